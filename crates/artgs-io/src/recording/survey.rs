//! What a file or folder is that is neither a capture nor a recording: known layouts that are not read, with the way to one that is,
//! recordings below it or in an archive, and what of a recording is missing.

use super::files::names;
use super::{RecordingFormat, folders};
use std::path::{Path, PathBuf};

/// Files that hold recordings which are not read: suffix, name and remedy.
const FILES: [(&str, &str, &str); 22] = [
    (
        "db3",
        "a ROS 2 bag in SQLite",
        "convert it to MCAP, with `ros2 bag convert -i BAG -o OUT.yaml`, OUT.yaml stating \
      `output_bags: [{uri: scan, storage_id: mcap, all: true}]`, or without ROS by `pip install rosbags` and \
      `rosbags-convert --src BAG --dst OUT --dst-storage mcap`, and give the .mcap file with --poses",
    ),
    (
        "sens",
        "a ScanNet .sens file",
        "export it with ScanNet's SensReader (reader.py --export_color_images --export_depth_images \
      --export_poses --export_intrinsics) and give the folder with color, depth, pose and intrinsic",
    ),
    (
        "klg",
        "an ElasticFusion log",
        "export its frames as 16-bit PNG and colour images with poses in the layout of TUM",
    ),
    ("oni", "an OpenNI recording", "export its frames as 16-bit PNG and colour images with poses in the layout of TUM"),
    ("svo", "a ZED recording", "export its frames and poses with the ZED SDK in the layout of TUM"),
    ("svo2", "a ZED recording", "export its frames and poses with the ZED SDK in the layout of TUM"),
    (
        "mkv",
        "a video container such as Azure Kinect's",
        "extract colour and depth with Open3D's azure_kinect_mkv_reader, and compute poses with its \
      reconstruction system",
    ),
    (
        "db",
        "an SQLite file such as RTAB-Map's database",
        "export it with `rtabmap-export --images --poses_camera --poses_format 11 FILE.db` and give the folder",
    ),
    ("vrs", "a Project Aria recording", "export depth and poses with projectaria_tools in the layout of TUM"),
    ("slam", "a slambook recording", "export its frames as images with poses in the layout of TUM"),
    ("h5", "an HDF5 file", "write its images and poses in the layout of nerfstudio or TUM"),
    ("hdf5", "an HDF5 file", "write its images and poses in the layout of nerfstudio or TUM"),
    ("npz", "a NumPy archive", "write its images and poses in the layout of nerfstudio or TUM"),
    ("usdz", "a finished 3D model", RAW),
    ("glb", "a finished 3D model", RAW),
    ("obj", "a finished 3D model", RAW),
    ("fbx", "a finished 3D model", RAW),
    ("e57", "a point cloud", RAW),
    ("las", "a point cloud", RAW),
    ("ply", "a point cloud, mesh or splats", RAW),
    ("mp4", "a video", VIDEO),
    ("mov", "a video", VIDEO),
];

const RAW: &str = "images with depth and poses are needed: export the raw data of the scan";
const VIDEO: &str = "a video has neither depth nor poses; record with an app that exports depth images and poses (Record3D: EXR + JPG or .r3d)";

/// Folders of known layouts that are not read: names that must all exist, name and remedy.
const FOLDERS: [(&[&str], &str, &str); 6] = [
    (
        &["dslr", "iphone"],
        "a scene of ScanNet++",
        "export the frames of `iphone` with poses in the layout of nerfstudio or TUM",
    ),
    (
        &["extrinsics", "depth", "image"],
        "a sequence of SUN3D",
        "convert it to the layout of TUM: its depth is stored with shifted bits",
    ),
    (
        &["undistorted_depth_images", "undistorted_color_images"],
        "a house of Matterport3D",
        "write its frames in the layout of nerfstudio",
    ),
    (&["nerfcapture"], "a session of NeRFCapture", "give the folder that contains transforms.json"),
    (&["mav0"], "a sequence of EuRoC", "depth images are needed, which it has not"),
    (&["velodyne"], "a sequence of KITTI", "depth images of an object are needed"),
];

