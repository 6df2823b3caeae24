use super::scene::Cuboid;
use super::*;
use artgs_core::{Mesh, PerState, Rigid};
use glam::DVec2;

fn small() -> CabinetOptions {
    CabinetOptions { views: 6, test_views: 1, size: 64, principal_offset: [3.0, -2.0], ..Default::default() }
}

/// Distance of a point from a triangle.
fn to_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let inside = [(a, b), (b, c), (c, a)].iter().all(|(s, e)| (e - s).cross(p - s).dot(normal) >= 0.0);
    if inside {
        return (p - a).dot(normal).abs();
    }
    let to_edge = |(s, e): &(DVec3, DVec3)| {
        let t = ((p - s).dot(e - s) / (e - s).length_squared()).clamp(0.0, 1.0);
        (p - s.lerp(*e, t)).length()
    };
    [(a, b), (b, c), (c, a)].iter().map(to_edge).fold(f64::INFINITY, f64::min)
}

fn to_mesh(p: DVec3, mesh: &Mesh) -> f64 {
    let vertex = |i: u32| glam::Vec3::from(mesh.vertices[i as usize]).as_dvec3();
    mesh.triangles.iter().map(|t| to_triangle(p, t.map(vertex))).fold(f64::INFINITY, f64::min)
}

/// Pixel centre and planar depth of every pixel that sees something.
fn seen(view: &View) -> impl Iterator<Item = (usize, DVec2, f64)> {
    let width = view.size().0;
    let depth = view.depth.as_ref().unwrap().iter().enumerate().filter(|(_, d)| *d > 0.0);
    depth.map(move |(i, d)| (i, DVec2::new((i % width) as f64 + 0.5, (i / width) as f64 + 0.5), f64::from(d)))
}

#[test]
fn depth_back_projects_onto_the_true_mesh_of_the_part_seen() {
    let (capture, cabinet) = cabinet_capture(&small()).unwrap();
    let mut pixels = PerState::new([0; 3], [0; 3]);
    for (state, views) in capture.states.enumerate() {
        let meshes: Vec<Mesh> = (0..3).map(|p| cabinet.mesh(p, state)).collect();
        for view in views.train.iter().chain(&views.test) {
            let labels = render(&cabinet, state, &view.camera).labels;
            for (i, pixel, depth) in seen(view) {
                let part = usize::from(labels[i]) - 1;
                let distance = to_mesh(view.camera.unproject(pixel, depth), &meshes[part]);
                assert!(distance < 0.0008, "{} {pixel}: {distance} from part {part}", view.name);
                pixels[state][part] += 1;
            }
        }
    }
    assert!(pixels.iter().flatten().all(|n| *n > 500), "every part is seen: {pixels:?}");
}

#[test]
fn the_whole_cabinet_is_in_every_view_and_fills_it() {
    let options = CabinetOptions { views: 30, test_views: 8, size: 48, ..Default::default() };
    let (capture, _) = cabinet_capture(&options).unwrap();
    for view in capture.states.iter().flat_map(|s| s.train.iter().chain(&s.test)) {
        let alpha = |x: usize, y: usize| view.rgba[y * 48 + x][3];
        let empty = (0..48).all(|i| [alpha(i, 0), alpha(i, 47), alpha(0, i), alpha(47, i)] == [0; 4]);
        assert!(empty, "{} is cut by the border", view.name);
        let covered = view.rgba.iter().filter(|p| p[3] > 127).count();
        assert!(covered > 48 * 48 / 8, "{} shows little: {covered}", view.name);
    }
}

#[test]
fn the_start_mesh_moved_by_the_joint_is_the_end_mesh() {
    let cabinet = Cabinet::new(0);
    for part in 0..3 {
        let motion = cabinet.parts[part].joint.map_or(Rigid::IDENTITY, |j| j.start_to_end());
        let (moved, end) = (cabinet.mesh(part, State::START).moved(&motion), cabinet.mesh(part, State::END));
        for (a, b) in moved.vertices.iter().zip(&end.vertices) {
            assert!((glam::Vec3::from(*a) - glam::Vec3::from(*b)).length() < 1e-6, "part {part}");
        }
        assert_eq!(cabinet.mesh(part, State::START) == end, part == 0, "only the carcass stands still");
    }
}

#[test]
fn moved_points_are_visible_in_the_other_state() {
    let (capture, cabinet) = cabinet_capture(&CabinetOptions { size: 96, ..small() }).unwrap();
    let mut changed = Vec::new();
    for view in &capture.states[State::START].train {
        let start = render(&cabinet, State::START, &view.camera);
        let end = render(&cabinet, State::END, &view.camera);
        for (i, pixel, depth) in seen(view) {
            let part = usize::from(start.labels[i]) - 1;
            let motion = cabinet.parts[part].joint.map_or(Rigid::IDENTITY, |j| j.start_to_end());
            let (uv, z) = view.camera.project(motion.apply(view.camera.unproject(pixel, depth)));
            let (x, y) = (uv.x.floor() as usize, uv.y.floor() as usize);
            // The nearest surface around that pixel may hide the point but can never lie behind it.
            let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| v * 96 + u));
            let nearest = around.map(|j| end.depth[j]).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
            assert!(nearest < z + 0.02, "{} {pixel}: part {part} at {z} but {nearest} is seen", view.name);
        }
        let door = |rendering: &Rendering| rendering.labels.iter().map(|l| *l == 2).collect::<Vec<_>>();
        changed.push(door(&start).iter().zip(door(&end)).filter(|(a, b)| **a != *b).count());
    }
    assert!(changed.iter().filter(|n| **n > 200).count() >= 4, "the door hardly moves, pixels per view: {changed:?}");
}

