//! Photos prepared for sampling, with the distance of each pixel to edges that make its colour unreliable.

use super::{BakeOptions, BakeView};
use crate::bake::zbuffer::depth_of;
use artgs_core::{DepthMap, Mesh};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Distance from the nearest edge at which pixels have full weight, pixels.
const FULL_TRUST: u8 = 8;
/// Least alpha of a pixel that shows only the object.
const OPAQUE: u8 = 250;
/// Least cosine between the normal and the direction to the camera.
const LEAST_COSINE: f64 = 0.1;

/// A view prepared for sampling at surface points.
pub(super) struct PreparedView<'a> {
    view: &'a BakeView<'a>,
    depth: Cow<'a, DepthMap>,
    /// Pixels to the nearest edge; 0 for pixels that do not show the part.
    clear: Vec<u8>,
    eye: DVec3,
    rotation: DMat3,
    translation: DVec3,
}

/// Colour of a surface point in one view.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// sRGB in [0, 255].
    pub(super) color: Vec3,
    /// Weight.
    pub(super) weight: f32,
}

/// Prepares all views; views without depth use the rendered depth of the mesh.
pub(super) fn prepare<'a>(views: &'a [BakeView<'a>], mesh: &Mesh, options: &BakeOptions) -> Vec<PreparedView<'a>> {
    let usable = |v: &&BakeView| v.is_whole();
    let views: Vec<&BakeView> = views.iter().filter(usable).collect();
    views.into_par_iter().map(|view| PreparedView::new(view, mesh, options)).collect()
}

impl<'a> PreparedView<'a> {
    fn new(view: &'a BakeView<'a>, mesh: &Mesh, options: &BakeOptions) -> Self {
        let depth = view.depth.map_or_else(|| Cow::Owned(depth_of(&view.camera, &[mesh])), Cow::Borrowed);
        let pose = view.camera.world_to_camera;
        Self {
            clear: clearance(view, &depth, options.jump as f32),
            depth,
            eye: view.camera.position(),
            rotation: pose.matrix(),
            translation: pose.translation,
            view,
        }
    }

    /// Colour of a point with a unit normal, if this view sees it.
    pub(super) fn sample(&self, point: DVec3, normal: DVec3, options: &BakeOptions) -> Option<Sample> {
        let ray = self.eye - point;
        let along = normal.dot(ray);
        if along <= 0.0 {
            return None;
        }
        let cosine = along / ray.length();
        if cosine < LEAST_COSINE {
            return None;
        }
        let k = &self.view.camera.intrinsics;
        let p = self.rotation * point + self.translation;
        if p.z <= 0.0 {
            return None;
        }
        let (x, y) = (k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy);
        if !(x >= 0.0 && y >= 0.0 && x < f64::from(k.width) && y < f64::from(k.height)) {
            return None;
        }
        let index = y as usize * k.width as usize + x as usize;
        let clear = self.clear[index];
        if clear == 0 {
            return None;
        }
        // The depth of an inclined surface changes within a pixel.
        let footprint = p.z / k.fx;
        let slope = (1.0 - cosine * cosine).sqrt() / cosine;
        if (f64::from(self.depth.at(index)) - p.z).abs() > options.tolerance + footprint * slope {
            return None;
        }
        let color = if clear >= 2 { self.bilinear(x, y) } else { self.pixel(index) };
        let weight = cosine.powf(options.sharpness) / (footprint * footprint) * self.view.weight;
        Some(Sample { color, weight: weight as f32 * trust(clear) })
    }

    fn pixel(&self, index: usize) -> Vec3 {
        let [r, g, b, _] = self.view.rgba[index];
        Vec3::new(r.into(), g.into(), b.into())
    }

    fn bilinear(&self, x: f64, y: f64) -> Vec3 {
        let k = &self.view.camera.intrinsics;
        let (w, h) = (k.width as usize, k.height as usize);
        let (x, y) = ((x - 0.5).max(0.0), (y - 0.5).max(0.0));
        let (i, j) = (x as usize, y as usize);
        let (right, below) = ((i + 1).min(w - 1), (j + 1).min(h - 1));
        let (u, v) = (x.fract() as f32, y.fract() as f32);
        let above = self.pixel(j * w + i).lerp(self.pixel(j * w + right), u);
        above.lerp(self.pixel(below * w + i).lerp(self.pixel(below * w + right), u), v)
    }
}

/// Weight by distance from edges: almost zero at edges, smoothly rising beyond two pixels.
fn trust(clear: u8) -> f32 {
    match clear {
        0 => 0.0,
        1 => 1e-4,
        2 => 1e-3,
        _ => {
            let t = f32::from(clear - 2) / f32::from(FULL_TRUST - 2);
            t * t
        }
    }
}

/// Distance of every pixel to the nearest jump of depth, rim of the mask, change of label or border of the image, in pixels
/// (1: adjacent, at most [`FULL_TRUST`]); 0 for pixels that do not show the part.
fn clearance(view: &BakeView, depth: &DepthMap, jump: f32) -> Vec<u8> {
    let k = &view.camera.intrinsics;
    let (w, h) = (k.width as usize, k.height as usize);
    let shows = |i: usize| {
        view.rgba[i][3] >= OPAQUE && depth.counts()[i] > 0 && view.labels.is_none_or(|(labels, part)| labels[i] == part)
    };
    let mut clear: Vec<u8> = (0..w * h).map(|i| if shows(i) { FULL_TRUST } else { 0 }).collect();
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
    fn trust_grows_with_the_distance_from_edges() {
        let mut clear = vec![FULL_TRUST; 30 * 20];
        clear[10 * 30 + 12] = 0;
        spread(&mut clear, 30, 20);
        assert_eq!([12, 13, 14, 17].map(|x| clear[10 * 30 + x]), [0, 1, 2, 5]);
        assert_eq!((clear[0], clear[3 * 30 + 2], clear[29]), (1, 3, 1));
        assert!((0..FULL_TRUST).all(|d| trust(d) < trust(d + 1)) && trust(FULL_TRUST) == 1.0);
    }
}
