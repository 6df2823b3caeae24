//! Replica folders that are damaged.

use crate::case::{Trials, bad, check, odd};
use crate::folder::Folder;
use serde_json::{Value, json};

const EXPORT: &str = "export IN --to urdf,glb";
const FILE: &str = "replica.json";
const MESH: &str = "meshes/start/part_1.ply";

fn part(f: &Folder, change: impl FnOnce(&mut Value)) {
    f.json(FILE, |root| change(&mut root["parts"][1]));
}

fn joint(f: &Folder, key: &str, value: Value) {
    part(f, |part| part["joint"][key] = value);
}

#[test]
fn documents() {
    check(&[
        odd("as it is", "replica", EXPORT, &["part_1"], |_| {}),
        bad("no document", "replica", EXPORT, &["no replica.json", "artgs reconstruct"], |f| f.remove(FILE)),
        bad("an empty folder", "", EXPORT, &["no replica.json"], |_| {}),
        bad("no folder", "", "export IN/nowhere", &["nowhere", "no such folder"], |_| {}),
        bad("a file", "replica", "export IN/replica.json", &["is a file", "give the folder"], |_| {}),
        bad("an interrupted run", "", EXPORT, &["its run stopped", "--resume"], |f| f.write("stages/keys.json", "{}")),
        bad("empty", "replica", EXPORT, &[FILE, "EOF"], |f| f.write(FILE, "")),
        bad("cut", "replica", EXPORT, &[FILE, "EOF"], |f| f.cut(FILE, 0.5)),
        bad("a list", "replica", EXPORT, &[FILE], |f| f.write(FILE, "[]")),
        bad("an empty object", "replica", EXPORT, &[FILE, "missing field"], |f| f.write(FILE, "{}")),
        bad("not text", "replica", EXPORT, &[FILE], |f| f.write(FILE, [0xff; 300])),
        bad("version 99", "replica", EXPORT, &[FILE, "`version` is 99", "reads version 1"], |f| {
            f.json(FILE, |r| r["version"] = json!(99))
        }),
        bad("version 0", "replica", EXPORT, &[FILE, "`version` is 0"], |f| f.json(FILE, |r| r["version"] = json!(0))),
        bad("a negative version", "replica", EXPORT, &[FILE], |f| f.json(FILE, |r| r["version"] = json!(-1))),
        bad("a version of text", "replica", EXPORT, &[FILE], |f| f.json(FILE, |r| r["version"] = json!("1"))),
        bad("another format", "replica", EXPORT, &[FILE, "`format` is \"urdf\""], |f| {
            f.json(FILE, |r| r["format"] = json!("urdf"))
        }),
        bad("no parts", "replica", EXPORT, &[FILE, "`parts` is empty"], |f| f.json(FILE, |r| r["parts"] = json!([]))),
        bad("parts of text", "replica", EXPORT, &[FILE, "line"], |f| f.json(FILE, |r| r["parts"] = json!("all"))),
        bad("other states", "replica", EXPORT, &[FILE], |f| f.json(FILE, |r| r["states"] = json!(["a", "b", "c"]))),
        bad("a path out of the folder", "replica", EXPORT, &["without `..`"], |f| {
            part(f, |p| p["meshes"]["start"] = json!("../../part.ply"))
        }),
        bad("an absolute path", "replica", EXPORT, &["without `..`"], |f| {
            part(f, |p| p["meshes"]["start"] = json!("/etc/passwd"))
        }),
        bad("an empty path", "replica", EXPORT, &["expected a path"], |f| {
            part(f, |p| p["meshes"]["start"] = json!(""))
        }),
        bad("a path to nothing", "replica", EXPORT, &["there is no mesh"], |f| {
            part(f, |p| p["meshes"]["start"] = json!("none.ply"))
        }),
        bad("a path to a folder", "replica", EXPORT, &["there is no mesh"], |f| {
            part(f, |p| p["meshes"]["start"] = json!("meshes"))
        }),
        bad("the whole object is missing", "replica", EXPORT, &["there is no mesh"], |f| {
            f.remove("meshes/start/whole.ply")
        }),
    ]);
}

