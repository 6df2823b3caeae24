//! Captures whose camera files are damaged, or hold what no camera has.

use crate::case::{bad, check, odd};
use crate::folder::Folder;
use serde_json::{Value, json};

const START: &str = "transforms_train_start.json";
const END: &str = "transforms_train_end.json";
const RECONSTRUCT: &str = "reconstruct IN -o OUT";

/// Changes a key of the start state.
fn key(f: &Folder, name: &str, value: Value) {
    f.json(START, |root| root[name] = value);
}

/// Changes the first pose of the start state.
fn cell(f: &Folder, row: usize, column: usize, value: Value) {
    f.json(START, |root| root["frames"][0]["transform_matrix"][row][column] = value);
}

/// Writes something that JSON has no value for.
fn raw(f: &Folder, name: &str, text: &str) {
    key(f, name, json!("RAW"));
    f.text(START, "\"RAW\"", text);
}

#[test]
fn folders() {
    check(&[
        bad("an empty folder", "", RECONSTRUCT, &["in: not a capture", "the folder is empty"], |_| {}),
        bad(
            "a folder of something else",
            "",
            RECONSTRUCT,
            &["in: not a capture", "transforms_train_start.json", "camera_train.json"],
            |f| f.write("notes.txt", "x"),
        ),
        bad("an empty folder is inspected", "", "inspect IN", &["not a capture"], |_| {}),
        bad("no such folder", "", "inspect IN/nowhere", &["nowhere", "no such", "give the folder"], |_| {}),
        bad("no such folder is reconstructed", "", "reconstruct IN/nowhere -o OUT", &["nowhere", "no such"], |_| {}),
        bad("a file as capture", "tiny", "inspect IN/synth.json", &["is a file", "give the folder"], |_| {}),
        bad("one state", "tiny", RECONSTRUCT, &["one state only", "transforms_train_end.json"], |f| f.remove(END)),
        bad("the other state", "tiny", RECONSTRUCT, &["one state only", "transforms_train_start.json"], |f| {
            f.remove(START)
        }),
        bad("one state of PARIS", "paris", RECONSTRUCT, &["one state only", "camera_train.json"], |f| {
            f.remove("end/camera_train.json")
        }),
        bad("a camera file is a folder", "tiny", RECONSTRUCT, &["one state only"], |f| {
            f.remove(START);
            f.write("transforms_train_start.json/x", "");
        }),
        odd("no held-out views", "tiny", "inspect IN", &["4 views"], |f| {
            f.remove("transforms_test_start.json");
            f.remove("transforms_test_end.json");
        }),
        odd("no ground truth", "tiny", "inspect IN", &["4 views"], |f| f.remove("gt")),
        odd("unknown files beside", "tiny", "inspect IN", &["4 views"], |f| f.write("notes.txt", "x")),
    ]);
}

#[test]
fn text() {
    check(&[
        bad("empty", "tiny", RECONSTRUCT, &[START, "not valid JSON", "line 1"], |f| f.write(START, "")),
        bad("blank", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| f.write(START, " \n\n")),
        bad("zero bytes", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| f.write(START, [0; 4096])),
        bad("cut in the middle", "tiny", RECONSTRUCT, &[START, "not valid JSON", "EOF"], |f| f.cut(START, 0.5)),
        bad("cut at the end", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| f.cut(START, 0.99)),
        bad("a list", "tiny", RECONSTRUCT, &[START, "expected an object"], |f| f.write(START, "[]")),
        bad("a number", "tiny", RECONSTRUCT, &[START, "expected an object"], |f| f.write(START, "7")),
        bad("null", "tiny", RECONSTRUCT, &[START, "expected an object"], |f| f.write(START, "null")),
        bad("an empty object", "tiny", RECONSTRUCT, &[START, "is missing"], |f| f.write(START, "{}")),
        bad("a picture", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| {
            f.write(START, f.read("start/train/rgba/0000.png"))
        }),
        bad("nested without end", "tiny", RECONSTRUCT, &[START, "not valid JSON", "recursion"], |f| {
            f.write(START, "[".repeat(100_000))
        }),
        bad("comments", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| f.text(START, "{", "{ // mine\n")),
        bad("text after the end", "tiny", RECONSTRUCT, &[START, "trailing"], |f| f.bytes(START, |b| b.extend(b"}"))),
        bad("UTF-16", "tiny", RECONSTRUCT, &[START, "UTF-16", "UTF-8"], |f| {
            let text = String::from_utf8(f.read(START)).unwrap();
            f.write(START, [vec![0xff, 0xfe], text.encode_utf16().flat_map(u16::to_le_bytes).collect()].concat());
        }),
        bad("UTF-16 of the other order", "tiny", RECONSTRUCT, &[START, "UTF-16"], |f| {
            let text = String::from_utf8(f.read(START)).unwrap();
            f.write(START, [vec![0xfe, 0xff], text.encode_utf16().flat_map(u16::to_be_bytes).collect()].concat());
        }),
        bad("Latin-1", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| {
            f.bytes(START, |b| {
                let at = b.windows(5).position(|w| w == b"rgba/").unwrap();
                b[at] = 0xe9;
            })
        }),
        odd("a byte order mark", "tiny", "inspect IN", &["4 views"], |f| {
            f.bytes(START, |b| {
                b.splice(0..0, *b"\xef\xbb\xbf");
            })
        }),
        odd("lines end as on Windows", "tiny", "inspect IN", &["4 views"], |f| {
            f.write(START, String::from_utf8(f.read(START)).unwrap().replace('\n', "\r\n"));
        }),
        odd("unknown keys", "tiny", "inspect IN", &["4 views"], |f| key(f, "applied_transform", json!([[1, 0]]))),
    ]);
}

