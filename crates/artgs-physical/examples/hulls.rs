//! Prints the convex pieces of the given meshes.
#![allow(clippy::print_stdout, reason = "an example")]
use artgs_physical::decompose::{DecomposeOptions, decompose};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for file in std::env::args().skip(1) {
        let mesh = artgs_io::read_mesh_ply(file.as_ref())?;
        for concavity in [0.01, 0.004, 0.002] {
            let began = std::time::Instant::now();
            let options =
                DecomposeOptions { voxel: 0.015, concavity, most: 64, corners: 32, skin: 0.007, thinnest: 1e-3 };
            let hulls = decompose(&mesh, &options);
            let corners: usize = hulls.iter().map(|h| h.points().len()).sum();
            println!(
                "{file}: concavity {concavity}: {} pieces, {corners} corners, {:.2?}",
                hulls.len(),
                began.elapsed()
            );
        }
    }
    Ok(())
}
