//! Views that contradict the other views of their state.

use super::agreement::{Agreement, agreement_of};
use super::percent;
use super::samples::{CoarseView, Posed, Reading};
use artgs_core::View;
use rayon::prelude::*;
use serde::Serialize;

/// Agreement of a view with the others below which it contradicts them. Right views of the project's captures reach 0.7.
const CONTRADICTS: f64 = 0.3;
/// Points of a view that the others must be able to show.
const LEAST_SHOWN: usize = 60;
/// Share of rough cells above which a depth image shows no surface.
const NOISE: f64 = 0.8;
/// Cells with depth around them that a view must have.
const LEAST_CELLS: usize = 100;
/// Share of the views above which it cannot be decided which ones are wrong.
const MOST: f64 = 1.0 / 3.0;

/// A view with a wrong pose or wrong depth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OddView {
    /// Name of the view.
    pub name: String,
    /// Share of its depth points that other views confirm, 0 to 1; none if its depth shows no surface.
    pub agreement: Option<f64>,
}

impl OddView {
    fn described(&self) -> String {
        match self.agreement {
            Some(share) => format!("{} ({})", self.name, percent(share)),
            None => format!("{} (noise)", self.name),
        }
    }
}

/// Views that contradict some of their state, in their order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct OddViews {
    /// The views.
    pub views: Vec<OddView>,
    /// Number of views of the state with depth.
    pub of: usize,
}

impl OddViews {
    /// Compares every view with the views `with`.
    pub(super) fn find<'v>(views: impl Iterator<Item = &'v View>, with: &[CoarseView]) -> Self {
        let all: Vec<&View> = views.filter(|v| v.depth.is_some()).collect();
        let others: Vec<Posed<'_>> = with.iter().map(|v| Posed::new(v, Reading::STATED)).collect();
        let odd = |view: &&View| {
            let coarse = CoarseView::new(view);
            let own = Posed::new(&coarse, Reading::STATED);
            let name = || view.name.clone();
            if coarse.inner >= LEAST_CELLS && coarse.rough as f64 > NOISE * coarse.inner as f64 {
                return Some(OddView { name: name(), agreement: None });
            }
            let there = |p: &&Posed<'_>| p.to_camera != own.to_camera;
            let counts: Agreement = agreement_of(&own, others.iter().filter(there));
            let contradicts = counts.shown() >= LEAST_SHOWN && counts.share() < CONTRADICTS;
            contradicts.then(|| OddView { name: name(), agreement: Some(counts.share()) })
        };
        Self { of: all.len(), views: all.par_iter().filter_map(odd).collect() }
    }

    /// True if so many views contradict others that it cannot be decided which ones are right.
    pub fn are_too_many(&self) -> bool {
        self.views.len() as f64 > MOST * self.of as f64
    }

    /// True if most depth images show no surface.
    pub(super) fn are_noise(&self) -> bool {
        self.views.iter().filter(|v| v.agreement.is_none()).count() * 2 > self.of
    }

    /// Number and first names of the views.
    pub(super) fn described(&self) -> String {
        /// Names that are listed.
        const LISTED: usize = 4;
        let names: Vec<String> = self.views.iter().take(LISTED).map(OddView::described).collect();
        let more = if self.views.len() > LISTED { ", ..." } else { "" };
        format!("{} of {} images: {}{more}", self.views.len(), self.of, names.join(", "))
    }
}