#[test]
fn numbers() {
    check(&[
        bad("focal length is 0", "tiny", RECONSTRUCT, &[START, "`fl_x`", "must be above 0"], |f| {
            key(f, "fl_x", json!(0))
        }),
        bad("focal length is negative", "tiny", RECONSTRUCT, &[START, "`fl_x`", "must be above 0"], |f| {
            key(f, "fl_x", json!(-59.0))
        }),
        bad("vertical focal length is negative", "tiny", RECONSTRUCT, &["`fl_y`", "must be above 0"], |f| {
            key(f, "fl_y", json!(-59.0))
        }),
        bad(
            "focal length is text",
            "tiny",
            RECONSTRUCT,
            &["`fl_x`", "expected a finite number, found a string"],
            |f| key(f, "fl_x", json!("59")),
        ),
        bad("focal length is null", "tiny", RECONSTRUCT, &["`fl_x`", "null"], |f| key(f, "fl_x", json!(null))),
        bad("focal length is NaN", "tiny", RECONSTRUCT, &["`fl_x`", "NaN"], |f| raw(f, "fl_x", "NaN")),
        bad("focal length is Infinity", "tiny", RECONSTRUCT, &["`fl_x`", "infinity"], |f| raw(f, "fl_x", "Infinity")),
        bad("focal length is -Infinity", "tiny", RECONSTRUCT, &["`fl_x`", "infinity"], |f| raw(f, "fl_x", "-Infinity")),
        bad("focal length is 1e999", "tiny", RECONSTRUCT, &[START, "out of range"], |f| raw(f, "fl_x", "1e999")),
        bad("focal length is a millionth", "tiny", RECONSTRUCT, &[START, "fl_x"], |f| key(f, "fl_x", json!(1e-6))),
        bad("focal length is huge", "tiny", RECONSTRUCT, &[START, "fl_x"], |f| {
            key(f, "fl_x", json!(1e12));
            key(f, "fl_y", json!(1e12));
        }),
        bad("no focal length", "tiny", RECONSTRUCT, &["camera_angle_x", "is missing", "fl_x"], |f| {
            f.json(START, |root| {
                for name in ["fl_x", "fl_y", "camera_angle_x", "camera_angle_y"] {
                    root.as_object_mut().unwrap().remove(name);
                }
            })
        }),
        bad("an angle in degrees", "tiny", RECONSTRUCT, &["camera_angle_x", "radians"], |f| {
            f.json(START, |root| {
                root.as_object_mut().unwrap().remove("fl_x");
                root["camera_angle_x"] = json!(44.0);
            })
        }),
        bad("a negative angle", "tiny", RECONSTRUCT, &["camera_angle_x", "above 0"], |f| {
            f.json(START, |root| {
                root.as_object_mut().unwrap().remove("fl_x");
                root["camera_angle_x"] = json!(-0.7);
            })
        }),
        bad("the principal point is outside", "tiny", RECONSTRUCT, &[START, "`cx`", "outside"], |f| {
            key(f, "cx", json!(4800.0))
        }),
        bad("the principal point is far above", "tiny", RECONSTRUCT, &[START, "`cy`", "outside"], |f| {
            key(f, "cy", json!(-1e6))
        }),
        bad("the principal point is text", "tiny", RECONSTRUCT, &["`cx`", "expected a finite number"], |f| {
            key(f, "cx", json!([24]))
        }),
        bad("another width", "tiny", RECONSTRUCT, &["`w` says 400", "48x48"], |f| key(f, "w", json!(400))),
        bad("another height", "tiny", RECONSTRUCT, &["`h` says 47", "48x48"], |f| key(f, "h", json!(47))),
        bad("half a pixel", "tiny", RECONSTRUCT, &["`w`", "whole pixels"], |f| key(f, "w", json!(48.5))),
        bad("a negative width", "tiny", RECONSTRUCT, &["`w`", "above 0"], |f| key(f, "w", json!(-48))),
        bad("a width of 0", "tiny", RECONSTRUCT, &["`w`", "above 0"], |f| key(f, "w", json!(0))),
        bad("a depth scale of 0", "tiny", RECONSTRUCT, &["`depth_scale`", "above 0"], |f| {
            key(f, "depth_scale", json!(0))
        }),
        bad("a negative depth scale", "tiny", RECONSTRUCT, &["`depth_scale`", "above 0"], |f| {
            key(f, "depth_scale", json!(-1000))
        }),
        bad("a depth scale of text", "tiny", RECONSTRUCT, &["`depth_scale`", "string"], |f| {
            key(f, "depth_scale", json!("mm"))
        }),
        bad("a depth scale of NaN", "tiny", RECONSTRUCT, &["`depth_scale`", "NaN"], |f| raw(f, "depth_scale", "NaN")),
        bad("a huge depth scale", "tiny", RECONSTRUCT, &["depth_scale"], |f| {
            f.both("transforms_train_{}.json", |root| root["depth_scale"] = json!(1e30))
        }),
        bad("a tiny depth scale", "tiny", RECONSTRUCT, &["depth_scale"], |f| {
            f.both("transforms_train_{}.json", |root| root["depth_scale"] = json!(1e-30))
        }),
        bad("a depth scale beyond single precision", "tiny", RECONSTRUCT, &["depth_scale"], |f| {
            key(f, "depth_scale", json!(1e300))
        }),
        bad("a depth scale below single precision", "tiny", RECONSTRUCT, &["depth_scale"], |f| {
            key(f, "depth_scale", json!(1e-300))
        }),
        bad("the lens is a fisheye", "tiny", RECONSTRUCT, &["camera_model", "OPENCV_FISHEYE", "undistort"], |f| {
            key(f, "camera_model", json!("OPENCV_FISHEYE"))
        }),
        bad("the lens is a number", "tiny", RECONSTRUCT, &["camera_model", "expected a string"], |f| {
            key(f, "camera_model", json!(3))
        }),
        bad("a negative focal length of one frame", "tiny", RECONSTRUCT, &["frame 0", "`fl_x`"], |f| {
            f.json(START, |root| root["frames"][0]["fl_x"] = json!(-1))
        }),
        bad("PARIS without K", "paris", RECONSTRUCT, &["camera_train.json", "`K`", "is missing"], |f| {
            f.json("start/camera_train.json", |root| {
                root.as_object_mut().unwrap().remove("K");
            })
        }),
        bad("PARIS with skew", "paris", RECONSTRUCT, &["`K`", "skew"], |f| {
            f.json("start/camera_train.json", |root| root["K"][0][1] = json!(3.0))
        }),
        bad("PARIS with negative K", "paris", RECONSTRUCT, &["`K`", "above 0"], |f| {
            f.json("start/camera_train.json", |root| root["K"][0][0] = json!(-3.0))
        }),
        bad("PARIS with K by columns", "paris", RECONSTRUCT, &["`K`"], |f| {
            f.json("start/camera_train.json", |root| {
                let k = root["K"].clone();
                for row in 0..3 {
                    for column in 0..3 {
                        root["K"][row][column] = k[column][row].clone();
                    }
                }
            })
        }),
        bad("PARIS with a 4x4 K", "paris", RECONSTRUCT, &["`K`", "3x3"], |f| {
            f.json("start/camera_train.json", |root| root["K"] = json!(vec![[1.0; 4]; 4]))
        }),
        bad("PARIS with K of text", "paris", RECONSTRUCT, &["`K`", "3x3"], |f| {
            f.json("start/camera_train.json", |root| root["K"] = json!("K"))
        }),
        bad("PARIS without a frame's image", "paris", RECONSTRUCT, &["no image", "0001.png"], |f| {
            f.remove("start/train/0001.png")
        }),
        bad("PARIS without frames", "paris", RECONSTRUCT, &["camera_train.json", "0 usable"], |f| {
            f.json("start/camera_train.json", |root| {
                let k = root["K"].clone();
                *root = json!({ "K": k });
            })
        }),
    ]);
}

