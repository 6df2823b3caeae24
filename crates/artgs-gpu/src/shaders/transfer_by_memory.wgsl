// Moves pixels between threads through workgroup memory: works on every device.

fn receive(pixel_state: Pixel, p: u32, has_pixel: bool, lane: u32) -> Pixel {
    if has_pixel {
        return Pixel(transmittances[p], tile_remainders[p]);
    }
    return pixel_state;
}

fn send(pixel_state: Pixel, p: u32, has_pixel: bool) {
    if has_pixel {
        transmittances[p] = pixel_state.t;
        tile_remainders[p] = pixel_state.rest;
    }
    workgroupBarrier();
}
