//! Converts parts in the capture's frame to links in link frames: units, upward axis, zero pose, names, hulls, masses, limits.

use crate::collision::apart::links_apart;
use crate::collision::clearance::{Clearance, Pieces, Spacing, clear, deepest, uncovered};
use crate::collision::decompose::{
    DecomposeOptions, Decomposer, decompose_solid, decompose_with, patches, seen_points,
};
use crate::collision::islands::{remove_lost, without_islands};
use crate::collision::motions::{PairMotions, RelativeMotion, arm, pair_motions, stances};
use crate::collision::redundant::without_redundant;
use crate::describe::semantics;
use crate::describe::{Described, describe, to_identifier};
use crate::dynamics::dynamics;
use crate::geometry::hull::Hull;
use crate::geometry::solid::Solid;
use crate::geometry::topology::diagonal;
use crate::limits::sweep::Surface;
use crate::limits::{Range, extend};
use crate::looks::{PartSurface, Seen, Wall};
use crate::mass::{inertial, walls};
use crate::settings::{Collision, CollisionSettings, PhysicalConfig};
use crate::step::ExportStep;
use artgs_core::{Asset, AssetLink, Mesh, Replica, Rigid, State, TexturedMesh};
use glam::DVec3;
use rayon::prelude::*;

/// Decisions about an asset that the asset itself does not contain.
#[derive(Clone, Debug)]
pub(crate) struct Decisions {
    /// State in which each part is nearer to being closed; none if unknown.
    pub nearer_state: Vec<Option<State>>,
    /// Limits of each joint with their reasons.
    pub ranges: Vec<Option<Range>>,
    /// Cuts of convex pieces over the observed range.
    pub clearance: Clearance,
    /// Places of the observed surface of each link that are left without a convex piece.
    pub lost: Vec<usize>,
    /// Deepest remaining penetration over all tested poses, metres.
    pub penetration: f64,
    /// Scale from the capture's frame at the start state to each link's frame; applied before `to_link`.
    pub scale: f64,
    /// Motion from the scaled capture's frame to the object's frame.
    pub object: Rigid,
    /// Motion from the scaled capture's frame to each link's frame.
    pub to_link: Vec<Rigid>,
}

/// Assembles an asset from a valid replica and the surfaces of its parts, without splats. Fails only if `decomposer` fails, or if
/// the settings name a part that is not there.
pub(crate) fn assemble(
    name: &str,
    replica: &Replica,
    surfaces: &[PartSurface],
    config: &PhysicalConfig,
    decomposer: Option<&Decomposer>,
    begins: &mut dyn FnMut(ExportStep),
) -> Result<(Asset, Decisions), String> {
    begins(ExportStep::Limits);
    let (mut asset, mut decisions, mut solids) = limited(name, replica, surfaces, config)?;
    let meshes: Vec<&Mesh> = surfaces.iter().map(|s| &s.visual.mesh).collect();
    let diagonal = config.scale * diagonal(&meshes);
    begins(ExportStep::Hulls);
    collide(&mut asset, &mut decisions, &mut solids, surfaces, diagonal, config, decomposer)?;
    Ok((asset, decisions))
}

/// Solid of the visual mesh of each link; none without a surface.
type Solids = Vec<Option<Solid>>;

/// True for points of a link of which this holds: [`Seen::holds`], that they were observed, or [`Seen::measures`].
fn shown<'a>(
    is: fn(&Seen, DVec3) -> bool,
    part: usize,
    surfaces: &'a [PartSurface],
    to_link: &Rigid,
    scale: f64,
) -> impl Fn(DVec3) -> bool + Sync + use<'a> {
    let (from_link, seen) = (to_link.inverse(), surfaces[part].observed.as_ref());
    move |p: DVec3| seen.is_none_or(|seen| is(seen, from_link.apply(p) / scale))
}

