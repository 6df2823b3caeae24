use super::*;

fn splats(n: usize, sh_degree: usize) -> Splats {
    let stride = 3 * (sh_degree + 1) * (sh_degree + 1);
    Splats {
        means: (0..n).map(|i| [i as f32 * 1e-3, 0.5, -0.25]).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; n],
        log_scales: vec![[-3.0; 3]; n],
        logit_opacities: vec![1.0; n],
        sh_degree,
        sh: (0..n * stride).map(|i| (i as f32 * 0.37).sin() * 0.4).collect(),
    }
}

fn read(live: &Live, since: u64) -> Value {
    serde_json::from_str(&live.json(since)).unwrap()
}

fn unpacked(bytes: &[u8]) -> Splats {
    artgs_io::asset::spz::read_spz_bytes(bytes).unwrap()
}

#[test]
fn gaussians_are_asked_for_only_while_a_page_looks_and_has_the_last_ones() {
    let live = Live::new("lamp", Placement::default());
    assert!(!live.wants_splats(), "no page is open");
    live.update_splats(&splats(10, 0), &[]);
    assert_eq!(live.spz(Tint::Photo), None);
    assert_eq!(read(&live, 0)["splats"], 0);
    assert!(live.wants_splats() && live.wants_splats());
    live.update_splats(&splats(10, 1), &[0, 1, 1, 2, 0, 0, 0, 0, 0, 0]);
    assert!(!live.wants_splats());
    let json = read(&live, 0);
    assert_eq!((&json["splats"], &json["parts"]), (&1.into(), &3.into()));
    let rest = live.now().given.unwrap().1;
    assert!(rest >= PERIOD, "{rest:?}");
    // The interval has passed, but the page has not loaded the version yet.
    live.now().given = Some((Instant::now(), Duration::ZERO));
    assert!(!live.wants_splats());
    assert_eq!(unpacked(&live.spz(Tint::Photo).unwrap()).len(), 10);
    assert!(live.now().given.unwrap().1 > Duration::ZERO, "packing does not count");
    live.now().given = Some((Instant::now(), Duration::ZERO));
    assert!(live.wants_splats());
    live.now().polled = Instant::now().checked_sub(PRESENCE);
    assert!(!live.wants_splats(), "the page is closed");
}

#[test]
fn long_waits_make_long_rests() {
    let live = Live::new("lamp", Placement::default());
    read(&live, 0);
    assert!(live.wants_splats());
    std::thread::sleep(Duration::from_millis(30));
    live.update_splats(&splats(3, 0), &[]);
    let rest = live.now().given.unwrap().1;
    assert!(rest >= Duration::from_secs(3), "{rest:?}");
}

#[test]
fn gaussians_have_the_colours_of_photos_or_of_parts() {
    let live = Live::new("lamp", Placement::default());
    read(&live, 0);
    let given = splats(4, 2);
    live.update_splats(&given, &[0, 1, 2, 1]);
    let photo = unpacked(&live.spz(Tint::Photo).unwrap());
    assert_eq!((photo.sh_degree, photo.len()), (0, 4));
    for (i, sh) in photo.sh.chunks_exact(3).enumerate() {
        let want = &given.sh[i * 27..][..3];
        assert!(sh.iter().zip(want).all(|(a, b)| (a - b).abs() < 0.02), "{sh:?} {want:?}");
    }
    let parts = unpacked(&live.spz(Tint::Parts).unwrap());
    for (sh, label) in parts.sh.chunks_exact(3).zip([0, 1, 2, 1]) {
        let color = crate::page::colour(label);
        let seen = [0, 1, 2].map(|k| (sh[k] * 0.282_094_8 + 0.5) * 255.0);
        assert!(seen.iter().zip(color).all(|(a, b)| (a - f32::from(b)).abs() < 2.0), "{seen:?} {color:?}");
    }
    let mut broken = splats(4, 0);
    broken.means[2][1] = f32::NAN;
    live.now().given = Some((Instant::now(), Duration::ZERO));
    live.update_splats(&broken, &[]);
    assert_eq!((live.spz(Tint::Photo), read(&live, 0)["parts"].as_u64()), (None, Some(0)));
}

