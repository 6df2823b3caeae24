//! The stages, each a function from saved nouns to saved nouns.

use super::folder::{Folder, motion_parameters};
use super::following::Following;
use super::learnt::{relabelled, told_parts, uninformed_start};
use super::points::{PartSource, StartSource, canonical_start, label_pixels, scattered};
use super::rendered::{part_meshes_from_renderings, rendered_depths};
use super::{Built, Error, Summary, assemble};
use crate::articulation::{PaperConfig, SkinStart, Start, articulate, paper_pipeline};
use crate::config::Config;
use crate::discover::{self, DepthPicture, Discovery, Scene};
use crate::fit::{Devices, FitError, single::fit_single};
use crate::observer::{Event, Observer};
use crate::registration::{RegistrationError, register_parts};
use crate::surface::{LabelledDepth, PartMeshes, SurfaceConfig, part_meshes};
use artgs_core::{Camera, Capture, DepthMap, JointEstimate, STATE_NAMES, Splats, View};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

/// Depth maps of the training views of both states.
pub(super) type Depths<'a> = [Vec<Cow<'a, DepthMap>>; 2];

/// Where Gaussians of each state should be, for the Chamfer term.
type ChamferPoints = [Vec<[f32; 3]>; 2];

/// Joints with a smaller confidence are warned of; right ones have more than 0.9.
const DOUBTFUL: f64 = 0.5;
/// Corrections that the stages after discovery were made with.
const CORRECTED: &str = "stages/corrections.json";
/// The same of the replica: its stages may be made already with others, and it not yet.
pub(super) const ASSEMBLED: &str = "stages/corrections_assembled.json";
/// File that holds the fingerprint of the capture.
const MARK: &str = "stages/capture.txt";

/// A run under way.
pub(super) struct Run<'a> {
    capture: &'a Capture,
    folder: Folder,
    config: &'a Config,
    /// Saved stages are still good.
    resume: bool,
    /// An earlier run was to be gone on with.
    asked_to_resume: bool,
    devices: &'a dyn Devices,
    observer: &'a mut dyn Observer,
    begun: Instant,
    summary: Summary,
}

impl<'a> Run<'a> {
    /// Opens the folder and writes the resolved settings into it; refuses to resume under other settings.
    pub(super) fn open(
        capture: &'a Capture,
        out: &Path,
        config: &'a Config,
        resume: bool,
        devices: &'a dyn Devices,
        observer: &'a mut dyn Observer,
    ) -> Result<Self, Error> {
        let file = out.join("config.toml");
        if resume && let Ok(text) = std::fs::read_to_string(&file) {
            let earlier = Config::default().overridden_by(&text)?;
            if earlier != *config {
                return Err(Error::OtherSettings(out.display().to_string()));
            }
        }
        let (mark, own) = (out.join(MARK), fingerprint(capture));
        if resume && std::fs::read_to_string(&mark).is_ok_and(|earlier| earlier != own) {
            return Err(Error::OtherCapture(out.display().to_string()));
        }
        artgs_io::write_atomic(&mark, own.as_bytes())?;
        artgs_io::write_atomic(&file, config.to_toml().as_bytes())?;
        let mut run = Self {
            capture,
            folder: Folder::new(out),
            config,
            resume,
            asked_to_resume: resume,
            devices,
            observer,
            begun: Instant::now(),
            summary: Summary::default(),
        };
        capture.warnings.iter().for_each(|w| run.warn(w.clone()));
        Ok(run)
    }

    fn warn(&mut self, message: String) {
        self.observer.event(Event::warning(message.clone()));
        self.summary.warnings.push(message);
    }

