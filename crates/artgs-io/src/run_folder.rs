//! The folder of a run and its replica: the path of every file in it, and how its files are saved and loaded.
//!
//! | path | content |
//! |---|---|
//! | `config.toml` | complete settings of the run |
//! | `events.jsonl` | events of all runs in the folder, one JSON object per line |
//! | `corrections.json` | corrections by a person, see [`crate::Corrections`] |
//! | `replica.json`, `meshes/STATE/*.ply` | the replica, see [`crate::replica`] |
//! | `splats/canonical.ply`, `splats/part_K.ply` | Gaussians midway between the states, all and per part |
//! | `metrics.json`, `preview.png` | scores and times of the run; renderings beside photos |
//! | `stages/*` | results of stages, from which an interrupted run resumes |
//! | `.artgs.*` | who writes into the folder, while somebody does, see [`crate::FolderLock`] |
//! | `exports/FORMAT/*`, `exports/export.json` | exported files, and what the export decided |

use crate::asset::Format;
use crate::capture::fingerprint;
use crate::error::read_bytes;
use crate::{FileError, read_mesh_ply, read_splat_ply, write_atomic, write_mesh_ply, write_splat_ply};
use artgs_core::{Capture, Mesh, PerState, Replica, Splats, State};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Frame named in the PLY files of canonical Gaussians.
pub const CANONICAL_FRAME: &str = "canonical: world frame of the capture, parts midway between start and end";

pub(crate) const STAGES: &str = "stages";
pub(crate) const MESHES: &str = "meshes";
pub(crate) const SPLATS: &str = "splats";
pub(crate) const EXPORTS: &str = "exports";
pub(crate) const EVENTS: &str = "events.jsonl";
pub(crate) const METRICS: &str = "metrics.json";
pub(crate) const CONFIG: &str = "config.toml";
pub(crate) const PREVIEW: &str = "preview.png";
const ALIGNED: &str = "aligned";
const FINGERPRINT: &str = "capture.txt";
const KEYS: &str = "keys.json";
const TIMES: &str = "times.json";
const CAPTURE_NOTE: &str = "capture_folder.txt";
const REFUSAL: &str = "refused.txt";
/// Files of the folder `stages` that are no results.
pub(crate) const NOTES: [&str; 6] = [ALIGNED, FINGERPRINT, KEYS, TIMES, CAPTURE_NOTE, REFUSAL];

/// The folder of a run. Creating this value touches no file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFolder {
    root: PathBuf,
    /// All exports, if they are not in the folder itself.
    exports: Option<PathBuf>,
}

