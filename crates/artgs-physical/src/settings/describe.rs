//! What links are: their classes, the front of the object, handles.

/// Settings of what is described. Fields ending in `_share` are shares of the object's diagonal; angles are given by their cosines unless stated
/// otherwise. The limits between classes separate what these mean, and were set on the ground truth of the procedural objects
/// (`artgs synth --list`), not on reconstructions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescribeSettings {
    /// In which state is a part nearer to being closed?
    pub closed: ClosedSettings,
    /// Distance of the points of surfaces. Raising it is faster and less exact.
    pub spacing_share: f64,
    /// Distance of the points by which parts are ordered for their names.
    pub order_share: f64,
    /// Share of a surface beyond each end of an extent: reconstructed surfaces have a few loose triangles. Raising it makes parts smaller.
    pub beyond: f64,
    /// Cosine of the angle to the vertical above which an axis or a normal is upright.
    pub upright: f64,
    /// Least cosine between the motion of a part and the normals of the faces that look where it opens.
    pub facing: f64,
    /// What is a part?
    pub classes: ClassSettings,
    /// Where is the front of the object?
    pub front: FrontSettings,
    /// Where are handles?
    pub handles: HandleSettings,
}

impl DescribeSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        closed: ClosedSettings::DEFAULT,
        spacing_share: 0.01,
        order_share: 0.02,
        beyond: 0.01,
        upright: 0.7,
        facing: super::FACING,
        classes: ClassSettings::DEFAULT,
        front: FrontSettings::DEFAULT,
        handles: HandleSettings::DEFAULT,
    };
}

impl Default for DescribeSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the state in which a part is nearer to being closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClosedSettings {
    /// Least difference between the states of how far a part protrudes, ... Raising it leaves more parts without a closed state.
    pub significant_share: f64,
    /// ... or as a share of the mean motion of the part, whichever is smaller.
    pub of_motion: f64,
    /// Vertices of a mesh that are compared, about. Raising it is slower.
    pub points: usize,
}

impl ClosedSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self { significant_share: 0.01, of_motion: 0.15, points: 4000 };
}

impl Default for ClosedSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the limits between classes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClassSettings {
    /// A panel is thinner than this share of its smaller side. Raising it makes more parts doors, lids and flaps.
    pub panel: f64,
    /// A long part is longer than this multiple of its next extent. Raising it makes fewer parts arms and sliders.
    pub long: f64,
    /// A part whose middle is nearer to the axis than this share of its radius turns about its middle. Raising it makes more parts knobs.
    pub centred: f64,
    /// Least ratio of the extents across the axis of a round part. Raising it makes fewer parts knobs and wheels.
    pub round: f64,
    /// Largest radius of a knob, and largest extent of a button. Raising it makes more parts knobs and buttons.
    pub small_share: f64,
    /// Largest travel of a button, as a share of `small_share`. Raising it makes more parts buttons.
    pub pressed: f64,
    /// Share of its travel that a drawer sticks out of the part that carries it at least. Raising it makes more parts sliding doors.
    pub sticks_out: f64,
    /// A lid or a flap has a surface of the part that carries it behind more than this share of it, in one state. Raising it makes more parts
    /// seats.
    pub covered: f64,
    /// How far the carrier rises above the hinge of a seat and goes below it, as a share of its depth. Raising it makes fewer parts seats.
    pub backrest: f64,
    /// Difference of a cosine from a limit that is far from it.
    pub far: f64,
    /// Confidence in a class at a limit; 1 far from all limits.
    pub least_confidence: f64,
    /// Factor of the confidence without a closed state, where the side to which a part opens is a guess.
    pub guess: f64,
}

impl ClassSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        panel: 0.5,
        long: 2.5,
        centred: 0.3,
        round: 0.6,
        small_share: 0.08,
        pressed: 0.5,
        sticks_out: 0.5,
        covered: 0.6,
        backrest: 0.5,
        far: 0.3,
        least_confidence: 0.5,
        guess: 0.8,
    };
}

impl Default for ClassSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the front of the object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrontSettings {
    /// Least horizontal length of the unit direction for which a part votes. Raising it ignores parts that open upwards.
    pub horizontal: f64,
    /// Cosine of the angle up to which votes are for the same side.
    pub same: f64,
    /// What lying panels count against upright ones: a chest has its hinge at the back, but so may have a lid inside.
    pub lying: f64,
    /// Largest vertical length of the unit normals of walls; tilted objects have such walls, too.
    pub wall: f64,
    /// Walls may be turned from the votes by this angle, radians; beyond 45 degrees it would be another side.
    pub turned: f64,
    /// Angles that are tried on each side of the votes.
    pub steps: i32,
    /// Half the width of the peak of angles of walls, radians. Raising it makes the direction less exact.
    pub peak: f64,
    /// Share of all upright faces that the peak holds at least. Raising it follows the votes more often.
    pub held: f64,
}

impl FrontSettings {
    /// The settings that are used.
    pub const DEFAULT: Self =
        Self { horizontal: 0.3, same: 0.8, lying: 0.3, wall: 0.3, turned: 0.6, steps: 24, peak: 0.05, held: 0.3 };
}

impl Default for FrontSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of handles: what stands out from the front of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleSettings {
    /// A handle stands out by this at least. Raising it finds fewer handles and less noise.
    pub depth_share: f64,
    /// Extents of a handle are this at least.
    pub size_share: f64,
    /// Handles cover less than this share of the front: what covers more is a frame or a second face.
    pub most_area: f64,
    /// Handles of a part at most.
    pub most: usize,
    /// A handle that is longer than this multiple of its height is held from above and below, others from the sides.
    pub lying: f64,
    /// Share of the depth of a handle that is between the fingers.
    pub held: f64,
    /// Distance of the points of the front, as a share of the least extent of a handle.
    pub spacing: f64,
    /// Edge of a cell of the height field, as a share of the least extent of a handle, ...
    pub cell: f64,
    /// ... and cells along the larger side of a front at most.
    pub cells: usize,
    /// Depth within which cells are in the face of a part, as a share of the least depth of a handle.
    pub face: f64,
}

impl HandleSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        depth_share: 0.008,
        size_share: 0.01,
        most_area: 0.3,
        most: 4,
        lying: 1.5,
        held: 0.5,
        spacing: 0.3,
        cell: 0.4,
        cells: 160,
        face: 0.5,
    };
}

impl Default for HandleSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
