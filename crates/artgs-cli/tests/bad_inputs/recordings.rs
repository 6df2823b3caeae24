//! Recordings of every format that is a folder.

use crate::case::{bad, check, odd};
use crate::folder::{Folder, huge_png, jpeg, png};
use image::{DynamicImage, RgbImage};
use serde_json::{Value, json};

const INSPECT: &str = "inspect IN/start";
const BOTH: &str = "reconstruct IN/start IN/end -o OUT";

/// Replaces a word of a line of a table, both counted from 0.
fn word(f: &Folder, name: &str, line: usize, at: usize, to: &str) {
    let text = String::from_utf8(f.read(name)).unwrap();
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let mut words: Vec<&str> = lines[line].split(' ').collect();
    words[at] = to;
    lines[line] = words.join(" ");
    f.write(name, lines.join("\n") + "\n");
}

fn nerf(f: &Folder, change: impl FnOnce(&mut Value)) {
    f.json("start/transforms.json", change);
}

#[test]
fn nerfstudio() {
    const FILE: &str = "transforms.json";
    check(&[
        odd("as it is", "nerfstudio", INSPECT, &["5 of 5 recorded"], |_| {}),
        bad("empty", "nerfstudio", INSPECT, &[FILE, "not valid JSON"], |f| f.write("start/transforms.json", "")),
        bad("cut", "nerfstudio", INSPECT, &[FILE, "not valid JSON"], |f| f.cut("start/transforms.json", 0.7)),
        bad("UTF-16", "nerfstudio", INSPECT, &[FILE, "UTF-16"], |f| {
            f.bytes("start/transforms.json", |b| {
                b.splice(0..0, [0xff, 0xfe]);
            })
        }),
        bad("no frames", "nerfstudio", INSPECT, &[FILE, "`frames`"], |f| {
            nerf(f, |r| {
                r.as_object_mut().unwrap().remove("frames");
            })
        }),
        bad("an empty list of frames", "nerfstudio", INSPECT, &["0 of 0 frames", "at least 2"], |f| {
            nerf(f, |r| r["frames"] = json!([]))
        }),
        bad("a single frame", "nerfstudio", INSPECT, &["1 of 1 frames", "at least 2"], |f| {
            nerf(f, |r| r["frames"].as_array_mut().unwrap().truncate(1))
        }),
        odd("a pose of NaN", "nerfstudio", INSPECT, &[FILE, "1 poses are lost", "4 of 4"], |f| {
            nerf(f, |r| r["frames"][0]["transform_matrix"][0][3] = json!(null))
        }),
        bad("a pose of 3 rows", "nerfstudio", INSPECT, &[FILE, "transform_matrix"], |f| {
            nerf(f, |r| r["frames"][0]["transform_matrix"].as_array_mut().unwrap().truncate(2))
        }),
        bad("a scaled pose", "nerfstudio", INSPECT, &[FILE, "uniform scale"], |f| {
            nerf(f, |r| {
                for row in 0..3 {
                    for column in 0..3 {
                        let v = r["frames"][0]["transform_matrix"][row][column].as_f64().unwrap();
                        r["frames"][0]["transform_matrix"][row][column] = json!(2.0 * v);
                    }
                }
            })
        }),
        bad("a focal length of 0", "nerfstudio", INSPECT, &[FILE, "fl_x"], |f| {
            nerf(f, |r| r["frames"][0]["fl_x"] = json!(0))
        }),
        bad("a negative focal length", "nerfstudio", INSPECT, &[FILE, "fl_x"], |f| {
            nerf(f, |r| r["frames"][0]["fl_x"] = json!(-39.0))
        }),
        bad("a focal length of text", "nerfstudio", INSPECT, &[FILE, "fl_x"], |f| {
            nerf(f, |r| r["frames"][0]["fl_x"] = json!("40"))
        }),
        bad("an unknown lens", "nerfstudio", INSPECT, &[FILE, "camera_model"], |f| {
            nerf(f, |r| r["camera_model"] = json!("EQUIRECTANGULAR"))
        }),
        bad("distortion without end", "nerfstudio", INSPECT, &["distortion"], |f| {
            nerf(f, |r| r["frames"][0]["k1"] = json!(1e9))
        }),
        odd("an image is missing", "nerfstudio", INSPECT, &["warning", "000001.png"], |f| {
            f.remove("start/images/000001.png")
        }),
        bad(
            "all images are missing",
            "nerfstudio",
            INSPECT,
            &["0 of 5 frames", "5 images do not exist: images/000001.png"],
            |f| f.remove("start/images"),
        ),
        odd(
            "a depth image is missing",
            "nerfstudio",
            INSPECT,
            &["1 frames name a depth image that does not exist", "depth/000001.png"],
            |f| f.remove("start/depth/000001.png"),
        ),
        bad("all depth images are missing", "nerfstudio", INSPECT, &["0 frames have depth, at least 4"], |f| {
            f.remove("start/depth")
        }),
        bad("colour and depth have changed places", "nerfstudio", INSPECT, &["colour and depth mixed up"], |f| {
            nerf(f, |r| {
                for frame in r["frames"].as_array_mut().unwrap() {
                    let color = frame["file_path"].take();
                    frame["file_path"] = frame["depth_file_path"].take();
                    frame["depth_file_path"] = color;
                }
            })
        }),
        odd("another unit of depth", "nerfstudio", "inspect IN/start --depth-unit 1mm", &["5 of 5"], |_| {}),
        bad(
            "a unit that is none",
            "nerfstudio",
            "inspect IN/start --depth-unit inch",
            &["--depth-unit", "no length"],
            |_| {},
        ),
        bad("axes that are none", "nerfstudio", "inspect IN/start --camera-axes up", &["--camera-axes", "RDF"], |_| {}),
        bad("an image is empty", "nerfstudio", INSPECT, &["000001.png"], |f| f.write("start/images/000001.png", "")),
        bad("an image is cut", "nerfstudio", INSPECT, &["000002.png", "not a complete"], |f| {
            f.cut("start/images/000002.png", 0.5)
        }),
        bad("an image is huge", "nerfstudio", INSPECT, &["000001.png", "1 GiB"], |f| {
            f.write("start/images/000001.png", huge_png(50_000, 50_000))
        }),
        bad("an image of another shape", "nerfstudio", INSPECT, &["000001.png", "64x64"], |f| {
            f.write("start/images/000001.png", png(&DynamicImage::new_rgb8(64, 64)))
        }),
        odd("a JPEG is named .png", "nerfstudio", INSPECT, &["5 of 5"], |f| {
            f.write("start/images/000001.png", jpeg(&RgbImage::new(64, 48).into()))
        }),
        bad("depth is zero", "nerfstudio", INSPECT, &["depth is 0 in every frame"], |f| {
            f.names("start/depth").iter().for_each(|n| f.depth(n, |_| 0))
        }),
        odd("depth is zero in one frame", "nerfstudio", INSPECT, &["depth images are empty"], |f| {
            f.depth("start/depth/000001.png", |_| 0)
        }),
        bad("depth of 8 bits", "nerfstudio", INSPECT, &["000001.png", "16"], |f| {
            f.write("start/depth/000001.png", png(&DynamicImage::new_luma8(64, 48)))
        }),
        bad("depth of another shape", "nerfstudio", INSPECT, &["000001.png", "48x64", "field of view"], |f| {
            f.write("start/depth/000001.png", png(&DynamicImage::new_luma16(48, 64)))
        }),
        bad("depth that is a thousand times too small", "nerfstudio", BOTH, &["cannot be aligned"], |f| {
            for state in ["start", "end"] {
                f.names(&format!("{state}/depth")).iter().for_each(|n| f.depth(n, |c| c / 1000));
            }
        }),
        bad("poses that jump", "nerfstudio", BOTH, &["agree between views"], |f| {
            f.both("{}/transforms.json", |r| {
                for (i, frame) in r["frames"].as_array_mut().unwrap().iter_mut().enumerate() {
                    frame["transform_matrix"][0][3] = json!(1e5 * i as f64);
                }
            })
        }),
        bad("poses that are all equal", "nerfstudio", BOTH, &["poses"], |f| {
            f.both("{}/transforms.json", |r| {
                let first = r["frames"][0]["transform_matrix"].clone();
                r["frames"]
                    .as_array_mut()
                    .unwrap()
                    .iter_mut()
                    .for_each(|frame| frame["transform_matrix"] = first.clone());
            })
        }),
        bad("poses beyond single precision", "nerfstudio", INSPECT, &[FILE], |f| {
            nerf(f, |r| r["frames"][0]["transform_matrix"][0][3] = json!(1e300))
        }),
        bad("no depth at all", "nerfstudio", BOTH, &["start: 0 frames have depth", "record with depth"], without_depth),
        bad(
            "no depth at all, inspected",
            "nerfstudio",
            INSPECT,
            &["start: 0 frames have depth", "refuses this input"],
            without_depth,
        ),
        bad(
            "no depth image exists",
            "nerfstudio",
            BOTH,
            &["0 frames have depth", "depth image that does not exist"],
            |f| {
                f.remove("start/depth");
            },
        ),
    ]);
}

