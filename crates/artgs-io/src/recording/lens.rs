//! Intrinsics of recorded images with lens distortion, and its removal.

use super::pixels::Color;
use artgs_core::Intrinsics;
use glam::DVec2;

/// Lens distortion in normalised image coordinates (x / z, y / z).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Distortion {
    #[default]
    None,
    /// OpenCV's rational model.
    Radial {
        /// k1 to k6.
        k: [f64; 6],
        /// p1 and p2.
        p: [f64; 2],
    },
    /// Equidistant fisheye with k1 to k4, as in OpenCV.
    Fisheye([f64; 4]),
}

impl Distortion {
    /// From OpenCV's coefficients; none if all are 0.
    pub(super) fn radial(k: [f64; 6], p: [f64; 2]) -> Self {
        if k == [0.0; 6] && p == [0.0; 2] { Self::None } else { Self::Radial { k, p } }
    }

    fn apply(&self, at: DVec2) -> DVec2 {
        match self {
            Self::None => at,
            Self::Radial { k, p } => {
                let (x, y, r2) = (at.x, at.y, at.length_squared());
                let factor =
                    (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[2]))) / (1.0 + r2 * (k[3] + r2 * (k[4] + r2 * k[5])));
                at * factor
                    + DVec2::new(
                        2.0 * p[0] * x * y + p[1] * (r2 + 2.0 * x * x),
                        p[0] * (r2 + 2.0 * y * y) + 2.0 * p[1] * x * y,
                    )
            }
            Self::Fisheye(k) => {
                let r = at.length();
                let angle = r.atan();
                let a2 = angle * angle;
                let bent = angle * (1.0 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3]))));
                if r < 1e-9 { at } else { at * (bent / r) }
            }
        }
    }

    /// The undistorted position of a distorted one by Newton's method; none where the model folds over.
    fn invert(&self, distorted: DVec2) -> Option<DVec2> {
        const STEP: f64 = 1e-6;
        let mut at = distorted;
        for _ in 0..50 {
            let miss = self.apply(at) - distorted;
            if miss.length() < 1e-10 {
                return Some(at).filter(|a| a.length() < WIDEST);
            }
            let dx = (self.apply(at + DVec2::new(STEP, 0.0)) - self.apply(at - DVec2::new(STEP, 0.0))) / (2.0 * STEP);
            let dy = (self.apply(at + DVec2::new(0.0, STEP)) - self.apply(at - DVec2::new(0.0, STEP))) / (2.0 * STEP);
            let determinant = dx.perp_dot(dy);
            // A determinant near zero or below is where the model folds over.
            if determinant <= 1e-6 {
                return None;
            }
            at -= DVec2::new(miss.perp_dot(dy), dx.perp_dot(miss)) / determinant;
        }
        None
    }
}

/// Largest distance from the axis of an undistorted image at distance 1: 78 degrees.
const WIDEST: f64 = 4.7;

/// Intrinsics as files state them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lens {
    /// Focal lengths, pixels.
    pub(super) focal: DVec2,
    /// Principal point, pixels; the centre of the top left pixel is (0.5, 0.5). None: the image centre.
    pub(super) center: Option<DVec2>,
    /// Size of the images that the values belong to; none if the file does not state it.
    pub(super) size: Option<(u32, u32)>,
    pub(super) distortion: Distortion,
}

impl Lens {
    /// Without distortion; width and height 0 if they are unknown.
    pub(super) fn pinhole(k: &Intrinsics) -> Self {
        let size = (k.width > 0 && k.height > 0).then_some((k.width, k.height));
        let (focal, center) = (DVec2::new(k.fx, k.fy), Some(DVec2::new(k.cx, k.cy)));
        Self { focal, center, size, distortion: Distortion::None }
    }

