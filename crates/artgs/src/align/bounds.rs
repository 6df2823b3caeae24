//! A box that a person gives: the object is what is inside.

use glam::DVec3;
use serde::Serialize;
use std::fmt;
use std::str::FromStr;

/// Axis-aligned box of the object in the world of the start recording and its unit, the frame of
/// [`AlignReport::object`](super::AlignReport::object) and of the replica. As text:
/// `X0,Y0,Z0,X1,Y1,Z1`; serialises as `[[X0, Y0, Z0], [X1, Y1, Z1]]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(into = "[DVec3; 2]")]
pub struct ObjectBox {
    lower: DVec3,
    upper: DVec3,
}

/// Why numbers are not a box.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BoxError {
    /// Not six numbers.
    #[error("a box is six numbers: X0,Y0,Z0,X1,Y1,Z1, the lower corner before the upper one")]
    Count,
    /// Not a finite number.
    #[error("`{0}` is not a finite number")]
    NotFinite(String),
    /// No space between the corners along an axis.
    #[error("the upper {axis} ({upper}) must be above the lower one ({lower})")]
    Inverted {
        /// Name of the axis.
        axis: char,
        /// Lower bound as text.
        lower: String,
        /// Upper bound as text.
        upper: String,
    },
}

impl ObjectBox {
    /// An error for corners that are not finite, or not the lower and the upper one.
    pub fn new(lower: DVec3, upper: DVec3) -> Result<Self, BoxError> {
        if let Some(v) = lower.to_array().into_iter().chain(upper.to_array()).find(|v| !v.is_finite()) {
            return Err(BoxError::NotFinite(v.to_string()));
        }
        match (0..3).find(|&axis| lower[axis] >= upper[axis]) {
            Some(axis) => Err(BoxError::Inverted {
                axis: ['x', 'y', 'z'][axis],
                lower: lower[axis].to_string(),
                upper: upper[axis].to_string(),
            }),
            None => Ok(Self { lower, upper }),
        }
    }

    /// Smallest box that holds both.
    pub fn joined(&self, other: &Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// Smallest box of points, none if they have no extent along an axis.
    pub(crate) fn around(points: impl IntoIterator<Item = DVec3>) -> Option<Self> {
        let ends = points.into_iter().fold((DVec3::MAX, DVec3::MIN), |(l, u), p| (l.min(p), u.max(p)));
        Self::new(ends.0, ends.1).ok()
    }

    /// Corner with the lowest coordinates.
    pub fn lower(&self) -> DVec3 {
        self.lower
    }

    /// Corner with the highest coordinates.
    pub fn upper(&self) -> DVec3 {
        self.upper
    }

    /// True for points in the box and on its faces.
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.lower).all() && point.cmple(self.upper).all()
    }

    /// The smallest box with short decimal numbers that contains this one: between a hundredth and a thousandth of its
    /// longest edge is added at most.
    #[must_use]
    pub fn rounded(&self) -> Self {
        let digits = (2.0 - (self.upper - self.lower).max_element().log10().floor()) as i32;
        let steps = 10.0_f64.powi(digits);
        // Division by a power of ten gives the nearest number to the decimal one, which is written short.
        let scaled = |v: DVec3| if steps >= 1.0 { v / steps } else { v * (1.0 / steps).round() };
        // Without the sign of a negative zero.
        let round = |v: DVec3| scaled(v) + DVec3::ZERO;
        Self { lower: round((self.lower * steps).floor()), upper: round((self.upper * steps).ceil()) }
    }
}

impl From<ObjectBox> for [DVec3; 2] {
    fn from(b: ObjectBox) -> Self {
        [b.lower, b.upper]
    }
}

impl fmt::Display for ObjectBox {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([a, b, c], [d, e, g]) = (self.lower.to_array(), self.upper.to_array());
        write!(f, "{a},{b},{c},{d},{e},{g}")
    }
}

impl FromStr for ObjectBox {
    type Err = BoxError;

    fn from_str(text: &str) -> Result<Self, BoxError> {
        let number = |word: &str| word.trim().parse::<f64>().map_err(|_| BoxError::NotFinite(word.trim().to_owned()));
        let numbers: Vec<&str> = text.split(',').collect();
        if numbers.len() != 6 {
            return Err(BoxError::Count);
        }
        let v = numbers.into_iter().map(number).collect::<Result<Vec<f64>, _>>()?;
        Self::new(DVec3::new(v[0], v[1], v[2]), DVec3::new(v[3], v[4], v[5]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_six_finite_numbers_in_order() {
        let found: ObjectBox = "-1.5, 0,1e-1,2,3,4".parse().expect("a box");
        assert_eq!((found.lower(), found.upper()), (DVec3::new(-1.5, 0.0, 0.1), DVec3::new(2.0, 3.0, 4.0)));
        assert_eq!(found.to_string().parse(), Ok(found));
        for (text, part) in [
            ("", "six numbers"),
            ("1,2,3", "six numbers"),
            ("1,2,3,4,5,6,7", "six numbers"),
            ("0,0,0,1,1,x", "`x` is not a finite number"),
            ("0,0,0,1,1,NaN", "`NaN` is not a finite number"),
            ("0,0,-inf,1,1,1", "`-inf` is not a finite number"),
            ("0,2,0,1,1,1", "the upper y (1) must be above the lower one (2)"),
            ("0,0,1,1,1,1", "the upper z (1) must be above"),
        ] {
            let error = text.parse::<ObjectBox>().expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }

    #[test]
    fn rounding_grows_a_box_by_little_and_gives_short_numbers() {
        let exact =
            ObjectBox::new(DVec3::new(-1.234567, 0.1, 0.0), DVec3::new(0.765433, 0.300001, 0.7)).expect("a box");
        assert_eq!(exact.rounded().to_string(), "-1.24,0.1,0,0.77,0.31,0.7");
        let large = ObjectBox::new(DVec3::splat(-123_456.7), DVec3::splat(7_654.3)).expect("a box");
        assert_eq!(large.rounded().to_string(), "-124000,-124000,-124000,8000,8000,8000");
        for size in [1e-6, 0.02, 1.0, 99.0, 1e9] {
            let found = ObjectBox::new(DVec3::splat(-0.37 * size), DVec3::splat(0.63 * size)).expect("a box");
            let rounded = found.rounded();
            assert!(rounded.contains(found.lower()) && rounded.contains(found.upper()), "{rounded}");
            assert!((rounded.upper() - rounded.lower()).max_element() < 1.021 * size, "{rounded}");
        }
    }
}
