// What a step was like: sums over workgroups in a fixed order. One workgroup.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> pixel_sums: array<vec4f>;
@group(0) @binding(3) var<storage, read> window_sums: array<vec4f>;
@group(0) @binding(4) var<storage, read> control: array<u32>;
@group(0) @binding(5) var<storage, read_write> results: array<vec4f>;

var<workgroup> terms: array<vec4f, 256>;
var<workgroup> others: array<vec2f, 256>;

@compute @workgroup_size(256)
fn collect(@builtin(local_invocation_index) lane: u32) {
    var sum = vec4f(0.0);
    for (var i = lane; i < step.tiles.x * step.tiles.y; i += 256u) {
        sum += pixel_sums[i];
    }
    var similarity = 0.0;
    if has(step.flags, SSIM) {
        let across = (step.rect.z - step.rect.x + TILE - 1u) / TILE;
        let down = (step.rect.w - step.rect.y + TILE - 1u) / TILE;
        for (var i = lane; i < 3u * across * down; i += 256u) {
            similarity += window_sums[i].x;
        }
    }
    var entropy = 0.0;
    if step.entropy_step != 0.0 {
        for (var i = lane; i < step.n; i += 256u) {
            entropy += log(1.0 + exp(-abs(params[at_logit(step.n, i)])));
        }
    }
    terms[lane] = sum;
    others[lane] = vec2f(similarity, entropy);
    workgroupBarrier();
    for (var reach = 128u; reach > 0u; reach /= 2u) {
        if lane < reach {
            terms[lane] += terms[lane + reach];
            others[lane] += others[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        results[2u * step.slot] = terms[0];
        // The last word tells whether the step was made.
        results[2u * step.slot + 1u] = vec4f(others[0], f32(control[TOTAL]), select(1.0, 0.0, control[OVERFLOW] != 0u));
    }
}
