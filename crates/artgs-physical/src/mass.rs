//! Mass, centre of mass and inertia of a surface, solid or as a shell.

use crate::geometry::solid::Solid;
use crate::geometry::topology::{bounds, corners, points};
use crate::looks::Wall;
use crate::settings::MassSettings;
use artgs_core::{Inertial, Mesh};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

/// Integrals over a body of density 1.
#[derive(Clone, Copy, Debug)]
struct Moments {
    mass: f64,
    first: DVec3,
    second: DMat3,
}

impl Moments {
    const ZERO: Self = Self { mass: 0.0, first: DVec3::ZERO, second: DMat3::ZERO };

    /// Second moments about the centre, per mass.
    fn covariance(&self) -> DMat3 {
        let center = self.first / self.mass;
        self.second * (1.0 / self.mass) - outer(center, center)
    }

    /// True if a body inside the mesh can have these moments. Self-intersecting surfaces enclose some volume inside out; if
    /// little volume remains, the moments are meaningless.
    fn is_plausible(&self, mesh: &Mesh) -> bool {
        let Some([low, high]) = bounds(mesh) else { return false };
        let (center, c) = (self.first / self.mass, self.covariance());
        let spread = DVec3::new(c.x_axis.x, c.y_axis.y, c.z_axis.z);
        let minor = spread.x * spread.y - c.x_axis.y * c.y_axis.x;
        let definite = spread.x > 0.0 && minor > 0.0 && c.determinant() > 0.0;
        // The variance is largest with half of the mass at each end.
        let fits = spread.cmple(0.25 * (high - low) * (high - low)).all();
        definite && fits && center.cmpge(low).all() && center.cmple(high).all()
    }
}

/// What was observed of the wall at a point of a surface with this outward normal, at most so far behind it; metres.
pub(crate) type Walls<'a> = dyn Fn(DVec3, DVec3, f64) -> Wall + Sync + 'a;

/// A triangle with the wall behind it.
struct Behind {
    area: f64,
    wall: Wall,
    /// Distance of the other side in the closed mesh, at most the thickest wall.
    depth: f64,
}

/// Thickness of the wall for which each triangle of a closed surface stands, metres. Where both sides of a wall were seen,
/// each stands for half of the measured thickness. Where one was, it stands for all of it, as thick as the measured walls of the
/// part typically are, at most `wall`. A surface that only closes the mesh stands for a share `closing` of such a wall, or for
/// nothing where the other side is near. A sealed interior is not solid. `solid` is that of the mesh.
pub(crate) fn walls(
    mesh: &Mesh,
    solid: Option<&Solid>,
    observed: &Walls,
    [wall, closing]: [f64; 2],
    settings: &MassSettings,
) -> Vec<f64> {
    /// Distance, in multiples of `wall`, by which rounding puts the middle of a triangle beside the surface.
    const ROUNDING: f64 = 1e-3;
    let most = settings.thickest * wall;
    let Some(solid) = solid else { return vec![wall; mesh.triangles.len()] };
    let behind = |t: &[u32; 3]| {
        let [a, b, c] = corners(mesh, *t);
        let (middle, cross) = ((a + b + c) / 3.0, (b - a).cross(c - a));
        let normal = cross.normalize_or_zero();
        if normal == DVec3::ZERO {
            return Behind { area: 0.0, wall: Wall::default(), depth: 0.0 };
        }
        let depth = solid.thickness(middle, normal, ROUNDING * wall, most);
        Behind { area: 0.5 * cross.length(), wall: observed(middle, normal, most), depth }
    };
    let triangles: Vec<Behind> = mesh.triangles.par_iter().map(behind).collect();
    let typical = typical(&triangles, settings.measured).map_or(wall, |typical| typical.min(wall));
    let stands_for = |t: &Behind| match t.wall {
        Wall { thickness: Some(thickness), .. } => 0.5 * thickness,
        Wall { seen: true, .. } => typical,
        _ if t.depth >= most => closing * typical,
        _ => 0.0,
    };
    triangles.iter().map(stands_for).collect()
}

/// Median thickness, by area, of the walls of which both sides were seen; none if they are not more than a share `least` of what was seen.
fn typical(triangles: &[Behind], least: f64) -> Option<f64> {
    let seen: f64 = triangles.iter().filter(|t| t.wall.seen).map(|t| t.area).sum();
    let mut both: Vec<(f64, f64)> = triangles.iter().filter_map(|t| Some((t.wall.thickness?, t.area))).collect();
    let total: f64 = both.iter().map(|(_, area)| area).sum();
    both.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut sum = 0.0;
    let median = both.iter().find(|(_, area)| {
        sum += area;
        sum >= 0.5 * total
    });
    median.filter(|_| total > least * seen).map(|(thickness, _)| *thickness)
}