    /// Intrinsics of an image of this size; the size must be a multiple of the stated one. The error says what is wrong.
    pub(super) fn intrinsics(&self, width: u32, height: u32) -> Result<Intrinsics, String> {
        let (w, h) = self.size.unwrap_or((width, height));
        if !same_shape((w, h), (width, height)) {
            return Err(format!(
                "the image is {width}x{height}, its intrinsics are for {w}x{h}; give intrinsics of these images"
            ));
        }
        let center = self.center.unwrap_or(DVec2::new(f64::from(w), f64::from(h)) * 0.5);
        let inside = (0.0..f64::from(w)).contains(&center.x) && (0.0..f64::from(h)).contains(&center.y);
        if !inside || self.focal.min_element() <= 0.0 || !self.focal.is_finite() {
            return Err(format!(
                "focal lengths {:.1} {:.1} and principal point {:.1} {:.1} do not belong to an image of {w}x{h}; correct \
                 the intrinsics, or use images of the size that they were computed for",
                self.focal.x, self.focal.y, center.x, center.y
            ));
        }
        let (focal, center) = (self.focal, center);
        Ok(Intrinsics { fx: focal.x, fy: focal.y, cx: center.x, cy: center.y, width: w, height: h }
            .resized(width, height))
    }
}

/// True if two image sizes have the same aspect ratio, up to rounding of the smaller one.
pub(super) fn same_shape(a: (u32, u32), b: (u32, u32)) -> bool {
    let (aw, ah, bw, bh) = (f64::from(a.0), f64::from(a.1), f64::from(b.0), f64::from(b.1));
    let smallest = aw.min(ah).min(bw).min(bh).max(1.0);
    (aw * bh / (ah * bw) - 1.0).abs() < 0.005 + 1.0 / smallest
}

/// Where the pixels of an image without distortion come from.
pub(super) struct Undistortion {
    /// Pinhole intrinsics of the image without distortion.
    pub(super) intrinsics: Intrinsics,
    /// Position of every pixel in the distorted image, row-major.
    sources: Vec<DVec2>,
}

/// Largest coefficient of a lens: rational models of fisheyes reach some tens.
const MOST_DISTORTION: f64 = 1e4;

impl Undistortion {
    /// For a distorted image with intrinsics `k`. The new image has the same size and shows the largest rectangle that the
    /// distorted image fills. The error says why there is none.
    pub(super) fn new(k: &Intrinsics, distortion: &Distortion) -> Result<Self, String> {
        let coefficients = match distortion {
            Distortion::None => Vec::new(),
            Distortion::Radial { k, p } => [k.as_slice(), p].concat(),
            Distortion::Fisheye(k) => k.to_vec(),
        };
        if let Some(wrong) = coefficients.iter().find(|c| c.abs() > MOST_DISTORTION || c.is_nan()) {
            return Err(format!(
                "a coefficient of lens distortion is {wrong:e}; no lens has that, correct the coefficients"
            ));
        }
        let (w, h) = (f64::from(k.width), f64::from(k.height));
        let undistorted = |x: f64, y: f64| {
            let at = DVec2::new((x - k.cx) / k.fx, (y - k.cy) / k.fy);
            distortion.invert(at).ok_or_else(|| {
                "the lens distortion cannot be inverted at the image border; check its coefficients, or undistort and crop \
                 the images first"
                    .to_string()
            })
        };
        let (mut low, mut high) = (DVec2::NEG_INFINITY, DVec2::INFINITY);
        const SAMPLES: u32 = 64;
        for i in 0..=SAMPLES {
            let s = f64::from(i) / f64::from(SAMPLES);
            low.x = low.x.max(undistorted(0.5, s * h)?.x);
            high.x = high.x.min(undistorted(w - 0.5, s * h)?.x);
            low.y = low.y.max(undistorted(s * w, 0.5)?.y);
            high.y = high.y.min(undistorted(s * w, h - 0.5)?.y);
        }
        if (high - low).min_element() <= 0.0 {
            return Err("the lens distortion leaves no image; check its coefficients".into());
        }
        // Centres of the border pixels lie on the rectangle.
        let focal = DVec2::new(w - 1.0, h - 1.0) / (high - low);
        let center = DVec2::splat(0.5) - focal * low;
        let intrinsics =
            Intrinsics { fx: focal.x, fy: focal.y, cx: center.x, cy: center.y, width: k.width, height: k.height };
        let pixels = (0..k.height).flat_map(|y| (0..k.width).map(move |x| DVec2::new(x.into(), y.into()) + 0.5));
        let source = |pixel: DVec2| {
            let at = distortion.apply((pixel - center) / focal);
            DVec2::new(k.fx * at.x + k.cx, k.fy * at.y + k.cy)
        };
        Ok(Self { intrinsics, sources: pixels.map(source).collect() })
    }

