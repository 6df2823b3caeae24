//! Captures whose images are damaged, of another kind, or empty.

use crate::case::{bad, check, odd};
use crate::folder::{Folder, huge_png, jpeg, png};
use image::{DynamicImage, GrayImage, Luma, RgbImage};

const COLOUR: &str = "start/train/rgba/0000.png";
const DEPTH: &str = "start/train/depth/0000.png";
const RECONSTRUCT: &str = "reconstruct IN -o OUT";

fn every(f: &Folder, folder: &str, change: impl Fn(&str)) {
    for state in ["start", "end"] {
        f.names(&format!("{state}/train/{folder}")).iter().for_each(|name| change(name));
    }
}

fn no_depth(f: &Folder) {
    for state in ["start", "end"] {
        f.remove(&format!("{state}/train/depth"));
    }
    f.both("transforms_train_{}.json", |root| {
        for frame in root["frames"].as_array_mut().unwrap() {
            frame.as_object_mut().unwrap().remove("depth_path");
        }
    });
}

#[test]
fn colours() {
    check(&[
        bad("empty", "tiny", RECONSTRUCT, &["frame 0", COLOUR, "not a complete, readable PNG"], |f| {
            f.write(COLOUR, "")
        }),
        bad("one byte", "tiny", RECONSTRUCT, &[COLOUR, "not a complete, readable PNG"], |f| f.write(COLOUR, "x")),
        bad("cut in the header", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| {
            f.bytes(COLOUR, |b| b.truncate(20))
        }),
        bad("cut in the middle", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| f.cut(COLOUR, 0.5)),
        bad("cut near the end", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| f.cut(COLOUR, 0.9)),
        bad("only zeros", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| f.write(COLOUR, [0; 4096])),
        bad("changed in the middle", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| {
            f.bytes(COLOUR, |b| {
                let middle = b.len() / 2;
                b[middle..middle + 40].fill(0x55);
            })
        }),
        bad("JSON", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| f.write(COLOUR, "{}")),
        bad("a folder", "tiny", RECONSTRUCT, &["no image", "0000.png"], |f| {
            f.remove(COLOUR);
            f.write(&format!("{COLOUR}/x"), "");
        }),
        bad("missing", "tiny", RECONSTRUCT, &["frame 0", "file_path", "0000.png"], |f| f.remove(COLOUR)),
        bad("all missing", "tiny", RECONSTRUCT, &["frame 0", "file_path"], |f| f.remove("start/train/rgba")),
        bad("a header of a billion pixels", "tiny", RECONSTRUCT, &[COLOUR, "60000x60000", "1 GiB"], |f| {
            f.write(COLOUR, huge_png(60_000, 60_000))
        }),
        bad("a header of the largest numbers", "tiny", RECONSTRUCT, &[COLOUR], |f| {
            f.write(COLOUR, huge_png(i32::MAX as u32, i32::MAX as u32))
        }),
        bad("a header of numbers that are too large", "tiny", RECONSTRUCT, &[COLOUR], |f| {
            f.write(COLOUR, huge_png(u32::MAX, u32::MAX))
        }),
        bad("a header of width 0", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| {
            f.write(COLOUR, huge_png(0, 48))
        }),
        bad("a wide header", "tiny", RECONSTRUCT, &[COLOUR, "not a complete"], |f| f.write(COLOUR, huge_png(4800, 48))),
        bad("another size", "tiny", RECONSTRUCT, &["0000.png", "24x24", "48"], |f| {
            f.write(COLOUR, png(&DynamicImage::new_rgba8(24, 24)))
        }),
        bad("another size where the size is not stated", "tiny", RECONSTRUCT, &["24x24", "48x48", "one size"], |f| {
            f.both("transforms_train_{}.json", |root| {
                root.as_object_mut().unwrap().retain(|key, _| key != "w" && key != "h");
            });
            f.write("start/train/rgba/0002.png", png(&DynamicImage::new_rgba8(24, 24)));
            f.write("start/train/depth/0002.png", png(&DynamicImage::new_luma16(24, 24)));
        }),
        bad("one pixel", "tiny", RECONSTRUCT, &["1x1"], |f| f.write(COLOUR, png(&DynamicImage::new_rgba8(1, 1)))),
        bad("a JPEG named .png", "tiny", RECONSTRUCT, &[COLOUR, "JPEG"], |f| {
            f.write(COLOUR, jpeg(&RgbImage::new(48, 48).into()))
        }),
        bad("a GIF named .png", "tiny", RECONSTRUCT, &[COLOUR, "not a complete, readable PNG"], |f| {
            f.write(COLOUR, "GIF89a\x30\0\x30\0\0\0\0;")
        }),
        bad("a WebP named .png", "tiny", RECONSTRUCT, &[COLOUR, "not a complete, readable PNG"], |f| {
            f.write(COLOUR, "RIFF\x24\0\0\0WEBPVP8 ")
        }),
        bad("no alpha in any view", "tiny", "inspect IN", &["refuses this input"], |f| {
            every(f, "rgba", |name| f.write(name, png(&RgbImage::new(48, 48).into())))
        }),
        odd("grey", "tiny", "inspect IN", &["no alpha"], |f| f.write(COLOUR, png(&GrayImage::new(48, 48).into()))),
        odd("16 bits per channel", "tiny", "inspect IN", &["16 bits"], |f| {
            let image = image::load_from_memory(&f.read(COLOUR)).unwrap();
            f.write(COLOUR, png(&image.into_rgba16().into()));
        }),
        odd("read only", "tiny", "inspect IN", &["4 views"], |f| {
            // Not through a link that other cases share.
            f.bytes(COLOUR, |_| {});
            let mut rights = std::fs::metadata(f.path(COLOUR)).unwrap().permissions();
            rights.set_readonly(true);
            std::fs::set_permissions(f.path(COLOUR), rights).unwrap();
        }),
    ]);
}

