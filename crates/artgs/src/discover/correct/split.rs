//! Parts that a user splits. A part is labelled as one; then its points are distributed over its pieces.

use super::CorrectError;
use crate::discover::cloud::IndexedCloud;
use crate::neighbours::PointTree;
use artgs_core::{JointEstimate, PerState, Rigid, State};
use artgs_io::CutPlane;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Splits, and edits of pieces after them.
#[derive(Default)]
pub(super) struct Split<'a> {
    steps: Vec<Step<'a>>,
    /// Motions that pieces begin with; others begin with that of the part they were cut from.
    starts: Vec<(usize, Rigid)>,
}

/// A change of labels.
enum Step<'a> {
    Cut { part: usize, new: usize, plane: Option<&'a CutPlane>, points: &'a [[f64; 3]] },
    Merge { part: usize, into: usize },
    Delete { part: usize },
}

/// What is left after all steps.
pub(super) struct Pieces {
    /// Numbers of the parts, in order.
    pub(super) numbers: Vec<usize>,
    /// Motions to begin with, of those whose points changed.
    pub(super) starts: Vec<Option<Rigid>>,
    /// Position in `numbers`, from 1, of every point; 0 is static.
    pub(super) labels: PerState<Vec<u16>>,
}

impl<'a> Split<'a> {
    /// Cuts a new part off.
    pub(super) fn cut(&mut self, part: usize, new: usize, plane: Option<&'a CutPlane>, points: &'a [[f64; 3]]) {
        self.steps.push(Step::Cut { part, new, plane, points });
    }

    /// True if the part is a piece, or pieces were cut off it or merged with it.
    pub(super) fn concerns(&self, part: usize) -> bool {
        self.steps.iter().any(|step| match step {
            Step::Cut { part: from, new, .. } => part == *from || part == *new,
            Step::Merge { part: other, into } => part == *other || part == *into,
            Step::Delete { part: gone } => part == *gone,
        })
    }

    /// Merges a part if one of both is a piece; false if none is.
    pub(super) fn merge(&mut self, part: usize, into: usize) -> bool {
        let concerned = self.concerns(part) || self.concerns(into);
        if concerned {
            self.steps.push(Step::Merge { part, into });
        }
        concerned
    }

    /// Deletes a part if it is a piece; false if it is none.
    pub(super) fn delete(&mut self, part: usize) -> bool {
        let concerned = self.concerns(part);
        if concerned {
            self.steps.push(Step::Delete { part });
        }
        concerned
    }

    /// Sets the motion that a piece begins with; false if the part is none.
    pub(super) fn start(&mut self, part: usize, motion: Rigid) -> bool {
        let concerned = self.concerns(part);
        if concerned {
            self.starts.retain(|start| start.0 != part);
            self.starts.push((part, motion));
        }
        concerned
    }

    /// The part that a piece was cut from at first.
    pub(super) fn root(&self, part: usize) -> usize {
        let parent = self.steps.iter().find_map(|step| match step {
            Step::Cut { part: from, new, .. } if *new == part => Some(*from),
            _ => None,
        });
        // A piece has a higher number than the part it is cut from, so the recursion ends.
        parent.filter(|from| *from < part).map_or(part, |from| self.root(from))
    }