    /// Colours, interpolated linearly.
    pub(super) fn color(&self, image: &Color) -> Color {
        let rgba = self.sources.iter().map(|s| bilinear(image, *s)).collect();
        Color { rgba, ..*image }
    }

    /// Index of the nearest pixel of the distorted image for every pixel.
    pub(super) fn nearest(&self) -> impl Iterator<Item = usize> {
        let (w, h) = (self.intrinsics.width as usize, self.intrinsics.height as usize);
        self.sources.iter().map(move |s| (s.y as usize).min(h - 1) * w + (s.x as usize).min(w - 1))
    }
}

fn bilinear(image: &Color, at: DVec2) -> [u8; 4] {
    let (w, h) = (image.width as usize, image.height as usize);
    let axis = |v: f64, n: usize| {
        let v = (v - 0.5).clamp(0.0, (n - 1) as f64);
        (v as usize, (v as usize + 1).min(n - 1), (v - v.floor()) as f32)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (axis(at.x, w), axis(at.y, h));
    let mix = |a: [u8; 4], b: [u8; 4], f: f32| -> [f32; 4] {
        std::array::from_fn(|c| f32::from(a[c]) * (1.0 - f) + f32::from(b[c]) * f)
    };
    let (top, bottom) = (
        mix(image.rgba[y0 * w + x0], image.rgba[y0 * w + x1], fx),
        mix(image.rgba[y1 * w + x0], image.rgba[y1 * w + x1], fx),
    );
    std::array::from_fn(|c| (top[c] * (1.0 - fy) + bottom[c] * fy + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: Intrinsics = Intrinsics { fx: 100.0, fy: 110.0, cx: 78.0, cy: 61.0, width: 160, height: 120 };

    fn models() -> [Distortion; 3] {
        [
            Distortion::radial([-0.12, 0.03, 0.001, 0.01, 0.0, 0.002], [0.001, -0.002]),
            Distortion::radial([0.08, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0]),
            Distortion::Fisheye([0.02, -0.004, 0.0, 0.0]),
        ]
    }

    #[test]
    fn inversion_is_exact() {
        for model in models() {
            for at in [DVec2::new(0.6, -0.4), DVec2::new(-0.2, 0.5), DVec2::ZERO] {
                let back = model.invert(model.apply(at)).unwrap();
                assert!(back.distance(at) < 1e-8, "{model:?} {at} {back}");
            }
        }
    }

    /// An image whose colour is its distorted position: after removal a pixel has the colour of where its ray was recorded.
    #[test]
    fn rays_keep_their_colour() {
        let pixels = (0..120_u8).flat_map(|y| (0..160_u8).map(move |x| [x, y, 0, 255])).collect();
        let image = Color::new(160, 120, pixels);
        for model in models() {
            let undistortion = Undistortion::new(&K, &model).unwrap();
            let k = undistortion.intrinsics;
            let flat = undistortion.color(&image);
            for (x, y) in [(0, 0), (159, 0), (80, 60), (30, 100), (159, 119)] {
                let ray = DVec2::new((x as f64 + 0.5 - k.cx) / k.fx, (y as f64 + 0.5 - k.cy) / k.fy);
                let bent = model.apply(ray);
                let source = DVec2::new(K.fx * bent.x + K.cx, K.fy * bent.y + K.cy);
                assert!(source.min_element() > 0.4 && source.x < 159.6 && source.y < 119.6, "{source}");
                let [r, g, _, _] = flat.rgba[y * 160 + x];
                assert!((f64::from(r) + 0.5 - source.x).abs() < 0.6 && (f64::from(g) + 0.5 - source.y).abs() < 0.6);
            }
            assert_eq!(undistortion.nearest().count(), 160 * 120);
        }
    }

    #[test]
    fn distortion_that_folds_over_is_refused() {
        let message =
            Undistortion::new(&K, &Distortion::radial([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2])).err().unwrap();
        assert!(message.contains("cannot be inverted"), "{message}");
    }

    #[test]
    fn intrinsics_follow_the_image_size() {
        let lens = Lens::pinhole(&K);
        assert_eq!(lens.intrinsics(80, 60).unwrap(), K.resized(80, 60));
        assert!(lens.intrinsics(120, 160).unwrap_err().contains("160x120"));
        let unknown = Lens { size: None, ..lens };
        assert!(unknown.intrinsics(64, 48).unwrap_err().contains("principal point"));
    }
}
