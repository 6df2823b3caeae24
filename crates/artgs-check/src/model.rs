//! Model of an object, independent of the format: object's frame, +Z up, joints at 0.

use artgs_core::{Inertial, Joint, JointKind, PerState, Rigid};
use glam::{DMat3, DVec3};

/// A tree of links, parents before children.
#[derive(Clone, Debug, Default)]
pub(crate) struct Model {
    pub(crate) links: Vec<Link>,
    /// Whether the format contains collision hulls.
    pub(crate) has_hulls: bool,
}

/// A rigid body, or the fixed root of URDF.
#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) parent: Option<usize>,
    /// Link frame in the object's frame at the zero pose.
    pub(crate) pose: Rigid,
    pub(crate) motion: Option<Motion>,
    /// Link frame; none for a link without a body.
    pub(crate) inertial: Option<Inertial>,
    pub(crate) visuals: Vec<Shape>,
    pub(crate) hulls: Vec<Shape>,
}

/// Joint of a link; the axis is in the link frame. Values that a format lacks are none.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
    pub(crate) axis: DVec3,
    pub(crate) limits: [f64; 2],
    pub(crate) pitch: Option<f64>,
    pub(crate) observed: Option<PerState<f64>>,
    pub(crate) effort: Option<f64>,
    pub(crate) velocity: Option<f64>,
    pub(crate) damping: Option<f64>,
    pub(crate) friction: Option<f64>,
}

/// A mesh in the link frame; empty if it could not be read.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shape {
    pub(crate) points: Vec<DVec3>,
    /// Empty where only the corners are known.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Motion {
    /// A joint with only name, kind and axis.
    pub(crate) fn new(name: &str, kind: JointKind, axis: DVec3) -> Self {
        let (pitch, observed, effort, velocity, damping, friction) = (None, None, None, None, None, None);
        Self {
            name: name.into(),
            kind,
            axis,
            limits: [f64::NEG_INFINITY, f64::INFINITY],
            pitch,
            observed,
            effort,
            velocity,
            damping,
            friction,
        }
    }

    /// Motion in the link frame when the joint goes from 0 to `value`.
    pub(crate) fn motion(&self, value: f64) -> Rigid {
        let (kind, axis, pitch) = (self.kind, self.axis, self.pitch.unwrap_or(0.0));
        Joint { kind, axis, origin: DVec3::ZERO, pitch, state_values: PerState::new(0.0, 0.0), limits: self.limits }
            .motion(value)
    }

    pub(crate) fn turns(&self) -> bool {
        self.kind != JointKind::Prismatic
    }
}

impl Link {
    pub(crate) fn new(name: &str, parent: Option<usize>, pose: Rigid) -> Self {
        let (visuals, hulls) = (Vec::new(), Vec::new());
        Self { name: name.into(), parent, pose, motion: None, inertial: None, visuals, hulls }
    }

    pub(crate) fn is_body(&self) -> bool {
        self.inertial.is_some()
    }

    /// Box around shapes, in the object's frame at the zero pose.
    pub(crate) fn bounds(&self, shapes: &[Shape]) -> Option<[DVec3; 2]> {
        bounds(shapes.iter().flat_map(|s| &s.points).map(|p| self.pose.apply(*p)))
    }
}

/// Box around points.
pub(crate) fn bounds(points: impl Iterator<Item = DVec3>) -> Option<[DVec3; 2]> {
    points.fold(None, |out, p| {
        let [low, high] = out.unwrap_or([p; 2]);
        Some([low.min(p), high.max(p)])
    })
}

/// `ixx iyy izz ixy ixz iyz` as a matrix.
pub(crate) fn tensor([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

/// A matrix as `ixx iyy izz ixy ixz iyz`.
pub(crate) fn moments(m: DMat3) -> [f64; 6] {
    let [x, y, z] = m.to_cols_array_2d();
    [x[0], y[1], z[2], x[1], x[2], y[2]]
}

impl Model {
    /// Link frames in the object's frame for joint values, one per link.
    pub(crate) fn poses(&self, values: &[f64]) -> Vec<Rigid> {
        let mut poses: Vec<Rigid> = Vec::with_capacity(self.links.len());
        for (i, link) in self.links.iter().enumerate() {
            let moved = link.motion.as_ref().map_or(Rigid::IDENTITY, |m| m.motion(values[i]));
            let pose = match link.parent {
                Some(p) => poses[p] * self.links[p].pose.inverse() * link.pose * moved,
                None => link.pose * moved,
            };
            poses.push(pose);
        }
        poses
    }

    /// For every link whether the joint of link `root` moves it.
    pub(crate) fn carried(&self, root: usize) -> Vec<bool> {
        let mut out = vec![false; self.links.len()];
        for (i, link) in self.links.iter().enumerate() {
            out[i] = i == root || link.parent.is_some_and(|p| out[p]);
        }
        out
    }

    /// Numbers that are not finite, and invalid limits and axes.
    pub(crate) fn faults(&self) -> Vec<String> {
        self.links.iter().flat_map(|l| faults(l).into_iter().map(|f| format!("link `{}`: {f}", l.name))).collect()
    }
}

fn faults(link: &Link) -> Vec<String> {
    let mut out = Vec::new();
    let mut finite = |what: &str, values: &[f64]| {
        if let Some(v) = values.iter().find(|v| !v.is_finite()) {
            out.push(format!("{what} is {v}"));
        }
    };
    finite("position", &link.pose.translation.to_array());
    finite("orientation", &link.pose.rotation.to_array());
    if let Some(i) = &link.inertial {
        finite("mass", &[i.mass]);
        finite("centre of mass", &i.center.to_array());
        finite("inertia", &i.inertia);
    }
    let Some(m) = &link.motion else { return out };
    finite("axis of the joint", &m.axis.to_array());
    finite("limit of the joint", &m.limits);
    let others = [("effort", m.effort), ("velocity", m.velocity), ("damping", m.damping), ("friction", m.friction)];
    for (what, value) in others.into_iter().chain([("pitch", m.pitch)]) {
        finite(what, value.as_slice());
    }
    finite("observed value", m.observed.as_ref().map_or(&[], |o| o.as_slice()));
    if (m.axis.length() - 1.0).abs() > 1e-3 {
        out.push(format!("axis of the joint has length {}, must be 1", m.axis.length()));
    }
    if m.limits[0] >= m.limits[1] {
        out.push(format!("lower limit {} is not below the upper limit {}", m.limits[0], m.limits[1]));
    }
    out
}
