// Blurs with the window of structural similarity, `TAPS` weights in `WINDOW` along each axis.

const HALF: i32 = i32(TAPS / 2u);
// Pixels along a tile with half a window on both sides.
const REACH: u32 = TILE + TAPS - 1u;
