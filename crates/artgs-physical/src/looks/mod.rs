//! Prepares fused part meshes for display and mass computation: closed, simplified, textured from the photos.

pub mod bake;
pub(crate) mod fused;
mod passage;
pub(crate) mod repair;
pub(crate) mod shade;
mod sides;
mod sights;
pub(crate) mod simplify;
pub(crate) mod spread;
pub(crate) mod unwrap;

use crate::geometry::convert::{from_parry, pose, to_parry};
use crate::geometry::topology::{bounds, corners, cross, diagonal, points};
use crate::looks::bake::{BakeOptions, BakeView, Photo, bake, depth_of, equalise};
use crate::looks::fused::Fused;
use crate::looks::passage::{Passage, carved, freed};
use crate::looks::repair::{Obstacles, RepairOptions, mean_edge, repair};
use crate::looks::shade::with_normals;
use crate::looks::sights::Sights;
use crate::looks::simplify::{Original, SurfaceError, smoothed};
use crate::looks::spread::spread;
use crate::looks::unwrap::{UnwrapOptions, unwrap};
use crate::settings::{BakeSettings, LookSettings, PassageSettings, PhysicalConfig};
use artgs_core::{Camera, Capture, DepthMap, FaceEvidence, Joint, Mesh, PerState, Replica, State, TexturedMesh, View};
use artgs_io::export_report::Evidence;
use glam::DVec3;
use parry3d::math::Pose3;
use parry3d::query::{PointQuery as _, PointQueryWithLocation as _, Ray, RayCullingMode};
use parry3d::shape::TriMesh;
use rayon::prelude::*;
pub(crate) use sides::unrecorded_sides;
use std::borrow::Cow;
use std::sync::Arc;

/// A part's surface at the start state, frame and unit of the capture.
#[derive(Clone, Debug, Default)]
pub struct PartSurface {
    /// Visual mesh.
    pub visual: TexturedMesh,
    /// True if the mesh is closed.
    pub closed: bool,
    /// True if walls of a thickness that was not measured close the mesh: its volume says nothing about its mass.
    pub thickened: bool,
    /// Triangles of the fused mesh.
    pub fused: usize,
    /// Distance between the visual mesh and the closed fused mesh, units of the capture.
    pub error: SurfaceError,
    /// Texels of the surface, and those of them that a photo shows.
    pub texels: [usize; 2],
    /// What was observed of the surface: the fused mesh.
    pub observed: Option<Seen>,
    /// What the visual mesh rests on; none without a surface or without a capture with depth.
    pub evidence: Option<Evidence>,
    /// Warnings, one sentence each.
    pub warnings: Vec<String>,
}

/// A fused mesh, for distances.
#[derive(Clone, Debug)]
pub struct Seen {
    shape: Arc<TriMesh>,
    /// Points within this distance belong to it, units of the capture.
    reach: f64,
    /// Whether a photo measured each triangle; none if all depth was measured.
    measured: Option<Arc<[bool]>>,
}

impl Seen {
    /// True for points of a part's surface that were observed, frame of the capture at the start state.
    pub fn holds(&self, point: DVec3) -> bool {
        self.shape.project_local_point_with_max_dist(to_parry(point), false, self.reach as f32).is_some()
    }

    /// True for points of a part's surface that a sensor measured: surfaces that are only derived from photos end anywhere within a cell.
    pub fn measures(&self, point: DVec3) -> bool {
        let Some(measured) = &self.measured else { return self.holds(point) };
        self.nearest(point).is_some_and(|triangle| measured[triangle as usize])
    }

    /// The nearest triangle, if the point belongs to the mesh.
    fn nearest(&self, point: DVec3) -> Option<u32> {
        let point = to_parry(point);
        let near = self.shape.project_local_point_and_get_location_with_max_dist(point, false, self.reach as f32);
        near.map(|(_, (triangle, _))| triangle)
    }

