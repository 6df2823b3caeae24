// Adjoint of `sh_color`. Needs `params` and `grads`.

// Writes the gradient of one coefficient, returns the slope of the colour by its basis function.
fn pull(at: u32, k: u32, basis: f32, d_color: vec3f) -> f32 {
    let i = at + 3u * k;
    grads[i] = basis * d_color.x;
    grads[i + 1u] = basis * d_color.y;
    grads[i + 2u] = basis * d_color.z;
    return dot(coefficient(at, k), d_color);
}

// Writes the gradient of the harmonics of which `stored` are kept (zero beyond `degree`); returns that of the
// direction.
fn sh_adjoint(degree: u32, stored: u32, d: vec3f, at: u32, d_color: vec3f) -> vec3f {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    var g = vec3f(0.0);
    _ = pull(at, 0u, SH_C0, d_color);
    if degree > 0u {
        let s1 = pull(at, 1u, -SH_C1 * y, d_color);
        let s2 = pull(at, 2u, SH_C1 * z, d_color);
        let s3 = pull(at, 3u, -SH_C1 * x, d_color);
        g += SH_C1 * vec3f(-s3, -s1, s2);
    }
    if degree > 1u {
        let s4 = pull(at, 4u, SH_C20 * x * y, d_color);
        let s5 = pull(at, 5u, -SH_C20 * y * z, d_color);
        let s6 = pull(at, 6u, SH_C21 * (2.0 * z * z - x * x - y * y), d_color);
        let s7 = pull(at, 7u, -SH_C20 * x * z, d_color);
        let s8 = pull(at, 8u, SH_C22 * (x * x - y * y), d_color);
        g += SH_C20 * (s4 * vec3f(y, x, 0.0) - s5 * vec3f(0.0, z, y) - s7 * vec3f(z, 0.0, x));
        g += SH_C21 * s6 * vec3f(-2.0 * x, -2.0 * y, 4.0 * z);
        g += SH_C22 * s8 * vec3f(2.0 * x, -2.0 * y, 0.0);
    }
    if degree > 2u {
        let xx = x * x;
        let yy = y * y;
        let zz = z * z;
        let xy = x * y;
        let ring = 4.0 * zz - xx - yy;
        let s9 = pull(at, 9u, -SH_C30 * y * (3.0 * xx - yy), d_color);
        let s10 = pull(at, 10u, SH_C31 * xy * z, d_color);
        let s11 = pull(at, 11u, -SH_C32 * y * ring, d_color);
        let s12 = pull(at, 12u, SH_C33 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy), d_color);
        let s13 = pull(at, 13u, -SH_C32 * x * ring, d_color);
        let s14 = pull(at, 14u, SH_C34 * z * (xx - yy), d_color);
        let s15 = pull(at, 15u, -SH_C30 * x * (xx - 3.0 * yy), d_color);
        g -= SH_C30 * s9 * vec3f(6.0 * xy, 3.0 * (xx - yy), 0.0);
        g += SH_C31 * s10 * vec3f(y * z, x * z, xy);
        g -= SH_C32 * s11 * vec3f(-2.0 * xy, 4.0 * zz - xx - 3.0 * yy, 8.0 * y * z);
        g += SH_C33 * s12 * vec3f(-6.0 * x * z, -6.0 * y * z, 6.0 * zz - 3.0 * (xx + yy));
        g -= SH_C32 * s13 * vec3f(4.0 * zz - 3.0 * xx - yy, -2.0 * xy, 8.0 * x * z);
        g += SH_C34 * s14 * vec3f(2.0 * x * z, -2.0 * y * z, xx - yy);
        g -= SH_C30 * s15 * vec3f(3.0 * (xx - yy), -6.0 * xy, 0.0);
    }
    for (var k = 3u * (degree + 1u) * (degree + 1u); k < stored; k++) {
        grads[at + k] = 0.0;
    }
    return g;
}
