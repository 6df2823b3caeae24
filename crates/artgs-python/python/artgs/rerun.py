"""Replicas and captures in Rerun, a viewer of data over time. Needs ``pip install artgs[viz]``.

`save` writes a recording (``.rrd``), `show` opens the viewer, `log` adds to a recording of your own. Entities are in the world frame and unit
of the capture:

- ``capture/start/camera``, ``capture/end/camera``: images, depth and cameras of both states, along the timeline ``view``
- ``capture/start/points``, ``capture/end/points``: surface points of the depth images
- ``replica/base``, ``replica/part_1``, ...: meshes of the parts; along the timeline ``motion`` they move from the start to the end state, then one
  joint after another through its limits
- ``joints/part_1``, ...: axes of the joints, as long as half of the diagonal of the object; they move with the parts that carry them
- ``values/part_1``, ...: values of the joints, radians or units of the capture
- ``about``: parts, joints and confidences as text
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from artgs._capture import STATES, Capture, View
from artgs._errors import InputError
from artgs._replica import Part, Replica

# Its types are those of one version.
rr: Any = import_module("rerun")

COLORS = ((37, 99, 235), (220, 38, 38), (5, 150, 105), (217, 119, 6), (124, 58, 237), (8, 145, 178), (190, 24, 93), (87, 83, 78))
"""Colours of joints, repeated when they run out."""


def save(replica: Replica | None, path: str | os.PathLike[str], capture: Capture | None = None, **options: Any) -> Path:
    """Writes a replica, a capture or both to a recording of Rerun (``.rrd``), and returns its path. `options` are those of `log`."""
    target = Path(path)
    if not target.parent.is_dir():
        raise InputError(f"{target}: the folder {target.parent} does not exist; create it first")
    recording = rr.RecordingStream("artgs")
    recording.save(target)
    log(recording, replica, capture, **options)
    recording.flush()
    recording.disconnect()
    return target


def show(replica: Replica | None, capture: Capture | None = None, **options: Any) -> None:
    """Opens the viewer of Rerun with a replica, a capture or both. `options` are those of `log`."""
    recording = rr.RecordingStream("artgs")
    recording.spawn()
    log(recording, replica, capture, **options)
    recording.flush()


def log(
    recording: Any,
    replica: Replica | None,
    capture: Capture | None = None,
    *,
    up: Literal["z", "y"] = "z",
    every: int = 1,
    steps: int = 30,
    points: int = 100_000,
    jpeg_quality: int | None = 85,
) -> None:
    """Adds a replica, a capture or both to a ``rerun.RecordingStream``.

    `up` is the upward axis of the capture. Every `every`-th view is logged, as JPEG of `jpeg_quality`, or uncompressed if it is None; surface points are
    at most `points` for each state. `steps` is the number of frames of each movement.
    """
    if replica is None and capture is None:
        raise InputError("give a replica, a capture, or both")
    if every < 1 or steps < 1 or points < 0:
        raise InputError("`every` and `steps` are 1 or more, `points` is 0 or more")
    axes = rr.ViewCoordinates.RIGHT_HAND_Z_UP if up == "z" else rr.ViewCoordinates.RIGHT_HAND_Y_UP
    recording.log("/", axes, static=True)
    if capture is not None:
        for state in STATES:
            _log_state(recording, capture, state, every, points, jpeg_quality)
    if replica is not None:
        _log_replica(recording, replica, steps)


def _log_state(recording: Any, capture: Capture, state: Any, every: int, points: int, quality: int | None) -> None:
    views = capture.views(state)[::every]
    camera = f"capture/{state}/camera"
    for number, view in enumerate(views):
        height, width = view.rgba.shape[:2]
        recording.set_time("view", sequence=number)
        pose = view.camera_to_world
        recording.log(camera, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        recording.log(
            camera,
            rr.Pinhole(image_from_camera=view.intrinsics, width=width, height=height, camera_xyz=rr.ViewCoordinates.RDF),
        )
        image = rr.Image(np.ascontiguousarray(view.rgba[..., :3]))
        recording.log(f"{camera}/image", image if quality is None else image.compress(jpeg_quality=quality))
        if view.depth is not None:
            # Points are logged apart; the image only shows where there is depth.
            recording.log(f"{camera}/depth", rr.DepthImage(view.depth, meter=1.0))
    recording.reset_time()
    clouds = [surface_points(view) for view in views if view.depth is not None]
    if clouds and points > 0:
        positions = np.concatenate([cloud[0] for cloud in clouds])
        colors = np.concatenate([cloud[1] for cloud in clouds])
        step = max(1, -(-len(positions) // points))
        recording.log(f"capture/{state}/points", rr.Points3D(positions[::step], colors=colors[::step]), static=True)


def surface_points(view: View) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Points of the depth image of a view where its mask is set: positions ``[n, 3]`` in the world frame, and colours ``[n, 3]``."""
    if view.depth is None:
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8)
    rows, columns = np.nonzero((view.depth > 0.0) & (view.rgba[..., 3] > 127))
    depth = view.depth[rows, columns].astype(np.float64)
    lens = view.intrinsics
    # The centre of a pixel is half a pixel from its corner.
    x = (columns + 0.5 - lens[0, 2]) / lens[0, 0] * depth
    y = (rows + 0.5 - lens[1, 2]) / lens[1, 1] * depth
    pose = view.camera_to_world
    positions = np.stack([x, y, depth], axis=1) @ pose[:3, :3].T + pose[:3, 3]
    return positions.astype(np.float32), view.rgba[rows, columns, :3]


