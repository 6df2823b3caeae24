//! The outline of the object where no depth was measured: it follows edges of the photo.

use super::complete::window;
use crate::discover::graph_cut::expand;
use glam::Vec3;

/// Pixels of an image, of which some may change sides.
pub(super) struct Sides<'a> {
    /// Of each pixel, true if it shows the object, false if it shows something else; none where nothing is known.
    pub(super) shows_object: &'a [Option<bool>],
    /// Pixels that may change sides: those whose depth was not measured.
    pub(super) free: &'a [bool],
    /// Straight colours; alpha is not read.
    pub(super) rgba: &'a [[u8; 4]],
    pub(super) width: usize,
}

/// The free pixels that change sides where the sum of two costs is least: 1 for each pixel that changes, and for each pair of neighbours
/// (eight) on different sides `cost` where their colours are alike, and a tenth of that where they differ (Boykov and Jolly 2001).
pub(super) fn changed(sides: &Sides<'_>, cost: f32) -> Vec<usize> {
    /// Share of the cost that does not fall with contrast. A fifth of it gives the same masks.
    const EVEN: f32 = 0.1;
    let Sides { shows_object, free, width, .. } = *sides;
    let nodes: Vec<usize> = (0..free.len()).filter(|&i| free[i] && shows_object[i].is_some()).collect();
    if nodes.is_empty() {
        return nodes;
    }
    let mut node_of = vec![u32::MAX; free.len()];
    nodes.iter().enumerate().for_each(|(node, &i)| node_of[i] = node as u32);
    let is_object = |i: usize| shows_object[i] == Some(true);
    let contrast = contrast(sides);
    let mut data: Vec<f32> = nodes.iter().flat_map(|&i| [f32::from(is_object(i)), f32::from(!is_object(i))]).collect();
    let mut edges = Vec::new();
    for (node, &i) in nodes.iter().enumerate() {
        for (j, length) in neighbours(i, width, free.len()) {
            let weight = cost * (EVEN + (1.0 - EVEN) * (-contrast * difference(sides.rgba, i, j)).exp()) / length;
            if node_of[j] == u32::MAX {
                // What was measured stays.
                shows_object[j].into_iter().for_each(|object| data[2 * node + usize::from(!object)] += weight);
            } else if i < j {
                edges.push((node as u32, node_of[j], weight));
            }
        }
    }
    let mut labels: Vec<u16> = nodes.iter().map(|&i| u16::from(is_object(i))).collect();
    // With two labels, one round of expansion finds the least sum.
    expand(&data, 2, &edges, 1.0, &mut labels, 1);
    nodes.into_iter().zip(labels).filter(|(i, label)| (*label == 1) != is_object(*i)).map(|(i, _)| i).collect()
}

/// One over twice the mean squared difference of neighbours in a row.
fn contrast(sides: &Sides<'_>) -> f32 {
    /// Squared difference of noise in an image of one colour.
    const LEAST: f32 = 1.0;
    let pairs = (1..sides.rgba.len()).filter(|i| i % sides.width > 0);
    let (sum, count) = pairs.fold((0.0, 0), |(sum, count), i| (sum + difference(sides.rgba, i - 1, i), count + 1));
    0.5 / (sum / count.max(1) as f32).max(LEAST)
}

fn difference(rgba: &[[u8; 4]], i: usize, j: usize) -> f32 {
    let color = |i: usize| Vec3::from(std::array::from_fn(|c| f32::from(rgba[i][c])));
    color(i).distance_squared(color(j))
}

/// The eight neighbours of a pixel, with their distances.
fn neighbours(i: usize, width: usize, pixels: usize) -> impl Iterator<Item = (usize, f32)> {
    let is_aside = move |j: usize| i % width != j % width && i / width != j / width;
    let length = move |j: usize| if is_aside(j) { std::f32::consts::SQRT_2 } else { 1.0 };
    window(i, 1, width, pixels).filter(move |j| *j != i).map(move |j| (j, length(j)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 24;

    /// A red object left of column 12, before a grey wall; columns 7 to 17 were not measured, and these of them are taken for the object.
    fn changed_of(is_object: impl Fn(usize, usize) -> bool, unknown: &[usize]) -> Vec<usize> {
        let pixels = || (0..WIDTH * 20).map(|i| (i % WIDTH, i / WIDTH));
        let free: Vec<bool> = pixels().map(|(x, _)| (7..18).contains(&x)).collect();
        let rgba: Vec<[u8; 4]> = pixels()
            .map(|(x, y)| {
                let noise = ((x * 7 + y * 5) % 6) as u8;
                if x < 12 { [180 + noise, 60, 40, 255] } else { [120, 122 + noise, 120, 255] }
            })
            .collect();
        let shows = |(i, (x, y)): (usize, (usize, usize))| match (unknown.contains(&i), x) {
            (true, _) => None,
            (_, ..7) => Some(true),
            (_, 18..) => Some(false),
            _ => Some(is_object(x, y)),
        };
        let shows_object: Vec<Option<bool>> = pixels().enumerate().map(shows).collect();
        changed(&Sides { shows_object: &shows_object, free: &free, rgba: &rgba, width: WIDTH }, 10.0)
    }

    #[test]
    fn a_ragged_outline_moves_to_the_edge_of_the_photo() {
        let ragged = |x: usize, y: usize| x < 9 + y * 7 % 6;
        let expected: Vec<usize> = (0..WIDTH * 20)
            .filter(|i| (7..18).contains(&(i % WIDTH)) && ragged(i % WIDTH, i / WIDTH) != (i % WIDTH < 12))
            .collect();
        assert_eq!(changed_of(ragged, &[]), expected);
        assert!(expected.len() > 20);
        // What is unknown stays so, and holds nothing.
        let unknown: Vec<usize> = expected.iter().copied().step_by(3).collect();
        let left: Vec<usize> = expected.iter().copied().filter(|i| !unknown.contains(i)).collect();
        assert_eq!(changed_of(ragged, &unknown), left);
    }

    #[test]
    fn an_outline_at_the_edge_of_the_photo_and_an_image_without_free_pixels_stay() {
        assert!(changed_of(|x, _| x < 12, &[]).is_empty());
        let none = Sides { shows_object: &[Some(true)], free: &[false], rgba: &[[9; 4]], width: 1 };
        assert!(changed(&none, 10.0).is_empty());
    }
}
