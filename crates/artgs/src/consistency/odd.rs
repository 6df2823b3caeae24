//! Views that contradict the other views of their state.

use super::agreement::{Agreement, agreement_of};
use super::percent;
use super::samples::{CoarseView, Posed, Reading};
use artgs_core::View;
use rayon::prelude::*;
use serde::Serialize;

/// Agreement of a view with the others below which it contradicts them. Right views of the project's captures reach 0.7.
const CONTRADICTS: f64 = 0.3;
/// The same as a share of the median of the views. Poses that jump by 0.3 m in a room leave half of a view in agreement.
const OF_MEDIAN: f64 = 0.6;
/// Most comparisons.
const ROUNDS: usize = 4;
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
    /// Compares every view with the views `with`. Wrong views lower the agreement of right ones, so that the comparison is
    /// repeated without those that were found.
    pub(super) fn find<'v>(views: impl Iterator<Item = &'v View>, with: &[CoarseView]) -> Self {
        let all: Vec<&View> = views.filter(|v| v.depth.is_some()).collect();
        let coarse: Vec<CoarseView> = all.par_iter().map(|v| CoarseView::new(v)).collect();
        let own: Vec<Posed<'_>> = coarse.iter().map(|v| Posed::new(v, Reading::STATED)).collect();
        let mut others: Vec<Posed<'_>> = with.iter().map(|v| Posed::new(v, Reading::STATED)).collect();
        let is_noise = |v: &CoarseView| v.inner >= LEAST_CELLS && v.rough as f64 > NOISE * v.inner as f64;
        let mut found: Vec<Option<OddView>> = all
            .iter()
            .zip(&coarse)
            .map(|(view, v)| is_noise(v).then(|| OddView { name: view.name.clone(), agreement: None }))
            .collect();
        for _ in 0..ROUNDS {
            let shares: Vec<Option<f64>> = own.par_iter().map(|view| agreement_with(view, &others)).collect();
            let open = || shares.iter().zip(&found).filter(|(_, f)| f.is_none()).filter_map(|(share, _)| *share);
            let mut right: Vec<f64> = open().collect();
            let least = crate::trimmed::median(&mut right).map_or(CONTRADICTS, |m| CONTRADICTS.max(OF_MEDIAN * m));
            let before = found.iter().flatten().count();
            for ((found, share), view) in found.iter_mut().zip(&shares).zip(&all) {
                let share = share.filter(|s| found.is_none() && *s < least);
                *found = found.take().or(share.map(|s| OddView { name: view.name.clone(), agreement: Some(s) }));
            }
            if found.iter().flatten().count() == before {
                break;
            }
            let is_odd = |p: &Posed<'_>| found.iter().zip(&own).any(|(f, o)| f.is_some() && o.to_camera == p.to_camera);
            others.retain(|p| !is_odd(p));
        }
        Self { of: all.len(), views: found.into_iter().flatten().collect() }
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

/// Share of the points of a view that others confirm; none if they show too few of them.
fn agreement_with(view: &Posed<'_>, others: &[Posed<'_>]) -> Option<f64> {
    let there = |p: &&Posed<'_>| p.to_camera != view.to_camera;
    let counts: Agreement = agreement_of(view, others.iter().filter(there));
    (counts.shown() >= LEAST_SHOWN).then(|| counts.share())
}
