mod captures;
mod degradations;
mod objects;

use crate::PhotoOptions;

fn small() -> PhotoOptions {
    PhotoOptions { views: 3, test_views: 1, size: 48, ..Default::default() }
}
