// Real spherical harmonics up to degree 3 with the signs of 3DGS. Same computation as `artgs_raster::sh`. Needs
// `params`; the adjoint also `grads`.

fn coefficient(at: u32, k: u32) -> vec3f {
    let i = at + 3u * k;
    return vec3f(params[i], params[i + 1u], params[i + 2u]);
}

// `0.5 + sum_k basis[k] sh[k]`, not clamped.
fn sh_color(degree: u32, d: vec3f, at: u32) -> vec3f {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    var c = vec3f(0.5) + SH_C0 * coefficient(at, 0u);
    if degree > 0u {
        c += SH_C1 * (z * coefficient(at, 2u) - y * coefficient(at, 1u) - x * coefficient(at, 3u));
    }
    if degree > 1u {
        c += SH_C20 * (x * y * coefficient(at, 4u) - y * z * coefficient(at, 5u) - x * z * coefficient(at, 7u));
        c += SH_C21 * (2.0 * z * z - x * x - y * y) * coefficient(at, 6u);
        c += SH_C22 * (x * x - y * y) * coefficient(at, 8u);
    }
    if degree > 2u {
        let ring = 4.0 * z * z - x * x - y * y;
        c -= SH_C30 * y * (3.0 * x * x - y * y) * coefficient(at, 9u);
        c += SH_C31 * x * y * z * coefficient(at, 10u);
        c -= SH_C32 * y * ring * coefficient(at, 11u);
        c += SH_C33 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y) * coefficient(at, 12u);
        c -= SH_C32 * x * ring * coefficient(at, 13u);
        c += SH_C34 * z * (x * x - y * y) * coefficient(at, 14u);
        c -= SH_C30 * x * (x * x - 3.0 * y * y) * coefficient(at, 15u);
    }
    return c;
}