    /// Asks of each triangle whether more views measure it than show it by derived depth, if some depth was derived: at borders of parts,
    /// sensors measure what lies between two surfaces.
    fn asked(self, views: &[BakeView], options: &BakeOptions) -> Self {
        if !views.iter().any(BakeView::has_derived) {
            return self;
        }
        let is_measured = |triangle: u32| {
            let triangle = self.shape.triangle(triangle);
            let (middle, normal) = (from_parry(triangle.center()), triangle.normal().map(from_parry));
            let sights = views.iter().filter_map(|view| view.measures(middle, normal?, options));
            sights.map(|measured| if measured { 1 } else { -1 }).sum::<i32>() > 0
        };
        let measured = (0..self.shape.indices().len() as u32).into_par_iter().map(is_measured).collect::<Vec<_>>();
        Self { measured: Some(measured.into()), ..self }
    }

    /// What was observed of a wall at a point of its surface with this outward unit normal; the cosine between it and that of what was seen
    /// is above `alike`. Distances in units of the capture.
    pub fn wall(&self, point: DVec3, normal: DVec3, most: f64, alike: f64) -> Wall {
        let faces = |t: u32| self.shape.triangle(t).normal().is_some_and(|n| from_parry(n).dot(normal) > alike);
        let ray = Ray::new(to_parry(point), to_parry(-normal));
        let exit = self.shape.cast_local_ray_with_culling(&ray, most as f32, RayCullingMode::IgnoreFrontfaces);
        let seen = self.nearest(point).is_some_and(faces);
        Wall { seen, thickness: exit.filter(|_| seen).map(|hit| f64::from(hit.time_of_impact)) }
    }
}

/// What was observed of a wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wall {
    /// True if this side was seen from outside: the other side of a thin wall is near, but faces the other way.
    pub seen: bool,
    /// Distance to the other side if both were seen; closing surfaces between them do not count.
    pub thickness: Option<f64>,
}

/// Surfaces of all parts of a valid replica. `meshes[i]` is the fused mesh of part `i` at the start state; without a capture
/// textures hold the colours of the meshes.
pub fn surfaces(
    replica: &Replica,
    meshes: &[Mesh],
    capture: Option<&Capture>,
    config: &PhysicalConfig,
) -> Vec<PartSurface> {
    let settings = &config.settings.looks;
    let better = PerState::from_fn(|state| better_depth(replica, meshes, capture, state));
    let whole = voxels(meshes.iter(), settings);
    let finest = whole.iter().copied().filter(|voxel| *voxel > 0.0).fold(f64::INFINITY, f64::min);
    let photos = photos(capture, &better, settings.bake.jump * finest, &settings.bake);
    // Depth that was rendered from the meshes measures nothing.
    let measured = if capture.is_some_and(Capture::has_depth) { &photos[..] } else { &[] };
    let fused = &consistent(replica, meshes, &whole, measured, settings);
    fused.par_iter().for_each(|fused| {
        fused.shape();
    });
    let voxels = voxels(fused.iter().map(Fused::mesh), settings);
    let mut views: Vec<Vec<BakeView>> = (0..fused.len()).map(|part| views(part, replica, photos.iter())).collect();
    let shape = |part| {
        let sights = Sights::of(part, replica, measured, BakeOptions::at_resolution(voxels[part], &settings.bake));
        shape(part, replica, fused, voxels[part], &views[part], &sights, config)
    };
    let mut shapes: Vec<Shape> = (0..fused.len()).into_par_iter().map(shape).collect();
    let compared: Vec<Vec<[DVec3; 2]>> =
        shapes.par_iter().map(|shape| spread(&shape.surface.visual.mesh, settings.compared)).collect();
    let options: Vec<BakeOptions> =
        voxels.iter().map(|voxel| BakeOptions::at_resolution(*voxel, &settings.bake)).collect();
    shapes.par_iter_mut().zip(&views).zip(&options).for_each(|((shape, views), options)| {
        // Depth that was rendered from the meshes measures nothing.
        let observed = shape.surface.observed.as_ref().filter(|_| capture.is_some_and(Capture::has_depth));
        let mesh = &shape.surface.visual.mesh;
        let evidence = observed.map_or_else(Vec::new, |seen| faces(mesh, seen, views, options));
        shape.surface.evidence = shares(mesh, &evidence);
        shape.surface.visual.evidence = evidence;
        shape.surface.observed = shape.surface.observed.take().map(|seen| seen.asked(views, options));
    });
    equalise(&mut views, &compared, &options);
    shapes.par_iter_mut().zip(&views).zip(fused).zip(&options).for_each(|(((shape, views), fused), options)| {
        if let Some(size) = shape.atlas {
            let surface = &mut shape.surface;
            let baked = bake(&surface.visual, size, views, (fused.mesh(), settings.atlas.padding), options);
            surface.texels = [baked.texels, baked.seen];
            surface.visual.mesh.colors = baked.colors;
            surface.visual.texture = Some(baked.texture);
        }
    });
    shapes.into_iter().map(|shape| shape.surface).collect()
}

