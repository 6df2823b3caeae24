//! A replica prepared for simulators: links in link frames, metres, with masses, hulls and joint dynamics.
//!
//! The object's frame has +Z up. Link frames are parallel to it at the zero pose; link 0 is fixed to the world.

use crate::{Handle, Joint, JointKind, Mesh, PartSemantics, PerState, Rigid, Splats, State};
use glam::DVec3;

/// Says what is wrong with the size of an object, the length of the diagonal of its box in metres; none if simulators can
/// compute with it: from a millimetre to a kilometre.
pub fn odd_size(diagonal: f64) -> Option<String> {
    let said = match diagonal {
        d if d < 1e-9 => format!("{d:.1e} m"),
        d if d < 1e-6 => format!("{:.1} nanometres", 1e9 * d),
        d if d < 1e-3 => format!("{:.1} micrometres", 1e6 * d),
        d if d > 1e3 => format!("{:.1} kilometres", 1e-3 * d),
        _ => return None,
    };
    Some(format!(
        "the object has a size of {said}, and simulators compute with 1 mm to 1 km; --scale of artgs export is the length of a \
         unit of the capture in metres"
    ))
}

/// An articulated object for simulators.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Asset {
    /// Name of the object: lower case letters, digits and `_`, a letter first.
    pub name: String,
    /// Links, the base first, parents before children.
    pub links: Vec<AssetLink>,
    /// Pairs of links, by their places in `links`, that cannot touch at any values of their joints within the limits: engines need not
    /// test them against each other. First link before second; links and their parents are not among them.
    pub apart: Vec<[usize; 2]>,
    /// Unit vector from the object towards its front, in the object's frame; none if unknown.
    pub front: Option<DVec3>,
}

/// A rigid body of an asset.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AssetLink {
    /// Unique name, of the same form as the asset's name.
    pub name: String,
    /// Parent link; none for the base.
    pub parent: Option<usize>,
    /// Joint to the parent; none for the base.
    pub joint: Option<AssetJoint>,
    /// Origin of the link frame in the object's frame at the zero pose, metres; on the joint's axis.
    pub origin: DVec3,
    /// Visual mesh, link frame; may be empty.
    pub visual: TexturedMesh,
    /// Convex closed collision meshes, link frame, without colours; empty if the link has no volume.
    pub collision: Vec<Mesh>,
    /// Mass and inertia.
    pub inertial: Inertial,
    /// How its surface rubs and bounces.
    pub contact: ContactMaterial,
    /// Gaussians of the link, link frame.
    pub splats: Option<Splats>,
    /// What it is; none if unknown.
    pub semantics: Option<PartSemantics>,
    /// Where a gripper holds it.
    pub handles: Vec<Handle>,
}

/// A joint of an asset; its frame is that of the child link at value 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AssetJoint {
    /// Kind of motion.
    pub kind: JointKind,
    /// Unit axis, link frame; positive values open the joint if the closed state is known.
    pub axis: DVec3,
    /// Metres along the axis per radian; 0 unless `kind` is `Screw`.
    pub pitch: f64,
    /// Lower and upper limit, radians or metres, lower below upper; 0 lies between them.
    pub limits: [f64; 2],
    /// Values in the observed states, within the limits.
    pub observed: PerState<f64>,
    /// Largest force (N) or torque (N m).
    pub effort: f64,
    /// Largest speed, radians or metres per second.
    pub velocity: f64,
    /// Viscous damping, N s/m or N m s/rad.
    pub damping: f64,
    /// Dry friction, N or N m.
    pub friction: f64,
}

/// A mesh with normals and, optionally, a baked texture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TexturedMesh {
    /// Vertices with colours and triangles; vertices are split along seams of the texture.
    pub mesh: Mesh,
    /// Unit normals, one per vertex.
    pub normals: Vec<[f32; 3]>,
    /// Texture coordinates per vertex, (0, 0) at the top left corner of the texture, (1, 1) at the bottom right; empty
    /// without a texture.
    pub uvs: Vec<[f32; 2]>,
    /// The texture, if there is one.
    pub texture: Option<Texture>,
    /// What each triangle rests on; empty if that is unknown.
    pub evidence: Vec<FaceEvidence>,
}

