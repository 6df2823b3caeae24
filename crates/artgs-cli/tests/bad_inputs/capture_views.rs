//! Captures whose files are whole, and whose views or states contradict each other: the mistake is named.

use crate::case::{bad, check, odd};
use crate::folder::Folder;
use serde_json::{Value, json};

const RECONSTRUCT: &str = "reconstruct IN -o OUT";
const FILES: &str = "transforms_train_{}.json";

/// Changes every pose of a camera file.
fn poses(root: &mut Value, change: impl Fn(glam::DMat4) -> glam::DMat4) {
    for frame in root["frames"].as_array_mut().unwrap() {
        let cell = |row: usize, column: usize| frame["transform_matrix"][row][column].as_f64().unwrap();
        let rows: Vec<f64> = (0..16).map(|i| cell(i / 4, i % 4)).collect();
        let read = glam::DMat4::from_cols_slice(&rows).transpose();
        let made = change(read).transpose().to_cols_array();
        frame["transform_matrix"] = json!(made.chunks(4).collect::<Vec<_>>());
    }
}

fn flip() -> glam::DMat4 {
    glam::DMat4::from_diagonal(glam::DVec4::new(1.0, -1.0, -1.0, 1.0))
}

/// Multiplies keys of a camera file.
fn multiply(root: &mut Value, keys: &[&str], by: f64) {
    for key in keys {
        root[*key] = json!(root[*key].as_f64().unwrap() * by);
    }
}

const FOCAL: [&str; 2] = ["fl_x", "fl_y"];

#[test]
fn conventions() {
    check(&[
        bad("OpenCV axes", "fridge", RECONSTRUCT, &["OpenCV"], |f| f.both(FILES, |root| poses(root, |m| m * flip()))),
        bad("world-to-camera", "fridge", RECONSTRUCT, &["world-to-camera"], |f| {
            f.both(FILES, |root| poses(root, |m| m.inverse()))
        }),
        bad("world-to-camera with OpenCV axes", "fridge", RECONSTRUCT, &["world-to-camera", "OpenCV"], |f| {
            f.both(FILES, |root| poses(root, |m| (m * flip()).inverse()));
        }),
        bad("all poses are equal", "fridge", RECONSTRUCT, &["all camera poses are the same"], |f| {
            f.both(FILES, |root| poses(root, |_| glam::DMat4::from_translation(glam::DVec3::Z)));
        }),
        bad("depth in metres is read as millimetres", "fridge", RECONSTRUCT, &["0.001"], |f| {
            f.both(FILES, |root| multiply(root, &["depth_scale"], 1e-3))
        }),
        bad("depth is a thousand times too small", "fridge", RECONSTRUCT, &["depth multiplied by 1000"], |f| {
            f.both(FILES, |root| multiply(root, &["depth_scale"], 1e3))
        }),
        bad("depth is five times too large", "fridge", RECONSTRUCT, &["depth multiplied by 0.2"], |f| {
            f.both(FILES, |root| multiply(root, &["depth_scale"], 0.2))
        }),
        bad("the focal length is wrong", "fridge", RECONSTRUCT, &["focal length"], |f| {
            f.both(FILES, |root| multiply(root, &FOCAL, 1.4))
        }),
    ]);
}

