//! Every reader of untrusted input on mutated files: no panic, no endless work, no memory for what a header only claims.
//!
//! Each target mutates one file of a valid seed folder per case and reads the folder. Case `n` of a target is always the same, so a
//! failure is found again by its number. Targets run in processes of their own with a limit on memory; a case that ends
//! the process, or takes longer than [`worker::PATIENCE`], fails.
//!
//! `cargo test -p artgs-cli --test fuzz` runs a few seconds of each target. `ARTGS_FUZZ_CASES=1000000` runs so many of each, and
//! `ARTGS_FUZZ_FROM=4711 ARTGS_FUZZ_CASES=1` one. Inputs that once failed are in `regressions`, and always run.

#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, reason = "tests")]

mod mutate;
mod requests;
mod seeds;
mod targets;
mod worker;

/// One test per target, and the worker that they start.
macro_rules! targets {
    ($($name:ident),* $(,)?) => {
        $(#[test]
        fn $name() {
            worker::start(stringify!($name));
        })*

        /// Every target has a test.
        #[test]
        fn all_targets_are_tested() {
            let tested = [$(stringify!($name)),*];
            assert_eq!(targets::ALL.map(|target| target.name).as_slice(), tested);
        }
    };
}

targets![
    capture,
    capture_paris,
    colmap,
    corrected_run,
    corrections,
    found_parts,
    ground_truth,
    images,
    mcap,
    mesh,
    nerfstudio,
    npy,
    polycam,
    realsense_bag,
    record3d,
    record3d_archive,
    replica,
    report,
    requests,
    scanner_app,
    seven_scenes,
    settings,
    splats,
    spz,
    stray,
    tensors,
    tum,
];

/// The process of a target. Ignored: it needs its environment.
#[test]
#[ignore = "started by the other tests"]
fn worker_process() {
    worker::run();
}
