//! Equalises photos: what each view shows brighter or darker than others, from points that several views show.
//!
//! First one gain per view and channel for all parts: exposure and white balance. Then for every part and view a gain that
//! depends linearly on the normal: the light on a part that moved, or a lamp that moves with the camera. Both have the mean 1 over
//! all that is seen, so that the overall brightness stays.

use super::BakeOptions;
use super::solve::{Row, conjugate_gradients, dot, solved};
use super::view::BakeView;
use crate::settings::GainSettings;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// How much brighter than others a view shows a part: logarithms of factors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Gain {
    /// Of each channel.
    channels: DVec3,
    /// Of all channels in this part: a constant and the slope along x, y and z of the normal, frame of the part.
    shading: [f64; 4],
}

impl Gain {
    /// The colour without the gain at a point with this unit normal, and the share of its weight that it keeps: what is
    /// changed much is less certain.
    pub(super) fn removed(&self, color: Vec3, normal: DVec3, settings: &GainSettings) -> (Vec3, f32) {
        let GainSettings { most, half, .. } = *settings;
        if *self == Self::default() {
            return (color, 1.0);
        }
        let shading = dot(&self.shading, &basis(normal)).clamp(-most, most);
        let share = (1.0 + (shading / half).powi(2)).recip();
        (color * (-self.channels - shading).exp().as_vec3(), share as f32)
    }
}

/// Points of a part that are compared, with unit normals.
pub(crate) type Compared = Vec<[DVec3; 2]>;

/// What a view shows of a point: its number, the normal, the colour in the photo.
type Shown = (usize, DVec3, Vec3);

/// Sets the gains of the views of all parts. `views[part]` has the views of every photo in the same order.
pub(crate) fn equalise(views: &mut [Vec<BakeView>], points: &[Compared], options: &[BakeOptions]) {
    let Some(settings) = options.first().map(|options| &options.settings.gains) else { return };
    let shown: Vec<Vec<Vec<Shown>>> =
        views.iter().zip(points).zip(options).map(|((views, points), options)| seen(views, points, options)).collect();
    let count = views.iter().map(Vec::len).max().unwrap_or(0);
    let exposures = exposures(&shown, count, settings);
    views.par_iter_mut().zip(&shown).for_each(|(views, shown)| {
        let shadings = shadings(shown, &exposures, settings);
        for ((view, channels), shading) in views.iter_mut().zip(&exposures).zip(shadings) {
            view.gain = Gain { channels: *channels, shading };
        }
    });
}

/// What the views show of points that at least two of them show.
fn seen(views: &[BakeView], points: &[[DVec3; 2]], options: &BakeOptions) -> Vec<Vec<Shown>> {
    let settings = &options.settings.gains;
    let of_point = |[point, normal]: &[DVec3; 2]| {
        let one = |(i, view): (usize, &BakeView)| {
            let sight = view.sight(*point, *normal, options).filter(|sight| sight.clear >= settings.clear)?;
            let color = view.color(&sight);
            usable(color, settings).then_some((i, *normal, color))
        };
        let shown: Vec<Shown> = views.iter().enumerate().filter_map(one).collect();
        (shown.len() > 1).then_some(shown)
    };
    points.par_iter().filter_map(of_point).collect()
}

/// Colours that are neither dark, so that noise and offsets count, nor saturated.
fn usable(color: Vec3, settings: &GainSettings) -> bool {
    color.element_sum() > 3.0 * settings.dark && color.max_element() < settings.bright
}

/// Logarithm of the brightness.
fn brightness(color: Vec3) -> f64 {
    f64::from(color.element_sum()).ln()
}