#[test]
fn curves_come_once_and_stay_bounded() {
    let live = Live::new("lamp", Placement::default());
    live.stage_started("single");
    (1..=3).for_each(|step| live.event("single", [step, 100], Some(f64::from(step as u32)), Some(20.0), Some(7)));
    let first = read(&live, 0);
    assert_eq!(first["points"], json!([[0, 1, 1.0, 20.0], [0, 2, 2.0, 20.0], [0, 3, 3.0, 20.0]]));
    assert_eq!(first["progress"], json!({"step": 3, "total": 100, "gaussians": 7}));
    let next = first["since"].as_u64().unwrap();
    assert_eq!(read(&live, next)["points"], json!([]));
    live.stage_finished("single", 1.5, false);
    live.event("articulate", [1, 10], Some(f64::NAN), None, None);
    let second = read(&live, next);
    assert_eq!(second["points"], json!([[1, 1, null, null]]));
    assert_eq!(second["stages"][0], json!({"name": "single", "seconds": 1.5, "reused": false}));
    assert_eq!(second["stages"][1]["name"], "articulate");
    // A page of an earlier run requests with its last `since`.
    assert_eq!(read(&live, 1000)["since"], 4);

    let steps = 9 * MOST_POINTS;
    (2..=steps).for_each(|step| live.event("articulate", [step, steps], Some(step as f64), None, None));
    let all = read(&live, 0);
    let points = all["points"].as_array().unwrap();
    assert!(points.len() <= MOST_POINTS && points.len() > MOST_POINTS / 3, "{}", points.len());
    let rows: Vec<(u64, u64, f64)> =
        points[3..].iter().map(|p| (p[0].as_u64().unwrap(), p[1].as_u64().unwrap(), p[2].as_f64().unwrap())).collect();
    assert!(rows.windows(2).all(|w| w[0].1 < w[1].1 && w[0].2 < w[1].2), "in order");
    assert!(rows.iter().all(|r| r.0 == 1 && r.2 <= r.1 as f64 && r.1 as f64 - r.2 <= 16.0), "means of their steps");
}

#[test]
fn the_end_is_sent() {
    let live = Live::new("lamp", Placement::default());
    live.wait_until_end_is_shown(Duration::from_secs(60));
    assert_eq!(read(&live, 0)["state"], "running");
    live.finish(Err("no depth".into()));
    live.finish(Ok(()));
    let json = read(&live, 0);
    assert_eq!((&json["state"], &json["message"]), (&"failed".into(), &"no depth".into()));
    live.wait_until_end_is_shown(Duration::from_secs(60));
}

/// `cargo test -p artgs-view --release -- --ignored --nocapture cost`
#[test]
#[ignore = "measures times"]
#[allow(clippy::print_stdout, reason = "its purpose")]
fn cost_of_a_snapshot() {
    let live = Live::new("lamp", Placement::default());
    let (mut given, labels) = (splats(60_000, 3), vec![1; 60_000]);
    // Data that compresses badly.
    let noise = |i: usize| ((i as f32 * 12.989).sin() * 43_758.547).fract();
    given.means.as_flattened_mut().iter_mut().enumerate().for_each(|(i, v)| *v = noise(i));
    given.rotations.as_flattened_mut().iter_mut().enumerate().for_each(|(i, v)| *v = noise(i + 1));
    given.log_scales.as_flattened_mut().iter_mut().enumerate().for_each(|(i, v)| *v = noise(i + 2) - 4.0);
    given.logit_opacities.iter_mut().enumerate().for_each(|(i, v)| *v = 4.0 * noise(i + 3));
    for _ in 0..5 {
        read(&live, 0);
        live.now().given = None;
        assert!(live.wants_splats());
        let begun = Instant::now();
        live.update_splats(&given, &labels);
        let copied = begun.elapsed();
        let bytes = live.spz(Tint::Photo).unwrap().len();
        println!("copied in {copied:?}, packed in {:?}, {bytes} bytes", begun.elapsed() - copied);
    }
    let begun = Instant::now();
    (0..100_000).for_each(|step| {
        live.event("articulate", [step, 100_000], Some(1.0), Some(1.0), None);
        live.wants_splats();
    });
    println!("a step: {:?}", begun.elapsed() / 100_000);
}
