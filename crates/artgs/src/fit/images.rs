//! Training images, prepared once: resampled, kept small, with the rectangle the object fills.

use artgs_core::capture::OBJECT_ALPHA;
use artgs_core::{Camera, DepthMap, Intrinsics, State, View};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// A half-open rectangle of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub x0: usize,
    /// First row.
    pub y0: usize,
    /// One past the last column.
    pub x1: usize,
    /// One past the last row.
    pub y1: usize,
}

impl Rect {
    /// The whole image.
    pub fn full(width: usize, height: usize) -> Self {
        Self { x0: 0, y0: 0, x1: width, y1: height }
    }

    /// True if it holds no pixel.
    pub fn is_empty(&self) -> bool {
        self.x0 >= self.x1 || self.y0 >= self.y1
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        (self.x1 - self.x0) * (self.y1 - self.y0)
    }

    /// Grown by `margin` pixels on every side, within the image.
    pub fn grown(&self, margin: usize, width: usize, height: usize) -> Self {
        Self {
            x0: self.x0.saturating_sub(margin),
            y0: self.y0.saturating_sub(margin),
            x1: (self.x1 + margin).min(width),
            y1: (self.y1 + margin).min(height),
        }
    }
}

/// How the depth of a coarse pixel is chosen among those it covers; depths are never averaged across edges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthPick {
    /// The one at the middle (right and below for even factors), as the published code does.
    Nearest,
    /// The (lower) median of those that exist.
    #[default]
    Median,
}

/// One view as training sees it. At full size it borrows the pixels of the view: those of many fine views fill memory.
#[derive(Clone, Debug)]
pub struct TrainImage<'a> {
    /// State it was taken in.
    pub state: State,
    /// Pose and intrinsics at the size of this image.
    pub camera: Camera,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Straight colour and alpha, `[height * width]`.
    pub rgba: Cow<'a, [[u8; 4]]>,
    /// Planar depth, `[height * width]`, of the object only where the mask is at least [`OBJECT_ALPHA`]; see
    /// [`TrainImage::depth_at`].
    pub depth: Option<Cow<'a, DepthMap>>,
    /// Smallest rectangle around all pixels with alpha above 0; empty if there are none.
    pub object: Rect,
    /// Number of pixels the mask covers but that have no depth.
    pub without_depth: usize,
}

impl<'a> TrainImage<'a> {
    /// Resamples a view by an integer factor: colour weighted by alpha, alpha averaged, depth picked.
    /// Rows and columns that do not fill a coarse pixel are dropped at the right and bottom.
    pub fn new(view: &'a View, state: State, divisor: usize, pick: DepthPick) -> Self {
        if divisor <= 1 {
            let depth = view.depth.as_ref().map(Cow::Borrowed);
            return Self::of_pixels(view.camera, state, Cow::Borrowed(&view.rgba), depth);
        }
        Self::resampled(&view.camera, &view.rgba, view.depth.as_ref(), state, divisor, pick)
    }

    fn of_pixels(camera: Camera, state: State, rgba: Cow<'a, [[u8; 4]]>, depth: Option<Cow<'a, DepthMap>>) -> Self {
        let (width, height) = (camera.intrinsics.width as usize, camera.intrinsics.height as usize);
        let object = occupied(&rgba, width);
        let missing = |(p, count): &(&[u8; 4], &u16)| p[3] >= OBJECT_ALPHA && **count == 0;
        let without_depth = depth.as_ref().map_or(0, |depth| rgba.iter().zip(depth.counts()).filter(missing).count());
        Self { state, camera, width, height, rgba, depth, object, without_depth }
    }

    fn resampled(
        camera: &Camera,
        rgba: &[[u8; 4]],
        depth: Option<&DepthMap>,
        state: State,
        divisor: usize,
        pick: DepthPick,
    ) -> Self {
        let k = camera.intrinsics;
        let (w, h) = (k.width as usize, k.height as usize);
        let d = divisor.clamp(1, w.min(h).max(1));
        let (width, height) = (w / d, h / d);
        let s = d as f64;
        let (fx, fy, cx, cy) = (k.fx / s, k.fy / s, k.cx / s, k.cy / s);
        let intrinsics = Intrinsics { fx, fy, cx, cy, width: width as u32, height: height as u32 };
        let rgba = shrink_rgba(rgba, w, width, height, d);
        let depth = depth.map(|depth| Cow::Owned(shrink_depth(depth, &rgba, w, width, d, pick)));
        Self::of_pixels(Camera { intrinsics, ..*camera }, state, Cow::Owned(rgba), depth)
    }

    /// The same image resampled by an integer factor, with pixels of its own.
    pub fn smaller(&self, divisor: usize) -> TrainImage<'static> {
        TrainImage::resampled(&self.camera, &self.rgba, self.depth.as_deref(), self.state, divisor, DepthPick::Median)
    }

    /// Number of pixels.
    pub fn area(&self) -> usize {
        self.width * self.height
    }

    /// Depth of the object at a pixel, scene units; 0 where there is none or the mask is below one half.
    pub fn depth_at(&self, index: usize) -> f32 {
        match &self.depth {
            Some(depth) if self.rgba[index][3] >= OBJECT_ALPHA => depth.at(index),
            _ => 0.0,
        }
    }
}

