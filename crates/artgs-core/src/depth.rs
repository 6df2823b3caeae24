//! Depth images, stored as 16-bit counts like the files they come from.

/// Planar depth of a view, row-major: integer counts, `per_unit` of them per scene unit; 0 for missing depth. A pixel has
/// 16 bits, because the depth of a few hundred large views would otherwise fill the memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DepthMap {
    counts: Vec<u16>,
    per_unit: f32,
}

impl DepthMap {
    /// From counts; `per_unit` (positive) counts are one scene unit.
    pub fn new(counts: Vec<u16>, per_unit: f32) -> Self {
        Self { counts, per_unit }
    }

    /// Rounds depths in scene units to counts. Depths that are not positive and finite become 0. The largest depth defines
    /// the unit, so errors are below a hundred-thousandth of it.
    pub fn nearest(depths: &[f32]) -> Self {
        let valid = |d: &f32| *d > 0.0 && d.is_finite();
        let largest = depths.iter().copied().filter(valid).fold(0.0, f32::max);
        let per_unit = if largest > 0.0 { f32::from(u16::MAX - 1) / largest } else { 1.0 };
        let count = |d: &f32| if valid(d) { (d * per_unit).round().max(1.0) as u16 } else { 0 };
        Self { counts: depths.iter().map(count).collect(), per_unit }
    }

    /// Counts, `[height * width]`.
    pub fn counts(&self) -> &[u16] {
        &self.counts
    }

    /// Counts per scene unit.
    pub fn per_unit(&self) -> f32 {
        self.per_unit
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.counts.len()
    }

    /// True if it has no pixels.
    pub fn is_empty(&self) -> bool {
        self.counts.is_empty()
    }

    /// Depth of a pixel, scene units.
    #[inline]
    pub fn at(&self, index: usize) -> f32 {
        f32::from(self.counts[index]) / self.per_unit
    }

    /// Depth of every pixel, scene units.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f32> + Clone + '_ {
        self.counts.iter().map(|&c| f32::from(c) / self.per_unit)
    }

    /// Depth of the given pixels, scene units, in that order.
    pub fn select(&self, pixels: impl Iterator<Item = usize>) -> Self {
        Self { counts: pixels.map(|i| self.counts[i]).collect(), per_unit: self.per_unit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_a_file_keep_their_depth_exactly() {
        let map = DepthMap::new(vec![0, 1, 1234, 65535], 1000.0);
        assert_eq!(map.iter().collect::<Vec<_>>(), [0.0, 0.001, 1.234, 65.535]);
        assert_eq!((map.at(2), map.len()), (1.234, 4));
    }

    #[test]
    fn depths_are_rounded_with_small_errors() {
        let depths = [0.0, 3.7, -1.0, f32::NAN, 1e-9, 0.25, f32::INFINITY];
        let map = DepthMap::nearest(&depths);
        assert_eq!((map.at(0), map.at(2), map.at(3), map.at(6)), (0.0, 0.0, 0.0, 0.0));
        assert!((map.at(1) - 3.7).abs() < 4e-5 && (map.at(5) - 0.25).abs() < 4e-5);
        assert!(map.counts()[4] == 1, "a surface very near the camera stays a surface");
        assert_eq!(DepthMap::nearest(&[0.0]).at(0), 0.0);
    }
}
