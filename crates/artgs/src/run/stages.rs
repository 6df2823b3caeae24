//! The stages of a run. With a folder each saves its result there and, if the run resumes, takes a saved one.

use super::checkpoint::{self, StageTimes};
use super::fingerprint::StageKeys;
use super::following::Following;
use super::learnt::{joints_of, relabelled, uninformed_start};
use super::points::{canonical_start, motion_parameters, scattered};
use super::rendered::{part_meshes_from_renderings, rendered_depths};
use super::{Error, FittedParts, Reconstruction, Summary, fusion, refined};
use crate::articulation::{SkinStart, Start, Trained, articulate};
use crate::config::Config;
use crate::discover::{self, DepthPicture, DiscoverError, Discovery, Scene};
use crate::fit::{FitError, single::fit_single};
use crate::observer::{Event, Observer, percent, within};
use crate::prepare::RENDERED_DEPTH;
use crate::published::{PaperConfig, paper_pipeline};
use crate::registration::{RegistrationError, register_parts};
use crate::start::{PartSource, StartSource};
use crate::surface::PartMeshes;
use artgs_core::{Capture, DepthMap, JointEstimate, PerState, Splats, State, View};
use artgs_io::run_folder::{RunFolder, save_json};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::borrow::Cow;
use std::time::Instant;

/// Depth maps of the training views of both states.
pub(super) type Depths<'a> = PerState<Vec<Cow<'a, DepthMap>>>;

/// Where Gaussians of each state should be, for the Chamfer term.
type ChamferPoints = PerState<Vec<[f32; 3]>>;

/// A run in progress.
pub(super) struct Run<'a> {
    pub(super) what: &'a Reconstruction<'a>,
    pub(super) capture: &'a Capture,
    pub(super) config: &'a Config,
    pub(super) folder: Option<&'a RunFolder>,
    /// True as long as the saved results of stages are still valid.
    pub(super) reuse: bool,
    pub(super) observer: &'a mut dyn Observer,
    pub(super) begun: Instant,
    pub(super) summary: Summary,
    times: StageTimes,
    keys: StageKeys,
}

impl<'a> Run<'a> {
    /// Opens the folder and writes the complete settings into it. A run that resumes takes the saved results of those stages
    /// whose capture and settings have not changed.
    pub(super) fn open(
        what: &'a Reconstruction<'a>,
        folder: Option<&'a RunFolder>,
        observer: &'a mut dyn Observer,
    ) -> Result<Self, Error> {
        let prepared = what.prepared;
        let (capture, config) = (&prepared.capture, &prepared.config);
        let resume = what.resume && folder.is_some();
        let mut times = StageTimes::new();
        if let Some(folder) = folder {
            if what.resume {
                times = checkpoint::load_times(folder);
            }
            folder.save_config(&config.to_toml()?)?;
        }
        times.extend(prepared.seconds());
        let keys = StageKeys::new(folder, capture, config, resume)?;
        let (begun, summary) =
            (Instant::now(), Summary { seconds: prepared.seconds().collect(), ..Summary::default() });
        let mut run = Self { what, capture, config, folder, reuse: resume, observer, begun, summary, times, keys };
        capture.warnings.iter().for_each(|w| run.warn(w.clone()));
        Ok(run)
    }

    pub(super) fn warn(&mut self, message: String) {
        self.observer.event(Event::warning(message.clone()));
        self.summary.warnings.push(message);
    }

