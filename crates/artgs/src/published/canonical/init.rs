//! Canonical Gaussians, part centres and targets from two separately fitted states.

use super::CanonicalError;
use super::cluster::{ClusterConfig, spectral_clusters};
use super::fps::farthest_points;
use super::matching::match_points;
use super::motion::{MotionAnalysis, StaticRule, analyse};
use super::uninformed::{random_centres, random_gaussians};
use crate::fit::RandomInit;
use artgs_core::{PerState, Splats, State};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Least radius of a part, as a fraction of the object's longest side: the logarithm must stay finite.
const MIN_RADIUS: f32 = 1e-4;

/// Where canonical Gaussians come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CanonicalStart {
    /// Static Gaussians and midpoints of matched pairs: the paper's.
    #[default]
    Matched,
    /// Uniform in a cube around the object, near-grey: the paper's ablation "w/o Cano. Init."
    Random,
}

/// Where part centres come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CentreSource {
    /// Clusters of the Gaussians that moved, and the mean of the others: the paper's.
    #[default]
    Moved,
    /// Clusters of all Gaussians, the largest taken for the static part: the paper's ablation "w/o Motion Prior".
    All,
    /// Drawn around the middle of the object: the paper's ablation "w/o Center Init."
    Random,
}

/// Gaussians of which states make part centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CentreStates {
    /// Those that moved, of both states. A part that closes while others open shows in one state only, and the mean of
    /// both states is near the canonical place, which lies midway.
    #[default]
    Both,
    /// Those of the state with more motion, as published.
    One,
}

/// Settings of the canonical start. Defaults follow the published code, save for quaternions and clustering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CanonicalConfig {
    /// Canonical Gaussians.
    pub start: CanonicalStart,
    /// Those of `start = "random"`.
    pub random: RandomInit,
    /// Part centres.
    pub centres: CentreSource,
    /// Where `centres = "moved"` looks for what moved.
    pub centre_states: CentreStates,
    /// Most pairs of Gaussians that are matched and averaged.
    pub max_matched: usize,
    /// Which Gaussians are copied as static.
    pub static_rule: StaticRule,
    /// Ratio of that rule where parts are separated; none: 0.05 for more than three parts, otherwise unchanged.
    /// Published code also takes 0.05 for real captures.
    pub centre_ratio: Option<f32>,
    /// Whether quaternions are averaged with equal signs; published code does not look at signs.
    pub align_quaternions: bool,
    /// Radius of a part as a fraction of the distance of its farthest Gaussian; the paper says 1.
    pub radius_factor: f32,
    /// How moved Gaussians are split into parts.
    pub cluster: ClusterConfig,
}

impl Default for CanonicalConfig {
    fn default() -> Self {
        Self {
            start: CanonicalStart::Matched,
            random: RandomInit::default(),
            centres: CentreSource::Moved,
            centre_states: CentreStates::Both,
            max_matched: 5000,
            static_rule: StaticRule::default(),
            centre_ratio: None,
            align_quaternions: true,
            radius_factor: 0.5,
            cluster: ClusterConfig::default(),
        }
    }
}

impl CanonicalConfig {
    /// As published, but for the states and the unit of lengths of centres.
    pub fn paper() -> Self {
        Self { align_quaternions: false, cluster: ClusterConfig::paper(), ..Self::default() }
    }
}

/// The start of the joint optimisation.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Canonical {
    /// Static Gaussians of the state with more motion, then the midpoints of matched pairs.
    pub splats: Splats,
    /// Centre of every part, `[K]`, the static part first. Their order is the order of parts from here on.
    pub centres: Vec<[f32; 3]>,
    /// Radius of every part, `[K]`, positive.
    pub radii: Vec<f32>,
    /// State in which moved parts show best.
    pub more_motion_state: State,
    /// All centres of each state's Gaussians, targets for the warped canonical ones.
    pub cd_targets: PerState<Vec<[f32; 3]>>,
    /// Positions of the matched Gaussians at start and end; none where the start is random.
    pub pairs: Vec<[[f32; 3]; 2]>,
    /// Gaussians of that state that were copied as static, by index.
    pub copied: Vec<usize>,
    /// Gaussians of each state in movable parts: index and part (1..K); none where centres are random, or of a state that was
    /// not looked at.
    pub movable_clusters: PerState<Vec<(usize, u16)>>,
}