/// Paths.
impl RunFolder {
    /// The folder `root`, which need not exist.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into(), exports: None }
    }

    /// The same folder with its exports elsewhere, for a folder that cannot be written.
    pub fn with_exports(self, exports: impl Into<PathBuf>) -> Self {
        Self { exports: Some(exports.into()), ..self }
    }

    /// The folder itself.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Name of the folder, `run` if the path has none.
    pub fn name(&self) -> String {
        self.root.file_name().map_or("run".into(), |name| name.to_string_lossy().into_owned())
    }

    /// Complete settings of the run, TOML.
    pub fn config(&self) -> PathBuf {
        self.root.join(CONFIG)
    }

    /// Events of all runs in the folder.
    pub fn events(&self) -> PathBuf {
        self.root.join(EVENTS)
    }

    /// Corrections by a person.
    pub fn corrections(&self) -> PathBuf {
        self.root.join(crate::corrections::CORRECTIONS_FILE)
    }

    /// The replica.
    pub fn replica(&self) -> PathBuf {
        self.root.join(crate::replica::REPLICA_FILE)
    }

    /// Scores and times of the run.
    pub fn metrics(&self) -> PathBuf {
        self.root.join(METRICS)
    }

    /// Scores against the ground truth.
    pub fn scores(&self) -> PathBuf {
        self.root.join("scores.json")
    }

    /// Renderings beside photos.
    pub fn preview(&self) -> PathBuf {
        self.root.join(PREVIEW)
    }

    /// Gaussians of all parts, canonical frame.
    pub fn canonical_splats(&self) -> PathBuf {
        self.root.join(SPLATS).join("canonical.ply")
    }

    /// Gaussians of one part, canonical frame.
    pub fn part_splats(&self, part: usize) -> PathBuf {
        self.root.join(SPLATS).join(format!("part_{part}.ply"))
    }

    /// A file of the folder `stages`.
    pub fn stage(&self, name: &str) -> PathBuf {
        self.root.join(STAGES).join(name)
    }

    /// Capture that was made of two recordings, ArtGS layout.
    pub fn aligned(&self) -> PathBuf {
        self.stage(ALIGNED)
    }

    /// Parts and joints as found before training.
    pub fn found_parts(&self) -> PathBuf {
        self.stage("parts.json")
    }

    /// Labelled surface points of one state, as small Gaussians.
    pub fn found_points(&self, state: State) -> PathBuf {
        self.stage(&format!("points_{}.ply", state.name()))
    }

    /// Gaussians of one state alone.
    pub fn single_splats(&self, state: State) -> PathBuf {
        self.stage(&format!("single_{}.ply", state.name()))
    }

    /// Canonical Gaussians as trained.
    pub fn trained_splats(&self) -> PathBuf {
        self.stage("articulated.ply")
    }

    /// Joints as trained.
    pub fn trained_joints(&self) -> PathBuf {
        self.stage("joints.json")
    }

    /// What each stage of the published method decided.
    pub fn published_trace(&self) -> PathBuf {
        self.stage("published.json")
    }

    /// Seconds that each stage took when it was computed.
    pub fn stage_times(&self) -> PathBuf {
        self.stage(TIMES)
    }

    /// Corrections that the stages after discovery were computed with.
    pub fn applied_corrections(&self) -> PathBuf {
        self.stage("corrections.json")
    }

    /// Corrections that the replica was made with.
    pub fn replica_corrections(&self) -> PathBuf {
        self.stage("corrections_assembled.json")
    }

    /// Fingerprint of the capture that the run read.
    pub fn capture_fingerprint(&self) -> PathBuf {
        self.stage(FINGERPRINT)
    }

    /// Hashes of what each computed stage read.
    pub fn stage_keys(&self) -> PathBuf {
        self.stage(KEYS)
    }

    /// Why the input of a run was refused after it began.
    pub(crate) fn refusal_note(&self) -> PathBuf {
        self.stage(REFUSAL)
    }

    /// Names the folder of the photos.
    fn capture_note(&self) -> PathBuf {
        self.stage(CAPTURE_NOTE)
    }

    /// All exports.
    pub fn exports(&self) -> PathBuf {
        self.exports.clone().unwrap_or_else(|| self.root.join(EXPORTS))
    }

    /// Exported files of one format.
    pub fn export(&self, format: Format) -> PathBuf {
        self.exports().join(format.name())
    }

    /// What the export decided.
    pub fn export_report(&self) -> PathBuf {
        self.exports().join("export.json")
    }
}

/// What the folder holds.
impl RunFolder {
    /// True if it holds a replica.
    pub fn has_replica(&self) -> bool {
        self.replica().is_file()
    }

    /// True if a run has found parts here.
    pub fn has_found_parts(&self) -> bool {
        self.found_parts().is_file()
    }

    /// True if the replica has Gaussians.
    pub fn has_splats(&self) -> bool {
        self.canonical_splats().is_file()
    }

    /// True if files of this format were exported.
    pub fn has_export(&self, format: Format) -> bool {
        self.export(format).is_dir()
    }

    /// Creates the folder and its parents.
    pub fn create(&self) -> Result<(), FileError> {
        fs::create_dir_all(&self.root).map_err(|source| FileError::Write { path: self.root.clone(), source })
    }
}

/// Saving and loading.
impl RunFolder {
    /// Writes the settings of the run.
    pub fn save_config(&self, toml: &str) -> Result<(), FileError> {
        write_atomic(&self.config(), toml.as_bytes())
    }

    /// Text of the settings of the run; none if there are none.
    pub fn load_config(&self) -> Result<Option<String>, FileError> {
        load_text(&self.config())
    }