/// Shares of the area of a mesh by what its faces rest on; none if that is unknown.
fn shares(mesh: &Mesh, evidence: &[FaceEvidence]) -> Option<Evidence> {
    let mut areas = [0.0; 3];
    evidence.iter().zip(&mesh.triangles).for_each(|(kind, t)| areas[*kind as usize] += cross(mesh, *t).length());
    let all: f64 = areas.iter().sum();
    let [seen, derived, invented] = areas.map(|area| area / all);
    (all > 0.0).then_some(Evidence { seen, derived, invented })
}

/// What each face of a mesh rests on: most of four of its points.
fn faces(mesh: &Mesh, observed: &Seen, views: &[BakeView], options: &BakeOptions) -> Vec<FaceEvidence> {
    /// Barycentric weights of the points.
    const PLACES: [[f64; 3]; 4] = [
        [1.0 / 3.0; 3],
        [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0],
        [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0],
        [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0],
    ];
    let face = |t: &[u32; 3]| {
        let [a, b, c] = corners(mesh, *t);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let mut counts = [0; 3];
        for [u, v, w] in PLACES {
            counts[at([a * u + b * v + c * w, normal], observed, views, options) as usize] += 1;
        }
        // Of two kinds with as many points, the one that rests on less.
        let most = |kind: &FaceEvidence| (counts[*kind as usize], *kind);
        FaceEvidence::ALL.into_iter().max_by_key(most).unwrap_or(FaceEvidence::Invented)
    };
    mesh.triangles.par_iter().map(face).collect()
}

/// What a point of a surface, with its normal, rests on.
fn at([point, normal]: [DVec3; 2], observed: &Seen, views: &[BakeView], options: &BakeOptions) -> FaceEvidence {
    if !observed.holds(point) {
        return FaceEvidence::Invented;
    }
    let mut sights = views.iter().filter_map(|view| view.measures(point, normal, options)).peekable();
    match sights.peek().is_some() && !sights.any(|measured| measured) {
        true => FaceEvidence::Derived,
        false => FaceEvidence::Seen,
    }
}

/// A part's surface before its texture is painted.
#[derive(Default)]
struct Shape {
    surface: PartSurface,
    /// Width and height of the texture, texels; none if there will not be one.
    atlas: Option<[u32; 2]>,
}

/// Edge of a voxel of a fused mesh.
fn voxel(mesh: &Mesh, diagonal: f64, settings: &LookSettings) -> f64 {
    settings.voxel_per_edge
        * match mean_edge(mesh) {
            edge if edge > settings.coarsest_share * diagonal => settings.exact_share * diagonal,
            edge => edge,
        }
}

/// Edges of the voxels of fused meshes.
fn voxels<'a>(meshes: impl Iterator<Item = &'a Mesh>, settings: &LookSettings) -> Vec<f64> {
    let meshes: Vec<&Mesh> = meshes.collect();
    let diagonal = diagonal(&meshes);
    meshes.iter().map(|mesh| voxel(mesh, diagonal, settings)).collect()
}

