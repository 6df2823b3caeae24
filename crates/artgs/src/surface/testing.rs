//! Small scenes with exact depth, for tests.

use artgs_core::{Camera, Intrinsics, Rigid};
use glam::{DVec2, DVec3};

pub(crate) enum Shape {
    Sphere(f64),
    /// Half extents.
    Box(DVec3),
}

/// Solids with the motions that place them; labels are their positions in the list.
pub(crate) struct Scene(pub(crate) Vec<(Shape, Rigid)>);

impl Scene {
    pub(crate) fn sphere(radius: f64) -> Self {
        Self(vec![(Shape::Sphere(radius), Rigid::IDENTITY)])
    }

    /// Nearest hit along `eye + t * direction`: parameter and label.
    fn cast(&self, eye: DVec3, direction: DVec3) -> Option<(f64, u16)> {
        let mut best: Option<(f64, u16)> = None;
        for (label, (shape, place)) in self.0.iter().enumerate() {
            let back = place.inverse();
            let (o, d) = (back.apply(eye), back.turn(direction));
            let hit = match shape {
                Shape::Sphere(r) => {
                    let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - r * r);
                    let q = b * b - a * c;
                    (q >= 0.0).then(|| (-b - q.sqrt()) / a)
                }
                Shape::Box(half) => {
                    let (p, q) = ((-*half - o) / d, (*half - o) / d);
                    let (t0, t1) = (p.min(q).max_element(), p.max(q).min_element());
                    (t0 <= t1).then_some(t0)
                }
            };
            if let Some(t) = hit.filter(|t| *t > 0.0 && best.is_none_or(|b| *t < b.0)) {
                best = Some((t, label as u16));
            }
        }
        best
    }

    /// Planar depth, 0 where nothing is hit, and labels, `u16::MAX` there.
    pub(crate) fn render(&self, camera: &Camera) -> (Vec<f32>, Vec<u16>) {
        let k = camera.intrinsics;
        let eye = camera.position();
        (0..k.width * k.height)
            .map(|i| {
                let pixel = DVec2::new(f64::from(i % k.width) + 0.5, f64::from(i / k.width) + 0.5);
                // The direction has depth 1, so the parameter is the planar depth.
                let hit = self.cast(eye, camera.unproject(pixel, 1.0) - eye);
                hit.map_or((0.0, u16::MAX), |(t, label)| (t as f32, label))
            })
            .unzip()
    }

    pub(crate) fn depth(&self, camera: &Camera) -> Vec<f32> {
        self.render(camera).0
    }
}

/// Cameras spread evenly over a sphere around the origin.
pub(crate) fn orbit(n: usize, size: u32, distance: f64) -> Vec<Camera> {
    let s = f64::from(size);
    let k = Intrinsics { fx: 1.4 * s, fy: 1.4 * s, cx: 0.5 * s, cy: 0.5 * s, width: size, height: size };
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..n)
        .map(|i| {
            let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
            let (r, a) = ((1.0 - z * z).sqrt(), golden * i as f64);
            Camera::look_at(k, DVec3::new(r * a.cos(), r * a.sin(), z) * distance, DVec3::ZERO, DVec3::Z)
        })
        .collect()
}
