//! The stages, each a function from saved nouns to saved nouns.

use super::folder::{Folder, motion_parameters};
use super::points::{canonical_start, label_pixels};
use super::rendered::{part_meshes_from_renderings, rendered_depths};
use super::{Built, Error, Summary, assemble};
use crate::articulate::{PaperConfig, SkinStart, Stage, Start, articulate, paper_pipeline};
use crate::config::Config;
use crate::discover::{self, DepthPicture, Discovery, FoundPart, Scene};
use crate::fit::{StepStats, single::fit_single};
use crate::observer::{Event, Observer};
use crate::surface::{LabelledDepth, PartMeshes, SurfaceConfig, part_meshes};
use artgs_core::{Camera, Capture, DepthMap, Splats, View};
use rayon::prelude::*;
use std::borrow::Cow;
use std::path::Path;
use std::time::Instant;

/// Depth maps of the training views of both states.
pub(super) type Depths<'a> = [Vec<Cow<'a, DepthMap>>; 2];

/// A run under way.
pub(super) struct Run<'a> {
    capture: &'a Capture,
    folder: Folder,
    config: &'a Config,
    resume: bool,
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
        observer: &'a mut dyn Observer,
    ) -> Result<Self, Error> {
        let file = out.join("config.toml");
        if resume && let Ok(text) = std::fs::read_to_string(&file) {
            let earlier = Config::default().overridden_by(&text)?;
            if earlier != *config {
                return Err(Error::OtherSettings(out.display().to_string()));
            }
        }
        artgs_io::write_atomic(&file, config.to_toml().as_bytes())?;
        let mut run = Self {
            capture,
            folder: Folder::new(out),
            config,
            resume,
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
                let observer = &mut *run.observer;
                let seed = run.config.seed.wrapping_mul(2).wrapping_add(state as u64);
                let mut on_step = |s: StepStats| {
                    let stats = StepStats { step: s.step + state * steps, total: 2 * steps, ..s };
                    observer.event(progress("single", &stats));
                };
                fitted.push(fit_single(views, &run.config.single, seed, &mut on_step)?);
            }
            let end = fitted.pop().unwrap_or_default();
            let single = [fitted.pop().unwrap_or_default(), end];
            run.folder.save_single(&single)?;
            Ok(single)
        })
    }

    /// Depth of every training view: the capture's where all views have it, else that of Gaussians fitted to each state.
    pub(super) fn depths(&mut self) -> Result<Depths<'a>, Error> {
        let captured = |views: &'a [View]| -> Option<Vec<Cow<'a, DepthMap>>> {
            views.iter().map(|v| Some(Cow::Borrowed(v.depth.as_ref()?))).collect()
        };
        let [start, end] = self.train_views();
        if let (Some(start), Some(end)) = (captured(start), captured(end)) {
            return Ok([start, end]);
        }
        let single = self.single()?;
        self.observer.event(Event::note("the capture has no depth: parts are found from depth rendered by Gaussians"));
        Ok([0, 1].map(|s| {
            let views = self.train_views()[s];
            rendered_depths(&single[s], views).iter().map(|d| Cow::Owned(DepthMap::nearest(d))).collect()
        }))
    }

    /// Parts, joints and labelled points.
    pub(super) fn discover(&mut self, depths: &Depths<'a>, parts: usize) -> Result<Discovery, Error> {
        let found = self.stage("discover", Folder::load_discovery, |run| {
            let pictures = pictures(run.train_views(), depths);
            let scene = Scene::new([&pictures[0], &pictures[1]], &run.config.discover)?;
            let found = discover::discover(&scene, parts - 1, &run.config.discover)?;
            run.folder.save_discovery(&found)?;
            // As a resumed run would: files hold less than memory, and both must go on from the same.
            Ok(run.folder.load_discovery().unwrap_or(found))
        })?;
        found.warnings.iter().for_each(|w| self.warn(w.clone()));
        Ok(found)
    }

    /// Canonical Gaussians trained on both states with the found parts.
    pub(super) fn articulate(&mut self, found: &Discovery) -> Result<Built, Error> {
        let (trained, parts) = self.stage("articulate", Folder::load_trained, |run| {
            let (splats, labels) = canonical_start(found, &run.config.start);
            let start = Start { splats, skin: SkinStart::Labels(labels), joints: motion_parameters(&found.parts) };
            let config = &run.config.articulate;
            let observer = &mut *run.observer;
            let mut on_step = |s: StepStats| observer.event(progress("articulate", &s));
            let views = [&run.capture.states[0].train[..], &run.capture.states[1].train[..]];
            let trained = articulate(views, start, None, config, run.config.seed, &mut on_step)?;
            let parts: Vec<FoundPart> = found
                .parts
                .iter()
                .zip(&trained.joints)
                .map(|(p, j)| if config.learn_joints { FoundPart { motion: j.full_motion(), ..*p } } else { *p })
                .collect();
            run.folder.save_trained(&trained, &parts)?;
            Ok((trained, parts))
        })?;
        Ok(Built { trained, parts })
    }

    /// The published method from the Gaussians of each state on.
    pub(super) fn published(&mut self, single: &[Splats; 2], parts: usize) -> Result<Built, Error> {
        let (trained, parts) = self.stage("articulate", Folder::load_trained, |run| {
            let Config { canonical, types, articulate, .. } = run.config.clone();
            let config = PaperConfig { canonical, types, articulate };
            let observer = &mut *run.observer;
            let mut on_step = |stage: Stage, s: StepStats| {
                observer.event(progress(if stage == Stage::Types { "types" } else { "articulate" }, &s));
            };
            let views = [&run.capture.states[0].train[..], &run.capture.states[1].train[..]];
            let result = paper_pipeline(views, single, parts, &config, run.config.seed, &mut on_step)?;
            let half_angle = config.types.half_angle_deg.to_radians();
            let parts: Vec<FoundPart> = result
                .trained
                .joints
                .iter()
                .map(|j| FoundPart { kind: j.joint_kind(half_angle), motion: j.full_motion(), rms: 0.0 })
                .collect();
            run.folder.save_trained(&result.trained, &parts)?;
            Ok((result.trained, parts))
        })?;
        Ok(Built { trained, parts })
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
            |run| Ok(part_meshes_from_renderings(&built.trained, run.train_views(), &run.config.surface)),
        )
    }

    /// Everything a user opens.
    pub(super) fn assemble(mut self, built: &Built, meshes: &PartMeshes) -> Result<Summary, Error> {
        for (part, mesh) in meshes.parts.iter().enumerate().filter(|(_, m)| m[0].is_empty()) {
            let _ = mesh;
            self.warn(format!("part {part} has no surface: no view shows enough of it"));
        }
        self.stage(
            "assemble",
            |_| None,
            |run| {
                let rotate = run.config.articulate.rotate_sh;
                assemble::write_replica_files(&run.folder.root, built, meshes)?;
                assemble::write_splats(&run.folder.root, &built.trained)?;
                super::preview::write_preview(&run.folder.root, run.capture, built, rotate)?;
                run.summary.parts = built.parts.len() + 1;
                run.summary.gaussians = built.trained.splats.len();
                (run.summary.test, run.summary.train) = assemble::score_pictures(run.capture, &built.trained, rotate);
                Ok(())
            },
        )?;
        self.summary.total_seconds = self.begun.elapsed().as_secs_f64();
        self.summary.peak_memory_mib = assemble::peak_memory_mib();
        self.folder.write_json(&self.folder.root.join("metrics.json"), &self.summary)?;
        Ok(self.summary)
    }
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

fn progress(stage: &'static str, s: &StepStats) -> Event {
    Event::Progress {
        stage: stage.into(),
        step: s.step,
        total: s.total,
        loss: Some(s.loss),
        psnr: Some(s.psnr),
        gaussians: Some(s.gaussians),
    }
}
