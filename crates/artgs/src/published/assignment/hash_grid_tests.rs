use super::*;

fn points() -> Vec<[f32; 3]> {
    let mut rng = Pcg64Mcg::new(3);
    (0..200).map(|_| std::array::from_fn(|_| 3.0 * rng.random::<f32>() - 1.5)).collect()
}

fn small() -> HashGrid {
    let config = HashGridConfig { levels: 4, log2_entries: 10, base_resolution: 4.0, ..Default::default() };
    HashGrid::new(&config, &mut Pcg64Mcg::new(1))
}

#[test]
fn paper_preset_has_three_dense_levels_of_twelve() {
    let grid = HashGrid::new(&HashGridConfig::default(), &mut Pcg64Mcg::new(1));
    let sizes: Vec<usize> = grid.levels.iter().map(|l| l.table.len()).collect();
    assert_eq!(sizes[..4], [4096, 32768, 262_144, 524_288]);
    assert!(grid.levels.iter().enumerate().all(|(l, level)| level.hashed == (l >= 3)));
    assert!((0..grid.entries(5)).all(|e| grid.entry(5, e).iter().all(|v| v.abs() <= 1e-4)));
    assert_eq!(grid.levels[11].scale, 32767.0);
}

#[test]
fn dense_levels_interpolate_linearly() {
    let mut grid = small();
    for z in 0..4 {
        for y in 0..4 {
            for x in 0..4 {
                grid.set_entry(0, x + 4 * y + 16 * z, [x as f32 + 10.0 * y as f32, z as f32]);
            }
        }
    }
    let p = [0.3f32, 0.55, 0.7];
    let at = p.map(|c| 3.0 * c + 0.5);
    let f = grid.features(0, p);
    assert!((f[0] - at[0] - 10.0 * at[1]).abs() < 1e-5 && (f[1] - at[2]).abs() < 1e-5);
}

#[test]
fn features_are_continuous_also_at_negative_coordinates() {
    let grid = small();
    for level in 0..4 {
        for &p in &points() {
            let q = p.map(|c| c + 1e-5);
            let (a, b) = (grid.features(level, p), grid.features(level, q));
            assert!((a[0] - b[0]).abs() < 1e-6, "{level} {p:?}");
        }
    }
}

#[test]
fn table_gradient_matches_finite_differences_and_inactive_levels_get_none() {
    let mut grid = small();
    let points = points();
    let weight = |l: usize, i: usize| [(i % 7) as f32 - 3.0, (l + i % 3) as f32];
    grid.forward(&points);
    grid.backward(3, weight);
    let loss = |grid: &HashGrid| -> f64 {
        let at = |l: usize, i: usize| {
            let (f, w) = (grid.features(l, points[i]), weight(l, i));
            f64::from(f[0]) * f64::from(w[0]) + f64::from(f[1]) * f64::from(w[1])
        };
        (0..4).map(|l| (0..points.len()).map(|i| at(l, i)).sum::<f64>()).sum()
    };
    let mut entries = Vec::new();
    grid.for_each_gradient(|l, e, g| entries.push((l, e, g)));
    assert!(entries.len() > 300 && entries.iter().all(|e| e.0 < 3));
    for (l, e, g) in entries.into_iter().step_by(17) {
        for f in 0..FEATURES {
            let base = loss(&grid);
            let start = grid.entry(l, e);
            let mut raised = start;
            raised[f] += 0.5;
            grid.set_entry(l, e, raised);
            let numeric = (loss(&grid) - base) / 0.5;
            grid.set_entry(l, e, start);
            assert!((numeric - f64::from(g[f])).abs() < 1e-4 * (1.0 + numeric.abs()), "{numeric} {}", g[f]);
        }
    }
}

#[test]
fn lazy_adam_equals_a_dense_one() {
    let mut grid = small();
    let points = points();
    let mut dense: Vec<[f64; 3]> = (0..grid.entries(2)).map(|e| [grid.entry(2, e)[0].into(), 0.0, 0.0]).collect();
    for step in 1..=40u32 {
        // Most entries wait for their next gradient for many steps.
        let some = &points[step as usize * 37 % 180..][..20];
        let rate = 1e-2 / f64::from(step);
        grid.forward(some);
        grid.backward(4, |l, i| [(i + l) as f32 - 20.0, 1.0]);
        let mut gradient = vec![0.0f64; dense.len()];
        grid.for_each_gradient(|l, e, g| {
            if l == 2 {
                gradient[e] = g[0].into()
            }
        });
        grid.adam_step(rate as f32);
        for ([p, m, v], g) in dense.iter_mut().zip(gradient) {
            *m = 0.9 * *m + 0.1 * g;
            *v = 0.999 * *v + 0.001 * g * g;
            let (mh, vh) = (*m / (1.0 - 0.9f64.powf(step.into())), *v / (1.0 - 0.999f64.powf(step.into())));
            *p -= rate * mh / (vh.sqrt() + 1e-15);
        }
    }
    for (e, b) in dense.iter().enumerate() {
        let a = grid.entry(2, e)[0];
        assert!((f64::from(a) - b[0]).abs() < 1e-6, "{a} {}", b[0]);
    }
}

#[test]
fn tables_taken_over_by_another_grid_continue_alike() {
    let (mut grid, points) = (small(), points());
    let train = |grid: &mut HashGrid, steps: std::ops::Range<usize>| {
        for step in steps {
            grid.forward(&points[step * 37 % 180..][..20]);
            grid.backward(4, |l, i| [(i + l) as f32 - 20.0, 1.0]);
            grid.adam_step(1e-2);
        }
    };
    train(&mut grid, 0..9);
    let mut other = HashGrid::new(
        &HashGridConfig { levels: 4, log2_entries: 10, base_resolution: 4.0, ..Default::default() },
        &mut Pcg64Mcg::new(2),
    );
    other.take_over(&grid.tables(), 9);
    train(&mut grid, 9..20);
    train(&mut other, 9..20);
    let mut apart = 0.0_f32;
    for l in 0..4 {
        for e in 0..grid.entries(l) {
            let (a, b) = (grid.entry(l, e), other.entry(l, e));
            (0..FEATURES).for_each(|f| apart = apart.max((a[f] - b[f]).abs()));
        }
    }
    assert!(apart < 2e-6, "{apart}");
}