/// Builds the canonical start for `parts` parts, the static one included.
pub(crate) fn canonical_init(
    single: &PerState<Splats>,
    parts: usize,
    config: &CanonicalConfig,
    rng: &mut Pcg64Mcg,
) -> Result<Canonical, CanonicalError> {
    check(single, parts)?;
    let motion = analyse(single.as_ref().map(|splats| &splats.means[..]))?;
    let state = motion.more_motion_state;
    let (distances, source) = (&motion.squared_distances[state], &single[state]);

    let (splats, pairs, copied) = match config.start {
        CanonicalStart::Random => (random_gaussians(single, &config.random, rng)?, Vec::new(), Vec::new()),
        CanonicalStart::Matched => {
            let fixed = config.static_rule.mask(distances);
            let copied: Vec<usize> = (0..source.len()).filter(|&i| fixed[i]).collect();
            let mut splats = source.select(copied.iter().copied());
            let (middle, pairs) = midpoints(single, config);
            splats.extend_from(&middle, 0..middle.len());
            (splats, pairs, copied)
        }
    };
    let clusters = match config.centres {
        CentreSource::Moved => moved_clusters(single, &motion, parts, config, rng)?,
        CentreSource::All => {
            let mut clusters = PerState::default();
            clusters[state] = all_clusters(source, parts, config, rng)?;
            clusters
        }
        CentreSource::Random => PerState::default(),
    };
    let (centres, radii) = match config.centres {
        CentreSource::Random => random_centres(single, parts, rng),
        _ => balls(single, state, &clusters, parts, config.radius_factor),
    };
    let movable = |of: &Vec<u16>| of.iter().copied().enumerate().filter(|(_, part)| *part > 0).collect();
    let movable_clusters = clusters.as_ref().map(movable);
    let cd_targets = single.as_ref().map(|splats| splats.means.clone());
    Ok(Canonical { splats, centres, radii, more_motion_state: state, cd_targets, pairs, copied, movable_clusters })
}

/// Part of every Gaussian, per state: 0 for those that stayed, clusters of the others; empty for a state that is not looked at.
fn moved_clusters(
    single: &PerState<Splats>,
    motion: &MotionAnalysis,
    parts: usize,
    config: &CanonicalConfig,
    rng: &mut Pcg64Mcg,
) -> Result<PerState<Vec<u16>>, CanonicalError> {
    let default_ratio = if parts > 3 { 0.05 } else { config.static_rule.ratio };
    let rule = StaticRule { ratio: config.centre_ratio.unwrap_or(default_ratio), ..config.static_rule };
    let wanted = |s: &State| config.centre_states == CentreStates::Both || *s == motion.more_motion_state;
    let moved: Vec<(State, usize)> = State::ALL
        .into_iter()
        .filter(wanted)
        .flat_map(|s| {
            let fixed = rule.mask(&motion.squared_distances[s]);
            (0..fixed.len()).filter(move |&i| !fixed[i]).map(move |i| (s, i))
        })
        .collect();
    if moved.len() < parts - 1 {
        return Err(CanonicalError::TooFewPoints { points: moved.len(), clusters: parts - 1 });
    }
    let scale = 1.0 / length_unit(single);
    let points: Vec<[f32; 3]> = moved.iter().map(|&(s, i)| single[s].means[i].map(|c| c * scale)).collect();
    let labels = spectral_clusters(&points, parts - 1, &config.cluster, rng)?;
    let mut clusters = PerState::from_fn(|s| if wanted(&s) { vec![0; single[s].len()] } else { Vec::new() });
    moved.iter().zip(&labels).for_each(|(&(s, i), &label)| clusters[s][i] = label + 1);
    Ok(clusters)
}

/// Scene units that count as 1 in clustering: half the longest side of the object, whose size is then that of the paper's.
fn length_unit(single: &PerState<Splats>) -> f32 {
    0.5 * single.iter().map(|splats| longest_side(&splats.means)).fold(0.0, f32::max)
}

/// Cluster of every Gaussian of a state, the largest first.
fn all_clusters(
    source: &Splats,
    parts: usize,
    config: &CanonicalConfig,
    rng: &mut Pcg64Mcg,
) -> Result<Vec<u16>, CanonicalError> {
    let scale = 2.0 / longest_side(&source.means);
    let points: Vec<[f32; 3]> = source.means.iter().map(|p| p.map(|c| c * scale)).collect();
    let labels = spectral_clusters(&points, parts, &config.cluster, rng)?;
    let mut sizes: Vec<(usize, u16)> = (0..parts as u16).map(|k| (0, k)).collect();
    labels.iter().for_each(|&l| sizes[usize::from(l)].0 += 1);
    sizes.sort_by_key(|&(size, k)| (std::cmp::Reverse(size), k));
    let place = |l: &u16| sizes.iter().position(|s| s.1 == *l).unwrap_or(0) as u16;
    Ok(labels.iter().map(place).collect())
}