impl TexturedMesh {
    /// The triangles by what they rest on, in the order of [`FaceEvidence::ALL`]; all together if that is unknown.
    pub fn by_evidence(&self) -> Vec<(Option<FaceEvidence>, Vec<[u32; 3]>)> {
        let triangles = &self.mesh.triangles;
        if self.evidence.len() != triangles.len() {
            return vec![(None, triangles.clone())];
        }
        let of = |kind: FaceEvidence| {
            let own = triangles.iter().zip(&self.evidence).filter(|(_, evidence)| **evidence == kind);
            (Some(kind), own.map(|(t, _)| *t).collect::<Vec<_>>())
        };
        FaceEvidence::ALL.into_iter().map(of).filter(|(_, own)| !own.is_empty()).collect()
    }
}

/// What a face of a surface rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaceEvidence {
    /// A sensor measured it.
    Seen,
    /// Depth was derived from photos and from surfaces that continue there.
    Derived,
    /// Nothing was recorded: it closes the surface.
    Invented,
}

impl FaceEvidence {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Seen, Self::Derived, Self::Invented];

    /// `seen`, `derived` or `invented`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Seen => "seen",
            Self::Derived => "derived",
            Self::Invented => "invented",
        }
    }
}

/// An sRGB image, rows from the top.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// `[height * width][3]`.
    pub rgb: Vec<[u8; 3]>,
}

/// Mass and inertia of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertial {
    /// Kilograms, above 0.
    pub mass: f64,
    /// Centre of mass, link frame, metres.
    pub center: DVec3,
    /// `ixx iyy izz ixy ixz iyz` about the centre of mass, axes of the link frame, kg m^2.
    pub inertia: [f64; 6],
}

/// Contact of a surface with others.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactMaterial {
    /// Coefficient of static and dynamic dry friction, at least 0.
    pub friction: f64,
    /// Share of the speed that is left after an impact, 0 to 1.
    pub restitution: f64,
}

impl Default for ContactMaterial {
    /// Wood, plastic and painted metal on each other; impacts without rebound.
    fn default() -> Self {
        Self { friction: 0.5, restitution: 0.0 }
    }
}

impl Default for Inertial {
    /// A kilogram in a cube of 10 cm.
    fn default() -> Self {
        let i = 1.0 / 600.0;
        Self { mass: 1.0, center: DVec3::ZERO, inertia: [i, i, i, 0.0, 0.0, 0.0] }
    }
}

impl AssetJoint {
    /// Motion of the child in its own frame when the joint goes from 0 to `value`.
    pub fn motion(&self, value: f64) -> Rigid {
        let Self { kind, axis, pitch, limits, observed, .. } = *self;
        Joint { kind, axis, origin: DVec3::ZERO, pitch, state_values: observed, limits }.motion(value)
    }
}

impl Asset {
    /// Length of the diagonal of the box around the visual meshes at the zero pose, metres; 0 without meshes.
    pub fn bounds_diagonal(&self) -> f64 {
        self.bounds(&[]).map_or(0.0, |[low, high]| (high - low).length())
    }

    /// Lowest and highest coordinates of the visual meshes at joint values as of [`Asset::poses`], object's frame, metres; none without
    /// meshes.
    pub fn bounds(&self, values: &[f64]) -> Option<[DVec3; 2]> {
        let poses = self.poses(values);
        let points = self.links.iter().zip(&poses).flat_map(|(link, pose)| {
            link.visual.mesh.vertices.iter().map(|vertex| pose.apply(DVec3::from_array(vertex.map(f64::from))))
        });
        points.map(|p| [p, p]).reduce(|[low, high], [p, _]| [low.min(p), high.max(p)])
    }

