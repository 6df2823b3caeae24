// Sums of `d[j] x[k]` over ranges of Gaussians, in a fixed order; biases have inputs of 1.

@group(0) @binding(2) var<storage, read> d: array<f32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;
// `[chunks][total]`.
@group(0) @binding(4) var<storage, read_write> partial: array<f32>;

const SIDE: u32 = PRODUCT_SIDE;
const DEPTH_OF_TILE: u32 = 64u;
// One more than the depth, so that neighbouring rows are in different memory banks.
const PITCH: u32 = DEPTH_OF_TILE + 1u;

var<workgroup> left: array<f32, SIDE * PITCH>;
var<workgroup> right: array<f32, SIDE * PITCH>;

@compute @workgroup_size(WIDE_GROUP)
fn products(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let each = (step.n + step.chunks - 1u) / step.chunks;
    let begin = group.x * each;
    let end = min(begin + each, step.n);
    let j = group.z * SIDE + lane / SIDE;
    let k = group.y * SIDE + lane % SIDE;
    var sum = 0.0;
    for (var base = begin; base < end; base += DEPTH_OF_TILE) {
        for (var q = 0u; q < 4u; q++) {
            let row = q * 4u + lane / DEPTH_OF_TILE;
            let column = lane % DEPTH_OF_TILE;
            let i = base + column;
            let of_d = group.z * SIDE + row;
            let of_x = group.y * SIDE + row;
            var a = 0.0;
            var b = 0.0;
            if i < end {
                if of_d < shape.rows {
                    a = d[of_d * step.n + i];
                }
                if of_x < shape.inputs {
                    b = x[of_x * step.n + i];
                } else {
                    b = 1.0;
                }
            }
            left[row * PITCH + column] = a;
            right[row * PITCH + column] = b;
        }
        workgroupBarrier();
        for (var c = 0u; c < DEPTH_OF_TILE; c++) {
            sum += left[(lane / SIDE) * PITCH + c] * right[(lane % SIDE) * PITCH + c];
        }
        workgroupBarrier();
    }
    if j < shape.rows && k <= shape.inputs {
        let at = select(shape.weights + j * shape.inputs + k, shape.biases + j, k == shape.inputs);
        // Parameters of the parts come before those of the layers.
        partial[group.x * shape.total + at - FRAME * step.parts] = sum;
    }
}