/// Mean and radius of every part, `[K]`; of a part without members those of everything. The static part is that of one state: in
/// the other it has the same Gaussians once more.
fn balls(
    single: &PerState<Splats>,
    state: State,
    clusters: &PerState<Vec<u16>>,
    parts: usize,
    factor: f32,
) -> (Vec<[f32; 3]>, Vec<f32>) {
    let everything = &single[state].means;
    let floor = MIN_RADIUS * longest_side(everything);
    let of_part = |part: usize| {
        let of_state = |s: State| {
            let own = single[s].means.iter().zip(&clusters[s]);
            own.filter(|(_, c)| usize::from(**c) == part).map(|(p, _)| *p).collect::<Vec<_>>()
        };
        let states = State::ALL.into_iter().filter(|s| part > 0 || *s == state);
        let members: Vec<[f32; 3]> = states.flat_map(of_state).collect();
        let (centre, farthest) = ball(if members.is_empty() { everything } else { &members });
        (centre, (factor * farthest).max(floor))
    };
    (0..parts).map(of_part).unzip()
}

fn check(single: &PerState<Splats>, parts: usize) -> Result<(), CanonicalError> {
    if parts < 2 {
        return Err(CanonicalError::Parts(parts));
    }
    for (state, splats) in single.enumerate() {
        if splats.is_empty() {
            return Err(CanonicalError::Empty("Gaussians in one of the states"));
        }
        if splats.means.iter().flatten().any(|c| !c.is_finite()) {
            return Err(CanonicalError::NotFinite { state });
        }
    }
    let degrees = single.as_ref().map(|splats| splats.sh_degree);
    if degrees[State::START] != degrees[State::END] {
        return Err(CanonicalError::Degrees(degrees[State::START], degrees[State::END]));
    }
    Ok(())
}

/// Thins both states to equally many Gaussians, matches them and averages every raw parameter of the pairs. Also returns where
/// the two of each pair are.
pub(crate) fn midpoints(single: &PerState<Splats>, config: &CanonicalConfig) -> (Splats, Vec<[[f32; 3]; 2]>) {
    let count = single.iter().map(Splats::len).fold(config.max_matched, usize::min);
    let thinned = |splats: &Splats| splats.select(farthest_points(&splats.means, count));
    let (first, second) = (thinned(&single[State::START]), thinned(&single[State::END]));
    let partner = match_points(&first.means, &second.means);
    let pairs = first.means.iter().zip(&partner).map(|(a, &j)| [*a, second.means[j]]).collect();
    let mut out = first;
    let stride = out.sh_stride();
    for (i, j) in partner.into_iter().enumerate() {
        average(&mut out.means[i], &second.means[j]);
        average(&mut out.log_scales[i], &second.log_scales[j]);
        average(&mut out.sh[i * stride..(i + 1) * stride], &second.sh[j * stride..(j + 1) * stride]);
        out.logit_opacities[i] = 0.5 * (out.logit_opacities[i] + second.logit_opacities[j]);
        let (a, b) = (out.rotations[i], second.rotations[j]);
        let opposed = (0..4).map(|c| a[c] * b[c]).sum::<f32>() < 0.0;
        let sign = if config.align_quaternions && opposed { -1.0 } else { 1.0 };
        average(&mut out.rotations[i], &b.map(|c| sign * c));
    }
    (out, pairs)
}

fn average(a: &mut [f32], b: &[f32]) {
    a.iter_mut().zip(b).for_each(|(x, y)| *x = 0.5 * (*x + y));
}

/// Mean of some points and the distance from it to the farthest.
fn ball(points: &[[f32; 3]]) -> ([f32; 3], f32) {
    let mean = [0, 1, 2].map(|a| {
        let sum: f64 = points.iter().map(|p| f64::from(p[a])).sum();
        (sum / points.len() as f64) as f32
    });
    let square = |p: &[f32; 3]| (0..3).map(|a| (p[a] - mean[a]).powi(2)).sum::<f32>();
    (mean, points.iter().map(square).fold(0.0, f32::max).sqrt())
}

