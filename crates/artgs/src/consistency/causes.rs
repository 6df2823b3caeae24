//! Usual mistakes in captures, found by reading the same numbers differently.

use super::agreement::{Agreement, agreement};
use super::samples::{AxisTurn, CoarseView, PoseReading, Posed, Reading};
use super::{Explained, between};
use artgs_core::{PerState, State};
use glam::{DMat3, DVec3};
use serde::Serialize;

/// Agreement that a corrected capture must reach.
const EXPLAINED: f64 = 0.8;
/// How much agreement the correction of a certain mistake must gain.
pub(super) const GAIN: f64 = 0.15;

/// A usual mistake.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Camera axes: y and z point the other way.
    Axes,
    /// Poses lead from the world to the camera.
    WorldToCamera,
    /// Poses lead from the world to the camera, and y and z point the other way.
    WorldToCameraAndAxes,
    /// Poses of a robot's base: x forward, y left, z up.
    RobotAxes,
    /// The camera frame of the poses is turned against the images by right angles.
    TurnedAxes(AxisTurn),
    /// Depth must be multiplied by this.
    DepthScale(f64),
    /// Focal lengths must be multiplied by this.
    FocalLength(f64),
    /// Intrinsics of columns and rows have changed places.
    SwappedIntrinsics,
    /// Depth is measured along the ray.
    DepthAlongRay,
    /// Poses and depth of the end state must be multiplied by this.
    EndScale(f64),
}

impl Cause {
    /// True for the same mistake, by about the same factor.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        /// Factors are known this well.
        const ACCURACY: f64 = 0.1;
        match (self, other) {
            (Self::DepthScale(a), Self::DepthScale(b)) | (Self::FocalLength(a), Self::FocalLength(b)) => {
                (a / b - 1.0).abs() < ACCURACY
            }
            _ => self == other,
        }
    }

    /// How the capture was read for the better agreement; a number follows.
    pub(super) fn changed(&self) -> String {
        match self {
            Self::Axes => "with y and z of the cameras flipped".into(),
            Self::WorldToCamera => "with inverted poses".into(),
            Self::WorldToCameraAndAxes => "with inverted poses and y and z of the cameras flipped".into(),
            Self::RobotAxes => "with x of the cameras read as forward and z as up".into(),
            Self::TurnedAxes(turn) => match roll(*turn) {
                Some(angle) => format!("with the cameras turned by {angle} degrees about their viewing axis"),
                None => "with the axes of the cameras in another order".into(),
            },
            Self::DepthScale(s) => format!("with depth multiplied by {}", number(*s)),
            Self::FocalLength(s) => format!("with focal lengths multiplied by {}", number(*s)),
            Self::SwappedIntrinsics => "with fx and fy, cx and cy exchanged".into(),
            Self::DepthAlongRay => "with depth read as the distance from the camera".into(),
            Self::EndScale(s) => format!("with poses and depth of the end state multiplied by {}", number(*s)),
        }
    }

    /// The question to the user, with the remedy; options are for recordings. `stored` is the number of stored depths per unit.
    pub(super) fn question(&self, is_recording: bool, stored: Option<f64>) -> String {
        let option = |name: String| if is_recording { format!(", or use {name}") } else { String::new() };
        match self {
            Self::Axes => "are these OpenCV poses (y down, looks along +z) in a format that expects OpenGL poses (y up, looks \
                           along -z), or the reverse? Flip the second and third column of every rotation"
                .to_string()
                + &option("--camera-axes opencv or opengl".into()),
            Self::WorldToCamera => "are these world-to-camera poses in a format that expects camera-to-world, or the \
                                    reverse? Invert every matrix"
                .to_string()
                + &option("--invert-poses".into()),
            Self::WorldToCameraAndAxes => "are these world-to-camera poses with OpenCV axes in a format that expects \
                                           camera-to-world with OpenGL axes? Invert every matrix, then flip the second and \
                                           third column of its rotation"
                .to_string()
                + &option("--invert-poses with --camera-axes".into()),
            Self::RobotAxes => "are these poses of the robot base (x forward, y left, z up) where those of the camera are expected? \
                                Give poses of the camera's optical frame"
                .to_string()
                + &option("--camera-axes robot".into()),
            Self::TurnedAxes(turn) => turned_question(*turn, is_recording),
            Self::DepthScale(s) if is_recording => {
                let unit = stored.and_then(|stored| unit_name(s / stored));
                let unit = unit.unwrap_or_else(|| format!("LENGTH, the length of one stored number, {} times the present one", number(*s)));
                format!("is the unit of depth wrong? State it: --depth-unit {unit}")
            }
            Self::DepthScale(s) => format!(
                "is the unit of depth wrong? Multiply `depth_scale` (stored numbers per scene unit) by {}, or, in a layout \
                 without it, all stored depths by {}",
                number(1.0 / s),
                number(*s)
            ),
            Self::FocalLength(_) => {
                "is the focal length wrong, or were the images resized or cropped after calibration?".into()
            }
            Self::SwappedIntrinsics => "are the intrinsics of columns and rows swapped, or the images rotated?".into(),
            Self::DepthAlongRay => "is depth stored as distance along the ray? Convert it to depth along the optical axis".into(),
            Self::EndScale(_) => "do the two states have different units?".into(),
        }
    }
}

