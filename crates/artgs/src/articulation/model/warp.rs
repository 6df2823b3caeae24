//! Dual-quaternion blending: canonical Gaussians to the two observed states, and back with gradients.
//!
//! With part weights `w_k` and half motions `(q_k, d_k)`, conjugated for the start,
//! `b = sum w_k q_k`, `e = sum w_k d_k`, `r = b / |b|`, `s = e / |b|`,
//! `x_t = R(r) x + 2 vec(s conj(r))`, `rotation_t = r rotation`.

use super::quaternion::{Quat, Vec3, conjugate, cross, dot, matrix, multiply, vector};
use artgs_core::{Rigid, State};
use rayon::prelude::*;

/// Gaussians per task. Fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 1024;
/// Least length of a sum of weighted motions that is divided by it.
pub(crate) const LENGTH_MIN: f64 = 1e-12;

/// A rigid motion as two quaternions (w, x, y, z), or the gradient with respect to one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DualQuaternion {
    /// Real part, of unit length for a motion.
    pub real: [f64; 4],
    /// Dual part `(0, t) real / 2`.
    pub dual: [f64; 4],
}

impl DualQuaternion {
    /// The motion that moves nothing.
    pub const IDENTITY: Self = Self { real: [1.0, 0.0, 0.0, 0.0], dual: [0.0; 4] };

    /// Of a half motion from the canonical state to the end: the one that leads to `state`. Also takes gradients back.
    fn towards(self, state: State) -> Self {
        if state == State::END { self } else { Self { real: conjugate(self.real), dual: conjugate(self.dual) } }
    }

    /// The same motion after the world has been shifted by `by`: `dual + (0, by x vec(real))`.
    pub fn shifted(mut self, by: [f64; 3]) -> Self {
        let moved = cross(by, vector(self.real));
        (0..3).for_each(|a| self.dual[a + 1] += moved[a]);
        self
    }

    /// Gradient by a motion from that by the motion [`shifted`](Self::shifted) by `by`.
    pub fn shifted_vjp(mut self, by: [f64; 3]) -> Self {
        let through = cross(vector(self.dual), by);
        (0..3).for_each(|a| self.real[a + 1] += through[a]);
        self
    }

    pub(crate) fn add_scaled(&mut self, other: &Self, scale: f64) {
        for c in 0..4 {
            self.real[c] += scale * other.real[c];
            self.dual[c] += scale * other.dual[c];
        }
    }

    fn dot(&self, other: &Self) -> f64 {
        dot(self.real, other.real) + dot(self.dual, other.dual)
    }
}

impl From<Rigid> for DualQuaternion {
    fn from(motion: Rigid) -> Self {
        let (real, dual) = motion.dual_quaternion();
        Self { real, dual }
    }
}

/// How Gaussians hang on parts.
#[derive(Clone, Copy, Debug)]
pub enum Skin<'a> {
    /// `[n][K]`, row-major; need not sum to one.
    Weights(&'a [f32]),
    /// One part per Gaussian.
    Labels(&'a [u16]),
}

/// What is warped, and to where.
#[derive(Clone, Copy, Debug)]
pub struct WarpInput<'a> {
    /// Canonical centres, `[n]`.
    pub means: &'a [[f32; 3]],
    /// Canonical rotations (w, x, y, z), `[n]`, not normalised.
    pub rotations: &'a [[f32; 4]],
    /// Parts of the Gaussians.
    pub skin: Skin<'a>,
    /// Half motions from the canonical state to the end, `[K]`; part 0 is the identity.
    pub motions: &'a [DualQuaternion],
    /// Where the Gaussians are moved to.
    pub state: State,
}

/// Where [`Warp::backward`] writes; everything is overwritten.
#[derive(Debug)]
pub struct WarpGradients<'a> {
    /// By canonical centres, `[n]`.
    pub means: &'a mut [[f32; 3]],
    /// By canonical rotations, `[n]`.
    pub rotations: &'a mut [[f32; 4]],
    /// By weights, `[n][K]`; not for [`Skin::Labels`].
    pub weights: Option<&'a mut [f32]>,
    /// By half motions, `[K]`, the static part included.
    pub motions: &'a mut [DualQuaternion],
}

/// The warp with its scratch memory.
#[derive(Clone, Debug)]
pub struct Warp {
    /// True: the derivative of the equations above. False, as published: centres receive the gradient of the warped
    /// centres unrotated, and the gradient of rotations reaches neither motions nor weights.
    pub exact: bool,
    partial: Vec<DualQuaternion>,
}

/// The motion of one Gaussian: unit real part, dual part over the same length, that length.
struct Blend {
    r: Quat,
    s: Quat,
    length: f64,
}

