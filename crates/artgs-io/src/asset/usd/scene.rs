//! `scene.usda`: the asset on a floor, with light and a camera before its front.

use super::layer::{Layer, Prim, dictionary, float3, float3s, references};
use super::physics::float;
use super::{header, looks, physics};
use crate::asset::scene::{FIELD_OF_VIEW, FrontCamera, SUNLIGHT, axes_against};
use artgs_core::{Asset, Mesh};
use glam::{DMat3, DQuat, DVec3};
use openusd::sdf::Value;

/// The layer; it references `NAME.usdc`. What is around the asset has a scope of its own, so that no name is taken twice.
pub(super) fn scene(asset: &Asset) -> Layer {
    let camera = FrontCamera::of(asset);
    let object =
        Prim::new("Xform", asset.name.clone()).field("references", references(&[format!("./{}.usdc", asset.name)]));
    let around = [front(&camera), sun(), sky(), floor(camera.floor)];
    let surroundings = around.into_iter().fold(Prim::new("Scope", "surroundings"), Prim::child);
    let world = Prim::new("Xform", "World").child(object).child(surroundings).child(physics::scene());
    let shown = dictionary([("boundCamera", Value::String("/World/surroundings/front".into()))]);
    let data = ("customLayerData", dictionary([("cameraSettings", shown)]));
    Layer { fields: [header("World"), vec![data]].concat(), prims: vec![world] }
}

/// A turn whose axes are to the right, upwards and backwards.
fn turn([right, up, back]: [DVec3; 3]) -> DQuat {
    DQuat::from_mat3(&DMat3::from_cols(right, up, back))
}

fn front(camera: &FrontCamera) -> Prim {
    /// Tenths of a scene unit; only the ratio to the focal length counts.
    const APERTURE: f64 = 20.0;
    let focal = 0.5 * APERTURE / (0.5 * FIELD_OF_VIEW).to_radians().tan();
    Prim::new("Camera", "front")
        .placed(camera.eye, turn(camera.axes()))
        .attr("float", "focalLength", float(focal))
        .attr("float", "horizontalAperture", float(APERTURE * 4.0 / 3.0))
        .attr("float", "verticalAperture", float(APERTURE))
        .attr("float2", "clippingRange", Value::Vec2f([0.01, 1000.0].into()))
}

fn sun() -> Prim {
    Prim::new("DistantLight", "sun")
        .placed(DVec3::ZERO, turn(axes_against(-SUNLIGHT)))
        .attr("float", "inputs:intensity", float(1500.0))
        .attr("float", "inputs:angle", float(1.0))
}

fn sky() -> Prim {
    Prim::new("DomeLight", "sky").attr("color3f", "inputs:color", float3(DVec3::new(0.92, 0.95, 1.0))).attr(
        "float",
        "inputs:intensity",
        float(600.0),
    )
}

/// A square that bodies stand on; `half` is half of its side, metres.
fn floor(half: f64) -> Prim {
    let half = half as f32;
    let vertices = vec![[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]];
    let mesh = Mesh { vertices, colors: Vec::new(), triangles: vec![[0, 1, 2], [0, 2, 3]] };
    looks::mesh_prim("floor".into(), &mesh)
        .api("PhysicsCollisionAPI")
        .constant("normal3f[]", "normals", float3s(&[[0.0, 0.0, 1.0]]))
        .constant("color3f[]", "primvars:displayColor", float3s(&[[0.8, 0.8, 0.79]]))
}
