//! A page: a scene and the files it names. Only these files are served or written into an exported page.

use crate::camera::{CameraView, Placement};
use crate::obj;
use crate::scene::{self, Scene, SceneAlternative, SceneCloud, SceneJoint, SceneLink, SceneMesh, SceneSemantics};
use crate::urdf::{self, Link};
use crate::{Cloud, ViewError};
use artgs_core::{Alternative, Joint, JointKind};
use artgs_io::asset::Format;
use artgs_io::asset::spz::{read_spz, spz_bytes};
use artgs_io::export_report::ExportReport;
use artgs_io::run_folder::load_json;
use artgs_io::{Corrections, FileError, RunFolder};
use glam::DVec3;
use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Content of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// On disk, read on every request.
    Path(PathBuf),
    /// In memory.
    Bytes(Vec<u8>),
}

impl Source {
    /// The bytes.
    pub fn read(&self) -> Result<Vec<u8>, FileError> {
        match self {
            Self::Path(path) => std::fs::read(path).map_err(|source| FileError::Read { path: path.clone(), source }),
            Self::Bytes(bytes) => Ok(bytes.clone()),
        }
    }
}

/// A joint that was found before training, with what is known of it.
#[derive(Clone, Debug)]
pub struct FoundJoint {
    /// The joint to the part that carries it, capture's frame and unit.
    pub joint: Joint,
    /// That part; 0 is the static part.
    pub parent: usize,
    /// Joint confidence, 0 to 1; none if unknown.
    pub confidence: Option<f64>,
    /// Other joints that explain the part nearly as well.
    pub alternatives: Vec<Alternative>,
}

/// A scene and its files by name.
#[derive(Clone, Debug)]
pub struct Page {
    /// `scene.json`.
    pub scene: Scene,
    /// All files that `scene` names.
    pub files: BTreeMap<String, Source>,
    /// Corrections already applied to the shown replica, and the number of movable parts before them.
    pub corrected: Option<(Corrections, usize)>,
}
/// Colours of movable parts, distinguishable with colour vision deficiencies (after Okabe and Ito), repeated.
const COLOURS: [[u8; 3]; 7] =
    [[230, 159, 0], [86, 180, 233], [0, 158, 115], [204, 121, 167], [213, 94, 0], [240, 228, 66], [0, 114, 178]];

pub(crate) fn colour(link: usize) -> [u8; 3] {
    if link == 0 { [158, 163, 170] } else { COLOURS[(link - 1) % COLOURS.len()] }
}

impl Page {
    /// A scene without links; cameras and clouds can be added.
    pub fn empty(name: &str) -> Self {
        let scene = Scene {
            format: scene::FORMAT,
            version: scene::VERSION,
            name: name.into(),
            links: Vec::new(),
            cameras: Vec::new(),
            clouds: Vec::new(),
            scores: None,
            placement: None,
            corrections: false,
            live: false,
            returns: false,
            rerun: None,
            object_box: None,
        };
        Self { scene, files: BTreeMap::new(), corrected: None }
    }

    /// The page of a replica folder: `exports/urdf/*.urdf` with its meshes, `exports/splats/` and `metrics.json`. Refuses a
    /// folder without a valid `replica.json` or without these exports.
    pub fn of_replica(out: &Path) -> Result<Self, ViewError> {
        Self::of_run(&RunFolder::new(out))
    }

    /// The same of a folder whose exports may be elsewhere.
    pub fn of_run(run: &RunFolder) -> Result<Self, ViewError> {
        let out = run.root();
        let replica = artgs_io::read_replica(out)?;
        let folder = run.export(Format::Urdf);
        let missing = |missing| ViewError::NotExported { out: out.into(), missing };
        let path = first_urdf(&folder).ok_or_else(|| missing("exports/urdf/*.urdf"))?;
        let (name, links) = urdf::read(&path)?;
        let mut page = Self::empty(&name);
        let report = ExportReport::load(run)?.unwrap_or_default();
        for (i, link) in links.into_iter().enumerate() {
            let mut link = page.link(run, &folder, i, link)?;
            if let Some(mesh) = &mut link.mesh {
                // As the export calls it; none without its report.
                mesh.closed = report.links.iter().any(|l| l.watertight && l.name == link.name);
            }
            let name = report.part_of(&link.name).unwrap_or(&link.name);
            let part = replica.parts.iter().find(|part| part.name == name);
            link.semantics = report.links.iter().find(|l| l.name == link.name).and_then(SceneSemantics::of);
            if let Some(joint) = &mut link.joint {
                joint.confidence = part.and_then(|part| part.confidence);
                joint.axis_within = part.and_then(|part| part.interval).map(|interval| interval.axis_deg);
                let others = part.map_or(&[][..], |part| part.alternatives.as_slice());
                joint.alternatives = others.iter().map(SceneAlternative::from).collect();
            }
            page.scene.links.push(link);
        }
        // Replicas of a baseline have no Gaussians to export.
        if run.has_splats() && page.scene.links.iter().all(|l| l.splats.is_none()) {
            return Err(missing("exports/splats/*.spz"));
        }
        page.scene.scores = load_json(&run.metrics())?;
        Ok(page)
    }

