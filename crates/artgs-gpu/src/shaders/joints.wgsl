// Motions of parts: their gradients and their updates. Same computation as `artgs::articulation::model::joints` and the
// update in `artgs::fit::deform`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> partial: array<vec4f>;
@group(0) @binding(2) var<storage, read> control: array<u32>;
@group(0) @binding(3) var<storage, read_write> joints: array<Joint>;
@group(0) @binding(4) var<storage, read_write> motions: array<vec4f>;

struct Dual {
    real: vec4f,
    dual: vec4f,
}

// Parameters of a part: eight numbers, in the order of `MotionModel`.
struct Values {
    a: vec4f,
    b: vec4f,
}

struct Line {
    axis: vec3f,
    length: f32,
    pivot: vec3f,
    angle: f32,
    slide: f32,
}

fn line_of(v: Values, model: u32) -> Line {
    let raw = v.a.xyz;
    let size = max(length(raw), 1e-30);
    return Line(raw / size, size, vec3f(v.a.w, v.b.xy), v.b.z, select(0.0, v.b.w, model == MODEL_SCREW));
}

fn motion(v: Values, model: u32) -> Dual {
    if model == MODEL_PRISMATIC {
        return Dual(vec4f(1.0, 0.0, 0.0, 0.0), vec4f(0.0, 0.5 * v.a.xyz));
    }
    if model == MODEL_FREE {
        let real = v.a / max(length(v.a), 1e-30);
        return Dual(real, multiply(vec4f(0.0, 0.5 * v.b.xyz), real));
    }
    let l = line_of(v, model);
    let turn = sine_cosine(0.5 * l.angle);
    let s = turn.x;
    let c = turn.y;
    let slide = 0.5 * l.slide;
    return Dual(vec4f(c, l.axis * s), vec4f(-slide * s, l.axis * slide * c + cross(l.pivot, l.axis) * s));
}

// Gradient with respect to the parameters from that with respect to the motion.
fn motion_adjoint(v: Values, model: u32, d: Dual) -> Values {
    if model == MODEL_PRISMATIC {
        return Values(vec4f(0.5 * d.dual.yzw, 0.0), vec4f(0.0));
    }
    if model == MODEL_FREE {
        let size = max(length(v.a), 1e-30);
        let real = v.a / size;
        let d_real = d.real + multiply(conjugate(vec4f(0.0, 0.5 * v.b.xyz)), d.dual);
        let d_raw = (d_real - real * dot(real, d_real)) / size;
        return Values(d_raw, vec4f(0.5 * multiply(d.dual, conjugate(real)).yzw, 0.0));
    }
    let l = line_of(v, model);
    let turn = sine_cosine(0.5 * l.angle);
    let s = turn.x;
    let c = turn.y;
    let slide = 0.5 * l.slide;
    let moment = cross(l.pivot, l.axis);
    let g_r = d.real.yzw;
    let g_d = d.dual.yzw;
    let d_half = -s * d.real.x + c * dot(l.axis, g_r) - slide * c * d.dual.x - slide * s * dot(l.axis, g_d)
        + c * dot(moment, g_d);
    let d_slide = 0.5 * (-s * d.dual.x + c * dot(l.axis, g_d));
    let d_unit = s * g_r + slide * c * g_d + s * cross(g_d, l.pivot);
    let d_axis = (d_unit - l.axis * dot(l.axis, d_unit)) / l.length;
    let d_pivot = s * cross(l.axis, g_d);
    return Values(vec4f(d_axis, d_pivot.x), vec4f(d_pivot.yz, 0.5 * d_half, select(0.0, d_slide, model == MODEL_SCREW)));
}

// Sum over all ranges of Gaussians, as a gradient with respect to the half motion towards the end state.
fn gradient_of(part: u32) -> Dual {
    var sum = Dual(vec4f(0.0), vec4f(0.0));
    for (var k = 0u; k < step.chunks; k++) {
        let at = 2u * (part * step.chunks + k);
        sum.real += partial[at];
        sum.dual += partial[at + 1u];
    }
    if step.pose == 0u {
        sum.real = conjugate(sum.real);
        sum.dual = conjugate(sum.dual);
    }
    return sum;
}

// Scene units of the parameters that are lengths, 1 for the others.
fn units_of(model: u32) -> Values {
    let u = step.length_unit;
    if model == MODEL_PRISMATIC {
        return Values(vec4f(u), vec4f(u));
    }
    if model == MODEL_FREE {
        return Values(vec4f(1.0), vec4f(u));
    }
    return Values(vec4f(1.0, 1.0, 1.0, u), vec4f(u, u, 1.0, u));
}

fn write_motion(part: u32, m: Dual) {
    let towards_end = 2u * (step.parts + part);
    motions[towards_end] = m.real;
    motions[towards_end + 1u] = m.dual;
    motions[2u * part] = conjugate(m.real);
    motions[2u * part + 1u] = conjugate(m.dual);
}

fn all_finite(v: vec4f) -> bool {
    return finite(v.x) && finite(v.y) && finite(v.z) && finite(v.w);
}

// Sine and cosine of angles up to half a turn, exact to rounding; those of WGSL may have an error of 5e-4.
fn sine_cosine(angle: f32) -> vec2f {
    let x = 0.5 * angle;
    let q = x * x;
    let s = x * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * (1.0 - q / 110.0)))));
    let c = 1.0 - q / 2.0 * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * (1.0 - q / 90.0 * (1.0 - q / 132.0)))));
    return vec2f(2.0 * s * c, 1.0 - 2.0 * s * s);
}

@compute @workgroup_size(PART_GROUP)
fn update_joints(@builtin(local_invocation_index) lane: u32) {
    if control[OVERFLOW] != 0u {
        return;
    }
    for (var part = lane + 1u; part < step.parts; part += PART_GROUP) {
        let joint = joints[part - 1u];
        var v = Values(joint.values[0], joint.values[1]);
        let middle = joint.middle;
        let model = joint.model;
        var d = gradient_of(part);
        d.real += vec4f(0.0, cross(d.dual.yzw, middle));
        let g = motion_adjoint(v, model, d);
        // A Gaussian that is not finite must not affect its joint.
        if all_finite(g.a) && all_finite(g.b) {
            let units = units_of(model);
            let rate = step.joint_rate;
            let corrections = step.joint_corrections;
            var m = Values(joint.first[0], joint.first[1]);
            var s = Values(joint.second[0], joint.second[1]);
            m = Values(m.a + ADAM_GAIN_1 * (g.a - m.a), m.b + ADAM_GAIN_1 * (g.b - m.b));
            s = Values(s.a + ADAM_GAIN_2 * (g.a * g.a - s.a), s.b + ADAM_GAIN_2 * (g.b * g.b - s.b));
            v.a -= rate * units.a * (m.a / corrections.x) / (sqrt(s.a / corrections.y) + ADAM_EPSILON);
            v.b -= rate * units.b * (m.b / corrections.x) / (sqrt(s.b / corrections.y) + ADAM_EPSILON);
            joints[part - 1u].values = array(v.a, v.b);
            joints[part - 1u].first = array(m.a, m.b);
            joints[part - 1u].second = array(s.a, s.b);
        }
        var moved = motion(v, model);
        moved.dual += vec4f(0.0, cross(middle, moved.real.yzw));
        write_motion(part, moved);
    }
}
