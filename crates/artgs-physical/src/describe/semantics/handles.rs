//! Handles: what stands out from the front of a moving part, and how a gripper with two fingers holds it.

use super::form::{Form, Sample, samples, span};
use crate::settings::{DescribeSettings, HandleSettings};
use artgs_core::{Asset, Handle, PartClass, Rigid};
use glam::{DMat3, DVec3};

/// Handles of all links, named after them. Only parts that a hand pulls or turns by a handle have some.
pub(crate) fn handles(asset: &Asset, settings: &DescribeSettings) -> Vec<Vec<Handle>> {
    let diagonal = asset.bounds_diagonal();
    let of_handles = &settings.handles;
    let of = |link: &artgs_core::AssetLink| {
        let class = link.semantics.map_or(PartClass::Part, |s| s.class);
        let pulled = matches!(
            class,
            PartClass::Drawer | PartClass::Door | PartClass::SlidingDoor | PartClass::Flap | PartClass::Lid
        );
        let Some(form) = Form::of(link, diagonal, settings).filter(|_| pulled) else { return Vec::new() };
        let front = match class {
            PartClass::SlidingDoor => front_of_sheet(asset, &form),
            _ => form.facing(settings.facing),
        };
        let surface =
            samples(&link.visual.mesh, &Rigid::IDENTITY, of_handles.spacing * of_handles.size_share * diagonal);
        let found = protrusions(&surface, front, diagonal, settings);
        let number = |(k, mut handle): (usize, Handle)| {
            let place = if k == 0 { String::new() } else { format!("_{}", k + 1) };
            handle.name = format!("{}_handle{place}", link.name);
            handle
        };
        found.into_iter().enumerate().map(number).collect()
    };
    asset.links.iter().map(of).collect()
}

/// The face of a sliding door that looks away from the middle of the object.
fn front_of_sheet(asset: &Asset, form: &Form) -> DVec3 {
    let across = form.axis.cross(form.reach);
    let middles = asset
        .links
        .iter()
        .flat_map(|link| link.visual.mesh.vertices.iter().map(|v| link.origin + DVec3::from_array(v.map(f64::from))));
    let (sum, count) = middles.fold((DVec3::ZERO, 0.0), |(sum, count), p| (sum + p, count + 1.0));
    let away = form.middle - sum / f64::max(count, 1.0);
    if away.dot(across) < 0.0 { -across } else { across }
}

/// A height field over the plane across `front`.
struct Heights {
    origin: DVec3,
    right: DVec3,
    up: DVec3,
    cell: f64,
    size: [usize; 2],
    /// Highest sample per cell; none without samples.
    height: Vec<Option<f64>>,
}

impl Heights {
    /// Cells have edges of at least `least_cell`.
    fn of(surface: &[Sample], front: DVec3, least_cell: f64, settings: &DescribeSettings) -> Option<Self> {
        let right = DVec3::Z.cross(front).try_normalize().unwrap_or(DVec3::X);
        let up = front.cross(right);
        let ([x0, x1], [y0, y1]) = (span(surface, right, settings.beyond)?, span(surface, up, settings.beyond)?);
        let cell = ((x1 - x0).max(y1 - y0) / settings.handles.cells as f64).max(least_cell);
        if !(cell > 0.0 && cell.is_finite()) {
            return None;
        }
        let size = [x1 - x0, y1 - y0].map(|side| ((side / cell).ceil() as usize).max(1));
        let mut out =
            Self { origin: right * x0 + up * y0, right, up, cell, size, height: vec![None; size[0] * size[1]] };
        for s in surface {
            let at = s.at - out.origin;
            let [i, j] = [at.dot(right), at.dot(up)].map(|x| (x / cell).floor());
            if i < 0.0 || j < 0.0 || i >= size[0] as f64 || j >= size[1] as f64 {
                continue;
            }
            let cell = &mut out.height[j as usize * size[0] + i as usize];
            *cell = Some(cell.map_or(s.at.dot(front), |h| h.max(s.at.dot(front))));
        }
        Some(out)
    }

    /// Height of the plane that most cells lie in, the outer one of equal ones.
    fn face(&self, step: f64) -> Option<f64> {
        let mut heights: Vec<f64> = self.height.iter().flatten().copied().collect();
        heights.sort_by(f64::total_cmp);
        let within = |i: usize| heights[i..].partition_point(|h| *h <= heights[i] + step);
        let best = (0..heights.len()).max_by_key(|i| within(*i))?;
        Some(heights[best + within(best) / 2])
    }

    /// Connected cells above `level`, as lists of cells.
    fn islands(&self, level: f64) -> Vec<Vec<usize>> {
        let above = |i: usize| self.height[i].is_some_and(|h| h > level);
        let mut taken = vec![false; self.height.len()];
        let mut out = Vec::new();
        for first in 0..self.height.len() {
            if taken[first] || !above(first) {
                continue;
            }
            taken[first] = true;
            let (mut island, mut at) = (vec![first], 0);
            while at < island.len() {
                let (x, y) = (island[at] % self.size[0], island[at] / self.size[0]);
                at += 1;
                for (nx, ny) in [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)] {
                    let next = ny.wrapping_mul(self.size[0]).wrapping_add(nx);
                    if nx < self.size[0] && ny < self.size[1] && !taken[next] && above(next) {
                        taken[next] = true;
                        island.push(next);
                    }
                }
            }
            out.push(island);
        }
        out
    }
}