/// Prepares all views of one state.
pub(crate) fn prepare(views: &[View], state: State, divisor: usize, pick: DepthPick) -> Vec<TrainImage<'_>> {
    views.par_iter().map(|v| TrainImage::new(v, state, divisor, pick)).collect()
}

fn shrink_rgba(rgba: &[[u8; 4]], from_width: usize, width: usize, height: usize, d: usize) -> Vec<[u8; 4]> {
    let mut out = Vec::with_capacity(width * height);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let mut sum = [0_u64; 4];
        let mut plain = [0_u64; 3];
        for row in 0..d {
            let at = (y * d + row) * from_width + x * d;
            for p in &rgba[at..at + d] {
                let a = u64::from(p[3]);
                for c in 0..3 {
                    sum[c] += a * u64::from(p[c]);
                    plain[c] += u64::from(p[c]);
                }
                sum[3] += a;
            }
        }
        let n = (d * d) as u64;
        let round = |v: u64, by: u64| ((v + by / 2) / by) as u8;
        let color = |c: usize| if sum[3] > 0 { round(sum[c], sum[3]) } else { round(plain[c], n) };
        out.push([color(0), color(1), color(2), round(sum[3], n)]);
    }
    out
}

fn shrink_depth(
    depth: &DepthMap,
    rgba: &[[u8; 4]],
    from_width: usize,
    width: usize,
    d: usize,
    pick: DepthPick,
) -> DepthMap {
    let counts = depth.counts();
    let mut found = Vec::with_capacity(d * d);
    let choose = |(i, pixel): (usize, &[u8; 4])| {
        if pixel[3] < OBJECT_ALPHA {
            return 0;
        }
        let (y, x) = (i / width * d, i % width * d);
        if pick == DepthPick::Nearest {
            return counts[(y + d / 2) * from_width + x + d / 2];
        }
        found.clear();
        for row in 0..d {
            let at = (y + row) * from_width + x;
            found.extend(counts[at..at + d].iter().filter(|&&v| v > 0));
        }
        found.sort_unstable();
        if found.is_empty() { 0 } else { found[(found.len() - 1) / 2] }
    };
    DepthMap::new(rgba.iter().enumerate().map(choose).collect(), depth.per_unit())
}

/// Smallest rectangle around the pixels whose alpha is above 0.
fn occupied(rgba: &[[u8; 4]], width: usize) -> Rect {
    let mut r = Rect { x0: usize::MAX, y0: usize::MAX, x1: 0, y1: 0 };
    for (i, _) in rgba.iter().enumerate().filter(|(_, p)| p[3] > 0) {
        let (x, y) = (i % width, i / width);
        r = Rect { x0: r.x0.min(x), y0: r.y0.min(y), x1: r.x1.max(x + 1), y1: r.y1.max(y + 1) };
    }
    if r.x1 == 0 { Rect::default() } else { r }
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::Rigid;

    fn view() -> View {
        let intrinsics = Intrinsics { fx: 8.0, fy: 9.0, cx: 2.5, cy: 2.0, width: 5, height: 4 };
        let mut rgba = vec![[10, 20, 30, 0]; 20];
        rgba[6] = [200, 100, 0, 255];
        rgba[7] = [100, 0, 0, 255];
        rgba[12] = [0, 60, 0, 255];
        rgba[13] = [0, 60, 8, 255];
        rgba[8] = [0, 60, 0, 100];
        let mut depth = vec![0; 20];
        depth[7] = 10;
        depth[8] = 2;
        depth[12] = 6;
        depth[13] = 4;
        let camera = Camera { intrinsics, world_to_camera: Rigid::IDENTITY };
        View { name: String::new(), camera, rgba, depth: Some(DepthMap::new(depth, 2.0)), derived: None }
    }

    #[test]
    fn shrinking_weights_colour_by_alpha_and_keeps_depth_sharp() {
        let view = view();
        let t = TrainImage::new(&view, State::END, 2, DepthPick::Median);
        assert_eq!((t.width, t.height), (2, 2));
        assert_eq!(t.rgba[0], [200, 100, 0, 64], "one opaque pixel of four keeps its colour");
        assert_eq!(t.object, Rect { x0: 0, y0: 0, x1: 2, y1: 2 });
        assert_eq!(
            (0..4).map(|i| t.depth_at(i)).collect::<Vec<_>>(),
            [0.0, 0.0, 0.0, 2.0],
            "below half alpha there is no depth"
        );
        let k = t.camera.intrinsics;
        assert_eq!((k.fx, k.fy, k.cx, k.cy), (4.0, 4.5, 1.25, 1.0));
        let nearest = TrainImage::new(&view, State::END, 2, DepthPick::Nearest).depth;
        assert_eq!(nearest.unwrap().counts(), [0; 4], "the middle pixel has no depth");
    }

    #[test]
    fn full_size_is_untouched() {
        let view = view();
        let t = TrainImage::new(&view, State::START, 1, DepthPick::Median);
        assert!(matches!((&t.rgba, &t.depth), (Cow::Borrowed(_), Some(Cow::Borrowed(_)))));
        assert_eq!(*t.rgba, *view.rgba);
        assert_eq!((t.depth_at(7), t.depth_at(8)), (5.0, 0.0), "below half alpha there is no depth");
        assert_eq!(t.object, Rect { x0: 1, y0: 1, x1: 4, y1: 3 });
    }
}
