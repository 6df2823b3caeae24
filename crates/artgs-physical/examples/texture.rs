//! Compares closed, simplified, textured parts with the photos of the capture.
//!
//! `cargo run --release -p artgs-physical --example texture -- REPLICA CAPTURE OUT [budget]`
//! writes an OBJ, an MTL and a PNG per part, `compare.png` (photo, textured mesh, shaded mesh; two cameras per state) and
//! `back.png` (from a direction without cameras).
#![allow(clippy::print_stdout, missing_docs)]

use anyhow::{Context, Result};
use artgs_core::{Camera, Capture, Mesh, Replica, State, Texture, TexturedMesh, View};
use artgs_physical::PhysicalConfig;
use artgs_physical::looks::bake::visible;
use artgs_physical::looks::surfaces;
use glam::{DVec3, Vec2, Vec3};
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [replica_dir, capture_dir, out, rest @ ..] = arguments.as_slice() else {
        anyhow::bail!("usage: texture REPLICA CAPTURE OUT [triangles per part]");
    };
    let budget = rest.first().map_or(Ok(20_000), |b| b.parse()).context("the budget is a number of triangles")?;
    let (replica_dir, out) = (PathBuf::from(replica_dir), PathBuf::from(out));
    let replica = artgs_io::read_replica(&replica_dir)?;
    let capture = artgs_io::load_capture(Path::new(capture_dir))?;
    let mut meshes = Vec::new();
    for part in &replica.parts {
        meshes.push(artgs_io::read_mesh_ply(&replica_dir.join(&part.meshes[State::START]))?);
    }
    let clock = Instant::now();
    let config = PhysicalConfig { triangles: budget, ..PhysicalConfig::default() };
    let made = surfaces(&replica, &meshes, Some(&capture), &config);
    println!("all parts in {:.2?}", clock.elapsed());
    let mut parts = Vec::new();
    for (part, surface) in replica.parts.iter().zip(made) {
        let [texels, seen] = surface.texels;
        println!(
            "{}: {} -> {} triangles, closed {}, error max {:.5} 99% {:.5} mean {:.6}, {texels} texels, {seen} seen",
            part.name,
            surface.fused,
            surface.visual.mesh.triangles.len(),
            surface.closed,
            surface.error.max,
            surface.error.most,
            surface.error.mean
        );
        surface.warnings.iter().for_each(|warning| println!("  {warning}"));
        write_obj(&out, &format!("part_{}", part.id), &surface.visual)?;
        parts.push(surface.visual);
    }
    compare(&out, &replica, &capture, &parts)
}