/// Frames of both states that name no depth.
fn without_depth(f: &Folder) {
    for state in ["start", "end"] {
        f.remove(&format!("{state}/depth"));
    }
    f.both("{}/transforms.json", |r| {
        for frame in r["frames"].as_array_mut().unwrap() {
            frame.as_object_mut().unwrap().remove("depth_file_path");
        }
    });
}

#[test]
fn tum() {
    const POSES: &str = "start/groundtruth.txt";
    check(&[
        odd("as it is", "tum", INSPECT, &["5 of 5 recorded"], |_| {}),
        bad("an empty list of images", "tum", INSPECT, &["0 of 0"], |f| f.write("start/rgb.txt", "")),
        odd("a list without a name", "tum", INSPECT, &["rgb.txt", "1 of 5 lines", "line 2", "file name"], |f| {
            word(f, "start/rgb.txt", 1, 1, "")
        }),
        odd("a time of text", "tum", INSPECT, &["rgb.txt", "line 2"], |f| word(f, "start/rgb.txt", 1, 0, "soon")),
        odd("a time of NaN", "tum", INSPECT, &["rgb.txt", "line 2"], |f| word(f, "start/rgb.txt", 1, 0, "nan")),
        bad("a list that is not text", "tum", INSPECT, &["rgb.txt"], |f| {
            f.write("start/rgb.txt", [0xff, 0xfe, 0, 0x80])
        }),
        bad("empty poses", "tum", INSPECT, &["groundtruth.txt", "contains no pose"], |f| f.write(POSES, "")),
        odd("a pose of 7 numbers", "tum", INSPECT, &["groundtruth.txt", "line 2", "7 values"], |f| {
            word(f, POSES, 1, 7, "")
        }),
        odd("a pose of NaN", "tum", INSPECT, &["groundtruth.txt", "line 2", "1 of 5 poses are lost"], |f| {
            word(f, POSES, 1, 1, "nan")
        }),
        odd("a pose of infinity", "tum", INSPECT, &["groundtruth.txt", "line 2", "1 of 5 poses are lost"], |f| {
            word(f, POSES, 1, 1, "1e999")
        }),
        odd("a quaternion of length 0", "tum", INSPECT, &["groundtruth.txt", "line 2", "are lost"], |f| {
            (4..8).for_each(|at| word(f, POSES, 1, at, "0"));
        }),
        odd("a quaternion of length 2", "tum", INSPECT, &["groundtruth.txt", "line 2", "quaternion"], |f| {
            word(f, POSES, 1, 4, "2")
        }),
        bad("poses of another day", "tum", INSPECT, &["frames with a pose"], |f| {
            let text = String::from_utf8(f.read(POSES)).unwrap();
            f.write(POSES, text.replace("\n1", "\n900001"));
        }),
        bad("no poses", "tum", INSPECT, &["no groundtruth.txt"], |f| f.remove(POSES)),
        odd("a ninth column and a head without #", "tum", INSPECT, &["5 of 5"], |f| {
            let text = String::from_utf8(f.read(POSES)).unwrap();
            let rows = text.lines().skip(1).enumerate().map(|(i, row)| format!("{row} {i}\n"));
            f.write(POSES, "timestamp tx ty tz qx qy qz qw id\n".to_string() + &rows.collect::<String>());
        }),
        bad("all images are missing", "tum", INSPECT, &["0 of 5 frames", "5 images of rgb.txt do not exist"], |f| {
            f.remove("start/rgb")
        }),
        bad("depth in JPEG", "tum", INSPECT, &["000001.png", "is a JPEG", "no depth"], |f| {
            f.write("start/depth/000001.png", jpeg(&RgbImage::new(64, 48).into()))
        }),
        bad("no intrinsics", "tum", INSPECT, &["no camera intrinsics", "fx,fy,cx,cy"], |f| {
            f.remove("start/intrinsics.txt")
        }),
        bad("empty intrinsics", "tum", INSPECT, &["intrinsics.txt", "0 numbers"], |f| {
            f.write("start/intrinsics.txt", "")
        }),
        bad("intrinsics of text", "tum", INSPECT, &["intrinsics.txt", "fx fy cx cy"], |f| {
            f.write("start/intrinsics.txt", "see manual")
        }),
        bad("intrinsics of 0", "tum", INSPECT, &["intrinsics.txt", "above 0"], |f| {
            f.write("start/intrinsics.txt", "0 0 32 24")
        }),
        bad("intrinsics of NaN", "tum", INSPECT, &["intrinsics.txt"], |f| {
            f.write("start/intrinsics.txt", "nan nan 32 24")
        }),
        bad("intrinsics of a huge image", "tum", INSPECT, &["intrinsics.txt"], |f| {
            f.write("start/intrinsics.txt", "40 40 32 24 1e9 1e9")
        }),
        bad("intrinsics of half pixels", "tum", INSPECT, &["intrinsics.txt"], |f| {
            f.write("start/intrinsics.txt", "40 40 32 24 64.5 48.5")
        }),
        odd("an image is missing", "tum", INSPECT, &["warning", "000001.png"], |f| f.remove("start/rgb/000001.png")),
        odd("a depth image is missing", "tum", INSPECT, &["000001.png"], |f| f.remove("start/depth/000001.png")),
        bad("depth in another scale", "tum", BOTH, &["depth"], |f| {
            for state in ["start", "end"] {
                f.names(&format!("{state}/depth")).iter().for_each(|n| f.depth(n, |c| c / 50));
            }
        }),
        bad("a list of depth that is damaged", "tum", INSPECT, &["depth.txt", "line 1"], |f| {
            f.write("start/depth.txt", "x y\n")
        }),
    ]);
}

