//! Names that `artgs bench` understands: suites of procedural objects, and variants of the method.

use artgs::{Config, ablation};
use artgs_bench::paper::{self, PaperObject};
use artgs_bench::{Item, Source, Variant};
use artgs_io::recording::RecordingFormat;
use artgs_synth::cabinet::{CabinetOptions, write_cabinet};
use artgs_synth::recording::write_recorded_object;
use artgs_synth::{CaptureOptions, ObjectInfo, RecordingCaptureOptions, objects, suite as synth_suite, write_object};

/// Names of the suites, beside which any object of theirs may be named.
pub(crate) fn known() -> String {
    let suites = artgs_synth::SUITES.iter().chain(&["cabinet"]);
    let objects = objects().iter().map(|o| o.name);
    let list = |names: Vec<&str>| names.join(", ");
    format!("suites are {}; objects are {}", list(suites.copied().collect()), list(objects.collect()))
}

/// How captures of the objects of a suite are rendered: every combination of the lists. The suite decides where a list is
/// empty.
#[derive(Clone, Debug, Default)]
pub(crate) struct Photos {
    pub(crate) views: Vec<usize>,
    pub(crate) size: Vec<u32>,
    /// Degradations as `artgs synth --noise` reads them, joined by `+`; `none` for none.
    pub(crate) noise: Vec<String>,
    pub(crate) seed: u64,
}

/// One combination.
#[derive(Clone, Debug)]
struct Way {
    views: Option<usize>,
    size: Option<u32>,
    noise: Option<String>,
    /// Appended to the name of an object, if there is more than one way.
    suffix: String,
}

impl Photos {
    fn ways(&self) -> Vec<Way> {
        let some = |n: usize| (0..n.max(1)).map(move |i| (n > 0).then_some(i));
        let mut ways = Vec::new();
        for v in some(self.views.len()) {
            for s in some(self.size.len()) {
                for n in some(self.noise.len()) {
                    let (views, size) = (v.map(|v| self.views[v]), s.map(|s| self.size[s]));
                    let noise = n.map(|n| self.noise[n].clone());
                    let mut suffix = String::new();
                    for (many, text) in [
                        (self.views.len() > 1, views.map(|v| format!(".{v}_views"))),
                        (self.size.len() > 1, size.map(|s| format!(".{s}_px"))),
                        (self.noise.len() > 1, noise.as_ref().map(|n| format!(".{}", folder_name(n)))),
                    ] {
                        suffix.extend(text.filter(|_| many));
                    }
                    ways.push(Way { views, size, noise, suffix });
                }
            }
        }
        ways
    }
}

fn folder_name(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '.' { c } else { '_' }).collect()
}

/// Objects of a suite, or one object, with `.room` recorded in a room; none if there is neither, an error if no capture can be rendered so.
pub(crate) fn suite(name: &str, photos: &Photos) -> Option<Result<Vec<Item>, String>> {
    if name == "cabinet" {
        return Some(photos.ways().iter().map(|way| cabinet(way, photos.seed)).collect());
    }
    let (name, recorded) = name.strip_suffix(".room").map_or((name, false), |name| (name, true));
    let real_like = name == "real-like" || recorded;
    let names = synth_suite(name).or_else(|| objects().iter().find(|o| o.name == name).map(|o| vec![o.name]))?;
    let infos = objects().iter().filter(move |o| names.contains(&o.name));
    let ways = photos.ways();
    let make = if real_like { recorded_item } else { item };
    Some(ways.iter().flat_map(|way| infos.clone().map(|info| make(info, way, photos.seed))).collect())
}

fn item(info: &'static ObjectInfo, way: &Way, seed: u64) -> Result<Item, String> {
    let default = CaptureOptions::default();
    let (views, size) = (way.views.unwrap_or(default.views), way.size.unwrap_or(default.size));
    let mut options = CaptureOptions { views, size, seed, ..default };
    let settings = way.noise.as_deref().filter(|n| *n != "none").map(|n| n.split('+').collect::<Vec<_>>());
    for setting in settings.unwrap_or_default() {
        options.degradation.set(setting)?;
    }
    options.check().map_err(|e| e.to_string())?;
    let json = serde_json::to_string(&options).map_err(|e| e.to_string())?;
    Ok(Item {
        name: format!("{}{}", info.name, way.suffix),
        source: Source::Procedural {
            settings: format!("{} {json}", info.name),
            write: Box::new(move |folder| {
                write_object(info.name, &options, folder).map(drop).map_err(|e| e.to_string())
            }),
        },
        parts: Some(info.parts()),
        // One row for an object of the paper: it could be any of several captures.
        stands_for: row(info).filter(|_| way.suffix.is_empty()),
        same_object: false,
        noise: way.noise.as_deref().map(noise_label),
    })
}

