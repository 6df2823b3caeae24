//! Where parts are flush: the front of a slide in one plane with the front of its carrier, or with the fronts of closed parts beside
//! it; a panel that turns, on the face of its carrier.

use crate::limits::sweep::Surface;
use crate::settings::FlushSettings;
use artgs_core::{Asset, JointKind};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// The front of a part: the plate that looks where the part opens. Handles stand out of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plate {
    /// Coordinate along the direction in which the part opens, object's frame, all joints at 0.
    pub depth: f64,
    /// Extents along both directions across it.
    across: [[f64; 2]; 2],
}

/// Directions across the one in which a part opens.
fn sides(opens: DVec3) -> [DVec3; 2] {
    let (u, v) = opens.any_orthonormal_pair();
    [u, v]
}

/// Observed points of a link that look in direction `opens`, object's frame, with normals within an angle of the given cosine.
fn facing(asset: &Asset, surfaces: &[Surface], link: usize, opens: DVec3, cosine: f64) -> Vec<DVec3> {
    let origin = asset.links[link].origin;
    surfaces[link].facing(opens, cosine).map(|p| p + origin).collect()
}

/// Depth at which most of the points lie, if at least `least` do: the mean of the fullest interval of length 2 `layer`.
fn fullest(points: &[DVec3], opens: DVec3, layer: f64, least: usize) -> Option<f64> {
    let mut depths: Vec<f64> = points.iter().map(|p| p.dot(opens)).collect();
    depths.sort_by(f64::total_cmp);
    let count = |i: usize| depths.partition_point(|d| *d <= depths[i] + 2.0 * layer) - i;
    let first = (0..depths.len()).max_by(|a, b| count(*a).cmp(&count(*b)).then(b.cmp(a)))?;
    let number = count(first);
    (number >= least).then(|| depths[first..first + number].iter().sum::<f64>() / number as f64)
}

/// The front of a link that slides and opens in direction `opens`; `layer`: distance from a plane within which points lie on it; none
/// with fewer than `least` points.
pub(crate) fn plate(
    asset: &Asset,
    surfaces: &[Surface],
    link: usize,
    opens: DVec3,
    (layer, least): (f64, usize),
    settings: &FlushSettings,
) -> Option<Plate> {
    let points = facing(asset, surfaces, link, opens, settings.facing);
    let depth = fullest(&points, opens, layer, least)?;
    let across = sides(opens).map(|side| {
        let on_plate = points.iter().filter(|p| (p.dot(opens) - depth).abs() <= 2.0 * layer).map(|p| p.dot(side));
        on_plate.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    });
    Some(Plate { depth, across })
}

/// Depth of the front of another link within `reach` of the rim of a plate, between two depths.
pub(crate) fn frame(
    asset: &Asset,
    surfaces: &[Surface],
    link: usize,
    (plate, opens): (&Plate, DVec3),
    (reach, [low, high]): (f64, [f64; 2]),
    (layer, least): (f64, usize),
    settings: &FlushSettings,
) -> Option<f64> {
    let sides = sides(opens);
    let beyond = |p: &DVec3| {
        let outside = sides.iter().zip(plate.across).map(|(side, [low, high])| {
            let x = p.dot(*side);
            (low - x).max(x - high)
        });
        outside.fold(f64::NEG_INFINITY, f64::max)
    };
    let around = facing(asset, surfaces, link, opens, settings.facing);
    let is_around = |p: &DVec3| (low..=high).contains(&p.dot(opens)) && (0.0..reach).contains(&beyond(p));
    let around: Vec<DVec3> = around.into_iter().filter(is_around).collect();
    fullest(&around, opens, layer, least)
}

/// Links that slide in the same direction on the same carrier; the cosine between their axes is above `parallel`.
pub(crate) fn beside(asset: &Asset, link: usize, parallel: f64) -> impl Iterator<Item = usize> {
    let slides = |i: usize| asset.links[i].joint.filter(|joint| joint.kind == JointKind::Prismatic);
    (0..asset.links.len()).filter(move |other| {
        let axes = slides(link).zip(slides(*other));
        *other != link
            && asset.links[*other].parent == asset.links[link].parent
            && axes.is_some_and(|(a, b)| a.axis.dot(b.axis) > parallel)
    })
}