#[test]
fn scanner_app() {
    const FRAME: &str = "start/frame_00001.json";
    check(&[
        odd("as it is", "scanner-app", INSPECT, &["5 of 5 recorded"], |_| {}),
        odd("both states in one folder", "scanner-app", "inspect IN", &["start", "end", "5 of 5 recorded"], |_| {}),
        bad("a state is missing", "scanner-app", "inspect IN", &["not a capture"], |f| {
            std::fs::remove_dir_all(f.path("end")).unwrap();
        }),
        bad("a frame is empty", "scanner-app", INSPECT, &["frame_00001.json", "not valid JSON"], |f| {
            f.write(FRAME, "")
        }),
        bad("the first frame is empty", "scanner-app", INSPECT, &["start", "frame_00000.json"], |f| {
            f.write("start/frame_00000.json", "")
        }),
        bad("a pose of 12 numbers", "scanner-app", INSPECT, &["frame_00001.json", "cameraPoseARFrame"], |f| {
            f.json(FRAME, |r| r["cameraPoseARFrame"].as_array_mut().unwrap().truncate(12))
        }),
        odd("a pose of zero", "scanner-app", INSPECT, &["frame_00001.jpg", "1 poses are lost"], |f| {
            f.json(FRAME, |r| r["cameraPoseARFrame"] = json!([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]))
        }),
        odd("a pose with null", "scanner-app", INSPECT, &["frame_00001.jpg", "1 poses are lost"], |f| {
            f.json(FRAME, |r| r["cameraPoseARFrame"][3] = json!(null))
        }),
        bad("no intrinsics", "scanner-app", INSPECT, &["frame_00001.json", "intrinsics"], |f| {
            f.json(FRAME, |r| {
                r.as_object_mut().unwrap().remove("intrinsics");
            })
        }),
        bad("intrinsics of 0", "scanner-app", INSPECT, &["frame_00001.json", "intrinsics", "above 0"], |f| {
            f.json(FRAME, |r| r["intrinsics"] = json!([0, 0, 0, 0, 0, 0, 0, 0, 0]))
        }),
        bad("a projection of text", "scanner-app", INSPECT, &["frame_00001.json", "projectionMatrix"], |f| {
            f.json(FRAME, |r| r["projectionMatrix"] = json!("p"))
        }),
        bad("a time of text", "scanner-app", INSPECT, &["frame_00001.json", "time"], |f| {
            f.json(FRAME, |r| r["time"] = json!("now"))
        }),
        odd("an image is missing", "scanner-app", INSPECT, &["warning", "frame_00002.jpg"], |f| {
            f.remove("start/frame_00002.jpg")
        }),
        bad("all images are missing", "scanner-app", INSPECT, &["0 of 0", "at least 2"], |f| {
            f.names("start").iter().filter(|n| n.ends_with(".jpg")).for_each(|n| f.remove(n));
        }),
        bad("a JPEG is cut", "scanner-app", INSPECT, &["frame_00002.jpg", "end marker"], |f| {
            f.cut("start/frame_00002.jpg", 0.7)
        }),
        bad("a JPEG is empty", "scanner-app", INSPECT, &["frame_00002.jpg", "neither a JPEG nor a PNG"], |f| {
            f.write("start/frame_00002.jpg", "")
        }),
        bad("a JPEG of zeros", "scanner-app", INSPECT, &["frame_00002.jpg"], |f| {
            f.bytes("start/frame_00002.jpg", |b| {
                let end = b.len() - 2;
                b[200..end].fill(0);
            })
        }),
        bad("a JPEG of a huge size", "scanner-app", INSPECT, &["frame_00002.jpg"], |f| {
            f.bytes("start/frame_00002.jpg", |b| {
                let at = b.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
                b[at + 5..at + 9].fill(0xff);
            })
        }),
        bad("confidence of another size", "scanner-app", INSPECT, &["conf_00001.png", "the confidence is 4x4"], |f| {
            f.write("start/conf_00001.png", png(&DynamicImage::new_luma8(4, 4)))
        }),
        bad("depth without confidence everywhere", "scanner-app", INSPECT, &["depth is 0 in every frame"], |f| {
            f.names("start")
                .iter()
                .filter(|n| n.contains("conf_"))
                .for_each(|n| f.write(n, png(&DynamicImage::new_luma8(64, 48))));
        }),
        odd("no depth image of one frame", "scanner-app", INSPECT, &["frame_00001.jpg"], |f| {
            f.remove("start/depth_00001.png")
        }),
    ]);
}

