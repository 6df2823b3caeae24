//! Photos prepared for all parts, with the distance of each pixel to edges that make its colour unreliable.

use crate::settings::BakeSettings;
use artgs_core::{DepthMap, Intrinsics};
use glam::Vec3;

/// A photo as a source of colours.
pub(crate) struct Photo<'a> {
    pub(super) rgba: &'a [[u8; 4]],
    pub(super) depth: &'a DepthMap,
    /// Not 0 for pixels whose depth was derived; none where it was measured everywhere.
    pub(super) derived: Option<&'a DepthMap>,
    /// Pixels to the nearest edge; 0 for pixels that do not show the object.
    pub(super) clear: Vec<u8>,
    pub(super) intrinsics: Intrinsics,
}

impl<'a> Photo<'a> {
    /// Straight colours and planar depth, both `[height * width]`; alpha is the mask of the object. A step of depth of `jump`
    /// between pixels (scene units) is an edge between two surfaces. None if a buffer does not have the size of the image.
    pub(crate) fn new(
        rgba: &'a [[u8; 4]],
        depth: &'a DepthMap,
        intrinsics: Intrinsics,
        (jump, settings): (f64, &BakeSettings),
    ) -> Option<Self> {
        let pixels = intrinsics.width as usize * intrinsics.height as usize;
        let whole = rgba.len() == pixels && depth.len() == pixels;
        let clear = || clearance(rgba, depth, &intrinsics, (jump as f32, settings));
        whole.then(|| Self { clear: clear(), rgba, depth, derived: None, intrinsics })
    }

    /// The same with pixels whose depth was derived.
    pub(crate) fn with_derived(self, derived: Option<&'a DepthMap>) -> Self {
        Self { derived: derived.filter(|map| map.len() == self.depth.len()), ..self }
    }

    /// True for pixels whose depth was not derived.
    pub(super) fn is_measured(&self, index: usize) -> bool {
        self.derived.is_none_or(|derived| derived.counts()[index] == 0)
    }

    pub(super) fn pixel(&self, index: usize) -> Vec3 {
        let [r, g, b, _] = self.rgba[index];
        Vec3::new(r.into(), g.into(), b.into())
    }

    pub(super) fn bilinear(&self, x: f64, y: f64) -> Vec3 {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        let (x, y) = ((x - 0.5).max(0.0), (y - 0.5).max(0.0));
        let (i, j) = (x as usize, y as usize);
        let (right, below) = ((i + 1).min(w - 1), (j + 1).min(h - 1));
        let (u, v) = (x.fract() as f32, y.fract() as f32);
        let above = self.pixel(j * w + i).lerp(self.pixel(j * w + right), u);
        above.lerp(self.pixel(below * w + i).lerp(self.pixel(below * w + right), u), v)
    }
}

/// Distance of every pixel to the nearest jump of depth, rim of the mask or border of the image, in pixels (1: adjacent, at
/// most that of full trust); 0 for pixels that do not show the object.
fn clearance(rgba: &[[u8; 4]], depth: &DepthMap, k: &Intrinsics, (jump, settings): (f32, &BakeSettings)) -> Vec<u8> {
    let BakeSettings { opaque, full_trust, .. } = *settings;
    let (w, h) = (k.width as usize, k.height as usize);
    let shows = |i: usize| rgba[i][3] >= opaque && depth.counts()[i] > 0;
    let mut clear: Vec<u8> = (0..w * h).map(|i| if shows(i) { full_trust } else { 0 }).collect();
    let depths: Vec<f32> = depth.iter().collect();
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            if x + 1 < w && is_depth_edge(&depths, i, 1, [x > 0, x + 2 < w], jump) {
                clear[i] = clear[i].min(1);
                clear[i + 1] = clear[i + 1].min(1);
            }
            if y + 1 < h && is_depth_edge(&depths, i, w, [y > 0, y + 2 < h], jump) {
                clear[i] = clear[i].min(1);
                clear[i + w] = clear[i + w].min(1);
            }
        }
    }
    spread(&mut clear, w, h);
    clear
}

/// True if pixels `i` and `i + step` show two surfaces. The depth of an inclined surface changes between pixels, too, so the
/// test is for a change of slope. `has`: whether there are pixels before and after the two.
fn is_depth_edge(depths: &[f32], i: usize, step: usize, has: [bool; 2], jump: f32) -> bool {
    let change = depths[i + step] - depths[i];
    if change.abs() <= jump {
        return false;
    }
    let before = if has[0] { depths[i] - depths[i - step] } else { 0.0 };
    let after = if has[1] { depths[i + 2 * step] - depths[i + step] } else { 0.0 };
    (change - before).abs().min((change - after).abs()) > jump
}

/// Chessboard distance: each value at most one more than that of any neighbour, pixels outside of the image counting 0.
fn spread(clear: &mut [u8], w: usize, h: usize) {
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let edge = x == 0 || y == 0 || x + 1 == w;
            let near =
                if edge { 0 } else { clear[i - 1].min(clear[i - w - 1]).min(clear[i - w]).min(clear[i - w + 1]) };
            clear[i] = clear[i].min(near + 1);
        }
    }
    for y in (0..h).rev() {
        for x in (0..w).rev() {
            let i = y * w + x;
            let edge = x == 0 || y + 1 == h || x + 1 == w;
            let near =
                if edge { 0 } else { clear[i + 1].min(clear[i + w - 1]).min(clear[i + w]).min(clear[i + w + 1]) };
            clear[i] = clear[i].min(near + 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_count_their_distance_to_the_nearest_edge() {
        let mut clear = vec![8; 30 * 20];
        clear[10 * 30 + 12] = 0;
        spread(&mut clear, 30, 20);
        assert_eq!([12, 13, 14, 17].map(|x| clear[10 * 30 + x]), [0, 1, 2, 5]);
        assert_eq!((clear[0], clear[3 * 30 + 2], clear[29]), (1, 3, 1));
    }
}