/// An asset with masses and joint limits, without convex pieces.
fn limited(
    name: &str,
    replica: &Replica,
    surfaces: &[PartSurface],
    config: &PhysicalConfig,
) -> Result<(Asset, Decisions, Solids), String> {
    let meshes: Vec<&Mesh> = surfaces.iter().map(|s| &s.visual.mesh).collect();
    let diagonal = config.scale * diagonal(&meshes);
    let Described { nearer, frames, names, semantics: classes, object, front } = describe(replica, &meshes, config);
    let settings = &config.settings;
    let wall = settings.mass.wall_share * diagonal;
    let link = |part: usize| {
        let to_link = Rigid::shift(-frames[part].origin) * frames[part].from_start;
        let visual = moved(&surfaces[part].visual, &to_link, config.scale);
        let from_link = to_link.inverse();
        let seen = surfaces[part].observed.as_ref();
        let mut solid = Solid::new(&visual.mesh, &shown(Seen::holds, part, surfaces, &to_link, config.scale));
        if let Some(solid) = &mut solid {
            solid.need_floors(&settings.collision.decompose.floor);
        }
        let wall_at = |p: DVec3, normal: DVec3, most: f64| match seen {
            Some(seen) => {
                let wall = seen.wall(
                    from_link.apply(p) / config.scale,
                    from_link.turn(normal),
                    most / config.scale,
                    settings.looks.alike,
                );
                Wall { thickness: wall.thickness.map(|thickness| thickness * config.scale), ..wall }
            }
            None => Wall { seen: true, thickness: None },
        };
        let closing = if part == 0 { settings.mass.closing_wall } else { 0.0 };
        let walls = walls(&visual.mesh, solid.as_ref(), &wall_at, [wall, closing], &settings.mass);
        let is_named = |name: &str| name == names[part] || name == replica.parts[part].name;
        let own = config.densities.iter().find(|(name, _)| is_named(name)).map(|(_, density)| *density);
        let density = own.unwrap_or(config.density);
        let is_solid = surfaces[part].closed && !surfaces[part].thickened;
        let inertial = inertial(&visual.mesh, is_solid, &walls, density, &settings.mass);
        let joint = frames[part].joint;
        let (name, parent, origin) = (names[part].clone(), replica.parts[part].parent, frames[part].origin);
        let (semantics, contact) = (Some(classes[part]), settings.dynamics.contact);
        (AssetLink { name, parent, joint, origin, visual, inertial, contact, semantics, ..AssetLink::default() }, solid)
    };
    let known = |name: &String| names.contains(name) || replica.parts.iter().any(|part| part.name == *name);
    if let Some((name, _)) = config.densities.iter().find(|(name, _)| !known(name)) {
        let shown = names.iter().zip(&replica.parts).map(|(name, part)| match part.name == *name {
            true => name.clone(),
            false => format!("{name} ({})", part.name),
        });
        let shown = shown.collect::<Vec<_>>().join(", ");
        return Err(format!("--density names `{name}`, but the parts are {shown}"));
    }
    let (mut links, solids): (Vec<AssetLink>, Solids) = (0..replica.parts.len()).into_par_iter().map(link).unzip();
    weigh(&mut links, config);
    for link in &mut links {
        let arm = link.joint.map_or(0.0, |joint| arm(&joint, &link.visual.mesh));
        link.joint = link.joint.map(|joint| dynamics(joint, &link.inertial, arm, &settings.dynamics));
    }
    let mut asset = Asset { name: to_identifier(name, "replica"), links, apart: Vec::new(), front };
    let handles = semantics::handles(&asset, &settings.describe);
    asset.links.iter_mut().zip(handles).for_each(|(link, handles)| link.handles = handles);
    let to_link = frames.iter().map(|f| Rigid::shift(-f.origin) * f.from_start).collect();
    let mut decisions = Decisions {
        nearer_state: nearer,
        ranges: Vec::new(),
        clearance: Clearance::default(),
        lost: Vec::new(),
        penetration: 0.0,
        scale: config.scale,
        object,
        to_link,
    };
    limit(&mut asset, &mut decisions, &solids, surfaces, diagonal, config);
    Ok((asset, decisions, solids))
}

