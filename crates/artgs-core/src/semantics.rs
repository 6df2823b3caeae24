//! What the links of an asset are: classes such as door and drawer, and where a gripper holds them.

use crate::Rigid;
use serde::{Deserialize, Serialize};

/// What a part is, from its joint, its shape and its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PartClass {
    /// The static part.
    Body,
    /// Slides out of the part that carries it.
    Drawer,
    /// An upright panel with an upright hinge.
    Door,
    /// A panel that slides within its plane, in front of the part that carries it.
    SlidingDoor,
    /// An upright panel with a horizontal hinge, such as the door of an oven.
    Flap,
    /// A lying panel with a horizontal hinge over the part that carries it; also the screen of a laptop.
    Lid,
    /// A lying panel with a horizontal hinge and nothing below, below a part that rises above it.
    Seat,
    /// A small part that turns about its own middle.
    Knob,
    /// A round part that turns about its own middle.
    Wheel,
    /// A part on a screw.
    Cap,
    /// A small part with a short slide.
    Button,
    /// A long part that slides along its length, or a part that slides up and down.
    Slider,
    /// A long part that turns about an axis across its length.
    Arm,
    /// None of the others.
    Part,
}

impl PartClass {
    /// Every class.
    pub const ALL: [Self; 14] = [
        Self::Body,
        Self::Drawer,
        Self::Door,
        Self::SlidingDoor,
        Self::Flap,
        Self::Lid,
        Self::Seat,
        Self::Knob,
        Self::Wheel,
        Self::Cap,
        Self::Button,
        Self::Slider,
        Self::Arm,
        Self::Part,
    ];

    /// Its name in files and messages: lower case letters and `_`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Body => "body",
            Self::Drawer => "drawer",
            Self::Door => "door",
            Self::SlidingDoor => "sliding_door",
            Self::Flap => "flap",
            Self::Lid => "lid",
            Self::Seat => "seat",
            Self::Knob => "knob",
            Self::Wheel => "wheel",
            Self::Cap => "cap",
            Self::Button => "button",
            Self::Slider => "slider",
            Self::Arm => "arm",
            Self::Part => "part",
        }
    }
}

/// The edge of a panel at which its hinge is, seen from the side to which the panel opens.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum HingeSide {
    /// At the left edge.
    Left,
    /// At the right edge.
    Right,
    /// At the lower edge.
    Bottom,
    /// At the upper edge.
    Top,
}

impl HingeSide {
    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Bottom => "bottom",
            Self::Top => "top",
        }
    }
}

/// The class of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartSemantics {
    /// What it is.
    pub class: PartClass,
    /// Edge of the hinge; only of doors and flaps.
    pub hinge: Option<HingeSide>,
    /// 0.5 where a measure is at the limit of another class, 1 where all are far from it or where a person gave the class.
    pub confidence: f64,
    /// True if a person gave the class.
    pub given: bool,
}

/// Where a gripper with two fingers holds a link.
#[derive(Clone, Debug, PartialEq)]
pub struct Handle {
    /// Unique name, of the same form as those of links.
    pub name: String,
    /// Grasp frame in the link frame, metres: its Z axis is the direction in which the gripper approaches the object, the
    /// fingers close along its Y axis.
    pub frame: Rigid,
    /// Opening of the gripper that the handle needs, metres: its extent along Y.
    pub width: f64,
    /// Extent of the handle along X, metres.
    pub length: f64,
    /// How far the handle stands out from the surface about it, metres.
    pub depth: f64,
}