/// The parts that another one carries, with their joints.
fn carried_by(replica: &Replica, part: usize) -> impl Iterator<Item = (usize, Joint)> {
    let own = move |q: &usize| replica.parts[*q].parent == Some(part);
    (0..replica.parts.len()).filter(own).filter_map(|q| Some((q, replica.joint(q)?)))
}

fn passages(replica: &Replica, meshes: &[Fused], part: usize, voxel: f64, settings: &PassageSettings) -> Vec<Passage> {
    carried_by(replica, part).filter_map(|(q, joint)| Passage::of(&meshes[q], &joint, voxel, settings)).collect()
}

/// Fused meshes, of these edges of voxels, without surfaces that contradict the motions and that no `measured` photos show: first those of carriers, then
/// those of what they carry.
fn consistent(
    replica: &Replica,
    meshes: &[Mesh],
    voxels: &[f64],
    measured: &[Placed],
    settings: &LookSettings,
) -> Vec<Fused> {
    let known = |part: usize| voxels[part] > 0.0;
    let fused: Vec<Fused> = meshes.iter().cloned().map(Fused::from).collect();
    let carve = |part: usize| match known(part) {
        true => {
            let passages = passages(replica, &fused, part, voxels[part], &settings.passage);
            let options = BakeOptions::at_resolution(voxels[part], &settings.bake);
            carved(&fused[part], &passages, &Sights::of(part, replica, measured, options))
        }
        false => fused[part].clone(),
    };
    let carved: Vec<Fused> = (0..meshes.len()).into_par_iter().map(carve).collect();
    let free = |part: usize| match (replica.parts[part].parent, replica.joint(part)) {
        (Some(parent), Some(joint)) if known(part) => {
            freed(&carved[part], &joint, &carved[parent], voxels[part], &settings.passage)
        }
        _ => carved[part].clone(),
    };
    (0..meshes.len()).into_par_iter().map(free).collect()
}

/// Surfaces of the other parts in both states, with their poses in the frame of a part at the start state.
fn others<'a>(replica: &Replica, meshes: &'a [Fused], part: usize) -> Vec<(&'a TriMesh, Pose3)> {
    let at = |(state, q): (State, usize)| {
        let relative = replica.motion_to(part, state).inverse() * replica.motion_to(q, state);
        Some((meshes[q].shape()?.as_ref(), pose(&relative)))
    };
    let all = State::ALL.into_iter().flat_map(|state| (0..meshes.len()).map(move |q| (state, q)));
    all.filter(|(_, q)| *q != part).filter_map(at).collect()
}

