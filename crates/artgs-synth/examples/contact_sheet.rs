//! A contact sheet of random objects: `contact_sheet FROM TO FILE.png`; each seed has its start above its end.

#![allow(clippy::print_stdout, reason = "an example prints")]

use artgs_core::State;
use artgs_synth::population::random_object;
use artgs_synth::{Arc, CaptureOptions, render_capture};

const SIZE: u32 = 200;
const COLUMNS: usize = 10;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, from, to, file] = &arguments[..] else { return Err("contact_sheet FROM TO FILE.png".into()) };
    let seeds: Vec<u64> = (from.parse()?..to.parse()?).collect();
    let rows = seeds.len().div_ceil(COLUMNS);
    let (width, height) = (COLUMNS as u32 * SIZE, 2 * rows as u32 * SIZE);
    let mut sheet = vec![[255_u8; 3]; (width * height) as usize];
    for (index, seed) in seeds.into_iter().enumerate() {
        let drawn = random_object(seed, 2)?;
        println!("{seed} {} {:?}", drawn.category, drawn.features);
        let options =
            CaptureOptions { views: 2, test_views: 0, size: SIZE, arc: Arc::Half, ..CaptureOptions::default() };
        let capture = render_capture(&drawn.object, &options)?;
        for state in State::ALL {
            let view = &capture.states[state].train[1 - state.index()];
            let (left, top) = (index % COLUMNS, 2 * (index / COLUMNS) + state.index());
            for (pixel, [r, g, b, a]) in view.rgba.iter().enumerate() {
                let (x, y) = (pixel as u32 % SIZE + left as u32 * SIZE, pixel as u32 / SIZE + top as u32 * SIZE);
                let over = |c: &u8| ((u32::from(*c) * u32::from(*a) + 255 * (255 - u32::from(*a))) / 255) as u8;
                sheet[(y * width + x) as usize] = [over(r), over(g), over(b)];
            }
        }
    }
    artgs_io::image_io::write_rgb(file.as_ref(), width, height, &sheet)?;
    Ok(())
}