impl Blend {
    fn new(sum: DualQuaternion) -> Self {
        let length = dot(sum.real, sum.real).sqrt().max(LENGTH_MIN);
        Self { r: sum.real.map(|c| c / length), s: sum.dual.map(|c| c / length), length }
    }

    fn apply(&self, x: Vec3) -> Vec3 {
        let rows = matrix(self.r);
        let t = vector(multiply(self.s, conjugate(self.r)));
        std::array::from_fn(|i| dot(rows[i], x) + 2.0 * t[i])
    }

    /// `R(r)^T g`.
    fn turn_back(&self, g: Vec3) -> Vec3 {
        let rows = matrix(self.r);
        std::array::from_fn(|i| rows[0][i] * g[0] + rows[1][i] * g[1] + rows[2][i] * g[2])
    }

    /// Gradient by the blended sums, from those by the warped centre and by `r` otherwise.
    fn vjp(&self, x: Vec3, g: Vec3, mut g_r: Quat) -> DualQuaternion {
        let (w, v) = (self.r[0], vector(self.r));
        let (sw, sv) = (self.s[0], vector(self.s));
        let (vx, xg, vg, gs) = (cross(v, x), cross(x, g), cross(v, g), cross(g, sv));
        let (g_v, v_x, g_x) = (dot(g, v), dot(v, x), dot(g, x));
        g_r[0] += 2.0 * dot(g, vx) + 2.0 * dot(g, sv);
        for i in 0..3 {
            g_r[i + 1] += 2.0 * (w * xg[i] + g[i] * v_x + x[i] * g_v - 2.0 * v[i] * g_x) - 2.0 * (sw * g[i] + gs[i]);
        }
        let g_s = [-2.0 * g_v, 2.0 * (w * g[0] - vg[0]), 2.0 * (w * g[1] - vg[1]), 2.0 * (w * g[2] - vg[2])];
        let radial = dot(self.r, g_r) + dot(self.s, g_s);
        DualQuaternion {
            real: std::array::from_fn(|i| (g_r[i] - self.r[i] * radial) / self.length),
            dual: g_s.map(|c| c / self.length),
        }
    }
}

impl Skin<'_> {
    fn blend(&self, i: usize, motions: &[DualQuaternion]) -> Blend {
        match self {
            Skin::Labels(labels) => Blend::new(motions[labels[i] as usize]),
            Skin::Weights(weights) => {
                let mut sum = DualQuaternion::default();
                for (motion, &w) in motions.iter().zip(&weights[i * motions.len()..]) {
                    sum.add_scaled(motion, f64::from(w));
                }
                Blend::new(sum)
            }
        }
    }
}

impl WarpInput<'_> {
    fn check(&self) {
        let n = self.means.len();
        let held = match self.skin {
            Skin::Weights(w) => w.len() / self.motions.len().max(1),
            Skin::Labels(l) => l.len(),
        };
        assert!(n == self.rotations.len() && n == held, "means, rotations and skin must have one entry per Gaussian");
    }

    fn motions_to_state(&self) -> Vec<DualQuaternion> {
        self.motions.iter().map(|m| m.towards(self.state)).collect()
    }
}

impl Warp {
    /// See [`Warp::exact`].
    pub fn new(exact: bool) -> Self {
        Self { exact, partial: Vec::new() }
    }

    /// Centres and rotations at the state, `[n]` each.
    pub fn forward(&self, input: &WarpInput, means_t: &mut [[f32; 3]], rotations_t: &mut [[f32; 4]]) {
        input.check();
        let motions = input.motions_to_state();
        means_t.par_chunks_mut(CHUNK).zip(rotations_t.par_chunks_mut(CHUNK)).enumerate().for_each(|(c, (xs, qs))| {
            for (offset, (x, q)) in xs.iter_mut().zip(qs).enumerate() {
                let i = c * CHUNK + offset;
                let blend = input.skin.blend(i, &motions);
                *x = blend.apply(input.means[i].map(f64::from)).map(|c| c as f32);
                *q = multiply(blend.r, input.rotations[i].map(f64::from)).map(|c| c as f32);
            }
        });
    }

