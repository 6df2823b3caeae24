// Frames of the parts and one Adam update of them and of the perceptron. Same computation as
// `artgs::articulation::assignment::centres`.

// Matrix rows of a part's raw quaternion are the columns that `matrix` gives for the conjugate one.
struct Turn {
    unit: vec4f,
    length: f32,
}

fn turn_of(q: vec4f) -> Turn {
    let size = length(q);
    if size < 1e-30 {
        return Turn(vec4f(1.0, 0.0, 0.0, 0.0), 1e-30);
    }
    return Turn(q / size, size);
}
