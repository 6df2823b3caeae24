//! What a run's folder holds, and what is removed from it: results that a run replaces, and what a killed run left.

use crate::asset::Format;
use crate::export_report::ExportReport;
use crate::folder_lock::{LOCK_FILE, OWNER_FILE};
use crate::run_folder::{EXPORTS, MESHES, NOTES, RunFolder, SPLATS, STAGES, remove_file, remove_folder};
use crate::{FileError, atomic, write_atomic};
use artgs_core::State;
use std::fs::{self, DirEntry};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// What is in a folder that a run is to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Contents {
    /// There is no such folder, or it is empty.
    Nothing,
    /// A run was started here and saved no result, or its input was refused.
    Started,
    /// Results of a run: stages or a replica.
    Results,
    /// Files of something else.
    Foreign,
    /// It is a file, not a folder.
    File,
}

impl RunFolder {
    /// Looks at the folder and changes nothing.
    pub fn contents(&self) -> Result<Contents, FileError> {
        let names = match names(self.root()) {
            Ok(names) => names,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Contents::Nothing),
            Err(error) if error.kind() == ErrorKind::NotADirectory => return Ok(Contents::File),
            Err(source) => return Err(FileError::Read { path: self.root().into(), source }),
        };
        if names.is_empty() {
            return Ok(Contents::Nothing);
        }
        if self.replica().exists() {
            return Ok(Contents::Results);
        }
        let stages = self::names(&self.stage("")).unwrap_or_default();
        let has_results = stages.iter().any(|name| !NOTES.contains(&name.as_str()) && !is_leftover(name));
        if self.events().exists() {
            let results = has_results && !self.refusal_note().exists();
            return Ok(if results { Contents::Results } else { Contents::Started });
        }
        // A run that was killed before its first event left nothing else.
        let is_own = |name: &String| is_leftover(name) || (name == STAGES && !has_results);
        Ok(if names.iter().all(is_own) { Contents::Started } else { Contents::Foreign })
    }

    /// Marks the folder as that of a run, before anything else is written into it. Without `resume` also removes the stages
    /// of a run whose input was refused.
    pub fn begin(&self, resume: bool) -> Result<(), FileError> {
        let path = self.events();
        let opened = fs::OpenOptions::new().create(true).append(true).open(&path);
        opened.map_err(|source| FileError::Write { path, source })?;
        if self.refusal_note().exists() && !resume {
            remove_folder(&self.stage(""))?;
        }
        remove_file(&self.refusal_note())
    }

    /// An error if no file can be written into the folder.
    pub fn require_writable(&self) -> Result<(), FileError> {
        match atomic::unfinished(self.root()) {
            Ok(_) => Ok(()),
            Err(source) => Err(FileError::Write { path: self.root().into(), source }),
        }
    }

    /// Notes that the input of a run was refused after it began: the next run need not resume it.
    pub fn note_refusal(&self, reason: &str) -> Result<(), FileError> {
        write_atomic(&self.refusal_note(), format!("{reason}\n").as_bytes())
    }

    /// Removes what runs and exports write, by name; anything else in the folder stays.
    pub fn discard(&self) -> Result<(), FileError> {
        [STAGES, MESHES, SPLATS, EXPORTS].iter().try_for_each(|name| remove_folder(&self.root().join(name)))?;
        // `replica.urdf` was written by versions before there were exports.
        let urdf = self.root().join("replica.urdf");
        [self.replica(), self.events(), urdf, self.metrics(), self.preview(), self.config()]
            .iter()
            .try_for_each(|path| remove_file(path))
    }

    /// Removes unfinished files of writes that were killed. Only for the process that has locked the folder.
    pub fn remove_leftovers(&self) -> Result<(), FileError> {
        let own = [STAGES, MESHES, SPLATS, EXPORTS].map(|name| self.root().join(name));
        for format in Format::ALL {
            remove_folder(&self.exports().join(format.unfinished_name()))?;
        }
        remove_unfinished(self.root(), false)?;
        own.iter().try_for_each(|folder| remove_unfinished(folder, true))
    }

    /// Removes meshes of parts with this number and above.
    pub(crate) fn remove_meshes_from(&self, part: usize) -> Result<(), FileError> {
        State::ALL.iter().try_for_each(|state| remove_parts(&self.root().join(MESHES).join(state.name()), part))
    }

    /// Removes Gaussians of parts with this number and above.
    pub(crate) fn remove_splats_from(&self, part: usize) -> Result<(), FileError> {
        remove_parts(&self.root().join(SPLATS), part)
    }

    /// Removes all Gaussians, of a replica that had some.
    pub fn remove_splats(&self) -> Result<(), FileError> {
        remove_file(&self.canonical_splats())?;
        self.remove_splats_from(0)
    }

    /// Removes the exports of a replica that was replaced by another one; true if there were any. Exports that do not record
    /// their replica stay.
    pub fn remove_stale_exports(&self) -> Result<bool, FileError> {
        let recorded = ExportReport::load(self).ok().flatten().and_then(|report| report.replica);
        let stale = recorded.is_some() && recorded != self.replica_digest()?;
        if stale {
            self.remove_exports()?;
        }
        Ok(stale)
    }

    /// Removes the exported files.
    pub fn remove_exports(&self) -> Result<(), FileError> {
        remove_file(&self.export_report())?;
        Format::ALL.iter().try_for_each(|format| remove_folder(&self.export(*format)))?;
        // What is not an export stays, and the folder with it.
        let _ = fs::remove_dir(self.exports());
        Ok(())
    }
}

