// Moves pixels between threads in registers: for workgroups that are one subgroup.

fn receive(pixel_state: Pixel, p: u32, has_pixel: bool, lane: u32) -> Pixel {
    // All threads call the shuffle, also those without a pixel.
    let before = Pixel(subgroupShuffleUp(pixel_state.t, 1u), subgroupShuffleUp(pixel_state.rest, 1u));
    if lane == 0u && has_pixel {
        return Pixel(transmittances[p], tile_remainders[p]);
    }
    return before;
}

fn send(pixel_state: Pixel, p: u32, has_pixel: bool) {}