def _log_replica(recording: Any, replica: Replica, steps: int) -> None:
    for part in replica.parts:
        mesh = replica.mesh(part.id)
        recording.log(
            f"replica/{part.name}",
            rr.Mesh3D(
                vertex_positions=mesh.vertices,
                triangle_indices=mesh.triangles,
                vertex_colors=mesh.colors if len(mesh.colors) else None,
            ),
            static=True,
        )
    length = 0.5 * _diagonal(replica)
    for part in replica.movable:
        _log_axis(recording, part, length)
    recording.log("about", rr.TextDocument(_about(replica), media_type=rr.MediaType.MARKDOWN), static=True)
    for number, values in enumerate(movements(replica, steps)):
        recording.set_time("motion", sequence=number)
        poses = replica.poses(values)
        for part, value in zip(replica.movable, values, strict=True):
            recording.log(f"replica/{part.name}", _transform(poses[part.id]))
            recording.log(f"joints/{part.name}", _transform(poses[part.parent or 0]))
            recording.log(f"values/{part.name}", rr.Scalars(value))
    recording.reset_time()


def movements(replica: Replica, steps: int) -> Iterator[list[float]]:
    """Values of all joints for every frame: from the start to the end state, then one joint after another through its limits."""
    joints = [part.joint for part in replica.movable if part.joint is not None]
    start = np.array([joint.state_values[0] for joint in joints])
    end = np.array([joint.state_values[1] for joint in joints])
    for step in range(steps + 1):
        yield (start + (end - start) * step / steps).tolist()
    for index, joint in enumerate(joints):
        low, high = joint.limits
        for step in range(steps + 1):
            values = start.copy()
            values[index] = low + (high - low) * step / steps
            yield values.tolist()


def _transform(pose: NDArray[np.float64]) -> Any:
    return rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])


def _diagonal(replica: Replica) -> float:
    vertices = replica.mesh("whole").vertices
    return float(np.linalg.norm(vertices.max(0) - vertices.min(0))) if len(vertices) else 1.0


def _log_axis(recording: Any, part: Part, length: float) -> None:
    if part.joint is None:
        return
    axis = part.joint.axis * length
    share = "" if part.confidence is None else f", confidence {part.confidence:.2f}"
    arrow = rr.Arrows3D(
        origins=[part.joint.origin - 0.5 * axis],
        vectors=[axis],
        radii=[0.01 * length],
        colors=[COLORS[part.id % len(COLORS)]],
        labels=[f"{part.name}: {part.joint.type}{share}"],
    )
    recording.log(f"joints/{part.name}", arrow, static=True)


def _about(replica: Replica) -> str:
    lines = ["| part | joint | limits | confidence |", "|---|---|---|---|"]
    for part in replica.movable:
        joint = part.joint
        limits = "" if joint is None else f"{joint.limits[0]:.3f} to {joint.limits[1]:.3f}"
        confidence = "" if part.confidence is None else f"{part.confidence:.2f}"
        lines.append(f"| {part.name} | {joint.type if joint else 'static'} | {limits} | {confidence} |")
    return "\n".join([f"**{replica.path.name}**", "", *lines])