    /// Distributes the points of labelled parts; part `k + 1` of `labels` has the number `numbers[k]` and the motion of
    /// `parts[k]`.
    pub(super) fn apply(
        &self,
        clouds: &PerState<IndexedCloud<'_>>,
        numbers: &[usize],
        parts: &[JointEstimate],
        labels: PerState<Vec<u16>>,
    ) -> Result<Pieces, CorrectError> {
        let number = |label: u16| usize::from(label).checked_sub(1).map_or(0, |k| numbers[k]);
        let mut labels = labels.map(|l| l.into_iter().map(number).collect::<Vec<usize>>());
        let mut left = numbers.to_vec();
        let motion_of = |part: usize| {
            let root = self.root(part);
            numbers.iter().position(|n| *n == root).map_or(Rigid::IDENTITY, |k| parts[k].motion)
        };
        for step in &self.steps {
            match *step {
                Step::Cut { part, new, plane, points } => {
                    let chosen = Chosen::new(plane, points, clouds, &labels, part);
                    let motion = motion_of(part);
                    let [mut cut, mut kept] = [0, 0];
                    for s in State::ALL {
                        let to_start = if s == State::START { Rigid::IDENTITY } else { motion.inverse() };
                        let of_new = chosen.of(&clouds[s].cloud.points, &labels[s], part, &to_start);
                        for (label, new_part) in labels[s].iter_mut().zip(of_new).filter(|(l, _)| **l == part) {
                            if new_part {
                                *label = new;
                                cut += 1;
                            } else {
                                kept += 1;
                            }
                        }
                    }
                    if cut == 0 || kept == 0 {
                        return Err(CorrectError::NothingSplit { part });
                    }
                    left.push(new);
                }
                Step::Merge { part, into } => replace(&mut labels, &mut left, part, into),
                Step::Delete { part } => replace(&mut labels, &mut left, part, 0),
            }
        }
        // As they were found, then as they were added.
        left.sort_unstable();
        let label = |part: &usize| left.iter().position(|n| n == part).map_or(0, |k| k as u16 + 1);
        let labels = labels.as_ref().map(|l| l.iter().map(label).collect());
        let start = |part: &usize| {
            let own = self.starts.iter().find(|start| start.0 == *part).map(|start| start.1);
            self.concerns(*part).then(|| own.unwrap_or_else(|| motion_of(*part)))
        };
        Ok(Pieces { starts: left.iter().map(start).collect(), numbers: left, labels })
    }
}

fn replace(labels: &mut PerState<Vec<usize>>, left: &mut Vec<usize>, part: usize, by: usize) {
    for s in State::ALL {
        labels[s].iter_mut().filter(|l| **l == part).for_each(|l| *l = by);
    }
    left.retain(|n| *n != part);
}

/// Which points of a part at the start belong to the new one.
enum Chosen {
    Side(DVec3, DVec3),
    /// Points of the part at the start, and whether each is chosen.
    Near(PointTree, Vec<bool>),
}

impl Chosen {
    fn new(
        plane: Option<&CutPlane>,
        points: &[[f64; 3]],
        clouds: &PerState<IndexedCloud<'_>>,
        labels: &PerState<Vec<usize>>,
        part: usize,
    ) -> Self {
        if let Some(plane) = plane {
            return Self::Side(DVec3::from_array(plane.point), DVec3::from_array(plane.normal));
        }
        let start = clouds[State::START].cloud.points.iter().zip(&labels[State::START]);
        let own: Vec<[f32; 3]> = start.filter(|(_, l)| **l == part).map(|(p, _)| p.to_array()).collect();
        let tree = PointTree::new(&own);
        let mut chosen = vec![false; own.len()];
        for point in points {
            if let Some((i, _)) = tree.nearest(&point.map(|x| x as f32)) {
                chosen[i] = true;
            }
        }
        Self::Near(tree, chosen)
    }

    /// For every point, whether it belongs to the new part, if it belongs to `part`.
    fn of(&self, points: &[Vec3], labels: &[usize], part: usize, to_start: &Rigid) -> Vec<bool> {
        let is_new = |(p, label): (&Vec3, &usize)| {
            let at = to_start.apply(p.as_dvec3());
            *label == part
                && match self {
                    Self::Side(point, normal) => (at - *point).dot(*normal) > 0.0,
                    Self::Near(tree, chosen) => tree.nearest(&at.as_vec3().to_array()).is_some_and(|(i, _)| chosen[i]),
                }
        };
        points.par_iter().zip(labels).with_min_len(512).map(is_new).collect()
    }
}