/// Marks of recordings in the names of an archive.
const MARKS: [(&str, RecordingFormat); 8] = [
    ("keyframes/cameras/", RecordingFormat::Polycam),
    ("keyframes/corrected_cameras/", RecordingFormat::Polycam),
    ("transforms.json", RecordingFormat::Nerfstudio),
    ("odometry.csv", RecordingFormat::Stray),
    ("rgb.txt", RecordingFormat::Tum),
    ("frame_00000.json", RecordingFormat::ScannerApp),
    ("frame-000000.pose.txt", RecordingFormat::SevenScenes),
    ("cameras.bin", RecordingFormat::Colmap),
];

/// What a file or folder is, with a remedy, in a sentence without its name; none if nothing is known.
pub(crate) fn identify(path: &Path) -> Option<String> {
    let listed = if path.is_dir() {
        names(path)
    } else {
        path.file_name().and_then(|n| n.to_str()).map(String::from).into_iter().collect()
    };
    if path.is_dir() && listed.iter().all(|name| name.starts_with('.')) {
        return Some("the folder is empty; give the folder that the files were exported to".into());
    }
    if let Some(below) = below(path) {
        return Some(below);
    }
    let folder = FOLDERS.iter().find(|(all, _, _)| all.iter().all(|n| listed.iter().any(|l| l == n)));
    if let Some((_, what, remedy)) = folder {
        return Some(format!("{what}, which is not read; {remedy}"));
    }
    if let Some(text) = posed_folders(path) {
        return Some(text);
    }
    archive(path, &listed).or_else(|| {
        let ends = |suffix: &str| listed.iter().find(|n| n.to_ascii_lowercase().ends_with(&format!(".{suffix}")));
        let (name, what, remedy) =
            FILES.iter().find_map(|(suffix, what, remedy)| Some((ends(suffix)?, what, remedy)))?;
        Some(if path.is_dir() { format!("contains {name}: {what}; {remedy}") } else { format!("{what}; {remedy}") })
    })
}

/// Recordings in the folders of a folder, and in those in them.
fn nested(path: &Path) -> Vec<(PathBuf, RecordingFormat)> {
    /// Folders that are looked into, so that a disk is not searched.
    const MOST: usize = 200;
    let inside = |dir: &Path| -> Vec<PathBuf> {
        let all = names(dir).into_iter().filter(|n| !n.starts_with('.')).map(|n| dir.join(n));
        all.filter(|p| p.is_dir() || is_container(p)).take(MOST).collect()
    };
    let found = |paths: &[PathBuf]| -> Vec<(PathBuf, RecordingFormat)> {
        paths.iter().filter_map(|p| Some((p.clone(), RecordingFormat::of(p)?))).collect()
    };
    let first = if path.is_dir() { inside(path) } else { Vec::new() };
    let here = found(&first);
    if !here.is_empty() {
        return here;
    }
    let second: Vec<PathBuf> = first.iter().filter(|p| p.is_dir()).flat_map(|p| inside(p)).take(MOST).collect();
    found(&second)
}

fn is_container(path: &Path) -> bool {
    let suffix = path.extension().and_then(|e| e.to_str()).unwrap_or("");
    ["r3d", "bag", "mcap"].contains(&suffix)
}

fn below(path: &Path) -> Option<String> {
    let inside = if path.is_dir() { names(path) } else { Vec::new() };
    if let Some(capture) = inside.into_iter().map(|name| path.join(name)).find(|p| crate::capture::is_capture(p)) {
        return Some(format!("contains the capture {}; give this path instead", capture.display()));
    }
    let found = nested(path);
    let shown = |(path, format): &(PathBuf, RecordingFormat)| format!("{} ({})", path.display(), format.name());
    match &found[..] {
        [] => None,
        [only] => Some(format!("contains the recording {}; give this path instead", shown(only))),
        [a, b] => Some(format!(
            "contains the recordings {} and {}; give both of them, the closed state first: artgs reconstruct CLOSED OPEN -o OUT",
            shown(a),
            shown(b)
        )),
        all => {
            let first: Vec<String> = all.iter().take(4).map(shown).collect();
            Some(format!("contains {} recordings, first {}; give two of them", all.len(), first.join(", ")))
        }
    }
}

