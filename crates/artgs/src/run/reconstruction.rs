//! The method in one call, on disk or in memory, and its three parts alone.

use super::stages::Run;
use super::{Error, FittedParts, Reconstructed};
use crate::config::{Config, Method};
use crate::discover::Discovery;
use crate::fit::{Cpu, Devices};
use crate::observer::Observer;
use crate::part_count::PartCount;
use crate::run::points::PartSource;
use crate::surface::PartMeshes;
use artgs_core::{Capture, Replica};
use artgs_io::run_folder::RunFolder;
use std::path::PathBuf;

/// What to reconstruct and how.
#[derive(Clone, Debug)]
pub struct Reconstruction<'a> {
    /// Photos of both states.
    pub capture: &'a Capture,
    /// All settings. The default method finds the number of parts unless `parts` gives it; the others need it.
    pub config: Config,
    /// What trains.
    pub devices: &'a dyn Devices,
    /// Take stages that an earlier run saved in the same folder, and apply its `corrections.json`.
    pub resume: bool,
    /// Names and wall-clock seconds of what was done for this run before it, such as the alignment of two recordings. They are part of
    /// [`Summary::seconds`](super::Summary) and of its total.
    pub preparation: Vec<(String, f64)>,
}

impl<'a> Reconstruction<'a> {
    /// The default method on the processor, from the start. It finds the number of parts.
    pub fn new(capture: &'a Capture) -> Self {
        Self { capture, config: Config::default(), devices: &Cpu, resume: false, preparation: Vec::new() }
    }

    /// The same with a known number of parts, or bounds of it; it counts the static part.
    pub fn with_parts(mut self, parts: impl Into<PartCount>) -> Self {
        self.config.parts = parts.into();
        self
    }

    /// Runs all stages, saves each in the folder `out` when it is finished, and writes the replica there. The same seed
    /// on the same machine gives the same files, as far as its devices do.
    pub fn run(&self, out: impl Into<PathBuf>, observer: &mut dyn Observer) -> Result<Replica, Error> {
        Ok(self.run_in(&RunFolder::new(out), observer)?.replica)
    }

    /// Like [`Reconstruction::run`]; returns everything that was computed.
    pub fn run_in(&self, folder: &RunFolder, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.compute_with(Some(folder), observer)
    }

    /// Runs all stages in memory: no file is read or written. The result is the one that [`Reconstruction::run`] gives
    /// in an empty folder; [`Reconstructed::save`] writes it.
    pub fn compute(&self, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.compute_with(None, observer)
    }

    fn compute_with(&self, folder: Option<&RunFolder>, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.check()?;
        let mut run = Run::open(self, folder, observer)?;
        match self.config.method {
            Method::Discover => {
                let depths = run.depths()?;
                let found = run.discover(&depths)?;
                let found = run.corrected(&depths, found)?;
                let (fitted, found) = run.articulate(found)?;
                let meshes = run.surface(&depths, &found, &fitted)?;
                run.assemble(fitted, meshes, Some(found))
            }
            Method::Registration => {
                let depths = run.captured_depths()?;
                let found = run.register(&depths)?;
                let found = run.corrected(&depths, found)?;
                let fitted = FittedParts { trained: None, parts: found.parts.clone() };
                let meshes = run.surface(&depths, &found, &fitted)?;
                run.assemble(fitted, meshes, Some(found))
            }
            Method::Paper => {
                run.warn_of_ignored_corrections();
                let single = run.single()?;
                let fitted = run.published(&single)?;
                let meshes = run.rendered_surface(&fitted)?;
                run.assemble(fitted, meshes, None)
            }
        }
    }

    /// Finds parts, joints and labelled surface points in memory; trains nothing, unless the capture has no depth.
    pub fn find_parts(&self, observer: &mut dyn Observer) -> Result<Discovery, Error> {
        self.find_parts_with(None, observer)
    }

    /// The same, saved in a folder for `found_parts` and for a run that resumes. Corrections are applied by that run,
    /// not here.
    pub fn find_parts_in(&self, folder: &RunFolder, observer: &mut dyn Observer) -> Result<Discovery, Error> {
        self.find_parts_with(Some(folder), observer)
    }

    fn find_parts_with(&self, folder: Option<&RunFolder>, observer: &mut dyn Observer) -> Result<Discovery, Error> {
        self.check()?;
        if !finds_parts(&self.config) {
            return Err(Error::PartsLearnt);
        }
        let mut run = Run::open(self, folder, observer)?;
        if self.config.method == Method::Registration {
            let depths = run.captured_depths()?;
            return run.register(&depths);
        }
        let depths = run.depths()?;
        run.discover(&depths)
    }

    /// Trains Gaussians on found parts, in memory. Part `k` of the result is part `k` of `found`.
    pub fn train(&self, found: &Discovery, observer: &mut dyn Observer) -> Result<FittedParts, Error> {
        Ok(Run::open(self, None, observer)?.articulate(found.clone())?.0)
    }

    /// Fuses the depth maps of both states into meshes of the found parts, in memory. Motions are those of `fitted` where
    /// it was trained, else the found ones.
    pub fn fuse(
        &self,
        found: &Discovery,
        fitted: Option<&FittedParts>,
        observer: &mut dyn Observer,
    ) -> Result<PartMeshes, Error> {
        let untrained = FittedParts { trained: None, parts: found.parts.clone() };
        let mut run = Run::open(self, None, observer)?;
        let depths = run.depths()?;
        run.surface(&depths, found, fitted.unwrap_or(&untrained))
    }

    fn check(&self) -> Result<(), Error> {
        self.config.check()?;
        Ok(self.config.check_part_count()?)
    }
}

/// True if parts are found before any training, so that they can be corrected.
pub fn finds_parts(config: &Config) -> bool {
    config.method != Method::Paper && config.start.parts == PartSource::Labels
}