#[test]
fn record3d() {
    const FILE: &str = "start/metadata.json";
    check(&[
        odd("as it is", "record3d", INSPECT, &["5 of 5 recorded"], |_| {}),
        bad("metadata is cut", "record3d", INSPECT, &["start", "no camera file"], |f| f.cut(FILE, 0.8)),
        bad("K is short", "record3d", INSPECT, &["metadata.json", "K"], |f| {
            f.json(FILE, |r| {
                r["K"].as_array_mut().unwrap().truncate(5);
                r.as_object_mut().unwrap().remove("perFrameIntrinsicCoeffs");
            })
        }),
        bad("K of 0", "record3d", INSPECT, &["metadata.json", "K", "above 0"], |f| {
            f.json(FILE, |r| {
                r["K"] = json!([0, 0, 0, 0, 0, 0, 0, 0, 0]);
                r.as_object_mut().unwrap().remove("perFrameIntrinsicCoeffs");
            })
        }),
        bad("poses are text", "record3d", INSPECT, &["metadata.json", "poses"], |f| {
            f.json(FILE, |r| r["poses"] = json!("p"))
        }),
        bad("a pose of 6 numbers", "record3d", INSPECT, &["metadata.json", "pose 2", "7 finite numbers"], |f| {
            f.json(FILE, |r| r["poses"][2].as_array_mut().unwrap().truncate(6))
        }),
        odd("a quaternion of zero", "record3d", INSPECT, &["1 poses are lost", "rgb/2.jpg"], |f| {
            f.json(FILE, |r| r["poses"][2] = json!([0, 0, 0, 0, 1, 1, 1]))
        }),
        bad("fewer poses than images", "record3d", INSPECT, &["3 frames have depth, at least 4"], |f| {
            f.json(FILE, |r| r["poses"].as_array_mut().unwrap().truncate(3))
        }),
        bad(
            "poses of the front camera",
            "record3d",
            INSPECT,
            &["all 5 camera poses are the same", "front camera"],
            |f| {
                f.json(FILE, |r| {
                    r["poses"].as_array_mut().unwrap().iter_mut().for_each(|pose| *pose = json!([0, 0, 0, 1, 0, 0, 0]))
                })
            },
        ),
        bad("poses of zeros", "record3d", INSPECT, &["0 of 5 frames", "5 poses are lost", "front camera"], |f| {
            f.json(FILE, |r| {
                r["poses"].as_array_mut().unwrap().iter_mut().for_each(|pose| *pose = json!([0, 0, 0, 0, 0, 0, 0]))
            })
        }),
        bad("the video export", "record3d", INSPECT, &["video", "EXR + JPG"], |f| {
            f.remove("start/rgb");
            f.remove("start/depth");
            f.write("start/scan.mp4", "a video");
        }),
        bad("no poses", "record3d", INSPECT, &["at least 2", "5 images have no pose"], |f| {
            f.json(FILE, |r| r["poses"] = json!([]))
        }),
        bad("a size of 0", "record3d", INSPECT, &["metadata.json", "`w`"], |f| f.json(FILE, |r| r["w"] = json!(0))),
        bad("a size of text", "record3d", INSPECT, &["metadata.json", "`h`"], |f| {
            f.json(FILE, |r| r["h"] = json!("48"))
        }),
        bad("an EXR is empty", "record3d", INSPECT, &["1.exr", "not a complete"], |f| f.write("start/depth/1.exr", "")),
        bad("an EXR is cut", "record3d", INSPECT, &["1.exr", "not a complete"], |f| f.cut("start/depth/1.exr", 0.5)),
        bad("an EXR is a PNG", "record3d", INSPECT, &["1.exr"], |f| {
            f.write("start/depth/1.exr", png(&DynamicImage::new_luma16(64, 48)))
        }),
        odd("an EXR is missing", "record3d", INSPECT, &["frames have no depth"], |f| f.remove("start/depth/1.exr")),
        odd("a JPEG is missing", "record3d", INSPECT, &["4 of 4"], |f| f.remove("start/rgb/1.jpg")),
        bad("a JPEG is text", "record3d", INSPECT, &["1.jpg", "neither a JPEG nor a PNG"], |f| {
            f.write("start/rgb/1.jpg", "no picture")
        }),
    ]);
}