/// The name of a usual unit of depth, metres.
fn unit_name(metres: f64) -> Option<String> {
    const UNITS: [(f64, &str); 9] = [
        (1.0, "m"),
        (0.1, "0.1m"),
        (0.01, "cm"),
        (1e-3, "mm"),
        (2e-3, "2mm"),
        (5e-4, "0.5mm"),
        (2.5e-4, "0.25mm"),
        (2e-4, "0.2mm"),
        (1e-4, "0.1mm"),
    ];
    UNITS.iter().find(|(unit, _)| (metres / unit - 1.0).abs() < 0.015).map(|(_, name)| name.to_string())
}

/// The angle in degrees of a turn about the viewing axis.
fn roll(turn: AxisTurn) -> Option<i32> {
    let m = turn.matrix();
    (m.z_axis == DVec3::Z).then(|| m.x_axis.y.atan2(m.x_axis.x).to_degrees().round() as i32)
}

/// Where x, y and z of the stated camera frame point, if the format's frame is `format_axes` in that of OpenCV.
fn letters(turn: AxisTurn, format_axes: DMat3) -> String {
    let stated = turn.matrix() * format_axes;
    let letter = |axis: DVec3| match axis.to_array().map(|v| v.round() as i32) {
        [1, _, _] => 'R',
        [-1, _, _] => 'L',
        [_, 1, _] => 'D',
        [_, -1, _] => 'U',
        [_, _, 1] => 'F',
        _ => 'B',
    };
    [stated.x_axis, stated.y_axis, stated.z_axis].into_iter().map(letter).collect()
}

fn turned_question(turn: AxisTurn, is_recording: bool) -> String {
    let what = match roll(turn) {
        Some(_) => {
            "are the images turned against their poses, as those of a phone that is held upright? Turn the images back"
        }
        None => "are these poses of another camera frame? Convert every rotation to the axes of the format",
    };
    if !is_recording {
        return what.into();
    }
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let (cv, gl) = (letters(turn, DMat3::IDENTITY), letters(turn, flip));
    format!("{what}, or use --camera-axes {cv} ({gl} in nerfstudio, polycam, record3d and scanner-app)")
}