fn write_obj(out: &Path, name: &str, mesh: &TexturedMesh) -> Result<()> {
    let texture = mesh.texture.as_ref().context("a part has no texture")?;
    artgs_io::image_io::write_rgb(&out.join(format!("{name}.png")), texture.width, texture.height, &texture.rgb)?;
    let material = format!("newmtl {name}\nKd 1 1 1\nmap_Kd {name}.png\n");
    artgs_io::write_atomic(&out.join(format!("{name}.mtl")), material.as_bytes())?;
    let mut obj = format!("mtllib {name}.mtl\nusemtl {name}\n");
    for i in 0..mesh.mesh.vertices.len() {
        let ([x, y, z], [a, b, c], [u, v]) = (mesh.mesh.vertices[i], mesh.normals[i], mesh.uvs[i]);
        writeln!(obj, "v {x} {y} {z}\nvn {a:.4} {b:.4} {c:.4}\nvt {u} {}", 1.0 - v)?;
    }
    for t in &mesh.mesh.triangles {
        let [a, b, c] = t.map(|i| i + 1);
        writeln!(obj, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?;
    }
    Ok(artgs_io::write_atomic(&out.join(format!("{name}.obj")), obj.as_bytes())?)
}

/// Two cameras of each state, a row each: photo, textured, shaded.
fn compare(out: &Path, replica: &Replica, capture: &Capture, parts: &[TexturedMesh]) -> Result<()> {
    let moved = |state: State| -> Vec<TexturedMesh> {
        let at = |id: usize| replica.motion_to(id, state);
        let one = |(id, part): (usize, &TexturedMesh)| {
            let turn = |n: &[f32; 3]| at(id).turn(DVec3::from_array(n.map(f64::from))).as_vec3().to_array();
            let normals = part.normals.iter().map(turn).collect();
            TexturedMesh { mesh: part.mesh.moved(&at(id)), normals, ..part.clone() }
        };
        parts.iter().enumerate().map(one).collect()
    };
    let mut rows = Vec::new();
    for state in State::ALL {
        let meshes = moved(state);
        let views = &capture.states[state].train;
        for view in [facing(views), &views[views.len() / 3]] {
            let (w, h) = view.size();
            let camera = view.camera.resized(2 * w as u32, 2 * h as u32);
            let photo = (0..4 * w * h).map(|i| over_grey(view.rgba[i / (2 * w) / 2 * w + i % (2 * w) / 2])).collect();
            rows.push(vec![photo, draw(&camera, &meshes, true), draw(&camera, &meshes, false)]);
        }
    }
    let (w, h) = capture.states[State::START].train[0].size();
    write_rows(&out.join("compare.png"), 2 * w, 2 * h, &rows)?;

    let meshes = moved(State::END);
    let view = facing(&capture.states[State::END].train);
    let middle = parts[0].mesh.vertices.iter().map(|v| Vec3::from_array(*v)).sum::<Vec3>().as_dvec3()
        / parts[0].mesh.vertices.len() as f64;
    let eye = view.camera.position() - middle;
    let around = |eye: DVec3| {
        Camera::look_at(view.camera.resized(2 * w as u32, 2 * h as u32).intrinsics, middle + eye, middle, DVec3::Z)
    };
    let cameras = [around(DVec3::new(-eye.x, -eye.y, eye.z)), around(DVec3::new(eye.x, eye.y, -1.2 * eye.length()))];
    let rows: Vec<_> = cameras.iter().map(|c| vec![draw(c, &meshes, true), draw(c, &meshes, false)]).collect();
    write_rows(&out.join("back.png"), 2 * w, 2 * h, &rows)
}

/// The view in which the object covers the most pixels: it shows the front.
fn facing(views: &[View]) -> &View {
    let cover = |v: &&View| v.rgba.iter().filter(|p| p[3] > 0).count();
    views.iter().max_by_key(cover).unwrap_or(&views[0])
}

fn over_grey([r, g, b, a]: [u8; 4]) -> [u8; 3] {
    [r, g, b].map(|c| ((u32::from(c) * u32::from(a) + 60 * (255 - u32::from(a))) / 255) as u8)
}

/// Renders the meshes with texture or in grey; the inside of surfaces is magenta.
fn draw(camera: &Camera, meshes: &[TexturedMesh], textured: bool) -> Vec<[u8; 3]> {
    let plain: Vec<&Mesh> = meshes.iter().map(|m| &m.mesh).collect();
    let color = |hit: &artgs_physical::looks::bake::Hit| -> [u8; 3] {
        let mesh = &meshes[hit.mesh];
        let t = mesh.mesh.triangles[hit.triangle].map(|v| v as usize);
        let mix3 = |of: &[[f32; 3]]| (0..3).map(|k| Vec3::from_array(of[t[k]]) * hit.weights[k]).sum::<Vec3>();
        let [a, b, c] = t.map(|v| Vec3::from_array(mesh.mesh.vertices[v]));
        let ray = (camera.position().as_vec3() - mix3(&mesh.mesh.vertices)).normalize();
        if (b - a).cross(c - a).dot(ray) < 0.0 {
            return [255, 0, 255];
        }
        if !textured {
            let light = mix3(&mesh.normals).normalize_or_zero().dot((ray + Vec3::new(0.3, 0.1, 0.5)).normalize());
            return [(40.0 + 200.0 * light.max(0.0)) as u8; 3];
        }
        let uv = (0..3).map(|k| Vec2::from_array(mesh.uvs[t[k]]) * hit.weights[k]).sum();
        mesh.texture.as_ref().map_or([0; 3], |texture| bilinear(texture, uv))
    };
    visible(camera, &plain).iter().map(|h| h.as_ref().map_or([60; 3], color)).collect()
}

fn bilinear(texture: &Texture, uv: Vec2) -> [u8; 3] {
    let (w, h) = (texture.width as usize, texture.height as usize);
    let p = (uv * Vec2::new(w as f32, h as f32) - 0.5).max(Vec2::ZERO);
    let (x, y) = ((p.x as usize).min(w - 1), (p.y as usize).min(h - 1));
    let at = |x: usize, y: usize| Vec3::from_array(texture.rgb[y.min(h - 1) * w + x.min(w - 1)].map(f32::from));
    let top = at(x, y).lerp(at(x + 1, y), p.x.fract());
    top.lerp(at(x, y + 1).lerp(at(x + 1, y + 1), p.x.fract()), p.y.fract()).to_array().map(|c| c.round() as u8)
}

fn write_rows(path: &Path, width: usize, height: usize, rows: &[Vec<Vec<[u8; 3]>>]) -> Result<()> {
    let columns = rows[0].len();
    let mut pixels = Vec::with_capacity(rows.len() * columns * width * height);
    for row in rows {
        for y in 0..height {
            row.iter().for_each(|image| pixels.extend(&image[y * width..(y + 1) * width]));
        }
    }
    artgs_io::image_io::write_rgb(path, (columns * width) as u32, (rows.len() * height) as u32, &pixels)?;
    Ok(())
}
