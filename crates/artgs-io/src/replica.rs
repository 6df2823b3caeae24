//! The replica folder's `replica.json`.

use crate::error::read_bytes;
use crate::{FileError, without_mark, write_atomic};
use artgs_core::{Replica, ReplicaError};
use serde_json::Value;
use std::path::{Component, Path, PathBuf};

/// Name of the file in a replica folder.
pub const REPLICA_FILE: &str = "replica.json";

/// A `replica.json` that cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplicaFileError {
    /// Not readable, not JSON, or a field is missing or of the wrong type.
    #[error(transparent)]
    File(#[from] FileError),
    /// Understood, but its content contradicts itself or is of another version.
    #[error("{}: {source}", path.display())]
    Invalid {
        /// The `replica.json`.
        path: PathBuf,
        /// What is wrong.
        source: ReplicaError,
    },
    /// It names a mesh that does not exist.
    #[error("{}: field `{field}`: there is no mesh {mesh}; restore the file or reconstruct again", path.display())]
    MissingMesh {
        /// The `replica.json`.
        path: PathBuf,
        /// Where in the file.
        field: String,
        /// The mesh as the file names it.
        mesh: String,
    },
}

/// Checks a replica and writes it as `DIR/replica.json`. Meshes are written by others, before or after.
pub fn write_replica(dir: &Path, replica: &Replica) -> Result<(), ReplicaFileError> {
    let path = dir.join(REPLICA_FILE);
    replica.validate().map_err(|source| ReplicaFileError::Invalid { path: path.clone(), source })?;
    check_paths(&path, replica)?;
    let mut text = serde_json::to_string_pretty(replica).map_err(|e| FileError::malformed(&path, e.to_string()))?;
    text.push('\n');
    Ok(write_atomic(&path, text.as_bytes())?)
}

/// Reads and checks `DIR/replica.json`: format, version, joints, and that every mesh it names lies in the folder.
pub fn read_replica(dir: &Path) -> Result<Replica, ReplicaFileError> {
    let path = dir.join(REPLICA_FILE);
    let bytes = read_bytes(&path)?;
    let malformed = |e: serde_json::Error| FileError::malformed(&path, e.to_string());
    let bytes = without_mark(&bytes).map_err(|reason| FileError::malformed(&path, reason))?;
    let value: Value = serde_json::from_slice(bytes).map_err(malformed)?;
    // Another version may have other fields: say so before complaining about those.
    let (format, version) = (value.get("format"), value.get("version").and_then(Value::as_u64));
    let invalid = |source| ReplicaFileError::Invalid { path: path.clone(), source };
    if let Some(format) = format.and_then(Value::as_str).filter(|f| *f != artgs_core::replica::REPLICA_FORMAT) {
        return Err(invalid(ReplicaError::Format(format.into())));
    }
    if let Some(version) = version.filter(|v| *v != u64::from(artgs_core::replica::REPLICA_VERSION)) {
        return Err(invalid(ReplicaError::Version(u32::try_from(version).unwrap_or(u32::MAX))));
    }
    // Parsed again from the text, because only then do errors know their line.
    let replica: Replica = serde_json::from_slice(bytes).map_err(malformed)?;
    replica.validate().map_err(invalid)?;
    check_paths(&path, &replica)?;
    for (field, mesh) in meshes(&replica) {
        if !dir.join(mesh).is_file() {
            return Err(ReplicaFileError::MissingMesh { path, field, mesh: mesh.into() });
        }
    }
    Ok(replica)
}

/// Every mesh with the name of its field.
fn meshes(replica: &Replica) -> Vec<(String, &str)> {
    let parts = replica.parts.iter().enumerate().map(|(i, p)| (format!("parts[{i}].meshes"), &p.meshes));
    std::iter::once(("whole".to_string(), &replica.whole))
        .chain(parts)
        .flat_map(|(field, m)| {
            m.enumerate().map(move |(state, mesh)| (format!("{field}.{}", state.name()), mesh.as_str()))
        })
        .collect()
}

