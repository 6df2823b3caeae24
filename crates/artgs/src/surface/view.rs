//! Depth maps as fusion reads them: the use of each pixel, how obliquely it looks, and how deep each tile reaches.

use super::tsdf::TsdfParams;
use artgs_core::{Camera, Intrinsics, Rigid};
use glam::DVec3;
use std::borrow::Cow;

/// Label of pixels that show no part.
pub const BACKGROUND: u16 = u16::MAX;

/// One posed depth map of one state. Everything that fuses or paints meshes reads these.
#[derive(Clone, Debug)]
pub struct FusionView<'a> {
    /// Camera in the frame of the mesh: the world, or the canonical frame of a part after [`FusionView::moved_with`].
    pub camera: Camera,
    /// Planar depth, scene units, `[height * width]`, 0 where there is none.
    pub depth: Cow<'a, [f32]>,
    /// Straight colours, `[height * width]`; none in any view leaves the meshes uncoloured.
    pub rgba: Option<Cow<'a, [[u8; 4]]>>,
    /// Part of every pixel, `[height * width]`, [`BACKGROUND`] for none. Without labels every pixel with depth belongs to
    /// the surface, and the others say nothing.
    pub labels: Option<Cow<'a, [u16]>>,
    /// True for pixels whose depth, or the background that they show, was derived, `[height * width]`; none in views whose depth was measured
    /// everywhere.
    pub derived: Option<Cow<'a, [bool]>>,
}

/// Which pixels of labelled views are samples of the fused surface. Measured depth of all other parts shows where space is empty.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// The part to fuse; none: all parts.
    pub part: Option<usize>,
    /// The rays of background pixels are empty; otherwise these pixels are ignored.
    pub carve_background: bool,
}

impl Selection {
    /// All parts; rays of background pixels are empty.
    pub const ALL: Self = Self { part: None, carve_background: true };
}

/// What one pixel contributes to a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PixelUse {
    /// Its depth is a sample of the surface; space before it is empty.
    Surface,
    /// Space before its depth is empty (all of the ray if the depth is 0); nothing is known at or behind it.
    FreeOnly,
    /// Nothing.
    Ignore,
}

impl<'a> FusionView<'a> {
    /// A view without colours and labels.
    pub fn new(camera: Camera, depth: impl Into<Cow<'a, [f32]>>) -> Self {
        Self { camera, depth: depth.into(), rgba: None, labels: None, derived: None }
    }
}

impl FusionView<'_> {
    /// Use and depth of a pixel by index; depths that are not positive and finite are no samples.
    #[inline]
    pub(super) fn pixel(&self, index: usize, selection: Selection) -> (PixelUse, f32) {
        let depth = self.depth[index];
        let valid = depth > 0.0 && depth.is_finite();
        let wanted = |label: u16| selection.part.is_none_or(|part| usize::from(label) == part);
        let pixel_use = match self.labels.as_ref().map(|labels| labels[index]) {
            None => PixelUse::Surface,
            Some(BACKGROUND) if selection.carve_background => PixelUse::FreeOnly,
            Some(BACKGROUND) => PixelUse::Ignore,
            Some(_) if depth.is_nan() || depth <= 0.0 => PixelUse::Ignore,
            Some(label) if wanted(label) => PixelUse::Surface,
            Some(_) if self.derived.as_ref().is_some_and(|derived| derived[index]) => PixelUse::Ignore,
            Some(_) => PixelUse::FreeOnly,
        };
        match pixel_use {
            PixelUse::Surface if valid => (PixelUse::Surface, depth),
            PixelUse::FreeOnly => (PixelUse::FreeOnly, if valid { depth } else { f32::INFINITY }),
            _ => (PixelUse::Ignore, 0.0),
        }
    }

    /// The same view without copies of its images.
    pub fn borrowed(&self) -> FusionView<'_> {
        FusionView {
            camera: self.camera,
            depth: Cow::Borrowed(&self.depth),
            rgba: self.rgba.as_deref().map(Cow::Borrowed),
            labels: self.labels.as_deref().map(Cow::Borrowed),
            derived: self.derived.as_deref().map(Cow::Borrowed),
        }
    }

    /// The same view after the world of the camera has been moved: `motion` leads from the frame of the mesh to the
    /// world frame of the state.
    pub fn moved_with(&self, motion: &Rigid) -> FusionView<'_> {
        FusionView { camera: self.camera.moved_with(motion), ..self.borrowed() }
    }

    /// True if every buffer has the size of the camera's image.
    pub fn is_consistent(&self) -> bool {
        let n = self.camera.intrinsics.width as usize * self.camera.intrinsics.height as usize;
        let (rgba, labels, derived) = (self.rgba.as_deref(), self.labels.as_deref(), self.derived.as_deref());
        let optional = [rgba.map(<[_]>::len), labels.map(<[_]>::len), derived.map(<[_]>::len)];
        self.depth.len() == n && optional.into_iter().flatten().all(|len| len == n)
    }
}

