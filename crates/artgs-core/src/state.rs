//! The observed states of an object, and data with one entry per state.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::ops::{Index, IndexMut};

/// One observed state. Its number is the index used in files, GPU buffers and `time` fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct State(u8);

impl State {
    /// The first observed state. Joint values are 0 here, and the replica is in the world frame of this state.
    pub const START: Self = Self(0);
    /// The last observed state.
    pub const END: Self = Self(1);
    /// Every state, in order.
    pub const ALL: [Self; COUNT] = [Self::START, Self::END];

    /// The state with this index; none if there is no such state.
    pub fn from_index(index: usize) -> Option<Self> {
        Self::ALL.get(index).copied()
    }

    /// Position in [`State::ALL`].
    pub fn index(self) -> usize {
        usize::from(self.0)
    }

    /// Name used in paths, files and messages: `start` or `end`.
    pub fn name(self) -> &'static str {
        NAMES[self.index()]
    }

    /// The state on the other end of a motion from start to end.
    pub fn other(self) -> Self {
        if self == Self::START { Self::END } else { Self::START }
    }
}

const COUNT: usize = 2;
const NAMES: [&str; COUNT] = ["start", "end"];

/// One value for every observed state. Serialises as `{"start": .., "end": ..}`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PerState<T>([T; COUNT]);

impl<T> PerState<T> {
    /// From the value at the start and the value at the end.
    pub const fn new(start: T, end: T) -> Self {
        Self([start, end])
    }

    /// `make` is called once per state, in order.
    pub fn from_fn(make: impl FnMut(State) -> T) -> Self {
        Self(State::ALL.map(make))
    }

    /// Like [`PerState::from_fn`] for values that may be missing; none if one is.
    pub fn try_from_fn(mut make: impl FnMut(State) -> Option<T>) -> Option<Self> {
        Some(Self([make(State::START)?, make(State::END)?]))
    }

    /// The same function of every value, in order.
    pub fn map<U>(self, f: impl FnMut(T) -> U) -> PerState<U> {
        PerState(self.0.map(f))
    }

    /// References to the values.
    pub fn as_ref(&self) -> PerState<&T> {
        PerState(self.0.each_ref())
    }

    /// Mutable references to the values.
    pub fn as_mut(&mut self) -> PerState<&mut T> {
        PerState(self.0.each_mut())
    }

    /// Values of two in pairs.
    pub fn zip<U>(self, other: PerState<U>) -> PerState<(T, U)> {
        let [a, b] = self.0;
        let [c, d] = other.0;
        PerState([(a, c), (b, d)])
    }

    /// Values in the order of the states.
    pub fn iter(&self) -> std::slice::Iter<'_, T> {
        self.0.iter()
    }

    /// Values in the order of the states.
    pub fn iter_mut(&mut self) -> std::slice::IterMut<'_, T> {
        self.0.iter_mut()
    }

    /// Values with their states, in order.
    pub fn enumerate(&self) -> impl Iterator<Item = (State, &T)> {
        State::ALL.into_iter().zip(&self.0)
    }

    /// The values as a slice, in the order of the states.
    pub fn as_slice(&self) -> &[T] {
        &self.0
    }
}

impl<T, E> PerState<Result<T, E>> {
    /// All values, or the first error.
    pub fn transpose(self) -> Result<PerState<T>, E> {
        let [start, end] = self.0;
        Ok(PerState([start?, end?]))
    }
}

impl<T> Index<State> for PerState<T> {
    type Output = T;
    fn index(&self, state: State) -> &T {
        &self.0[state.index()]
    }
}

impl<T> IndexMut<State> for PerState<T> {
    fn index_mut(&mut self, state: State) -> &mut T {
        &mut self.0[state.index()]
    }
}

impl<T> IntoIterator for PerState<T> {
    type Item = T;
    type IntoIter = std::array::IntoIter<T, COUNT>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a PerState<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<'a, T> IntoIterator for &'a mut PerState<T> {
    type Item = &'a mut T;
    type IntoIter = std::slice::IterMut<'a, T>;
    fn into_iter(self) -> Self::IntoIter {
        self.0.iter_mut()
    }
}

#[derive(Serialize)]
struct NamedRef<'a, T> {
    start: &'a T,
    end: &'a T,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Named<T> {
    start: T,
    end: T,
}

impl<T: Serialize> Serialize for PerState<T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        NamedRef { start: &self.0[0], end: &self.0[1] }.serialize(serializer)
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for PerState<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Named { start, end } = Named::deserialize(deserializer)?;
        Ok(Self([start, end]))
    }
}

/// Serialises values as the array `[start, end]`; for `#[serde(with = "artgs_core::state::array")]`.
pub mod array {
    use super::{COUNT, PerState};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes `[start, end]`.
    pub fn serialize<T: Serialize, S: Serializer>(values: &PerState<T>, serializer: S) -> Result<S::Ok, S::Error> {
        values.0.serialize(serializer)
    }

    /// Reads `[start, end]`.
    pub fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<PerState<T>, D::Error> {
        <[T; COUNT]>::deserialize(deserializer).map(PerState)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_by_state_and_in_order() {
        let names = PerState::from_fn(State::name);
        assert_eq!((names[State::START], names[State::END]), ("start", "end"));
        assert_eq!(names.enumerate().map(|(s, _)| s.index()).collect::<Vec<_>>(), [0, 1]);
        assert_eq!(State::ALL.map(State::other), [State::END, State::START]);
        assert_eq!((State::from_index(1), State::from_index(2)), (Some(State::END), None));
    }

    #[test]
    fn errors_and_missing_values_are_passed_on() {
        assert_eq!(PerState::new(Ok(1), Err("no")).transpose(), Err("no"));
        assert_eq!(PerState::try_from_fn(|s| (s == State::START).then_some(1)), None);
        assert_eq!(PerState::new(1, 2).zip(PerState::new(3, 4)), PerState::new((1, 3), (2, 4)));
    }
}