/// Limits of all joints, by what was measured of the visual meshes.
fn limit(
    asset: &mut Asset,
    decisions: &mut Decisions,
    solids: &[Option<Solid>],
    surfaces: &[PartSurface],
    diagonal: f64,
    config: &PhysicalConfig,
) {
    let limits = &config.settings.limits;
    let swept = |(part, solid): (usize, &Option<Solid>)| {
        let measured = shown(Seen::measures, part, surfaces, &decisions.to_link[part], config.scale);
        let link = &asset.links[part];
        // Points of another part that have the label of this one are apart from it.
        let main = link.parent.and_then(|_| without_islands(&link.visual.mesh, config.settings.collision.island));
        let main = main.and_then(|mesh| Solid::new(&mesh, &measured));
        Surface::of(main.as_ref().or(solid.as_ref()), &measured, limits.sample_share * diagonal, &limits.sweep)
    };
    let swept: Vec<Surface> = solids.par_iter().enumerate().map(swept).collect();
    decisions.ranges = extend(asset, &swept, &decisions.nearer_state, diagonal, config);
    for (link, range) in asset.links.iter_mut().zip(&decisions.ranges) {
        if let (Some(joint), Some(range)) = (&mut link.joint, range) {
            joint.limits = range.limits;
        }
    }
}

/// Computes hulls that do not collide within the limits.
fn collide(
    asset: &mut Asset,
    decisions: &mut Decisions,
    solids: &mut [Option<Solid>],
    surfaces: &[PartSurface],
    diagonal: f64,
    config: &PhysicalConfig,
    decomposer: Option<&Decomposer>,
) -> Result<(), String> {
    let settings = &config.settings.collision;
    let spacing = Spacing::of(settings, diagonal, config.most_hulls);
    let Spacing { cover, thinnest, waste, .. } = spacing;
    let apart = settings.apart * cover;
    let options =
        DecomposeOptions::of(settings, diagonal, config.settings.mass.wall_share * diagonal, config.most_hulls);
    let parents: Vec<Option<usize>> = asset.links.iter().map(|link| link.parent).collect();
    let related = |a: usize, b: usize| parents[a] == Some(b) || parents[b] == Some(a);
    let convex = |(part, (link, solid)): (usize, (&AssetLink, &mut Option<Solid>))| {
        let Some(solid) = solid else { return Ok(Default::default()) };
        let observed = shown(Seen::holds, part, surfaces, &decisions.to_link[part], config.scale);
        let hulls = match decomposer {
            Some(other) => decompose_with(&link.visual.mesh, other, &options)?,
            None => decompose_solid(solid, &options),
        };
        Ok((hulls, seen_points(solid, &observed, apart)))
    };
    let links = asset.links.par_iter().zip(&mut *solids).enumerate();
    let decomposed: Vec<(Vec<Hull>, Vec<DVec3>)> = links.map(convex).collect::<Result<_, String>>()?;
    let (mut pieces, mut surface): (Pieces, Vec<Vec<DVec3>>) = decomposed.into_iter().unzip();
    // Poses in which several joints move are not cleared: contacts there are real.
    let motions = pair_motions(&stances(asset, &decisions.ranges, &settings.poses), asset.links.len());
    decisions.clearance = clear(&mut pieces, &surface, &motions, &spacing, related);
    // Finer than the distance within which surfaces are covered, so that no gap opens between points.
    let lean = |(part, link): (usize, &mut Vec<Hull>)| {
        let Some(solid) = &solids[part] else { return };
        let observed = shown(Seen::holds, part, surfaces, &decisions.to_link[part], config.scale);
        without_redundant(
            link,
            &seen_points(solid, &observed, cover),
            settings.lean * cover,
            config.most_hulls as usize,
        );
    };
    pieces.par_iter_mut().enumerate().for_each(lean);
    // What cuts left open gets thin pieces of its own.
    let thin = DecomposeOptions { most: config.most_hulls, skin: settings.patch * options.least, ..options };
    let patched = |part: usize| solids[part].as_ref().map_or(Vec::new(), |solid| patches(solid, &pieces[part], &thin));
    if decomposer.is_none() {
        let added: Pieces = (0..asset.links.len()).into_par_iter().map(patched).collect();
        pieces.iter_mut().zip(added).for_each(|(link, added)| link.extend(added));
        clear(&mut pieces, &surface, &motions, &spacing, related);
    }
    separate(&mut pieces, &surface, &motions, (&spacing, settings.rounds), related);
    pieces.iter_mut().for_each(|link| link.retain(|hull| !is_crumb(hull, cover, settings)));
    pieces.par_iter_mut().enumerate().for_each(lean);
    let near = settings.lost * (cover + spacing.gap + spacing.margins);
    let links = asset.links.iter_mut().zip(&pieces).zip(&mut surface);
    links
        .filter(|((link, _), _)| link.parent.is_some())
        .for_each(|((link, hulls), points)| remove_lost(link, hulls, points, near, settings.island));
    let missing =
        |(hulls, points): (&Vec<Hull>, &Vec<DVec3>)| uncovered(hulls, points, near, apart, settings.lost_width * waste);
    decisions.lost = pieces.par_iter().zip(&surface).map(missing).collect();
    let left = motions.iter().flat_map(|pair| overlaps(&pieces, pair));
    decisions.penetration = left.map(|(_, depth)| depth).fold(0.0, f64::max);
    if config.collision == Collision::Hulls {
        for (link, hulls) in asset.links.iter_mut().zip(&pieces) {
            // Cuts add corners.
            let coarse = |hull: &Hull| hull.clone().for_engines(options.corners, options.rounding, thinnest);
            link.collision = hulls.iter().filter_map(coarse).map(|hull| hull.mesh()).collect();
        }
        asset.apart = links_apart(asset, &settings.poses);
    }
    Ok(())
}

