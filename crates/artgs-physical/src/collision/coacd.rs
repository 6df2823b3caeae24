//! Convex decomposition by CoACD, where its Python package is installed.

use artgs_core::Mesh;
use glam::DVec3;
use serde_json::json;
use std::io::Write;
use std::process::{Command, Stdio};

/// Names another interpreter than `python3`.
const PYTHON: &str = "ARTGS_PYTHON";

/// Reads a mesh from standard input and writes the corners of its pieces; CoACD itself talks on the real standard output.
const SCRIPT: &str = "
import json, os, sys
real = os.dup(1)
os.dup2(2, 1)
import coacd, numpy
mesh = json.load(sys.stdin)
coacd.set_log_level('error')
parts = coacd.run_coacd(coacd.Mesh(numpy.array(mesh['vertices']), numpy.array(mesh['triangles'])), seed=0)
os.write(real, json.dumps([numpy.asarray(p[0]).tolist() for p in parts]).encode())
";

/// Corners of CoACD's pieces.
pub(crate) fn decompose(mesh: &Mesh) -> Result<Vec<Vec<DVec3>>, String> {
    let python = std::env::var(PYTHON).unwrap_or_else(|_| "python3".into());
    let advice = format!(
        "install it (`pip install coacd`), name an interpreter that has it in {PYTHON}, or leave out --collision"
    );
    let failed = |reason: &dyn std::fmt::Display| format!("CoACD cannot be run by {python}: {reason}; {advice}");
    let mut child = Command::new(&python)
        .args(["-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .map_err(|e| failed(&e))?;
    let text = json!({ "vertices": mesh.vertices, "triangles": mesh.triangles }).to_string();
    // A child that stops early says why on its standard error.
    let fed = child.stdin.take().map(|mut pipe| pipe.write_all(text.as_bytes()));
    let output = child.wait_with_output().map_err(|e| failed(&e))?;
    if !output.status.success() || fed.is_some_and(|fed| fed.is_err()) {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(failed(&said.lines().rfind(|line| !line.is_empty()).unwrap_or("it stopped without a word")));
    }
    let pieces: Vec<Vec<[f64; 3]>> = serde_json::from_slice(&output.stdout).map_err(|e| failed(&e))?;
    Ok(pieces.into_iter().map(|corners| corners.into_iter().map(DVec3::from_array).collect()).collect())
}
