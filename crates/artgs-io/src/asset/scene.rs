//! Scenes that show an asset at its best: a floor, light, sky and a camera before its front. [`super::mjcf`], [`super::sdf`] and
//! [`super::usd`] each write one beside the asset, so that a simulator shows something with one command.

use super::xml::{row, triple};
use artgs_core::Asset;
use glam::DVec3;

/// Stem of the files, such as `scene.xml`. An object of this name has no scene.
pub const SCENE: &str = "scene";

/// True if the path is a scene, and no asset.
pub fn is_scene(path: &std::path::Path) -> bool {
    path.file_stem().is_some_and(|stem| stem == SCENE)
}

/// Vertical field of view of the camera, degrees.
pub(super) const FIELD_OF_VIEW: f64 = 40.0;

/// Direction in which the light of the sun travels.
pub(super) const SUNLIGHT: DVec3 = DVec3::new(0.4, 0.8, -1.2);

/// A camera before the front of an asset, which is along -Y, a little above it and to its left, object's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrontCamera {
    /// Its place, metres.
    pub(super) eye: DVec3,
    /// What it looks at, metres.
    pub(super) target: DVec3,
    /// Half the side of the floor, metres.
    pub(super) floor: f64,
}

impl FrontCamera {
    /// Far enough to show everything that the parts reach: at their limits, each joint by itself.
    pub(super) fn of(asset: &Asset) -> Self {
        /// Direction from the object to the camera.
        const FROM: DVec3 = DVec3::new(-0.45, -1.0, 0.4);
        /// Free border around what is shown.
        const BORDER: f64 = 1.1;
        let [lower, upper] = reach(asset);
        let (target, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
        let slope = (0.5 * FIELD_OF_VIEW).to_radians().tan();
        let looking = Self { eye: target + FROM, target, floor: 0.0 };
        let [right, up, back] = looking.axes();
        // A corner is in view from this far.
        let needed = |corner: DVec3| corner.dot(right).abs().max(corner.dot(up).abs()) / slope + corner.dot(back);
        let distance = (0..8).map(|c| needed(half * corner_signs(c))).fold(1e-3, f64::max);
        Self { eye: target + BORDER * distance * back, floor: 10.0 * half.length().max(1e-3), ..looking }
    }

    /// Axes of the camera: to the right, upwards and backwards.
    pub(super) fn axes(&self) -> [DVec3; 3] {
        axes_against(self.eye - self.target)
    }
}

/// Axes of what looks or shines against a direction: to the right, upwards and backwards.
pub(super) fn axes_against(direction: DVec3) -> [DVec3; 3] {
    let back = direction.normalize();
    let right = DVec3::Z.cross(back).normalize();
    [right, back.cross(right), back]
}

/// Corner of a cube with sides of 2, 0 to 7.
fn corner_signs(corner: usize) -> DVec3 {
    let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
    DVec3::new(sign(0), sign(1), sign(2))
}

/// Box around the visual meshes at the zero pose, and with each joint at its limits; a point without meshes.
fn reach(asset: &Asset) -> [DVec3; 2] {
    let ends = asset.movable().flat_map(|(link, _, joint)| {
        joint.limits.map(|value| {
            let mut values = vec![0.0; asset.links.len()];
            values[link] = value;
            values
        })
    });
    let boxes = std::iter::once(Vec::new()).chain(ends).filter_map(|values| asset.bounds(&values));
    boxes.reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]).unwrap_or([DVec3::ZERO; 2])
}