    /// Takes a stage's saved result if resuming, else computes and thereby saves it. Once a stage is computed, all
    /// later ones are.
    fn stage<T>(
        &mut self,
        name: &'static str,
        load: impl FnOnce(&Folder) -> Option<T>,
        compute: impl FnOnce(&mut Self) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.observer.event(Event::started(name));
        let begun = Instant::now();
        if self.resume
            && let Some(result) = load(&self.folder)
        {
            self.observer.event(Event::finished(name, begun.elapsed().as_secs_f64(), true));
            return Ok(result);
        }
        self.resume = false;
        let result = compute(self)?;
        self.devices.notice().into_iter().for_each(|w| self.warn(w));
        let seconds = begun.elapsed().as_secs_f64();
        self.summary.seconds.push((name.into(), seconds));
        self.observer.event(Event::finished(name, seconds, false));
        Ok(result)
    }

    fn train_views(&self) -> [&'a [View]; 2] {
        [&self.capture.states[0].train, &self.capture.states[1].train]
    }

    /// Gaussians of each state alone.
    pub(super) fn single(&mut self) -> Result<[Splats; 2], Error> {
        self.stage("single", Folder::load_single, |run| {
            let mut fitted = Vec::new();
            for (state, views) in run.train_views().into_iter().enumerate() {
                let steps = run.config.single.steps;
                let seed = run.config.seed.wrapping_mul(2).wrapping_add(state as u64);
                let follow = Following::new(run.observer, run.devices, &mut run.summary.warnings, "single");
                let mut follow = follow.of_two(state, steps);
                fitted.push(fit_single(views, &run.config.single, seed, run.devices, &mut follow)?);
            }
            run.summary.device = Some(run.devices.name());
            let end = fitted.pop().unwrap_or_default();
            let single = [fitted.pop().unwrap_or_default(), end];
            run.folder.save_single(&single)?;
            Ok(single)
        })
    }