#[test]
fn frames() {
    check(&[
        bad("no frames", "tiny", RECONSTRUCT, &[START, "`frames`", "is missing"], |f| {
            f.json(START, |root| {
                root.as_object_mut().unwrap().remove("frames");
            })
        }),
        bad("an empty list of frames", "tiny", RECONSTRUCT, &[START, "`frames`", "0 usable"], |f| {
            key(f, "frames", json!([]))
        }),
        bad("frames are an object", "tiny", RECONSTRUCT, &["`frames`"], |f| key(f, "frames", json!({}))),
        bad("frames are text", "tiny", RECONSTRUCT, &["`frames`"], |f| key(f, "frames", json!("all"))),
        bad("a frame is null", "tiny", RECONSTRUCT, &["frame 1"], |f| {
            f.json(START, |root| root["frames"][1] = json!(null))
        }),
        bad("a frame is a list", "tiny", RECONSTRUCT, &["frame 1"], |f| {
            f.json(START, |root| root["frames"][1] = json!([1]))
        }),
        bad("a single frame", "tiny", RECONSTRUCT, &["`frames`", "1 usable", "at least 2"], |f| {
            f.json(START, |root| root["frames"].as_array_mut().unwrap().truncate(1))
        }),
        bad("a frame without path", "tiny", RECONSTRUCT, &["frame 0", "file_path", "is missing"], |f| {
            f.json(START, |root| {
                root["frames"][0].as_object_mut().unwrap().remove("file_path");
            })
        }),
        bad("a frame without pose", "tiny", RECONSTRUCT, &["frame 0", "transform_matrix", "is missing"], |f| {
            f.json(START, |root| {
                root["frames"][0].as_object_mut().unwrap().remove("transform_matrix");
            })
        }),
        bad("a path that is a number", "tiny", RECONSTRUCT, &["file_path", "expected a string"], |f| {
            f.json(START, |root| root["frames"][0]["file_path"] = json!(0))
        }),
        bad("an empty path", "tiny", RECONSTRUCT, &["frame 0", "file_path"], |f| {
            f.json(START, |root| root["frames"][0]["file_path"] = json!(""))
        }),
        bad("a path that ends in dots", "tiny", RECONSTRUCT, &["frame 0", "file_path"], |f| {
            f.json(START, |root| root["frames"][0]["file_path"] = json!("start/.."))
        }),
        bad("an absolute path of another machine", "tiny", RECONSTRUCT, &["no image", "file_path"], |f| {
            f.json(START, |root| root["frames"][0]["file_path"] = json!("C:\\photos\\0000.png"))
        }),
        bad("a path that does not exist", "tiny", RECONSTRUCT, &["no image nowhere.png exists"], |f| {
            f.json(START, |root| root["frames"][0]["file_path"] = json!("nowhere.png"))
        }),
        bad("a depth path that does not exist", "tiny", RECONSTRUCT, &["depth_path", "nowhere.png"], |f| {
            f.json(START, |root| root["frames"][0]["depth_path"] = json!("nowhere.png"))
        }),
        bad("a depth path that is a list", "tiny", RECONSTRUCT, &["depth_path", "expected a string"], |f| {
            f.json(START, |root| root["frames"][0]["depth_path"] = json!([]))
        }),
        bad("a time of text", "tiny", RECONSTRUCT, &["`time`", "expected a finite number"], |f| {
            f.json(START, |root| root["frames"][0]["time"] = json!("start"))
        }),
        odd("times of the other state", "tiny", "inspect IN", &["warning", "`time`"], |f| {
            f.json(START, |root| root["frames"][0]["time"] = json!(1.0))
        }),
        odd("a frame listed twice", "tiny", "inspect IN", &["5 views"], |f| {
            f.json(START, |root| {
                let first = root["frames"][0].clone();
                root["frames"].as_array_mut().unwrap().push(first);
            })
        }),
        odd("frames in another order", "tiny", "inspect IN", &["4 views"], |f| {
            f.json(START, |root| root["frames"].as_array_mut().unwrap().reverse())
        }),
        odd("two frames per state", "tiny", "inspect IN", &["2 views"], |f| {
            f.both("transforms_train_{}.json", |root| root["frames"].as_array_mut().unwrap().truncate(2))
        }),
        bad("two frames per state are reconstructed", "tiny", RECONSTRUCT, &["2"], |f| {
            f.both("transforms_train_{}.json", |root| root["frames"].as_array_mut().unwrap().truncate(2))
        }),
        bad(
            "a damaged list of held-out views",
            "tiny",
            RECONSTRUCT,
            &["transforms_test_start.json", "not valid JSON"],
            |f| f.write("transforms_test_start.json", "{"),
        ),
        bad("a damaged file of frames", "tiny", RECONSTRUCT, &["frames.json"], |f| {
            f.write("frames.json", "{\"frames\": 3}")
        }),
    ]);
}

