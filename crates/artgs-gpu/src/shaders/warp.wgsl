// Moves canonical Gaussians to the state of an image, and the adjoint. Same computation as
// `artgs::articulation::model::warp`. `softmax` computes weighted sums of motions before. Needs `step`, `params`,
// `labels` and `motions`.

// A rigid motion as a unit quaternion and the dual part over the same length.
struct Motion {
    r: vec4f,
    s: vec4f,
}

// A Gaussian as it is rendered, world frame.
struct Placed {
    mean: vec3f,
    rotation: vec4f,
}

fn canonical(i: u32) -> Placed {
    let m = 3u * i;
    let q = at_rotation(step.n, i);
    return Placed(
        vec3f(params[m], params[m + 1u], params[m + 2u]),
        vec4f(params[q], params[q + 1u], params[q + 2u], params[q + 3u]),
    );
}

fn motion_of(i: u32) -> Motion {
    if has(step.flags, WEIGHTED) {
        return Motion(motions[3u * i], motions[3u * i + 1u]);
    }
    let k = 2u * (step.pose * step.parts + labels[i]);
    return Motion(motions[k], motions[k + 1u]);
}

// Rotation from the frame of the harmonics to the world: that of the heaviest part.
fn frame_of(i: u32) -> mat3x3f {
    if has(step.flags, WEIGHTED) {
        return matrix(motions[3u * i + 2u]);
    }
    return matrix(motion_of(i).r);
}

fn placed(i: u32) -> Placed {
    var p = canonical(i);
    if has(step.flags, ARTICULATED) {
        let m = motion_of(i);
        p.mean = matrix(m.r) * p.mean + 2.0 * multiply(m.s, conjugate(m.r)).yzw;
        p.rotation = multiply(m.r, p.rotation);
    }
    return p;
}

// Gradient with respect to the blended sums of a motion, from the gradient of the warped centre and the other gradient
// of `r`. Sums of labels have unit length; otherwise `softmax_back` divides by the length.
fn motion_adjoint(m: Motion, x: vec3f, g: vec3f, by_r: vec4f) -> Motion {
    let w = m.r.x;
    let v = m.r.yzw;
    let sv = m.s.yzw;
    let vg = cross(v, g);
    let g_r = by_r + vec4f(
        2.0 * dot(g, cross(v, x)) + 2.0 * dot(g, sv),
        2.0 * (w * cross(x, g) + g * dot(v, x) + x * dot(g, v) - 2.0 * v * dot(g, x)) - 2.0 * (m.s.x * g + cross(g, sv)),
    );
    let g_s = vec4f(-2.0 * dot(g, v), 2.0 * (w * g - vg));
    let radial = dot(m.r, g_r) + dot(m.s, g_s);
    return Motion(g_r - m.r * radial, g_s);
}
