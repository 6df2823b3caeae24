//! Recordings in one file: bags, MCAP and the archives of Record3D.

use crate::case::{bad, check};

const BAG: &str = "inspect IN/small.bag --poses IN/poses.txt";
const MCAP: &str = "inspect IN/small.mcap --poses IN/poses.txt";
const R3D: &str = "inspect IN/small.r3d";

#[test]
fn bags() {
    check(&[
        bad("as it is", "containers", BAG, &["3 frames have depth, at least 4", "refuses this input"], |_| {}),
        bad(
            "no poses",
            "containers",
            "inspect IN/small.bag",
            &["small.bag", "contains no poses", "timestamp tx ty tz"],
            |_| {},
        ),
        bad("empty", "containers", BAG, &["small.bag", "no bag of ROS 1"], |f| f.write("small.bag", "")),
        bad("only the first line", "containers", BAG, &["small.bag", "colour"], |f| {
            f.write("small.bag", "#ROSBAG V2.0\n")
        }),
        bad("of version 1.2", "containers", BAG, &["small.bag"], |f| f.bytes("small.bag", |b| b[9] = b'1')),
        bad("cut in the middle", "containers", BAG, &["small.bag", "damaged or incomplete"], |f| {
            f.cut("small.bag", 0.5)
        }),
        bad("cut at the end", "containers", BAG, &["small.bag", "damaged or incomplete"], |f| {
            f.cut("small.bag", 0.999)
        }),
        bad("zeros from the middle", "containers", BAG, &["small.bag"], |f| {
            f.bytes("small.bag", |b| {
                let middle = b.len() / 2;
                b[middle..].fill(0);
            })
        }),
        bad("a header of 4 GB", "containers", BAG, &["small.bag", "damaged or incomplete"], |f| {
            f.bytes("small.bag", |b| b[13..17].fill(0xff))
        }),
        bad("an archive", "containers", BAG, &["small.bag"], |f| f.write("small.bag", "PK\u{3}\u{4}")),
        bad("poses of another clock", "containers", BAG, &["poses.txt", "20 ms", "time stamps"], |f| {
            f.write("poses.txt", "900.0 0 0 0 0 0 0 1\n900.1 0 0 0 0 0 0 1\n");
        }),
        bad("poses that are missing", "containers", "inspect IN/small.bag --poses IN/none.txt", &["none.txt"], |_| {}),
    ]);
}

#[test]
fn mcap_files() {
    check(&[
        bad("as it is", "containers", MCAP, &["3 frames have depth, at least 4", "refuses this input"], |_| {}),
        bad("empty", "containers", MCAP, &["small.mcap", "no MCAP file"], |f| f.write("small.mcap", "")),
        bad("only the magic bytes", "containers", MCAP, &["small.mcap", "damaged or incomplete"], |f| {
            f.bytes("small.mcap", |b| b.truncate(8))
        }),
        bad("cut in the middle", "containers", MCAP, &["small.mcap", "damaged or incomplete"], |f| {
            f.cut("small.mcap", 0.5)
        }),
        bad("cut at the end", "containers", MCAP, &["small.mcap", "damaged or incomplete"], |f| {
            f.bytes("small.mcap", |b| {
                let length = b.len();
                b.truncate(length - 20);
            })
        }),
        bad("a record of 2^64 bytes", "containers", MCAP, &["small.mcap", "damaged or incomplete"], |f| {
            f.bytes("small.mcap", |b| b[9..17].fill(0xff))
        }),
        bad("zeros from the middle", "containers", MCAP, &["small.mcap"], |f| {
            f.bytes("small.mcap", |b| {
                let middle = b.len() / 2;
                b[middle..].fill(0);
            })
        }),
        bad("no poses", "containers", "inspect IN/small.mcap", &["contains no poses"], |_| {}),
    ]);
}

#[test]
fn archives() {
    check(&[
        bad("as it is", "containers", R3D, &["3 frames have depth, at least 4", "refuses this input"], |_| {}),
        bad("empty", "containers", R3D, &["small.r3d", "no camera file"], |f| f.write("small.r3d", "")),
        bad("cut in the middle", "containers", R3D, &["small.r3d"], |f| f.cut("small.r3d", 0.5)),
        bad("cut at the end", "containers", R3D, &["small.r3d"], |f| {
            f.bytes("small.r3d", |b| {
                let length = b.len();
                b.truncate(length - 30);
            })
        }),
        bad("zeros in the middle", "containers", R3D, &["small.r3d"], |f| {
            f.bytes("small.r3d", |b| {
                let (a, z) = (b.len() / 4, b.len() / 2);
                b[a..z].fill(0);
            })
        }),
        bad("text after the first bytes", "containers", R3D, &["small.r3d"], |f| {
            f.write("small.r3d", "PK but no archive")
        }),
    ]);
}