fn names(folder: &Path) -> std::io::Result<Vec<String>> {
    fs::read_dir(folder)?.map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned())).collect()
}

/// Files that a run writes and removes again, unless it is killed.
fn is_leftover(name: &str) -> bool {
    atomic::is_unfinished(name) || name == LOCK_FILE || name == OWNER_FILE
}

/// Entries of a folder; none if it does not exist.
fn entries(folder: &Path) -> Result<Vec<DirEntry>, FileError> {
    match fs::read_dir(folder).and_then(Iterator::collect) {
        Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => Ok(Vec::new()),
        found => found.map_err(|source| FileError::Read { path: folder.into(), source }),
    }
}

fn remove_unfinished(folder: &Path, below: bool) -> Result<(), FileError> {
    for entry in entries(folder)? {
        let path = entry.path();
        if atomic::is_unfinished(&entry.file_name().to_string_lossy()) {
            remove_file(&path)?;
        } else if below && entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_unfinished(&path, true)?;
        }
    }
    Ok(())
}

/// Removes `part_K.ply` of a folder where K is at least `first`.
fn remove_parts(folder: &Path, first: usize) -> Result<(), FileError> {
    let is_stale = |path: &PathBuf| {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let number = name.strip_prefix("part_").and_then(|rest| rest.strip_suffix(".ply"));
        number.and_then(|number| number.parse().ok()).is_some_and(|number: usize| number >= first)
    };
    entries(folder)?.iter().map(DirEntry::path).filter(is_stale).try_for_each(|path| remove_file(&path))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run_folder::{EVENTS, save_json};
    use artgs_core::{Mesh, PerState, Replica, Splats};
    use serde_json::Value;

    #[test]
    fn own_folders_differ_from_others() {
        let root = tempfile::tempdir().unwrap();
        let at = |name: &str| RunFolder::new(root.path().join(name));
        assert_eq!(at("missing").contents().unwrap(), Contents::Nothing);
        let run = at("run");
        run.create().unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Nothing);
        fs::write(run.root().join("thesis.tex"), "x").unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Foreign);
        assert_eq!(at("run/thesis.tex").contents().unwrap(), Contents::File);
        fs::write(run.events(), "").unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Started);
        save_json(&run.found_parts(), &Value::Null).unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Results);
        run.discard().unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Foreign);
        assert!(run.root().join("thesis.tex").is_file() && !run.has_found_parts());
    }

    #[test]
    fn what_a_run_leaves_that_was_killed_at_its_first_writes_is_its_own() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        for name in [".artgs-abc123.tmp", LOCK_FILE, OWNER_FILE, "stages/.artgs-x.tmp", "stages/capture_folder.txt"] {
            write_atomic(&root.path().join(name), b"x").unwrap();
            assert_eq!(run.contents().unwrap(), Contents::Started, "{name}");
        }
        run.begin(false).unwrap();
        run.remove_leftovers().unwrap();
        let left = names(root.path()).unwrap();
        assert!(!left.iter().any(|name| name.ends_with(".tmp")) && left.iter().any(|name| name == EVENTS), "{left:?}");
        assert!(!root.path().join("stages/.artgs-x.tmp").exists());
        fs::remove_file(run.events()).unwrap();
        fs::write(root.path().join("notes.tmp"), "x").unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Foreign);
    }

    #[test]
    fn notes_and_refused_input_are_no_results() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        run.begin(false).unwrap();
        run.save_capture_folder(root.path()).unwrap();
        fs::write(run.capture_fingerprint(), "0").unwrap();
        fs::write(run.stage_keys(), "{}").unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Started);
        save_json(&run.found_parts(), &Value::Null).unwrap();
        run.note_refusal("no overlap").unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Started);
        run.begin(true).unwrap();
        assert_eq!(run.contents().unwrap(), Contents::Results);
        run.note_refusal("no overlap").unwrap();
        run.begin(false).unwrap();
        assert!(run.contents().unwrap() == Contents::Started && !run.has_found_parts());
    }

    #[test]
    fn unfinished_files_are_removed_wherever_they_are_written() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        let own = ["meshes/start/.artgs-a.tmp", "exports/urdf/meshes/.artgs-b.tmp", "exports/.usd.new/part/c.obj"];
        let others = ["mine/.artgs-d.tmp", "meshes/start/part_1.ply"];
        for name in own.iter().chain(&others) {
            write_atomic(&root.path().join(name), b"").unwrap();
        }
        run.remove_leftovers().unwrap();
        assert!(own.iter().all(|name| !root.path().join(name).exists()));
        assert!(others.iter().all(|name| root.path().join(name).exists()));
        assert!(!root.path().join("exports/.usd.new").exists());
    }

    #[test]
    fn files_of_parts_that_are_no_more_are_removed() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        let others = ["splats/part_of_mine.ply", "splats/part_9.txt", "splats/part_1.ply"];
        for name in ["splats/part_2.ply", "splats/part_9.ply"].iter().chain(&others) {
            write_atomic(&root.path().join(name), b"").unwrap();
        }
        run.save_splats(&Splats::empty(0), &[], 2).unwrap();
        assert!(!run.part_splats(2).exists() && !run.part_splats(9).exists());
        assert!(others.iter().all(|name| root.path().join(name).exists()));
        run.remove_splats().unwrap();
        assert!(!run.has_splats() && !run.part_splats(0).exists() && root.path().join(others[0]).exists());
        for name in ["meshes/start/part_3.ply", "meshes/end/part_3.ply", "meshes/end/part_2.ply"] {
            write_atomic(&root.path().join(name), b"").unwrap();
        }
        run.remove_meshes_from(3).unwrap();
        assert_eq!(names(&root.path().join("meshes/end")).unwrap(), ["part_2.ply"]);
        assert!(names(&root.path().join("meshes/start")).unwrap().is_empty());
    }

    #[test]
    fn exports_of_a_replaced_replica_are_removed_and_others_stay() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path());
        let replica = Replica::new(&[]);
        let mesh = PerState::new(Mesh::default(), Mesh::default());
        run.save_replica(&replica, [&mesh], &mesh).unwrap();
        let file = run.export(Format::Urdf).join("replica.urdf");
        write_atomic(&file, b"<robot/>").unwrap();
        let mine = run.exports().join("notes.txt");
        write_atomic(&mine, b"").unwrap();
        assert!(!run.remove_stale_exports().unwrap(), "nothing says what they were made from");
        let mut report = ExportReport { files: vec![file.clone()], ..ExportReport::default() };
        report.record_digests(&run, &[Format::Urdf]).unwrap();
        report.save(&run).unwrap();
        run.save_replica(&replica, [&mesh], &mesh).unwrap();
        assert!(!run.remove_stale_exports().unwrap() && file.is_file(), "the same replica");
        let other = Mesh { vertices: vec![[0.0; 3]], ..Mesh::default() };
        run.save_replica(&replica, [&PerState::new(other, Mesh::default())], &mesh).unwrap();
        assert!(run.remove_stale_exports().unwrap() && !file.exists() && !run.export_report().exists());
        assert!(mine.is_file());
    }
}