/// MJCF that includes `NAME.xml`; `keys` are further keyframes.
pub(super) fn mjcf(asset: &Asset, keys: &str) -> String {
    let camera = FrontCamera::of(asset);
    let [right, up, _] = camera.axes();
    let (name, eye, axes) = (&asset.name, triple(camera.eye), row(&[right.to_array(), up.to_array()].concat()));
    let (center, extent) = (triple(camera.target), camera.floor / 10.0);
    let (sun, floor) = (triple(SUNLIGHT), camera.floor);
    let above = triple(camera.target - 4.0 * extent * SUNLIGHT);
    format!(
        "<mujoco model=\"{name} scene\">
  <include file=\"{name}.xml\"/>
  <statistic center=\"{center}\" extent=\"{extent}\"/>
  <visual>
    <headlight ambient=\"0.4 0.4 0.4\" diffuse=\"0.4 0.4 0.4\" specular=\"0 0 0\"/>
    <global azimuth=\"65\" elevation=\"-20\" fovy=\"{FIELD_OF_VIEW}\" offwidth=\"1280\" offheight=\"960\"/>
    <quality shadowsize=\"4096\"/>
    <map shadowclip=\"2\"/>
  </visual>
  <asset>
    <texture name=\"sky\" type=\"skybox\" builtin=\"gradient\" rgb1=\"0.75 0.84 0.94\" rgb2=\"0.96 0.97 0.98\" width=\"256\" height=\"1536\"/>
    <texture name=\"tiles\" type=\"2d\" builtin=\"checker\" rgb1=\"0.82 0.82 0.8\" rgb2=\"0.86 0.86 0.84\" width=\"300\" height=\"300\"/>
    <material name=\"floor\" texture=\"tiles\" texuniform=\"true\" texrepeat=\"2 2\"/>
  </asset>
  <worldbody>
    <light name=\"sun\" type=\"directional\" pos=\"{above}\" dir=\"{sun}\" diffuse=\"0.5 0.5 0.5\" specular=\"0 0 0\"/>
    <geom name=\"floor\" type=\"plane\" size=\"{floor} {floor} 0.05\" material=\"floor\"/>
    <camera name=\"front\" pos=\"{eye}\" xyaxes=\"{axes}\" fovy=\"{FIELD_OF_VIEW}\"/>
  </worldbody>
{keys}</mujoco>
"
    )
}

/// A world of SDFormat around a model: `model` is its element.
pub(super) fn sdf(asset: &Asset, model: &str) -> String {
    let camera = FrontCamera::of(asset);
    let ahead = (camera.target - camera.eye).normalize();
    let (pitch, yaw) = ((-ahead.z).asin(), ahead.y.atan2(ahead.x));
    let (eye, sun, side) = (triple(camera.eye), triple(SUNLIGHT), 2.0 * camera.floor);
    let floor = format!("<geometry><plane><normal>0 0 1</normal><size>{side} {side}</size></plane></geometry>");
    format!(
        "<?xml version=\"1.0\"?>\n<sdf version=\"1.10\">\n  <world name=\"{SCENE}\">
    <scene><ambient>0.5 0.5 0.5 1</ambient><background>0.85 0.9 0.95 1</background></scene>
    <gui><camera name=\"front\"><pose>{eye} 0 {pitch} {yaw}</pose></camera></gui>
    <light name=\"sun\" type=\"directional\"><direction>{sun}</direction><diffuse>0.8 0.8 0.8 1</diffuse><cast_shadows>true</cast_shadows></light>
    <model name=\"scene_floor\">
      <static>true</static>
      <link name=\"floor\">
        <collision name=\"collision\">{floor}</collision>
        <visual name=\"visual\">{floor}<material><ambient>0.8 0.8 0.8 1</ambient><diffuse>0.8 0.8 0.8 1</diffuse></material></visual>
      </link>
    </model>
{model}  </world>\n</sdf>\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;

    #[test]
    fn the_camera_shows_all_that_the_parts_reach() {
        let asset = cabinet();
        let camera = FrontCamera::of(&asset);
        let [right, up, back] = camera.axes();
        assert!(right.cross(up).distance(back) < 1e-12 && up.z > 0.0 && camera.eye.y < camera.target.y);
        let slope = (0.5 * FIELD_OF_VIEW).to_radians().tan();
        let [lower, upper] = reach(&asset);
        for corner in 0..8 {
            let seen = camera.target + 0.5 * (upper - lower) * corner_signs(corner) - camera.eye;
            let depth = -seen.dot(back);
            assert!(depth > 0.0 && seen.dot(right).abs() < slope * depth && seen.dot(up).abs() < slope * depth);
        }
        // The drawer comes out to the front.
        assert!(lower.y < -0.3, "{lower}");
        assert_eq!(reach(&Asset::default()), [DVec3::ZERO; 2]);
    }
}
