"""Drops balls into the drawers and onto the shelves of a replica: places are found on its visual meshes, not on its hulls."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np

CELL = 0.02
# Least side of a place, in cells.
LEAST = 5
RADIUS = 0.02
# Free height above a place, and height from which a ball falls.
ROOM = 0.12
HEIGHT = 0.05
# How far a ball may sink in.
SINKS = 0.01
TIME = 1.0
MOST = 4


class Place:
    """A flat place that faces up: a start for a ball above it and the height of its surface, at the joint values `values`."""

    def __init__(self, link, start, height, values):
        self.link, self.start, self.height, self.values = link, start, height, values


def places(urdf):
    """Places of the links of a URDF of this program: floors of drawers while they are open, and what the base carries."""
    root = ElementTree.parse(urdf).getroot()
    origins, slides = {}, {}
    for joint in root.iter("joint"):
        parent, child = joint.find("parent").get("link"), joint.find("child").get("link")
        at = joint.find("origin")
        shift = np.zeros(3) if at is None else np.array(at.get("xyz").split(), float)
        origins[child] = origins.get(parent, np.zeros(3)) + shift
        if joint.get("type") == "prismatic":
            axis = np.array(joint.find("axis").get("xyz").split(), float)
            slides[child] = (joint.get("name"), float(joint.find("limit").get("upper")), axis)
    meshes = {}
    for link in root.iter("link"):
        visual = link.find("visual/geometry/mesh")
        if visual is not None:
            meshes[link.get("name")] = read_mesh(Path(urdf).parent / visual.get("filename"))
    out = []
    for name, (points, triangles) in meshes.items():
        joint, upper, axis = slides.get(name, (None, 0.0, np.zeros(3)))
        shift = origins.get(name, np.zeros(3)) + upper * axis
        if name not in slides and name in origins and np.any(origins[name]):
            continue
        others = [p + origins.get(n, np.zeros(3)) for n, (p, _) in meshes.items() if n in slides and n != name]
        values = {joint: upper} if joint else {}
        for x, y, z in _flat(points + shift, triangles):
            # Where a part slides, its carrier holds nothing.
            inside = any((p.min(0) < (x, y, z)).all() and (p.max(0) > (x, y, z)).all() for p in others)
            if not inside or joint:
                out.append(Place(name, np.array([x, y, z + RADIUS + HEIGHT]), z, values))
    return out


def read_mesh(path):
    """Vertices `[n, 3]` and triangles `[m, 3]` of an OBJ file."""
    points, triangles = [], []
    for line in path.read_text().splitlines():
        if line.startswith("v "):
            points.append(line.split()[1:4])
        elif line.startswith("f "):
            triangles.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:4]])
    return np.array(points, float), np.array(triangles, int)


def _flat(points, triangles):
    """Middles of flat places with room above, widest first. Heights are those of the highest and lower surfaces per cell."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    up = normal[:, 2] > 0.95 * np.maximum(area, 1e-12)
    rng = np.random.default_rng(0)
    # About six samples per cell.
    counts = np.ceil(3.0 * area / CELL**2).astype(int) + 1
    which = np.repeat(np.arange(len(triangles)), counts)
    s, r = rng.random(len(which)), rng.random(len(which))
    fold = s + r > 1.0
    s[fold], r[fold] = 1.0 - s[fold], 1.0 - r[fold]
    all_points = a[which] + s[:, None] * (b - a)[which] + r[:, None] * (c - a)[which]
    faces_up = up[which]
    columns = {}
    for cell, z, level in zip(map(tuple, np.floor(all_points[:, :2] / CELL).astype(int)), all_points[:, 2], faces_up):
        columns.setdefault(cell, []).append((z, level))
    levels = {}
    for cell, found in columns.items():
        found.sort()
        for z, level in found:
            free = not any(z + 0.01 < other < z + ROOM for other, _ in found)
            if level and free:
                levels.setdefault(cell, []).append(z)
    # A place: a square of cells with a surface at about the same height.
    half = LEAST // 2
    seen, out = [], []
    for (i, j), heights in sorted(levels.items()):
        for z in heights:
            near = lambda u, v: any(abs(z - other) < 0.006 for other in levels.get((u, v), []))
            if not all(near(i + u, j + v) for u in range(-half, half + 1) for v in range(-half, half + 1)):
                continue
            x, y = (i + 0.5) * CELL, (j + 0.5) * CELL
            # Spread over the place: no two closer than four squares.
            if all(abs(z - w) > 0.02 or max(abs(x - u), abs(y - v)) > 4 * LEAST * CELL for u, v, w in seen):
                seen.append((x, y, z))
                out.append((x, y, z))
    return out[: MOST * 3]


def report_drops(found, report):
    """Adds a finding per link; `found` holds (place, lowest height of the ball's centre while it was above the place)."""
    for link in sorted({place.link for place, _ in found}):
        own = [(place, low) for place, low in found if place.link == link]
        fell = [place for place, low in own if low < place.height - RADIUS]
        sank = sum(low < place.height + RADIUS - SINKS for place, low in own) - len(fell)
        note = "" if not fell else "at " + ", ".join(f"({p.start[0]:.2f}, {p.start[1]:.2f}, {p.height:.2f})" for p in fell)
        if sank:
            note += f" {sank} sink more than {1000 * SINKS:.0f} mm"
        report.add(link, "balls stay", not fell, len(own) - len(fell), f"of {len(own)}", note)