    /// Depth of every training view: the capture's where all views have it, else that of Gaussians fitted to each state.
    pub(super) fn depths(&mut self) -> Result<Depths<'a>, Error> {
        if let Ok(depths) = self.captured_depths() {
            return Ok(depths);
        }
        let single = self.single()?;
        self.observer.event(Event::note("the capture has no depth: parts are found from depth rendered by Gaussians"));
        Ok([0, 1].map(|s| {
            let views = self.train_views()[s];
            rendered_depths(&single[s], views).iter().map(|d| Cow::Owned(DepthMap::nearest(d))).collect()
        }))
    }

    /// The capture's own depth of every training view.
    pub(super) fn captured_depths(&self) -> Result<Depths<'a>, Error> {
        let captured = |state: usize| -> Result<Vec<Cow<'a, DepthMap>>, RegistrationError> {
            let views = self.train_views()[state].iter();
            let depths: Option<Vec<_>> = views.map(|v| Some(Cow::Borrowed(v.depth.as_ref()?))).collect();
            depths.ok_or(RegistrationError::NoDepth(STATE_NAMES[state]))
        };
        Ok([captured(0)?, captured(1)?])
    }

    fn scene(&self, depths: &Depths<'a>) -> Result<Scene, Error> {
        let pictures = pictures(self.train_views(), depths);
        Ok(Scene::new([&pictures[0], &pictures[1]], &self.config.discover)?)
    }

    /// Parts, joints and labelled points; only points where training is to learn the parts.
    pub(super) fn discover(&mut self, depths: &Depths<'a>, parts: usize) -> Result<Discovery, Error> {
        self.found("discover", |run| {
            let scene = run.scene(depths)?;
            Ok(match run.config.start.parts {
                PartSource::Labels => discover::discover(&scene, parts - 1, &run.config.discover)?,
                PartSource::Learnt => discover::undiscovered(&scene),
            })
        })
    }

    /// What was found, as `corrections.json` corrects it when a run is resumed. Whatever depends on it is made anew unless
    /// that was made from the same corrections.
    pub(super) fn corrected(&mut self, depths: &Depths<'a>, found: Discovery) -> Result<Discovery, Error> {
        let mark = self.folder.root.join(CORRECTED);
        let honoured = std::fs::read_to_string(&mark).unwrap_or_default();
        let learnt = self.config.start.parts == PartSource::Learnt;
        if learnt {
            self.leave_corrections();
        }
        let asked = self.asked_to_resume && !learnt;
        let corrections = if asked { artgs_io::read_corrections(&self.folder.root) } else { Ok(None) };
        let corrections = corrections.map_err(Error::Corrections)?.filter(|c| !c.is_empty());
        let text = corrections.as_ref().map(artgs_io::Corrections::text).unwrap_or_default();
        // Before anything is forgotten: corrections that are refused must not cost what was trained.
        let corrected = match &corrections {
            None => found,
            Some(corrections) => self.apply(depths, &found, corrections)?,
        };
        if text != honoured {
            self.resume = false;
            // Once it is written, a run that is stopped and resumed must not find what was made before.
            self.folder.forget_trained()?;
            artgs_io::write_atomic(&mark, text.as_bytes())?;
        }
        Ok(corrected)
    }

    fn apply(
        &mut self,
        depths: &Depths<'a>,
        found: &Discovery,
        corrections: &artgs_io::Corrections,
    ) -> Result<Discovery, Error> {
        self.observer.event(Event::started("correct"));
        let begun = Instant::now();
        let corrected = discover::correct(&self.scene(depths)?, found, corrections, &self.config.discover)?;
        corrected.warnings.iter().for_each(|w| self.warn(w.clone()));
        self.observer.event(Event::finished("correct", begun.elapsed().as_secs_f64(), false));
        Ok(corrected)
    }

    /// Says so where corrections are there that learnt parts cannot honour.
    pub(super) fn leave_corrections(&mut self) {
        let file = self.folder.root.join(artgs_io::corrections::CORRECTIONS_FILE);
        if self.asked_to_resume && file.is_file() {
            let file = file.display();
            self.warn(format!("{file} is left aside: it corrects parts found from depth, and here they are learnt"));
        }
    }

    /// The same by the baseline.
    pub(super) fn register(&mut self, depths: &Depths<'a>, parts: usize) -> Result<Discovery, Error> {
        self.found("register", |run| {
            let Config { registration, seed, .. } = run.config;
            Ok(register_parts(&run.scene(depths)?, parts - 1, registration, *seed)?)
        })
    }

    fn found(
        &mut self,
        name: &'static str,
        find: impl FnOnce(&Self) -> Result<Discovery, Error>,
    ) -> Result<Discovery, Error> {
        let found = self.stage(name, Folder::load_discovery, |run| {
            let found = find(run)?;
            run.folder.save_discovery(&found)?;
            // As a resumed run would: files hold less than memory, and both must go on from the same.
            Ok(run.folder.load_discovery().unwrap_or(found))
        })?;
        found.warnings.iter().for_each(|w| self.warn(w.clone()));
        Ok(found)
    }

    /// Canonical Gaussians trained on both states with the found parts, or with parts that training learns; these then
    /// label the points.
    pub(super) fn articulate(&mut self, found: Discovery, parts: usize) -> Result<(Built, Discovery), Error> {
        let learnt = self.config.start.parts == PartSource::Learnt;
        let (trained, parts) = self.stage("articulate", Folder::load_trained, |run| {
            let config = &run.config.articulate;
            let (start, targets) = run.start(&found, parts)?;
            let mut follow = Following::new(run.observer, run.devices, &mut run.summary.warnings, "articulate");
            let views = [&run.capture.states[0].train[..], &run.capture.states[1].train[..]];
            let trained =
                articulate(views, start, targets.as_ref(), config, run.config.seed, run.devices, &mut follow)?;
            run.summary.device = Some(run.devices.name());
            let told = if learnt {
                told_parts(&trained, run.config.types.half_angle_deg.to_radians())
            } else if !run.config.discover.decide_joints {
                told_parts(&trained, 0.5 * run.config.discover.revolute_deg.to_radians())
            } else {
                let pairs = found.parts.iter().zip(&trained.joints);
                let learn = config.learn_joints;
                pairs.map(|(p, j)| if learn { JointEstimate { motion: j.full_motion(), ..*p } } else { *p }).collect()
            };
            run.folder.save_trained(&trained, &told)?;
            Ok((trained, told))
        })?;
        let found = if learnt { relabelled(&found, &trained) } else { found };
        Ok((Built { trained: Some(trained), parts }, found))
    }

    /// What training begins with, and targets of the Chamfer term if parts are to be learnt.
    fn start(&self, found: &Discovery, parts: usize) -> Result<(Start, Option<ChamferPoints>), Error> {
        let config = self.config;
        if config.start.parts == PartSource::Learnt {
            let (start, canonical) = uninformed_start(found, parts, config).map_err(FitError::from)?;
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

    /// The published method from the Gaussians of each state on.
    pub(super) fn published(&mut self, single: &[Splats; 2], parts: usize) -> Result<Built, Error> {
        let (trained, parts) = self.stage("articulate", Folder::load_trained, |run| {
            let Config { canonical, types, articulate, .. } = run.config.clone();
            let config = PaperConfig { canonical, types, articulate };
            let mut follow = Following::new(run.observer, run.devices, &mut run.summary.warnings, "articulate");
            let views = [&run.capture.states[0].train[..], &run.capture.states[1].train[..]];
            let result = paper_pipeline(views, single, parts, &config, run.config.seed, run.devices, &mut follow)?;
            run.summary.device = Some(run.devices.name());
            let parts = told_parts(&result.trained, config.types.half_angle_deg.to_radians());
            run.folder.save_trained(&result.trained, &parts)?;
            Ok((result.trained, parts))
        })?;
        Ok(Built { trained: Some(trained), parts })
    }

    /// Part meshes from depth maps whose pixels are labelled by the nearest labelled points.
    pub(super) fn surface(
        &mut self,
        depths: &Depths<'a>,
        found: &Discovery,
        built: &Built,
    ) -> Result<PartMeshes, Error> {
        self.stage(
            "surface",
            |_| None,
            |run| {
                let pictures = pictures(run.train_views(), depths);
                let views = thinned(&pictures, &run.config.surface);
                let plain = [0, 1].map(|s| views[s].iter().map(|v| &v.depth[..]).collect::<Vec<&[f32]>>());
                let cameras = [0, 1].map(|s| views[s].iter().map(|v| v.camera).collect::<Vec<_>>());
                let labels = [0, 1].map(|s| label_pixels(&cameras[s], &plain[s], &found.clouds[s], &found.labels[s]));
                let labelled = [0, 1].map(|s| {
                    let pixels = views[s].iter().zip(&labels[s]);
                    pixels.map(|(v, labels)| v.labelled(labels)).collect::<Vec<LabelledDepth>>()
                });
                let halves = built.half_motions();
                Ok(part_meshes([&labelled[0], &labelled[1]], &halves, &run.config.surface)?.meshes)
            },
        )
    }

    /// Part meshes from renderings of each part alone.
    pub(super) fn rendered_surface(&mut self, built: &Built) -> Result<PartMeshes, Error> {
        self.stage(
            "surface",
            |_| None,
            |run| {
                let meshes = |t| part_meshes_from_renderings(t, run.train_views(), &run.config.surface);
                Ok(built.trained.as_ref().map(meshes).unwrap_or_default())
            },
        )
    }

    /// Everything a user opens.
    pub(super) fn assemble(mut self, built: &Built, meshes: &PartMeshes) -> Result<Summary, Error> {
        for (part, _) in meshes.parts.iter().enumerate().filter(|(_, m)| m[0].is_empty()) {
            self.warn(format!("part {part} has no surface: no view shows enough of it"));
        }
        for (k, found) in built.parts.iter().enumerate() {
            if let Some(share) = found.confidence.filter(|&c| c < DOUBTFUL) {
                self.warn(format!(
                    "part {}: its joint takes only {:.0} % of its points onto a surface of the other state; look at it in artgs view",
                    k + 1,
                    100.0 * share
                ));
            }
        }
        self.stage(
            "assemble",
            |_| None,
            |run| {
                let rotate = run.config.articulate.rotate_sh;
                assemble::write_replica_files(&run.folder.root, built, meshes)?;
                run.summary.parts = built.parts.len() + 1;
                if let Some(trained) = &built.trained {
                    assemble::write_splats(&run.folder.root, trained)?;
                    super::preview::write_preview(&run.folder.root, run.capture, trained, &built.parts, rotate)?;
                    run.summary.gaussians = trained.splats.len();
                    (run.summary.test, run.summary.train) = assemble::score_pictures(run.capture, trained, rotate);
                }
                Ok(())
            },
        )?;
        let root = &self.folder.root;
        let corrected = std::fs::read(root.join(CORRECTED)).unwrap_or_default();
        artgs_io::write_atomic(&root.join(ASSEMBLED), &corrected)?;
        self.summary.total_seconds = self.begun.elapsed().as_secs_f64();
        self.summary.peak_memory_mib = assemble::peak_memory_mib();
        self.folder.write_json(&self.folder.root.join("metrics.json"), &self.summary)?;
        Ok(self.summary)
    }
}

/// True if a run's folder says that it was made from this capture, none if it says nothing.
pub fn made_from(out: &Path, capture: &Capture) -> Option<bool> {
    let mark = std::fs::read_to_string(out.join(MARK)).ok()?;
    Some(mark == fingerprint(capture))
}

/// Tells captures apart: names, cameras, and some of the pixels of the training views.
fn fingerprint(capture: &Capture) -> String {
    const PIXELS: usize = 97;
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        bytes.iter().for_each(|b| hash = (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01b3));
    };
    for view in capture.states.iter().flat_map(|s| &s.train) {
        add(view.name.as_bytes());
        let eye = view.camera.position();
        [eye.x, eye.y, eye.z, view.camera.intrinsics.fx].iter().for_each(|v| add(&v.to_le_bytes()));
        view.rgba.iter().step_by(PIXELS).for_each(|pixel| add(pixel));
        view.depth.iter().for_each(|d| d.counts().iter().step_by(PIXELS).for_each(|c| add(&c.to_le_bytes())));
    }
    format!("{hash:016x}\n")
}