    /// The page of discovered parts before training: a base, and a link for every joint with its confidence. Joints are in the
    /// capture's frame and unit, as in a replica.
    pub fn of_joints(name: &str, joints: &[FoundJoint], placement: Placement) -> Self {
        let mut page = Self::empty(name);
        page.place(placement);
        let link = |index: usize, parent, origin: DVec3, joint| SceneLink {
            name: if index == 0 { "base".into() } else { format!("part_{index}") },
            parent,
            origin: origin.to_array(),
            joint,
            mesh: None,
            collision: Vec::new(),
            splats: None,
            semantics: None,
            colour: colour(index),
        };
        page.scene.links.push(link(0, None, DVec3::ZERO, None));
        for (k, FoundJoint { joint, parent, confidence, alternatives }) in joints.iter().enumerate() {
            let length = if joint.kind == JointKind::Prismatic { placement.scale } else { 1.0 };
            let scene_joint = SceneJoint {
                kind: joint.kind,
                axis: (placement.rotation * joint.axis).to_array(),
                pitch: placement.scale * joint.pitch,
                limits: joint.limits.map(|v| length * v),
                observed: joint.state_values.map(|v| length * v),
                effort: 0.0,
                confidence: *confidence,
                axis_within: None,
                alternatives: alternatives.iter().map(SceneAlternative::from).collect(),
            };
            let origin = placement.apply(joint.origin);
            page.scene.links.push(link(k + 1, Some(*parent), origin, Some(scene_joint)));
        }
        page
    }

    /// Reads every file into memory, so that the page needs none of them any more.
    pub fn load_files(&mut self) -> Result<(), ViewError> {
        for source in self.files.values_mut() {
            *source = Source::Bytes(source.read()?);
        }
        Ok(())
    }

    /// Sets the transform from the capture's frame to the object's; without it corrections cannot contain positions.
    pub fn place(&mut self, placement: Placement) {
        self.scene.placement = Some(placement);
    }

    /// Adds cameras of the capture; `placement` maps its frame to the object's.
    pub fn add_cameras(&mut self, cameras: &[CameraView], placement: Placement) -> Result<(), ViewError> {
        self.scene.placement = Some(placement);
        for view in cameras {
            let mut placed = view.placed(&placement);
            let at = format!("cameras/{}", self.scene.cameras.len());
            placed.photo = self.add_picture(&format!("{at}_photo"), view.photo.as_deref())?;
            placed.rendering = self.add_picture(&format!("{at}_rendering"), view.rendering.as_deref())?;
            placed.mask = self.add_picture(&format!("{at}_mask"), view.mask.as_deref())?;
            self.scene.cameras.push(placed);
        }
        Ok(())
    }

    /// The page as it is given to others: without scores and, unless `photos` are asked for, without the cameras of the capture, their photos
    /// and masks.
    pub fn shared(mut self, photos: bool) -> Self {
        self.scene.scores = None;
        if !photos {
            for camera in std::mem::take(&mut self.scene.cameras) {
                for file in [camera.photo, camera.rendering, camera.mask].into_iter().flatten() {
                    self.files.remove(&file);
                }
            }
        }
        self
    }

    /// Adds the points of an observed state; `placement` maps the capture's frame to the object's.
    pub fn add_cloud(&mut self, cloud: &Cloud, placement: Placement) {
        self.scene.placement = Some(placement);
        let file = format!("clouds/{}.points", self.scene.clouds.len());
        self.files.insert(file.clone(), Source::Bytes(cloud.bytes(&placement)));
        self.scene.clouds.push(SceneCloud { state: cloud.state.index(), count: cloud.points.len(), file });
    }

