//! Names that `artgs bench` understands: suites of procedural objects, and variants of the method.

use artgs::synth::{CabinetOptions, write_cabinet};
use artgs_bench::{Item, Source, Variant};

/// Names of the suites.
pub(crate) const SUITES: &[&str] = &["cabinet"];
/// Names of the variants.
pub(crate) const VARIANTS: &[&str] = &["full", "paper"];

/// How the objects of a suite are photographed; what is absent is the suite's own choice.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Photos {
    pub(crate) views: Option<usize>,
    pub(crate) size: Option<u32>,
}

/// Objects of a suite; none if there is no such suite, an error if it cannot be photographed so.
pub(crate) fn suite(name: &str, photos: Photos) -> Option<Result<Vec<Item>, String>> {
    match name {
        "cabinet" => Some(cabinet(photos).map(|item| vec![item])),
        _ => None,
    }
}

/// The cabinet of `artgs demo`.
fn cabinet(photos: Photos) -> Result<Item, String> {
    let default = CabinetOptions::default();
    let options = CabinetOptions {
        views: photos.views.unwrap_or(default.views),
        size: photos.size.unwrap_or(default.size),
        ..default
    };
    options.check().map_err(|e| e.to_string())?;
    let settings = serde_json::to_string(&options).map_err(|e| e.to_string())?;
    Ok(Item {
        name: "cabinet".into(),
        source: Source::Procedural {
            settings: format!("cabinet {settings}"),
            write: Box::new(move |folder| write_cabinet(folder, &options).map(drop).map_err(|e| e.to_string())),
        },
        parts: Some(3),
        stands_for: None,
        same_object: false,
        noise: None,
    })
}

/// A variant by name: a preset, and settings that replace some of it.
pub(crate) fn variant(name: &str) -> Option<Variant> {
    match name {
        "full" => Some(Variant::preset("full", "default", "default settings")),
        "paper" => Some(Variant::preset("paper", "paper", "the published method")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_understood() {
        assert!(SUITES.iter().all(|name| suite(name, Photos::default()).unwrap().is_ok()));
        assert!(VARIANTS.iter().all(|name| variant(name).unwrap().name == *name));
        assert!(suite("zoo", Photos::default()).is_none() && variant("zoo").is_none());
        let tiny = Photos { size: Some(1), ..Photos::default() };
        assert!(suite("cabinet", tiny).unwrap().unwrap_err().contains("`size`"));
    }
}
