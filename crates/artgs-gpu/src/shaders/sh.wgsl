// Real spherical harmonics up to degree 3 with the signs of 3DGS. Twin of `artgs_raster::sh`. Needs `params`; the adjoint
// also `grads`.

const C0: f32 = 0.28209479;
const C1: f32 = 0.48860251;
const C20: f32 = 1.0925484;
const C21: f32 = 0.31539157;
const C22: f32 = 0.5462742;
const C30: f32 = 0.5900436;
const C31: f32 = 2.8906114;
const C32: f32 = 0.4570458;
const C33: f32 = 0.37317634;
const C34: f32 = 1.4453057;

fn coefficient(at: u32, k: u32) -> vec3f {
    let i = at + 3u * k;
    return vec3f(params[i], params[i + 1u], params[i + 2u]);
}

// `0.5 + sum_k basis[k] sh[k]`, not clamped.
fn sh_color(degree: u32, d: vec3f, at: u32) -> vec3f {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    var c = vec3f(0.5) + C0 * coefficient(at, 0u);
    if degree > 0u {
        c += C1 * (z * coefficient(at, 2u) - y * coefficient(at, 1u) - x * coefficient(at, 3u));
    }
    if degree > 1u {
        c += C20 * (x * y * coefficient(at, 4u) - y * z * coefficient(at, 5u) - x * z * coefficient(at, 7u));
        c += C21 * (2.0 * z * z - x * x - y * y) * coefficient(at, 6u);
        c += C22 * (x * x - y * y) * coefficient(at, 8u);
    }
    if degree > 2u {
        let ring = 4.0 * z * z - x * x - y * y;
        c -= C30 * y * (3.0 * x * x - y * y) * coefficient(at, 9u);
        c += C31 * x * y * z * coefficient(at, 10u);
        c -= C32 * y * ring * coefficient(at, 11u);
        c += C33 * z * (2.0 * z * z - 3.0 * x * x - 3.0 * y * y) * coefficient(at, 12u);
        c -= C32 * x * ring * coefficient(at, 13u);
        c += C34 * z * (x * x - y * y) * coefficient(at, 14u);
        c -= C30 * x * (x * x - 3.0 * y * y) * coefficient(at, 15u);
    }
    return c;
}
