//! Files of replicas as arrays. No array is copied: numpy takes the memory that was read into.

use crate::errors::bad_input;
use artgs_core::Replica;
use artgs_io::{read_mesh_ply, read_splat_ply};
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;

/// An array `[n][C]` of the rows of a vector.
pub(crate) fn rows<'py, T: Element, const C: usize>(
    py: Python<'py>,
    rows: Vec<[T; C]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let n = rows.len();
    PyArray1::from_vec(py, rows.into_flattened()).reshape([n, C])
}

type MeshArrays<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u8>>, Bound<'py, PyArray2<u32>>);

/// Vertices, colours (of no rows if there are none) and triangles of a mesh.
#[pyfunction]
pub(crate) fn read_mesh(py: Python<'_>, path: PathBuf) -> PyResult<MeshArrays<'_>> {
    let mesh = py.detach(|| read_mesh_ply(&path)).map_err(|e| bad_input(py, e))?;
    Ok((rows(py, mesh.vertices)?, rows(py, mesh.colors)?, rows(py, mesh.triangles)?))
}

type SplatArrays<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray3<f32>>,
    Option<Bound<'py, PyArray1<u16>>>,
);

/// Means, rotations, logarithms of scales, logits of opacities, harmonics and parts of Gaussians.
#[pyfunction]
pub(crate) fn read_splats(py: Python<'_>, path: PathBuf) -> PyResult<SplatArrays<'_>> {
    let (splats, parts) = py.detach(|| read_splat_ply(&path)).map_err(|e| bad_input(py, e))?;
    let shape = [splats.len(), splats.sh_stride() / 3, 3];
    Ok((
        rows(py, splats.means)?,
        rows(py, splats.rotations)?,
        rows(py, splats.log_scales)?,
        PyArray1::from_vec(py, splats.logit_opacities),
        PyArray1::from_vec(py, splats.sh).reshape(shape)?,
        parts.map(|parts| PyArray1::from_vec(py, parts)),
    ))
}

/// The checked `replica.json` of a folder.
#[pyfunction]
pub(crate) fn read_replica(py: Python<'_>, folder: PathBuf) -> PyResult<String> {
    let replica = artgs_io::read_replica(&folder).map_err(|e| bad_input(py, e))?;
    serde_json::to_string(&replica).map_err(|e| bad_input(py, e))
}

/// Motion of every part of a replica, given as JSON, from the start to joint values, `[parts][4][4]`.
#[pyfunction]
pub(crate) fn poses<'py>(py: Python<'py>, replica: &str, values: Vec<f64>) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let replica: Replica = serde_json::from_str(replica).map_err(|e| bad_input(py, e))?;
    let parts = replica.parts.len();
    let matrices: Vec<f64> = (0..parts).flat_map(|part| matrix(&replica.pose(part, &values))).collect();
    PyArray1::from_vec(py, matrices).reshape([parts, 4, 4])
}

/// Rows of the matrix of a motion.
pub(crate) fn matrix(motion: &artgs_core::Rigid) -> [f64; 16] {
    let (r, t) = (motion.matrix(), motion.translation);
    let mut out = [0.0; 16];
    for i in 0..3 {
        out[4 * i..4 * i + 4].copy_from_slice(&[r.x_axis[i], r.y_axis[i], r.z_axis[i], t[i]]);
    }
    out[15] = 1.0;
    out
}
