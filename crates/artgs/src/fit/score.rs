//! How well Gaussians explain photographs they were not fitted to.

use super::images::{DepthPick, Rect, TrainImage};
use super::ssim::Ssim;
use artgs_core::{Camera, Splats, State, View};
use artgs_raster::{Frame, Rasterizer, RenderOptions, SplatView};

/// Scores of one view over black.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewScore {
    /// Peak signal to noise ratio, decibel.
    pub psnr: f64,
    /// Structural similarity of the whole image.
    pub ssim: f64,
}

/// Draws Gaussians over black with all their harmonics.
pub fn render_view<'a>(rasterizer: &'a mut Rasterizer, splats: &Splats, camera: &Camera) -> &'a Frame {
    let options = RenderOptions { sh_degree: splats.sh_degree, ..RenderOptions::default() };
    rasterizer.forward(SplatView::from(splats), camera, &options)
}

/// Peak signal to noise ratio of a mean squared error of values in [0, 1], decibel, at most 120.
pub fn psnr_of_mse(mse: f64) -> f64 {
    -10.0 * mse.max(1e-12).log10()
}

/// `-10 log10(mean (a - b)^2)` of values in [0, 1], at most 120.
pub fn psnr(a: &[f32], b: &[f32]) -> f64 {
    let square = |(a, b): (&f32, &f32)| f64::from(a - b).powi(2);
    psnr_of_mse(a.iter().zip(b).map(square).sum::<f64>() / a.len().max(1) as f64)
}

/// Straight RGBA over black, planar `[3][height * width]`.
pub(crate) fn over_black(view: &View) -> Vec<f32> {
    let blend = |c: usize| view.rgba.iter().map(move |p| f32::from(p[c]) * f32::from(p[3]) / (255.0 * 255.0));
    (0..3).flat_map(blend).collect()
}

/// Scores every view at full size; renderings are clamped to [0, 1].
pub fn score_views(splats: &Splats, views: &[View]) -> Vec<ViewScore> {
    score_splats(SplatView::from(splats), splats.sh_degree, views)
}

/// Like [`score_views`], drawing borrowed Gaussians with harmonics up to `sh_degree`.
pub fn score_splats<'v>(
    splats: SplatView<'_>,
    sh_degree: usize,
    views: impl IntoIterator<Item = &'v View>,
) -> Vec<ViewScore> {
    let options = RenderOptions { sh_degree, ..RenderOptions::default() };
    let (mut rasterizer, mut ssim) = (Rasterizer::new(), Ssim::new());
    let (mut picture, mut unused) = (Vec::new(), Vec::new());
    let score = |view: &View| {
        let frame = rasterizer.forward(splats, &view.camera, &options);
        picture.clear();
        picture.extend(frame.rgb.iter().map(|v| v.clamp(0.0, 1.0)));
        unused.resize(picture.len(), 0.0);
        let truth = over_black(view);
        let (w, h) = view.size();
        let similarity = ssim.evaluate(&picture, &truth, (w, h), Rect::full(w, h), 0.0, &mut unused);
        ViewScore { psnr: psnr(&picture, &truth), ssim: similarity }
    };
    views.into_iter().map(score).collect()
}

/// Means of scores; zero for none.
pub fn mean_score(scores: &[ViewScore]) -> ViewScore {
    let n = scores.len().max(1) as f64;
    ViewScore {
        psnr: scores.iter().map(|s| s.psnr).sum::<f64>() / n,
        ssim: scores.iter().map(|s| s.ssim).sum::<f64>() / n,
    }
}

/// Mean absolute difference between rendered depth (divided by alpha) and measured depth, scene units, over the pixels
/// of all views that have both; none if there are none.
pub fn depth_error(splats: &Splats, views: &[View]) -> Option<f64> {
    let mut rasterizer = Rasterizer::new();
    let (mut sum, mut count) = (0.0, 0_usize);
    for view in views {
        let image = TrainImage::new(view, State::START, 1, DepthPick::Nearest);
        if image.depth.is_none() {
            continue;
        }
        let frame = render_view(&mut rasterizer, splats, &view.camera);
        let seen = (0..image.area()).map(|i| (i, image.depth_at(i)));
        for (i, z) in seen.filter(|&(i, z)| z > 0.0 && frame.alpha[i] > 0.5) {
            sum += f64::from((frame.depth[i] / frame.alpha[i] - z).abs());
            count += 1;
        }
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_of_a_constant_difference() {
        assert!((psnr(&[0.5; 10], &[0.6; 10]) - 20.0).abs() < 1e-5);
        assert_eq!(psnr(&[0.5; 10], &[0.5; 10]), 120.0);
    }
}
