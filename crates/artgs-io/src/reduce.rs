//! Smaller images: every new pixel is the mean of the area that it covers.

/// Size of an image whose longer side is at most `longest_side` pixels.
pub(crate) fn reduced_size(width: u32, height: u32, longest_side: u32) -> (u32, u32) {
    let longest = width.max(height);
    if longest <= longest_side {
        return (width, height);
    }
    let side = |n: u32| ((f64::from(n) * f64::from(longest_side) / f64::from(longest)).round() as u32).max(1);
    (side(width), side(height))
}

/// Straight RGBA, row-major, at a smaller size. Where alpha varies, colours are weighted by it, so that what is outside a mask
/// does not show at its border.
pub(crate) fn reduced_rgba(pixels: &[[u8; 4]], from: (u32, u32), to: (u32, u32)) -> Vec<[u8; 4]> {
    let (across, down) = (Cover::new(from.0, to.0), Cover::new(from.1, to.1));
    let wide = from.0 as usize;
    let opaque = pixels.iter().all(|p| p[3] == u8::MAX);
    let mut out = Vec::with_capacity(to.0 as usize * to.1 as usize);
    // Sums of alpha times colour, and of alpha.
    let mut row = vec![[0.0_f32; 4]; wide];
    for spans in &down.spans {
        row.fill([0.0; 4]);
        for &(y, share) in spans {
            for (sum, pixel) in row.iter_mut().zip(&pixels[y * wide..]) {
                let alpha = f32::from(pixel[3]);
                let weight = if opaque { share } else { share * alpha };
                (0..3).for_each(|c| sum[c] += weight * f32::from(pixel[c]));
                sum[3] += share * alpha;
            }
        }
        out.extend(across.spans.iter().map(|spans| {
            let mut sum = [0.0_f32; 4];
            for &(x, share) in spans {
                (0..4).for_each(|c| sum[c] += share * row[x][c]);
            }
            if !opaque {
                (0..3).for_each(|c| sum[c] /= sum[3].max(f32::MIN_POSITIVE));
            }
            sum.map(|v| (v + 0.5) as u8)
        }));
    }
    out
}

/// Indices of the pixels in the middle of the new ones, row-major: for images whose values must not be mixed, such as depth.
pub(crate) fn nearest(from: (u32, u32), to: (u32, u32)) -> impl Iterator<Item = usize> {
    let middle = |i: u32, from: u32, to: u32| ((f64::from(i) + 0.5) * f64::from(from) / f64::from(to)) as usize;
    (0..to.1).flat_map(move |y| {
        let row = middle(y, from.1, to.1) * from.0 as usize;
        (0..to.0).map(move |x| row + middle(x, from.0, to.0))
    })
}

/// For every pixel of a reduced line the pixels that it covers, with their shares.
struct Cover {
    spans: Vec<Vec<(usize, f32)>>,
}

impl Cover {
    fn new(from: u32, to: u32) -> Self {
        let step = f64::from(from) / f64::from(to);
        let span = |i: u32| {
            let (begin, end) = (f64::from(i) * step, (f64::from(i + 1) * step).min(f64::from(from)));
            let pixels = begin as usize..(end.ceil() as usize).min(from as usize);
            pixels.map(|p| (p, ((end.min(p as f64 + 1.0) - begin.max(p as f64)) / step) as f32)).collect()
        };
        Self { spans: (0..to).map(span).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_outside_a_mask_do_not_show_at_its_border() {
        let row = [[200, 100, 50, 255], [0, 0, 0, 0], [9, 9, 9, 0], [7, 7, 7, 0]];
        assert_eq!(reduced_rgba(&row, (4, 1), (2, 1)), [[200, 100, 50, 128], [0, 0, 0, 0]]);
    }

    #[test]
    fn nearest_pixels_are_in_the_middle() {
        assert_eq!(nearest((6, 3), (2, 1)).collect::<Vec<_>>(), [7, 10]);
        assert_eq!(nearest((3, 2), (3, 2)).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn the_longer_side_is_limited() {
        assert_eq!(reduced_size(4000, 3000, 1600), (1600, 1200));
        assert_eq!(reduced_size(3000, 4000, 1600), (1200, 1600));
        assert_eq!(reduced_size(800, 600, 1600), (800, 600));
        assert_eq!(reduced_size(4000, 1, 1600), (1600, 1));
    }
}
