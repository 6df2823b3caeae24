//! Semantic labels: items of Wikidata, and the classes of artgs.

use crate::asset::Provenance;
use crate::asset::usd::layer::Prim;
use artgs_core::{AssetLink, PartClass};
use openusd::sdf::Value;

/// Wikidata's item of what every part is: a physical object.
pub(super) const OBJECT: &str = "Q223557";

/// The item of a class. Classes without an item of the same meaning are physical objects.
const fn item(class: PartClass) -> &'static str {
    match class {
        PartClass::Door | PartClass::SlidingDoor | PartClass::Flap => "Q36794",
        _ => OBJECT,
    }
}

fn label(prim: Prim, taxonomy: &str, value: &str) -> Prim {
    prim.api(format!("SemanticsLabelsAPI:{taxonomy}")).attr(
        "token[]",
        &format!("semantics:labels:{taxonomy}"),
        Value::token_vec([value]),
    )
}

/// Labels the whole object.
pub(super) fn object(prim: Prim, provenance: &Provenance) -> Prim {
    label(prim, "wikidata_qcode", provenance.item.as_deref().unwrap_or(OBJECT))
}

/// Labels a link by its class.
pub(super) fn link(prim: Prim, link: &AssetLink) -> Prim {
    let Some(semantics) = link.semantics else { return prim };
    label(label(prim, "wikidata_qcode", item(semantics.class)), "class", semantics.class.name())
}

/// Labels a material. What it is made of is not known; rules ask for a label of every material.
pub(super) fn material(prim: Prim) -> Prim {
    label(prim, "material", "unknown")
}