    /// Takes a stage's saved result if it is still valid, else computes and saves it. Once a stage is computed, all later
    /// ones are.
    pub(super) fn stage<T>(
        &mut self,
        name: &'static str,
        load: impl FnOnce(&RunFolder) -> Option<T>,
        compute: impl FnOnce(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.observer.event(Event::started(name));
        let begun = Instant::now();
        let valid = self.keys.is_valid(name);
        if self.reuse && valid == Some(false) {
            self.observer.event(Event::note(format!(
                "the capture, the settings or the program changed since {name} was computed: it and all later stages are \
                 recomputed"
            )));
        }
        // A result without a key is of an earlier version, or of a run that was interrupted while it was saved.
        self.reuse &= valid == Some(true);
        let saved = self.folder.filter(|_| self.reuse).and_then(load);
        if let Some(result) = saved {
            let earlier = self.times.get(name).map(|seconds| (name.to_string(), *seconds));
            self.summary.seconds.extend(earlier);
            self.observer.event(Event::finished(name, begun.elapsed().as_secs_f64(), true));
            return Ok(result);
        }
        self.reuse = false;
        if let Some(folder) = self.folder {
            self.keys.forget(name, folder)?;
        }
        let result = compute(self)?;
        self.what.devices.notice().into_iter().for_each(|w| self.warn(w));
        self.computed(name, begun)?;
        Ok(result)
    }

    /// Records that a stage was computed.
    pub(super) fn computed(&mut self, name: &'static str, begun: Instant) -> Result<(), Error> {
        let seconds = begun.elapsed().as_secs_f64();
        self.summary.seconds.push((name.into(), seconds));
        self.times.insert(name.into(), seconds);
        if let Some(folder) = self.folder {
            self.keys.computed(name, folder)?;
            checkpoint::save_times(folder, &self.times)?;
        }
        self.observer.event(Event::finished(name, seconds, false));
        Ok(())
    }

    /// Does something with the folder if there is one.
    pub(super) fn save(&self, save: impl FnOnce(&RunFolder) -> Result<(), Error>) -> Result<(), Error> {
        self.folder.map_or(Ok(()), save)
    }

    fn train_views(&self) -> PerState<&'a [View]> {
        PerState::from_fn(|state| &self.capture.states[state].train[..])
    }

    /// Gaussians of each state alone.
    pub(super) fn single(&mut self) -> Result<PerState<Splats>, Error> {
        self.stage("single", checkpoint::load_single, |run| {
            let (config, devices) = (&run.config.single, run.what.devices);
            let mut fit = |state: State| {
                let views = &run.capture.states[state].train;
                let seed = run.config.seed.wrapping_mul(2).wrapping_add(state.index() as u64);
                let follow = Following::new(run.observer, devices, &mut run.summary.warnings, "single");
                fit_single(views, config, seed, devices, &mut follow.of_two(state, config.steps))
            };
            let single = PerState::new(fit(State::START)?, fit(State::END)?);
            run.summary.device = Some(devices.name());
            run.save(|folder| checkpoint::save_single(folder, &single))?;
            Ok(single)
        })
    }