    /// Writes which folder the photos are in, as an absolute path.
    pub fn save_capture_folder(&self, capture: &Path) -> Result<(), FileError> {
        let folder = fs::canonicalize(capture).map_err(|source| FileError::Read { path: capture.into(), source })?;
        write_atomic(&self.capture_note(), format!("{}\n", folder.display()).as_bytes())
    }

    /// The folder that the photos were in; none if that is not known. It may not exist any more.
    pub fn capture_folder(&self) -> Option<PathBuf> {
        let text = fs::read_to_string(self.capture_note()).ok()?;
        Some(PathBuf::from(text.trim_end_matches('\n')))
    }

    /// True if the run was made from this capture; none if its folder does not say.
    pub fn is_of(&self, capture: &Capture) -> Option<bool> {
        let mark = fs::read_to_string(self.capture_fingerprint()).ok()?;
        Some(mark == fingerprint(capture))
    }

    /// Refuses a folder without a replica, and says how to get one.
    pub fn require_replica(&self) -> Result<(), NoReplica> {
        let folder = || self.root().to_path_buf();
        if self.has_replica() {
            Ok(())
        } else if self.root().is_file() {
            Err(NoReplica::File(folder()))
        } else if !self.root().is_dir() {
            Err(NoReplica::NoFolder(folder()))
        } else if self.stage("").is_dir() {
            Err(NoReplica::Unfinished(folder()))
        } else if let Some(above) = self.root().parent().filter(|above| Self::new(above).has_replica()) {
            Err(NoReplica::Within(folder(), above.to_path_buf()))
        } else if crate::capture::is_capture(self.root()) {
            Err(NoReplica::Capture(folder()))
        } else {
            Err(NoReplica::Other(folder()))
        }
    }

    /// Writes `replica.json` and its meshes: those of every part, and the whole object. Meshes of an earlier replica with
    /// more parts are removed.
    pub fn save_replica<'m>(
        &self,
        replica: &Replica,
        parts: impl IntoIterator<Item = &'m PerState<Mesh>>,
        whole: &'m PerState<Mesh>,
    ) -> Result<(), crate::replica::ReplicaFileError> {
        let of_parts = replica.parts.iter().zip(parts).map(|(part, meshes)| (&part.meshes, meshes));
        for (paths, meshes) in of_parts.chain([(&replica.whole, whole)]) {
            for (state, mesh) in State::ALL.into_iter().zip(meshes) {
                write_mesh_ply(&self.root.join(&paths[state]), mesh)?;
            }
        }
        crate::write_replica(&self.root, replica)?;
        Ok(self.remove_meshes_from(replica.parts.len())?)
    }

    /// A mesh that `replica.json` names by its relative path.
    pub fn load_mesh(&self, path: &str) -> Result<Mesh, FileError> {
        read_mesh_ply(&self.root.join(path))
    }

    /// Meshes of every part in one state, world frame.
    pub fn load_meshes(&self, replica: &Replica, state: State) -> Result<Vec<Mesh>, FileError> {
        replica.parts.iter().map(|part| self.load_mesh(&part.meshes[state])).collect()
    }

    /// Writes canonical Gaussians, all together with the part of each, and once more per part. `labels[i]` is below
    /// `parts`. Files of an earlier replica with more parts are removed.
    pub fn save_splats(&self, splats: &Splats, labels: &[u16], parts: usize) -> Result<(), FileError> {
        write_splat_ply(&self.canonical_splats(), splats, Some(labels), CANONICAL_FRAME)?;
        for part in 0..parts {
            let members = (0..labels.len()).filter(|&i| usize::from(labels[i]) == part);
            let own = splats.select(members);
            let labels = vec![part as u16; own.len()];
            write_splat_ply(&self.part_splats(part), &own, Some(&labels), CANONICAL_FRAME)?;
        }
        self.remove_splats_from(parts)
    }

    /// Gaussians of every part, canonical frame; none if the replica has none.
    pub fn load_part_splats(&self, parts: usize) -> Result<Option<Vec<Splats>>, FileError> {
        if !self.part_splats(0).is_file() {
            return Ok(None);
        }
        (0..parts).map(|part| Ok(read_splat_ply(&self.part_splats(part))?.0)).collect::<Result<_, _>>().map(Some)
    }

    /// All canonical Gaussians with the part of each.
    pub fn load_splats(&self) -> Result<(Splats, Vec<u16>), FileError> {
        let path = self.canonical_splats();
        let (splats, labels) = read_splat_ply(&path)?;
        Ok((splats, labels.ok_or_else(|| FileError::malformed(&path, "property `part` is missing"))?))
    }
}

