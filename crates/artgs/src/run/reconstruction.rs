//! The method in one call, on disk or in memory, and its three parts alone.

use super::stages::Run;
use super::{Earlier, Error, FittedParts, Output, Reconstructed};
use crate::config::{Config, Method};
use crate::discover::Discovery;
use crate::fit::{Chosen, Cpu, Devices};
use crate::observer::{Event, JsonLines, Observer, Tee};
use crate::prepare::{Prepared, Request};
use crate::start::PartSource;
use crate::surface::PartMeshes;
use artgs_core::Replica;
use artgs_io::FileError;
use artgs_io::run_folder::RunFolder;
use std::path::PathBuf;

/// The stages of a run on a prepared capture.
#[derive(Clone, Copy, Debug)]
pub struct Reconstruction<'a> {
    /// Photos of both states, and all settings.
    pub prepared: &'a Prepared,
    /// What trains.
    pub devices: &'a dyn Devices,
    /// Take stages that an earlier run saved in the same folder, and apply its `corrections.json`.
    pub resume: bool,
}

impl<'a> Reconstruction<'a> {
    /// On the processor, from the start.
    pub fn new(prepared: &'a Prepared) -> Self {
        Self { prepared, devices: &Cpu, resume: false }
    }

    /// Runs all stages, saves each in the folder `out` when it is finished, and writes the replica there, with the events of the run and
    /// where the photos are. The same seed on the same machine gives the same files, as far as its devices do. The folder is neither refused nor locked: [`Output`] does that.
    pub fn run(&self, out: impl Into<PathBuf>, observer: &mut dyn Observer) -> Result<Replica, Error> {
        Ok(self.run_in(&RunFolder::new(out), observer)?.replica)
    }

    /// Like [`Reconstruction::run`]; returns everything that was computed.
    pub fn run_in(&self, folder: &RunFolder, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.logged(folder, observer, |observer| self.compute_with(Some(folder), observer))
    }

    /// Runs all stages in memory: no file is read or written. The result is the one that [`Reconstruction::run`] gives
    /// in an empty folder; [`Reconstructed::save`] writes it.
    pub fn compute(&self, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.compute_with(None, observer)
    }

    /// Does something in a folder, which gets the photos and the events, and a note where the capture is refused.
    fn logged<T>(
        &self,
        folder: &RunFolder,
        observer: &mut dyn Observer,
        act: impl FnOnce(&mut dyn Observer) -> Result<T, Error>,
    ) -> Result<T, Error> {
        self.check()?;
        folder.create()?;
        folder.begin(self.resume)?;
        self.prepared.save_photos(folder)?;
        let path = folder.events();
        let failed = |source| FileError::Write { path: path.clone(), source };
        let mut log = JsonLines::append(&path).map_err(failed)?;
        self.prepared.before.iter().for_each(|event| log.event(event.clone()));
        let result = act(&mut Tee(&mut log, observer));
        if let Err(error) = &result
            && error.is_bad_input()
            && !self.resume
        {
            // The refusal itself matters more than a note of it.
            let _ = folder.note_refusal(&error.to_string());
        }
        let logged = log.finish().map_err(failed);
        let result = result?;
        logged?;
        Ok(result)
    }

    fn compute_with(&self, folder: Option<&RunFolder>, observer: &mut dyn Observer) -> Result<Reconstructed, Error> {
        self.check()?;
        let mut run = Run::open(self, folder, observer)?;
        match self.prepared.config.method {
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
        self.require_parts()?;
        self.logged(folder, observer, |observer| self.find_parts_with(Some(folder), observer))
    }

    fn find_parts_with(&self, folder: Option<&RunFolder>, observer: &mut dyn Observer) -> Result<Discovery, Error> {
        self.check()?;
        self.require_parts()?;
        let mut run = Run::open(self, folder, observer)?;
        if self.prepared.config.method == Method::Registration {
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

    fn require_parts(&self) -> Result<(), Error> {
        if finds_parts(&self.prepared.config) { Ok(()) } else { Err(Error::PartsLearnt) }
    }

    fn check(&self) -> Result<(), Error> {
        self.prepared.config.check()?;
        Ok(self.prepared.config.check_part_count()?)
    }
}

/// How a request is run.
#[derive(Clone, Copy, Debug)]
pub struct RunOptions<'a> {
    /// What to do about an earlier run in the folder.
    pub earlier: Earlier,
    /// What trains, as `artgs_gpu::open` opens it; none: the processor.
    pub device: Option<&'a Chosen>,
    /// Who others see that find the folder locked.
    pub owner: &'a str,
}

impl Default for RunOptions<'_> {
    /// A new folder, and the processor.
    fn default() -> Self {
        Self { earlier: Earlier::Refuse, device: None, owner: "a program that uses artgs" }
    }
}

impl Request {
    /// Makes the replica in the folder `out`, which must be new or empty, on the processor.
    pub fn run(self, out: impl Into<PathBuf>, observer: &mut dyn Observer) -> Result<Replica, Error> {
        Ok(self.run_with(out, &RunOptions::default(), observer)?.replica)
    }

    /// Makes the replica in the folder `out` as the program does: [`Request::begin`], then all stages.
    pub fn run_with(
        self,
        out: impl Into<PathBuf>,
        options: &RunOptions<'_>,
        observer: &mut dyn Observer,
    ) -> Result<Reconstructed, Error> {
        let begun = self.begin(out, options, observer)?;
        begun.reconstruction(options.device).run_in(begun.output.folder(), observer)
    }

    /// Refuses the folder `out` or prepares the input and locks the folder. Reports the device, which is part of the events of the run.
    pub fn begin(
        self,
        out: impl Into<PathBuf>,
        options: &RunOptions<'_>,
        observer: &mut dyn Observer,
    ) -> Result<Begun, Error> {
        let RunOptions { earlier, device, owner } = *options;
        let folder = RunFolder::new(out);
        let photos = self.input.photos().map(PathBuf::from);
        Output::check(&folder, earlier, photos.as_deref())?;
        let mut prepared = self.prepare(observer)?;
        let output = Output::open(folder, earlier, photos.as_deref(), owner)?;
        output.notice().into_iter().for_each(|notice| observer.event(Event::note(notice.to_string())));
        if let Some(device) = device {
            prepared.before.extend(device.description.as_ref().map(Event::note));
            device.announce(observer);
        }
        Ok(Begun { prepared, output })
    }
}

/// A run whose input is prepared and whose folder is locked.
#[derive(Debug)]
pub struct Begun {
    /// What the stages run on.
    pub prepared: Prepared,
    /// The folder.
    pub output: Output,
}

impl Begun {
    /// The stages on `device`; none: the processor.
    pub fn reconstruction<'a>(&'a self, device: Option<&'a Chosen>) -> Reconstruction<'a> {
        let devices = device.map_or(&Cpu as &dyn Devices, |device| device.devices.as_ref());
        Reconstruction { prepared: &self.prepared, devices, resume: self.output.resumes() }
    }
}

/// True if parts are found before any training, so that they can be corrected.
pub fn finds_parts(config: &Config) -> bool {
    config.method != Method::Paper && config.start.parts == PartSource::Labels
}