/// True for pieces so short and small that engines report false contacts of them; surfaces are covered within `cover`.
fn is_crumb(hull: &Hull, cover: f64, settings: &CollisionSettings) -> bool {
    let [low, high] = hull.bounds();
    (high - low).max_element() < settings.crumb_length * cover && hull.volume() < (settings.crumb_side * cover).powi(3)
}

/// Cuts what still penetrates, in so many rounds at most: the query for contacts within a distance can miss a penetration of thin
/// pieces that the query without a distance finds. Pieces keep the gap in these poses.
fn separate(
    pieces: &mut Pieces,
    surface: &[Vec<DVec3>],
    motions: &[PairMotions],
    (spacing, rounds): (&Spacing, usize),
    related: impl Fn(usize, usize) -> bool,
) {
    let sure = Spacing { sure: true, ..*spacing };
    for _ in 0..rounds {
        let left = |pair: &PairMotions| {
            let deep = overlaps(pieces, pair).into_iter().filter(|(_, depth)| *depth > spacing.tolerance);
            let motions: Vec<RelativeMotion> = deep.map(|(motion, _)| motion).collect();
            (!motions.is_empty()).then_some(PairMotions { motions, ..*pair })
        };
        let left: Vec<PairMotions> = motions.iter().filter_map(left).collect();
        if left.is_empty() {
            return;
        }
        clear(pieces, surface, &left, &sure, &related);
    }
}

/// The deepest penetration in each motion of a pair of links.
fn overlaps(pieces: &Pieces, pair: &PairMotions) -> Vec<(RelativeMotion, f64)> {
    pair.motions.par_iter().map(|motion| (*motion, deepest(pieces, pair.links, motion, 0.0))).collect()
}

/// Scales the masses to the total that was asked for.
fn weigh(links: &mut [AssetLink], config: &PhysicalConfig) {
    let total: f64 = links.iter().map(|link| link.inertial.mass).sum();
    let Some(mass) = config.mass.filter(|_| total > 0.0) else { return };
    for link in links {
        link.inertial.mass *= mass / total;
        link.inertial.inertia.iter_mut().for_each(|i| *i *= mass / total);
    }
}

/// A textured mesh scaled, then moved.
fn moved(visual: &TexturedMesh, motion: &Rigid, scale: f64) -> TexturedMesh {
    let mut out = visual.clone();
    for v in &mut out.mesh.vertices {
        *v = motion.apply(DVec3::from_array(v.map(f64::from)) * scale).as_vec3().to_array();
    }
    for n in &mut out.normals {
        *n = motion.turn(DVec3::from_array(n.map(f64::from))).as_vec3().to_array();
    }
    out
}

#[cfg(test)]
#[path = "assemble_tests.rs"]
mod tests;
