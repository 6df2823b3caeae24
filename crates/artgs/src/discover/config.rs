//! Settings of part discovery. Those a user may want to change are in [`DiscoverConfig`]; the others are grouped by the
//! step that reads them, each group in the module of that step.

use super::candidates::CandidateSettings;
use super::confidence::ConfidenceSettings;
use super::diagnosis::DiagnosisSettings;
use super::front::FrontSettings;
use super::instances::InstanceSettings;
use super::joints::JointSettings;
use super::parents::ParentSettings;
use super::rails::RailSettings;
use super::ranking::RankingSettings;
use super::segmentation::{GraphSettings, LabelCosts, SegmentationSettings};
use super::selection::SelectionSettings;
use super::support::SupportSettings;
use serde::{Deserialize, Serialize};

/// Settings of part discovery. Lengths are fractions of the object's diagonal unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiscoverConfig {
    /// Distance between the surface points that are labelled; never below one pixel.
    pub spacing: f64,
    /// Edge of a cell of the grid that candidate motions are scored with.
    pub voxel: f64,
    /// A motion must explain at least this fraction of all moved points.
    pub least_share: f64,
    /// Rounds of labelling and registering.
    pub rounds: usize,
    /// Motions that turn less than this are slides, degrees, unless a hinge fits clearly better.
    pub revolute_deg: f64,
    /// Decide between hinge, slide and screw, find which part carries which, and register parts on their joints. Otherwise,
    /// an ablation, they keep general rigid motions, and those that turn by more than `revolute_deg` are called revolute in
    /// the end.
    pub decide_joints: bool,
    /// Largest share of the surfaces that may contradict the found parts, 0 to 1: with more, the states show different objects. It is
    /// the share of all points that moved for certain without a motion that explains them, or, if that is larger and depth noise does
    /// not spread points, the share of the points of a state that the motions take to empty space of the other state, of those that they
    /// take to where it shows something. Of ten right captures 0.1 to 1.1 %, of four pairs of states of one object that was rendered in two
    /// ways at most 1.3 %, of 38 pairs of different objects 16 % and more.
    /// Where depth noise spreads points, of 36 right captures at most 3.3 %; of three pairs of different objects in rooms that were
    /// aligned, 11 to 29 %.
    pub most_unexplained: f64,
    /// Share of the points that must rest, of the state where it is larger, 0 to 1: with less, the object was moved as a whole. Of a
    /// refrigerator whose end state was turned as a whole 0.6 %, of right captures at least 40 %.
    pub least_resting: f64,
    /// Quality, the share of what moved that joints explain weighted by their confidence, from which more may be unexplained. Of thin
    /// parts that show different sides in the two states (folding chairs in six rooms, 14 to 39 % unexplained) right joints had 0.45 to
    /// 0.63; of 63 pairs of different objects one had 0.57, the others at most 0.50.
    pub sure_quality: f64,
}

impl Default for DiscoverConfig {
    fn default() -> Self {
        Self {
            spacing: 1.0 / 160.0,
            voxel: 1.0 / 110.0,
            least_share: 0.004,
            rounds: 3,
            revolute_deg: 3.0,
            decide_joints: true,
            most_unexplained: 0.1,
            least_resting: 0.05,
            sure_quality: 0.55,
        }
    }
}

impl DiscoverConfig {
    /// The same, but no states are refused because what was found explains too little of them.
    pub fn without_refusals(self) -> Self {
        Self { most_unexplained: 1.0, least_resting: 0.0, ..self }
    }
}

/// Settings that are not in the configuration file.
#[derive(Clone, Debug, Default)]
pub(crate) struct StepSettings {
    pub(crate) front: FrontSettings,
    pub(crate) candidates: CandidateSettings,
    pub(crate) ranking: RankingSettings,
    pub(crate) selection: SelectionSettings,
    pub(crate) segmentation: SegmentationSettings,
    pub(crate) graph: GraphSettings,
    pub(crate) label_costs: LabelCosts,
    pub(crate) joints: JointSettings,
    pub(crate) rails: RailSettings,
    pub(crate) instances: InstanceSettings,
    pub(crate) support: SupportSettings,
    pub(crate) confidence: ConfidenceSettings,
    pub(crate) parents: ParentSettings,
    pub(crate) diagnosis: DiagnosisSettings,
}
