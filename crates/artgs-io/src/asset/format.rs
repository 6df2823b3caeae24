//! The formats that assets are exported to. A new format is a variant of [`Format`] and a module beside this one.

use super::provenance::Provenance;
use super::spz::SpzVersion;
use crate::run_folder::remove_folder;
use crate::{FileError, asset};
use artgs_core::Asset;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A file format of simulators, browsers or renderers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Robot description.
    Urdf,
    /// MuJoCo.
    Mjcf,
    /// OpenUSD with physics.
    Usd,
    /// OpenUSD in one file.
    Usdz,
    /// Binary glTF with a clip per joint.
    Glb,
    /// Gazebo.
    Sdf,
    /// Folder as of PartNet-Mobility.
    Partnet,
    /// Gaussians per link.
    Splats,
    /// Folder as of NVIDIA's SimReady props.
    Simready,
}

/// Actuators of an MJCF, one per joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Actuators {
    /// The control is a force or torque.
    Motor,
    /// The control is the value of the joint.
    Position,
}

impl Actuators {
    /// Every kind.
    pub const ALL: [Self; 2] = [Self::Motor, Self::Position];

    /// Name on the command line and element of the MJCF.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Motor => "motor",
            Self::Position => "position",
        }
    }
}

/// What some formats write only if asked to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WriteOptions {
    /// MJCF: actuators of the joints; none without.
    pub actuators: Option<Actuators>,
    /// MJCF: the base moves freely instead of being fixed to the world.
    pub free_base: bool,
    /// URDF: mesh paths begin with `package://` and this name; none for paths relative to the URDF.
    pub package: Option<String>,
    /// Frames without a body.
    pub frames: Frames,
    /// Version of the SPZ files.
    pub spz: SpzVersion,
    /// SimReady: where the asset comes from.
    pub provenance: Provenance,
}

/// Which frames without a body are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Frames {
    /// Grasp frames of handles and, in URDF, a root link `world` that the base is fixed to.
    #[default]
    All,
    /// None: some importers stop at a link without mass.
    None,
}

impl Frames {
    /// Every value.
    pub const ALL: [Self; 2] = [Self::All, Self::None];

    /// Name on the command line and in `export.json`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::None => "none",
        }
    }
}

impl Format {
    /// Every format, also those whose writer is not built in.
    pub const ALL: [Self; 9] = [
        Self::Urdf,
        Self::Mjcf,
        Self::Usd,
        Self::Usdz,
        Self::Glb,
        Self::Sdf,
        Self::Partnet,
        Self::Splats,
        Self::Simready,
    ];

