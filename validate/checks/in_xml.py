"""SDF, which no installed engine reads: checks XML syntax, referenced files and frames."""

import math
from pathlib import Path
from xml.etree import ElementTree


def check_sdf(path, _states, report):
    """Checks every reference of a model.sdf."""
    model = ElementTree.parse(path).getroot().find("model")
    links = [link.get("name") for link in model.iterfind("link")]
    joints = list(model.iterfind("joint"))
    frames = links + [j.get("name") for j in joints]
    report.add("-", "names differ", len(set(frames)) == len(frames), len(frames), "frames")
    missing = [
        u.text
        for u in model.iter("uri")
        if not Path(path).with_name(u.text.split("/")[0]).joinpath(*u.text.split("/")[1:]).is_file()
    ]
    report.add("-", "all files found", not missing, note=" ".join(missing))
    loose = [p.get("relative_to") for p in model.iter("pose") if p.get("relative_to") not in [None, *frames]]
    ends = [j.findtext(tag) for j in joints for tag in ("parent", "child")]
    loose += [end for end in ends if end not in ["world", *links]]
    report.add("-", "frames defined", not loose, note=" ".join(loose))
    report.add(
        "-", "fixed to the world", any(j.findtext("parent") == "world" and j.get("type") == "fixed" for j in joints)
    )
    for joint in (j for j in joints if j.find("axis") is not None):
        lower, upper = (float(joint.findtext(f"axis/limit/{end}")) for end in ("lower", "upper"))
        length = math.dist((0, 0, 0), list(map(float, joint.findtext("axis/xyz").split())))
        report.add(
            joint.get("name"), "limits and axis", lower < upper and abs(length - 1) < 1e-6, note=f"{lower} to {upper}"
        )