/// An object recorded in a room with a phone.
fn recorded_item(info: &'static ObjectInfo, way: &Way, seed: u64) -> Result<Item, String> {
    if way.noise.is_some() {
        return Err("recordings of the suite real-like have the noise of their sensor; leave --noise out".into());
    }
    let default = RecordingCaptureOptions::default();
    let (views, width) = (way.views.unwrap_or(default.views), way.size.unwrap_or(default.width));
    let options = RecordingCaptureOptions { views, width, seed, ..default };
    options.check().map_err(|e| e.to_string())?;
    let json = serde_json::to_string(&options).map_err(|e| e.to_string())?;
    let format = RecordingFormat::ScannerApp;
    Ok(Item {
        name: format!("{}.room{}", info.name, way.suffix),
        source: Source::Procedural {
            settings: format!("{} in a room {json}", info.name),
            write: Box::new(move |folder| {
                write_recorded_object(info.name, &options, format, folder).map(drop).map_err(|e| e.to_string())
            }),
        },
        parts: Some(info.parts()),
        stands_for: None,
        same_object: false,
        noise: None,
    })
}

/// The number where depth noise is all there is, so that it can be an axis of a plot.
fn noise_label(noise: &str) -> String {
    match noise {
        "none" => "0".into(),
        _ => noise.strip_prefix("depth=").filter(|v| v.parse::<f64>().is_ok()).unwrap_or(noise).into(),
    }
}

/// The paper's object that a procedural one stands for.
fn row(info: &ObjectInfo) -> Option<&'static PaperObject> {
    let name = info.paper?.to_lowercase().replace(' ', "_");
    let id = match info.suite {
        "dta" => format!("dta_multi/{}", name.trim_end_matches("-m")),
        "multi" => format!("artgs_multi/{name}"),
        _ => format!("paris/{name}"),
    };
    paper::find(&id)
}

/// The cabinet of `artgs demo`.
fn cabinet(way: &Way, seed: u64) -> Result<Item, String> {
    let default = CabinetOptions::default();
    let (views, size) = (way.views.unwrap_or(default.views), way.size.unwrap_or(default.size));
    let mut options = CabinetOptions { views, size, seed, ..default };
    match way.noise.as_deref() {
        None | Some("none") => {}
        Some(noise) => {
            let sigma = noise.strip_prefix("depth=").and_then(|v| v.parse().ok());
            options.depth_noise = sigma.ok_or("the cabinet knows no degradation but depth=SIGMA")?;
        }
    }
    options.check().map_err(|e| e.to_string())?;
    let settings = serde_json::to_string(&options).map_err(|e| e.to_string())?;
    Ok(Item {
        name: format!("cabinet{}", way.suffix),
        source: Source::Procedural {
            settings: format!("cabinet {settings}"),
            write: Box::new(move |folder| write_cabinet(folder, &options).map(drop).map_err(|e| e.to_string())),
        },
        parts: Some(3),
        stands_for: None,
        same_object: false,
        noise: way.noise.as_deref().map(noise_label),
    })
}

/// Names of the variants: `full`, `paper`, `registration`, and either preset without one idea.
pub(crate) fn variant_names() -> Vec<String> {
    let mut names = vec!["full".to_string(), "paper".into(), "registration".into()];
    for (preset, prefix) in [("default", ""), ("paper", "paper-")] {
        let base = if preset == "paper" { artgs::config::Config::paper() } else { artgs::config::Config::default() };
        let sound = |name: &&str| *name != "full" && ablation::apply(name, base.clone()).is_ok();
        names.extend(ablation::variants().iter().map(|v| v.0).filter(sound).map(|name| format!("{prefix}{name}")));
    }
    names
}

