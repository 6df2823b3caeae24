//! The search for the limits of one joint.

use super::flush;
use super::range::{Flush, Range, Source, Stop, ordered};
use super::sweep::{Contact, Part, Precision, Surface, Sweep, first_contact, first_crossing, reach};
use crate::settings::LimitSettings;
use artgs_core::{Asset, JointKind, PerState, State};
use glam::DVec3;

/// How far a joint goes beyond an observed value.
pub(super) struct Found {
    pub(super) way: f64,
    pub(super) stop: Stop,
    pub(super) source: Source,
}

/// The search for the limits of one joint.
pub(super) struct Search<'a> {
    pub(super) asset: &'a Asset,
    pub(super) surfaces: &'a [Surface],
    pub(super) link: usize,
    pub(super) precision: Precision,
    pub(super) settings: &'a LimitSettings,
    /// True if limits go beyond the observed values.
    pub(super) extends: bool,
    /// A part that meets another one within this way, metres, was observed closed.
    pub(super) near: f64,
    /// Distance of the points of the surfaces.
    pub(super) spacing: f64,
}

impl Search<'_> {
    /// The limits by this part's contacts; `free` is not known yet.
    pub(super) fn range(&self, knows_direction: bool) -> Option<Range> {
        let observed = ordered(self.asset.links[self.link].joint?.observed);
        let mut out = Range {
            limits: observed,
            stops: [Stop::Observed, Stop::Observed],
            sources: [Source::Observed; 2],
            free: PerState::new(observed, observed),
            closed: false,
        };
        if !self.extends {
            return Some(out);
        }
        for (end, sign) in [(0, -1.0), (1, 1.0)] {
            let closes = knows_direction && observed[end] == 0.0;
            let found = if closes { self.closing(sign) } else { self.opening(observed[end], sign, knows_direction) };
            out.limits[end] = observed[end] + sign * found.way;
            (out.stops[end], out.sources[end]) = (found.stop, found.source);
            out.closed |= closes && out.sources[end] == Source::Contact;
        }
        Some(out)
    }

    /// The end of the range at which the part closes, where 0 is the observed value nearest to it.
    pub(super) fn closing_end(&self) -> Option<usize> {
        let observed = ordered(self.asset.links[self.link].joint?.observed);
        (0..2).find(|end| observed[*end] == 0.0)
    }

    /// Farthest beyond what was observed that a contact closes a part which is flush nowhere.
    pub(super) fn most_unseen(&self) -> f64 {
        match self.kind() {
            JointKind::Prismatic => self.settings.most_unseen_slide,
            _ => self.settings.most_unseen_turn,
        }
    }

    /// Where a part that closes beyond 0 is flush; none if it was observed closed.
    pub(super) fn flush(&self, ranges: &[Option<Range>]) -> Option<Flush> {
        let range = ranges[self.link].as_ref()?;
        let end = self.closing_end()?;
        let sign = if end == 0 { -1.0 } else { 1.0 };
        if range.sources[end] == Source::Contact || sign * range.limits[end] * self.reach() <= self.near {
            return None;
        }
        match self.kind() {
            JointKind::Prismatic => self.flush_slide(ranges, end, sign),
            JointKind::Revolute => self.flush_panel(sign),
            JointKind::Screw => None,
        }
    }

    /// Where a panel that turns lies on the face of its carrier.
    fn flush_panel(&self, sign: f64) -> Option<Flush> {
        let settings = &self.settings.flush;
        let (asset, near) = (self.asset, self.near / self.reach());
        let most = self.settings.widest_turn - self.span();
        let values = flush::folded(asset, self.surfaces, self.link, settings.border * self.near, settings);
        let beyond = values.into_iter().filter(|v| (-near..=most).contains(&(sign * v)));
        let value = beyond.min_by(|a, b| (sign * a).total_cmp(&(sign * b)))?;
        let link = asset.links[asset.links[self.link].parent?].name.clone();
        let closed = value.abs() <= near;
        Some(Flush { value: sign * (sign * value).max(0.0), link, precision: settings.turn_error, closed })
    }

    /// Where the front of a slide is flush with the front of its carrier or, where it meets nothing, with those of parts beside it that
    /// close until a contact.
    fn flush_slide(&self, ranges: &[Option<Range>], end: usize, sign: f64) -> Option<Flush> {
        let (asset, surfaces, settings) = (self.asset, self.surfaces, &self.settings.flush);
        let joint = asset.links[self.link].joint?;
        let range = ranges[self.link].as_ref()?;
        // A front that overlaps its frame meets it before it is flush, by its thickness.
        let most = sign * range.limits[end] + self.settings.most_unseen_slide;
        let (opens, layer, least) = (-sign * joint.axis, settings.layer * self.spacing, self.precision.points);
        let plate = |link: usize| flush::plate(asset, surfaces, link, opens, (layer, least), settings);
        let own = plate(self.link)?;
        let flush_with = |depth: f64, link: usize| {
            let way = own.depth - depth;
            let value = sign * way.max(0.0);
            let closed = way.abs() <= self.near;
            let name = asset.links[link].name.clone();
            (way >= -self.near && way < most).then_some(Flush { value, link: name, precision: 0.0, closed })
        };
        let parent = asset.links[self.link].parent?;
        let frame = {
            let within = [own.depth - most, own.depth + self.near];
            let around = (settings.frame * self.near, within);
            flush::frame(asset, surfaces, parent, (&own, opens), around, (layer, least), settings)
        };
        if let Some(found) = frame.and_then(|depth| flush_with(depth, parent)) {
            return Some(found);
        }
        if range.sources[end] != Source::Assumed {
            return None;
        }
        let closed_beside = flush::beside(asset, self.link, settings.parallel).filter_map(|other| {
            let range = ranges[other].as_ref().filter(|r| matches!(r.stops[end], Stop::Contact(_)))?;
            flush_with(plate(other)?.depth - sign * range.limits[end], other)
        });
        closed_beside.min_by(|a, b| (sign * a.value).total_cmp(&(sign * b.value)))
    }

    /// Metres that a point of the part moves at most per unit of the joint.
    pub(super) fn reach(&self) -> f64 {
        reach(self.asset, self.surfaces, self.link)
    }

    /// The first contact beyond a joint value, the other joints at the given values.
    fn contact(
        &self,
        values: &[f64],
        (from, way): (f64, f64),
        [own, others]: [Part; 2],
        precision: &Precision,
    ) -> Option<Contact> {
        let sweep = Sweep { link: self.link, from, way, own, others };
        first_contact(self.asset, self.surfaces, values, &sweep, precision)
    }

    /// The precision with which contacts with the carrier may be narrow.
    pub(super) const fn with_narrow(&self) -> Precision {
        Precision { carrier_width: 0.0, ..self.precision }
    }

    fn met(&self, contact: Contact, source: Source) -> Found {
        let name = self.asset.links[contact.link].name.clone();
        Found { way: contact.way, stop: Stop::Contact(name), source }
    }

    /// The way from 0 to where the part closes.
    fn closing(&self, sign: f64) -> Found {
        if let Some(found) = self.first_closing(sign, &self.precision) {
            return found;
        }
        match self.uncrossed(self.assumed(), 0.0, sign) {
            found if found.way > 0.0 => found,
            _ => Found { way: 0.0, stop: Stop::Observed, source: Source::Observed },
        }
    }

    /// The first contact beyond 0 in the direction in which the part closes. The side of a part that presses against its frame is often
    /// hidden: the closed mesh counts too. Only surfaces that were seen show that a part is closed.
    pub(super) fn first_closing(&self, sign: f64, precision: &Precision) -> Option<Found> {
        let most = match self.kind() {
            JointKind::Prismatic => self.length(),
            JointKind::Revolute => self.settings.widest_turn - self.span(),
            // The length of a thread is not visible.
            JointKind::Screw => 0.0,
        };
        let zero = vec![0.0; self.asset.links.len()];
        let way = (0.0, sign * most.max(0.0));
        let seen = self.contact(&zero, way, [Part::Seen; 2], precision);
        let closed = self.contact(&zero, way, [Part::All, Part::Seen], precision);
        let first = [seen, closed].into_iter().flatten().min_by(|a, b| a.way.total_cmp(&b.way))?;
        let is_near = |contact: Contact| contact.way * self.reach() <= self.near;
        Some(self.met(first, if seen.is_some_and(is_near) { Source::Contact } else { Source::Inferred }))
    }

    /// The way from a joint value until a contact, until a slide loses its support, or as far as is assumed. Only what was seen
    /// stops a part: hidden sides of meshes are invented.
    fn opening(&self, from: f64, sign: f64, knows_direction: bool) -> Found {
        let (most, end) = match self.kind() {
            JointKind::Prismatic => {
                let (held, assumed) = (self.held(from, sign), self.assumed());
                match knows_direction || held < assumed.way {
                    true => (held, Found { way: held, stop: Stop::Support, source: Source::Inferred }),
                    false => (assumed.way, assumed),
                }
            }
            _ => {
                let assumed = self.assumed();
                (assumed.way, assumed)
            }
        };
        let zero = vec![0.0; self.asset.links.len()];
        match self.contact(&zero, (from, sign * most), [Part::Seen; 2], &self.with_narrow()) {
            Some(contact) => {
                let met = self.met(contact, Source::Contact);
                // Between the observed value and the contact, nothing but an assumption says that the way is free.
                match end.source {
                    Source::Assumed => self.uncrossed(met, from, sign),
                    _ => met,
                }
            }
            None if most <= 0.0 => Found { way: 0.0, stop: Stop::Observed, source: Source::Observed },
            None if end.source == Source::Assumed => self.uncrossed(end, from, sign),
            None => end,
        }
    }

    /// The way of a slide from a joint value, ended where the part begins to cross another one; other ways stay.
    fn uncrossed(&self, found: Found, from: f64, sign: f64) -> Found {
        if self.kind() != JointKind::Prismatic || found.way <= 0.0 {
            return found;
        }
        let zero = vec![0.0; self.asset.links.len()];
        let sweep = Sweep { link: self.link, from, way: sign * found.way, own: Part::Seen, others: Part::Seen };
        let precision = Precision { overlap: self.settings.crossing * self.precision.overlap, ..self.precision };
        match first_crossing(self.asset, self.surfaces, &zero, &sweep, &precision) {
            Some(contact) => self.met(contact, Source::Inferred),
            None => found,
        }
    }

    /// The range around the value in a state in which the joint meets nothing, the others in that state.
    pub(super) fn free(&self, state: State, [lower, upper]: [f64; 2]) -> [f64; 2] {
        let values = self.asset.observed(state);
        let at = values[self.link];
        let parts = [Part::Seen; 2];
        let below = self.contact(&values, (at, lower - at), parts, &self.precision).map_or(lower, |met| at - met.way);
        let above = self.contact(&values, (at, upper - at), parts, &self.precision).map_or(upper, |met| at + met.way);
        [below.clamp(lower, at.max(lower)), above.clamp(at.min(upper), upper)]
    }

    fn kind(&self) -> JointKind {
        self.asset.links[self.link].joint.map_or(JointKind::Prismatic, |joint| joint.kind)
    }

    fn span(&self) -> f64 {
        let [lower, upper] = self.asset.links[self.link].joint.map_or([0.0; 2], |joint| ordered(joint.observed));
        upper - lower
    }

    /// The largest extension where nothing limits it.
    fn assumed(&self) -> Found {
        let span = self.span();
        let way = match self.kind() {
            JointKind::Prismatic => self.settings.most_slide * span,
            JointKind::Revolute => self.settings.most_turn.min(0.5 * (self.settings.widest_turn - span)).max(0.0),
            JointKind::Screw => 0.0,
        };
        Found { way, stop: Stop::Reach, source: Source::Assumed }
    }

    /// Extent of a link along the axis of this joint, in the frame of the link.
    fn extent(&self, link: usize) -> [f64; 2] {
        let axis = self.asset.links[self.link].joint.map_or(DVec3::X, |joint| joint.axis);
        let along = self.surfaces[link].visible().map(|p| p.dot(axis));
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    }

    /// Visible length of the part along its axis.
    fn length(&self) -> f64 {
        let [low, high] = self.extent(self.link);
        if high > low { high - low } else { 0.0 }
    }

    /// How far a slide can move beyond a value before less than the configured share of its visible length lies within the
    /// extent of its parent.
    fn held(&self, from: f64, sign: f64) -> f64 {
        let link = &self.asset.links[self.link];
        let (Some(parent), Some(joint)) = (link.parent, link.joint) else { return 0.0 };
        let shift = (link.origin - self.asset.links[parent].origin).dot(joint.axis) + from;
        let (own, carrier, length) = (self.extent(self.link), self.extent(parent), self.length());
        let inside = match sign > 0.0 {
            true => carrier[1] - (own[0] + shift),
            false => own[1] + shift - carrier[0],
        };
        let free = inside - self.settings.least_support * length;
        if free.is_finite() { free.clamp(0.0, length) } else { 0.0 }
    }
}
