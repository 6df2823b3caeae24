//! Part discovery from depth: what moved, by which motion, and which part every surface point belongs to.
//!
//! A point that the other state's depth maps look through has moved; one they hide is merely unseen. Motions are
//! searched for clusters of moved points, then parts and motions are refined in turn.

pub mod field;
pub mod label;
pub mod observe;
pub mod propose;
pub mod register;
pub mod select;

use artgs_core::{Joint, JointKind, Rigid, View};
use field::Field;
use glam::Vec3;
use label::LabelCosts;
use observe::{Cloud, DepthView, Observation, Sightings};
use propose::{Scales, Side};
use rayon::prelude::*;
use register::{Match, RegisterOptions, Searchable};
use serde::{Deserialize, Serialize};

/// Settings of part discovery. Lengths are fractions of the object's diagonal unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiscoverConfig {
    /// Distance between the surface points that are labelled; never below one pixel.
    pub spacing: f64,
    /// Edge of a cube of the lookup grid.
    pub voxel: f64,
    /// A motion must explain at least this fraction of all moved points.
    pub least_share: f64,
    /// Rounds of labelling and registering.
    pub rounds: usize,
    /// Motions that turn less than this are slides, degrees, unless a hinge fits clearly better.
    pub revolute_deg: f64,
}

impl Default for DiscoverConfig {
    fn default() -> Self {
        Self { spacing: 1.0 / 160.0, voxel: 1.0 / 110.0, least_share: 0.004, rounds: 3, revolute_deg: 3.0 }
    }
}

/// A movable part as discovery sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FoundPart {
    /// Type of the joint.
    pub kind: JointKind,
    /// Motion from start to end, on the joint.
    pub motion: Rigid,
    /// Root mean square distance between the registered surfaces, scene units.
    pub rms: f64,
}

/// Labelled surface points of both states and the motions of the parts.
#[derive(Clone, Debug, Default)]
pub struct Discovery {
    /// Surface points at start and end, world frame of each.
    pub clouds: [Cloud; 2],
    /// Part of every point; 0 is static.
    pub labels: [Vec<u16>; 2],
    /// Parts 1.., largest first.
    pub parts: Vec<FoundPart>,
    /// Diagonal of the object's bounding box, scene units.
    pub diagonal: f64,
    /// Distance between neighbouring points, scene units.
    pub spacing: f64,
    /// Depth tolerance used, scene units.
    pub tolerance: f64,
    /// What was odd, one sentence each.
    pub warnings: Vec<String>,
}

/// Why parts could not be found.
#[derive(Debug, thiserror::Error)]
pub enum DiscoverError {
    /// No usable depth.
    #[error("no surface point could be back-projected from the {0} state: its depth maps are empty or torn")]
    NoSurface(&'static str),
    /// Nothing moved.
    #[error("nothing moved between the two states: check that `start` and `end` show different joint positions")]
    NothingMoved,
}

/// Bounding box of both clouds without the outermost 0.1 % of points.
fn bounds(clouds: [&Cloud; 2]) -> (Vec3, Vec3) {
    let range = |axis: usize| {
        let mut xs: Vec<f32> = clouds.iter().flat_map(|c| c.points.iter().map(|p| p[axis])).collect();
        xs.sort_unstable_by(f32::total_cmp);
        (xs[xs.len() / 1000], xs[xs.len() - 1 - xs.len() / 1000])
    };
    let (x, y, z) = (range(0), range(1), range(2));
    (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1))
}

/// A view with its depth map, measured or rendered.
#[derive(Clone, Copy, Debug)]
pub struct DepthPicture<'a> {
    /// Camera, colours and mask.
    pub view: &'a View,
    /// Planar depth, scene units, `[height * width]`, 0 where there is none.
    pub depth: &'a [f32],
}

impl<'a> DepthPicture<'a> {
    fn prepared(&self) -> (DepthView, &'a [[u8; 4]]) {
        let mask: Vec<bool> = self.view.rgba.iter().map(|p| p[3] >= 128).collect();
        (DepthView::new(self.view.camera, self.depth.to_vec(), &mask), &self.view.rgba)
    }
}

/// Both states prepared for discovery.
pub struct Scene {
    /// Start and end.
    pub states: [Observation; 2],
    /// Lengths in scene units.
    pub scales: Scales,
    /// Depth tolerance, scene units.
    pub tolerance: f32,
    lower: Vec3,
    upper: Vec3,
}

