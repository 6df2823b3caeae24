//! Settings of part discovery. Those a user may want to change are in [`DiscoverConfig`]; the others are grouped by the
//! step that reads them, each group in the module of that step.

use super::bodies::BodySettings;
use super::candidates::CandidateSettings;
use super::confidence::ConfidenceSettings;
use super::diagnosis::DiagnosisSettings;
use super::facets::FacetSettings;
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
    /// Largest share of the surfaces that the found parts may leave unexplained, 0 to 1: with more, the states show different objects. It
    /// is the share of the surfels of a state that cost more than a nat, of both states the larger one. Of 23 exact captures at most 0.18, of 40
    /// rooms 0.28 and two more (0.36 a folding chair, 0.48 a cabinet of which two of seven doors were found); of 14 pairs of
    /// different objects with exact depth 0.34 and more, of 10 in rooms 0.55 and more. Of others, two wardrobes had 0.14.
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
            most_unexplained: 0.31,
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
    pub(crate) facets: FacetSettings,
    pub(crate) bodies: BodySettings,
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