/// Training views of both states with their depth.
fn pictures<'p>(views: [&'p [View]; 2], depths: &'p Depths<'_>) -> [Vec<DepthPicture<'p>>; 2] {
    [0, 1].map(|s| views[s].iter().zip(&depths[s]).map(|(view, depth)| DepthPicture { view, depth }).collect())
}

/// A view as fusion reads it.
struct Fused<'p> {
    camera: Camera,
    rgba: Cow<'p, [[u8; 4]]>,
    depth: Vec<f32>,
}

impl Fused<'_> {
    fn labelled<'v>(&'v self, labels: &'v [u16]) -> LabelledDepth<'v> {
        LabelledDepth { camera: self.camera, depth: &self.depth, rgba: Some(&self.rgba), labels }
    }
}

/// Views at the size that voxels ask for.
fn thinned<'p>(pictures: &[Vec<DepthPicture<'p>>; 2], config: &SurfaceConfig) -> [Vec<Fused<'p>>; 2] {
    // A pixel may be a little larger than a voxel.
    const PIXEL_PER_VOXEL: f64 = 1.2;
    let fitting = || discover::pixel_step([&pictures[0], &pictures[1]], PIXEL_PER_VOXEL / config.resolution);
    let step = if config.voxel.is_none() { fitting() } else { 1 };
    let fused = |picture: &DepthPicture<'p>| {
        let (camera, depth) = picture.thinned_depth(step);
        Fused { camera, rgba: picture.thinned_colors(step), depth: depth.iter().collect() }
    };
    [0, 1].map(|s| pictures[s].par_iter().map(fused).collect())
}