    /// The text of `scene.json`; numbers that are not finite are null.
    pub fn scene_json(&self) -> Result<String, ViewError> {
        serde_json::to_string(&self.scene).map_err(ViewError::Scene)
    }

    fn link(&mut self, run: &RunFolder, folder: &Path, index: usize, link: Link) -> Result<SceneLink, ViewError> {
        let mesh = match &link.visual {
            None => None,
            Some(file) => {
                let texture = texture_of(&folder.join(file))?;
                let texture = texture.map(|t| self.add(&t, &format!("mesh/{}.png", link.name)));
                let file = self.add_mesh(&folder.join(file), &format!("mesh/{}.obj", link.name))?;
                Some(SceneMesh { file, texture: texture.transpose()?, closed: false })
            }
        };
        let mut collision = Vec::new();
        for (k, file) in link.collision.iter().enumerate() {
            collision.push(self.add_mesh(&folder.join(file), &format!("hull/{}_{k}.obj", link.name))?);
        }
        let splats = self.add_splats(&run.export(Format::Splats), &link.name)?;
        let joint = link.joint.map(|j| SceneJoint {
            kind: j.kind,
            axis: j.axis.to_array(),
            pitch: j.pitch,
            limits: j.limits,
            observed: j.observed,
            effort: j.effort,
            confidence: None,
            axis_within: None,
            alternatives: Vec::new(),
        });
        let (name, parent, origin) = (link.name, link.parent, link.origin.to_array());
        let colour = colour(index);
        Ok(SceneLink { name, parent, origin, joint, mesh, collision, splats, semantics: None, colour })
    }

    fn add(&mut self, path: &Path, name: &str) -> Result<String, ViewError> {
        if !path.is_file() {
            let source = std::io::Error::from(std::io::ErrorKind::NotFound);
            return Err(FileError::Read { path: path.into(), source }.into());
        }
        self.files.insert(name.into(), Source::Path(path.into()));
        Ok(name.into())
    }

    /// The Gaussians of a link. The page adds them to the node of the link, so the SPZ that it gets is one in the link frame and of
    /// the version that it reads.
    fn add_splats(&mut self, folder: &Path, link: &str) -> Result<Option<String>, ViewError> {
        let [packed, plain] = ["spz", "ply"].map(|extension| folder.join(format!("{link}.{extension}")));
        if packed.is_file() {
            let bytes = read_spz(&packed)
                .and_then(|splats| spz_bytes(&splats).map_err(|reason| FileError::malformed(&packed, reason)))?;
            let name = format!("splats/{link}.spz");
            self.files.insert(name.clone(), Source::Bytes(bytes));
            return Ok(Some(name));
        }
        let there = plain.is_file();
        there.then(|| self.add(&plain, &format!("splats/{link}.ply"))).transpose()
    }

    fn add_mesh(&mut self, path: &Path, name: &str) -> Result<String, ViewError> {
        obj::check(path)?;
        self.add(path, name)
    }

    fn add_picture(&mut self, name: &str, path: Option<&Path>) -> Result<Option<String>, ViewError> {
        let Some(path) = path else { return Ok(None) };
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_ascii_lowercase();
        if !["png", "jpg", "jpeg"].contains(&extension.as_str()) {
            return Err(FileError::malformed(path, "a browser shows PNG and JPEG").into());
        }
        self.add(path, &format!("{name}.{extension}")).map(Some)
    }
}

/// First by name, so that the choice does not depend on the file system.
fn first_urdf(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?;
    let mut found: Vec<PathBuf> = entries
        .filter_map(|e| Some(e.ok()?.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "urdf") && p.is_file())
        .collect();
    found.sort();
    found.into_iter().next()
}

/// Texture of an OBJ according to its MTL in the same folder.
fn texture_of(obj: &Path) -> Result<Option<PathBuf>, FileError> {
    let material = obj.with_extension("mtl");
    if !material.is_file() {
        return Ok(None);
    }
    let text = Source::Path(material.clone()).read()?;
    let text = String::from_utf8_lossy(&text);
    let Some(name) = text.lines().find_map(|l| l.trim().strip_prefix("map_Kd ")) else { return Ok(None) };
    let inside = Path::new(name.trim()).components().all(|c| matches!(c, Component::Normal(_)));
    if !inside {
        return Err(FileError::malformed(&material, format!("texture {name:?} is not a path inside the folder")));
    }
    Ok(Some(obj.with_file_name(name.trim())))
}
