//! Prints the convex pieces of the given meshes.
#![allow(clippy::print_stdout, reason = "an example")]
use artgs_physical::collision::decompose::{DecomposeOptions, decompose};
use artgs_physical::settings::DecomposeSettings;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for file in std::env::args().skip(1) {
        let mesh = artgs_io::read_mesh_ply(file.as_ref())?;
        for tolerance in [0.01, 0.005] {
            let began = std::time::Instant::now();
            let options = DecomposeOptions {
                tolerance,
                most: 64,
                corners: 64,
                rounding: 5e-4,
                skin: 0.015,
                least: 2e-3,
                thinnest: 1e-3,
                settings: DecomposeSettings::DEFAULT,
            };
            let hulls = decompose(&mesh, &|_| true, &options);
            let corners: usize = hulls.iter().map(|h| h.points().len()).sum();
            println!(
                "{file}: tolerance {tolerance}: {} pieces, {corners} corners, {:.2?}",
                hulls.len(),
                began.elapsed()
            );
        }
    }
    Ok(())
}