/// A replica folder can be moved: its meshes are relative paths that stay inside.
fn check_paths(path: &Path, replica: &Replica) -> Result<(), FileError> {
    if replica.parts.is_empty() {
        return Err(FileError::malformed(path, "field `parts` is empty; the static part must be there"));
    }
    for (field, mesh) in meshes(replica) {
        let inside = Path::new(mesh).components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if mesh.is_empty() || !inside {
            let reason = format!("field `{field}` is {mesh:?}; expected a path relative to the folder, without `..`");
            return Err(FileError::malformed(path, reason));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::{Alternative, Joint, JointAlternative, JointKind, Rigid};
    use glam::DVec3;

    fn folder() -> (tempfile::TempDir, Replica) {
        let dir = tempfile::tempdir().unwrap();
        let hinge = Rigid::about(DVec3::Z, DVec3::new(0.1, 0.2, 0.0), 0.7);
        let replica = Replica::new(&[Joint::from_motion(JointKind::Revolute, &hinge)]);
        for (_, mesh) in meshes(&replica) {
            write_atomic(&dir.path().join(mesh), b"").unwrap();
        }
        write_replica(dir.path(), &replica).unwrap();
        (dir, replica)
    }

    #[test]
    fn round_trip() {
        let (dir, mut replica) = folder();
        assert_eq!(read_replica(dir.path()).unwrap(), replica);
        // A replica of before there was any confidence has no such field.
        assert!(!std::fs::read_to_string(dir.path().join(REPLICA_FILE)).unwrap().contains("confidence"));
        replica.parts[1].confidence = Some(0.75);
        let found = JointAlternative {
            kind: JointKind::Prismatic,
            motion: Rigid::shift(DVec3::new(0.0, 0.25, 0.0)),
            cost: 0.125,
            what: "slides".into(),
            advice: String::new(),
        };
        assert!(!std::fs::read_to_string(dir.path().join(REPLICA_FILE)).unwrap().contains("alternatives"));
        replica.parts[1].alternatives.push(Alternative::near(&found, DVec3::ZERO));
        write_replica(dir.path(), &replica).unwrap();
        assert_eq!(read_replica(dir.path()).unwrap(), replica);
    }

    #[test]
    fn errors_name_file_and_field() {
        for (from, to, words) in [
            ("\"version\": 1", "\"version\": 2, \"new\": 0", "field `version` is 2"),
            ("artgs-replica", "other", "field `format` is \"other\""),
            ("\"axis\"", "\"axes\"", "missing field `axis`"),
            ("\"axis\"", "\"axes\"", "line "),
            ("revolute", "floating", "unknown variant `floating`"),
            ("\"lower\": 0.0", "\"lower\": 9.0", "part 1: field `limits`"),
            ("\"lower\": 0.0", "\"lower\": 0.3", "part 1: field `limits` does not contain"),
            ("meshes/end/part_1.ply", "../part_1.ply", "field `parts[1].meshes.end`"),
            (
                "meshes/start/whole.ply",
                "meshes/start/hole.ply",
                "field `whole.start`: there is no mesh meshes/start/hole",
            ),
            ("\"lower\": 0.0", "\"lower\": NaN", "line "),
            ("\"lower\": 0.0", "\"lower\": null", "invalid type: null"),
            ("\"lower\": 0.0", "\"lower\": 1e999", "number out of range"),
            ("{", "", "line 2"),
        ] {
            let (dir, _) = folder();
            let path = dir.path().join(REPLICA_FILE);
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.contains(from), "{from}");
            std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
            let message = read_replica(dir.path()).unwrap_err().to_string();
            assert!(message.contains("replica.json") && message.contains(words), "{to}: {message}");
        }
    }

    #[test]
    fn what_cannot_be_read_back_is_not_written() {
        let dir = tempfile::tempdir().unwrap();
        let mut replica = Replica::new(&[]);
        replica.whole[artgs_core::State::END] = "/abs.ply".into();
        assert!(write_replica(dir.path(), &replica).unwrap_err().to_string().contains("whole.end"));
        replica.parts.clear();
        assert!(write_replica(dir.path(), &replica).is_err());
        assert!(!dir.path().join(REPLICA_FILE).exists());
    }
}