    /// Depth of every training view: the capture's where all views have it, else that of Gaussians fitted to each state.
    pub(super) fn depths(&mut self) -> Result<Depths<'a>, Error> {
        if let Ok(depths) = self.captured_depths() {
            return Ok(depths);
        }
        let single = self.single()?;
        self.observer.event(Event::note(RENDERED_DEPTH));
        Ok(PerState::from_fn(|state| {
            let views = self.train_views()[state];
            rendered_depths(&single[state], views).iter().map(|d| Cow::Owned(DepthMap::nearest(d))).collect()
        }))
    }

    /// The capture's own depth of every training view.
    pub(super) fn captured_depths(&self) -> Result<Depths<'a>, Error> {
        let captured = |state: State| -> Result<Vec<Cow<'a, DepthMap>>, RegistrationError> {
            let views = self.train_views()[state].iter();
            let depths: Option<Vec<_>> = views.map(|v| Some(Cow::Borrowed(v.depth.as_ref()?))).collect();
            depths.ok_or(RegistrationError::NoDepth(state.name()))
        };
        Ok(PerState::from_fn(captured).transpose()?)
    }

    pub(super) fn scene(&self, depths: &Depths<'a>) -> Result<Scene, Error> {
        let pictures = depth_pictures(self.train_views(), depths);
        Ok(Scene::new(pictures.as_ref().map(Vec::as_slice), &self.config.discover)?)
    }

    /// Parts, joints and labelled points; only points where training is to learn the parts.
    pub(super) fn discover(&mut self, depths: &Depths<'a>) -> Result<Discovery, Error> {
        /// Share of the work until the scene is prepared.
        const PREPARED: f64 = 0.25;
        self.find("discover", |run| {
            percent(run.observer, "discover")(0.0);
            let (scene, config) = (run.scene(depths)?, run.config);
            if config.start.parts == PartSource::Learnt {
                return Ok(discover::without_parts(&scene));
            }
            let mut done = percent(run.observer, "discover");
            let mut found = within(&mut done, PREPARED, 1.0);
            match discover::discover_with_progress(&scene, config.parts.movable(), &config.discover, &mut found) {
                Err(DiscoverError::NothingMoved) => Ok(nothing_moved(&scene)),
                Ok(found) if found.parts.is_empty() => Ok(nothing_explained(found)),
                found => Ok(found?),
            }
        })
    }

    /// The same by the baseline.
    pub(super) fn register(&mut self, depths: &Depths<'a>) -> Result<Discovery, Error> {
        self.find("register", |run| {
            let Config { registration, seed, .. } = run.config;
            let movable = run.config.known_parts()?.saturating_sub(1);
            let scene = run.scene(depths)?;
            match register_parts(&scene, movable, registration, *seed) {
                Err(RegistrationError::Discover(DiscoverError::NothingMoved)) => Ok(nothing_moved(&scene)),
                found => Ok(found?),
            }
        })
    }

    fn find(
        &mut self,
        name: &'static str,
        find: impl FnOnce(&mut Self) -> Result<Discovery, Error>,
    ) -> Result<Discovery, Error> {
        let found = self.stage(name, checkpoint::load_discovery, |run| {
            let found = find(run)?;
            run.save(|folder| checkpoint::save_discovery(folder, &found))?;
            Ok(checkpoint::as_saved(found))
        })?;
        found.warnings.iter().for_each(|w| self.warn(w.clone()));
        Ok(found)
    }

    /// Canonical Gaussians trained on both states with the found parts, or with parts that training learns; these then
    /// label the points.
    pub(super) fn articulate(&mut self, found: Discovery) -> Result<(FittedParts, Discovery), Error> {
        /// Steps where nothing moved: there is no joint to fit, only colours.
        const STILL_STEPS: usize = 250;
        let learnt = self.config.start.parts == PartSource::Learnt;
        let (trained, parts) = self.stage("articulate", checkpoint::load_trained, |run| {
            let (mut config, devices) = (run.config.articulate.clone(), run.what.devices);
            if !learnt && found.parts.is_empty() {
                config.steps = config.steps.min(STILL_STEPS);
            }
            let improved = run.improved_by_training(&found);
            config.learn_joints |= improved.contains(&true);
            let (start, targets) = run.start(&found)?;
            let mut follow = Following::new(run.observer, devices, &mut run.summary.warnings, "articulate");
            let views = views_of(run.what);
            let mut trained =
                articulate(views, start, targets.as_ref(), &config, run.config.seed, devices, &mut follow)?;
            run.summary.device = Some(devices.name());
            let parts = run.joints_after_training(&found, &mut trained, &improved);
            run.save(|folder| checkpoint::save_trained(folder, &trained, &parts))?;
            Ok((trained, parts))
        })?;
        let found = if learnt { relabelled(&found, &trained) } else { found };
        Ok((FittedParts { trained: Some(trained), parts }, found))
    }

    /// Which motions of found parts training improves, `[K - 1]`.
    fn improved_by_training(&self, found: &Discovery) -> Vec<bool> {
        let Config { start, discover, articulate, .. } = self.config;
        let noisy = articulate.learn_noisy_joints && discover.decide_joints && start.parts == PartSource::Labels;
        match articulate.learn_joints {
            false if noisy => refined::noisy_joints(found, self.train_views()),
            learnt => vec![learnt; found.parts.len()],
        }
    }

    /// Joints of the parts after training, where those that are `improved` were learnt.
    fn joints_after_training(&self, found: &Discovery, trained: &mut Trained, improved: &[bool]) -> Vec<JointEstimate> {
        let Config { start, types, discover, articulate, .. } = self.config;
        if start.parts == PartSource::Learnt {
            return joints_of(trained, types.half_angle_deg.to_radians());
        }
        if !discover.decide_joints {
            return joints_of(trained, 0.5 * discover.revolute_deg.to_radians());
        }
        if !improved.contains(&true) {
            return found.parts.clone();
        }
        if !articulate.learn_joints {
            refined::keep_others(found, trained, improved);
        }
        refined::refined(found, trained)
    }

    /// What training begins with, and targets of the Chamfer term if parts are to be learnt.
    fn start(&self, found: &Discovery) -> Result<(Start, Option<ChamferPoints>), Error> {
        let config = self.config;
        if config.start.parts == PartSource::Learnt {
            let (start, canonical) = uninformed_start(found, config.known_parts()?, config).map_err(FitError::from)?;
            return Ok((start, Some(canonical.cd_targets)));
        }
        let mut labelled = canonical_start(found, &config.start);
        if config.start.from == StartSource::Random {
            let mut rng = Pcg64Mcg::seed_from_u64(config.seed);
            labelled = scattered(&labelled, config.start.sh_degree, &mut rng)?;
        }
        let (splats, labels) = labelled;
        Ok((Start { splats, skin: SkinStart::Labels(labels), joints: motion_parameters(&found.parts) }, None))
    }

    /// The published method from the Gaussians of each state to trained parts.
    pub(super) fn published(&mut self, single: &PerState<Splats>) -> Result<FittedParts, Error> {
        let (trained, parts) = self.stage("articulate", checkpoint::load_trained, |run| {
            let devices = run.what.devices;
            let Config { canonical, types, articulate, .. } = run.config.clone();
            let config = PaperConfig { canonical, types, articulate };
            let mut follow = Following::new(run.observer, devices, &mut run.summary.warnings, "articulate");
            let (views, seed) = (views_of(run.what), run.config.seed);
            let parts = run.config.known_parts()?;
            let result = paper_pipeline(views, single, parts, &config, seed, devices, &mut follow)?;
            run.summary.device = Some(devices.name());
            let parts = joints_of(&result.trained, config.types.half_angle_deg.to_radians());
            run.save(|folder| Ok(save_json(&folder.published_trace(), &result.trace)?))?;
            run.save(|folder| checkpoint::save_trained(folder, &result.trained, &parts))?;
            Ok((result.trained, parts))
        })?;
        Ok(FittedParts { trained: Some(trained), parts })
    }

    /// Part meshes from depth maps whose pixels are labelled by the nearest labelled points.
    pub(super) fn surface(
        &mut self,
        depths: &Depths<'a>,
        found: &Discovery,
        fitted: &FittedParts,
    ) -> Result<PartMeshes, Error> {
        self.stage(
            "surface",
            |_| None,
            |run| {
                let pictures = depth_pictures(run.train_views(), depths);
                let done = &mut percent(run.observer, "surface");
                Ok(fusion::fuse_labelled(&pictures, found, &fitted.half_motions(), &run.config.surface, done)?)
            },
        )
    }

    /// Part meshes from renderings of each part alone.
    pub(super) fn rendered_surface(&mut self, fitted: &FittedParts) -> Result<PartMeshes, Error> {
        self.stage(
            "surface",
            |_| None,
            |run| {
                let meshes = |t| part_meshes_from_renderings(t, run.train_views(), &run.config.surface);
                Ok(fitted.trained.as_ref().map(meshes).unwrap_or_default())
            },
        )
    }
}

/// One static part, where nothing moved.
fn nothing_moved(scene: &Scene) -> Discovery {
    let warning = format!("{}; the replica is one part without joints", DiscoverError::NothingMoved);
    Discovery { warnings: vec![warning], ..discover::without_parts(scene) }
}

/// One static part, where noise or a misalignment looks like motion.
fn nothing_explained(found: Discovery) -> Discovery {
    let warning = "nothing moved by more than the errors of depth and poses; the replica is one part without joints; if a part moved, \
                   open it further";
    Discovery { warnings: vec![warning.into()], ..found }
}

fn views_of<'a>(what: &Reconstruction<'a>) -> PerState<&'a [View]> {
    PerState::from_fn(|state| &what.prepared.capture.states[state].train[..])
}

/// Training views of both states with their depth.
fn depth_pictures<'p>(views: PerState<&'p [View]>, depths: &'p Depths<'_>) -> PerState<Vec<DepthPicture<'p>>> {
    PerState::from_fn(|state| {
        let pairs = views[state].iter().zip(&depths[state]);
        pairs.map(|(view, depth)| DepthPicture { view, depth }).collect()
    })
}
