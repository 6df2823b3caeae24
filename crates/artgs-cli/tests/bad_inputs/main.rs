//! A table of bad and odd inputs. Each case copies a good input, changes it, runs the program and requires the listed exit code,
//! the listed words in one clear message, an answer in seconds, and nothing half-written.
//!
//! `ARTGS_SHOW=1 cargo test -p artgs-cli --test bad_inputs -- --nocapture` prints what every case answers.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "tests")]

mod arguments;
mod capture_files;
mod capture_images;
mod capture_views;
mod case;
mod containers;
mod corrections;
mod exports;
mod folder;
mod names;
mod recordings;
mod replicas;
mod seeds;
mod settings;
mod truth;
