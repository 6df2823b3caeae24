//! Metadata of the layer that is opened.

use super::labels::OBJECT;
use super::{ENGINES, GAUSSIANS, MESH, REPRESENTATION, engine_set, has_gaussians};
use crate::asset::Provenance;
use crate::asset::usd::layer::dictionary;
use artgs_core::Asset;
use glam::DVec3;
use openusd::sdf::Value;

/// The profile that the folder is written for.
pub(crate) const PROFILE: [&str; 2] = ["Robotics-Prop", "4.0.0"];

fn text(value: &str) -> Value {
    Value::String(value.into())
}

/// `customLayerData` of the layer. The four entries beside `SimReady_Metadata` are those that profiles before 3.3.0 ask for there.
pub(super) fn layer_data(asset: &Asset, provenance: &Provenance) -> Value {
    let origin = origin(asset, provenance);
    // Joints at 0.
    let extents = asset.bounds(&[]).map_or(DVec3::ZERO, |[low, high]| high - low);
    let measured = [
        ("rigid_body_count", Value::Int(i32::try_from(asset.links.len()).unwrap_or(i32::MAX))),
        ("asset_extents", Value::Vec3f(extents.as_vec3().to_array().into())),
        ("mass", Value::Double(asset.links.iter().map(|link| link.inertial.mass).sum())),
    ];
    let validation = [("profile", text(PROFILE[0])), ("profile_version", text(PROFILE[1]))];
    let nested = origin.iter().cloned().chain(measured).chain([
        ("Variants", variants(asset)),
        ("generator", text(concat!("artgs ", env!("CARGO_PKG_VERSION")))),
        ("validation", dictionary(validation)),
    ]);
    let nested = ("SimReady_Metadata", dictionary(nested));
    let outer = ["asset_name", "asset_type", "source_file", "usd_date_generated"];
    dictionary(origin.iter().filter(|(key, _)| outer.contains(key)).cloned().chain([nested]))
}

/// What the asset is and where it comes from.
fn origin(asset: &Asset, provenance: &Provenance) -> [(&'static str, Value); 8] {
    let or = |value: &Option<String>, otherwise: &str| text(value.as_deref().unwrap_or(otherwise));
    [
        ("asset_name", text(&asset.name)),
        ("asset_type", text("prop")),
        ("category", text("articulated object")),
        ("author", or(&provenance.author, "unknown")),
        ("asset_license", or(&provenance.license, "not stated")),
        ("source_file", or(&provenance.source, "unknown")),
        ("usd_date_generated", or(&provenance.date, "unknown")),
        ("qcode", or(&provenance.item, OBJECT)),
    ]
}

/// Which variant sets there are and what they change.
fn variants(asset: &Asset) -> Value {
    let prim = text(&format!("/{}", asset.name));
    let engine = |engine| {
        let (name, _) = engine_set(engine);
        let entries = [("prim", prim.clone()), ("variantSetName", text(name)), ("activateOption", text("Enabled"))];
        (name, dictionary(entries))
    };
    let physics = ("Physics", dictionary(ENGINES.map(engine)));
    if !has_gaussians(asset) {
        return dictionary([physics]);
    }
    let appearance = dictionary([
        ("prim", prim.clone()),
        ("variantSetName", text(REPRESENTATION)),
        ("category", text(REPRESENTATION)),
        ("default", text(MESH)),
        ("impactClass", text("visual-only")),
        ("options", Value::StringVec(vec![MESH.into(), GAUSSIANS.into()])),
    ]);
    dictionary([physics, (REPRESENTATION, dictionary([(REPRESENTATION, appearance)]))])
}
