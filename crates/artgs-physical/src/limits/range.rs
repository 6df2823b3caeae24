//! Limits of joints, and what they rest on.

use super::search::{Found, Search};
use super::sweep::{Precision, Surface};
use crate::settings::PhysicalConfig;
use artgs_core::{Asset, PerState, State};

/// Reason of a joint limit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Stop {
    /// The observed value: not extended.
    Observed,
    /// Contact with this link.
    Contact(String),
    /// The front of a slide is in one plane with the front of this link, or a panel lies on its face.
    Flush(String),
    /// A slide would lose its support.
    Support,
    /// The largest allowed extension.
    Reach,
}

/// What a joint limit rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Source {
    /// An observed state.
    Observed,
    /// A contact of surfaces that were observed, with the part closed in an observed state or opening.
    Contact,
    /// A contact that closes a part which no state shows closed, a front in one plane with those around it, or the visible length
    /// of a part that slides.
    Inferred,
    /// A default.
    Assumed,
}

impl Source {
    /// Name in `export.json`.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Observed => "observed",
            Self::Contact => "contact",
            Self::Inferred => "inferred",
            Self::Assumed => "assumed",
        }
    }
}

/// Limits of one joint.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Range {
    /// Lower and upper limit while the other joints are at 0.
    pub limits: [f64; 2],
    /// Reasons of both.
    pub stops: [Stop; 2],
    /// What both rest on.
    pub sources: [Source; 2],
    /// Where the joint meets nothing that was seen while the other joints are in a state: within the limits, around the value in that state.
    pub free: PerState<[f64; 2]>,
    /// True if the part touches another one at joint value 0, in the direction in which it closes, or if its front is in one plane
    /// with those around it: it was observed closed.
    pub closed: bool,
}

/// Limits of every joint. Entry `i` belongs to link `i`; the base has none. `surfaces` in link frames, metres. `nearer[i]` is the
/// state in which link `i` is nearer to being closed, if known; its joint is at 0 there and opens in positive direction.
///
/// Parts close until the first contact, at most until they are flush with what is around them, and not far beyond what was seen if nothing
/// says that they are flush there. They open until a contact, until a slide loses its support, or by a default.
pub(crate) fn extend(
    asset: &Asset,
    surfaces: &[Surface],
    nearer: &[Option<State>],
    diagonal: f64,
    config: &PhysicalConfig,
) -> Vec<Option<Range>> {
    let (settings, extends) = (&config.settings.limits, config.extend_limits);
    let spacing = settings.sample_share * diagonal;
    let width = settings.contact_width_share * diagonal;
    let precision = Precision {
        points: (width * width / (spacing * spacing)).ceil() as usize,
        width: settings.contact_rim_share * diagonal,
        carrier_width: settings.contact_rim_share * diagonal,
        overlap: settings.overlap_share * diagonal,
        settings: settings.sweep,
    };
    let near = settings.closed_share * diagonal;
    let search = |link: usize| Search { asset, surfaces, link, precision, settings, extends, near, spacing };
    let mut ranges: Vec<Option<Range>> =
        (0..asset.links.len()).map(|link| search(link).range(nearer[link].is_some())).collect();
    if extends {
        let flush: Vec<Option<Flush>> =
            (0..asset.links.len()).map(|link| nearer[link].and_then(|_| search(link).flush(&ranges))).collect();
        for (link, flush) in flush.into_iter().enumerate().filter(|(link, _)| nearer[*link].is_some()) {
            if let Some((range, end)) = ranges[link].as_mut().zip(search(link).closing_end()) {
                let search = search(link);
                let closing = if end == 0 { -1.0 } else { 1.0 };
                let narrow = search.first_closing(closing, &search.with_narrow());
                range.close(end, flush, narrow, [search.most_unseen(), precision.overlap / search.reach()]);
            }
        }
    }
    for (link, range) in ranges.iter_mut().enumerate() {
        let Some(range) = range.as_mut().filter(|_| extends) else { continue };
        // Engines refuse a range of nothing.
        range.limits[1] = range.limits[1].max(range.limits[0] + settings.narrowest);
        for state in State::ALL {
            range.free[state] = search(link).free(state, range.limits);
        }
    }
    ranges
}

pub(super) fn ordered(values: PerState<f64>) -> [f64; 2] {
    let (start, end) = (values[State::START], values[State::END]);
    [start.min(end), start.max(end)]
}

/// A joint value, beyond 0 in the direction in which a part closes, at which it is flush with others.
pub(super) struct Flush {
    pub(super) value: f64,
    pub(super) link: String,
    /// A contact within this way behind it is a better measure.
    pub(super) precision: f64,
    /// The part was observed there.
    pub(super) closed: bool,
}

impl Range {
    /// Ends the range that closes where the part is flush, if no contact comes before that. Of a part that is flush nowhere, a limit more than `most` beyond
    /// what was observed is one of a surface that was not seen well, and the part closes no further than it was seen. The first contact, `narrow`, may
    /// be two rims that overlap, but not if the part would move by more than `most` behind it; one that comes at most `alike` before a wide
    /// contact or a flush place is the beginning of it.
    pub(super) fn close(&mut self, end: usize, flush: Option<Flush>, narrow: Option<Found>, [most, alike]: [f64; 2]) {
        self.close_behind_rims(end, flush, most);
        let way = self.limits[end].abs();
        let rests_on_nothing = self.stops[end] == Stop::Observed;
        let Some(narrow) = narrow else { return };
        let is_same = (0.0..=alike).contains(&(way - narrow.way));
        if narrow.way + most >= way && !is_same && !(rests_on_nothing && narrow.way <= most) {
            return;
        }
        let sign = if end == 0 { -1.0 } else { 1.0 };
        self.closed |= narrow.source == Source::Contact;
        self.limits[end] = sign * narrow.way;
        (self.stops[end], self.sources[end]) = (narrow.stop, narrow.source);
    }

    /// The same with wide contacts only.
    fn close_behind_rims(&mut self, end: usize, flush: Option<Flush>, most: f64) {
        let way = self.limits[end].abs();
        match flush {
            Some(flush) if flush.value.abs() + flush.precision < way || self.sources[end] == Source::Assumed => {
                self.limits[end] = flush.value;
                self.stops[end] = Stop::Flush(flush.link);
                self.sources[end] = Source::Inferred;
                self.closed |= flush.closed;
            }
            Some(_) => {}
            None if way > most || self.sources[end] == Source::Assumed => {
                self.limits[end] = 0.0;
                (self.stops[end], self.sources[end]) = (Stop::Observed, Source::Observed);
            }
            None => {}
        }
    }
}
