//! The formats, their names, and recognition by content.

use super::pose::Axes;
use super::{
    colmap, files, folders, mcap, nerfstudio, polycam, record3d, rosbag, scanner_app, seven_scenes, stray, tum,
};
use crate::capture::is_capture;
use artgs_core::PerState;
use std::path::{Path, PathBuf};

/// A format of recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RecordingFormat {
    /// 3D Scanner App, "All Data".
    ScannerApp,
    /// TUM RGB-D.
    Tum,
    /// nerfstudio or instant-ngp, `transforms.json`.
    Nerfstudio,
    /// Record3D: a folder with EXR and JPG, or a `.r3d` file.
    Record3d,
    /// Polycam raw data.
    Polycam,
    /// Stray Scanner.
    Stray,
    /// COLMAP, text or binary.
    Colmap,
    /// 7-Scenes.
    SevenScenes,
    /// RealSense `.bag` (ROS 1).
    RealsenseBag,
    /// MCAP with ROS messages.
    Mcap,
    /// Folders of colour and depth images with poses in text files: ScanNet, Replica, RTAB-Map, Open3D, ARKitScenes.
    Folders,
}

impl RecordingFormat {
    /// All formats, in the order in which they are looked for.
    pub const ALL: [Self; 11] = [
        Self::ScannerApp,
        Self::Tum,
        Self::Record3d,
        Self::Polycam,
        Self::Stray,
        Self::SevenScenes,
        Self::Nerfstudio,
        Self::Colmap,
        Self::RealsenseBag,
        Self::Mcap,
        Self::Folders,
    ];