/// Mass and inertia of a link: its walls, of the given thickness per triangle; as a solid if that is less and the surface is
/// closed without invented walls.
/// Lengths in metres, density in kg/m^3. An empty mesh has the least mass.
pub(crate) fn inertial(mesh: &Mesh, closed: bool, walls: &[f64], density: f64, settings: &MassSettings) -> Inertial {
    let least = settings.least_mass;
    let mut moments = shell(mesh, walls);
    let area = shell(mesh, &vec![1.0; mesh.triangles.len()]).mass;
    let wall = if area > 0.0 { moments.mass / area } else { 0.0 };
    if closed {
        let solid = solid(mesh);
        if solid.mass > 0.0 && solid.mass < moments.mass && solid.is_plausible(mesh) {
            moments = solid;
        }
    }
    if moments.mass.is_nan() || moments.mass <= 0.0 {
        return Inertial { mass: least, ..Inertial::default() };
    }
    let mass = (moments.mass * density).max(least);
    let center = moments.first / moments.mass;
    // About the centre, per mass; a body is at least as thick as its walls.
    let covariance = moments.second * (1.0 / moments.mass) - outer(center, center);
    let least_spread = wall * wall / 12.0 * settings.least_thickness;
    let covariance = covariance + DMat3::from_diagonal(DVec3::splat(least_spread));
    let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
    let inertia = (DMat3::IDENTITY * trace - covariance) * mass;
    let (x, y, z) = (inertia.x_axis, inertia.y_axis, inertia.z_axis);
    Inertial { mass, center, inertia: [x.x, y.y, z.z, x.y, x.z, y.z] }
}

fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Integrals over the surface, with the thickness of each triangle.
fn shell(mesh: &Mesh, walls: &[f64]) -> Moments {
    mesh.triangles.iter().map(|t| corners(mesh, *t)).zip(walls).fold(Moments::ZERO, |m, ([a, b, c], wall)| {
        let area = 0.5 * (b - a).cross(c - a).length() * wall;
        let sum = a + b + c;
        let second = outer(sum, sum) + outer(a, a) + outer(b, b) + outer(c, c);
        Moments { mass: m.mass + area, first: m.first + sum * (area / 3.0), second: m.second + second * (area / 12.0) }
    })
}

