//! The axes that SPZ fixes: right, up, back. Those of 3DGS PLY are right, down, front, half a turn about x away.

use artgs_core::Splats;

/// Sign of each coefficient of the spherical harmonics after half a turn about x: odd in the sum of the exponents of y and z.
const SIGNS: [f32; 16] = [1., -1., -1., 1., -1., 1., 1., -1., 1., -1., 1., -1., -1., 1., -1., 1.];

/// The same Gaussians in the axes of the other format: half a turn about x, of positions, rotations and harmonics alike. Twice
/// it changes nothing.
pub(super) fn between_ply_and_spz(splats: &Splats) -> Splats {
    let mut out = splats.clone();
    out.means.iter_mut().for_each(|[_, y, z]| (*y, *z) = (-*y, -*z));
    out.rotations.iter_mut().for_each(|[_, _, y, z]| (*y, *z) = (-*y, -*z));
    let stride = out.sh_stride().max(1);
    for sh in out.sh.chunks_exact_mut(stride) {
        // A degree above 3 is refused when it is written.
        for (rgb, sign) in sh.chunks_exact_mut(3).zip(SIGNS) {
            rgb.iter_mut().for_each(|v| *v *= sign);
        }
    }
    out
}
