// `out[j] = bias[j] + sum_k w[j][k] x[k]`, with a ReLU after it or its gradient.

@group(0) @binding(2) var<storage, read> values: array<f32>;
@group(0) @binding(3) var<storage, read> x: array<f32>;
@group(0) @binding(4) var<storage, read> gate: array<f32>;
@group(0) @binding(5) var<storage, read_write> out: array<f32>;

@compute @workgroup_size(GROUP)
fn linear(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = group.x * GROUP + lane;
    if i >= step.n {
        return;
    }
    let first = LAYER_ROWS * group.y;
    let last = shape.rows - 1u;
    let rows = min(vec4u(first, first + 1u, first + 2u, first + 3u), vec4u(last));
    var sum = vec4f(0.0);
    if has(shape.flags, LAYER_BIAS) {
        let b = shape.biases + rows;
        sum = vec4f(values[b.x], values[b.y], values[b.z], values[b.w]);
    }
    var w = shape.weights + rows * shape.row_stride;
    for (var k = 0u; k < shape.inputs; k++) {
        sum += x[k * step.n + i] * vec4f(values[w.x], values[w.y], values[w.z], values[w.w]);
        w += vec4u(shape.input_stride);
    }
    if has(shape.flags, LAYER_RELU) {
        sum = max(sum, vec4f(0.0));
    }
    for (var q = 0u; q < LAYER_ROWS; q++) {
        if first + q >= shape.rows {
            break;
        }
        let at = (first + q) * step.n + i;
        out[at] = select(sum[q], 0.0, has(shape.flags, LAYER_GATE) && !(gate[at] > 0.0));
    }
}