/// Integrals over the volume inside, as a sum of tetrahedra with one corner in the middle.
fn solid(mesh: &Mesh) -> Moments {
    let n = mesh.vertices.len().max(1) as f64;
    let middle = points(mesh).sum::<DVec3>() / n;
    let about = mesh.triangles.iter().map(|t| corners(mesh, *t)).fold(Moments::ZERO, |m, t| {
        let [a, b, c] = t.map(|p| p - middle);
        let six = a.dot(b.cross(c));
        let sum = a + b + c;
        let second = outer(sum, sum) + outer(a, a) + outer(b, b) + outer(c, c);
        Moments {
            mass: m.mass + six / 6.0,
            first: m.first + sum * (six / 24.0),
            second: m.second + second * (six / 120.0),
        }
    });
    let first = about.first + middle * about.mass;
    let cross = outer(about.first, middle);
    let second = about.second + cross + cross.transpose() + outer(middle, middle) * about.mass;
    Moments { mass: about.mass, first, second }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of one thickness everywhere.
    fn inertial(mesh: &Mesh, closed: bool, wall: f64, density: f64, least: f64) -> Inertial {
        super::inertial(mesh, closed, &vec![wall; mesh.triangles.len()], density, &at_least(least))
    }

    fn at_least(least_mass: f64) -> MassSettings {
        MassSettings { least_mass, ..MassSettings::default() }
    }

    fn walls(mesh: &Mesh, observed: &Walls, wall: f64, closing: f64) -> Vec<f64> {
        super::walls(mesh, Solid::new(mesh, &|_| true).as_ref(), observed, [wall, closing], &MassSettings::default())
    }

    #[test]
    fn walls_are_measured_where_both_sides_were_seen() {
        // A board of 12 mm: seen from both sides, from one, and from one with a narrow side.
        let board = cuboid(DVec3::ZERO, DVec3::new(1.0, 0.5, 0.012));
        let mass = |observed: &Walls| {
            super::inertial(&board, false, &walls(&board, observed, 0.02, 0.5), 1.0, &at_least(1e-6)).mass
        };
        let through = |n: DVec3| DVec3::new(1.0, 0.5, 0.012).dot(n.abs());
        let thickness = |n: DVec3, most: f64| Some(through(n)).filter(|d| *d < most);
        let from_above = |_: DVec3, n: DVec3, _: f64| Wall { seen: n.z > 0.5, thickness: None };
        let from_both = |_: DVec3, n: DVec3, most: f64| Wall { seen: n.z.abs() > 0.5, thickness: thickness(n, most) };
        let in_part = |p: DVec3, n: DVec3, most: f64| Wall {
            seen: n.z > 0.5 || n.z < -0.5 && p.x < 0.5,
            thickness: thickness(n, most).filter(|_| n.z < -0.5 && p.x < 0.5),
        };
        // The narrow sides stand for walls of their own, which are thin.
        let found = [&from_both as &Walls, &from_above, &in_part].map(|observed| mass(observed) / (0.5 * 0.012));
        assert!((1.0..1.1).contains(&found[0]), "{found:?}");
        // As thick as by default, 20 mm.
        assert!((1.66..1.75).contains(&found[1]), "{found:?}");
        // As thick as where it was measured; that place counts from both sides.
        assert!((1.2..1.6).contains(&found[2]), "{found:?}");
        // A closed box with nothing near behind its sides is not solid.
        let body = cuboid(DVec3::ZERO, DVec3::splat(1.0));
        let seen = |_: DVec3, _: DVec3, _: f64| Wall { seen: true, thickness: None };
        let hollow = super::inertial(&body, true, &walls(&body, &seen, 0.02, 0.5), 1.0, &at_least(1e-6)).mass;
        assert!((hollow - 0.12).abs() < 1e-6, "{hollow}");
        let hidden = |_: DVec3, n: DVec3, _: f64| Wall { seen: n.z > -0.5, thickness: None };
        let hollow = super::inertial(&body, true, &walls(&body, &hidden, 0.02, 0.5), 1.0, &at_least(1e-6)).mass;
        assert!((hollow - 0.11).abs() < 1e-6, "{hollow}");
    }

    fn cuboid(low: DVec3, high: DVec3) -> Mesh {
        Mesh::cuboid(low.as_vec3().to_array(), high.as_vec3().to_array())
    }

    #[test]
    fn a_thick_walled_box_is_solid() {
        let mesh = cuboid(DVec3::new(1.0, 2.0, 3.0), DVec3::new(2.0, 4.0, 6.0));
        let found = inertial(&mesh, true, 10.0, 2.0, 0.01);
        // The lower bound on thickness adds to all three moments; this wall is thin enough to ignore it.
        let extra = found.mass * 2.0 * (100.0 / 120.0);
        assert!((found.mass - 12.0).abs() < 1e-5 && (found.center - DVec3::new(1.5, 3.0, 4.5)).length() < 1e-6);
        for (i, want) in [13.0, 10.0, 5.0].iter().enumerate() {
            assert!((found.inertia[i] - extra - want).abs() < 1e-4, "{:?}", found.inertia);
        }
        assert!(found.inertia[3..].iter().all(|x| x.abs() < 1e-4));
    }

    #[test]
    fn a_hollow_cube_weighs_its_walls() {
        let mesh = cuboid(DVec3::splat(-0.5), DVec3::splat(0.5));
        let found = inertial(&mesh, true, 0.01, 600.0, 0.01);
        assert!((found.mass - 36.0).abs() < 1e-4, "{}", found.mass);
        // A thin shell of a cube of edge 1: 5/18 of its mass.
        assert!((found.inertia[0] / found.mass - 5.0 / 18.0).abs() < 1e-4, "{:?}", found.inertia);
        let open = inertial(&mesh, false, 0.01, 600.0, 0.01);
        assert!((open.mass - 36.0).abs() < 1e-4);
    }

    #[test]
    fn a_surface_that_encloses_itself_inside_out_weighs_as_a_shell() {
        let mut mesh = cuboid(DVec3::ZERO, DVec3::ONE);
        let mut inverted = cuboid(DVec3::new(3.0, 0.0, 0.0), DVec3::new(3.99, 1.0, 1.0));
        inverted.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        mesh.append(&inverted);
        let found = inertial(&mesh, true, 1.0, 100.0, 0.01);
        assert!(found.mass > 1000.0 && found.inertia[..3].iter().all(|i| *i > 0.0), "{found:?}");
        assert!((0.0..4.0).contains(&found.center.x));
    }

    #[test]
    fn nothing_and_little_have_mass() {
        assert_eq!(inertial(&Mesh::default(), true, 0.01, 600.0, 0.01).mass, 0.01);
        let tiny = cuboid(DVec3::ZERO, DVec3::splat(1e-3));
        let found = inertial(&tiny, true, 0.01, 600.0, 0.01);
        assert_eq!(found.mass, 0.01);
        assert!(found.inertia[..3].iter().all(|i| *i > 0.0));
    }
}
