//! The folder of SimReady: the stage that is opened, the layers of engines, and the rules of its profile that need no other
//! program.

use super::usd::{self, get, has, is};
use crate::model::Model;
use crate::report::{FormatFinding, RuleFinding, Verdict};
use artgs_core::JointKind;
use openusd::sdf::{self, Value};
use openusd::tf::Token;
use openusd::usd::{Prim, Stage};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Engines: name of the variant set, stem of its layer, beginning of its schemas, rule of its metadata.
const ENGINES: [(&str, &str, &str, &str); 3] = [
    ("PhysX", "physx", "Physx", "RV.003"),
    ("Newton", "newton", "Newton", "RV.006"),
    ("MuJoCo", "mujoco", "Mjc", "RV.009"),
];

/// The files of `simready` that are opened: `NAME/simready_usd/NAME.usda`.
pub(super) fn files(dir: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut out: Vec<PathBuf> = entries.flat_map(|asset| super::files(&asset.join("simready_usd"), "usda")).collect();
    out.sort();
    out
}

/// Reads the stage with all engines disabled, adds what Newton's layer says about its joints, and applies the rules.
pub(super) fn read(path: &Path, finding: &mut FormatFinding) -> Result<Option<Model>, String> {
    let stage = usd::open(path)?;
    let prims = usd::prims(&stage)?;
    let asset = super::folder(path);
    // The paths of textures are those from the layer of meshes.
    let mut model = usd::model(&asset.join("visuals/mesh.usdc"), &stage, &prims, finding)?;
    let name = stage.default_prim().map(|name| name.to_string()).ok_or("there is no default prim")?;
    let splats = asset.join("visuals/splats.usdc");
    if splats.is_file() {
        usd::gaussians(&usd::prims(&usd::open(&splats)?)?, finding)?;
    }
    for (engine, stem, ..) in ENGINES {
        let layer =
            usd::open(&asset.join(format!("runnables/physics/{stem}.usda"))).map_err(|e| format!("{engine}: {e}"))?;
        resistances(&layer, engine, &name, &mut model)?;
    }
    let data = stage.stage_metadata("customLayerData").map_err(|e| format!("{e:#}"))?;
    let metadata = entry(data.as_ref(), &["SimReady_Metadata"]).cloned();
    let subject = Subject { path, asset, stage: &stage, prims: &prims, name: &name, metadata: metadata.as_ref() };
    finding.rules = subject.rules();
    let failed = finding.rules.iter().filter(|rule| rule.verdict == Verdict::Failed);
    let said: Vec<String> = failed.map(|rule| format!("{}: {}", rule.id, rule.note)).collect();
    finding.problems.extend(said);
    Ok(Some(model))
}

/// Speed and friction of the joints in the layer of an engine, which must be the same in all.
fn resistances(layer: &Stage, engine: &str, name: &str, model: &mut Model) -> Result<(), String> {
    for motion in model.links.iter_mut().filter_map(|link| link.motion.as_mut()) {
        let joint = layer.prim(sdf::path(format!("/{name}/Joints/{}", motion.name)).map_err(|e| format!("{e:#}"))?);
        let (unit, word) = match motion.kind {
            JointKind::Prismatic => (1.0, "linear"),
            JointKind::Revolute | JointKind::Screw => (1f64.to_radians(), "angular"),
        };
        let number = |name: &str| get::<f32>(&joint, name).map(|v| v.map(f64::from));
        let axis = |what: &str| format!("physxJointAxis:{word}:{what}");
        let (friction, velocity) = match engine {
            "PhysX" => (number(&axis("staticFrictionEffort"))?, number(&axis("maxJointVelocity"))?),
            "Newton" => (number("newton:friction")?, number("newton:velocityLimit")?),
            _ => (get::<f64>(&joint, "mjc:frictionloss")?, None),
        };
        let friction = friction.ok_or_else(|| format!("{engine} has no friction of {}", motion.name))?;
        let velocity = velocity.map(|v| v * unit);
        let differs = |a: Option<f64>, b: f64| a.is_some_and(|a| (a - b).abs() > 1e-5 * a.abs().max(b.abs()));
        if differs(motion.friction, friction) || velocity.is_some_and(|v| differs(motion.velocity, v)) {
            return Err(format!(
                "{engine} has another friction or speed of {} than the engines before it",
                motion.name
            ));
        }
        motion.friction = motion.friction.or(Some(friction));
        motion.velocity = motion.velocity.or(velocity);
    }
    Ok(())
}

