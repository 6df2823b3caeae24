// Sums the gradients of the intersections per Gaussian and computes the gradients of its parameters. Same computation
// as `artgs_raster::gather`, the adjoint in `artgs_raster::project`, and the backward pass of the warp.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> labels: array<u32>;
@group(0) @binding(3) var<storage, read> motions: array<vec4f>;
@group(0) @binding(4) var<storage, read> flats: array<Flat>;
@group(0) @binding(5) var<storage, read> counts: array<u32>;
@group(0) @binding(6) var<storage, read> starts: array<u32>;
@group(0) @binding(7) var<storage, read> cells: array<vec4f>;
@group(0) @binding(8) var<storage, read> control: array<u32>;
@group(0) @binding(9) var<storage, read_write> grads: array<f32>;
@group(0) @binding(10) var<storage, read_write> densify_stats: array<vec4f>;
@group(0) @binding(11) var<storage, read_write> d_motions: array<vec4f>;

struct Spread {
    log_scale: vec3f,
    to_image_x: vec3f,
    to_image_y: vec3f,
    rotation: mat3x3f,
}

fn symmetric(k: vec3f, v: vec2f) -> vec2f {
    return vec2f(k.x * v.x + k.y * v.y, k.y * v.x + k.z * v.y);
}

// `K S K / 2` for symmetric `K` and `S`: the gradient of the covariance from the second moments `S`.
fn sandwich(k: vec3f, s: vec3f) -> vec3f {
    let u = symmetric(k, s.xy);
    let v = symmetric(k, s.yz);
    let top = symmetric(k, vec2f(u.x, v.x));
    let bottom = symmetric(k, vec2f(u.y, v.y));
    return 0.5 * vec3f(top, bottom.y);
}

// Gradients of log scales, of `to_image` and of the rotation matrix, given the symmetric one of the covariance.
fn spread_adjoint(c: Chain, g: vec3f) -> Spread {
    let d_a = 2.0 * (g.x * c.scaled_x + g.y * c.scaled_y);
    let d_b = 2.0 * (g.y * c.scaled_x + g.z * c.scaled_y);
    let turned_a = d_a * c.scale;
    let turned_b = d_b * c.scale;
    let t0 = c.to_image_x;
    let t1 = c.to_image_y;
    return Spread(
        d_a * c.scaled_x + d_b * c.scaled_y,
        c.rotation * turned_a,
        c.rotation * turned_b,
        mat3x3f(
            t0 * turned_a.x + t1 * turned_b.x,
            t0 * turned_a.y + t1 * turned_b.y,
            t0 * turned_a.z + t1 * turned_b.z,
        ),
    );
}

// Gradient of the raw quaternion, given that of the rotation matrix.
fn quaternion_adjoint(c: Chain, d: mat3x3f) -> vec4f {
    if c.norm == 0.0 {
        return vec4f(0.0);
    }
    let w = c.unit.x;
    let x = c.unit.y;
    let y = c.unit.z;
    let z = c.unit.w;
    let turn = vec3f(d[1].z - d[2].y, d[2].x - d[0].z, d[0].y - d[1].x);
    let sxy = d[1].x + d[0].y;
    let sxz = d[2].x + d[0].z;
    let syz = d[2].y + d[1].z;
    let g = 2.0 * vec4f(
        x * turn.x + y * turn.y + z * turn.z,
        w * turn.x + y * sxy + z * sxz - 2.0 * x * (d[1].y + d[2].z),
        w * turn.y + x * sxy + z * syz - 2.0 * y * (d[0].x + d[2].z),
        w * turn.z + x * sxz + y * syz - 2.0 * z * (d[0].x + d[1].y),
    );
    return (g - c.unit * dot(c.unit, g)) / c.norm;
}

// Gradient of the world-space centre through one coordinate of the image: its share of the view-space centre, x or y
// and z.
fn axis_adjoint(c: Chain, k: u32, row: vec3f, d_center: f32, d_to_image: vec3f) -> vec2f {
    let r2 = step.row_z.xyz;
    let inverse = 1.0 / c.p.z;
    let f = step.focal[k] * inverse;
    let d_f = dot(d_to_image, row - c.clamped[k] * r2);
    var d_ratio = step.focal[k] * d_center;
    if c.clamped[k] == c.ratio[k] {
        d_ratio -= f * dot(d_to_image, r2);
    }
    return vec2f(d_ratio * inverse, -inverse * (f * d_f + d_ratio * c.ratio[k]));
}

fn write3(at: u32, v: vec3f) {
    grads[at] = v.x;
    grads[at + 1u] = v.y;
    grads[at + 2u] = v.z;
}

fn write_rotation(i: u32, q: vec4f) {
    let at = at_rotation(step.n, i);
    grads[at] = q.x;
    grads[at + 1u] = q.y;
    grads[at + 2u] = q.z;
    grads[at + 3u] = q.w;
}