    /// Link frames in the object's frame, one per link, where `values[i]` is the joint value of link `i` (that of the base
    /// is ignored).
    pub fn poses(&self, values: &[f64]) -> Vec<Rigid> {
        let mut poses: Vec<Rigid> = Vec::with_capacity(self.links.len());
        for (i, link) in self.links.iter().enumerate() {
            let moved = link.joint.map_or(Rigid::IDENTITY, |j| j.motion(values.get(i).copied().unwrap_or(0.0)));
            let pose = match link.parent {
                Some(parent) => poses[parent] * Rigid::shift(link.origin - self.links[parent].origin) * moved,
                None => Rigid::shift(link.origin) * moved,
            };
            poses.push(pose);
        }
        poses
    }

    /// Joint values of all links in an observed state; 0 for the base.
    pub fn observed(&self, state: State) -> Vec<f64> {
        self.links.iter().map(|l| l.joint.map_or(0.0, |j| j.observed[state])).collect()
    }

    /// Indices of the links that have a joint.
    pub fn movable(&self) -> impl Iterator<Item = (usize, &AssetLink, &AssetJoint)> {
        self.links.iter().enumerate().filter_map(|(i, l)| Some((i, l, l.joint.as_ref()?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(parent: Option<usize>, kind: JointKind, axis: DVec3, origin: DVec3) -> AssetLink {
        let joint = AssetJoint {
            kind,
            axis,
            pitch: 0.0,
            limits: [0.0, 1.0],
            observed: PerState::new(0.0, 0.5),
            effort: 1.0,
            velocity: 1.0,
            damping: 0.0,
            friction: 0.0,
        };
        AssetLink { parent, joint: parent.map(|_| joint), origin, ..AssetLink::default() }
    }

    #[test]
    fn a_drawer_in_a_door_moves_with_the_door() {
        let base = link(None, JointKind::Revolute, DVec3::Z, DVec3::ZERO);
        let door = link(Some(0), JointKind::Revolute, DVec3::Z, DVec3::new(1.0, 0.0, 0.0));
        let drawer = link(Some(1), JointKind::Prismatic, DVec3::X, DVec3::new(2.0, 0.0, 0.5));
        let asset = Asset { name: "a".into(), links: vec![base, door, drawer], ..Asset::default() };
        let zero = asset.poses(&[0.0; 3]);
        assert!((zero[2].translation - DVec3::new(2.0, 0.0, 0.5)).length() < 1e-12);
        let quarter = asset.poses(&[0.0, std::f64::consts::FRAC_PI_2, 0.25]);
        // The door turns about (1, 0, 0); the drawer is a metre from that axis, and its direction has turned to +Y.
        assert!((quarter[2].translation - DVec3::new(1.0, 1.25, 0.5)).length() < 1e-12);
        assert_eq!(asset.observed(State::END), [0.0, 0.5, 0.5]);
        assert_eq!(asset.movable().count(), 2);
        assert_eq!(asset.bounds_diagonal(), 0.0);
        let mut asset = asset;
        asset.links[1].visual.mesh = Mesh::cuboid([0.0; 3], [0.5, 0.0, 0.0]);
        assert_eq!(asset.bounds_diagonal(), 0.5);
    }

    #[test]
    fn only_sizes_that_no_simulator_computes_with_are_odd() {
        for (diagonal, words) in [
            (3e-12, "3.0e-12 m"),
            (3e-8, "30.0 nanometres"),
            (5.4e-7 * 1e3, "540.0 micrometres"),
            (2e4, "20.0 kilometres"),
        ] {
            let said = odd_size(diagonal).unwrap();
            assert!(said.contains(words) && said.contains("--scale"), "{said}");
        }
        assert!([1e-3, 0.5, 1e3, f64::NAN].iter().all(|d| odd_size(*d).is_none()));
    }
}