#[test]
fn masks() {
    check(&[
        bad(
            "empty everywhere",
            "tiny",
            RECONSTRUCT,
            &["the mask (alpha) is empty in every frame", "255 on the object"],
            |f| {
                every(f, "rgba", |name| f.colour(name, |[r, g, b, _]| [r, g, b, 0]));
            },
        ),
        bad("of 0 and 1", "tiny", RECONSTRUCT, &["alpha", "255"], |f| {
            every(f, "rgba", |name| f.colour(name, |[r, g, b, a]| [r, g, b, a / 255]));
        }),
        bad("inverted", "tiny", RECONSTRUCT, &["mask"], |f| {
            every(f, "rgba", |name| f.colour(name, |[r, g, b, a]| [r, g, b, 255 - a]));
        }),
        odd("empty in one frame", "tiny", "inspect IN", &["warning", "their mask (alpha) is empty", "0000.png"], |f| {
            f.colour(COLOUR, |[r, g, b, _]| [r, g, b, 0]);
        }),
        bad("empty in all frames but one", "tiny", RECONSTRUCT, &["1 usable training views", "at least 2"], |f| {
            for name in &f.names("start/train/rgba")[1..] {
                f.colour(name, |[r, g, b, _]| [r, g, b, 0]);
            }
        }),
        odd("full everywhere", "tiny", "inspect IN", &["100.0 % of the pixels"], |f| {
            every(f, "rgba", |name| f.colour(name, |[r, g, b, _]| [r, g, b, 255]));
        }),
        odd("half transparent", "tiny", "inspect IN", &["4 views"], |f| {
            every(f, "rgba", |name| f.colour(name, |[r, g, b, a]| [r, g, b, if a > 0 { 200 } else { 0 }]));
        }),
        bad("one pixel", "tiny", RECONSTRUCT, &["mask"], |f| {
            every(f, "rgba", |name| {
                let first = std::sync::atomic::AtomicBool::new(true);
                f.colour(name, |[r, g, b, _]| {
                    [r, g, b, if first.swap(false, std::sync::atomic::Ordering::Relaxed) { 255 } else { 0 }]
                });
            });
        }),
        bad("inverted in the end state", "tiny", RECONSTRUCT, &["mask"], |f| {
            f.names("end/train/rgba").iter().for_each(|name| f.colour(name, |[r, g, b, a]| [r, g, b, 255 - a]));
        }),
    ]);
}