    /// Name, for example on a command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::ScannerApp => "scanner-app",
            Self::Tum => "tum",
            Self::Nerfstudio => "nerfstudio",
            Self::Record3d => "record3d",
            Self::Polycam => "polycam",
            Self::Stray => "stray",
            Self::Colmap => "colmap",
            Self::SevenScenes => "7-scenes",
            Self::RealsenseBag => "realsense-bag",
            Self::Mcap => "mcap",
            Self::Folders => "folders",
        }
    }

    /// The format of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// The format of a file or folder by its content.
    pub fn detect(path: &Path) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.matches(path))
    }

    /// The format that the names of files promise: of recordings whose content is damaged, so that its reader says how.
    pub fn by_name(path: &Path) -> Option<Self> {
        let has = |name: &str| path.join(name).exists();
        match path.extension().map(|e| e.to_ascii_lowercase()).as_ref().and_then(|e| e.to_str()) {
            Some("r3d") if path.is_file() => Some(Self::Record3d),
            Some("bag") if path.is_file() => Some(Self::RealsenseBag),
            Some("mcap") if path.is_file() => Some(Self::Mcap),
            _ if has("transforms.json") => Some(Self::Nerfstudio),
            _ if has("rgb.txt") => Some(Self::Tum),
            _ if colmap::is_incomplete(path) => Some(Self::Colmap),
            _ if has("odometry.csv") => Some(Self::Stray),
            _ if has("keyframes") => Some(Self::Polycam),
            _ if has("metadata.json") && has("rgb") => Some(Self::Record3d),
            _ if has_name(path, "frame_", ".json") && has_name(path, "frame_", ".jpg") => Some(Self::ScannerApp),
            _ => None,
        }
    }

    /// The format of a recording of one state, also a damaged one; none for a capture, a folder of the recordings of both states, and
    /// anything else.
    pub fn of(path: &Path) -> Option<Self> {
        if Self::of_two_states(path).is_some() { None } else { Self::of_one(path) }
    }

    /// The same where the recording may be a folder with the recordings of both states: some formats are looked for one level down.
    fn of_one(path: &Path) -> Option<Self> {
        if is_capture(path) { None } else { Self::detect(path).or_else(|| Self::by_name(path)) }
    }

    /// The recordings of both states in the folders `start` and `end` of `folder`, as simulated recordings are written; none if
    /// one of them is not a recording, or if the folder is a capture.
    pub fn of_two_states(folder: &Path) -> Option<PerState<PathBuf>> {
        let paths = PerState::from_fn(|state| folder.join(state.name()));
        (!is_capture(folder) && paths.iter().all(|path| Self::of_one(path).is_some())).then_some(paths)
    }

    fn matches(self, path: &Path) -> bool {
        match self {
            Self::ScannerApp => scanner_app::matches(path),
            Self::Tum => tum::matches(path),
            Self::Nerfstudio => nerfstudio::matches(path),
            Self::Record3d => record3d::matches(path),
            Self::Polycam => polycam::matches(path),
            Self::Stray => stray::matches(path),
            Self::Colmap => colmap::matches(path),
            Self::SevenScenes => seven_scenes::matches(path),
            Self::RealsenseBag => rosbag::matches(path),
            Self::Mcap => mcap::matches(path),
            Self::Folders => folders::matches(path),
        }
    }

    /// Axes of the camera frame that its poses belong to.
    pub(super) fn axes(self) -> Axes {
        match self {
            Self::ScannerApp | Self::Record3d | Self::Polycam | Self::Nerfstudio => Axes::OpenGl,
            _ => Axes::OpenCv,
        }
    }

    /// Why its poses may be unknown or all the same, with the remedy.
    pub(super) fn pose_hint(self) -> &'static str {
        match self {
            Self::Record3d => {
                "the front camera of Record3D (TrueDepth, selfies) records no poses; record with the LiDAR camera at the back"
            }
            Self::ScannerApp | Self::Polycam | Self::Stray => {
                "the phone did not track its motion; record again in light, slowly, without covering a camera"
            }
            Self::Nerfstudio => "write the pose of every image to `transform_matrix` (camera-to-world)",
            Self::Colmap => "compute the model again, from photos of different places",
            _ => {
                "the program that computed them did not track the camera; write the pose of every image (camera-to-world), or \
                 give other poses by --poses"
            }
        }
    }

    /// Where its depth images are, for messages.
    pub(super) fn depth_names(self) -> &'static str {
        match self {
            Self::ScannerApp => "depth_00000.png",
            Self::Tum => "a list depth.txt with `timestamp file`",
            Self::Record3d => "depth/0.exr or 0.depth",
            Self::Polycam => "keyframes/depth/TIME.png",
            Self::Stray => "depth/000000.png or .npy",
            Self::Colmap => "depth/NAME.png, or .npy, with the name of the image",
            Self::SevenScenes => "frame-000000.depth.png or .pgm",
            Self::Nerfstudio => "the key `depth_file_path` in every frame",
            Self::RealsenseBag | Self::Mcap => "a topic of depth",
            Self::Folders => "a folder `depth` with the numbers of the images",
        }
    }

    /// What the format is recognised by.
    fn mark(self) -> &'static str {
        match self {
            Self::ScannerApp => "frame_00000.json",
            Self::Tum => "rgb.txt",
            Self::Nerfstudio => "transforms.json",
            Self::Record3d => "metadata with poses, or a .r3d file",
            Self::Polycam => "keyframes/cameras",
            Self::Stray => "odometry.csv",
            Self::Colmap => "cameras and images, .txt or .bin",
            Self::SevenScenes => "frame-000000.pose.txt",
            Self::RealsenseBag => "a .bag file",
            Self::Mcap => "a .mcap file",
            Self::Folders => "folders color and depth, and poses: ScanNet, Replica, RTAB-Map, Open3D, ARKitScenes",
        }
    }

    /// Every format with its mark, for messages.
    pub(crate) fn known() -> String {
        Self::ALL.map(|f| format!("{} ({})", f.name(), f.mark())).join(", ")
    }
}

/// True if a file begins with these bytes.
pub(super) fn begins_with(path: &Path, magic: &[u8]) -> bool {
    use std::io::Read;
    let mut bytes = vec![0; magic.len()];
    path.is_file() && std::fs::File::open(path).and_then(|mut f| f.read_exact(&mut bytes)).is_ok() && bytes == magic
}

/// True if a name in the folder has this beginning and end.
pub(super) fn has_name(dir: &Path, prefix: &str, suffix: &str) -> bool {
    files::names(dir).iter().any(|n| files::between(n, prefix, suffix).is_some())
}