impl Scene {
    /// Back-projects both states.
    pub fn new(pictures: [&[DepthPicture<'_>]; 2], config: &DiscoverConfig) -> Result<Self, DiscoverError> {
        let views = pictures.map(|p| p.par_iter().map(DepthPicture::prepared).collect::<Vec<_>>());
        let coarse = |v: &[(DepthView, &[[u8; 4]])]| {
            let mut c = Cloud::default();
            v.iter().for_each(|(d, rgba)| c.append(&observe::surface_points(d, rgba, 5)));
            c
        };
        let rough = [coarse(&views[0]), coarse(&views[1])];
        for s in 0..2 {
            if rough[s].len() < 50 {
                return Err(DiscoverError::NoSurface(artgs_core::STATE_NAMES[s]));
            }
        }
        let (lower, upper) = bounds([&rough[0], &rough[1]]);
        let diagonal = lower.distance(upper);
        let states = views.map(|state| {
            let (depths, pictures): (Vec<_>, Vec<_>) = state.into_iter().unzip();
            let pixel = Observation::pixel_size(&depths);
            Observation::new(depths, &pictures, (config.spacing as f32 * diagonal).max(pixel))
        });
        let pixel = Observation::pixel_size(&states[0].views).max(Observation::pixel_size(&states[1].views));
        let noise = states[0].depth_noise().max(states[1].depth_noise());
        let spacing = (config.spacing as f32 * diagonal).max(pixel);
        let tolerance = (4.0 * noise).max(0.5 * pixel);
        Ok(Self { states, scales: Scales { spacing, diagonal }, tolerance, lower, upper })
    }

    /// Points of a state that are not there in the other one, and points the other one says nothing about.
    pub fn moved_and_unsure(&self, state: usize) -> (Vec<usize>, Vec<usize>) {
        let (own, other) = (&self.states[state].cloud, &self.states[1 - state].views);
        let seen: Vec<Sightings> = own.points.par_iter().map(|p| Sightings::of(other, *p, self.tolerance)).collect();
        let which = |f: fn(&Sightings) -> bool| (0..seen.len()).filter(|&i| f(&seen[i])).collect();
        (which(|s| s.is_empty_space()), which(|s| !s.is_empty_space() && !s.is_surface()))
    }
}

/// Finds the movable parts (`movable` of them) and labels every surface point.
pub fn discover(scene: &Scene, movable: usize, config: &DiscoverConfig) -> Result<Discovery, DiscoverError> {
    let clouds = [&scene.states[0].cloud, &scene.states[1].cloud];
    let search = [Searchable::new(clouds[0]), Searchable::new(clouds[1])];
    let [(moved_start, unsure_start), (moved_end, unsure_end)] = [0, 1].map(|s| scene.moved_and_unsure(s));
    let (moved, unsure) = ([moved_start, moved_end], [unsure_start, unsure_end]);
    let total = moved[0].len() + moved[1].len();
    if total < 24 {
        return Err(DiscoverError::NothingMoved);
    }
    let pad = Vec3::splat(0.05 * scene.scales.diagonal);
    let voxel = config.voxel as f32 * scene.scales.diagonal;
    let fields = [0, 1].map(|s| {
        let (lower, upper) = (scene.lower - pad, scene.upper + pad);
        Field::new(clouds[s], &scene.states[s].views, lower, upper, voxel, scene.tolerance)
    });
    let sides = [0, 1].map(|s| Side { points: &search[s], field: &fields[s], moved: &moved[s], unsure: &unsure[s] });
    let least = (config.least_share * total as f64).max(24.0);
    let pool = propose::propose([&sides[0], &sides[1]], &scene.scales, movable + 2, 120, least);
    let chosen = select::select(scene, &search, &moved, &pool, movable);
    let mut warnings = Vec::new();
    if chosen.len() < movable {
        let found = chosen.len();
        warnings.push(format!("{movable} movable parts were asked for but only {found} distinct motions were found"));
    }
    let motions: Vec<Rigid> = chosen.iter().map(|&c| pool[c].motion).collect();
    let mut parts: Vec<FoundPart> =
        motions.iter().map(|m| FoundPart { kind: JointKind::Screw, motion: *m, rms: f64::NAN }).collect();
    let graphs = [0, 1].map(|s| {
        let c = clouds[s];
        label::neighbour_graph(&c.points, &c.normals, &c.colors, 10, scene.scales.spacing)
    });
    let is_unsure = [0, 1].map(|s| {
        let mut flags = vec![false; clouds[s].len()];
        unsure[s].iter().chain(&moved[s]).for_each(|&i| flags[i] = true);
        flags
    });
    let mut labels = [Vec::new(), Vec::new()];
    for round in 0..config.rounds.max(1) {
        labels = [0, 1].map(|s| {
            let to_other: Vec<Rigid> = std::iter::once(Rigid::IDENTITY)
                .chain(parts.iter().map(|p| if s == 0 { p.motion } else { p.motion.inverse() }))
                .collect();
            let costs = LabelCosts::default();
            let mut data = label::data_costs(
                &search[s],
                &search[1 - s],
                &scene.states[1 - s].views,
                &to_other,
                scene.tolerance,
                scene.scales.spacing,
                &costs,
            );
            let spoken = data.clone();
            let evidence = evidence(&data, to_other.len(), &moved[s]);
            let ranges = reaches(&evidence, clouds[s], &to_other[1..], &scene.scales);
            label::add_idle_costs(&mut data, clouds[s], &evidence, &is_unsure[s], &ranges, &costs);
            let mut labels = label::propagate(&data, to_other.len(), &graphs[s], costs.smooth, 60);
            label::drop_islands(&mut labels, &spoken, to_other.len(), clouds[s], 1.8 * scene.scales.spacing);
            labels
        });
        let last = round + 1 == config.rounds.max(1);
        for (k, part) in parts.iter_mut().enumerate() {
            refine(part, clouds, &labels, k as u16 + 1, &scene.scales, last, config);
        }
    }
    Ok(Discovery {
        clouds: [clouds[0].clone(), clouds[1].clone()],
        labels,
        parts,
        diagonal: scene.scales.diagonal.into(),
        spacing: scene.scales.spacing.into(),
        tolerance: scene.tolerance.into(),
        warnings,
    })
}

/// Moved points that each movable part explains best, by the data costs `[n * parts]`.
fn evidence(data: &[f32], parts: usize, moved: &[usize]) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new(); parts - 1];
    for &i in moved {
        let row = &data[i * parts..(i + 1) * parts];
        let best = (1..parts).min_by(|&a, &b| row[a].total_cmp(&row[b]));
        if let Some(k) = best.filter(|&k| row[k] < 0.3) {
            out[k - 1].push(i);
        }
    }
    out
}

