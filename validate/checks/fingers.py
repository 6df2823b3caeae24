"""Puts fingers behind the handles of a replica: gaps are found on its visual meshes, not on its hulls."""

import json
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from .drop import read_mesh

RADIUS = 0.005
# Half the length of a finger without its round ends.
HALF = 0.005
# Least gap between a handle and what it is fixed to, and the way to it from above or below, that have to be free.
GAP = 0.015
ENTRY = 0.05
REACH = 0.15
# Places along a handle, as shares of its length.
PLACES = (-0.3, -0.15, 0.0, 0.15, 0.3)
# How far a hull may reach into a finger. PyBullet has a margin of 1 mm around hulls.
TOUCH = 0.002


class Finger:
    """A capsule behind a handle of `link`, joints at 0: its middle and the direction of its length, in the frame of the object."""

    def __init__(self, link, middle, along):
        self.link, self.middle, self.along = link, middle, along


def fingers(urdf):
    """Fingers in the gaps of the handles that `export.json` beside the folder of the URDF lists."""
    listed = Path(urdf).parent.parent / "export.json"
    if not listed.is_file():
        return []
    handles = {link["name"]: link.get("handles") or [] for link in json.loads(listed.read_text())["links"]}
    root = ElementTree.parse(urdf).getroot()
    origins = {}
    for joint in root.iter("joint"):
        at = joint.find("origin")
        shift = np.zeros(3) if at is None else np.array(at.get("xyz").split(), float)
        origins[joint.find("child").get("link")] = origins.get(joint.find("parent").get("link"), np.zeros(3)) + shift
    meshes = {}
    for link in root.iter("link"):
        visual = link.find("visual/geometry/mesh")
        if visual is not None:
            points, triangles = read_mesh(Path(urdf).parent / visual.get("filename"))
            meshes[link.get("name")] = (points + origins.get(link.get("name"), np.zeros(3)))[triangles]
    out = []
    for name in sorted(meshes):
        for handle in handles.get(name, []):
            out += _behind(name, handle, origins.get(name, np.zeros(3)), meshes)
    return out


def _behind(name, handle, origin, meshes):
    x, y, z, w = handle["orientation"]
    across = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)])
    along = np.array([2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)])
    inward = np.cross(across, along)
    out = []
    for place in PLACES:
        at = origin + np.array(handle["position"]) + place * handle["length"] * across
        # Into the handle, out behind it, into what it is fixed to.
        ways = _hits(meshes[name], at - REACH * inward, inward, 2.0 * REACH)
        if len(ways) < 3 or ways[2] - ways[1] < GAP:
            continue
        middle = at + (0.5 * (ways[1] + ways[2]) - REACH) * inward
        # What a mesh encloses is no gap.
        if all(len(_hits(meshes[name], middle, side * along, ENTRY)) for side in (1.0, -1.0)):
            continue
        line = middle + np.linspace(-HALF, HALF, 5)[:, None] * along
        if all(_distance(mesh, line) > RADIUS for mesh in meshes.values()):
            out.append(Finger(name, middle, along))
    return out


def _hits(triangles, start, direction, reach):
    """Sorted distances at which a ray meets triangles, `[n, 3, 3]` (Moeller and Trumbore 1997); hits of one surface count once."""
    a, u, v = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(direction, v)
    det = np.einsum("ij,ij->i", u, p)
    inverse = np.where(np.abs(det) > 1e-14, 1.0, 0.0) / np.where(np.abs(det) > 1e-14, det, 1.0)
    s = start - a
    b = np.einsum("ij,ij->i", s, p) * inverse
    q = np.cross(s, u)
    c = (q @ direction) * inverse
    t = np.einsum("ij,ij->i", v, q) * inverse
    found = np.sort(t[(inverse != 0) & (b >= 0) & (c >= 0) & (b + c <= 1) & (t > 0) & (t < reach)])
    return found[np.diff(found, prepend=-1.0) > 1e-6]


def _distance(triangles, points):
    """Least distance of points to the vertices, edges and faces of triangles, metres; only near ones are looked at."""
    middle = points.mean(0)
    near = (triangles.min(1) < middle + 0.03).all(1) & (triangles.max(1) > middle - 0.03).all(1)
    a, b, c = (triangles[near][:, None, k] for k in range(3))
    if not near.any():
        return np.inf
    best = np.inf
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.maximum(length, 1e-15)
    height = np.sum((points - a) * normal, -1)
    foot = points - height[..., None] * normal
    inside = np.ones(height.shape, bool)
    for p, q in ((a, b), (b, c), (c, a)):
        side = np.sum(np.cross(q - p, foot - p) * normal, -1)
        inside &= side >= 0
        share = np.sum((points - p) * (q - p), -1) / np.maximum(np.sum((q - p) ** 2, -1), 1e-15)
        ends = p + np.clip(share, 0.0, 1.0)[..., None] * (q - p)
        best = min(best, np.linalg.norm(points - ends, axis=-1).min())
    return min(best, np.abs(height[inside]).min(initial=np.inf))


def turned_to(direction):
    """Quaternion (w, x, y, z) that turns Z to a unit direction."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    turn = np.array([1.0 + z, -y, x, 0.0])
    return turn / np.linalg.norm(turn)


def report_fingers(found, report):
    """Adds a finding per link; `found` holds (finger, how far hulls reach into it). A hand needs half of the places."""
    for link in sorted({finger.link for finger, _ in found}):
        depths = [depth for finger, depth in found if finger.link == link]
        blocked = sum(depth > TOUCH for depth in depths)
        note = f"hulls are up to {1000 * max(depths):.1f} mm in the way" if blocked else ""
        report.add(link, "fingers fit behind handles", 2 * blocked <= len(depths), len(depths) - blocked, f"of {len(depths)}", note)
