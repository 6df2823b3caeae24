//! Links, joints and files of an exported URDF.
//!
//! Limitations: reads only files of `artgs export`: parallel frames (no `rpy`), and mesh files relative to the URDF or in the
//! package that its folder is. Frames of handles are omitted. The pitch
//! of a screw and the observed states are in comments; without them a joint is revolute or prismatic and its observed values
//! are its limits.

use artgs_core::{JointKind, PerState};
use artgs_io::FileError;
use glam::DVec3;
use roxmltree::{Document, Node};
use std::path::{Component, Path, PathBuf};

/// A link with its joint, files relative to the folder of the URDF.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) parent: Option<usize>,
    /// Object's frame, zero pose.
    pub(crate) origin: DVec3,
    pub(crate) joint: Option<Joint>,
    pub(crate) visual: Option<PathBuf>,
    pub(crate) collision: Vec<PathBuf>,
}

/// A joint in the frame of its link.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Joint {
    pub(crate) kind: JointKind,
    pub(crate) axis: DVec3,
    pub(crate) pitch: f64,
    pub(crate) limits: [f64; 2],
    pub(crate) observed: PerState<f64>,
    pub(crate) effort: f64,
}

/// Name of the robot and its links, the base first, parents before children. The root link without a body is omitted.
pub(crate) fn read(path: &Path) -> Result<(String, Vec<Link>), FileError> {
    let text = std::fs::read_to_string(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    parse(&text).map_err(|reason| FileError::malformed(path, reason))
}

fn parse(text: &str) -> Result<(String, Vec<Link>), String> {
    let document = Document::parse(text).map_err(|e| e.to_string())?;
    let robot = document.root_element();
    let joints: Vec<Node> = elements(robot, "joint").collect();
    let mut left: Vec<Node> = elements(robot, "link").collect();
    let mut links: Vec<Link> = Vec::new();
    let mut roots: Vec<(String, DVec3)> = Vec::new();
    // Parents may follow children in the file; every round adds the links whose parents are known.
    while !left.is_empty() {
        let before = left.len();
        let mut waiting = Vec::new();
        for node in left {
            let name = attribute(node, "name")?;
            let joint = joints
                .iter()
                .find(|j| child(**j, "child").and_then(|c| attribute(c, "link")).as_deref() == Ok(name.as_str()));
            let Some(joint) = joint else {
                match link(node, None, DVec3::ZERO, None)? {
                    empty if empty.visual.is_none() && empty.collision.is_empty() => roots.push((name, DVec3::ZERO)),
                    body => links.push(body),
                }
                continue;
            };
            let carrier = attribute(child(*joint, "parent")?, "link")?;
            let is_frame = !["visual", "collision"].iter().any(|tag| elements(node, tag).next().is_some());
            if is_frame && joint.attribute("type") == Some("fixed") && !roots.iter().any(|(n, _)| *n == carrier) {
                continue;
            }
            let parent = links.iter().position(|l| l.name == carrier);
            let root = roots.iter().find(|(n, _)| *n == carrier).map(|(_, at)| *at);
            let Some(at) = parent.map(|p| links[p].origin).or(root) else {
                waiting.push(node);
                continue;
            };
            links.push(link(node, parent, at + shift(*joint)?, motion(*joint)?)?);
        }
        if waiting.len() == before {
            return Err(format!("link `{}` has no parent", waiting[0].attribute("name").unwrap_or("")));
        }
        left = waiting;
    }
    if links.is_empty() {
        return Err("no link has a mesh".into());
    }
    Ok((attribute(robot, "name")?, links))
}

fn link(node: Node, parent: Option<usize>, origin: DVec3, joint: Option<Joint>) -> Result<Link, String> {
    let files = |tag| elements(node, tag).map(mesh_file).collect::<Result<Vec<_>, _>>();
    let (mut visual, collision) = (files("visual")?, files("collision")?);
    if visual.len() > 1 {
        return Err(format!("link `{}` has {} visuals; expected one", attribute(node, "name")?, visual.len()));
    }
    Ok(Link { name: attribute(node, "name")?, parent, origin, joint, visual: visual.pop(), collision })
}

fn mesh_file(shape: Node) -> Result<PathBuf, String> {
    if elements(shape, "origin").any(|o| o.attribute("xyz").is_some_and(|t| row::<3>(t) != Ok([0.0; 3]))) {
        return Err("a mesh is not in its link's frame; export the replica again".into());
    }
    let name = attribute(child(child(shape, "geometry")?, "mesh")?, "filename")?;
    let inside = name.strip_prefix("package://").and_then(|rest| rest.split_once('/')).map(|(_, inside)| inside);
    let path = PathBuf::from(inside.unwrap_or(&name));
    if name.is_empty() || !path.components().all(|c| matches!(c, Component::Normal(_))) {
        return Err(format!("mesh {name:?} is not a path inside the folder of the URDF"));
    }
    Ok(path)
}

fn shift(joint: Node) -> Result<DVec3, String> {
    let Ok(origin) = child(joint, "origin") else { return Ok(DVec3::ZERO) };
    if origin.attribute("rpy").is_some_and(|t| row::<3>(t) != Ok([0.0; 3])) {
        return Err("a joint's frame is turned (`rpy`); export the replica again".into());
    }
    origin.attribute("xyz").map_or(Ok(DVec3::ZERO), |t| row::<3>(t).map(DVec3::from_array))
}

fn motion(joint: Node) -> Result<Option<Joint>, String> {
    let name = joint.attribute("name").unwrap_or("");
    let kind = match joint.attribute("type") {
        Some("fixed") => return Ok(None),
        Some("prismatic") => JointKind::Prismatic,
        Some("revolute") => JointKind::Revolute,
        other => return Err(format!("joint `{name}`: type {other:?} is neither revolute, prismatic nor fixed")),
    };
    let limit = child(joint, "limit")?;
    let number = |key: &str| attribute(limit, key).and_then(|t| row::<1>(&t)).map(|[v]| v);
    let limits = [number("lower")?, number("upper")?];
    let axis = DVec3::from_array(row(&attribute(child(joint, "axis")?, "xyz")?)?);
    let axis = axis.try_normalize().ok_or_else(|| format!("joint `{name}`: the axis is zero"))?;
    if limits[0] > limits[1] {
        return Err(format!("joint `{name}`: lower limit {} above upper limit {}", limits[0], limits[1]));
    }
    let pitch = note(joint, "screw: slides ").and_then(|t| row::<1>(t.split(' ').next()?).ok()).map(|[p]| p);
    let [start, end] = note(joint, "observed: ").map_or(Ok(limits), row)?;
    let kind = if pitch.is_some() { JointKind::Screw } else { kind };
    let effort = number("effort").unwrap_or(0.0);
    Ok(Some(Joint { kind, axis, pitch: pitch.unwrap_or(0.0), limits, observed: PerState::new(start, end), effort }))
}

/// Text after `start` in a comment of a joint.
fn note<'a>(joint: Node<'a, '_>, start: &str) -> Option<&'a str> {
    joint.children().filter(Node::is_comment).find_map(|c| c.text()?.trim().strip_prefix(start))
}

fn elements<'a, 'i: 'a>(node: Node<'a, 'i>, tag: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.has_tag_name(tag))
}

