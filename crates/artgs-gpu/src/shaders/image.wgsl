// The training image, over the background of the step. Needs `step` and `image`.

fn image_alpha(p: u32) -> f32 {
    return f32(image[p] >> 24u) * (1.0 / 255.0);
}

// `alpha color + (1 - alpha) background`.
fn image_color(p: u32) -> vec3f {
    let pixel = image[p];
    let a = f32(pixel >> 24u) * (1.0 / 255.0);
    let weight = select(a, a * a, has(step.flags, DOUBLE_ALPHA));
    let color = vec3f(f32(pixel & 255u), f32((pixel >> 8u) & 255u), f32((pixel >> 16u) & 255u)) * (1.0 / 255.0);
    return weight * color + (1.0 - a) * step.background;
}