fn shape(
    part: usize,
    replica: &Replica,
    meshes: &[Fused],
    voxel: f64,
    views: &[BakeView],
    sights: &Sights,
    config: &PhysicalConfig,
) -> Shape {
    let fused = meshes[part].mesh();
    let settings = &config.settings.looks;
    let edge = voxel / settings.voxel_per_edge;
    if fused.is_empty() || edge.is_nan() || edge <= 0.0 {
        let warnings =
            vec![format!("{} has no surface: nothing is drawn and nothing collides", replica.parts[part].name)];
        return Shape { surface: PartSurface { warnings, ..PartSurface::default() }, atlas: None };
    }
    let carried = passages(replica, meshes, part, voxel, &settings.passage);
    let others = others(replica, meshes, part);
    let passed = |p: DVec3| carried.iter().any(|c| c.holds(p));
    let empty = |p: DVec3| sights.look_through(p, settings.passage.shown);
    let obstacles = Obstacles { passed: &passed, empty: &empty };
    let repaired = repair(fused, &obstacles, &others, &RepairOptions::at_resolution(edge, &settings.repair));
    let simplify = &settings.simplify;
    let smooth = smoothed(&repaired.mesh, simplify.rounds, simplify.reach * voxel);
    // Flat panels need few triangles.
    let original = Original::new(&smooth, simplify);
    let exact = original.simplified_to(config.triangles / simplify.flat, simplify.exact * voxel, config.triangles);
    let simple = exact.unwrap_or_else(|| original.simplified(config.triangles, simplify.most * voxel));
    let mut surface = PartSurface {
        closed: repaired.watertight,
        thickened: repaired.thickened,
        fused: fused.triangles.len(),
        error: simple.error,
        observed: meshes[part].shape().cloned().map(|shape| Seen { shape, reach: voxel, measured: None }),
        ..PartSurface::default()
    };
    let shaded = with_normals(&simple.mesh, settings.crease);
    let extent = bounds(fused).map_or(0.0, |[low, high]| low.distance(high)).max(TINY);
    let of_views = || texel_density(views, fused).unwrap_or(1.0 / voxel).min(settings.atlas.texels / extent);
    let texels_per_unit = config.texel.map_or_else(of_views, |edge| config.scale / edge);
    let options = UnwrapOptions { texels_per_unit, settings: settings.atlas };
    match unwrap(&shaded, &options) {
        Ok(flat) => {
            surface.visual = flat.mesh;
            Shape { surface, atlas: Some(flat.size) }
        }
        Err(reason) => {
            surface.warnings.push(format!("{} keeps vertex colours: {reason}", replica.parts[part].name));
            surface.visual = shaded;
            Shape { surface, atlas: None }
        }
    }
}

/// Length that guards a division.
const TINY: f64 = 1e-12;

/// A photo with the state and the camera in the world.
type Placed<'a> = (State, Camera, Photo<'a>);

/// A view with its state, and the depth that its photo is used with.
type Source<'a> = (State, &'a View, &'a DepthMap);

/// Photos of both states; those whose depth is not of their size are left out.
fn photos<'a>(
    capture: Option<&'a Capture>,
    better: &'a PerState<Vec<Option<DepthMap>>>,
    jump: f64,
    settings: &BakeSettings,
) -> Vec<Placed<'a>> {
    let Some(capture) = capture else { return Vec::new() };
    let of_state = |state: State| {
        let views = capture.states[state].train.iter().zip(&better[state]);
        views.filter_map(move |(v, better)| Some((state, v, better.as_ref().or(v.depth.as_ref())?)))
    };
    let all: Vec<Source> = State::ALL.into_iter().flat_map(of_state).collect();
    let photo = |(state, view, depth): Source<'a>| {
        let photo = Photo::new(&view.rgba, depth, view.camera.intrinsics, (jump, settings))?;
        Some((state, view.camera, photo.with_derived(view.derived.as_ref())))
    };
    all.into_par_iter().filter_map(photo).collect()
}

/// Photos in the frame of a part at the start state.
fn views<'a>(part: usize, replica: &Replica, photos: impl Iterator<Item = &'a Placed<'a>>) -> Vec<BakeView<'a>> {
    let motions = PerState::from_fn(|state| replica.motion_to(part, state));
    photos.map(|(state, camera, photo)| BakeView::new(photo, camera.moved_with(&motions[*state]))).collect()
}

/// Depth in those training views of a state whose measured depth is not enough: of the meshes where there is none, else with derived depth.
fn better_depth(replica: &Replica, meshes: &[Mesh], capture: Option<&Capture>, state: State) -> Vec<Option<DepthMap>> {
    let Some(capture) = capture else { return Vec::new() };
    let views = &capture.states[state].train;
    if views.iter().all(|v| v.depth.is_some()) {
        return views.par_iter().map(|v| v.derived.as_ref().and(v.any_depth()).map(Cow::into_owned)).collect();
    }
    let posed: Vec<Mesh> = meshes.iter().enumerate().map(|(i, m)| m.moved(&replica.motion_to(i, state))).collect();
    let posed: Vec<&Mesh> = posed.iter().collect();
    views.par_iter().map(|v| v.depth.is_none().then(|| depth_of(&v.camera, &posed))).collect()
}