/// Joint values, up to half a turn or more from 0, at which a part that turns lies as a panel on the face of its carrier: parallel to it, over it, and at its
/// border. Without values if one of both is no box. `layer`: how far the panel may be from the face.
pub(crate) fn folded(
    asset: &Asset,
    surfaces: &[Surface],
    link: usize,
    layer: f64,
    settings: &FlushSettings,
) -> Vec<f64> {
    let Some((joint, parent)) = asset.links[link].joint.zip(asset.links[link].parent) else { return Vec::new() };
    let across = joint.axis.any_orthonormal_pair();
    let turned = |own: &Surface| faces(own, joint.axis, across, settings);
    let Some((own, carrier)) = turned(&surfaces[link]).zip(turned(&surfaces[parent])) else { return Vec::new() };
    let from_pivot = asset.links[parent].origin - asset.links[link].origin;
    let sides = DVec2::from_angle(carrier);
    let extents = |points: &mut dyn Iterator<Item = DVec3>, side: DVec2| {
        extents(points, joint.axis, across, side, settings.beyond)
    };
    let of_carrier = extents(&mut surfaces[parent].visible().map(|p| p + from_pivot), sides);
    let quarter = |k: i32| carrier - own + f64::from(k) * FRAC_PI_2;
    let is_panel_on_face = |angle: f64| {
        // The part turned by an angle, seen from the carrier, is the part seen from sides that are turned back.
        let of_part = extents(&mut surfaces[link].visible(), DVec2::from_angle(carrier - angle));
        of_part.zip(of_carrier).is_some_and(|(part, carrier)| lies_on(&part, &carrier, layer, settings.over))
    };
    (-2..=2).map(quarter).filter(|angle| is_panel_on_face(*angle)).collect()
}

/// Angle about an axis of the faces of a box, modulo a quarter turn; none if the observed faces along the axis are not those of a box.
fn faces(surface: &Surface, axis: DVec3, across: (DVec3, DVec3), settings: &FlushSettings) -> Option<f64> {
    let (mut sum, mut count) = (DVec2::ZERO, 0.0);
    for normal in surface.normals().filter(|n| n.dot(axis).abs() < settings.along) {
        let angle = normal.dot(across.1).atan2(normal.dot(across.0));
        (sum, count) = (sum + DVec2::from_angle(4.0 * angle), count + 1.0);
    }
    (sum.length() > settings.boxlike * count).then(|| 0.25 * sum.to_angle())
}

/// Intervals along the two sides and along the axis that hold the points but for a share `beyond` at each end; none without points.
fn extents(
    points: impl Iterator<Item = DVec3>,
    axis: DVec3,
    across: (DVec3, DVec3),
    side: DVec2,
    beyond: f64,
) -> Option<[[f64; 2]; 3]> {
    let at = |side: DVec2| across.0 * side.x + across.1 * side.y;
    let directions = [at(side), at(side.perp()), axis];
    let points: Vec<DVec3> = points.collect();
    let beyond = (beyond * points.len() as f64) as usize;
    let interval = |direction: DVec3| {
        let mut along: Vec<f64> = points.iter().map(|p| p.dot(direction)).collect();
        along.sort_by(f64::total_cmp);
        [along[beyond], along[along.len() - 1 - beyond]]
    };
    (!points.is_empty()).then(|| directions.map(interval))
}

