//! Points of an observed state, encoded for the page.

use crate::Placement;
use artgs_core::State;
use glam::DVec3;

/// Points of an observed state before any reconstruction.
#[derive(Clone, Debug)]
pub struct Cloud {
    /// State in which the points were observed.
    pub state: State,
    /// Capture's frame and unit.
    pub points: Vec<[f32; 3]>,
    /// sRGB, one per point.
    pub colors: Vec<[u8; 3]>,
    /// Part of every point, 0 for the static part; before parts are known, 1 for points that the other state lacks. Empty if
    /// unknown.
    pub marks: Vec<u8>,
}

impl Cloud {
    /// See [`SceneCloud::file`](crate::SceneCloud::file); a missing colour is grey.
    pub(crate) fn bytes(&self, placement: &Placement) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.points.len() * 16);
        for p in &self.points {
            let at = placement.apply(DVec3::from_array(p.map(f64::from)));
            at.as_vec3().to_array().iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        for i in 0..self.points.len() {
            out.extend(self.colors.get(i).unwrap_or(&[160; 3]));
            out.push(self.marks.get(i).copied().unwrap_or(0));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_then_colours() {
        let cloud = Cloud {
            state: State::START,
            points: vec![[1.0, 2.0, 3.0], [0.0; 3]],
            colors: vec![[9, 8, 7]],
            marks: vec![1],
        };
        let bytes = cloud.bytes(&Placement { scale: 2.0, ..Placement::default() });
        assert_eq!(bytes.len(), 32);
        assert_eq!(bytes[8..12], 6f32.to_le_bytes());
        assert_eq!(bytes[24..], [9, 8, 7, 1, 160, 160, 160, 0]);
    }
}
