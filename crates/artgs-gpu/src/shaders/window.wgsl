// The window of structural similarity along one axis: 11 weights of a normal distribution of deviation 1.5, sum 1.

const TAPS: u32 = 11u;
const HALF: i32 = 5;
// Pixels along a tile with half a window on both sides.
const REACH: u32 = 26u;

const WINDOW = array<f32, 11>(
    0.0010283801, 0.0075987581, 0.0360007721, 0.1093606895, 0.2130055377, 0.2660117249,
    0.2130055377, 0.1093606895, 0.0360007721, 0.0075987581, 0.0010283801,
);