/// True if the thinner side of a panel is at the border of a carrier and more than a share `over` of its other extents is over it.
fn lies_on(part: &[[f64; 2]; 3], carrier: &[[f64; 2]; 3], layer: f64, over: f64) -> bool {
    let length = |[low, high]: [f64; 2]| high - low;
    let thin = usize::from(length(part[1]) < length(part[0]));
    let is_over = |side: usize| {
        let ([low, high], of) = (part[side], carrier[side]);
        high.min(of[1]) - low.max(of[0]) > over * length([low, high])
    };
    let [low, high] = part[thin];
    let is_at = |border: f64| (low - layer..=high + layer).contains(&border);
    is_over(1 - thin) && is_over(2) && carrier[thin].into_iter().any(is_at)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::solid::Solid;
    use crate::settings::SweepSettings;
    use artgs_core::{AssetJoint, AssetLink, Mesh, PerState};

    fn surface(low: [f32; 3], high: [f32; 3]) -> Surface {
        Surface::of(
            Solid::new(&Mesh::cuboid(low, high), &|_| true).as_ref(),
            &|_| true,
            0.01,
            &SweepSettings::default(),
        )
    }

    /// A box, and a door about its left front edge that is open by `angle` at joint value 0 and opens in positive direction.
    fn with_door(angle: f64, wide: f32) -> (Asset, Vec<Surface>) {
        let joint = AssetJoint {
            kind: JointKind::Revolute,
            axis: DVec3::NEG_Z,
            pitch: 0.0,
            limits: [0.0, 1.0],
            observed: PerState::new(0.0, 1.0),
            effort: 1.0,
            velocity: 1.0,
            damping: 0.0,
            friction: 0.0,
        };
        let door = AssetLink {
            parent: Some(0),
            joint: Some(joint),
            origin: DVec3::new(-0.3, 0.0, 0.0),
            ..AssetLink::default()
        };
        let closed = Mesh::cuboid([0.0, -0.03, 0.1], [wide, 0.0, 0.9]);
        let turn = glam::DQuat::from_axis_angle(joint.axis, angle);
        let vertices =
            closed.vertices.iter().map(|v| (turn * DVec3::from_array(v.map(f64::from))).as_vec3().to_array());
        let open = Mesh { vertices: vertices.collect(), ..closed.clone() };
        let open = Surface::of(Solid::new(&open, &|_| true).as_ref(), &|_| true, 0.01, &SweepSettings::default());
        let asset = Asset { links: vec![AssetLink::default(), door], ..Asset::default() };
        (asset, vec![surface([-0.3, 0.0, 0.0], [0.3, 0.5, 1.0]), open])
    }

    #[test]
    fn a_door_is_flush_where_it_closes_and_nowhere_else() {
        for angle in [0.0, 0.2, 0.9, 1.7, 2.6] {
            let (asset, surfaces) = with_door(angle, 0.6);
            let found = folded(&asset, &surfaces, 1, 0.01, &FlushSettings::default());
            assert!(found.iter().any(|v| (v + angle).abs() < 0.01), "{angle}: {found:?}");
            // Opened by a quarter turn it stands before the box, by half a turn beside it.
            assert!(found.iter().all(|v| !(0.01..3.2).contains(&(v + angle))), "{angle}: {found:?}");
        }
    }

    #[test]
    fn what_is_round_is_never_flush() {
        let (asset, mut surfaces) = with_door(0.9, 0.6);
        let around = |k: usize| DVec2::from_angle(k as f64 * std::f64::consts::TAU / 48.0);
        let mut mesh = Mesh::default();
        for k in 0..48 {
            let ring = [around(k), around(k + 1)].map(|p| [0.3 * p.x as f32, 0.3 * p.y as f32]);
            let base = mesh.vertices.len() as u32;
            mesh.vertices.extend([0.0, 1.0].iter().flat_map(|z| ring.iter().map(move |p| [p[0], p[1], *z])));
            mesh.triangles.extend([[base, base + 1, base + 2], [base + 2, base + 1, base + 3]]);
        }
        surfaces[0] = Surface::of(Solid::new(&mesh, &|_| true).as_ref(), &|_| true, 0.01, &SweepSettings::default());
        assert_eq!(folded(&asset, &surfaces, 1, 0.01, &FlushSettings::default()), Vec::<f64>::new());
    }
}
