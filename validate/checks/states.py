"""Observed states of an export, from the keyframes of its MJCF."""

import json
from pathlib import Path
from xml.etree import ElementTree


def observed_states(folder):
    """{state: {joint: value}} of FOLDER/mjcf/*.xml; empty without such a file."""
    models = sorted(Path(folder, "mjcf").glob("*.xml"), key=lambda path: path.stem == "scene")
    for path in models:
        root = ElementTree.parse(path).getroot()
        world = root.find("worldbody")
        joints = [] if world is None else [j.get("name") for j in world.iter("joint")]
        return {
            key.get("name"): dict(zip(joints, map(float, key.get("qpos", "").split())))
            for key in root.iterfind("keyframe/key")
        }
    return {}


def partnet_states(folder, states):
    """The same with the joint names of the PartNet folder."""
    path = Path(folder, "partnet", "mobility_v2.json")
    if not path.is_file():
        return {}
    other = {f"{link['artgs_name']}_joint": f"link_{link['id']}_joint" for link in json.loads(path.read_text())}
    return {state: {other.get(joint, joint): value for joint, value in at.items()} for state, at in states.items()}
