//! Which colours textures have.

use std::num::NonZero;

/// Settings of baking. Colours are sRGB in [0, 255].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BakeSettings {
    /// Step of depth between pixels that counts as an edge between two surfaces, voxels. Raising it trusts pixels beside small steps.
    pub jump: f64,
    /// Largest difference between a view's depth and a visible point, voxels. Raising it takes colours of surfaces in front of others.
    pub tolerance: f64,
    /// Exponent of the cosine between normal and ray in the weight of a view. Raising it takes colours of fewer views.
    pub sharpness: f64,
    /// Difference in colour at which a sample has a quarter of its weight. Raising it mixes highlights in.
    pub outlier: f64,
    /// Rounds of reweighting.
    pub rounds: usize,
    /// Least cosine between the normal and the direction to the camera.
    pub facing: f64,
    /// Distance from the nearest edge at which pixels have full weight, pixels. Raising it takes less from beside edges.
    pub full_trust: u8,
    /// Weights of pixels 1 and 2 pixels from an edge, where pixels mix two surfaces.
    pub edge_trust: [f32; 2],
    /// Least alpha of a pixel that shows only the object.
    pub opaque: u8,
    /// How are photos equalised?
    pub gains: GainSettings,
    /// Which colours do texels have that no view sees?
    pub fill: FillSettings,
}

impl BakeSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        jump: 4.0,
        tolerance: 2.5,
        sharpness: 8.0,
        outlier: 40.0,
        rounds: 3,
        facing: 0.1,
        full_trust: 8,
        edge_trust: [1e-4, 1e-3],
        opaque: 250,
        gains: GainSettings::DEFAULT,
        fill: FillSettings::DEFAULT,
    };
}

impl Default for BakeSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of equalising photos. Differences are logarithms of colours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GainSettings {
    /// Largest shading: surfaces with the same normal can lie in the shadow, or shine less.
    pub most: f64,
    /// Shading at which the weight of a pixel has halved: what is changed much is less certain.
    pub half: f64,
    /// Mean difference that can be seen as a seam. Raising it leaves more photos as they are.
    pub visible: f64,
    /// Share of the differences that gains may leave. On five captures of equal exposure, exposures leave 0.72 to 1.03; on a copy of one whose
    /// photos vary by 30 % 0.08, but 0.64 where a lamp moves with the camera as well. Shadings leave 0.7 to 0.99 of parts in light
    /// that stays, 0.12 to 0.5 of parts that turned towards it, and 0.13 to 0.31 under a lamp at the camera. Raising it changes more photos.
    pub explained: f64,
    /// Larger differences, as those of highlights and shadows, count like this one.
    pub outlier: f64,
    /// Least distance to edges of pixels that are compared, pixels.
    pub clear: u8,
    /// Mean of the channels above which a colour is compared: in dark ones noise and offsets count.
    pub dark: f32,
    /// Largest channel below which a colour is compared: others are saturated.
    pub bright: f32,
    /// Least value of a channel in all colours by which its balance is decided.
    pub dark_channel: f32,
    /// Rounds of reweighting.
    pub rounds: usize,
    /// Residual at which the weight of a colour has halved: shadows and highlights differ by more, light that
    /// falls on a surface at another angle differs by less in most photos.
    pub scale: f64,
    /// Weight of a gain of 1, relative to the mean weight of a view. Views that share few points with others keep their
    /// colours. Raising it changes photos less.
    pub prior: f64,
    /// Factor of that weight for slopes by the normal: they hold for normals that a view does not show, too, and have to be small there.
    pub slope_prior: f64,
}

impl GainSettings {
    /// The settings that are used.
    pub const DEFAULT: Self = Self {
        most: 0.35,
        half: 0.35,
        visible: 0.01,
        explained: 0.6,
        outlier: 0.3,
        clear: 3,
        dark: 16.0,
        bright: 250.0,
        dark_channel: 24.0,
        rounds: 6,
        scale: 0.1,
        prior: 3e-3,
        slope_prior: 10.0,
    };
}

impl Default for GainSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Settings of the colours of texels that no view sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FillSettings {
    /// Known texels that are mixed for an unknown one, on each side that it faces. Raising it blurs.
    pub neighbours: NonZero<usize>,
    /// Distance, as a share of the extent of the part, that is added to that of surfaces which face another way: a texel takes
    /// colours of its own side of a panel from farther away than those of the other side.
    pub turn: f64,
    /// Distance, as a share of the extent of the part, at which the colour of the whole part counts as much as the neighbours. Raising it
    /// spreads colours farther.
    pub far: f64,
    /// Known texels are sources where both coordinates are multiples of this, and at rims.
    pub grid: usize,
    /// Least cosine between the normal of a source and an axis along which it faces; every normal has a cosine of 0.57 or more with one.
    pub facing: f64,
}

impl FillSettings {
    /// The settings that are used.
    pub const DEFAULT: Self =
        Self { neighbours: NonZero::new(12).expect("12 is not 0"), turn: 0.02, far: 0.25, grid: 4, facing: 0.4 };
}

impl Default for FillSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