#[test]
fn polycam() {
    const CAMERA: &str = "start/keyframes/cameras/1000001.json";
    check(&[
        odd("as it is", "polycam", INSPECT, &["5 of 5 recorded"], |_| {}),
        bad("a camera is empty", "polycam", INSPECT, &["1000001.json", "not valid JSON"], |f| f.write(CAMERA, "")),
        bad("a camera without a cell", "polycam", INSPECT, &["1000001.json", "t_12"], |f| {
            f.json(CAMERA, |r| {
                r.as_object_mut().unwrap().remove("t_12");
            })
        }),
        bad("a cell of text", "polycam", INSPECT, &["1000001.json", "t_12"], |f| {
            f.json(CAMERA, |r| r["t_12"] = json!("0"))
        }),
        odd("a rotation of zero", "polycam", INSPECT, &["1000001", "1 poses are lost"], |f| {
            f.json(CAMERA, |r| {
                for i in 0..9 {
                    r[format!("t_{}{}", i / 3, i % 3)] = json!(0);
                }
            })
        }),
        bad("a focal length of 0", "polycam", INSPECT, &["1000001"], |f| f.json(CAMERA, |r| r["fx"] = json!(0))),
        bad("a negative focal length", "polycam", INSPECT, &["1000001"], |f| f.json(CAMERA, |r| r["fy"] = json!(-3))),
        bad("a size of 0", "polycam", INSPECT, &["1000001.json", "width"], |f| {
            f.json(CAMERA, |r| r["width"] = json!(0))
        }),
        bad("a size of another shape", "polycam", INSPECT, &["1000001"], |f| {
            f.json(CAMERA, |r| r["width"] = json!(9000))
        }),
        odd("an image is missing", "polycam", INSPECT, &["warning", "1000001"], |f| {
            f.remove("start/keyframes/images/1000001.jpg")
        }),
        bad("no images", "polycam", INSPECT, &["start"], |f| f.remove("start/keyframes/images")),
        odd("images in another folder", "polycam", INSPECT, &["5 of 5", "raw_images, not in images"], |f| {
            std::fs::rename(f.path("start/keyframes/images"), f.path("start/keyframes/raw_images")).unwrap()
        }),
        odd(
            "corrected cameras without corrected images",
            "polycam",
            INSPECT,
            &["5 of 5", "corrected_cameras", "in images"],
            |f| {
                std::fs::rename(f.path("start/keyframes/cameras"), f.path("start/keyframes/corrected_cameras")).unwrap()
            },
        ),
        bad(
            "a folder above",
            "polycam",
            "inspect IN",
            &["not a capture", "contains the recording", "start (polycam)"],
            |f| {
                std::fs::remove_dir_all(f.path("end")).unwrap();
            },
        ),
        bad("no cameras", "polycam", INSPECT, &["start", "no keyframes"], |f| f.remove("start/keyframes/cameras")),
        bad("depth is cut", "polycam", INSPECT, &["1000001.png", "not a complete"], |f| {
            f.cut("start/keyframes/depth/1000001.png", 0.5)
        }),
        bad("confidence is cut", "polycam", INSPECT, &["1000001.png", "not a complete"], |f| {
            f.cut("start/keyframes/confidence/1000001.png", 0.5)
        }),
    ]);
}