#[test]
fn poses() {
    check(&[
        bad(
            "NaN",
            "tiny",
            RECONSTRUCT,
            &["frame 0", "transform_matrix", "not a finite number", "row 0, column 3"],
            |f| {
                cell(f, 0, 3, json!("RAW"));
                f.text(START, "\"RAW\"", "NaN");
            },
        ),
        bad("Infinity", "tiny", RECONSTRUCT, &["transform_matrix", "not a finite number"], |f| {
            cell(f, 1, 3, json!("RAW"));
            f.text(START, "\"RAW\"", "-Infinity");
        }),
        bad("1e999", "tiny", RECONSTRUCT, &[START, "out of range"], |f| {
            cell(f, 1, 3, json!("RAW"));
            f.text(START, "\"RAW\"", "1e999");
        }),
        bad("nan in lower case", "tiny", RECONSTRUCT, &[START, "not valid JSON"], |f| {
            cell(f, 1, 3, json!("RAW"));
            f.text(START, "\"RAW\"", "nan");
        }),
        bad("null", "tiny", RECONSTRUCT, &["transform_matrix", "not a finite number"], |f| cell(f, 2, 1, json!(null))),
        bad("text", "tiny", RECONSTRUCT, &["transform_matrix", "4x4"], |f| cell(f, 2, 1, json!("0.5"))),
        bad("3 rows", "tiny", RECONSTRUCT, &["transform_matrix", "4x4"], |f| {
            f.json(START, |root| root["frames"][0]["transform_matrix"].as_array_mut().unwrap().truncate(3))
        }),
        bad("a 3x3 matrix", "tiny", RECONSTRUCT, &["transform_matrix", "4x4"], |f| {
            f.json(START, |root| root["frames"][0]["transform_matrix"] = json!([[1, 0, 0], [0, 1, 0], [0, 0, 1]]))
        }),
        bad("16 numbers in a row", "tiny", RECONSTRUCT, &["transform_matrix", "4x4"], |f| {
            f.json(START, |root| {
                root["frames"][0]["transform_matrix"] = json!([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0])
            })
        }),
        bad("rows of 5", "tiny", RECONSTRUCT, &["transform_matrix", "4x4"], |f| {
            f.json(START, |root| {
                root["frames"][0]["transform_matrix"] =
                    json!([[0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]])
            })
        }),
        bad("all zero", "tiny", RECONSTRUCT, &["transform_matrix", "0 0 0 1"], |f| {
            f.json(START, |root| {
                root["frames"][0]["transform_matrix"] = json!([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]])
            })
        }),
        bad("a rotation of zero", "tiny", RECONSTRUCT, &["transform_matrix", "not orthonormal"], |f| {
            f.json(START, |root| {
                root["frames"][0]["transform_matrix"] = json!([[0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]])
            })
        }),
        bad("by columns", "tiny", RECONSTRUCT, &["transform_matrix", "last row", "row by row"], |f| {
            f.json(START, |root| {
                let m = root["frames"][0]["transform_matrix"].clone();
                for row in 0..4 {
                    for column in 0..4 {
                        root["frames"][0]["transform_matrix"][row][column] = m[column][row].clone();
                    }
                }
            })
        }),
        bad("scaled by 1000", "tiny", RECONSTRUCT, &["transform_matrix", "uniform scale of 1000"], |f| {
            scaled(f, [1000.0; 3])
        }),
        bad("sheared", "tiny", RECONSTRUCT, &["transform_matrix", "not orthonormal"], |f| scaled(f, [1.0, 1.3, 1.0])),
        bad("mirrored", "tiny", RECONSTRUCT, &["transform_matrix", "mirrors"], |f| scaled(f, [1.0, 1.0, -1.0])),
        bad("a huge rotation", "tiny", RECONSTRUCT, &["transform_matrix"], |f| scaled(f, [1e200; 3])),
        bad("a huge position", "tiny", RECONSTRUCT, &[START, "transform_matrix"], |f| cell(f, 0, 3, json!(1e300))),
        bad("a position a million away", "tiny", RECONSTRUCT, &["agree between views"], |f| cell(f, 0, 3, json!(1e6))),
    ]);
}

/// Scales the columns of the first rotation.
fn scaled(f: &Folder, by: [f64; 3]) {
    f.json(START, |root| {
        for row in 0..3 {
            for column in 0..3 {
                let cell = &mut root["frames"][0]["transform_matrix"][row][column];
                *cell = json!(cell.as_f64().unwrap() * by[column]);
            }
        }
    });
}