/// Pixels along one side of a culling tile.
const TILE: usize = 8;

/// Smallest obliqueness that still shortens a distance; keeps the reach of a sample along its ray below twice the band.
pub(super) const MIN_SCALE: f32 = 0.5;

/// What a view shows of a whole block of voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    /// Out of sight or hidden.
    Nothing,
    /// Empty throughout.
    Free,
    /// Ask for every voxel.
    Mixed,
}

/// A depth map ready for fusion.
pub(super) struct Prepared {
    pub(super) to_camera: Rigid,
    pub(super) intrinsics: Intrinsics,
    width: usize,
    height: usize,
    /// Code and slant of every pixel. Code: positive is the depth of a surface, negative is minus the depth up to which
    /// the ray is empty, 0 is nothing. Slant: what turns a depth difference into a distance, that is the cosine between
    /// ray and normal times the length of the ray at depth 1; negative where depth was derived.
    pixels: Vec<[f32; 2]>,
    tiles_across: usize,
    /// Least and greatest |code| per tile and its rim of one pixel.
    tiles: Vec<[f32; 2]>,
    jump: f32,
}

impl Prepared {
    pub(super) fn new(view: &FusionView, selection: Selection, params: &TsdfParams) -> Self {
        let k = view.camera.intrinsics;
        let (width, height) = (k.width as usize, k.height as usize);
        let jump = params.jump as f32;
        let mut code: Vec<f32> = (0..width * height)
            .map(|i| match view.pixel(i, selection) {
                (PixelUse::Surface, d) => d,
                (PixelUse::FreeOnly, d) => -d,
                (PixelUse::Ignore, _) => 0.0,
            })
            .collect();
        if jump > 0.0 {
            drop_flying_pixels(&mut code, width, height, jump);
        }
        drop_free_rim(&mut code, width, height);
        let mut pixels: Vec<[f32; 2]> = code.iter().copied().zip(slants(&code, &k)).map(<[f32; 2]>::from).collect();
        let mut reach: Vec<[f32; 2]> = code.iter().map(|c| [c.abs(); 2]).collect();
        if let Some(derived) = &view.derived {
            // A weight below zero: space before a derived surface is not seen to be empty, and rays of derived backgrounds are hardly.
            for i in (0..code.len()).filter(|&i| derived[i]) {
                (pixels[i][1], reach[i][0]) = (-pixels[i][1], 0.0);
            }
        }
        let tiles = tiles(&reach, width, height);
        let jump = if jump > 0.0 { jump } else { f32::INFINITY };
        let tiles_across = width.div_ceil(TILE);
        Self { to_camera: view.camera.world_to_camera, intrinsics: k, width, height, pixels, tiles_across, tiles, jump }
    }

