//! Robust mean of colour samples.

use super::view::Sample;
use glam::Vec3;

/// Robust mean of samples, [0, 255]. It starts at their weighted median by brightness; each iteration is a mean in which a
/// sample has less weight the farther it is from the previous mean, a quarter at distance `outlier`. None without samples.
pub(super) fn blend(samples: &mut [Sample], outlier: f32, rounds: usize) -> Option<Vec3> {
    let total: f32 = samples.iter().map(|s| s.weight).sum();
    if total.is_nan() || total <= 0.0 {
        return None;
    }
    samples.sort_unstable_by(|a, b| {
        let brightness = a.color.element_sum().total_cmp(&b.color.element_sum());
        brightness.then(a.weight.total_cmp(&b.weight)).then(a.color.x.total_cmp(&b.color.x))
    });
    let mut below = 0.0;
    let median = samples.iter().find(|s| {
        below += s.weight;
        2.0 * below >= total
    });
    let mut center = median.map_or(samples[0].color, |s| s.color);
    for _ in 0..rounds {
        let mut sum = (Vec3::ZERO, 0.0);
        for s in samples.iter() {
            let near = 1.0 / (1.0 + s.color.distance_squared(center) / (outlier * outlier));
            let weight = s.weight * near * near;
            sum.0 += s.color * weight;
            sum.1 += weight;
        }
        if sum.1 > 0.0 {
            center = sum.0 / sum.1;
        }
    }
    Some(center)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreement_wins_over_a_highlight() {
        let sample = |v: f32, weight: f32| Sample { color: Vec3::new(v, 50.0, 20.0), weight, clear: true };
        let mut samples = vec![sample(250.0, 2.0), sample(100.0, 1.0), sample(102.0, 1.0), sample(98.0, 1.0)];
        let color = blend(&mut samples, 20.0, 3).unwrap();
        assert!(color.distance(Vec3::new(100.0, 50.0, 20.0)) < 2.5, "{color}");
        samples.truncate(0);
        assert!(blend(&mut samples, 20.0, 3).is_none());
        assert!(blend(&mut [sample(1.0, 0.0)], 20.0, 3).is_none());
    }
}
