//! Captures in memory.

use crate::arrays::{matrix, rows};
use crate::errors::bad_input;
use artgs_core::{PerState, State, View};
use artgs_io::capture::{CameraAxes, PosedImage, capture_of_images};
use numpy::{
    PyArray1, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyReadonlyArray4,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// Posed images of both states.
#[pyclass(frozen, module = "artgs._native")]
pub(crate) struct Capture(pub(crate) Arc<artgs_core::Capture>);

/// Arrays of one state: colours `[n][h][w][4]`, depth `[n][h][w]`, camera-to-world `[n][4][4]`, (fx, fy, cx, cy) `[n][4]`.
type StateArrays<'py> = (
    PyReadonlyArray4<'py, u8>,
    Option<PyReadonlyArray3<'py, f32>>,
    PyReadonlyArray3<'py, f64>,
    PyReadonlyArray2<'py, f64>,
);

/// Name, colours `[h][w][4]`, depth `[h][w]`, camera-to-world `[4][4]`, (fx, fy, cx, cy).
type ViewArrays<'py> = (
    String,
    Bound<'py, PyArray3<u8>>,
    Option<Bound<'py, PyArray2<f32>>>,
    Bound<'py, PyArray2<f64>>,
    (f64, f64, f64, f64),
);

#[pymethods]
impl Capture {
    /// Reads a folder.
    #[staticmethod]
    fn load(py: Python<'_>, folder: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| artgs_io::load_capture(&folder)).map_err(|e| bad_input(py, e))?;
        Ok(Self(Arc::new(read)))
    }

    /// From contiguous arrays of consistent shapes.
    #[staticmethod]
    fn from_arrays(py: Python<'_>, start: StateArrays<'_>, end: StateArrays<'_>, opengl: bool) -> PyResult<Self> {
        let images = PerState::new(images(&start)?, images(&end)?);
        let axes = if opengl { CameraAxes::OpenGl } else { CameraAxes::OpenCv };
        let made = py.detach(|| capture_of_images(images, axes)).map_err(|e| bad_input(py, e))?;
        Ok(Self(Arc::new(made)))
    }

    /// What was unexpected, one sentence each.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.0.warnings.clone()
    }

    /// Number of training or held-out views of state 0 or 1.
    fn count(&self, state: usize, test: bool) -> usize {
        self.views(state, test).len()
    }

    /// One view; none if there is no such view.
    fn view<'py>(&self, py: Python<'py>, state: usize, test: bool, index: usize) -> PyResult<Option<ViewArrays<'py>>> {
        self.views(state, test).get(index).map(|view| arrays(py, view)).transpose()
    }
}

impl Capture {
    fn views(&self, state: usize, test: bool) -> &[View] {
        let views = &self.0.states[if state == 0 { State::START } else { State::END }];
        if test { &views.test } else { &views.train }
    }
}

fn images((colors, depths, poses, lenses): &StateArrays<'_>) -> PyResult<Vec<PosedImage>> {
    let shape = colors.shape();
    let (height, width) = (shape[1], shape[2]);
    let pixels = width * height;
    let (colors, poses, lenses) = (colors.as_slice()?, poses.as_slice()?, lenses.as_slice()?);
    let depths = depths.as_ref().map(|depths| depths.as_slice()).transpose()?;
    let image = |i: usize| PosedImage {
        size: [width as u32, height as u32],
        rgba: colors[4 * pixels * i..4 * pixels * (i + 1)].as_chunks::<4>().0.to_vec(),
        depth: depths.map(|depths| depths[pixels * i..pixels * (i + 1)].to_vec()),
        intrinsics: std::array::from_fn(|c| lenses[4 * i + c]),
        camera_to_world: std::array::from_fn(|r| std::array::from_fn(|c| poses[16 * i + 4 * r + c])),
    };
    Ok((0..shape[0]).map(image).collect())
}

fn arrays<'py>(py: Python<'py>, view: &View) -> PyResult<ViewArrays<'py>> {
    let ((width, height), k) = (view.size(), &view.camera.intrinsics);
    let depth = view.depth.as_ref().map(|d| PyArray1::from_vec(py, d.iter().collect()).reshape([height, width]));
    let pose = matrix(&view.camera.world_to_camera.inverse());
    Ok((
        view.name.clone(),
        rows(py, view.rgba.clone())?.reshape([height, width, 4])?,
        depth.transpose()?,
        PyArray1::from_vec(py, pose.to_vec()).reshape([4, 4])?,
        (k.fx, k.fy, k.cx, k.cy),
    ))
}