fn longest_side(points: &[[f32; 3]]) -> f32 {
    let side = |a: usize| {
        let (low, high) =
            points.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), p| (l.min(p[a]), h.max(p[a])));
        high - low
    };
    side(0).max(side(1)).max(side(2)).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn splats(means: Vec<[f32; 3]>, quaternion: [f32; 4], value: f32) -> Splats {
        let n = means.len();
        Splats {
            means,
            rotations: vec![quaternion; n],
            log_scales: vec![[value; 3]; n],
            logit_opacities: vec![value; n],
            sh_degree: 1,
            sh: vec![value; 12 * n],
        }
    }

    fn sheet(x: f32, y: f32, z: f32) -> Vec<[f32; 3]> {
        (0..400).map(|i| [x + (i % 20) as f32 * 0.02, y + (i / 20) as f32 * 0.02, z]).collect()
    }

    /// A plate and two drawers' fronts that come out of it by 0.5 at the end.
    fn cabinet() -> PerState<Splats> {
        let plate: Vec<[f32; 3]> = (0..2500).map(|i| [(i % 50) as f32 * 0.02, (i / 50) as f32 * 0.02, 0.0]).collect();
        let at = |z: f32| [plate.clone(), sheet(0.0, 0.0, z), sheet(0.6, 0.6, z)].concat();
        PerState::new(splats(at(0.01), [1.0, 0.0, 0.0, 0.0], 1.0), splats(at(0.51), [-1.0, 0.0, 0.0, 0.0], 3.0))
    }

    #[test]
    fn a_cabinet_gets_its_parts_midpoints_and_targets() {
        let single = cabinet();
        let config = CanonicalConfig { max_matched: 2000, centre_states: CentreStates::One, ..Default::default() };
        let c = canonical_init(&single, 3, &config, &mut Pcg64Mcg::new(1)).unwrap();
        assert_eq!(c.more_motion_state, State::END);
        assert_eq!(c.splats.len(), 2500 + 2000);
        assert_eq!(c.splats.sh.len(), 12 * 4500);
        assert!(c.splats.means[..2500].iter().all(|p| p[2] == 0.0));
        assert!(c.splats.log_scales[..2500].iter().all(|s| s[0] == 3.0));
        assert!(c.splats.log_scales[2500..].iter().all(|s| s[0] == 2.0));
        assert!(c.splats.rotations[2500..].iter().all(|q| q[0] == 1.0));
        assert_eq!(c.cd_targets[State::END], single[State::END].means);
        let [start, moved] = State::ALL.map(|s| &c.movable_clusters[s]);
        assert!(start.is_empty() && moved.len() == 800);
        let part_of = |i: usize| moved.iter().find(|m| m.0 == i).map(|m| m.1).unwrap();
        let (a, b) = (part_of(2500), part_of(2900));
        assert!(a != b && moved.iter().all(|m| m.1 == if m.0 < 2900 { a } else { b }));
        for (part, centre) in [(0, [0.49, 0.49, 0.0]), (a.into(), [0.19, 0.19, 0.51]), (b.into(), [0.79, 0.79, 0.51])] {
            let found: [f32; 3] = c.centres[part];
            assert!((0..3).all(|i| (found[i] - centre[i]).abs() < 1e-4), "{part} {found:?}");
        }
        assert!((c.radii[0] - 0.5 * 0.49 * 2f32.sqrt()).abs() < 1e-4);
        assert!((c.radii[1] - 0.5 * 0.19 * 2f32.sqrt()).abs() < 1e-4);
    }

    /// A plate, a drawer that opens by 0.5 and one that closes by 0.3. Closed, a front is in the plane of the plate.
    fn opening_and_closing() -> PerState<Splats> {
        let plate: Vec<[f32; 3]> = (0..2500).map(|i| [(i % 50) as f32 * 0.02, (i / 50) as f32 * 0.02, 0.0]).collect();
        let at = |a: f32, b: f32| [plate.clone(), sheet(0.0, 0.0, a), sheet(0.6, 0.6, b)].concat();
        let of = |means| splats(means, [1.0, 0.0, 0.0, 0.0], 1.0);
        PerState::new(of(at(0.01, 0.31)), of(at(0.51, 0.01)))
    }

    #[test]
    fn a_part_that_closes_while_another_opens_has_a_centre() {
        let single = opening_and_closing();
        let with = |centre_states| {
            let config = CanonicalConfig { centre_states, max_matched: 300, ..CanonicalConfig::paper() };
            canonical_init(&single, 3, &config, &mut Pcg64Mcg::new(1)).unwrap()
        };
        let missed = |c: &Canonical, true_centre: [f32; 3]| {
            let far = |p: &[f32; 3]| (0..3).map(|a| (p[a] - true_centre[a]).powi(2)).sum::<f32>().sqrt();
            c.centres[1..].iter().map(far).fold(f32::INFINITY, f32::min)
        };
        let places = [[0.19, 0.19, 0.51], [0.79, 0.79, 0.31]];
        let both = with(CentreStates::Both);
        assert_eq!(State::ALL.map(|s| both.movable_clusters[s].len()), [400, 400]);
        assert!(places.iter().all(|p| missed(&both, *p) < 1e-3), "{:?}", both.centres);
        let one = with(CentreStates::One);
        assert!(places.iter().any(|p| missed(&one, *p) > 0.2), "{:?}", one.centres);
    }

    #[test]
    fn every_variant_changes_what_it_says_and_nothing_else() {
        let single = cabinet();
        let with = |change: fn(&mut CanonicalConfig)| {
            let mut config = CanonicalConfig { max_matched: 300, ..Default::default() };
            config.random.count = 500;
            change(&mut config);
            canonical_init(&single, 3, &config, &mut Pcg64Mcg::new(1)).unwrap()
        };
        let full = with(|_| {});
        let random = with(|c| c.start = CanonicalStart::Random);
        assert_eq!((random.splats.len(), random.splats.sh_degree), (500, 1));
        let inside = |p: &[f32; 3]| (0..2).all(|a| (p[a] - 0.49).abs() < 1.3 * 0.5);
        assert!(random.splats.means.iter().all(inside) && random.splats.means.iter().any(|p| p[0] < -0.1));
        // The generator is elsewhere by then, so parts may have changed places.
        let sorted = |c: &Canonical| {
            let mut centres = c.centres.clone();
            centres.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[2].total_cmp(&b[2])));
            centres
        };
        assert_eq!(sorted(&random), sorted(&full));

        let all = with(|c| c.centres = CentreSource::All);
        assert_eq!(all.splats, full.splats);
        // What lies far apart is separated without motion too, the largest being static; published clustering is not
        // as lucky and cuts the plate.
        assert!(all.movable_clusters[State::END].len() == 800 && all.centres[0] == full.centres[0]);
        let cut = with(|c| (c.centres, c.cluster) = (CentreSource::All, ClusterConfig::paper()));
        assert!(cut.movable_clusters[State::END].iter().any(|m| m.0 < 2500) && cut.centres[0] != full.centres[0]);
        let drawn = with(|c| c.centres = CentreSource::Random);
        assert_eq!(drawn.splats, full.splats);
        assert!(drawn.movable_clusters.iter().all(Vec::is_empty));
        assert!(drawn.centres.iter().all(|p| (p[0] - 0.49).abs() < 0.03 && (p[1] - 0.49).abs() < 0.03));
        assert!(drawn.centres[0] != drawn.centres[1] && drawn.radii.iter().all(|r| (r - 0.49).abs() < 0.05));
    }

    #[test]
    fn published_averaging_cancels_opposite_quaternions_and_pairs_stay_midway() {
        let single = cabinet();
        let paper = CanonicalConfig { max_matched: 300, ..CanonicalConfig::paper() };
        let m = midpoints(&single, &paper).0;
        assert!(m.len() == 300 && m.rotations.iter().all(|q| *q == [0.0; 4]));
        let (whole, _) = midpoints(&single, &CanonicalConfig::default());
        assert_eq!(whole.len(), 3300);
        let moved = whole.means.iter().filter(|p| (p[2] - 0.26).abs() < 1e-6).count();
        assert!(moved > 400, "{moved} midpoints lie half way");
    }

    #[test]
    fn unusable_input_is_refused_with_a_reason() {
        let init = |single: &PerState<Splats>, k: usize| {
            canonical_init(single, k, &CanonicalConfig::default(), &mut Pcg64Mcg::new(1)).unwrap_err()
        };
        let good = cabinet();
        assert_eq!(init(&good, 1), CanonicalError::Parts(1));
        let mut bad = good.clone();
        bad[State::END].means[7][2] = f32::NAN;
        assert_eq!(init(&bad, 2), CanonicalError::NotFinite { state: State::END });
        let mut bad = good.clone();
        bad[State::START].sh_degree = 0;
        assert_eq!(init(&bad, 2), CanonicalError::Degrees(0, 1));
        let empty = PerState::new(good[State::START].clone(), Splats::empty(1));
        assert!(matches!(init(&empty, 2), CanonicalError::Empty(_)));
    }

    #[test]
    fn states_that_are_the_same_have_no_static_part_yet_finite_centres() {
        let single = cabinet();
        let same = PerState::from_fn(|_| single[State::START].clone());
        let c = canonical_init(&same, 2, &CanonicalConfig::default(), &mut Pcg64Mcg::new(1)).unwrap();
        assert!(c.centres.iter().flatten().all(|v| v.is_finite()) && c.radii.iter().all(|r| *r > 0.0));
    }
}