/// A variant by name. `schedule` is the share of the published steps that the paper's runs make.
pub(crate) fn variant(name: &str, schedule: Option<f64>) -> Option<Variant> {
    if !variant_names().iter().any(|known| known == name) {
        return None;
    }
    let (preset, idea) = match name.strip_prefix("paper-") {
        Some(idea) => ("paper", idea),
        None if name == "paper" || name == "registration" => (name, "full"),
        None => ("default", name),
    };
    let description = match (preset, idea) {
        ("default", "full") => "default settings",
        ("paper", "full") => "the published method",
        ("registration", _) => "clusters of moved points registered, no Gaussians",
        _ => ablation::variants().iter().find(|v| v.0 == idea)?.1,
    };
    let mut variant = Variant::preset(name, preset, description);
    if idea != "full" {
        variant.arguments.extend(["--variant".to_string(), idea.into()]);
        variant.needs_parts |= ablation::apply(idea, Config::default()).is_ok_and(|c| c.check_part_count().is_err());
    }
    if let Some(share) = schedule.filter(|_| preset == "paper") {
        variant.arguments.extend(["--schedule".to_string(), share.to_string()]);
        variant.description = format!("{description}, {share} of the published steps");
    }
    Some(variant)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_understood() {
        for name in artgs_synth::SUITES.iter().chain(&["cabinet", "laptop"]) {
            assert!(!suite(name, &Photos::default()).unwrap().unwrap().is_empty(), "{name}");
        }
        for name in variant_names() {
            assert_eq!(variant(&name, None).unwrap().name, name);
        }
        let finding = |name: &str| !variant(name, None).unwrap().needs_parts;
        assert!(finding("full") && !finding("learnt-parts") && !finding("paper") && !finding("registration"));
        assert!(suite("zoo", &Photos::default()).is_none() && variant("zoo", None).is_none());
        assert!(variant("paper-learnt-parts", None).is_none(), "the published method always learns its parts");
        let recorded = suite("laptop.room", &Photos::default()).unwrap().unwrap();
        assert_eq!((recorded.len(), recorded[0].name.as_str()), (1, "laptop.room"));
        let tiny = Photos { size: vec![1], ..Photos::default() };
        assert!(suite("cabinet", &tiny).unwrap().unwrap_err().contains("`size`"));
    }

    #[test]
    fn stand_ins_find_their_rows() {
        let items = suite("paper", &Photos::default()).unwrap().unwrap();
        assert_eq!(items.len(), 17);
        assert!(items.iter().all(|i| i.stands_for.is_some() && !i.same_object));
        let rows: std::collections::BTreeSet<&str> = items.iter().filter_map(|i| i.stands_for).map(|o| o.id).collect();
        assert_eq!(rows.len(), 17, "{rows:?}");
    }

    #[test]
    fn lists_make_every_combination_with_names_of_its_own() {
        let noise = vec!["none".to_string(), "depth=0.002".into(), "pose=0.1,0.002+gloss=0.1".into()];
        let photos = Photos { views: vec![16, 32], noise, ..Photos::default() };
        let items = suite("fridge", &photos).unwrap().unwrap();
        let names: Vec<&str> = items.iter().map(|i| i.name.as_str()).collect();
        assert_eq!(names.len(), 6);
        assert_eq!((names[0], names[1]), ("fridge.16_views.none", "fridge.16_views.depth_0.002"));
        let labels: Vec<&str> = items.iter().filter_map(|i| i.noise.as_deref()).take(3).collect();
        assert_eq!(labels, ["0", "0.002", "pose=0.1,0.002+gloss=0.1"]);
        let wrong = Photos { noise: vec!["fog=1".into()], ..Photos::default() };
        assert!(suite("fridge", &wrong).unwrap().unwrap_err().contains("fog"));
    }

    #[test]
    fn only_the_papers_runs_are_shortened() {
        assert!(variant("full", Some(0.1)).unwrap().arguments.is_empty());
        let arguments = variant("paper-mlp", Some(0.1)).unwrap().arguments;
        assert_eq!(arguments, ["--variant", "mlp", "--schedule", "0.1"]);
    }
}