/// An entry of nested dictionaries.
fn entry<'a>(data: Option<&'a Value>, keys: &[&str]) -> Option<&'a Value> {
    keys.iter().try_fold(data?, |value, key| match value {
        Value::Dictionary(map) => map.get(*key),
        _ => None,
    })
}

/// What the rules look at.
struct Subject<'a> {
    path: &'a Path,
    /// The folder that it is in.
    asset: &'a Path,
    stage: &'a Stage,
    prims: &'a [Prim],
    name: &'a str,
    metadata: Option<&'a Value>,
}

/// A rule that counts what breaks it; none may.
fn counted(id: &str, checked: &str, bad: &[String], remedy: &str) -> RuleFinding {
    RuleFinding {
        id: id.into(),
        checked: checked.into(),
        verdict: if bad.is_empty() { Verdict::Passed } else { Verdict::Failed },
        measured: Some(bad.len() as f64),
        limit: Some(0.0),
        note: bad.iter().take(3).cloned().collect::<Vec<_>>().join("; "),
        remedy: remedy.into(),
        ..RuleFinding::default()
    }
}

impl Subject<'_> {
    fn rules(&self) -> Vec<RuleFinding> {
        let mut out = vec![
            self.layout(),
            self.thumbnail(),
            self.metadata(),
            self.roots(),
            self.labels(),
            self.materials(),
            self.contacts(),
            self.grasps(),
            self.front(),
        ];
        out.extend(ENGINES.iter().map(|engine| self.engine(engine)));
        out.push(self.neutral());
        out.push(self.representations());
        for rule in &mut out {
            rule.subject = self.name.into();
        }
        out
    }

    fn text(&self, key: &str) -> Option<&str> {
        match entry(self.metadata, &[key]) {
            Some(Value::String(text)) if !text.trim().is_empty() => Some(text),
            _ => None,
        }
    }

    fn layout(&self) -> RuleFinding {
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let root = super::folder(self.asset).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let beside = std::fs::read_dir(self.asset).into_iter().flatten().flatten();
        let is_stage = |path: &Path| path.extension().is_some_and(|e| e.to_string_lossy().starts_with("usd"));
        let stages = beside.filter(|entry| is_stage(&entry.path())).count();
        let mut bad = Vec::new();
        if !stem.contains(&root) {
            bad.push(format!("the file is called {stem} and its asset {root}"));
        }
        if stages != 1 {
            bad.push(format!("{stages} stages in the folder of the file, must be 1"));
        }
        counted("NP.005", "the file lies in a folder of the asset and is alone there", &bad, "export again")
    }

    fn thumbnail(&self) -> RuleFinding {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let file = self.asset.join(format!(".thumbs/256x256/{name}.png"));
        let bad = match image::image_dimensions(&file) {
            Ok((256, 256)) => Vec::new(),
            Ok((width, height)) => vec![format!("the picture has {width} x {height} pixels")],
            Err(_) => vec!["there is none".into()],
        };
        let rule = counted("SR.002", "there is a picture of 256 x 256 pixels", &bad, "export again");
        // No simulator needs it.
        let verdict = if bad.is_empty() { Verdict::Passed } else { Verdict::Warning };
        RuleFinding { verdict, ..rule }
    }

    fn metadata(&self) -> RuleFinding {
        let texts =
            ["author", "asset_name", "asset_type", "asset_license", "category", "source_file", "usd_date_generated"];
        let mut bad: Vec<String> =
            texts.iter().filter(|key| self.text(key).is_none()).map(|key| format!("no {key}")).collect();
        if self.text("qcode").is_none_or(|q| !artgs_io::asset::Provenance::is_item(q)) {
            bad.push("qcode is no item of Wikidata".into());
        }
        let bodies = self.prims.iter().filter(|p| has(p, "PhysicsRigidBodyAPI")).count();
        if entry(self.metadata, &["rigid_body_count"]) != i32::try_from(bodies).ok().map(Value::Int).as_ref() {
            bad.push(format!("rigid_body_count is not {bodies}"));
        }
        let masses = self.prims.iter().filter_map(|p| get::<f32>(p, "physics:mass").ok().flatten());
        let mass: f64 = masses.map(f64::from).sum();
        match entry(self.metadata, &["mass"]) {
            Some(Value::Double(said)) if (said - mass).abs() <= 1e-5 * mass => {}
            _ => bad.push(format!("mass is not {mass:.3} kg")),
        }
        counted("SR.004", "the metadata are complete and agree with the bodies", &bad, "export again")
    }

    fn roots(&self) -> RuleFinding {
        let roots = self.stage.root_prims().unwrap_or_default();
        let others = roots.iter().filter(|root| root.as_str() != self.name).map(ToString::to_string);
        counted("HI.001", "all prims are below the default prim", &others.collect::<Vec<_>>(), "export again")
    }

    /// Prims that are drawn and have no label of their own, of an ancestor up to the asset.
    fn labels(&self) -> RuleFinding {
        let labelled: Vec<String> = self
            .prims
            .iter()
            .filter(|p| {
                p.api_schemas().is_ok_and(|all| all.iter().any(|s| s.as_str().starts_with("SemanticsLabelsAPI:")))
            })
            .map(|p| format!("{}/", p.path()))
            .collect();
        let drawn = self.prims.iter().filter(|p| is(p, "Mesh") && !has(p, "PhysicsCollisionAPI"));
        let paths = drawn.map(|p| format!("{}/", p.path()));
        let bare = paths.filter(|path| !labelled.iter().any(|above| path.starts_with(above)));
        counted("SL.001", "everything that is drawn has a semantic label", &bare.collect::<Vec<_>>(), "export again")
    }

    fn materials(&self) -> RuleFinding {
        let bare = self.prims.iter().filter(|p| is(p, "Material") && !has(p, "SemanticsLabelsAPI:material"));
        let bare: Vec<String> = bare.map(|p| p.path().to_string()).collect();
        counted("SL.MAT.001", "every material has a label", &bare, "export again")
    }

    fn contacts(&self) -> RuleFinding {
        let hulls = self.prims.iter().filter(|p| has(p, "PhysicsCollisionAPI"));
        let bound = |p: &Prim| p.relationship("material:binding:physics").targets().is_ok_and(|t| t.len() == 1);
        let bare: Vec<String> = hulls.filter(|p| !bound(p)).map(|p| p.path().to_string()).collect();
        counted("PMT.001", "every hull has a contact material", &bare, "export again")
    }

    fn grasps(&self) -> RuleFinding {
        let lines = self.prims.iter().filter(|p| is(p, "BasisCurves")).count();
        RuleFinding {
            id: "GSP.001".into(),
            checked: "a line through a handle shows how a gripper closes".into(),
            verdict: if lines > 0 { Verdict::Passed } else { Verdict::Skipped },
            measured: Some(lines as f64),
            limit: Some(1.0),
            at_least: true,
            unit: "lines".into(),
            note: if lines > 0 { String::new() } else { "no handle was found".into() },
            remedy: "give the class of a part in corrections.json if a handle was overlooked".into(),
            ..RuleFinding::default()
        }
    }

    fn front(&self) -> RuleFinding {
        let root = self.stage.prim(sdf::Path::abs_root().append_path(self.name).unwrap_or(sdf::Path::abs_root()));
        let stated = get::<openusd::gf::Vec3f>(&root, "simready:assetFrame:forwardDirection").ok().flatten();
        let length = stated.map(|v| f64::from(v.x * v.x + v.y * v.y + v.z * v.z).sqrt());
        let (verdict, note) = match length {
            Some(length) if (length - 1.0).abs() <= 1e-4 => (Verdict::Passed, ""),
            Some(_) => (Verdict::Failed, "its length is not 1"),
            None => (Verdict::Skipped, "which side is the front is not known"),
        };
        RuleFinding {
            id: "AF.001".into(),
            checked: "the direction of the front is a unit vector".into(),
            verdict,
            measured: length.map(|length| (length - 1.0).abs()),
            limit: Some(1e-4),
            note: note.into(),
            remedy: "state it: artgs export --front".into(),
            ..RuleFinding::default()
        }
    }

    /// The layer of an engine: metadata, and no schema of another engine.
    fn engine(&self, (set, stem, own, id): &(&str, &str, &str, &str)) -> RuleFinding {
        let mut bad = Vec::new();
        let said = entry(self.metadata, &["Variants", "Physics", set, "activateOption"]);
        if said != Some(&Value::String("Enabled".into())) {
            bad.push(format!("the metadata do not list {set}"));
        }
        let text = std::fs::read_to_string(self.asset.join(format!("runnables/physics/{stem}.usda")));
        let text = text.unwrap_or_default();
        let applied = text.lines().filter(|line| line.contains("apiSchemas"));
        let others = ENGINES.iter().map(|engine| engine.2).filter(|begin| begin != own);
        let found = others.filter(|begin| applied.clone().any(|line| line.contains(&format!("\"{begin}"))));
        bad.extend(found.map(|begin| format!("schemas {begin}... in the layer of {set}")));
        let checked = format!("the variant {set} is in the metadata and has schemas of {set} only");
        counted(id, &checked, &bad, "export again")
    }

    fn neutral(&self) -> RuleFinding {
        let schemas = |p: &Prim| p.api_schemas().unwrap_or_default();
        let own = |s: &Token| ENGINES.iter().any(|engine| s.as_str().starts_with(engine.2));
        let bad = self.prims.iter().filter(|p| schemas(p).iter().any(own)).map(|p| p.path().to_string());
        counted("RV.011", "without an engine there are schemas of USD only", &bad.collect::<Vec<_>>(), "export again")
    }

    /// How far apart the boxes around meshes and Gaussians are.
    fn representations(&self) -> RuleFinding {
        let boxes = ["mesh", "splats"].map(|layer| extents(&self.asset.join(format!("visuals/{layer}.usdc"))));
        let [Some(mesh), Some(splats)] = boxes else {
            let note = "there is one appearance only".into();
            return RuleFinding { verdict: Verdict::Skipped, note, ..Self::envelopes() };
        };
        let reach = mesh.iter().filter_map(|(path, mesh)| Some(apart(mesh, splats.get(path)?)));
        RuleFinding { measured: Some(reach.fold(0.0, f64::max)), ..Self::envelopes() }
    }

    fn envelopes() -> RuleFinding {
        RuleFinding {
            id: "AV.005".into(),
            checked: "largest difference of the boxes around a mesh and its Gaussians; for information".into(),
            unit: "m".into(),
            ..RuleFinding::default()
        }
    }
}

/// The boxes in a layer of visuals, by the path of the link.
fn extents(file: &Path) -> Option<HashMap<String, [f32; 6]>> {
    let prims = usd::prims(&usd::open(file).ok()?).ok()?;
    let of = |p: &Prim| {
        let [low, high] = get::<Vec<openusd::gf::Vec3f>>(p, "extent").ok()??.try_into().ok()?;
        let (path, _) = p.path().to_string().rsplit_once('/').map(|(a, b)| (a.to_owned(), b.to_owned()))?;
        Some((path, [low.x, low.y, low.z, high.x, high.y, high.z]))
    };
    Some(prims.iter().filter_map(of).collect())
}

/// Largest difference of a side.
fn apart(a: &[f32; 6], b: &[f32; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max)
}