#[test]
fn colmap() {
    const CAMERAS: &str = "start/sparse/0/cameras.txt";
    const IMAGES: &str = "start/sparse/0/images.txt";
    check(&[
        odd("as it is", "colmap", INSPECT, &["5 of 5 recorded"], |_| {}),
        bad("no cameras", "colmap", INSPECT, &["images.txt", "no camera 1"], |f| f.write(CAMERAS, "")),
        bad("no images", "colmap", INSPECT, &["0 of 0"], |f| f.write(IMAGES, "")),
        bad("a camera of text", "colmap", INSPECT, &["cameras.txt", "line 2", "whole numbers"], |f| {
            word(f, CAMERAS, 1, 2, "wide")
        }),
        bad("a camera of an unknown model", "colmap", INSPECT, &["cameras.txt", "line 2", "EYE", "undistort"], |f| {
            word(f, CAMERAS, 1, 1, "EYE")
        }),
        bad("a camera of too few numbers", "colmap", INSPECT, &["cameras.txt", "line 2", "parameters"], |f| {
            word(f, CAMERAS, 1, 1, "OPENCV")
        }),
        bad("a focal length of NaN", "colmap", INSPECT, &["cameras.txt", "line 2", "finite"], |f| {
            word(f, CAMERAS, 1, 4, "nan")
        }),
        bad("a focal length of 0", "colmap", INSPECT, &["focal"], |f| word(f, CAMERAS, 1, 4, "0")),
        bad("a negative focal length", "colmap", INSPECT, &["focal"], |f| word(f, CAMERAS, 1, 4, "-40")),
        bad("a size of 0", "colmap", INSPECT, &["0"], |f| word(f, CAMERAS, 1, 2, "0")),
        bad("a pose of text", "colmap", INSPECT, &["images.txt", "line 2", "not a number"], |f| {
            word(f, IMAGES, 1, 2, "x")
        }),
        bad("a pose of NaN", "colmap", INSPECT, &["images.txt", "line 2"], |f| word(f, IMAGES, 1, 6, "nan")),
        bad("a quaternion of zero", "colmap", INSPECT, &["images.txt", "line 2", "quaternion"], |f| {
            (1..5).for_each(|at| word(f, IMAGES, 1, at, "0"))
        }),
        bad("a line of images that is short", "colmap", INSPECT, &["images.txt", "expected IMAGE_ID"], |f| {
            f.write(IMAGES, "1 2 3\n\n")
        }),
        bad(
            "a model without its images file",
            "colmap",
            INSPECT,
            &["sparse/0", "lacks images.txt or images.bin"],
            |f| f.remove(IMAGES),
        ),
        odd(
            "two models",
            "colmap",
            INSPECT,
            &["5 of 5", "sparse/0 with 5 images is used", "sparse/1 (0 images)"],
            |f| {
                f.write("start/sparse/1/cameras.txt", f.read(CAMERAS));
                f.write("start/sparse/1/images.txt", "");
            },
        ),
        odd("the second model is larger", "colmap", INSPECT, &["5 of 5", "sparse/1 with 5 images is used"], |f| {
            f.write("start/sparse/1/cameras.txt", f.read(CAMERAS));
            f.write("start/sparse/1/images.txt", f.read(IMAGES));
            f.write(IMAGES, "");
        }),
        odd("a model in dense/0", "colmap", INSPECT, &["5 of 5"], |f| {
            for name in ["cameras.txt", "images.txt"] {
                f.write(&format!("start/dense/0/sparse/{name}"), f.read(&format!("start/sparse/0/{name}")));
            }
            f.remove("start/sparse");
            std::fs::rename(f.path("start/images"), f.path("start/dense/0/images")).unwrap();
            std::fs::rename(f.path("start/depth"), f.path("start/dense/0/depth")).unwrap();
        }),
        bad("all images are missing", "colmap", INSPECT, &["0 of 5 frames", "5 images do not exist"], |f| {
            f.remove("start/images")
        }),
        odd("an image is missing", "colmap", INSPECT, &["warning", "000001.png"], |f| {
            f.remove("start/images/000001.png")
        }),
        bad("binary cameras that are empty", "colmap", INSPECT, &["cameras.bin", "ends inside"], |f| {
            f.write("start/sparse/0/cameras.bin", "");
            f.write("start/sparse/0/images.bin", "");
        }),
        bad("binary cameras of a huge number", "colmap", INSPECT, &["cameras.bin", "ends inside"], |f| {
            f.write("start/sparse/0/cameras.bin", [0xff; 16]);
            f.write("start/sparse/0/images.bin", [0xff; 16]);
        }),
        bad("points of text", "colmap", INSPECT, &["points3D.txt", "line 1"], |f| {
            f.write("start/sparse/0/points3D.txt", "a b c d\n")
        }),
    ]);
}

