//! Determines the closed state of parts and extends joint limits beyond the observed range.

use crate::config::PhysicalConfig;
use crate::flush;
use crate::hull::Hull;
use crate::sweep::{Contact, Part, Precision, Surface, Sweep, first_contact, first_crossing, reach};
use artgs_core::{Asset, JointKind, Mesh, PerState, State};
use glam::DVec3;

/// The state in which a part lies closer to its parent, nearer to being closed; none if the distances differ by less than
/// `significant`. `part` and `parent` are the surfaces in both states, in one frame. Open drawers and doors protrude.
pub(crate) fn nearer_state(part: PerState<&Mesh>, parent: PerState<&Mesh>, significant: f64) -> Option<State> {
    let distances = PerState::try_from_fn(|state| protrusion(part[state], parent[state]))?;
    let (start, end) = (distances[State::START], distances[State::END]);
    if (start - end).abs() < significant {
        return None;
    }
    Some(if end < start { State::END } else { State::START })
}

/// Mean distance of the vertices of a part from the convex hull of its parent.
fn protrusion(part: &Mesh, parent: &Mesh) -> Option<f64> {
    const SAMPLE: usize = 4000;
    let sampled = |mesh: &Mesh| -> Vec<DVec3> {
        let stride = mesh.vertices.len().div_ceil(SAMPLE).max(1);
        mesh.vertices.iter().step_by(stride).map(|v| DVec3::from_array(v.map(f64::from))).collect()
    };
    let hull = Hull::of(&sampled(parent), 0.0)?;
    let points = sampled(part);
    let far = |p: &DVec3| hull.distance(*p);
    (!points.is_empty()).then(|| points.iter().map(far).sum::<f64>() / points.len() as f64)
}

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
    let spacing = config.sample_share * diagonal;
    let width = config.contact_width_share * diagonal;
    let precision = Precision {
        points: (width * width / (spacing * spacing)).ceil() as usize,
        width: config.contact_rim_share * diagonal,
        carrier_width: config.contact_rim_share * diagonal,
        overlap: config.overlap_share * diagonal,
    };
    let near = config.closed_share * diagonal;
    let search = |link: usize| Search { asset, surfaces, link, precision, config, near, spacing };
    let mut ranges: Vec<Option<Range>> =
        (0..asset.links.len()).map(|link| search(link).range(nearer[link].is_some())).collect();
    if config.extend_limits {
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
        let Some(range) = range.as_mut().filter(|_| config.extend_limits) else { continue };
        // Engines refuse a range of nothing.
        range.limits[1] = range.limits[1].max(range.limits[0] + NARROWEST);
        for state in State::ALL {
            range.free[state] = search(link).free(state, range.limits);
        }
    }
    ranges
}

/// Least range of a joint, radians or metres: engines refuse `lower = upper`.
pub(crate) const NARROWEST: f64 = 1e-4;

fn ordered(values: PerState<f64>) -> [f64; 2] {
    let (start, end) = (values[State::START], values[State::END]);
    [start.min(end), start.max(end)]
}

/// A joint value, beyond 0 in the direction in which a part closes, at which it is flush with others.
struct Flush {
    value: f64,
    link: String,
    /// A contact within this way behind it is a better measure.
    precision: f64,
    /// The part was observed there.
    closed: bool,
}

