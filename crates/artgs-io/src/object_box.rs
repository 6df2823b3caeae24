//! `object_box.json`: the box of the object in a recording, as the page of `artgs view` saves it.
//!
//! ```json
//! {"format": "artgs-box", "version": 1, "lower": [-0.62, -1.21, 0.35], "upper": [0.48, 0.12, 1.4]}
//! ```

use crate::error::read_bytes;
use crate::{FileError, without_mark, write_atomic};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FORMAT: &str = "artgs-box";
const VERSION: u32 = 1;

/// Corners of an axis-aligned box in the world and unit of a recording. Readers and writers accept only finite numbers, and
/// only lower bounds below the upper ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoxBounds {
    /// Lowest x, y, z.
    pub lower: [f64; 3],
    /// Highest x, y, z.
    pub upper: [f64; 3],
}

/// Numbers that JSON cannot express are null in it.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u32,
    lower: Vec<Option<f64>>,
    upper: Vec<Option<f64>>,
}

impl BoxBounds {
    /// From the text of the file; the error says which field is wrong.
    pub fn parse(text: &[u8]) -> Result<Self, String> {
        let Document { format, version, lower, upper } =
            serde_json::from_slice(without_mark(text)?).map_err(|e| e.to_string())?;
        if format != FORMAT || version != VERSION {
            return Err(format!(
                "field `format` is {format:?} version {version}; expected {FORMAT:?} version {VERSION}"
            ));
        }
        let bounds = Self { lower: corner("lower", &lower)?, upper: corner("upper", &upper)? };
        bounds.check()?;
        Ok(bounds)
    }

    fn check(&self) -> Result<(), String> {
        for (name, [lower, upper]) in ["x", "y", "z"].iter().zip([0, 1, 2].map(|k| [self.lower[k], self.upper[k]])) {
            if !lower.is_finite() || !upper.is_finite() {
                return Err(format!("a bound of {name} is not finite"));
            }
            if lower >= upper {
                return Err(format!("field `upper`: {name} ({upper}) must be above that of `lower` ({lower})"));
            }
        }
        Ok(())
    }

    /// Reads and checks a file.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Self::parse(&read_bytes(path)?).map_err(|reason| FileError::malformed(path, reason))
    }

    /// Checks and writes a file. Refuses to replace a file that is not a box.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        self.check().map_err(|reason| FileError::malformed(path, reason))?;
        Self::require_replaceable(path)?;
        let numbers = |corner: [f64; 3]| corner.map(Some).to_vec();
        let (lower, upper) = (numbers(self.lower), numbers(self.upper));
        let text = serde_json::to_string(&Document { format: FORMAT.into(), version: VERSION, lower, upper });
        let text = text.map_err(|e| FileError::malformed(path, e.to_string()))?;
        write_atomic(path, (text + "\n").as_bytes())
    }

    /// An error if there is something at `path` that is not a box, which [`BoxBounds::write`] would not replace.
    pub fn require_replaceable(path: &Path) -> Result<(), FileError> {
        #[derive(Deserialize)]
        struct Head {
            format: String,
        }
        if path.symlink_metadata().is_err() {
            return Ok(());
        }
        let text = read_bytes(path)?;
        match without_mark(&text).map(serde_json::from_slice::<Head>) {
            Ok(Ok(head)) if head.format == FORMAT => Ok(()),
            _ => Err(FileError::malformed(path, "exists and is not a box; a box is saved only in a file of its own")),
        }
    }
}

fn corner(field: &str, numbers: &[Option<f64>]) -> Result<[f64; 3], String> {
    let count = || format!("field `{field}` has {} numbers; expected x, y and z", numbers.len());
    let numbers: [Option<f64>; 3] = numbers.try_into().map_err(|_| count())?;
    match numbers {
        [Some(x), Some(y), Some(z)] => Ok([x, y, z]),
        _ => Err(format!("field `{field}`: a number is missing or not finite")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: BoxBounds = BoxBounds { lower: [-0.62, -1.21, 0.1], upper: [0.48, 1e-9, 1.4] };

    #[test]
    fn round_trip_in_a_file_of_its_own() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("object_box.json");
        assert!(matches!(BoxBounds::read(&path), Err(FileError::Read { .. })));
        for bounds in [GOOD, BoxBounds { lower: [-1.0; 3], ..GOOD }] {
            bounds.write(&path).unwrap();
            assert_eq!(BoxBounds::read(&path).unwrap(), bounds);
        }
        // A box of a later version can be replaced, anything else cannot.
        std::fs::write(&path, r#"{"format": "artgs-box", "version": 2, "corners": []}"#).unwrap();
        GOOD.write(&path).unwrap();
        for other in [r#"{"frames": []}"#, r#"{"format": "artgs-scene"}"#, "", "0,0,0,1,1,1"] {
            std::fs::write(&path, other).unwrap();
            let error = GOOD.write(&path).unwrap_err().to_string();
            assert!(error.contains("object_box.json: exists and is not a box"), "{other}: {error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), other);
        }
        let inverted = BoxBounds { lower: GOOD.upper, upper: GOOD.lower };
        assert!(inverted.write(&dir.path().join("new.json")).is_err() && !dir.path().join("new.json").exists());
    }

    #[test]
    fn wrong_files_say_what_is_wrong() {
        let parse =
            |corners: &str| BoxBounds::parse(format!(r#"{{"format":"artgs-box","version":1,{corners}}}"#).as_bytes());
        assert_eq!(parse(r#""lower":[-0.62,-1.21,0.1],"upper":[0.48,1e-9,1.4]"#), Ok(GOOD));
        for (corners, part) in [
            (r#""lower":[0,0],"upper":[1,1,1]"#, "field `lower` has 2 numbers; expected x, y and z"),
            (r#""lower":[0,0,0],"upper":[1,1,1,1]"#, "field `upper` has 4 numbers"),
            (r#""lower":[0,0,0],"upper":[1,null,1]"#, "field `upper`: a number is missing or not finite"),
            (r#""lower":[0,0,0],"upper":[1,NaN,1]"#, "line 1"),
            (r#""lower":[0,0,0],"upper":[1,1e999,1]"#, "out of range"),
            (r#""lower":[0,2,0],"upper":[1,1,1]"#, "field `upper`: y (1) must be above that of `lower` (2)"),
            (r#""lower":[0,0,1],"upper":[1,1,1]"#, "field `upper`: z (1)"),
            (r#""lower":[0,0,0]"#, "missing field `upper`"),
            (r#""lower":[0,0,0],"upper":[1,1,1],"state":0"#, "unknown field `state`"),
        ] {
            let error = parse(corners).unwrap_err();
            assert!(error.contains(part), "{corners}: {error}");
        }
        let other = br#"{"format":"artgs-box","version":2,"lower":[0,0,0],"upper":[1,1,1]}"#;
        assert!(BoxBounds::parse(other).unwrap_err().contains("expected \"artgs-box\" version 1"));
    }
}