#[test]
fn depths() {
    const OF: &str = "depth/0000.png";
    check(&[
        bad("empty", "tiny", RECONSTRUCT, &["frame 0", OF, "not a complete, readable PNG"], |f| f.write(DEPTH, "")),
        bad("cut", "tiny", RECONSTRUCT, &[OF, "not a complete"], |f| f.cut(DEPTH, 0.6)),
        bad("a huge header", "tiny", RECONSTRUCT, &[OF, "1 GiB"], |f| f.write(DEPTH, huge_png(50_000, 50_000))),
        bad("8 bits", "tiny", RECONSTRUCT, &[OF, "16"], |f| {
            f.write(DEPTH, png(&GrayImage::from_pixel(48, 48, Luma([200])).into()))
        }),
        bad("colours", "tiny", RECONSTRUCT, &[OF, "16"], |f| f.write(DEPTH, png(&RgbImage::new(48, 48).into()))),
        bad("alpha", "tiny", RECONSTRUCT, &[OF, "16"], |f| f.write(DEPTH, png(&DynamicImage::new_luma_a16(48, 48)))),
        bad("a JPEG", "tiny", RECONSTRUCT, &[OF, "JPEG"], |f| f.write(DEPTH, jpeg(&RgbImage::new(48, 48).into()))),
        bad("another size", "tiny", RECONSTRUCT, &[OF, "24x24", "48x48", "rescale"], |f| {
            f.write(DEPTH, png(&DynamicImage::new_luma16(24, 24)))
        }),
        bad("turned", "tiny", RECONSTRUCT, &[OF, "48x36"], |f| f.write(DEPTH, png(&DynamicImage::new_luma16(48, 36)))),
        bad("zero everywhere", "tiny", RECONSTRUCT, &["depth is zero on the object in every frame"], |f| {
            every(f, "depth", |name| f.depth(name, |_| 0))
        }),
        bad("zero in one state", "tiny", RECONSTRUCT, &["transforms_train_end.json", "depth is zero"], |f| {
            f.names("end/train/depth").iter().for_each(|name| f.depth(name, |_| 0));
        }),
        odd("zero in one frame", "tiny", "inspect IN", &["4 views"], |f| f.depth(DEPTH, |_| 0)),
        odd(
            "missing in one frame",
            "tiny",
            "inspect IN",
            &["warning", "have no depth", "0000.png", "takes longer"],
            |f| {
                f.remove(DEPTH);
                f.json("transforms_train_start.json", |root| {
                    root["frames"][0].as_object_mut().unwrap().remove("depth_path");
                });
            },
        ),
        bad("missing where the file lists it", "tiny", RECONSTRUCT, &["depth_path", "add it or remove the key"], |f| {
            f.remove(DEPTH)
        }),
        odd(
            "missing everywhere",
            "tiny",
            "inspect IN",
            &["warning", "not every training view has depth", "takes longer"],
            no_depth,
        ),
        bad("the largest number everywhere", "tiny", RECONSTRUCT, &["depth"], |f| {
            every(f, "depth", |name| f.depth(name, |_| u16::MAX))
        }),
        bad("one millimetre everywhere", "tiny", RECONSTRUCT, &["depth"], |f| {
            every(f, "depth", |name| f.depth(name, |_| 1))
        }),
        bad("in centimetres", "fridge", RECONSTRUCT, &["depth"], |f| {
            every(f, "depth", |name| f.depth(name, |c| c / 10))
        }),
        bad("bytes in the other order", "fridge", RECONSTRUCT, &["depth"], |f| {
            every(f, "depth", |name| f.depth(name, u16::swap_bytes))
        }),
    ]);
}
