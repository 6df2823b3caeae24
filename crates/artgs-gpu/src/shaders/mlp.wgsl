// Layers of a perceptron and the gradients of their weights. Twin of `artgs::articulation::mlp`. Activations lie channel by
// channel, `[channels][n]`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<uniform> shape: Layer;

struct Layer {
    inputs: u32,
    rows: u32,
    // Where weights and biases begin among the parameters, and the distances between weights of neighbouring rows and inputs.
    weights: u32,
    biases: u32,
    row_stride: u32,
    input_stride: u32,
    what: u32,
    // Number of parameters of all layers.
    total: u32,
}