#[test]
fn states() {
    const END: &str = "transforms_train_end.json";
    check(&[
        bad("OpenCV axes in one state", "fridge", RECONSTRUCT, &["the end state", "OpenCV"], |f| {
            f.json(END, |root| poses(root, |m| m * flip()))
        }),
        bad("world-to-camera in one state", "fridge", RECONSTRUCT, &["the end state", "world-to-camera"], |f| {
            f.json(END, |root| poses(root, |m| m.inverse()))
        }),
        bad("all poses of one state are equal", "fridge", RECONSTRUCT, &["the end state", "poses are the same"], |f| {
            f.json(END, |root| poses(root, |_| glam::DMat4::from_translation(glam::DVec3::Z)))
        }),
        bad("one state is in millimetres", "fridge", RECONSTRUCT, &["state"], |f| {
            f.json(END, |root| {
                poses(root, |mut m| {
                    m.w_axis *= glam::DVec4::new(1e3, 1e3, 1e3, 1.0);
                    m
                });
                multiply(root, &["depth_scale"], 1e-3);
            })
        }),
        bad(
            "one state is elsewhere",
            "fridge",
            RECONSTRUCT,
            &["no overlap between the states", "one world frame"],
            |f| {
                f.json(END, |root| {
                    poses(root, |m| glam::DMat4::from_translation(glam::DVec3::splat(50.0)) * m);
                })
            },
        ),
        bad("depth of one state is five times too large", "fridge", RECONSTRUCT, &["the end state", "depth"], |f| {
            f.json(END, |root| multiply(root, &["depth_scale"], 0.2))
        }),
        bad("poses of the next images", "fridge", RECONSTRUCT, &["no usual mistake", "belong together"], |f| {
            f.both(FILES, |root| {
                let frames = root["frames"].as_array_mut().unwrap();
                let mut matrices: Vec<_> = frames.iter().map(|frame| frame["transform_matrix"].clone()).collect();
                matrices.rotate_left(1);
                frames.iter_mut().zip(matrices).for_each(|(frame, matrix)| frame["transform_matrix"] = matrix);
            });
        }),
        bad("depth images are noise", "fridge", RECONSTRUCT, &["(noise)", "16-bit distances"], |f| {
            let random = std::cell::Cell::new(1_u32);
            for name in [f.names("start/train/depth"), f.names("end/train/depth")].concat() {
                f.depth(&name, |stored| {
                    random.set(random.get().wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
                    if stored == 0 { 0 } else { 500 + (random.get() >> 20) as u16 }
                });
            }
        }),
        bad("images are those of the other state", "fridge", RECONSTRUCT, &["copied from there"], |f| {
            for name in f.names("start/train/rgba") {
                f.write(&name.replace("start/", "end/"), f.read(&name));
            }
        }),
        bad("both states are one without overlap", "fridge", RECONSTRUCT, &["no overlap"], |f| {
            f.write(END, f.read("transforms_train_start.json"));
            f.json(END, |root| poses(root, |m| glam::DMat4::from_translation(glam::DVec3::X * 9.0) * m));
        }),
    ]);
}

/// A capture is not changed, wherever its results shall go.
#[test]
fn outputs() {
    fn nothing(_: &Folder) {}
    check(&[
        bad("into the capture", "tiny", "reconstruct IN -o IN", &["did not write", "empty folder"], nothing),
        bad("into the capture by force", "tiny", "reconstruct IN -o IN --force", &["did not write"], nothing),
        bad("into a folder of the capture", "tiny", "reconstruct IN -o IN/start", &["did not write"], nothing),
        bad("over a file", "tiny", "reconstruct IN -o IN/synth.json", &["is a file", "give a folder"], nothing),
        bad("below a file", "tiny", "reconstruct IN -o IN/synth.json/out", &["synth.json"], nothing),
        bad(
            "into a place that cannot be written",
            "tiny",
            "reconstruct IN -o /proc/none/out",
            &["/proc/none"],
            nothing,
        )
        .exits(1),
        bad("with an empty name", "tiny", "reconstruct IN -o=", &["--out"], nothing),
    ]);
}

#[test]
fn states_that_hardly_agree_are_refused_only_if_no_motion_explains_them() {
    const FIND: &str = "reconstruct IN -o OUT --stop-after discover --device cpu";
    const HIDES: &str = "hides most of what rests";
    check(&[
        odd("a closed lid", "closed-laptop", FIND, &[HIDES, "part 1: revolute"], |_| {}),
        odd("a closed lid is inspected", "closed-laptop", "inspect IN", &[HIDES], |_| {}),
        bad("one state is turned as a whole", "fridge", FIND, &["different frames"], |f| {
            f.json("transforms_train_end.json", |root| {
                let turn = glam::DMat4::from_rotation_z(1.5);
                poses(root, |m| turn * m);
            });
        }),
        odd("states of two objects are inspected", "two-objects", "inspect IN", &["show one object"], |_| {}),
    ]);
}