// Gradient of the entropy of opacities with respect to a logit.
fn entropy_adjoint(logit: f32) -> f32 {
    if step.entropy_step == 0.0 {
        return 0.0;
    }
    let e = exp(-abs(logit));
    return -step.entropy_step * select(-1.0, 1.0, logit > 0.0) * e / (1.0 + e);
}

fn write_zero(i: u32) {
    write3(3u * i, vec3f(0.0));
    write_rotation(i, vec4f(0.0));
    write3(at_log_scale(step.n, i), vec3f(0.0));
    let at = at_sh(step.n, step.sh_stride, i);
    for (var k = 0u; k < step.sh_stride; k++) {
        grads[at + k] = 0.0;
    }
    grads[at_logit(step.n, i)] = entropy_adjoint(params[at_logit(step.n, i)]);
    if has(step.flags, LEARN_JOINTS | WEIGHTED) {
        d_motions[2u * i] = vec4f(0.0);
        d_motions[2u * i + 1u] = vec4f(0.0);
    }
}

// Gradients of the canonical centre and rotation and of the motion, from those of the rendered centre and rotation.
fn write_warp_adjoint(i: u32, d_mean: vec3f, d_rotation: vec4f) {
    if !has(step.flags, ARTICULATED) {
        write3(3u * i, d_mean);
        write_rotation(i, d_rotation);
        return;
    }
    let m = motion_of(i);
    let exact = has(step.flags, EXACT_WARP);
    write3(3u * i, select(d_mean, d_mean * matrix(m.r), exact));
    write_rotation(i, multiply(conjugate(m.r), d_rotation));
    if has(step.flags, LEARN_JOINTS | WEIGHTED) {
        let at = canonical(i);
        var by_r = vec4f(0.0);
        if exact {
            by_r = multiply(d_rotation, conjugate(at.rotation));
        }
        let d = motion_adjoint(m, at.mean, d_mean, by_r);
        d_motions[2u * i] = d.r;
        d_motions[2u * i + 1u] = d.s;
    }
}

@compute @workgroup_size(GROUP)
fn gather(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * GROUP + lane;
    if i >= step.n {
        return;
    }
    let count = counts[i];
    if count == 0u || control[TOTAL] == 0u {
        write_zero(i);
        return;
    }
    var first = vec4f(0.0);
    var second = vec4f(0.0);
    var color = vec4f(0.0);
    let begin = starts[i];
    for (var k = begin; k < begin + count; k++) {
        first += cells[3u * k];
        second += cells[3u * k + 1u];
        color += cells[3u * k + 2u];
    }
    let at = placed(i);
    let c = chain_of(i, at);
    let inverse = 1.0 / c.determinant;
    let conic = inverse * vec3f(c.covariance.z, -c.covariance.y, c.covariance.x);
    let d_center = symmetric(conic, first.yz);
    let spread = spread_adjoint(c, sandwich(conic, vec3f(first.w, second.x, second.y)));
    let d_x = axis_adjoint(c, 0u, step.row_x.xyz, d_center.x, spread.to_image_x);
    let d_y = axis_adjoint(c, 1u, step.row_y.xyz, d_center.y, spread.to_image_y);
    var d_mean = d_x.x * step.row_x.xyz + d_y.x * step.row_y.xyz + (color.y + d_x.y + d_y.y) * step.row_z.xyz;

    let offset = at.mean - step.eye;
    let distance = length(offset);
    let world = offset / distance;
    let shown = select(vec3f(0.0), vec3f(1.0), flats[i].rgb > vec3f(0.0));
    let d_rgb = vec3f(second.zw, color.x) * shown;
    let sh = at_sh(step.n, step.sh_stride, i);
    let d_local = sh_adjoint(step.sh_degree, step.sh_stride, to_frame(i, world), sh, d_rgb);
    let d_world = from_frame(i, d_local);
    d_mean += (d_world - world * dot(world, d_world)) / distance;

    write3(at_log_scale(step.n, i), spread.log_scale);
    let logit = params[at_logit(step.n, i)];
    grads[at_logit(step.n, i)] = first.x / (1.0 + exp(logit)) + entropy_adjoint(logit);
    write_warp_adjoint(i, d_mean, quaternion_adjoint(c, spread.rotation));

    let mean_variance = 0.5 * (c.covariance.x + c.covariance.z);
    let wide = sqrt(max(mean_variance * mean_variance - c.determinant, RADIUS_SPREAD_MIN));
    let radius = ceil(RADIUS_DEVIATIONS * sqrt(mean_variance + wide));
    let s = densify_stats[i];
    densify_stats[i] = vec4f(s.x + length(d_center * 0.5 * vec2f(step.size)), s.y + 1.0, max(s.z, radius), 0.0);
}