fn child<'a, 'i: 'a>(node: Node<'a, 'i>, tag: &'static str) -> Result<Node<'a, 'i>, String> {
    elements(node, tag).next().ok_or_else(|| {
        let name = node.attribute("name").map(|n| format!(" `{n}`")).unwrap_or_default();
        format!("<{}>{name} has no <{tag}>", node.tag_name().name())
    })
}

fn attribute(node: Node, key: &str) -> Result<String, String> {
    node.attribute(key).map(str::to_string).ok_or_else(|| format!("<{}> has no `{key}`", node.tag_name().name()))
}

/// Finite numbers separated by blanks.
fn row<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let numbers: Option<Vec<f64>> =
        text.split_whitespace().map(|t| t.parse().ok().filter(|v: &f64| v.is_finite())).collect();
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| format!("{text:?} is not {N} finite numbers"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = r#"<robot name="r"><link name="world"/>
        <link name="knob"><visual><geometry><mesh filename="m/knob.obj"/></geometry></visual></link>
        <link name="base"><collision><geometry><mesh filename="m/b.obj"/></geometry></collision></link>
        <joint name="b" type="fixed"><parent link="world"/><child link="base"/><origin xyz="1 0 0" rpy="0 0 0"/></joint>"#;

    fn robot(joint: &str) -> Result<(String, Vec<Link>), String> {
        parse(&format!("{HEAD}<joint name=\"k\" {joint}<parent link=\"base\"/><child link=\"knob\"/></joint></robot>"))
    }

    #[test]
    fn parents_come_first_and_comments_contain_screws() {
        let (name, links) = robot(
            r#"type="revolute"><origin xyz="0 2 0"/><axis xyz="0 0 -2"/><limit lower="-1" upper="3" effort="5"/>
               <!-- observed: 0 2.5 --><!-- screw: slides -0.01 m per radian along its axis -->"#,
        )
        .unwrap();
        assert_eq!((name.as_str(), links.len()), ("r", 2));
        assert_eq!((links[0].name.as_str(), links[0].parent, links[0].origin), ("base", None, DVec3::X));
        assert_eq!(links[0].collision, [PathBuf::from("m/b.obj")]);
        assert_eq!((links[1].parent, links[1].origin), (Some(0), DVec3::new(1.0, 2.0, 0.0)));
        assert_eq!(links[1].visual, Some(PathBuf::from("m/knob.obj")));
        let joint = links[1].joint.clone().unwrap();
        let expected = Joint {
            kind: JointKind::Screw,
            axis: DVec3::NEG_Z,
            pitch: -0.01,
            limits: [-1.0, 3.0],
            observed: PerState::new(0.0, 2.5),
            effort: 5.0,
        };
        assert_eq!(joint, expected);
    }

    #[test]
    fn what_is_wrong_is_named() {
        let slide = |inner: &str| robot(&format!("type=\"prismatic\">{inner}")).unwrap_err();
        assert!(slide("<axis xyz=\"0 0 1\"/>").contains("`k` has no <limit>"));
        assert!(slide("<axis xyz=\"0 0 0\"/><limit lower=\"0\" upper=\"1\"/>").contains("axis is zero"));
        assert!(slide("<axis xyz=\"0 0 1\"/><limit lower=\"NaN\" upper=\"1\"/>").contains("\"NaN\" is not 1 finite"));
        assert!(slide("<axis xyz=\"0 0 1\"/><limit lower=\"2\" upper=\"1\"/>").contains("above"));
        assert!(slide("<origin rpy=\"0 1 0\"/>").contains("rpy"));
        assert!(robot("type=\"floating\">").unwrap_err().contains("floating"));
        let lost = HEAD.replace("parent link=\"world\"", "parent link=\"base\"") + "</robot>";
        assert!(parse(&lost).unwrap_err().contains("`base` has no parent"));
        for bad in ["../b.obj", "/b.obj", "package://b.obj/../../c"] {
            let text = HEAD.replace("m/b.obj", bad) + "</robot>";
            assert!(parse(&text).unwrap_err().contains("inside the folder"), "{bad}");
        }
    }
}
