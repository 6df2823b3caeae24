//! `view_sample DIR`: writes a small replica folder to DIR, the page of it to DIR/page.html and that of its capture alone
//! to DIR/capture.html, prints the address of a server for it, and serves until standard input ends. The tests of the page
//! run it.
//!
//! `view_sample OUT --exported`: the same for a replica folder that exists and was exported.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a fixture that fails loudly")]

#[path = "../tests/common/mod.rs"]
mod common;

use artgs_view::{Page, Scene, Server, export_page};
use std::io::Read as _;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

fn main() {
    let out: PathBuf = std::env::args_os().nth(1).expect("a folder to write to").into();
    let page = if std::env::args().any(|a| a == "--exported") {
        Page::of_replica(&out).unwrap()
    } else {
        common::write_replica_folder(&out);
        common::page(&out)
    };
    export_page(&page, &out.join("page.html")).unwrap();
    let capture =
        Page { scene: Scene { links: Vec::new(), scores: None, ..page.scene.clone() }, files: page.files.clone() };
    export_page(&capture, &out.join("capture.html")).unwrap();
    let server = Server::bind(page, Some(0), Some(out)).unwrap();
    println!("{}", server.url());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        stop.store(true, Ordering::Relaxed);
    });
}
