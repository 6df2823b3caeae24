//! The box of the object: as `--box` states it, and the file in which the page of a recording saves it.

use crate::failure::Failure;
use artgs::Input;
use artgs::align::ObjectBox;
use artgs_io::run_folder::load_json;
use artgs_io::{BoxBounds, FileError};
use std::path::{Path, PathBuf};

/// The box of `--box`, which only recordings have: six numbers, or a file.
pub(crate) fn given(text: &str, input: &Input) -> Result<ObjectBox, Failure> {
    if let Input::Capture(folder) = input {
        return Err(Failure::bad(format!(
            "--box selects the object in two recordings; {} is one capture, whose masks select it",
            folder.display()
        )));
    }
    // Six numbers have commas.
    if Path::new(text).exists() || !(text.contains(',') || text.trim().is_empty()) {
        return from_file(Path::new(text));
    }
    text.parse().map_err(|reason| Failure::bad(format!("--box {text}: {reason}")))
}

fn from_file(path: &Path) -> Result<ObjectBox, Failure> {
    let remedy = "give six numbers, X0,Y0,Z0,X1,Y1,Z1, or a file that the page of artgs view RECORDING saved";
    let refused = |reason: &dyn std::fmt::Display| Failure::bad(format!("--box {reason}; {remedy}"));
    let BoxBounds { lower, upper } = BoxBounds::read(path).map_err(|e| refused(&e))?;
    ObjectBox::new(lower.into(), upper.into()).map_err(|e| refused(&format!("{}: {e}", path.display())))
}

/// The box of the object that a run selected, of the folder with the two recordings that it aligned.
pub(crate) fn of_alignment(folder: &Path) -> Option<BoxBounds> {
    let report: serde_json::Value = load_json(&folder.join("report.json")).ok()??;
    let [lower, upper]: [[f64; 3]; 2] = serde_json::from_value(report.get("object")?.clone()).ok()?;
    let found = ObjectBox::new(lower.into(), upper.into()).ok()?.rounded();
    Some(BoxBounds { lower: found.lower().to_array(), upper: found.upper().to_array() })
}

/// The file of the box of a recording: in its folder, or beside a recording that is one file.
pub(crate) fn file_of(recording: &Path) -> PathBuf {
    if recording.is_dir() { recording.join("object_box.json") } else { recording.with_extension("object_box.json") }
}

/// Where the page saves the box: `named` by the user, else `own`. The inner error says why nothing can be saved there, which
/// is refused if the user named it.
pub(crate) fn file_to_save(own: Option<PathBuf>, named: Option<&Path>) -> Result<Result<PathBuf, String>, Failure> {
    if let Some(path) = named {
        require_writable(path).map_err(|reason| Failure::bad(format!("--save-box {reason}")))?;
        return Ok(Ok(path.to_path_buf()));
    }
    let Some(path) = own else { return Ok(Err("a run keeps no box; --save-box FILE names a file".into())) };
    Ok(require_writable(&path).map(|()| path).map_err(|reason| format!("{reason}; --save-box FILE names another file")))
}

fn require_writable(path: &Path) -> Result<(), String> {
    BoxBounds::require_replaceable(path).map_err(|e| e.to_string())?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // Permissions alone do not say it: the file system may be read-only.
    let tried = tempfile::tempfile_in(folder);
    tried.map(drop).map_err(|source| FileError::Write { path: path.into(), source }.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recordings() -> Input {
        Input::new(&["a", "b"]).unwrap()
    }

    #[test]
    fn six_numbers_or_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("my box,1.json");
        let bounds = BoxBounds { lower: [-0.5, 0.0, 0.1], upper: [1.0, 2.0, 3.0] };
        bounds.write(&path).unwrap();
        let named = path.to_str().unwrap();
        for text in ["-0.5,0,0.1,1,2,3", named] {
            let found = given(text, &recordings()).unwrap();
            assert_eq!((found.lower().to_array(), found.upper().to_array()), (bounds.lower, bounds.upper), "{text}");
            assert!(given(text, &Input::Capture("x".into())).is_err());
        }
        let wrong = |text: &str, parts: &[&str]| {
            let error = given(text, &recordings()).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            let error = error.to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
        };
        wrong("absent.json", &["--box absent.json: cannot be read", "give six numbers", "artgs view RECORDING"]);
        wrong("1 2 3 4 5 6", &["--box 1 2 3 4 5 6: cannot be read", "X0,Y0,Z0,X1,Y1,Z1"]);
        wrong("0,0,0,1,1,NaN", &["`NaN` is not a finite number"]);
        wrong("", &["a box is six numbers"]);
        wrong(dir.path().to_str().unwrap(), &["cannot be read", "give six numbers"]);
        std::fs::write(&path, r#"{"format":"artgs-box","version":1,"lower":[0,0,0],"upper":[1,0,1]}"#).unwrap();
        wrong(named, &[named, "field `upper`: y (0) must be above", "give six numbers"]);
        std::fs::write(&path, r#"{"format":"artgs-box","version":1,"lower":[0,0],"upper":[1,0,1]}"#).unwrap();
        wrong(named, &[named, "field `lower` has 2 numbers", "give six numbers"]);
    }

    #[test]
    fn the_file_is_in_or_beside_the_recording_and_replaces_only_a_box() {
        let dir = tempfile::tempdir().unwrap();
        let (folder, bag) = (dir.path().join("closed"), dir.path().join("closed.bag"));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(&bag, "").unwrap();
        let own = || Some(file_of(&folder));
        let file = folder.join("object_box.json");
        assert_eq!((own(), file_of(&bag)), (Some(file.clone()), dir.path().join("closed.object_box.json")));
        assert_eq!(file_to_save(own(), None).unwrap(), Ok(file.clone()));
        assert_eq!(file_to_save(own(), Some(&dir.path().join("b"))).unwrap(), Ok(dir.path().join("b")));
        assert!(file_to_save(None, None).unwrap().unwrap_err().contains("--save-box FILE"));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 0);
        let absent = dir.path().join("absent/box.json");
        let error = file_to_save(own(), Some(&absent)).unwrap_err().to_string();
        assert!(error.starts_with("--save-box") && error.contains("box.json: cannot be written"), "{error}");
        std::fs::write(&file, "{}").unwrap();
        let reason = file_to_save(own(), None).unwrap().unwrap_err();
        assert!(reason.contains("object_box.json: exists and is not a box") && reason.contains("--save-box FILE"));
        assert!(file_to_save(own(), Some(&bag)).unwrap_err().to_string().contains("closed.bag: exists"));
    }

    #[test]
    fn the_box_of_a_run_is_in_its_report() {
        let dir = tempfile::tempdir().unwrap();
        let report = dir.path().join("report.json");
        assert_eq!(of_alignment(dir.path()), None);
        std::fs::write(&report, r#"{"object": [[0, 0, 0], [1, 2, 3]], "score": 0.5}"#).unwrap();
        assert_eq!(of_alignment(dir.path()), Some(BoxBounds { lower: [0.0; 3], upper: [1.0, 2.0, 3.0] }));
        for other in [r#"{"object": [[0, 0, 0], [1, 2]]}"#, r#"{"object": [[0, 0, 0], [1, 0, 1]]}"#, "{}", "x"] {
            std::fs::write(&report, other).unwrap();
            assert_eq!(of_alignment(dir.path()), None, "{other}");
        }
    }
}