    /// Verdict on a ball around `centre` (camera frame); `front` and `behind` bound the reach of a sample along its ray.
    #[inline(always)]
    pub(super) fn verdict(&self, centre: DVec3, radius: f64, front: f32, behind: f32) -> Verdict {
        let (near, far) = (centre.z - radius, centre.z + radius);
        if far <= 0.0 {
            return Verdict::Nothing;
        }
        if near <= 1e-3 * radius {
            return Verdict::Mixed;
        }
        let k = &self.intrinsics;
        let span = |x: f64, f: f64, c: f64| {
            let (lo, hi) = (x - radius, x + radius);
            (f * (lo / near).min(lo / far) + c - 1.0, f * (hi / near).max(hi / far) + c + 1.0)
        };
        let (u0, u1) = span(centre.x, k.fx, k.cx);
        let (v0, v1) = span(centre.y, k.fy, k.cy);
        let (w, h) = (self.width as f64, self.height as f64);
        if u1 <= 0.0 || v1 <= 0.0 || u0 >= w || v0 >= h {
            return Verdict::Nothing;
        }
        let inside = u0 >= 0.0 && v0 >= 0.0 && u1 < w && v1 < h;
        let tile = |x: f64, size: usize| (x.max(0.0) as usize).min(size - 1) / TILE;
        let (mut least, mut greatest) = (f32::INFINITY, 0.0f32);
        for ty in tile(v0, self.height)..=tile(v1, self.height) {
            for tx in tile(u0, self.width)..=tile(u1, self.width) {
                let [lo, hi] = self.tiles[ty * self.tiles_across + tx];
                least = least.min(lo);
                greatest = greatest.max(hi);
            }
        }
        if near as f32 > greatest + behind {
            Verdict::Nothing
        } else if inside && (far as f32) < least - front {
            Verdict::Free
        } else {
            Verdict::Mixed
        }
    }

    /// Code and slant of a pixel inside the image.
    #[inline(always)]
    pub(super) fn nearest(&self, x: i32, y: i32) -> [f32; 2] {
        self.pixels[y as usize * self.width + x as usize]
    }

    /// Depth at continuous pixel coordinates that lie in the pixel (x, y), whose code `own` is a depth: interpolated
    /// between the four nearest samples if they are of one surface, else `own`.
    #[inline(always)]
    pub(super) fn interpolated(&self, u: f32, v: f32, x: i32, y: i32, own: f32) -> f32 {
        // From the pixel's corner to the lattice of pixel centres.
        let shift = |c: f32, i: i32| {
            let f = c - i as f32;
            if f >= 0.5 { (i, f - 0.5) } else { (i - 1, f + 0.5) }
        };
        let ((x, fx), (y, fy)) = (shift(u, x), shift(v, y));
        if x < 0 || y < 0 || x as usize + 1 >= self.width || y as usize + 1 >= self.height {
            return own;
        }
        let i = y as usize * self.width + x as usize;
        let (above, below) = (&self.pixels[i..i + 2], &self.pixels[i + self.width..i + self.width + 2]);
        let ([a, b], [c, d]) = ([above[0][0], above[1][0]], [below[0][0], below[1][0]]);
        let (lo, hi) = (a.min(b).min(c.min(d)), a.max(b).max(c.max(d)));
        if lo <= 0.0 || hi - lo > self.jump {
            return own;
        }
        let (top, bottom) = (a + (b - a) * fx, c + (d - c) * fx);
        top + (bottom - top) * fy
    }
}

/// Drops samples that hang between a nearer and a farther neighbour, more than `jump` from both: mixtures of two
/// surfaces, or surfaces too steep to trust. A thin bar before a wall stays.
fn drop_flying_pixels(code: &mut [f32], width: usize, height: usize, jump: f32) {
    let before = code.to_vec();
    let between =
        |a: f32, d: f32, b: f32| a > 0.0 && b > 0.0 && (d - a).abs().min((b - d).abs()) > jump && (d > a) == (b > d);
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            let d = before[i];
            let flying = d > 0.0
                && ((x > 0 && x + 1 < width && between(before[i - 1], d, before[i + 1]))
                    || (y > 0 && y + 1 < height && between(before[i - width], d, before[i + width])));
            if flying {
                code[i] = 0.0;
            }
        }
    }
}

/// Drops carving pixels that touch a surface pixel: half a pixel off, they would carve into the silhouette.
fn drop_free_rim(code: &mut [f32], width: usize, height: usize) {
    if code.iter().all(|c| *c >= 0.0) {
        return;
    }
    let surface: Vec<bool> = code.iter().map(|c| *c > 0.0).collect();
    for y in 0..height {
        for x in 0..width {
            let i = y * width + x;
            if code[i] >= 0.0 {
                continue;
            }
            let rows = y.saturating_sub(1)..(y + 2).min(height);
            let touches = |r: usize| (x.saturating_sub(1)..(x + 2).min(width)).any(|c| surface[r * width + c]);
            if rows.into_iter().any(touches) {
                code[i] = 0.0;
            }
        }
    }
}