/// Gain of each channel and view. The brightness decides about what is common to all channels: single channels of a coloured
/// surface can be dark.
fn exposures(parts: &[Vec<Vec<Shown>>], count: usize, settings: &GainSettings) -> Vec<DVec3> {
    let fitted = |rows: &[Vec<Row<1>>]| {
        explaining(centred(solved(rows, count, [settings.prior], settings), rows), rows, settings)
    };
    let points = || parts.iter().flatten();
    let row = |shown: &Shown| Row { view: shown.0, basis: [1.0], value: brightness(shown.2) };
    let rows: Vec<Vec<Row<1>>> = points().map(|shown| shown.iter().map(row).collect()).collect();
    let Some(common) = fitted(&rows) else { return vec![DVec3::ZERO; count] };
    let mut out: Vec<DVec3> = common.iter().map(|[gain]| DVec3::splat(*gain)).collect();
    for channel in 0..3 {
        let row = |shown: &Shown| {
            let value = f64::from(shown.2[channel]).ln() - brightness(shown.2);
            Row { view: shown.0, basis: [1.0], value }
        };
        let bright = |shown: &&Vec<Shown>| shown.iter().all(|(_, _, color)| color[channel] > settings.dark_channel);
        let rows: Vec<Vec<Row<1>>> = points().filter(bright).map(|shown| shown.iter().map(row).collect()).collect();
        for (gain, [balance]) in out.iter_mut().zip(fitted(&rows).unwrap_or_default()) {
            gain[channel] += balance;
        }
    }
    out
}

/// What the exposures leave of a part, by the normal. The hue stays: highlights on surfaces of one colour would tint those of
/// another.
fn shadings(points: &[Vec<Shown>], exposures: &[DVec3], settings: &GainSettings) -> Vec<[f64; 4]> {
    let slope = settings.prior * settings.slope_prior;
    let prior = [settings.prior, slope, slope, slope];
    let row = |(view, normal, color): &Shown| {
        let color = *color * (-exposures[*view]).exp().as_vec3();
        Row { view: *view, basis: basis(*normal), value: brightness(color) }
    };
    let rows: Vec<Vec<Row<4>>> = points.iter().map(|shown| shown.iter().map(row).collect()).collect();
    let gains = explaining(centred(solved(&rows, exposures.len(), prior, settings), &rows), &rows, settings);
    gains.unwrap_or_else(|| vec![[0.0; 4]; exposures.len()])
}

fn basis(normal: DVec3) -> [f64; 4] {
    [1.0, normal.x, normal.y, normal.z]
}

/// Gains less their mean over all rows of a direction, so that the brightness of what is seen stays.
fn centred<const K: usize>(mut gains: Vec<[f64; K]>, points: &[Vec<Row<K>>]) -> Vec<[f64; K]> {
    /// Weight that guards a division where no row has a direction.
    const TINY: f64 = 1e-9;
    let rows = || points.iter().flatten();
    let normal = |of: &dyn Fn(&Row<K>) -> f64| {
        let mut sum = [[0.0; K]];
        rows().for_each(|row| sum[0].iter_mut().zip(row.basis).for_each(|(s, b)| *s += b * of(row)));
        sum
    };
    let right = normal(&|row| dot(&gains[row.view], &row.basis));
    let mut diagonal = [[TINY; K]];
    rows().for_each(|row| diagonal[0].iter_mut().zip(row.basis).for_each(|(d, b)| *d += b * b));
    let apply = |x: &[[f64; K]]| normal(&|row| dot(&x[0], &row.basis)).to_vec();
    let mean = conjugate_gradients(&apply, &right, &diagonal, vec![[0.0; K]])[0];
    gains.iter_mut().for_each(|gain| gain.iter_mut().zip(mean).for_each(|(g, m)| *g -= m));
    gains
}

/// The gains if they explain why views disagree, else none: the mean difference from the median of each point has to be
/// visible, and to fall to the share that gains may leave.
fn explaining<const K: usize>(
    gains: Vec<[f64; K]>,
    points: &[Vec<Row<K>>],
    settings: &GainSettings,
) -> Option<Vec<[f64; K]>> {
    let left = |of: &dyn Fn(&Row<K>) -> f64| {
        let differences = |rows: &Vec<Row<K>>| -> f64 {
            let mut values: Vec<f64> = rows.iter().map(of).collect();
            values.sort_unstable_by(f64::total_cmp);
            let median = values[values.len() / 2];
            values.iter().map(|value| (value - median).abs().min(settings.outlier)).sum()
        };
        points.iter().map(differences).sum::<f64>() / points.iter().map(Vec::len).sum::<usize>().max(1) as f64
    };
    let (before, after) = (left(&|row| row.value), left(&|row| row.value - dot(&gains[row.view], &row.basis)));
    (before > settings.visible && after < settings.explained * before).then_some(gains)
}