impl Range {
    /// Ends the range that closes where the part is flush, if no contact comes before that. Of a part that is flush nowhere, a limit more than `most` beyond
    /// what was observed is one of a surface that was not seen well, and the part closes no further than it was seen. The first contact, `narrow`, may
    /// be two rims that overlap, but not if the part would move by more than `most` behind it; one that comes at most `alike` before a wide
    /// contact or a flush place is the beginning of it.
    fn close(&mut self, end: usize, flush: Option<Flush>, narrow: Option<Found>, [most, alike]: [f64; 2]) {
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

/// How far a joint goes beyond an observed value.
struct Found {
    way: f64,
    stop: Stop,
    source: Source,
}

/// The search for the limits of one joint.
struct Search<'a> {
    asset: &'a Asset,
    surfaces: &'a [Surface],
    link: usize,
    precision: Precision,
    config: &'a PhysicalConfig,
    /// A part that meets another one within this way, metres, was observed closed.
    near: f64,
    /// Distance of the points of the surfaces.
    spacing: f64,
}

impl Search<'_> {
    /// The limits by this part's contacts; `free` is not known yet.
    fn range(&self, knows_direction: bool) -> Option<Range> {
        let observed = ordered(self.asset.links[self.link].joint?.observed);
        let mut out = Range {
            limits: observed,
            stops: [Stop::Observed, Stop::Observed],
            sources: [Source::Observed; 2],
            free: PerState::new(observed, observed),
            closed: false,
        };
        if !self.config.extend_limits {
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
    fn closing_end(&self) -> Option<usize> {
        let observed = ordered(self.asset.links[self.link].joint?.observed);
        (0..2).find(|end| observed[*end] == 0.0)
    }

    /// Farthest beyond what was observed that a contact closes a part which is flush nowhere.
    fn most_unseen(&self) -> f64 {
        match self.kind() {
            JointKind::Prismatic => self.config.most_unseen_slide,
            _ => self.config.most_unseen_turn,
        }
    }

    /// Where a part that closes beyond 0 is flush; none if it was observed closed.
    fn flush(&self, ranges: &[Option<Range>]) -> Option<Flush> {
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
        /// Error of the directions of faces, radians: surfaces are uneven.
        const PRECISION: f64 = 0.035;
        let (asset, near) = (self.asset, self.near / self.reach());
        let most = self.config.widest_turn - self.span();
        let values = flush::folded(asset, self.surfaces, self.link, 2.0 * self.near);
        let beyond = values.into_iter().filter(|v| (-near..=most).contains(&(sign * v)));
        let value = beyond.min_by(|a, b| (sign * a).total_cmp(&(sign * b)))?;
        let link = asset.links[asset.links[self.link].parent?].name.clone();
        Some(Flush { value: sign * (sign * value).max(0.0), link, precision: PRECISION, closed: value.abs() <= near })
    }

    /// Where the front of a slide is flush with the front of its carrier or, where it meets nothing, with those of parts beside it that
    /// close until a contact.
    fn flush_slide(&self, ranges: &[Option<Range>], end: usize, sign: f64) -> Option<Flush> {
        /// Largest distance of a frame from the rim of the front, multiples of the largest way of a part that was observed closed.
        const FRAME: f64 = 10.0;
        let (asset, surfaces) = (self.asset, self.surfaces);
        let joint = asset.links[self.link].joint?;
        let range = ranges[self.link].as_ref()?;
        // A front that overlaps its frame meets it before it is flush, by its thickness.
        let most = sign * range.limits[end] + self.config.most_unseen_slide;
        let (opens, layer, least) = (-sign * joint.axis, 0.5 * self.spacing, self.precision.points);
        let plate = |link: usize| flush::plate(asset, surfaces, link, opens, layer, least);
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
            flush::frame(asset, surfaces, parent, (&own, opens), (FRAME * self.near, within), (layer, least))
        };
        if let Some(found) = frame.and_then(|depth| flush_with(depth, parent)) {
            return Some(found);
        }
        if range.sources[end] != Source::Assumed {
            return None;
        }
        let closed_beside = flush::beside(asset, self.link).filter_map(|other| {
            let range = ranges[other].as_ref().filter(|r| matches!(r.stops[end], Stop::Contact(_)))?;
            flush_with(plate(other)?.depth - sign * range.limits[end], other)
        });
        closed_beside.min_by(|a, b| (sign * a.value).total_cmp(&(sign * b.value)))
    }

    /// Metres that a point of the part moves at most per unit of the joint.
    fn reach(&self) -> f64 {
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
    const fn with_narrow(&self) -> Precision {
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
    fn first_closing(&self, sign: f64, precision: &Precision) -> Option<Found> {
        let most = match self.kind() {
            JointKind::Prismatic => self.length(),
            JointKind::Revolute => self.config.widest_turn - self.span(),
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
        let precision = Precision { overlap: 0.5 * self.precision.overlap, ..self.precision };
        match first_crossing(self.asset, self.surfaces, &zero, &sweep, &precision) {
            Some(contact) => self.met(contact, Source::Inferred),
            None => found,
        }
    }

    /// The range around the value in a state in which the joint meets nothing, the others in that state.
    fn free(&self, state: State, [lower, upper]: [f64; 2]) -> [f64; 2] {
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
            JointKind::Prismatic => self.config.most_slide * span,
            JointKind::Revolute => self.config.most_turn.min(0.5 * (self.config.widest_turn - span)).max(0.0),
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
        let free = inside - self.config.least_support * length;
        if free.is_finite() { free.clamp(0.0, length) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decompose::solid::Solid;
    use artgs_core::{AssetJoint, AssetLink};

    fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
        Mesh::cuboid(low.map(|x| x as f32), high.map(|x| x as f32))
    }

    fn movable(kind: JointKind, axis: DVec3, origin: DVec3, open: f64) -> AssetLink {
        let joint = AssetJoint {
            kind,
            axis,
            pitch: 0.0,
            limits: [0.0, open],
            observed: PerState::new(0.0, open),
            effort: 1.0,
            velocity: 1.0,
            damping: 0.0,
            friction: 0.0,
        };
        let name = format!("{kind:?}").to_lowercase();
        AssetLink { name, parent: Some(0), joint: Some(joint), origin, ..AssetLink::default() }
    }

    /// Two side walls and a back, a drawer between them that is open by `out` at value 0 and
    /// was seen up to value `open`, a door before its left neighbour;
    /// everything opens along -Y.
    fn cabinet(drawer: [f64; 2]) -> (Asset, Vec<Surface>) {
        cabinet_with_front(drawer, 0.48)
    }

    /// The same with a front of the drawer that is this wide to both sides: the gap between the walls is 0.45 wide.
    fn cabinet_with_front([out, open]: [f64; 2], wide: f64) -> (Asset, Vec<Surface>) {
        let mut base = cuboid([-0.5, 0.0, 0.0], [-0.45, 1.0, 1.0]);
        base.append(&cuboid([0.45, 0.0, 0.0], [0.5, 1.0, 1.0]));
        base.append(&cuboid([-0.45, 0.95, 0.0], [0.45, 1.0, 1.0]));
        let mut drawer = cuboid([-0.4, 0.0, 0.0], [0.4, 0.8, 0.4]);
        drawer.append(&cuboid([-wide, -0.02, 0.0], [wide, 0.0, 0.4]));
        let door = cuboid([0.0, -0.04, 0.0], [0.95, 0.0, 0.4]);
        let links = vec![
            AssetLink { name: "base".into(), ..AssetLink::default() },
            movable(JointKind::Prismatic, DVec3::NEG_Y, DVec3::new(0.0, -out, 0.1), open),
            movable(JointKind::Revolute, DVec3::NEG_Z, DVec3::new(-0.45, -0.01, 0.55), 1.2),
        ];
        let surface = |mesh: &Mesh| Surface::of(Solid::new(mesh, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7);
        (Asset { name: "a".into(), links, ..Asset::default() }, [base, drawer, door].iter().map(surface).collect())
    }

    fn ranges(drawer: [f64; 2], config: &PhysicalConfig) -> Vec<Option<Range>> {
        let (asset, surfaces) = cabinet(drawer);
        extend(&asset, &surfaces, &[None, Some(State::START), Some(State::START)], 1.7, config)
    }

    #[test]
    fn a_front_between_walls_closes_until_it_is_flush_though_its_rims_overlap_them() {
        // Seen open by 3 cm or flush, but for an overlap with the walls of 4 mm.
        for out in [0.03, -0.02] {
            let (asset, surfaces) = cabinet_with_front([out, 0.3], 0.454);
            let found = extend(&asset, &surfaces, &[None, Some(State::START), None], 1.7, &PhysicalConfig::default());
            let drawer = found[1].clone().unwrap();
            assert!((drawer.limits[0] + out + 0.02).abs() < 2e-3, "{drawer:?}");
            assert_eq!((&drawer.stops[0], drawer.closed), (&Stop::Flush("base".into()), out < 0.0));
        }
    }

    #[test]
    fn parts_close_until_contact_and_slides_open_until_they_lose_support() {
        let config = PhysicalConfig::default();
        for (out, open, closed) in [(0.002, 0.3, true), (0.15, 0.3, false)] {
            let found = ranges([out, open], &config);
            assert_eq!(found[0], None);
            let drawer = found[1].clone().unwrap();
            assert_eq!(drawer.stops, [Stop::Contact("base".into()), Stop::Support]);
            assert!((drawer.limits[0] + out).abs() < 1e-3, "{drawer:?}");
            let closing = if closed { Source::Contact } else { Source::Inferred };
            assert_eq!((drawer.sources, drawer.closed), ([closing, Source::Inferred], closed));
            // A quarter of 82 cm stays inside.
            assert!((drawer.limits[1] + out - 0.595).abs() < 0.02, "{drawer:?}");
        }
        // It was seen farther open than that.
        let drawer = ranges([0.002, 0.7], &config)[1].clone().unwrap();
        assert_eq!((drawer.limits[1], &drawer.stops[1], drawer.sources[1]), (0.7, &Stop::Observed, Source::Observed));
        let door = ranges([0.002, 0.5], &config)[2].clone().unwrap();
        // Its front edge meets the wall beside it where the cosine is -1 / 4.
        assert_eq!((&door.stops[1], door.sources[1]), (&Stop::Contact("base".into()), Source::Contact));
        assert!((1.7..1.95).contains(&door.limits[1]) && door.closed, "{door:?}");
        let fixed = PhysicalConfig { extend_limits: false, ..config };
        let fixed = ranges([0.002, 0.5], &fixed)[1].clone().unwrap();
        assert_eq!((fixed.limits, fixed.sources), ([0.0, 0.5], [Source::Observed; 2]));
    }

    #[test]
    fn slides_without_contact_close_until_their_front_is_flush() {
        // An inset front, between side walls whose front edges are at y = 0; its neighbour overlaps the walls.
        let (mut asset, mut surfaces) = cabinet([0.2, 0.6]);
        let drawer = cuboid([-0.4, 0.0, 0.0], [0.4, 0.3, 0.4]);
        surfaces[1] = Surface::of(Solid::new(&drawer, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7);
        let nearer = [None, Some(State::START), Some(State::START)];
        let closing = |asset: &Asset, surfaces: &[Surface]| {
            let found = extend(asset, surfaces, &nearer, 1.7, &PhysicalConfig::default())[1].clone().unwrap();
            (found.limits[0], found.stops[0].clone(), found.sources[0], found.closed)
        };
        let (limit, stop, source, closed) = closing(&asset, &surfaces);
        assert_eq!((stop, source, closed), (Stop::Flush("base".into()), Source::Inferred, false));
        assert!((limit + 0.2).abs() < 0.005, "{limit}");
        // Nearly flush: closed.
        asset.links[1].origin.y = -0.005;
        let (limit, stop, _, closed) = closing(&asset, &surfaces);
        assert!(limit.abs() < 0.01 && stop == Stop::Flush("base".into()) && closed, "{limit} {stop:?}");
        // Without walls, the front of a closed drawer beside it shows where it closes.
        asset.links[1].origin.y = -0.2;
        let base = cuboid([-0.5, 0.3, 0.55], [0.5, 0.35, 1.0]);
        surfaces[0] = Surface::of(Solid::new(&base, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7);
        asset.links[2] = movable(JointKind::Prismatic, DVec3::NEG_Y, DVec3::new(0.0, -0.001, 0.55), 0.3);
        asset.links[2].name = "closed".into();
        surfaces[2] = Surface::of(Solid::new(&drawer, &|_| true).as_ref(), &|_| true, 4e-3 * 1.7);
        let (limit, stop, source, closed) = closing(&asset, &surfaces);
        assert_eq!((stop, source, closed), (Stop::Flush("closed".into()), Source::Inferred, false), "{limit}");
        assert!((limit + 0.2).abs() < 0.005, "{limit}");
    }

    #[test]
    fn what_closes_a_part_is_a_contact_a_flush_face_or_what_was_seen() {
        let range = |limit: f64, source: Source| Range {
            limits: [limit, 1.0],
            stops: [Stop::Contact("base".into()), Stop::Observed],
            sources: [source, Source::Observed],
            free: PerState::new([0.0; 2], [0.0; 2]),
            closed: false,
        };
        let closed_with = |narrow: Option<f64>, limit: f64, source: Source, flush: Option<f64>| {
            let flush = flush.map(|value| Flush { value, link: "base".into(), precision: 0.03, closed: false });
            let found = |way| Found { way, stop: Stop::Contact("frame".into()), source: Source::Inferred };
            let mut range = range(limit, source);
            range.close(0, flush, narrow.map(found), [0.26, 0.02]);
            range.limits[0]
        };
        let closed = |limit: f64, source: Source, flush: Option<f64>| closed_with(None, limit, source, flush);
        // A contact just behind the flush place, before it, and far behind it.
        assert_eq!(closed(-0.72, Source::Inferred, Some(-0.7)), -0.72);
        assert_eq!(closed(-0.5, Source::Inferred, Some(-0.7)), -0.5);
        assert_eq!(closed(-1.2, Source::Inferred, Some(-0.7)), -0.7);
        // Nothing was met: only what is flush says more than what was seen, also beyond what would be assumed.
        assert_eq!(closed(-0.78, Source::Assumed, Some(-1.1)), -1.1);
        assert_eq!(closed(-0.78, Source::Assumed, None), 0.0);
        // Contacts of parts that are flush nowhere.
        assert_eq!(closed(-0.2, Source::Inferred, None), -0.2);
        assert_eq!(closed(-0.9, Source::Inferred, None), 0.0);
        // A narrow contact before a wide one or a flush place, at its beginning, far before it, and alone.
        assert_eq!(closed_with(Some(0.19), -0.2, Source::Inferred, None), -0.19);
        assert_eq!(closed_with(Some(0.21), -0.5, Source::Inferred, Some(-0.2)), -0.2);
        assert_eq!(closed_with(Some(0.1), -0.2, Source::Inferred, None), -0.2);
        assert_eq!(closed_with(Some(0.1), -0.5, Source::Inferred, Some(-0.2)), -0.2);
        assert_eq!(closed_with(Some(0.1), -1.5, Source::Inferred, Some(-1.5)), -0.1);
        assert_eq!(closed_with(Some(0.1), -0.78, Source::Assumed, None), -0.1);
        assert_eq!(closed_with(Some(0.1), -0.5, Source::Inferred, Some(0.0)), 0.0);
    }

    #[test]
    fn an_open_neighbour_stops_a_part_only_where_it_is_open() {
        let (mut asset, surfaces) = cabinet([0.0, 0.5]);
        // The door is below the drawer's top: the open drawer is in its way.
        asset.links[2].origin.z = 0.2;
        let door =
            extend(&asset, &surfaces, &[None, Some(State::START), Some(State::START)], 1.7, &PhysicalConfig::default());
        let door = door[2].clone().unwrap();
        assert!(door.limits[0] > -0.05 && door.limits[1] > 1.2, "{door:?}");
        // At the end state the drawer is open by half a metre.
        assert!(door.free[State::END][0] > 0.3, "{door:?}");
        assert!((door.free[State::START][0] - door.limits[0]).abs() < 1e-3, "{door:?}");
    }

    #[test]
    fn the_closed_state_protrudes_less() {
        let base = cuboid([-0.5, 0.0, 0.0], [0.5, 1.0, 1.0]);
        let at = |y: f64| cuboid([-0.4, y, 0.0], [0.4, y + 0.8, 0.4]);
        let (shut, open) = (at(0.1), at(-0.5));
        let empty = Mesh::default();
        let closed = |start, end| nearer_state(PerState::new(start, end), PerState::new(&base, &base), 0.01);
        assert_eq!(closed(&shut, &open), Some(State::START));
        assert_eq!(closed(&open, &shut), Some(State::END));
        assert_eq!(closed(&shut, &shut), None);
        assert_eq!(closed(&shut, &empty), None);
    }
}