    /// Gradients of a loss from those by the warped centres and rotations.
    pub fn backward(
        &mut self,
        input: &WarpInput,
        d_means_t: &[[f32; 3]],
        d_rotations_t: &[[f32; 4]],
        out: WarpGradients,
    ) {
        input.check();
        let (n, parts, exact) = (input.means.len(), input.motions.len(), self.exact);
        let motions = input.motions_to_state();
        self.partial.clear();
        self.partial.resize(n.div_ceil(CHUNK) * parts, DualQuaternion::default());
        let mut none: [f32; 0] = [];
        let (weights, stride) = match (out.weights, input.skin) {
            (Some(w), Skin::Weights(_)) => (w, parts),
            _ => (&mut none[..], 0),
        };
        let weight_chunks: Vec<&mut [f32]> = if stride > 0 {
            weights.chunks_mut(CHUNK * stride).collect()
        } else {
            (0..n.div_ceil(CHUNK)).map(|_| Default::default()).collect()
        };
        (
            out.means.par_chunks_mut(CHUNK),
            out.rotations.par_chunks_mut(CHUNK),
            weight_chunks,
            self.partial.par_chunks_mut(parts.max(1)),
        )
            .into_par_iter()
            .enumerate()
            .for_each(|(c, (d_means, d_rotations, d_weights, partial))| {
                for offset in 0..d_means.len() {
                    let i = c * CHUNK + offset;
                    let (x, q) = (input.means[i].map(f64::from), input.rotations[i].map(f64::from));
                    let (g, g_q) = (d_means_t[i].map(f64::from), d_rotations_t[i].map(f64::from));
                    let blend = input.skin.blend(i, &motions);
                    let (d_mean, g_r) =
                        if exact { (blend.turn_back(g), multiply(g_q, conjugate(q))) } else { (g, [0.0; 4]) };
                    d_means[offset] = d_mean.map(|c| c as f32);
                    d_rotations[offset] = multiply(conjugate(blend.r), g_q).map(|c| c as f32);
                    let d_sum = blend.vjp(x, g, g_r);
                    match input.skin {
                        Skin::Labels(labels) => partial[labels[i] as usize].add_scaled(&d_sum, 1.0),
                        Skin::Weights(w) => {
                            for k in 0..parts {
                                partial[k].add_scaled(&d_sum, f64::from(w[i * parts + k]));
                            }
                            for (k, d) in d_weights.iter_mut().skip(offset * stride).take(stride).enumerate() {
                                *d = motions[k].dot(&d_sum) as f32;
                            }
                        }
                    }
                }
            });
        for (k, total) in out.motions.iter_mut().enumerate() {
            let mut sum = DualQuaternion::default();
            self.partial.iter().skip(k).step_by(parts).for_each(|p| sum.add_scaled(p, 1.0));
            *total = sum.towards(input.state);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::normal;
    use glam::DVec3;
    use rand_pcg::Pcg64Mcg;

    const N: usize = 7;
    const K: usize = 3;

    struct Case {
        means: Vec<[f32; 3]>,
        rotations: Vec<[f32; 4]>,
        weights: Vec<f32>,
        motions: Vec<DualQuaternion>,
        g_means: Vec<[f32; 3]>,
        g_rotations: Vec<[f32; 4]>,
    }

    fn case() -> Case {
        let mut rng = Pcg64Mcg::new(7);
        let mut draw = || normal(&mut rng) as f32;
        let axis = DVec3::new(0.2, 0.9, -0.4).normalize();
        Case {
            means: (0..N).map(|_| [draw(), draw(), draw()]).collect(),
            rotations: (0..N).map(|_| [draw(), draw(), draw(), draw()]).collect(),
            weights: (0..N * K).map(|_| draw().abs() + 0.1).collect(),
            motions: vec![
                DualQuaternion::IDENTITY,
                Rigid::about(axis, DVec3::new(0.3, 0.2, 0.5), 0.7).into(),
                Rigid::shift(DVec3::new(0.2, -0.3, 0.1)).into(),
            ],
            g_means: (0..N).map(|_| [draw(), draw(), draw()]).collect(),
            g_rotations: (0..N).map(|_| [draw(), draw(), draw(), draw()]).collect(),
        }
    }

    /// The loss in f64, straight from the equations, with the matrix product instead of any of the code above.
    fn loss(c: &Case, state: State) -> f64 {
        let mut total = 0.0;
        for i in 0..N {
            let (mut real, mut dual) = ([0.0; 4], [0.0; 4]);
            for (k, m) in c.motions.iter().enumerate() {
                for j in 0..4 {
                    let sign = if state == State::START && j > 0 { -1.0 } else { 1.0 };
                    real[j] += f64::from(c.weights[i * K + k]) * m.real[j] * sign;
                    dual[j] += f64::from(c.weights[i * K + k]) * m.dual[j] * sign;
                }
            }
            let rigid = Rigid::from_dual_quaternion(real, dual);
            let x = rigid.apply(DVec3::from_array(c.means[i].map(f64::from)));
            let q = c.rotations[i].map(f64::from);
            let turned = rigid.rotation * glam::DQuat::from_xyzw(q[1], q[2], q[3], q[0]);
            let turned = [turned.w, turned.x, turned.y, turned.z];
            total += x.dot(DVec3::from_array(c.g_means[i].map(f64::from)));
            total += dot(turned, c.g_rotations[i].map(f64::from));
        }
        total
    }

    fn input(c: &Case, state: State) -> WarpInput<'_> {
        let skin = Skin::Weights(&c.weights);
        WarpInput { means: &c.means, rotations: &c.rotations, skin, motions: &c.motions, state }
    }

    type Gradients = (Vec<[f32; 3]>, Vec<[f32; 4]>, Vec<f32>, Vec<DualQuaternion>);

    fn gradients(input: &WarpInput, c: &Case, exact: bool) -> Gradients {
        let (mut m, mut r) = (vec![[9.0; 3]; N], vec![[9.0; 4]; N]);
        let (mut w, mut d) = (vec![9.0; N * K], vec![DualQuaternion::IDENTITY; K]);
        let out = WarpGradients { means: &mut m, rotations: &mut r, weights: Some(&mut w), motions: &mut d };
        Warp::new(exact).backward(input, &c.g_means, &c.g_rotations, out);
        (m, r, w, d)
    }

    /// Central difference over a change of one f32, divided by the change that f32 really made.
    fn slope(c: &mut Case, state: State, entry: impl Fn(&mut Case) -> &mut f32) -> f64 {
        let start = *entry(c);
        let mut at = |v: f32| {
            *entry(c) = v;
            (loss(c, state), f64::from(v))
        };
        let ((up, a), (down, b)) = (at(start + 1e-3), at(start - 1e-3));
        *entry(c) = start;
        (up - down) / (a - b)
    }

    fn close(analytic: f64, numeric: f64) {
        assert!((analytic - numeric).abs() < 2e-5 * (1.0 + numeric.abs()), "{analytic} against {numeric}");
    }

    #[test]
    fn exact_gradients_match_finite_differences() {
        let mut c = case();
        for state in State::ALL {
            let (m, r, w, d) = gradients(&input(&c, state), &c, true);
            for i in 0..N {
                (0..3).for_each(|a| close(m[i][a].into(), slope(&mut c, state, |c| &mut c.means[i][a])));
                (0..4).for_each(|a| close(r[i][a].into(), slope(&mut c, state, |c| &mut c.rotations[i][a])));
                (0..K).for_each(|k| close(w[i * K + k].into(), slope(&mut c, state, |c| &mut c.weights[i * K + k])));
            }
            for k in 0..K {
                for a in 0..8 {
                    let entry = |c: &mut Case, h: f64| {
                        let m = &mut c.motions[k];
                        if a < 4 { m.real[a] += h } else { m.dual[a - 4] += h }
                    };
                    entry(&mut c, 1e-6);
                    let up = loss(&c, state);
                    entry(&mut c, -2e-6);
                    let down = loss(&c, state);
                    entry(&mut c, 1e-6);
                    close(if a < 4 { d[k].real[a] } else { d[k].dual[a - 4] }, (up - down) / 2e-6);
                }
            }
        }
    }

    #[test]
    fn published_routing_passes_centres_unrotated_and_rotations_past_the_motions() {
        let c = case();
        let (m, r, w, d) = gradients(&input(&c, State::END), &c, false);
        let (_, r_exact, ..) = gradients(&input(&c, State::END), &c, true);
        assert_eq!(m, c.g_means);
        assert_eq!(r, r_exact);
        let without = Case { g_rotations: vec![[0.0; 4]; N], ..case() };
        let (.., w_without, d_without) = gradients(&input(&without, State::END), &without, true);
        assert_eq!((w, d), (w_without, d_without));
    }

    #[test]
    fn labels_are_one_hot_weights_and_states_undo_each_other() {
        let mut c = case();
        let labels: Vec<u16> = (0..N).map(|i| (i % K) as u16).collect();
        c.weights = (0..N * K).map(|j| f32::from(u8::from(j % K == (j / K) % K))).collect();
        for state in State::ALL {
            let soft = input(&c, state);
            let hard = WarpInput { skin: Skin::Labels(&labels), ..soft };
            let run = |input: &WarpInput| {
                let (mut x, mut q) = (vec![[0.0; 3]; N], vec![[0.0; 4]; N]);
                Warp::new(true).forward(input, &mut x, &mut q);
                (x, q)
            };
            assert_eq!(run(&soft), run(&hard));
            let (moved, _) = run(&hard);
            let back = WarpInput { means: &moved, state: state.other(), ..hard };
            for (a, b) in run(&back).0.iter().zip(&c.means) {
                assert!((0..3).all(|i| (a[i] - b[i]).abs() < 1e-5));
            }
            let (a, b) = (gradients(&soft, &c, true), gradients(&hard, &c, true));
            assert_eq!((a.0, a.1, a.3), (b.0, b.1, b.3));
        }
    }
}