/// How far from its moved points a part may plausibly reach unmoved-looking: as far as it moves on average.
fn reaches(evidence: &[Vec<usize>], cloud: &Cloud, to_other: &[Rigid], scales: &Scales) -> Vec<f32> {
    let reach = |(members, motion): (&Vec<usize>, &Rigid)| {
        let shift = |i: &usize| {
            let p = cloud.points[*i].as_dvec3();
            motion.apply(p).distance(p)
        };
        let mean = members.iter().map(shift).sum::<f64>() / members.len().max(1) as f64;
        (mean as f32).clamp(3.0 * scales.spacing, 0.15 * scales.diagonal)
    };
    evidence.iter().zip(to_other).map(reach).collect()
}

/// Registers the points of one part; in the last round decides its joint and stays on it.
fn refine(
    part: &mut FoundPart,
    clouds: [&Cloud; 2],
    labels: &[Vec<u16>; 2],
    label: u16,
    scales: &Scales,
    last: bool,
    config: &DiscoverConfig,
) {
    let own = [0, 1].map(|s| {
        let members: Vec<usize> = (0..labels[s].len()).filter(|&i| labels[s][i] == label).collect();
        clouds[s].select(&members)
    });
    if own.iter().any(|c| c.len() < 12) {
        return;
    }
    let points = [Searchable::new(&own[0]), Searchable::new(&own[1])];
    let spacing = f64::from(scales.spacing);
    let (iterations, max_points) = if last { (20, 20_000) } else { (12, 4000) };
    let options = RegisterOptions { first_reach: 3.0 * spacing, last_reach: spacing, iterations, max_points };
    let free = register::register(Match::mutual(&points[0], &points[1]), part.motion, None, &options);
    *part = FoundPart { kind: JointKind::Screw, motion: free.motion, rms: free.rms };
    if last {
        let (kind, fit) = choose_joint(&points, &free, &options, config.revolute_deg);
        *part = FoundPart { kind, motion: fit.motion, rms: fit.rms };
    }
}

/// Slide or hinge: the simpler joint wins unless the other fits clearly better.
fn choose_joint(
    points: &[Searchable<'_>; 2],
    free: &register::Registration,
    options: &RegisterOptions,
    revolute_deg: f64,
) -> (JointKind, register::Registration) {
    let fit = |kind, guess| register::register(Match::mutual(&points[0], &points[1]), guess, Some(kind), options);
    let slide_guess = {
        // The shift of the part's centre, so that a small turn does not throw the slide off.
        let c = &points[0].cloud.points;
        let centre = (c.iter().sum::<Vec3>() / c.len() as f32).as_dvec3();
        Rigid::shift(free.motion.apply(centre) - centre)
    };
    let hinge_guess = Joint::from_motion(JointKind::Revolute, &free.motion).start_to_end();
    if free.motion.angle().to_degrees() < 0.05 {
        return (JointKind::Prismatic, fit(JointKind::Prismatic, slide_guess));
    }
    let hinge = fit(JointKind::Revolute, hinge_guess);
    if free.motion.angle().to_degrees() > 4.0 * revolute_deg {
        return (JointKind::Revolute, hinge);
    }
    let slide = fit(JointKind::Prismatic, slide_guess);
    let hinge_wins = free.motion.angle().to_degrees() > revolute_deg
        || (hinge.rms < 0.7 * slide.rms && hinge.pairs as f64 > 0.95 * slide.pairs as f64);
    if hinge_wins { (JointKind::Revolute, hinge) } else { (JointKind::Prismatic, slide) }
}