    /// Name on the command line, and of the folder in `exports`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Urdf => "urdf",
            Self::Mjcf => "mjcf",
            Self::Usd => "usd",
            Self::Usdz => "usdz",
            Self::Glb => "glb",
            Self::Sdf => "sdf",
            Self::Partnet => "partnet",
            Self::Splats => "splats",
            Self::Simready => "simready",
        }
    }

    /// What it is and which programs read it.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Urdf => "Robot description: ROS, PyBullet, SAPIEN, Isaac, Drake, Genesis",
            Self::Mjcf => "MuJoCo",
            Self::Usd => "OpenUSD with physics, text and binary: Isaac Sim, Omniverse, Newton",
            Self::Usdz => "OpenUSD in one file: Quick Look",
            Self::Glb => "Binary glTF with a clip per joint: browsers, Blender",
            Self::Sdf => "Gazebo",
            Self::Partnet => "Folder as of PartNet-Mobility: SAPIEN, ManiSkill",
            Self::Splats => "Gaussians per link: PLY and SPZ",
            Self::Simready => "Folder as of NVIDIA's SimReady props: Isaac Sim, Isaac Lab, Newton",
        }
    }

    /// False if the writer is not built in: OpenUSD needs the feature `usd`.
    pub const fn is_available(self) -> bool {
        cfg!(feature = "usd") || !matches!(self, Self::Usd | Self::Usdz | Self::Simready)
    }

    /// False if a screw is written as a hinge, with its pitch where the format has a place for it.
    pub const fn has_screws(self) -> bool {
        matches!(self, Self::Mjcf | Self::Glb | Self::Sdf | Self::Splats)
    }

    /// False if an asset has nothing that the format could hold.
    pub fn can_hold(self, asset: &Asset) -> bool {
        self != Self::Splats || asset.links.iter().any(|link| link.splats.is_some())
    }

    /// Writes the files of the format into `dir` and returns their paths.
    pub fn write(self, dir: &Path, asset: &Asset, options: &WriteOptions) -> Result<Vec<PathBuf>, FileError> {
        let bodies;
        let asset = if options.frames == Frames::None && asset.links.iter().any(|link| !link.handles.is_empty()) {
            bodies = without_handles(asset);
            &bodies
        } else {
            asset
        };
        match self {
            Self::Urdf => asset::urdf::export_urdf_with(dir, asset, options),
            Self::Mjcf => asset::mjcf::export_mjcf_with(dir, asset, options),
            #[cfg(feature = "usd")]
            Self::Usd => asset::usd::export_usd(dir, asset),
            #[cfg(feature = "usd")]
            Self::Usdz => asset::usd::export_usdz(dir, asset),
            #[cfg(feature = "usd")]
            Self::Simready => asset::usd::simready::export_simready(dir, asset, &options.provenance),
            #[cfg(not(feature = "usd"))]
            Self::Usd | Self::Usdz | Self::Simready => {
                Err(FileError::malformed(dir, "OpenUSD is not built into this program (feature `usd`)"))
            }
            Self::Glb => asset::glb::export_glb(dir, asset),
            Self::Sdf => asset::export_sdf(dir, asset),
            Self::Partnet => asset::export_partnet(dir, asset),
            Self::Splats => asset::splats::export_splats(dir, asset, options.spz),
        }
    }

    /// Name of its folder in `exports` while that is written.
    pub(crate) fn unfinished_name(self) -> String {
        format!(".{}.new", self.name())
    }

    /// Replaces the folder of the format in `exports`. Files are written beside it first: if that fails, the earlier
    /// export stays as it is; else none of its files are left. A format that can hold nothing of the asset leaves no
    /// folder, because an empty one would look like an export that failed.
    pub fn replace(self, exports: &Path, asset: &Asset) -> Result<Vec<PathBuf>, FileError> {
        self.replace_with(exports, asset, &WriteOptions::default())
    }

    /// The same with options.
    pub fn replace_with(
        self,
        exports: &Path,
        asset: &Asset,
        options: &WriteOptions,
    ) -> Result<Vec<PathBuf>, FileError> {
        let (folder, new) = (exports.join(self.name()), exports.join(self.unfinished_name()));
        if !self.can_hold(asset) {
            remove_folder(&folder)?;
            return Ok(Vec::new());
        }
        let fail = |path: &Path| {
            let path = path.to_path_buf();
            move |source| FileError::Write { path, source }
        };
        remove_folder(&new)?;
        fs::create_dir_all(&new).map_err(fail(&new))?;
        let files = self.write(&new, asset, options).inspect_err(|_| {
            // The reason of the failure matters more than files that remain.
            let _ = fs::remove_dir_all(&new);
        })?;
        remove_folder(&folder)?;
        fs::rename(&new, &folder).map_err(fail(&folder))?;
        let moved = |file: PathBuf| file.strip_prefix(&new).map(|rest| folder.join(rest)).unwrap_or(file.clone());
        Ok(files.into_iter().map(moved).collect())
    }
}

fn without_handles(asset: &Asset) -> Asset {
    let mut out = asset.clone();
    out.links.iter_mut().for_each(|link| link.handles.clear());
    out
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// There is no format of this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no format `{0}`; the formats are {names}", names = Format::ALL.map(Format::name).join(", "))]
pub struct UnknownFormat(pub String);

impl FromStr for Format {
    type Err = UnknownFormat;

    fn from_str(text: &str) -> Result<Self, UnknownFormat> {
        Self::ALL.into_iter().find(|format| format.name() == text).ok_or_else(|| UnknownFormat(text.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::asset::testing::cabinet;

    #[test]
    fn names_are_read_back() {
        for format in Format::ALL {
            assert_eq!(format.to_string().parse(), Ok(format));
            assert!(UnknownFormat("x".into()).to_string().contains(format.name()));
        }
        assert_eq!("stl".parse::<Format>(), Err(UnknownFormat("stl".into())));
    }

    #[test]
    fn a_folder_is_replaced_as_a_whole_or_not_at_all() {
        let exports = tempfile::tempdir().unwrap();
        let mut asset = cabinet();
        let files = Format::Splats.replace(exports.path(), &asset).unwrap();
        assert!(files.iter().all(|file| file.starts_with(exports.path().join("splats")) && file.is_file()));
        let old = exports.path().join("splats/old.ply");
        fs::write(&old, "").unwrap();
        let good = asset.links[0].splats.clone();
        // A number of harmonics that no file can hold.
        asset.links[0].splats.as_mut().unwrap().sh.pop();
        assert!(Format::Splats.replace(exports.path(), &asset).is_err());
        assert!(old.is_file() && fs::read_dir(exports.path()).unwrap().count() == 1);
        asset.links[0].splats = good;
        Format::Splats.replace(exports.path(), &asset).unwrap();
        assert!(!old.exists());
        asset.links.iter_mut().for_each(|link| link.splats = None);
        assert_eq!(Format::Splats.replace(exports.path(), &asset).unwrap(), Vec::<PathBuf>::new());
        assert!(!exports.path().join("splats").exists());
    }
}
