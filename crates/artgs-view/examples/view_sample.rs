//! `view_sample DIR`: writes a small replica folder to DIR, its page to DIR/page.html and the page of its capture only to
//! DIR/capture.html, prints the URL of a server for it, and serves until standard input ends. The tests of the page use it.
//!
//! A run started from the page turns the door red; it fails if corrections delete part 3, and it does not end while a file
//! `hold` exists in DIR. `view_sample DIR --found` first shows discovered parts before training. With `view_sample DIR
//! --unable` no run can be started.
//!
//! `view_sample DIR --recording`: serves a recording whose box is saved in DIR/object_box.json, or in no file with `--unable`.
//!
//! `view_sample OUT --exported`: the same for an existing, exported replica folder.
//!
//! `view_sample DIR --live`: serves a run controlled by lines on standard input: `steps STAGE FROM TO`, `splats COUNT`
//! (the first `COUNT` links of the sample; labelled from two on), `finish` or `fail WHY`. Each line is answered with `ok`.

#![allow(clippy::print_stdout, clippy::unwrap_used, reason = "a fixture that fails loudly")]

#[path = "../tests/common/mod.rs"]
mod common;

use artgs_core::Splats;
use artgs_io::CentreEdit;
use artgs_view::{Live, Page, Placement, Rerun, Scene, Server, export_page};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

fn main() {
    let out: PathBuf = std::env::args_os().nth(1).expect("a folder to write to").into();
    if std::env::args().any(|a| a == "--live") {
        return follow();
    }
    if std::env::args().any(|a| a == "--recording") {
        return record(&out);
    }
    let page = if std::env::args().any(|a| a == "--exported") {
        Page::of_replica(&out).unwrap()
    } else {
        common::write_replica_folder(&out);
        common::page(&out)
    };
    export_page(&page, &out.join("page.html")).unwrap();
    let capture = Page {
        scene: Scene { links: Vec::new(), scores: None, ..page.scene.clone() },
        files: page.files.clone(),
        corrected: None,
    };
    export_page(&capture, &out.join("capture.html")).unwrap();
    let has_flag = |flag: &str| std::env::args().any(|a| a == flag);
    let shown = if has_flag("--found") { common::found_page() } else { page.clone() };
    let folder = out.clone();
    let again = move |live: &Arc<Live>| made_again(live, &folder, &page);
    let rerun: Result<Box<Rerun<'static>>, String> =
        if has_flag("--unable") { Err("there are no photos".into()) } else { Ok(Box::new(again)) };
    serve(&Server::bind(shown, Some(0), Some(out)).unwrap().with_rerun(rerun));
}

fn record(folder: &Path) {
    let page = common::recording_page();
    export_page(&page, &folder.join("page.html")).unwrap();
    let unable = std::env::args().any(|a| a == "--unable");
    let file = if unable { Err("the folder is read-only".into()) } else { Ok(folder.join("object_box.json")) };
    serve(&Server::bind(page, Some(0), None).unwrap().with_box(file));
}

/// Serves until standard input ends.
fn serve(server: &Server) {
    println!("{}", server.url());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        let _ = std::io::stdin().read_to_end(&mut Vec::new());
        stop.store(true, Ordering::Relaxed);
    });
}

/// Simulates a run.
fn made_again(live: &Live, folder: &Path, page: &Page) -> Result<Page, String> {
    live.stage_started("discover");
    live.stage_finished("discover", 0.0, true);
    for step in 1..=20 {
        live.event("articulate", [step, 20], Some(0.5), Some(20.0 + step as f64), Some(1234));
        std::thread::sleep(Duration::from_millis(50));
    }
    while folder.join("hold").exists() {
        std::thread::sleep(Duration::from_millis(20));
    }
    let corrections = artgs_io::read_corrections(folder).map_err(|e| e.to_string())?.unwrap_or_default();
    if corrections.centres.contains(&CentreEdit::Delete { part: 3 }) {
        return Err("the knob is required".into());
    }
    let mut page = page.clone();
    page.scene.name = "cabinet again".into();
    page.scene.links[1].colour = [255, 0, 0];
    Ok(page)
}

fn follow() {
    // A unit of the capture is half a metre of the sample, and the capture lies on its side.
    let rotation = glam::DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let placement = Placement { scale: 0.5, rotation, ..Placement::default() };
    let live = Arc::new(Live::new("cabinet", placement));
    let server = Server::bind_live(Arc::clone(&live), Some(0)).unwrap();
    println!("{}", server.url());
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| server.run(&stop));
        for line in std::io::stdin().lines() {
            execute(&live, &placement, &line.unwrap());
            println!("ok");
        }
        stop.store(true, Ordering::Relaxed);
    });
}

fn execute(live: &Live, placement: &Placement, line: &str) {
    let words: Vec<&str> = line.split(' ').collect();
    let number = |i: usize| words[i].parse::<usize>().unwrap();
    match words[0] {
        "steps" => {
            for step in number(2)..=number(3) {
                let share = step as f64 / number(3) as f64;
                live.event(words[1], [step, 400], Some(0.5 - 0.4 * share), Some(18.0 + 10.0 * share), Some(1234));
            }
        }
        "splats" => {
            let (splats, labels) = captured(placement, number(1));
            while !live.wants_splats() {
                std::thread::sleep(Duration::from_millis(20));
            }
            live.update_splats(&splats, &labels);
        }
        "finish" => live.finish(Ok(())),
        "fail" => live.finish(Err(words[1..].join(" "))),
        other => panic!("unknown: {other}"),
    }
}

/// Gaussians of the first links of the sample in the frame of its capture, with their parts where there are any.
fn captured(placement: &Placement, links: usize) -> (Splats, Vec<u16>) {
    let (mut all, mut labels) = (Splats::empty(0), Vec::new());
    for (label, link) in common::cabinet().links.iter().take(links).enumerate() {
        let part = link.splats.as_ref().unwrap();
        let at = all.len();
        all.extend_from(part, 0..part.len());
        for (mean, log_scale) in all.means[at..].iter_mut().zip(&mut all.log_scales[at..]) {
            let object = glam::DVec3::from_array(mean.map(f64::from)) + link.origin;
            *mean = (placement.rotation.inverse() * object / placement.scale).as_vec3().to_array();
            *log_scale = log_scale.map(|v| v - placement.scale.ln() as f32);
        }
        labels.extend(vec![label as u16; part.len()]);
    }
    if links < 2 {
        labels.clear();
    }
    (all, labels)
}
