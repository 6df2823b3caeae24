// Intermediate values of the projection. Same computation as `Chain` in `artgs_raster::project`. Needs `step`,
// `params`.

struct Chain {
    p: vec3f,
    // x / z and y / z, and the same clamped to the limits.
    ratio: vec2f,
    clamped: vec2f,
    // Unit quaternion and the length of the raw one (0 if it was not usable).
    unit: vec4f,
    norm: f32,
    rotation: mat3x3f,
    scale: vec3f,
    // Rows of Jacobian times world-to-camera rotation, and of that times the Gaussian's rotation and scale.
    to_image_x: vec3f,
    to_image_y: vec3f,
    scaled_x: vec3f,
    scaled_y: vec3f,
    // Covariance (xx, xy, yy) with the blur, and its determinant.
    covariance: vec3f,
    determinant: f32,
}

fn chain_of(i: u32, at: Placed) -> Chain {
    var c: Chain;
    let r0 = step.row_x.xyz;
    let r1 = step.row_y.xyz;
    let r2 = step.row_z.xyz;
    c.p = vec3f(dot(r0, at.mean), dot(r1, at.mean), dot(r2, at.mean))
        + vec3f(step.row_x.w, step.row_y.w, step.row_z.w);
    c.ratio = c.p.xy / c.p.z;
    c.clamped = clamp(c.ratio, step.limits.xz, step.limits.yw);
    let norm = length(at.rotation);
    if norm <= QUATERNION_MIN {
        c.unit = vec4f(1.0, 0.0, 0.0, 0.0);
        c.norm = 0.0;
    } else {
        c.unit = at.rotation / norm;
        c.norm = norm;
    }
    c.rotation = matrix(c.unit);
    let s = at_log_scale(step.n, i);
    c.scale = exp(vec3f(params[s], params[s + 1u], params[s + 2u]));
    let f = step.focal / c.p.z;
    c.to_image_x = f.x * (r0 - c.clamped.x * r2);
    c.to_image_y = f.y * (r1 - c.clamped.y * r2);
    c.scaled_x = (c.to_image_x * c.rotation) * c.scale;
    c.scaled_y = (c.to_image_y * c.rotation) * c.scale;
    let aa = dot(c.scaled_x, c.scaled_x);
    let bb = dot(c.scaled_y, c.scaled_y);
    // Lagrange's identity: no cancellation for thin Gaussians.
    let across = cross(c.scaled_x, c.scaled_y);
    c.determinant = dot(across, across) + step.blur * (aa + bb) + step.blur * step.blur;
    c.covariance = vec3f(aa + step.blur, dot(c.scaled_x, c.scaled_y), bb + step.blur);
    return c;
}

// Viewing direction in the frame of the harmonics.
fn to_frame(i: u32, world: vec3f) -> vec3f {
    if has(step.flags, ARTICULATED) && has(step.flags, ROTATE_SH) {
        return world * frame_of(i);
    }
    return world;
}

fn from_frame(i: u32, local: vec3f) -> vec3f {
    if has(step.flags, ARTICULATED) && has(step.flags, ROTATE_SH) {
        return frame_of(i) * local;
    }
    return local;
}