/// Why a folder has no replica.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoReplica {
    /// It is a file.
    #[error("{}: is a file; give the folder that artgs reconstruct wrote", .0.display())]
    File(PathBuf),
    /// It does not exist.
    #[error("{}: no such folder; give the folder that artgs reconstruct wrote", .0.display())]
    NoFolder(PathBuf),
    /// Its run is not finished.
    #[error("{shown}: its run stopped before there was a replica; artgs reconstruct CAPTURE -o {shown} --resume continues it", shown = .0.display())]
    Unfinished(PathBuf),
    /// It is a folder of a replica.
    #[error("{}: is a folder of a replica; give {}", .0.display(), .1.display())]
    Within(PathBuf, PathBuf),
    /// It is a capture.
    #[error("{shown}: is a capture, not a replica; artgs reconstruct {shown} -o OUT makes one", shown = .0.display())]
    Capture(PathBuf),
    /// It was not written by a run.
    #[error("{}: there is no replica.json here; artgs reconstruct makes one", .0.display())]
    Other(PathBuf),
}

/// Writes a value as JSON with a final line break.
pub fn save_json(path: &Path, value: &impl Serialize) -> Result<(), FileError> {
    let text = serde_json::to_string_pretty(value).map_err(|e| FileError::malformed(path, e.to_string()))?;
    write_atomic(path, format!("{text}\n").as_bytes())
}

/// Reads a value from JSON; none if there is no such file.
pub fn load_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FileError> {
    match read_bytes(path) {
        Err(FileError::Read { source, .. }) if source.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
        Ok(bytes) => serde_json::from_slice(&bytes).map(Some).map_err(|e| FileError::malformed(path, e.to_string())),
    }
}

/// Text of a file; none if there is no such file.
pub fn load_text(path: &Path) -> Result<Option<String>, FileError> {
    match fs::read_to_string(path) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(FileError::Read { path: path.into(), source }),
    }
}

/// Removes a file if it exists.
pub fn remove_file(path: &Path) -> Result<(), FileError> {
    absent_is_fine(path, fs::remove_file(path))
}

/// Removes a folder with all it contains if it exists.
pub fn remove_folder(path: &Path) -> Result<(), FileError> {
    absent_is_fine(path, fs::remove_dir_all(path))
}

fn absent_is_fine(path: &Path, removed: std::io::Result<()>) -> Result<(), FileError> {
    match removed {
        Err(source) if source.kind() != ErrorKind::NotFound => Err(FileError::Remove { path: path.into(), source }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn json_survives_and_its_absence_is_no_error() {
        let root = tempfile::tempdir().unwrap();
        let path = RunFolder::new(root.path()).metrics();
        assert_eq!(load_json::<Value>(&path).unwrap(), None);
        save_json(&path, &vec![0.1, -2.5e-9]).unwrap();
        assert_eq!(load_json::<Vec<f64>>(&path).unwrap(), Some(vec![0.1, -2.5e-9]));
        fs::write(&path, "{").unwrap();
        assert!(load_json::<Value>(&path).unwrap_err().to_string().contains("metrics.json"));
        let no_json = std::collections::BTreeMap::from([((1, 2), 3)]);
        assert!(save_json(&path, &no_json).unwrap_err().to_string().contains("metrics.json"));
    }

    #[test]
    fn the_folder_of_the_photos_is_found_again() {
        let root = tempfile::tempdir().unwrap();
        let run = RunFolder::new(root.path().join("run"));
        assert_eq!(run.capture_folder(), None);
        run.save_capture_folder(root.path()).unwrap();
        assert_eq!(run.capture_folder().unwrap(), fs::canonicalize(root.path()).unwrap());
        assert!(run.save_capture_folder(&root.path().join("nowhere")).unwrap_err().to_string().contains("nowhere"));
    }
}