#[test]
fn parts_and_joints() {
    check(&[
        bad("two parts of one number", "replica", EXPORT, &[FILE, "part 1"], |f| part(f, |p| p["id"] = json!(2))),
        bad("a negative number", "replica", EXPORT, &[FILE], |f| part(f, |p| p["id"] = json!(-1))),
        bad("two parts of one name", "replica", EXPORT, &[FILE, "name"], |f| part(f, |p| p["name"] = json!("part_2"))),
        bad("an empty name", "replica", EXPORT, &[FILE, "name"], |f| part(f, |p| p["name"] = json!(""))),
        bad("a name that is a path", "replica", EXPORT, &[FILE, "name"], |f| {
            part(f, |p| p["name"] = json!("../../evil"))
        }),
        bad("its own parent", "replica", EXPORT, &[FILE, "part 1", "parent"], |f| part(f, |p| p["parent"] = json!(1))),
        bad("a cycle of parents", "replica", EXPORT, &[FILE, "parent"], |f| {
            part(f, |p| p["parent"] = json!(2));
            f.json(FILE, |r| r["parts"][2]["parent"] = json!(1));
        }),
        bad("a parent that does not exist", "replica", EXPORT, &[FILE, "part 1", "parent"], |f| {
            part(f, |p| p["parent"] = json!(77))
        }),
        bad("no parent", "replica", EXPORT, &[FILE, "part 1"], |f| part(f, |p| p["parent"] = json!(null))),
        bad("no joint", "replica", EXPORT, &[FILE, "part 1", "joint"], |f| part(f, |p| p["joint"] = json!(null))),
        bad("a base with a parent", "replica", EXPORT, &[FILE, "part 0"], |f| {
            f.json(FILE, |r| r["parts"][0]["parent"] = json!(1))
        }),
        bad("a base with a joint", "replica", EXPORT, &[FILE, "part 0"], |f| {
            f.json(FILE, |r| r["parts"][0]["joint"] = r["parts"][1]["joint"].clone())
        }),
        bad("an unknown joint", "replica", EXPORT, &[FILE, "ball"], |f| joint(f, "type", json!("ball"))),
        bad("an axis of zero", "replica", EXPORT, &[FILE, "part 1", "`axis`"], |f| joint(f, "axis", json!([0, 0, 0]))),
        bad("an axis of length 2", "replica", EXPORT, &[FILE, "part 1", "`axis`"], |f| {
            joint(f, "axis", json!([2, 0, 0]))
        }),
        bad("an axis of two numbers", "replica", EXPORT, &[FILE], |f| joint(f, "axis", json!([0, 1]))),
        bad("an axis of null", "replica", EXPORT, &[FILE, "null"], |f| joint(f, "axis", json!([null, 0, 1]))),
        bad("an axis of NaN", "replica", EXPORT, &[FILE], |f| {
            joint(f, "axis", json!("RAW"));
            f.text(FILE, "\"RAW\"", "[NaN, 0, 1]");
        }),
        bad("an origin of 1e999", "replica", EXPORT, &[FILE, "out of range"], |f| {
            joint(f, "origin", json!("RAW"));
            f.text(FILE, "\"RAW\"", "[1e999, 0, 1]");
        }),
        bad("an origin far away", "replica", EXPORT, &[FILE, "origin"], |f| joint(f, "origin", json!([1e300, 0, 0]))),
        bad("limits that are reversed", "replica", EXPORT, &[FILE, "part 1", "limits"], |f| {
            joint(f, "limits", json!({"lower": 2.0, "upper": -2.0}))
        }),
        bad("no limits", "replica", EXPORT, &[FILE, "limits"], |f| {
            part(f, |p| {
                p["joint"].as_object_mut().unwrap().remove("limits");
            })
        }),
        bad("no values", "replica", EXPORT, &[FILE, "state_values"], |f| {
            part(f, |p| {
                p["joint"].as_object_mut().unwrap().remove("state_values");
            })
        }),
        bad("a confidence of 7", "replica", EXPORT, &[FILE, "part 1", "confidence"], |f| {
            part(f, |p| p["confidence"] = json!(7.0))
        }),
        bad("a confidence of text", "replica", EXPORT, &[FILE], |f| part(f, |p| p["confidence"] = json!("high"))),
    ]);
}

/// A PLY with these lines after the header's format and these bytes after the header.
fn ply(lines: &str, body: &[u8]) -> Vec<u8> {
    [format!("ply\nformat binary_little_endian 1.0\n{lines}end_header\n").as_bytes(), body].concat()
}

const VERTEX: &str = "property float x\nproperty float y\nproperty float z\n";
const FACE: &str = "property list uchar int vertex_indices\n";

