// Results of a step: sums over workgroups in a fixed order. One workgroup.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read> params: array<f32>;
@group(0) @binding(2) var<storage, read> pixel_sums: array<vec4f>;
@group(0) @binding(3) var<storage, read> window_sums: array<vec4f>;
@group(0) @binding(4) var<storage, read> control: array<u32>;
@group(0) @binding(5) var<storage, read_write> results: array<Outcome>;

var<workgroup> terms: array<vec4f, WIDE_GROUP>;
var<workgroup> others: array<vec2f, WIDE_GROUP>;

@compute @workgroup_size(WIDE_GROUP)
fn collect(@builtin(local_invocation_index) lane: u32) {
    var sum = vec4f(0.0);
    for (var i = lane; i < step.tiles.x * step.tiles.y; i += WIDE_GROUP) {
        sum += pixel_sums[i];
    }
    var similarity = 0.0;
    if has(step.flags, SSIM) {
        let across = (step.rect.z - step.rect.x + TILE - 1u) / TILE;
        let down = (step.rect.w - step.rect.y + TILE - 1u) / TILE;
        for (var i = lane; i < 3u * across * down; i += WIDE_GROUP) {
            similarity += window_sums[i].x;
        }
    }
    var entropy = 0.0;
    if step.entropy_step != 0.0 {
        for (var i = lane; i < step.n; i += WIDE_GROUP) {
            entropy += log(1.0 + exp(-abs(params[at_logit(step.n, i)])));
        }
    }
    terms[lane] = sum;
    others[lane] = vec2f(similarity, entropy);
    workgroupBarrier();
    for (var reach = WIDE_GROUP / 2u; reach > 0u; reach /= 2u) {
        if lane < reach {
            terms[lane] += terms[lane + reach];
            others[lane] += others[lane + reach];
        }
        workgroupBarrier();
    }
    if lane == 0u {
        let complete = select(1.0, 0.0, control[OVERFLOW] != 0u);
        results[step.slot] = Outcome(terms[0], others[0].x, others[0].y, f32(control[TOTAL]), complete);
    }
}