/// `1 / |n|` with `n = (-a, -b, 1 + a x + b y)`, the normal scaled so that the ray `(x, y, 1)` has product 1 with it;
/// `a = f_x z_u / z`, `b = f_y z_v / z`, one-sided differences on the smoother side.
fn slants(code: &[f32], k: &Intrinsics) -> Vec<f32> {
    let (width, height) = (k.width as usize, k.height as usize);
    let (fx, fy, cx, cy) = (k.fx as f32, k.fy as f32, k.cx as f32, k.cy as f32);
    let smoother = |d: f32, before: f32, after: f32| {
        let (p, q) = (d - before, after - d);
        match (before > 0.0, after > 0.0) {
            (true, true) => {
                if p.abs() < q.abs() {
                    p
                } else {
                    q
                }
            }
            (true, false) => p,
            (false, true) => q,
            (false, false) => 0.0,
        }
    };
    let at = |x: usize, y: usize| code[y * width + x];
    let mut out = vec![1.0; code.len()];
    for y in 0..height {
        for x in 0..width {
            let d = at(x, y);
            if d <= 0.0 {
                continue;
            }
            let du =
                smoother(d, if x > 0 { at(x - 1, y) } else { 0.0 }, if x + 1 < width { at(x + 1, y) } else { 0.0 });
            let dv =
                smoother(d, if y > 0 { at(x, y - 1) } else { 0.0 }, if y + 1 < height { at(x, y + 1) } else { 0.0 });
            let (a, b) = (fx * du / d, fy * dv / d);
            let (rx, ry) = ((x as f32 + 0.5 - cx) / fx, (y as f32 + 0.5 - cy) / fy);
            let nz = 1.0 + a * rx + b * ry;
            out[y * width + x] = 1.0 / (a * a + b * b + nz * nz).sqrt().max(1e-6);
        }
    }
    out
}

/// `reach` has the least and the greatest depth of every pixel up to which space may be empty.
fn tiles(reach: &[[f32; 2]], width: usize, height: usize) -> Vec<[f32; 2]> {
    let mut out = Vec::with_capacity(width.div_ceil(TILE) * height.div_ceil(TILE));
    for y0 in (0..height).step_by(TILE) {
        for x0 in (0..width).step_by(TILE) {
            let (mut lo, mut hi) = (f32::INFINITY, 0.0f32);
            for y in y0.saturating_sub(1)..(y0 + TILE + 1).min(height) {
                let row = y * width;
                for [least, greatest] in &reach[row + x0.saturating_sub(1)..row + (x0 + TILE + 1).min(width)] {
                    lo = lo.min(*least);
                    hi = hi.max(*greatest);
                }
            }
            out.push([lo, hi]);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flying_pixel_goes_and_a_thin_bar_stays() {
        let mut code = vec![1.0, 1.0, 1.5, 2.0, 2.0, 1.0, 2.0, 2.0];
        drop_flying_pixels(&mut code, 8, 1, 0.1);
        assert_eq!(code, [1.0, 1.0, 0.0, 2.0, 2.0, 1.0, 2.0, 2.0]);
    }

    #[test]
    fn carving_stops_one_pixel_before_a_surface() {
        let mut code = vec![-3.0, -3.0, 1.0, -3.0, f32::NEG_INFINITY];
        drop_free_rim(&mut code, 5, 1);
        assert_eq!(code, [-3.0, 0.0, 1.0, 0.0, f32::NEG_INFINITY]);
    }

    #[test]
    fn slant_turns_depth_differences_into_distances_to_a_plane() {
        let k = Intrinsics { fx: 90.0, fy: 110.0, cx: 20.0, cy: 15.0, width: 40, height: 30 };
        let n = DVec3::new(0.4, -0.3, -0.8).normalize();
        let ray = |x: usize, y: usize| DVec3::new((x as f64 + 0.5 - k.cx) / k.fx, (y as f64 + 0.5 - k.cy) / k.fy, 1.0);
        let code: Vec<f32> = (0..1200).map(|i| (-2.0 / n.dot(ray(i % 40, i / 40))) as f32).collect();
        let slant = slants(&code, &k);
        for (x, y) in [(5, 7), (20, 15), (35, 25)] {
            let truth = n.dot(ray(x, y)).abs();
            assert!((f64::from(slant[y * 40 + x]) - truth).abs() < 0.01 * truth);
        }
    }
}
