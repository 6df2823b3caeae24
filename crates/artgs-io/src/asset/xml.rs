//! Numbers as text, for every XML format alike.

use artgs_core::JointKind;
use glam::DVec3;

/// Numbers parted by blanks, each as short as reads back the same; -0 becomes 0.
pub(super) fn row(values: &[f64]) -> String {
    values.iter().map(|v| (v + 0.0).to_string()).collect::<Vec<_>>().join(" ")
}

/// Coordinates parted by blanks.
pub(super) fn triple(v: DVec3) -> String {
    row(&v.to_array())
}

/// A comment that tells of a screw, of which the format at hand has only the turning; nothing for other joints.
pub(super) fn screw_note(kind: JointKind, pitch: f64) -> Option<String> {
    (kind == JointKind::Screw).then(|| format!("<!-- screw: slides {pitch} m per radian along its axis -->"))
}

/// A comment with the values in the two observed states, for which the format at hand has no place.
pub(super) fn observed_note([start, end]: [f64; 2]) -> String {
    format!("<!-- observed: {start} {end} -->")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_plain_and_exact() {
        assert_eq!(row(&[-0.0, 0.1, 1e-7, -2.5]), "0 0.1 0.0000001 -2.5");
        assert_eq!(triple(DVec3::new(1.0, 1.0 / 3.0, 0.0)), "1 0.3333333333333333 0");
    }
}