#[test]
fn mesh_faces_look_outward() {
    let mesh = Cabinet::new(0).mesh(0, State::START);
    let volume: f64 = mesh
        .triangles
        .iter()
        .map(|t| t.map(|i| glam::Vec3::from(mesh.vertices[i as usize]).as_dvec3()))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum();
    let boxes: f64 = Cabinet::new(0).parts[0].cuboids.iter().map(|c| 8.0 * c.half.element_product()).sum();
    assert!((volume - boxes).abs() < 1e-6, "{volume} {boxes}");
}

#[test]
fn boxes_of_the_cabinet_do_not_overlap_in_either_state() {
    let cabinet = Cabinet::new(0);
    for state in State::ALL {
        for part in 1..3 {
            let carcass_from_part = cabinet.pose(0, state).inverse() * cabinet.pose(part, state);
            for c in &cabinet.parts[part].cuboids {
                let corner = |i: u32| c.center + c.half * DVec3::new(sign(i, 1), sign(i, 2), sign(i, 4));
                for p in (0..8).map(corner).map(|p| carcass_from_part.apply(p)) {
                    let inside = |b: &&Cuboid| ((p - b.center).abs() - b.half).max_element() < -1e-9;
                    assert!(cabinet.parts[0].cuboids.iter().find(inside).is_none(), "part {part} {} {p}", state.name());
                }
            }
        }
    }
}

fn sign(bits: u32, bit: u32) -> f64 {
    if bits & bit == 0 { -1.0 } else { 1.0 }
}

#[test]
fn same_seed_same_capture_on_any_number_of_threads() {
    let render_with = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let options = CabinetOptions { seed, depth_noise: 0.01, views: 3, ..small() };
        let (capture, _) = pool.install(|| cabinet_capture(&options)).unwrap();
        capture.states.map(|s| s.train.into_iter().map(|v| (v.rgba, v.depth)).collect::<Vec<_>>())
    };
    assert!(render_with(1, 7) == render_with(3, 7));
    assert!(render_with(1, 7) != render_with(1, 8));
}

#[test]
fn depth_noise_has_the_requested_spread() {
    let (clean, _) = cabinet_capture(&small()).unwrap();
    let (noisy, _) = cabinet_capture(&CabinetOptions { depth_noise: 0.01, ..small() }).unwrap();
    let (a, b) = (&clean.states[State::START].train[0], &noisy.states[State::START].train[0]);
    let errors: Vec<f64> = seen(a).zip(seen(b)).map(|(x, y)| y.2 - x.2).collect();
    let spread = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((spread - 0.01).abs() < 0.001, "{spread}");
}

#[test]
fn the_capture_reads_back_from_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let (capture, _) = write_cabinet(folder.path(), &small()).unwrap();
    let back = artgs_io::load_capture(folder.path()).unwrap();
    assert_eq!(back.warnings, Vec::<String>::new());
    for (a, b) in capture.states.iter().zip(&back.states) {
        assert_eq!((a.train.len(), a.test.len()), (b.train.len(), b.test.len()));
        // The depth of held-out views is not read.
        assert!(a.train.iter().zip(&b.train).all(|(a, b)| a.depth == b.depth && a.depth.is_some()));
        for (a, b) in a.train.iter().chain(&a.test).zip(b.train.iter().chain(&b.test)) {
            assert_eq!(a.name, b.name);
            assert!(a.rgba == b.rgba, "{}", a.name);
            let (ka, kb) = (a.camera.intrinsics, b.camera.intrinsics);
            assert!((ka.fx - kb.fx).abs() < 1e-9 && ka.cx == kb.cx && ka.cy == kb.cy, "{ka:?} {kb:?}");
            let p = DVec3::new(0.3, 0.1, 0.7);
            let (ca, cb) = (a.camera.world_to_camera.apply(p), b.camera.world_to_camera.apply(p));
            assert!((ca - cb).length() < 1e-9, "{ca} {cb}");
        }
    }
}

#[test]
fn the_ground_truth_reads_back_from_its_files() {
    let folder = tempfile::tempdir().unwrap();
    let (_, cabinet) = write_cabinet(folder.path(), &small()).unwrap();
    let truth = artgs_io::load_ground_truth(&folder.path().join("gt")).unwrap();
    assert_eq!(truth.joints.len(), 2);
    for (i, joint) in truth.joints.iter().enumerate() {
        let p = cabinet.pose(i + 1, State::START).apply(DVec3::X);
        assert!((joint.start_to_end().apply(p) - cabinet.pose(i + 1, State::END).apply(DVec3::X)).length() < 1e-9);
        assert!(joint.state_values[State::END] > 0.0);
        for state in State::ALL {
            assert!(truth.movable[i][state] == cabinet.mesh(i + 1, state), "part {i} {}", state.name());
        }
    }
    assert!(truth.fixed[State::START] == cabinet.mesh(0, State::START));
    assert_eq!(truth.whole[State::END].vertices.len(), 8 * (8 + 4 + 8));
}

#[test]
fn impossible_options_are_refused() {
    for options in [
        CabinetOptions { views: 0, ..small() },
        CabinetOptions { size: 4, ..small() },
        CabinetOptions { depth_noise: f64::NAN, ..small() },
        CabinetOptions { principal_offset: [500.0, 0.0], ..small() },
    ] {
        assert!(matches!(cabinet_capture(&options), Err(SynthError::Options(_))), "{options:?}");
    }
}
