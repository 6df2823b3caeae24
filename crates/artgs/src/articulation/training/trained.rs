//! What the joint optimisation gives, and how to look at it.

use crate::articulation::{DualQuaternion, MotionParameters, Skin, Warp, WarpInput};
use crate::fit::deform::{half_motions, sh_frames};
use crate::fit::{ViewScore, score_splats};
use artgs_core::{Camera, Rigid, Splats, State, View};
use artgs_raster::{Colors, Frame, Rasterizer, RenderOptions, ShFrames, SplatView};

/// Canonical Gaussians, the parts they belong to and how these move.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// Gaussians midway between the states.
    pub splats: Splats,
    /// Part of each, `[n]`, below K.
    pub labels: Vec<u16>,
    /// Half motions of the movable parts, `[K - 1]`: part `k` has entry `k - 1`.
    pub joints: Vec<MotionParameters>,
}

/// A trained object at one state.
#[derive(Clone, Debug, PartialEq)]
pub struct Posed<'a> {
    /// Gaussians with moved centres and rotations; harmonics are those of the canonical directions.
    pub splats: Splats,
    /// Part of each, `[n]`.
    pub labels: &'a [u16],
    /// Rotations taking world directions to the canonical ones of each part, `[K]`, row-major.
    pub world_to_part: Vec<[[f32; 3]; 3]>,
}

impl Posed<'_> {
    /// For drawing, with the colours turned with the parts or fixed to the world.
    pub fn view(&self, rotate_sh: bool) -> SplatView<'_> {
        let frames = rotate_sh.then_some(ShFrames { index: self.labels, world_to_frame: &self.world_to_part });
        let colors = Colors::Sh { sh: &self.splats.sh, degree: self.splats.sh_degree, frames };
        SplatView { colors, ..SplatView::from(&self.splats) }
    }

    /// Draws over black with all harmonics.
    pub fn render<'r>(&self, rasterizer: &'r mut Rasterizer, camera: &Camera, rotate_sh: bool) -> &'r Frame {
        let options = RenderOptions { sh_degree: self.splats.sh_degree, ..RenderOptions::default() };
        rasterizer.forward(self.view(rotate_sh), camera, &options)
    }

    /// Draws over black with one colour per Gaussian, `[n]`.
    pub fn render_fixed<'r>(&self, rasterizer: &'r mut Rasterizer, camera: &Camera, colors: &[[f32; 3]]) -> &'r Frame {
        let view = SplatView { colors: Colors::Fixed(colors), ..SplatView::from(&self.splats) };
        rasterizer.forward(view, camera, &RenderOptions::default())
    }
}

impl Trained {
    /// Indices of the Gaussians of a part, ascending.
    pub fn members(&self, part: usize) -> impl Iterator<Item = usize> {
        self.labels.iter().enumerate().filter(move |(_, label)| usize::from(**label) == part).map(|(i, _)| i)
    }

    fn dual_quaternions(&self) -> Vec<DualQuaternion> {
        let mut motions = Vec::new();
        half_motions(&self.joints, &mut motions);
        motions
    }

    /// Gaussians with centres and rotations moved to a state; everything else as it is.
    pub fn at_state(&self, state: State) -> Splats {
        let (motions, mut moved) = (self.dual_quaternions(), self.splats.clone());
        let skin = Skin::Labels(&self.labels);
        let (means, rotations) = (&self.splats.means, &self.splats.rotations);
        let input = WarpInput { means, rotations, skin, motions: &motions, state };
        Warp::new(true).forward(&input, &mut moved.means, &mut moved.rotations);
        moved
    }

    /// The object at a state, ready to be drawn.
    pub fn posed(&self, state: State) -> Posed<'_> {
        let mut world_to_part = Vec::new();
        sh_frames(&self.dual_quaternions(), state, &mut world_to_part);
        Posed { splats: self.at_state(state), labels: &self.labels, world_to_part }
    }

    /// Motions from the canonical state to the end, `[K]`; that of the static part is the identity.
    pub fn half_motions(&self) -> Vec<Rigid> {
        std::iter::once(Rigid::IDENTITY).chain(self.joints.iter().map(MotionParameters::half_motion)).collect()
    }
}

/// Draws a trained object at a state over black. To draw many views of one state use [`Trained::posed`].
pub fn render_state<'r>(
    rasterizer: &'r mut Rasterizer,
    trained: &Trained,
    camera: &Camera,
    state: State,
    rotate_sh: bool,
) -> &'r Frame {
    trained.posed(state).render(rasterizer, camera, rotate_sh)
}

/// Like [`render_state`] with a colour per part, `[K]`, in place of harmonics. Parts without a colour are black.
pub fn render_state_fixed<'r>(
    rasterizer: &'r mut Rasterizer,
    trained: &Trained,
    camera: &Camera,
    state: State,
    palette: &[[f32; 3]],
) -> &'r Frame {
    let color = |label: &u16| palette.get(usize::from(*label)).copied().unwrap_or_default();
    let colors: Vec<[f32; 3]> = trained.labels.iter().map(color).collect();
    trained.posed(state).render_fixed(rasterizer, camera, &colors)
}

/// Scores every view of a state at full size, over black.
pub fn score_state<'v>(
    trained: &Trained,
    views: impl IntoIterator<Item = &'v View>,
    state: State,
    rotate_sh: bool,
) -> Vec<ViewScore> {
    score_splats(trained.posed(state).view(rotate_sh), trained.splats.sh_degree, views)
}