/// An archive, with what its names show.
fn archive(path: &Path, listed: &[String]) -> Option<String> {
    const SUFFIXES: [&str; 6] = [".zip", ".tar", ".tar.gz", ".tgz", ".7z", ".rar"];
    let name = listed.iter().find(|n| SUFFIXES.iter().any(|s| n.to_ascii_lowercase().ends_with(s)))?;
    let file = if path.is_dir() { path.join(name) } else { path.to_path_buf() };
    let inside = super::store::Store::Zip(file).names().unwrap_or_default();
    let mark = MARKS.iter().find(|(mark, _)| inside.iter().any(|n| n.contains(mark)));
    let what = match mark {
        Some((_, format)) => format!("with a recording of {}", format.name()),
        None if inside.is_empty() => "whose content is not known".into(),
        None => format!("with {} files, first {}", inside.len(), inside[0]),
    };
    let subject =
        if path.is_dir() { format!("contains the archive {name} {what}") } else { format!("an archive {what}") };
    Some(format!("{subject}; unpack it and give the folder"))
}

/// Folders of images that lack poses.
fn posed_folders(path: &Path) -> Option<String> {
    let contents = folders::contents(path).filter(|c| c.poses.is_none())?;
    let depth = contents.depth.map_or("no depth images".into(), |d| format!("depth images in {}", d.display()));
    Some(format!(
        "has colour images in {} and {depth}, but no poses; add `poses.txt` with `timestamp tx ty tz qx qy qz qw` for every image, or a folder \
         `pose` with a matrix for each, or state a file: --format folders --poses FILE",
        contents.color.display()
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(files: &[&str]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for file in files {
            let path = dir.path().join(file);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, b"{}").unwrap();
        }
        dir
    }

    #[test]
    fn layouts_are_named_with_a_remedy() {
        for (files, parts) in [
            (&["scan_0.db3", "metadata.yaml"][..], &["ROS 2 bag in SQLite", "ros2 bag convert"][..]),
            (&["scene0000_00.sens"], &["ScanNet", "SensReader"]),
            (&["iphone/rgb.mp4", "dslr/a.txt"], &["ScanNet++"]),
            (&["rgb/0001.png", "depth/0001.png", "cam_K.txt"], &["no poses", "--poses FILE"]),
            (&["scan.mp4"], &["a video", "EXR + JPG"]),
            (&["scan.glb"], &["finished 3D model", "raw data"]),
            (&["scan.7z"], &["archive scan.7z", "unpack"]),
            (&["a/rgb.txt", "a/groundtruth.txt"], &["contains the recording", "/a (tum)"]),
            (&["x/a/rgb.txt", "x/a/groundtruth.txt"], &["x/a (tum)"]),
            (&["a/transforms_train_start.json"], &["contains the capture", "/a;"]),
            (&["a/rgb.txt", "a/groundtruth.txt", "b/odometry.csv"], &["/a (tum) and", "/b (stray)", "reconstruct"]),
        ] {
            let dir = folder(files);
            let text = identify(dir.path()).unwrap_or_else(|| panic!("{files:?}"));
            assert!(parts.iter().all(|p| text.contains(p)), "{files:?}: {text}");
        }
        assert_eq!(identify(folder(&["notes.txt"]).path()), None);
    }

    #[test]
    fn archives_are_looked_into() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("scan.zip");
        let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).unwrap());
        zip.start_file("scan/keyframes/cameras/1.json", zip::write::SimpleFileOptions::default()).unwrap();
        zip.finish().unwrap();
        for place in [path.as_path(), dir.path()] {
            let text = identify(place).unwrap();
            assert!(text.contains("polycam") && text.contains("unpack"), "{text}");
        }
    }
}
