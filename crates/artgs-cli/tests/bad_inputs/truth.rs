//! Ground truth and what is compared with it.

use crate::case::{bad, check};
use crate::folder::Folder;
use serde_json::{Value, json};

const EVALUATE: &str = "evaluate IN --gt IN/gt";
const FILE: &str = "gt/trans.json";

fn entry(f: &Folder, change: impl FnOnce(&mut Value)) {
    f.json(FILE, |root| change(&mut root["trans_info"][0]));
}

/// Multiplies the coordinates of every true mesh.
fn scaled(f: &Folder, by: f32) {
    for state in ["start", "end"] {
        for name in f.names(&format!("gt/{state}")) {
            let mut mesh = artgs_io::read_mesh_ply(&f.path(&name)).unwrap();
            mesh.vertices.iter_mut().flatten().for_each(|v| *v *= by);
            f.remove(&name);
            artgs_io::write_mesh_ply(&f.path(&name), &mesh).unwrap();
        }
    }
}

#[test]
fn ground_truth() {
    check(&[
        bad(
            "the capture in place of its ground truth",
            "replica",
            "evaluate IN --gt IN",
            &["a capture", "--gt", "in/gt"],
            |_| {},
        ),
        bad("no folder", "replica", "evaluate IN --gt IN/none", &["none", "no such folder"], |_| {}),
        bad("a file", "replica", "evaluate IN --gt IN/gt/trans.json", &["trans.json", "is a file"], |_| {}),
        bad("an empty folder", "replica", "evaluate IN --gt IN/empty", &["trans.json"], |f| {
            std::fs::create_dir(f.path("empty")).unwrap();
        }),
        bad("no replica", "replica", "evaluate IN/gt --gt IN/gt", &["is a folder of a replica; give"], |_| {}),
        bad("empty", "replica", EVALUATE, &["trans.json", "EOF"], |f| f.write(FILE, "")),
        bad("cut", "replica", EVALUATE, &["trans.json", "EOF"], |f| f.cut(FILE, 0.5)),
        bad("a list", "replica", EVALUATE, &["trans.json", "trans_info"], |f| f.write(FILE, "[]")),
        bad("no joints", "replica", EVALUATE, &["trans.json", "trans_info"], |f| f.write(FILE, "{}")),
        bad("joints of text", "replica", EVALUATE, &["trans.json", "trans_info"], |f| {
            f.write(FILE, "{\"trans_info\": \"x\"}")
        }),
        bad("no axis", "replica", EVALUATE, &["trans_info[0]", "`axis` is missing"], |f| {
            entry(f, |e| {
                e.as_object_mut().unwrap().remove("axis");
            })
        }),
        bad("an axis of zero", "replica", EVALUATE, &["trans_info[0]", "`axis.d` is zero"], |f| {
            entry(f, |e| e["axis"]["d"] = json!([0, 0, 0]))
        }),
        bad("an axis of two numbers", "replica", EVALUATE, &["trans_info[0]", "`axis.d`"], |f| {
            entry(f, |e| e["axis"]["d"] = json!([0, 1]))
        }),
        bad("an axis of null", "replica", EVALUATE, &["trans_info[0]", "`axis.o`"], |f| {
            entry(f, |e| e["axis"]["o"] = json!([0, 1, null]))
        }),
        bad("an unknown type", "replica", EVALUATE, &["trans_info[0]", "`type`"], |f| {
            entry(f, |e| e["type"] = json!("ball"))
        }),
        bad("no range", "replica", EVALUATE, &["trans_info[0]", "rotate"], |f| {
            entry(f, |e| {
                e.as_object_mut().unwrap().remove("rotate");
            })
        }),
        bad("a range of text", "replica", EVALUATE, &["trans_info[0]", "`rotate.r`"], |f| {
            entry(f, |e| e["rotate"]["r"] = json!("90"))
        }),
        bad("its own parent", "replica", EVALUATE, &["trans_info[0]", "`parent` is 2"], |f| {
            entry(f, |e| e["parent"] = json!(2))
        }),
        bad("a parent that does not exist", "replica", EVALUATE, &["trans_info[0]", "`parent` is 77"], |f| {
            entry(f, |e| e["parent"] = json!(77))
        }),
        bad("a cycle of parents", "replica", EVALUATE, &["trans_info[0]", "cycle"], |f| {
            entry(f, |e| e["parent"] = json!(3));
            f.json(FILE, |root| root["trans_info"][1]["parent"] = json!(2));
        }),
        bad("a mesh is missing", "replica", EVALUATE, &["start_dynamic_1_rotate.ply"], |f| {
            f.remove("gt/start/start_dynamic_1_rotate.ply")
        }),
        bad("a mesh is cut", "replica", EVALUATE, &["end_static_rotate.ply", "ends early"], |f| {
            f.cut("gt/end/end_static_rotate.ply", 0.8)
        }),
        bad("a mesh is empty", "replica", EVALUATE, &["end_static_rotate.ply"], |f| {
            f.write("gt/end/end_static_rotate.ply", "")
        }),
        bad("a mesh has no triangles", "replica", EVALUATE, &["start_rotate.ply"], |f| {
            f.write("gt/start/start_rotate.ply", "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n");
        }),
        bad("millimetres", "replica", EVALUATE, &["unit"], |f| scaled(f, 1000.0)),
        bad("kilometres", "replica", EVALUATE, &["unit"], |f| scaled(f, 0.001)),
        bad("neither truth nor capture", "replica", "evaluate IN", &["--gt"], |_| {}),
        bad(
            "weights without a capture",
            "replica",
            "evaluate IN --gt IN/gt --lpips IN/w.safetensors",
            &["--capture"],
            |_| {},
        ),
        bad(
            "weights that are none",
            "replica",
            "evaluate IN --gt IN/gt --capture IN/gt --lpips IN/w.safetensors",
            &["w.safetensors"],
            |f| f.write("w.safetensors", "x"),
        ),
        bad("a capture that is none", "replica", "evaluate IN --capture IN/gt", &["not a capture"], |_| {}),
        bad("scores into a folder", "replica", "evaluate IN --gt IN/gt --json IN/gt", &["gt: is a folder"], |_| {}),
        bad(
            "scores below a file",
            "replica",
            "evaluate IN --gt IN/gt --json IN/replica.json/scores.json",
            &["scores.json"],
            |_| {},
        ),
        bad("no threads", "replica", "evaluate IN --gt IN/gt --threads 0", &["--threads"], |_| {}),
    ]);
}
