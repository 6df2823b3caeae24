// Layers of a perceptron and the gradients of their weights. Same computation as
// `artgs::articulation::assignment::mlp`. Activations lie channel by channel, `[channels][n]`.

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<uniform> shape: Layer;
