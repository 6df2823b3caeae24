//! What an export decided, as `export.json` says it.

use super::ExportOptions;
use crate::build::BuiltAsset;
use crate::limits::{Range, Stop};
use crate::looks::unrecorded_sides;
use crate::settings::SideSettings;
use artgs_core::{Capture, JointInterval, JointKind, Replica, State};
use artgs_io::asset::Format;
use artgs_io::export_report::{ExportReport, HandleReport, LinkReport, RequestedOptions};
use glam::DVec3;

/// What was decided about an asset.
pub(super) fn report(
    built: &BuiltAsset,
    replica: &Replica,
    asked: &ExportOptions,
    capture: Option<&Capture>,
    sides: &SideSettings,
) -> ExportReport {
    let BuiltAsset { asset, decisions, .. } = built;
    let views = capture.into_iter().flat_map(|capture| capture.states.iter().flat_map(|state| &state.train));
    let cameras: Vec<DVec3> =
        views.map(|view| decisions.object.apply(decisions.scale * view.camera.position())).collect();
    let [before, after] = decisions.clearance.volume;
    ExportReport {
        options: RequestedOptions::default(),
        scale: decisions.scale,
        up: asked.up.to_string(),
        up_source: asked.up_known.map(|up| up.source),
        up_confidence: asked.up_known.map(|up| up.confidence),
        frame: Some(decisions.object),
        links: (0..asset.links.len()).map(|i| link_report(built, replica, i, &asked.formats)).collect(),
        penetration: [decisions.clearance.deepest, decisions.penetration],
        lost_pieces: decisions.clearance.lost,
        unrecorded_sides: unrecorded_sides(asset, &cameras, sides).into_iter().map(String::from).collect(),
        cut_share: if before > 0.0 { 1.0 - after / before } else { 0.0 },
        ..ExportReport::default()
    }
}

/// The interval of the joint of part `i` in metres.
fn scaled(interval: &JointInterval, replica: &Replica, i: usize, scale: f64) -> JointInterval {
    let slides = replica.joint(i).is_some_and(|joint| joint.kind == JointKind::Prismatic);
    let motion = if slides { scale * interval.motion } else { interval.motion };
    JointInterval { position: interval.position.map(|p| scale * p), motion, ..*interval }
}

fn link_report(built: &BuiltAsset, replica: &Replica, i: usize, formats: &[Format]) -> LinkReport {
    let (link, surface, decisions) = (&built.asset.links[i], &built.surfaces[i], &built.decisions);
    let is_screw = link.joint.is_some_and(|j| j.kind == JointKind::Screw);
    let hinge_in = formats.iter().filter(|format| is_screw && !format.has_screws());
    let [texels, seen] = surface.texels;
    let range: Option<&Range> = decisions.ranges[i].as_ref();
    LinkReport {
        name: link.name.clone(),
        part: Some(replica.parts[i].name.clone()),
        class: link.semantics.map(|s| s.class),
        class_confidence: link.semantics.map(|s| s.confidence),
        class_given: link.semantics.is_some_and(|s| s.given),
        hinge: link.semantics.and_then(|s| s.hinge),
        handles: link.handles.iter().map(HandleReport::from).collect(),
        mass: link.inertial.mass,
        hulls: link.collision.len(),
        lost_pieces: decisions.lost.get(i).copied().unwrap_or(0),
        triangles: link.visual.mesh.triangles.len(),
        fused_triangles: surface.fused,
        watertight: surface.closed,
        surface_error: surface.error.most * decisions.scale,
        evidence: surface.evidence,
        textured_share: (seen > 0).then(|| seen as f64 / texels as f64),
        zero_state: decisions.nearer_state[i].map(|state| state.name().into()),
        closed_state: range
            .filter(|range| range.closed)
            .and(decisions.nearer_state[i])
            .map(|state| state.name().into()),
        parent: link.parent.map(|p| built.asset.links[p].name.clone()),
        joint: link.joint.map(|j| j.kind),
        pitch: link.joint.filter(|_| is_screw).map(|j| j.pitch),
        hinge_in: hinge_in.map(|format| format.name().into()).collect(),
        interval: link
            .joint
            .and(replica.parts[i].interval)
            .map(|interval| scaled(&interval, replica, i, decisions.scale)),
        limits: link.joint.map(|j| j.limits),
        observed: link.joint.map(|j| State::ALL.map(|state| j.observed[state])),
        sources: range.map(|range| range.sources.map(|source| source.name().into())),
        stops: range.map(|range| range.stops.each_ref().map(reason)),
        effort: link.joint.map(|j| j.effort),
        velocity: link.joint.map(|j| j.velocity),
        damping: link.joint.map(|j| j.damping),
        friction: link.joint.map(|j| j.friction),
    }
}

fn reason(stop: &Stop) -> String {
    match stop {
        Stop::Observed => "as observed".into(),
        Stop::Contact(link) => format!("before it meets {link}"),
        Stop::Flush(link) => format!("where it is flush with {link}"),
        Stop::Support => "where a quarter of its length is still supported".into(),
        Stop::Reach => "the largest range that is assumed".into(),
    }
}
