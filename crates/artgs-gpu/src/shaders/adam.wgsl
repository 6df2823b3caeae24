// One Adam update of every parameter. Same computation as `artgs::fit::adam`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> grads: array<f32>;
@group(0) @binding(2) var<storage, read> control: array<u32>;
@group(0) @binding(3) var<storage, read_write> params: array<f32>;
@group(0) @binding(4) var<storage, read_write> first: array<f32>;
@group(0) @binding(5) var<storage, read_write> second: array<f32>;

// Rate of a parameter; negative for harmonics that are not in use, which do not change.
fn rate_of(i: u32) -> f32 {
    let n = step.n;
    if i < 3u * n {
        return step.rates.x;
    }
    if i < 7u * n {
        return step.rates.y;
    }
    if i < 10u * n {
        return step.rates.z;
    }
    if i < PLAIN * n {
        return step.rates.w;
    }
    let column = (i - PLAIN * n) % step.sh_stride;
    if column < 3u {
        return step.sh_rates.x;
    }
    return select(-1.0, step.sh_rates.y, column < 3u * (step.sh_degree + 1u) * (step.sh_degree + 1u));
}

@compute @workgroup_size(WIDE_GROUP)
fn adam(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group_index(group) * WIDE_GROUP + lane;
    if i >= (PLAIN + step.sh_stride) * step.n || control[OVERFLOW] != 0u {
        return;
    }
    let rate = rate_of(i);
    if rate < 0.0 {
        return;
    }
    let g = grads[i];
    let m = step.betas.x * first[i] + (1.0 - step.betas.x) * g;
    let v = step.betas.y * second[i] + (1.0 - step.betas.y) * g * g;
    first[i] = m;
    second[i] = v;
    params[i] -= rate * step.corrections.x * m / (sqrt(v) * step.corrections.y + step.eps);
}