/// Handles on the side of a surface that looks along `front`, without names, the largest first. Samples and results are in
/// one frame with +Z up.
fn protrusions(surface: &[Sample], front: DVec3, diagonal: f64, settings: &DescribeSettings) -> Vec<Handle> {
    let of_handles = &settings.handles;
    let (depth, size) = (of_handles.depth_share * diagonal, of_handles.size_share * diagonal);
    let Some(field) = Heights::of(surface, front, of_handles.cell * size, settings) else { return Vec::new() };
    let Some(face) = field.face(of_handles.face * depth) else { return Vec::new() };
    let filled = field.height.iter().flatten().count();
    let mut found: Vec<(usize, Handle)> = Vec::new();
    for island in field.islands(face + depth) {
        if island.len() as f64 > of_handles.most_area * filled as f64 {
            continue;
        }
        if let Some(handle) = grasp(&field, &island, (front, face), of_handles).filter(|h| h.length >= size) {
            found.push((island.len(), handle));
        }
    }
    found.sort_by_key(|(cells, _)| std::cmp::Reverse(*cells));
    found.into_iter().take(of_handles.most).map(|(_, handle)| handle).collect()
}

/// The handle over some cells: fingers close across its longer side.
fn grasp(field: &Heights, island: &[usize], (front, face): (DVec3, f64), settings: &HandleSettings) -> Option<Handle> {
    let place = |i: &usize| {
        let (x, y) = ((i % field.size[0]) as f64 + 0.5, (i / field.size[0]) as f64 + 0.5);
        (x * field.cell, y * field.cell)
    };
    let ends = |values: Vec<f64>| {
        let low = values.iter().copied().fold(f64::INFINITY, f64::min) - 0.5 * field.cell;
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max) + 0.5 * field.cell;
        (0.5 * (low + high), high - low)
    };
    let (x, wide) = ends(island.iter().map(|i| place(i).0).collect());
    let (y, tall) = ends(island.iter().map(|i| place(i).1).collect());
    let top = island.iter().filter_map(|i| field.height[*i]).fold(f64::NEG_INFINITY, f64::max);
    let depth = top - face;
    let lies = wide > settings.lying * tall;
    let (closing, width, length) = if lies { (field.up, tall, wide) } else { (field.right, wide, tall) };
    let on_plane = field.origin + field.right * x + field.up * y;
    let translation = on_plane + front * (top - settings.held * depth - on_plane.dot(front));
    let approach = -front;
    let turn = DMat3::from_cols(closing.cross(approach), closing, approach);
    let name = String::new();
    (depth.is_finite()).then(|| Handle { name, frame: Rigid::from_matrix(turn, translation), width, length, depth })
}

#[cfg(test)]
mod tests {
    use super::*;
    use artgs_core::Mesh;

    fn panel_with(parts: &[Mesh]) -> Vec<Handle> {
        let mut mesh = Mesh::cuboid([-0.3, 0.0, 0.0], [0.3, 0.02, 0.4]);
        parts.iter().for_each(|part| mesh.append(part));
        protrusions(&samples(&mesh, &Rigid::IDENTITY, 0.002), DVec3::NEG_Y, 1.0, &DescribeSettings::DEFAULT)
    }

    #[test]
    fn a_bar_is_held_across_and_a_plain_panel_has_no_handle() {
        assert!(panel_with(&[]).is_empty());
        let bar = Mesh::cuboid([-0.1, -0.04, 0.29], [0.1, -0.02, 0.31]);
        let posts = [-0.09f32, 0.08].map(|x| Mesh::cuboid([x, -0.03, 0.295], [x + 0.01, 0.0, 0.305]));
        let [a, b] = posts;
        let found = panel_with(&[bar, a, b]);
        assert_eq!(found.len(), 1);
        let handle = &found[0];
        assert!((handle.frame.translation - DVec3::new(0.0, -0.02, 0.3)).length() < 0.005, "{handle:?}");
        assert!((handle.frame.turn(DVec3::Z) - DVec3::Y).length() < 1e-9);
        assert!(handle.frame.turn(DVec3::Y).z.abs() > 0.999);
        assert!((handle.width - 0.02).abs() < 0.006 && (handle.length - 0.2).abs() < 0.01, "{handle:?}");
        assert!((handle.depth - 0.04).abs() < 0.003, "{handle:?}");
    }

    #[test]
    fn knobs_are_held_from_the_sides_and_a_second_face_is_no_handle() {
        let knobs = [-0.2f32, 0.2].map(|x| Mesh::cuboid([x - 0.01, -0.03, 0.2], [x + 0.01, 0.0, 0.22]));
        let found = panel_with(&knobs);
        assert_eq!(found.len(), 2);
        assert!(found.iter().all(|h| h.frame.turn(DVec3::Y).x.abs() > 0.999), "{found:?}");
        assert!(panel_with(&[Mesh::cuboid([-0.25, -0.03, 0.05], [0.25, 0.0, 0.35])]).is_empty());
    }
}
