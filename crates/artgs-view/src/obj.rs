//! Checks that a mesh is whole before the page draws it; the page itself reads it.

use artgs_io::FileError;
use std::path::Path;

/// Refuses an OBJ that was cut, has numbers that are not finite or faces without corners, or lacks its materials.
pub(crate) fn check(path: &Path) -> Result<(), FileError> {
    let bytes = std::fs::read(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    let text = String::from_utf8_lossy(&bytes);
    let damaged = |reason: String| FileError::malformed(path, format!("{reason}; export again"));
    if !text.ends_with('\n') {
        return Err(damaged("the file ends in the middle of a line".into()));
    }
    // Vertices, texture coordinates, normals.
    let mut counts = [0; 3];
    let mut faces = 0;
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_ascii_whitespace();
        let wrong = |what: &str| damaged(format!("line {}: {what}", number + 1));
        let whole = match words.next() {
            Some("v") => numbers(words, 3, &mut counts[0]),
            Some("vt") => numbers(words, 2, &mut counts[1]),
            Some("vn") => numbers(words, 3, &mut counts[2]),
            Some("f") => {
                faces += 1;
                let mut corners = 0;
                words.all(|corner| {
                    corners += 1;
                    exists(corner, &counts)
                }) && corners >= 3
            }
            Some("mtllib") => match words.next().map(|name| path.with_file_name(name)) {
                Some(file) if !file.is_file() => {
                    let source = std::io::Error::from(std::io::ErrorKind::NotFound);
                    return Err(FileError::Read { path: file, source });
                }
                material => material.is_some(),
            },
            _ => true,
        };
        if !whole {
            return Err(wrong(&format!("`{line}` is damaged")));
        }
    }
    if faces == 0 { Err(damaged("the mesh has no faces".into())) } else { Ok(()) }
}

/// Whether at least so many finite numbers follow; counts the line.
fn numbers<'a>(words: impl Iterator<Item = &'a str>, least: usize, count: &mut usize) -> bool {
    *count += 1;
    let mut found = 0;
    words.map(|word| word.parse::<f64>().is_ok_and(f64::is_finite)).all(|number| {
        found += 1;
        number
    }) && found >= least
}

/// Whether a corner `v`, `v/vt`, `v//vn` or `v/vt/vn` names what came before it; numbers below 0 count backwards.
fn exists(corner: &str, counts: &[usize; 3]) -> bool {
    let within = |(word, count): (&str, &usize)| match word.parse::<i64>() {
        Ok(index) => index != 0 && index.unsigned_abs() <= *count as u64,
        Err(_) => word.is_empty(),
    };
    !corner.starts_with('/') && corner.split('/').count() <= 3 && corner.split('/').zip(counts).all(within)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_meshes_pass_and_cut_ones_do_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.obj");
        let text = "# a\nmtllib a.mtl\no x\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1e-3 0\nvt 0 0.5\nvn 0 0 1\nusemtl m\n\
                    f 1/1/1 2/1/1 3/1/1\nf -3//-1 -2 -1/1\n";
        let written = |text: &str| {
            std::fs::write(&path, text).unwrap();
            check(&path).map_err(|e| e.to_string())
        };
        assert!(written(text).unwrap_err().contains("a.mtl: cannot be read"));
        std::fs::write(dir.path().join("a.mtl"), "newmtl m\n").unwrap();
        assert_eq!(written(text), Ok(()));
        for (from, to, words) in [
            ("v 1 0 0 0.5", "v 1 nan 0 0.5", "line 5"),
            ("v 0 0 0\n", "v 0 0\n", "line 4"),
            ("3/1/1", "4/1/1", "line 10"),
            ("3/1/1", "3/1/2", "line 10"),
            ("2/1/1 3/1/1", "3/1/1", "line 10"),
            ("3/1/1", "/1/1", "line 10"),
            ("3/1/1", "0/1/1", "line 10"),
            ("3/1/1", "3x", "line 10"),
        ] {
            let message = written(&text.replacen(from, to, 1)).unwrap_err();
            assert!(message.contains(words) && message.contains("export again"), "{to}: {message}");
        }
        // The first face is the least that a mesh has; a cut after it is at the end of a line.
        let faces = text.find("f -3").unwrap();
        for cut in (0..text.len()).filter(|cut| *cut != faces) {
            assert!(written(&text[..cut]).is_err(), "{cut}");
        }
    }
}