/// Texels per unit that match the photos: pixels per unit at the part's distance, in the nearest view.
fn texel_density(views: &[BakeView], mesh: &Mesh) -> Option<f64> {
    let middle = points(mesh).sum::<DVec3>() / mesh.vertices.len().max(1) as f64;
    let density = |v: &BakeView| v.camera.intrinsics.fx / v.camera.position().distance(middle).max(TINY);
    views.iter().map(density).reduce(f64::max).filter(|d| d.is_finite() && *d > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::topology::testing::open_box;
    use artgs_core::Intrinsics;

    #[test]
    fn a_surface_is_measured_where_most_views_have_depth_of_their_own() {
        // Cameras look along +Z at the lower side of a cube; the left halves of two of their three images are derived.
        let cube = Fused::from(open_box(DVec3::ONE, 8, [true; 6]));
        let k = Intrinsics { fx: 100.0, fy: 100.0, cx: 50.0, cy: 50.0, width: 100, height: 100 };
        let camera = Camera::look_at(k, DVec3::new(0.5, 0.5, -2.0), DVec3::splat(0.5), DVec3::Y);
        let depth = depth_of(&camera, &[cube.mesh()]);
        let rgba = vec![[9, 9, 9, 255]; depth.len()];
        let left = DepthMap::new((0..depth.len()).map(|i| u16::from(i % 100 < 50)).collect(), 1.0);
        let photo =
            |derived| Photo::new(&rgba, &depth, k, (0.1, &BakeSettings::DEFAULT)).unwrap().with_derived(derived);
        let photos = [photo(Some(&left)), photo(Some(&left)), photo(None)];
        let views: Vec<BakeView> = photos.iter().map(|photo| BakeView::new(photo, camera)).collect();
        let options = BakeOptions::at_resolution(0.05, &BakeSettings::DEFAULT);
        let seen = || Seen { shape: cube.shape().unwrap().clone(), reach: 0.05, measured: None };
        let right_of = |x: f64| camera.project(DVec3::new(x, 0.5, 0.0)).0.x > 50.0;
        let places = [0.2, 0.8].map(|x| (DVec3::new(x, 0.5, 0.01), right_of(x)));
        let asked = seen().asked(&views, &options);
        for (place, is_right) in places {
            assert!(asked.holds(place) && asked.measures(place) == is_right, "{place}");
        }
        let none = seen().asked(&views[2..], &options);
        assert!(places.iter().all(|(place, _)| none.measures(*place)), "all depth was measured");
        assert!(!none.measures(DVec3::splat(0.5)), "no surface there");
    }

    /// A cube of which these sides were recorded.
    fn seen_box(sides: [bool; 6]) -> Seen {
        let fused = Fused::from(open_box(DVec3::ONE, 12, sides));
        Seen { shape: fused.shape().unwrap().clone(), reach: 0.01, measured: None }
    }

    #[test]
    fn walls_that_close_an_open_box_are_invented() {
        let whole = open_box(DVec3::ONE, 12, [true; 6]);
        let options = BakeOptions::at_resolution(0.01, &BakeSettings::DEFAULT);
        let of = |sides: [bool; 6]| faces(&whole, &seen_box(sides), &[], &options);
        assert_eq!(shares(&whole, &of([true; 6])).unwrap().seen, 1.0);
        // One side of six was not recorded.
        let evidence = of([true, true, true, true, true, false]);
        let count = evidence.iter().filter(|kind| **kind == FaceEvidence::Invented).count();
        assert_eq!(count, whole.triangles.len() / 6);
        let Evidence { seen, derived, invented } = shares(&whole, &evidence).unwrap();
        assert!((invented - 1.0 / 6.0).abs() < 1e-6 && derived == 0.0 && (seen + invented - 1.0).abs() < 1e-9);
        assert_eq!(shares(&whole, &[]), None);
    }
}
