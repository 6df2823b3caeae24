//! Quaternions (w, x, y, z) as arrays, for the adjoints that no geometry crate has.

pub(crate) type Quat = [f64; 4];
pub(crate) type Vec3 = [f64; 3];

pub(crate) fn dot<const N: usize>(a: [f64; N], b: [f64; N]) -> f64 {
    (0..N).map(|i| a[i] * b[i]).sum()
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(crate) fn conjugate(q: Quat) -> Quat {
    [q[0], -q[1], -q[2], -q[3]]
}

pub(crate) fn vector(q: Quat) -> Vec3 {
    [q[1], q[2], q[3]]
}

/// Hamilton product `a b`. The adjoint of `b -> a b` is `g -> conj(a) g`, that of `a -> a b` is `g -> g conj(b)`.
pub(crate) fn multiply(a: Quat, b: Quat) -> Quat {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Matrix rows of a unit quaternion.
pub(crate) fn matrix([w, x, y, z]: Quat) -> [Vec3; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// Adjoint of [`matrix`] taken as a polynomial in its four arguments.
pub(crate) fn matrix_vjp([w, x, y, z]: Quat, g: [Vec3; 3]) -> Quat {
    let [[g00, g01, g02], [g10, g11, g12], [g20, g21, g22]] = g;
    [
        2.0 * (-z * g01 + y * g02 + z * g10 - x * g12 - y * g20 + x * g21),
        2.0 * (y * g01 + z * g02 + y * g10 - 2.0 * x * g11 - w * g12 + z * g20 + w * g21 - 2.0 * x * g22),
        2.0 * (-2.0 * y * g00 + x * g01 + w * g02 + x * g10 + z * g12 - w * g20 + z * g21 - 2.0 * y * g22),
        2.0 * (-2.0 * z * g00 - w * g01 + x * g02 + w * g10 - 2.0 * z * g11 + y * g12 + x * g20 + y * g21),
    ]
}

/// `v / |v|` and `|v|`; the first axis for the zero vector.
pub(crate) fn normalise<const N: usize>(v: [f64; N]) -> ([f64; N], f64) {
    let length = dot(v, v).sqrt();
    if length < 1e-300 {
        let mut first = [0.0; N];
        first[0] = 1.0;
        return (first, 1e-300);
    }
    (v.map(|c| c / length), length)
}

/// Adjoint of [`normalise`] at the unit vector it returned.
pub(crate) fn normalise_vjp<const N: usize>(unit: [f64; N], length: f64, g: [f64; N]) -> [f64; N] {
    let along = dot(unit, g);
    std::array::from_fn(|i| (g[i] - unit[i] * along) / length)
}
