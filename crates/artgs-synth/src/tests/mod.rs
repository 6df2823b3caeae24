mod captures;
mod degradations;
mod objects;

use crate::CaptureOptions;

fn small() -> CaptureOptions {
    CaptureOptions { views: 3, test_views: 1, size: 48, ..Default::default() }
}