/// Three significant digits.
fn number(x: f64) -> String {
    let digits = (2 - x.abs().log10().floor() as i32).max(0) as usize;
    let text = format!("{x:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// The mistake after whose correction the views agree best, if they then agree well and by more than `gain` better than as stated.
pub(super) fn likely_cause(views: &[CoarseView], stated: Agreement, gain: f64) -> Option<Explained> {
    let with = |reading: Reading| agreement(views, views, [reading; 2]);
    let possible: Vec<(Cause, Agreement)> = readings()
        .map(|(cause, reading)| (cause, with(reading)))
        .filter(|(_, found)| found.share() > EXPLAINED && found.share() > stated.share() + gain)
        // A wrong camera can leave few points in the images, which then agree by chance.
        .filter(|(_, found)| found.agree > stated.agree)
        .collect();
    let best = possible.iter().max_by(|a, b| score(a).total_cmp(&score(b)))?;
    Some(Explained { cause: centered(best, &possible), agreement: best.1.share() })
}

/// The cause with the mean of those focal lengths that explain the views as well: several in a row do.
fn centered(best: &(Cause, Agreement), possible: &[(Cause, Agreement)]) -> Cause {
    const AS_WELL: f64 = 0.99;
    let Cause::FocalLength(_) = best.0 else { return best.0 };
    let factor = |found: &(Cause, Agreement)| match found.0 {
        Cause::FocalLength(s) if score(found) > AS_WELL * score(best) => Some(s.ln()),
        _ => None,
    };
    let (sum, count) = possible.iter().filter_map(factor).fold((0.0, 0), |(sum, n), x| (sum + x, n + 1));
    Cause::FocalLength((sum / f64::from(count.max(1))).exp())
}

fn score((cause, found): &(Cause, Agreement)) -> f64 {
    // A factor between usual units is more likely than its neighbours.
    const ROUND: f64 = 1.02;
    let round = matches!(cause, Cause::DepthScale(s) if round_factors().any(|r| r == *s));
    found.share() * found.share_of_all().sqrt() * if round { ROUND } else { 1.0 }
}

/// Readings of every usual mistake.
fn readings() -> impl Iterator<Item = (Cause, Reading)> {
    let stated = Reading::STATED;
    let pose = move |pose: PoseReading| Reading { pose, ..stated };
    let single = [
        (Cause::Axes, pose(PoseReading::OpenCv)),
        (Cause::WorldToCamera, pose(PoseReading::WorldToCamera)),
        (Cause::WorldToCamera, pose(PoseReading::Inverted)),
        (Cause::WorldToCameraAndAxes, pose(PoseReading::WorldToCameraOpenCv)),
        (Cause::SwappedIntrinsics, Reading { swapped: true, ..stated }),
        (Cause::DepthAlongRay, Reading { along_ray: true, ..stated }),
    ];
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let known = move |turn: &AxisTurn| turn.matrix() == DMat3::IDENTITY || turn.matrix() == flip;
    let turned = AxisTurn::all().filter(move |turn| !known(turn)).map(move |turn| {
        // The poses of a robot, read with OpenCV or with OpenGL axes.
        let robot = AxisTurn::ROBOT.matrix();
        let is_robot = turn.matrix() == robot || turn.matrix() == robot * flip;
        let cause = if is_robot { Cause::RobotAxes } else { Cause::TurnedAxes(turn) };
        (cause, pose(PoseReading::Turned(turn)))
    });
    let depth =
        round_factors().chain(factors(5.0)).map(move |s| (Cause::DepthScale(s), Reading { depth: s, ..stated }));
    let focal = factors(2.5).map(move |s| (Cause::FocalLength(s), Reading { focal: s, ..stated }));
    single.into_iter().chain(turned).chain(depth).chain(focal)
}

/// Factors between usual units, metres, millimetres, centimetres, inches and feet, and of usual depth encodings.
fn round_factors() -> impl Iterator<Item = f64> {
    [1000.0, 100.0, 10.0, 5.0, 4.0, 2.0, 39.37, 3.281].into_iter().flat_map(|s| [s, 1.0 / s])
}

/// Factors around 1 in steps of 2 %, up to `most` and down to its inverse, 1 left out.
fn factors(most: f64) -> impl Iterator<Item = f64> {
    const STEP: f64 = 0.02;
    let steps = (most.ln() / STEP) as i32;
    (-steps..=steps).filter(|i| i.abs() > 1).map(|i| (f64::from(i) * STEP).exp())
}

/// The factor of the end state after which the states agree much better than as stated.
pub(super) fn likely_scale(views: &PerState<Vec<CoarseView>>, stated: f64) -> Option<Explained> {
    /// Agreement between states that a corrected capture must reach.
    const LEAST: f64 = 0.3;
    /// Least factor by which agreement must grow.
    const GROWTH: f64 = 3.0;
    /// The size of an object changes by this factor at most when parts move.
    const OPENING: f64 = 1.6;
    let sizes = views.as_ref().map(|v| size(v));
    let ratio = sizes[State::START] / sizes[State::END];
    let scaled = |s: f64| (s, between(views, Reading { scale: s, ..Reading::STATED }).share_of_all());
    let possible = |s: &f64| (ratio / s).ln().abs() < OPENING.ln() && s.ln().abs() > 0.1;
    let best = |all: &mut dyn Iterator<Item = f64>| all.filter(possible).map(scaled).max_by(|a, b| a.1.total_cmp(&b.1));
    let any = best(&mut factors(OPENING).chain([1.0]).map(|f| ratio * f))?;
    let round = best(&mut round_factors()).filter(|r| r.1 > 0.95 * any.1);
    let (s, agreement) = round.unwrap_or(any);
    (agreement > LEAST && agreement > GROWTH * stated).then_some(Explained { cause: Cause::EndScale(s), agreement })
}

/// Diagonal of the box around the points of all views without the outermost 1 % along each axis.
fn size(views: &[CoarseView]) -> f64 {
    let mut all: Vec<DVec3> = Vec::new();
    for view in views {
        let posed = Posed::new(view, Reading::STATED);
        let to_world = posed.to_camera.inverse();
        all.extend(posed.points().map(|(p, _)| to_world.apply(p)));
    }
    let range = |axis: usize| {
        let mut xs: Vec<f64> = all.iter().map(|p| p[axis]).collect();
        xs.sort_unstable_by(f64::total_cmp);
        let cut = xs.len() / 100;
        if xs.is_empty() { 0.0 } else { xs[xs.len() - 1 - cut] - xs[cut] }
    };
    DVec3::new(range(0), range(1), range(2)).length().max(1e-12)
}
