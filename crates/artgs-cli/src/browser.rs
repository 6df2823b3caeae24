//! The user's browser.

use crate::failure::Failure;
use crate::output::{note, say};
use crate::style::Style;
use anyhow::Context;
use artgs_view::Server;
use serde_json::json;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Becomes true at Ctrl-C. A run in progress then ends at once: its files are complete, and it can be resumed.
pub(crate) fn stopped(server: &Arc<Server>) -> Result<Arc<AtomicBool>, Failure> {
    const INTERRUPTED: i32 = 130;
    let stop = Arc::new(AtomicBool::new(false));
    let (flag, server) = (Arc::clone(&stop), Arc::clone(server));
    let end = move || {
        if server.is_busy() {
            std::process::exit(INTERRUPTED);
        }
        flag.store(true, Ordering::Relaxed);
    };
    ctrlc::set_handler(end).context("cannot watch for Ctrl-C")?;
    Ok(stop)
}

/// Says where a page is, and shows it if asked to.
pub(crate) fn announce(url: &str, show: bool, style: Style) -> Result<(), Failure> {
    if style.json {
        say(json!({ "event": "listening", "url": url }))?;
    } else {
        say(format!("page at {url} (Ctrl-C to end)"))?;
    }
    if show && !open(url) {
        note("no browser could be started; open the address yourself", style);
    }
    Ok(())
}

/// Shows an address in the user's browser; false if that cannot be started.
fn open(url: &str) -> bool {
    let (program, before): (&str, &[&str]) = match std::env::consts::OS {
        "macos" => ("open", &[]),
        "windows" => ("cmd", &["/C", "start", ""]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(before).arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().is_ok()
}