#[test]
fn meshes() {
    let mut trials = Trials::default();
    let vertices = |n: usize| -> Vec<u8> { (0..3 * n).flat_map(|i| (i as f32).to_le_bytes()).collect() };
    let nan: Vec<u8> = (0..9).flat_map(|i| (if i == 4 { f32::NAN } else { i as f32 }).to_le_bytes()).collect();
    let infinite: Vec<u8> =
        (0..9).flat_map(|i| (if i == 4 { f32::INFINITY } else { i as f32 }).to_le_bytes()).collect();
    let huge: Vec<u8> = (0..9).flat_map(|i| (if i == 4 { 1e38 } else { i as f32 }).to_le_bytes()).collect();
    let face = |indices: [i32; 3]| [&[3][..], &indices.map(i32::to_le_bytes).concat()].concat();
    let of = |count: &str, faces: &str| format!("element vertex {count}\n{VERTEX}element face {faces}\n{FACE}");
    let cases: [(&str, Vec<u8>, &[&str]); 18] = [
        ("empty", Vec::new(), &["no `end_header`"]),
        ("text", b"hello\n".to_vec(), &["not a PLY file"]),
        ("no header", b"ply\n".to_vec(), &["no `end_header`"]),
        ("no format", b"ply\nend_header\n".to_vec(), &["no `format`"]),
        ("a count of a billion", ply(&of("1000000000", "0"), &vertices(3)), &["row 3", "ends early"]),
        ("a count beyond 64 bits", ply(&of("99999999999999999999999", "0"), &vertices(3)), &["whole number"]),
        ("a negative count", ply(&of("-3", "0"), &vertices(3)), &["whole number"]),
        ("a count of faces of a billion", ply(&of("3", "1000000000"), &vertices(3)), &["row 0", "ends early"]),
        ("a count of half", ply(&of("2.5", "0"), &vertices(3)), &["whole number"]),
        ("NaN", ply(&of("3", "1"), &[nan, face([0, 1, 2])].concat()), &["row 1", "not finite"]),
        ("infinity", ply(&of("3", "1"), &[infinite, face([0, 1, 2])].concat()), &["row 1", "not finite"]),
        ("a vertex at 1e38", ply(&of("3", "1"), &[huge, face([0, 1, 2])].concat()), &["part_1"]),
        (
            "an index out of range",
            ply(&of("3", "1"), &[vertices(3), face([0, 1, 9])].concat()),
            &["index 9", "3 vertices"],
        ),
        ("a negative index", ply(&of("3", "1"), &[vertices(3), face([0, -1, 2])].concat()), &["index -1"]),
        (
            "no coordinate z",
            ply("element vertex 1\nproperty float x\nproperty float y\n", &[0; 8]),
            &["no property `z`"],
        ),
        (
            "no vertex element",
            ply("element face 0\nproperty list uchar int vertex_indices\n", &[]),
            &["no element `vertex`"],
        ),
        ("an unknown type", ply("element vertex 1\nproperty quad x\n", &[0; 8]), &["quad"]),
        (
            "lists of a negative length",
            ply(
                &format!("element vertex 0\n{VERTEX}element face 1\nproperty list char int vertex_indices\n"),
                &[0xff, 0, 0],
            ),
            &["length -1"],
        ),
    ];
    for (name, bytes, words) in &cases {
        let all: Vec<&str> = words.iter().copied().chain(["part_1.ply"]).collect();
        trials.run(name, "replica", EXPORT, 2, &all, &|f| f.write(MESH, bytes));
    }
    trials.run("a thousand properties", "replica", EXPORT, 2, &["part_1.ply"], &|f| {
        let lines: String = (0..1000).map(|i| format!("property double p{i}\n")).collect();
        f.write(MESH, ply(&format!("element vertex 1000000000\n{lines}"), &[0; 100_000]));
    });
    trials.run("cut in the middle", "replica", EXPORT, 2, &["part_1.ply", "ends early"], &|f| f.cut(MESH, 0.7));
    trials.run("a folder", "replica", EXPORT, 2, &["there is no mesh"], &|f| {
        f.remove(MESH);
        f.write(&format!("{MESH}/x"), "");
    });
    trials.run("no vertices", "replica", EXPORT, 0, &["part_1 has no surface"], &|f| {
        f.write(MESH, ply(&of("0", "0"), &[]))
    });
    trials.run("faces of one point", "replica", EXPORT, 0, &["part_1 has no surface"], &|f| {
        f.write(MESH, ply(&of("3", "1"), &[vertices(3), face([1, 1, 1])].concat()))
    });
    trials.finish();
}

#[test]
fn views() {
    const PAGE: &str = "view IN --export OUT/page.html";
    check(&[
        bad("an empty folder", "", PAGE, &["in", "capture"], |_| {}),
        bad("no folder", "", "view IN/nowhere", &["nowhere", "no such folder"], |_| {}),
        bad("a file", "replica", "view IN/replica.json", &["replica.json"], |_| {}),
        bad("a damaged document", "replica", PAGE, &[FILE], |f| f.write(FILE, "{")),
        bad("a damaged mesh", "replica", PAGE, &["part_1.ply"], |f| f.cut(MESH, 0.5)),
        bad("a damaged capture", "tiny", PAGE, &["transforms_train_start.json"], |f| {
            f.write("transforms_train_start.json", "{")
        }),
        bad(
            "a page that cannot be written",
            "fridge",
            "view IN --export IN/synth.json/page.html",
            &["page.html"],
            |_| {},
        ),
        bad("port 0 to 65535", "tiny", "view IN --port 99999", &["--port"], |_| {}),
        bad("a negative port", "tiny", "view IN --port=-1", &["--port"], |_| {}),
        bad("a page and a port", "tiny", "view IN --port 1 --export OUT", &["--port"], |_| {}),
        odd("a recording", "nerfstudio", "view IN/start --export OUT/page.html", &["page.html"], |_| {}),
        bad("a damaged recording", "nerfstudio", "view IN/start --export OUT/page.html", &["transforms.json"], |f| {
            f.write("start/transforms.json", "{")
        }),
        bad("stages that are damaged", "found", "view IN/out --export OUT/page.html", &["stages"], |f| {
            f.names("out/stages").iter().filter(|n| !n.ends_with(".txt")).for_each(|n| {
                if f.path(n).is_file() {
                    f.write(n, "{")
                }
            });
        }),
    ]);
}
