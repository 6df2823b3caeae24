//! `scene.json`: the data of the page. `viewer/README.md` describes the fields.
//!
//! Frames: the object's, +Z up, metres; link frames are parallel to it at the zero pose.

use artgs_core::{Alternative, Joint, JointKind, PartClass, PerState, State};
use artgs_io::MarkedJoint;
use artgs_io::export_report::LinkReport;
use serde::Serialize;
use serde_json::Value;

/// Value of `format` in `scene.json`.
pub(crate) const FORMAT: &str = "artgs-scene";
/// Version of `scene.json`.
pub(crate) const VERSION: u32 = 1;

/// Content of the page. Files are names in [`Page::files`](crate::Page::files).
#[derive(Clone, Debug, Serialize)]
pub struct Scene {
    /// `artgs-scene`.
    pub format: &'static str,
    /// Version of the fields.
    pub version: u32,
    /// Name of the object.
    pub name: String,
    /// Links, the base first, parents before children.
    pub links: Vec<SceneLink>,
    /// Cameras with their photos.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cameras: Vec<SceneCamera>,
    /// Points of the observed states.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub clouds: Vec<SceneCloud>,
    /// Content of `metrics.json`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scores: Option<Value>,
    /// From the capture's frame to the object's, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub placement: Option<crate::Placement>,
    /// True if the server accepts corrections.
    pub corrections: bool,
    /// True if the page follows a run, see [`Live`](crate::Live).
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub live: bool,
    /// True if the server shows another page after the run.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub returns: bool,
    /// Whether the server can start a run that applies corrections; none for a server without runs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rerun: Option<SceneRerun>,
    /// Box of the object that the page edits; none if it edits none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub object_box: Option<SceneBox>,
}

/// The box of the object in a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneBox {
    /// Lowest x, y, z of the box to begin with, capture's frame and unit.
    pub lower: [f64; 3],
    /// Highest x, y, z.
    pub upper: [f64; 3],
    /// True if the box was saved before, false if it is a guess.
    pub saved: bool,
    /// File that the server writes; none if it writes none.
    pub file: Option<String>,
    /// Why the server writes none, if there is more to say than that the page has no server.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
}

/// Whether a run can be started from the page.
#[derive(Clone, Debug, Serialize)]
pub struct SceneRerun {
    /// Why it cannot; none if it can.
    pub refused: Option<String>,
}

/// A rigid body.
#[derive(Clone, Debug, Serialize)]
pub struct SceneLink {
    /// Unique name.
    pub name: String,
    /// Index of the parent link; none for the base.
    pub parent: Option<usize>,
    /// Origin of the link frame in the object's frame at the zero pose, metres.
    pub origin: [f64; 3],
    /// Joint to the parent; none if the link is fixed.
    pub joint: Option<SceneJoint>,
    /// Visual mesh.
    pub mesh: Option<SceneMesh>,
    /// Convex collision meshes, OBJ, link frame.
    pub collision: Vec<String>,
    /// Gaussians, SPZ or 3DGS PLY, link frame.
    pub splats: Option<String>,
    /// What it is; none if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub semantics: Option<SceneSemantics>,
    /// Colour of the part, sRGB in 0..=255.
    pub colour: [u8; 3],
}

/// A mesh in a link frame.
#[derive(Clone, Debug, Serialize)]
pub struct SceneMesh {
    /// OBJ; vertex colours where there is no texture.
    pub file: String,
    /// PNG, its first row at v = 1.
    pub texture: Option<String>,
    /// True if it is known to be closed, so that its inside is never visible.
    pub closed: bool,
}

/// What a link is.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneSemantics {
    /// Its class.
    pub class: PartClass,
    /// Confidence of the class, 0 to 1.
    pub confidence: f64,
    /// True if a person gave the class.
    pub given: bool,
}

impl SceneSemantics {
    /// As the export decided; none of earlier exports.
    pub(crate) fn of(link: &LinkReport) -> Option<Self> {
        let (class, confidence) = (link.class?, link.class_confidence?);
        Some(Self { class, confidence, given: link.class_given })
    }
}

/// A joint; its frame is that of its link at value 0.
#[derive(Clone, Debug, Serialize)]
pub struct SceneJoint {
    /// `revolute`, `prismatic` or `screw`.
    pub kind: JointKind,
    /// Unit axis, link frame.
    pub axis: [f64; 3],
    /// Metres along the axis per radian; 0 unless `kind` is `Screw`.
    pub pitch: f64,
    /// Lower and upper limit, radians or metres.
    pub limits: [f64; 2],
    /// Values in the observed states.
    #[serde(with = "artgs_core::state::array")]
    pub observed: PerState<f64>,
    /// Largest force (N) or torque (N m); 0 if unknown.
    pub effort: f64,
    /// Joint confidence, 0 to 1; none if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confidence: Option<f64>,
    /// Half width of the 95 % interval of the direction of the axis, degrees; none if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis_within: Option<f64>,
    /// Other joints that explain the part nearly as well.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<SceneAlternative>,
}

/// Another joint of a part.
#[derive(Clone, Debug, Serialize)]
pub struct SceneAlternative {
    /// `revolute`, `prismatic` or `screw`.
    pub kind: JointKind,
    /// The joint as corrections name it, capture's frame and unit.
    pub joint: MarkedJoint,
    /// How much worse it explains the part, as a share of the part's evidence.
    pub cost: f64,
    /// What it means for the part, one sentence.
    pub what: String,
    /// What further capture would decide, one sentence; may be empty.
    pub advice: String,
}

impl From<&Alternative> for SceneAlternative {
    fn from(found: &Alternative) -> Self {
        let Joint { kind, axis, origin, pitch, state_values, .. } = found.joint();
        let value = Some(state_values[State::END] - state_values[State::START]);
        let joint = MarkedJoint { axis: axis.to_array(), origin: origin.to_array(), value, pitch };
        Self { kind, joint, cost: found.cost, what: found.what.clone(), advice: found.advice.clone() }
    }
}

/// A camera of the capture.
#[derive(Clone, Debug, Serialize)]
pub struct SceneCamera {
    /// Name.
    pub name: String,
    /// 0 = start, 1 = end.
    pub state: usize,
    /// Camera to object, rows of a 3x4 matrix; OpenCV axes (x right, y down, z forward), metres.
    pub pose: [[f64; 4]; 3],
    /// `fx fy cx cy`, pixels.
    pub intrinsics: [f64; 4],
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Photo.
    pub photo: Option<String>,
    /// Rendering of the replica at this camera; without one the page draws the replica itself.
    pub rendering: Option<String>,
    /// Mask of the photo, white on the object.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mask: Option<String>,
}

/// Points of an observed state.
#[derive(Clone, Debug, Serialize)]
pub struct SceneCloud {
    /// 0 = start, 1 = end.
    pub state: usize,
    /// Number of points.
    pub count: usize,
    /// Little endian: `count` times x y z (f32, object's frame, metres), then `count` times r g b mark (u8; the mark is
    /// the index of the point's link; before parts are known, 1 for moved points).
    pub file: String,
}