#[test]
fn other_formats() {
    check(&[
        bad(
            "an empty folder",
            "",
            "reconstruct IN IN/a -o OUT",
            &["not a recording of a known format", "nerfstudio"],
            |f| f.write("a/b.txt", ""),
        ),
        bad(
            "folders of the states of a capture",
            "tiny",
            "reconstruct IN/start IN/end -o OUT",
            &["is a folder of the capture", "give the capture alone: artgs reconstruct"],
            |_| {},
        ),
        bad("photos without poses", "", "inspect IN/a IN/a", &["contains images but no camera poses", "COLMAP"], |f| {
            f.write("a/IMG_0001.JPG", "")
        }),
        bad("a folder of photos without poses", "", "reconstruct IN/a -o OUT", &["no camera poses", "COLMAP"], |f| {
            f.write("a/IMG_0001.JPG", "")
        }),
        bad(
            "one file of a recording",
            "tum",
            "reconstruct IN/start/rgb.txt IN/end/rgb.txt -o OUT",
            &["is a file of a recording", "give its folder"],
            |_| {},
        ),
        bad("a text file", "", "inspect IN/a.txt IN/a.txt", &["a.txt", "not a recording"], |f| {
            f.write("a.txt", "hello")
        }),
        bad("a Stray Scanner table of text", "", INSPECT, &["odometry.csv"], |f| {
            f.write("start/odometry.csv", "hello\n")
        }),
        bad("an empty Stray Scanner table", "", INSPECT, &["odometry.csv"], |f| f.write("start/odometry.csv", "")),
        bad("a Stray Scanner table without rows", "", INSPECT, &["start"], |f| {
            f.write("start/odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n")
        }),
        bad("a Stray Scanner video that is none", "", INSPECT, &["rgb.mp4"], |f| {
            f.write("start/odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n0.0, 000000, 0, 0, 0, 0, 0, 0, 1\n0.1, 000001, 0, 0, 0, 0, 0, 0, 1\n");
            f.write("start/camera_matrix.csv", "40, 0, 32\n0, 40, 24\n0, 0, 1\n");
            f.write("start/rgb.mp4", "no video");
        }),
        bad("7-Scenes with a pose of text", "", "inspect IN/start --intrinsics 40,40,32,24", &["frame-000000"], |f| {
            for i in 0..2 {
                f.write(&format!("start/frame-00000{i}.pose.txt"), "a b c d\n");
                f.write(&format!("start/frame-00000{i}.color.png"), png(&DynamicImage::new_rgb8(64, 48)));
            }
        }),
        bad("a ROS 2 bag in SQLite", "", "inspect IN", &["ROS 2 bag in SQLite", "ros2 bag convert"], |f| {
            f.write("scan_0.db3", "SQLite format 3");
        }),
        bad("a video alone", "", "inspect IN/scan.mp4", &["scan.mp4: is a file", "a video"], |f| {
            f.write("scan.mp4", "video")
        }),
        bad("7-Scenes without images", "", "inspect IN/start --intrinsics 40,40,32,24", &["at least 2"], |f| {
            f.write("start/frame-000000.pose.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
        }),
    ]);
}
