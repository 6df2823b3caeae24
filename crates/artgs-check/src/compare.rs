//! Compares formats: each is compared with the first readable one, the reference, which is the URDF if there is one.

use crate::CheckOptions;
use crate::model::{Link, Model, tensor};
use crate::readers::Opened;
use artgs_core::{Inertial, State};
use glam::DVec3;

/// Adds differences to the findings; returns the reference, completed by values that only other formats contain: observed
/// values and pitches.
pub(crate) fn compare_all(opened: &mut [Opened], options: &CheckOptions) -> Option<Model> {
    let first = opened.iter().position(|o| o.model.is_some())?;
    let name = opened[first].finding.format.clone();
    let mut reference = opened[first].model.clone()?;
    for read in opened.iter_mut().skip(first + 1) {
        let Some(model) = &read.model else { continue };
        let found = differences(&reference, &name, model, options.agreement);
        read.finding.problems.extend(found);
        complete(&mut reference, model);
    }
    Some(reference)
}

/// Copies values that the reference lacks, so that later formats are compared with them.
fn complete(reference: &mut Model, other: &Model) {
    for link in &mut reference.links {
        let twin = other.links.iter().find(|l| l.name == link.name).and_then(|l| l.motion.as_ref());
        let (Some(own), Some(twin)) = (&mut link.motion, twin) else { continue };
        own.observed = own.observed.or(twin.observed);
        own.pitch = own.pitch.or(twin.pitch);
    }
}

struct Against<'a> {
    name: &'a str,
    tolerance: f64,
    found: Vec<String>,
}

/// Differences of `other` from `reference`, a format called `name`.
fn differences(reference: &Model, name: &str, other: &Model, tolerance: f64) -> Vec<String> {
    let mut against = Against { name, tolerance, found: Vec::new() };
    let known = |model: &Model, name: &str| model.links.iter().any(|l| l.is_body() && l.name == name);
    for link in other.links.iter().filter(|l| l.is_body() && !known(reference, &l.name)) {
        against.found.push(format!("link `{}` is not in the {name}", link.name));
    }
    for link in reference.links.iter().filter(|l| l.is_body()) {
        match other.links.iter().find(|l| l.is_body() && l.name == link.name) {
            Some(twin) => against.link(reference, link, other, twin),
            None => against.found.push(format!("link `{}` of the {name} is missing", link.name)),
        }
    }
    against.found
}

impl Against<'_> {
    fn report(&mut self, link: &Link, what: &str, is: impl std::fmt::Display, was: impl std::fmt::Display) {
        self.found.push(format!("link `{}`: {what} is {is}, in the {} {was}", link.name, self.name));
    }

    /// Compares lengths and angles. [`Model::faults`] reports numbers that are not finite.
    fn same(&mut self, link: &Link, what: &str, is: f64, was: f64) {
        if (is - was).abs() > self.tolerance {
            self.report(link, what, is, was);
        }
    }

    /// Compares masses, forces and similar values, if both formats contain them.
    fn share(&mut self, link: &Link, what: &str, is: Option<f64>, was: Option<f64>) {
        let (Some(is), Some(was)) = (is, was) else { return };
        if (is - was).abs() > self.tolerance * is.abs().max(was.abs()) {
            self.report(link, what, is, was);
        }
    }

    fn point(&mut self, link: &Link, what: &str, is: DVec3, was: DVec3) {
        if (is - was).length() > self.tolerance {
            self.report(link, what, is, was);
        }
    }

    fn link(&mut self, reference: &Model, link: &Link, other: &Model, twin: &Link) {
        // The root link of a URDF represents the world and does not count as a parent.
        let parent = |model: &Model, link: &Link| {
            let body = link.parent.map(|p| &model.links[p]).filter(|p| p.is_body());
            body.map_or("the world".to_string(), |p| format!("`{}`", p.name))
        };
        let (is, was) = (parent(other, twin), parent(reference, link));
        if is != was {
            self.report(link, "parent", is, was);
        }
        self.point(link, "position of the joint", twin.pose.translation, link.pose.translation);
        self.motions(link, twin);
        if let (Some(was), Some(is)) = (&link.inertial, &twin.inertial) {
            self.share(link, "mass", Some(is.mass), Some(was.mass));
            let at = |l: &Link, i: &Inertial| l.pose.apply(i.center);
            self.point(link, "centre of mass", at(twin, is), at(link, was));
            let turned = |l: &Link, i: &Inertial| {
                let turn = l.pose.matrix();
                turn * tensor(i.inertia) * turn.transpose()
            };
            let (is, was) = (turned(twin, is), turned(link, was));
            let size = was.to_cols_array().iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            if !is.abs_diff_eq(was, self.tolerance * size) {
                self.report(link, "inertia", is, was);
            }
        }
        self.shapes(reference, link, other, twin);
    }

    fn motions(&mut self, link: &Link, twin: &Link) {
        let (was, is) = match (&link.motion, &twin.motion) {
            (None, None) => return,
            (Some(was), Some(is)) => (was, is),
            (was, _) => {
                let kind = |moves: bool| if moves { "movable" } else { "fixed" };
                return self.report(link, "the joint", kind(was.is_none()), kind(was.is_some()));
            }
        };
        if was.turns() != is.turns() {
            let kind = |turns: bool| if turns { "a hinge" } else { "a slide" };
            return self.report(link, "the joint", kind(is.turns()), kind(was.turns()));
        }
        self.point(link, "axis", twin.pose.turn(is.axis), link.pose.turn(was.axis));
        self.same(link, "lower limit", is.limits[0], was.limits[0]);
        self.same(link, "upper limit", is.limits[1], was.limits[1]);
        if let (Some(is), Some(was)) = (is.observed, was.observed) {
            for state in State::ALL {
                self.same(link, &format!("value observed at the {}", state.name()), is[state], was[state]);
            }
        }
        self.share(link, "pitch", is.pitch, was.pitch);
        self.share(link, "effort", is.effort, was.effort);
        self.share(link, "velocity", is.velocity, was.velocity);
        self.share(link, "damping", is.damping, was.damping);
        self.share(link, "friction", is.friction, was.friction);
    }

    /// Compares boxes of visual meshes and of hulls, and the number of hulls.
    fn shapes(&mut self, reference: &Model, link: &Link, other: &Model, twin: &Link) {
        let mut boxes = vec![("the visual meshes", twin.bounds(&twin.visuals), link.bounds(&link.visuals))];
        if reference.has_hulls && other.has_hulls {
            if link.hulls.len() != twin.hulls.len() {
                self.report(link, "number of hulls", twin.hulls.len(), link.hulls.len());
            }
            boxes.push(("the hulls", twin.bounds(&twin.hulls), link.bounds(&link.hulls)));
        }
        for (what, is, was) in boxes {
            // MJCF lacks meshes with three vertices, and unreadable meshes are reported elsewhere.
            let (Some(is), Some(was)) = (is, was) else { continue };
            self.point(link, &format!("lower corner of {what}"), is[0], was[0]);
            self.point(link, &format!("upper corner of {what}"), is[1], was[1]);
        }
    }
}
