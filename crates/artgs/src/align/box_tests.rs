//! Objects that are selected by a box.

use super::*;
use artgs_core::View;
use artgs_core::capture::OBJECT_ALPHA;
use artgs_synth::recording::{RecordingCaptureOptions, render_recording};

/// Pixels of the object in both views, and in at least one of them. Views are windows of the same image.
fn shared_pixels(a: &View, b: &View) -> [usize; 2] {
    let (k, l) = (a.camera.intrinsics, b.camera.intrinsics);
    let shift = [(k.cx - l.cx).round() as i64, (k.cy - l.cy).round() as i64];
    let object = |view: &View, x: i64, y: i64| {
        let (width, height) = view.size();
        let inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
        inside && view.rgba[y as usize * width + x as usize][3] >= OBJECT_ALPHA
    };
    let (mut both, mut own, mut others) = (0, 0, 0);
    for (y, x) in (0..a.size().1 as i64).flat_map(|y| (0..a.size().0 as i64).map(move |x| (y, x))) {
        own += usize::from(object(a, x, y));
        both += usize::from(object(a, x, y) && object(b, x - shift[0], y - shift[1]));
    }
    for (y, x) in (0..b.size().1 as i64).flat_map(|y| (0..b.size().0 as i64).map(move |x| (y, x))) {
        others += usize::from(object(b, x, y));
    }
    [both, own + others - both]
}

/// Share of the object's pixels that two captures have in common, of those that one of them has.
fn overlap(a: &Capture, b: &Capture) -> f64 {
    let (mut both, mut any) = (0, 0);
    for (own, others) in a.states.iter().zip(b.states.iter()) {
        for view in &own.train {
            let Some(other) = others.train.iter().find(|v| v.name == view.name) else { continue };
            let [shared, all] = shared_pixels(view, other);
            both += shared;
            any += all;
        }
    }
    both as f64 / any as f64
}

#[test]
fn a_box_selects_what_is_inside_without_the_floor() {
    let options = RecordingCaptureOptions { views: 30, width: 240, ..RecordingCaptureOptions::default() };
    let (recordings, _) = render_recording("storage2", &options).expect("the object exists");
    let config = AlignConfig::default();
    let aligned = poses(&recordings, &config, 0, &mut |_| ()).expect("aligned");
    let cut = |given: Option<&ObjectBox>| cut_out(&recordings, aligned.clone(), &config, given, 0);
    let (automatic, found) = cut(None).expect("the cameras look at the object");
    assert_eq!((found.given, found.bystanders.len()), (None, 0), "{:?}", found.bystanders);

    let given = found.object.rounded();
    let (same, report) = cut(Some(&given)).expect("the box contains the object");
    assert_eq!(report.given, Some(given));
    assert_eq!(report.frames, found.frames);
    // A frame that something hides by nearly the largest share may be left out by one of them.
    assert!(State::ALL.iter().all(|s| report.views[*s].abs_diff(found.views[*s]) <= 1), "{:?}", report.views);
    let share = overlap(&automatic, &same);
    assert!(share > 0.96, "{share}");

    // Into the floor, which is below in y, and a little wider.
    let margin = DVec3::new(0.04, 0.06, 0.04);
    let larger = ObjectBox::new(given.lower() - margin, given.upper() + margin).expect("a box");
    let (with_floor, report) = cut(Some(&larger)).expect("the box contains the object");
    let share = overlap(&automatic, &with_floor);
    assert!(share > 0.93, "{share}");
    assert!(report.object.lower().y > found.object.lower().y - 0.02, "{:?}", report.object);

    // Half of the object, and nothing beside it.
    let half = ObjectBox::new(given.lower(), (given.lower() + given.upper()).with_y(2.0 * given.upper().y) / 2.0);
    let half = half.expect("a box");
    let (part, report) = cut(Some(&half)).expect("the box contains a part of the object");
    // Depth is stored in steps.
    let grown = ObjectBox::new(half.lower() - 0.002, half.upper() + 0.002).expect("a box");
    for state in &part.states {
        let points = || state.train.iter().flat_map(View::points);
        assert!(points().count() > 1000 && points().all(|p| grown.contains(p)));
    }
    assert!(half.contains(report.object.lower()) && half.contains(report.object.upper()));

    let away = ObjectBox::new(given.lower() + 50.0, given.upper() + 50.0).expect("a box");
    let error = cut(Some(&away)).expect_err("nothing is there");
    assert!(matches!(&error, AlignError::EmptyBox { remedy: BoxRemedy::Selected(b), .. } if *b == given), "{error}");
    assert!(error.to_string().contains(&format!("the object that is found without a box is in {given}")), "{error}");
}
