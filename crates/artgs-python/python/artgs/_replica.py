"""Replicas: what a reconstruction made, in its folder."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from artgs import _native, _page
from artgs._arrays import Mesh, Splats
from artgs._capture import STATES, State, state_index
from artgs._errors import InputError
from artgs._events import Progress, receiver

PathLike = str | os.PathLike[str]
JointType = Literal["revolute", "prismatic", "screw"]


@dataclass(frozen=True, eq=False)
class Joint:
    """How a part moves against the part that carries it. Values are radians, or units of the capture for prismatic joints."""

    type: JointType
    """``revolute``, ``prismatic`` or ``screw``."""
    axis: NDArray[np.float64]
    """Unit vector, world frame at the start state."""
    origin: NDArray[np.float64]
    """A point of the axis."""
    pitch: float
    """Slide along the axis per radian; 0 unless the joint is a screw."""
    limits: tuple[float, float]
    """Lowest and highest value."""
    state_values: tuple[float, float]
    """Values in the start and in the end state."""

    def __repr__(self) -> str:
        return f"Joint({self.type}, axis {self.axis.round(3).tolist()}, limits {self.limits[0]:.3f} to {self.limits[1]:.3f})"


@dataclass(frozen=True, eq=False)
class Alternative:
    """Another joint that explains what was seen of a part nearly as well."""

    joint: Joint
    """The joint."""
    cost: float
    """How much worse it explains the part, as a share of the part's evidence; 0: as well."""
    what: str
    """What it means for the part."""
    advice: str
    """What further capture would decide; may be empty."""


@dataclass(frozen=True)
class Interval:
    """How far a joint may be from the true one of its type: half widths that hold in 95 of 100 joints each."""

    axis_deg: float
    """Angle between the axes, degrees."""
    position: float | None
    """Distance between the axes near the part, scene units; None for prismatic joints."""
    motion: float
    """Motion from the start to the end: radians, for prismatic joints scene units."""


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part. Part 0 is the static one."""

    id: int
    """Position in `Replica.parts`."""
    name: str
    """``base``, ``part_1``, ..."""
    parent: int | None
    """The part that carries it; None for the static part."""
    joint: Joint | None
    """Joint to the parent; None for the static part."""
    confidence: float | None
    """Probability that the joint is correct, 0 to 1; None if unknown."""
    interval: Interval | None
    """How far the joint may be off if its type is right; None if unknown."""
    alternatives: tuple[Alternative, ...]
    """Other joints that are nearly as likely, the most likely first."""


@dataclass(frozen=True, eq=False)
class Check:
    """What `Replica.check` found."""

    passed: bool
    """True if nothing is wrong."""
    report: dict[str, Any]
    """What ``artgs check --json`` prints."""

    def __bool__(self) -> bool:
        return self.passed


class Replica:
    """An articulated object in the folder of its run. Arrays are read when they are asked for. A pickled replica holds its parts and
    joints, and the path of the folder.

    >>> replica = artgs.load(replica_folder)
    >>> [part.name for part in replica.parts]
    ['base', 'part_1', 'part_2']
    >>> sorted(part.joint.type for part in replica.movable)
    ['prismatic', 'revolute']
    """

    def __init__(self, path: PathLike, _record: str | None = None) -> None:
        self.path = Path(path)
        """The folder."""
        self._record = _native.read_replica(self.path) if _record is None else _record
        self._fields: dict[str, Any] = json.loads(self._record)
        self.parts: tuple[Part, ...] = tuple(_part(fields) for fields in self._fields["parts"])
        """All parts, the static one first."""

    @property
    def movable(self) -> tuple[Part, ...]:
        """All parts but the static one."""
        return self.parts[1:]

    @property
    def metrics(self) -> dict[str, Any]:
        """Scores on images, times, memory and warnings of the run: ``metrics.json``."""
        fields: dict[str, Any] = json.loads((self.path / "metrics.json").read_text())
        return fields

    def part(self, which: int | str) -> Part:
        """A part by its number or name.

        >>> replica.part("part_1").id
        1
        """
        for part in self.parts:
            if which in (part.id, part.name):
                return part
        raise InputError(f"there is no part {which!r}; there are {', '.join(part.name for part in self.parts)}")

    def mesh(self, part: int | str = "whole", state: State = "start") -> Mesh:
        """The mesh of a part, or of the whole object, in a state; world frame.

        >>> mesh = replica.mesh("part_1", "end")
        >>> mesh.vertices.dtype, mesh.vertices.shape[1]
        (dtype('float32'), 3)
        """
        files = self._fields["whole"] if part == "whole" else self._fields["parts"][self.part(part).id]["meshes"]
        return Mesh(*_native.read_mesh(self.path / files[STATES[state_index(state)]]))

    def poses(self, values: Mapping[int | str, float] | Sequence[float]) -> NDArray[np.float64]:
        """Motion of every part from the start state to values of the joints, ``[parts, 4, 4]``, world frame. `values` are of parts by
        number or name, the others stay where they are at the start; or a sequence of one value for every movable part.

        >>> replica.poses([0.0, 0.0]).shape
        (3, 4, 4)
        """
        start = [0.0 if part.joint is None else part.joint.state_values[0] for part in self.parts]
        if isinstance(values, Mapping):
            for which, value in values.items():
                start[self.part(which).id] = float(value)
        elif len(values) == len(self.movable):
            start[1:] = [float(value) for value in values]
        else:
            raise InputError(f"{len(values)} values; there are {len(self.movable)} movable parts")
        return _native.poses(self._record, start)

    def posed(self, values: Mapping[int | str, float] | Sequence[float]) -> dict[str, Mesh]:
        """Meshes of all parts by name when the joints have these values; see `Replica.poses`.

        >>> sorted(replica.posed({"part_1": 0.1}))
        ['base', 'part_1', 'part_2']
        """
        poses = self.poses(values)
        return {part.name: self.mesh(part.id).moved(pose) for part, pose in zip(self.parts, poses, strict=True)}

    @property
    def splats(self) -> Splats | None:
        """Gaussians of all parts; None if the run trained none.

        >>> len(replica.splats) == len(replica.splats.of_part(0)) + sum(len(replica.splats.of_part(p.id)) for p in replica.movable)
        True
        """
        file = self.path / "splats" / "canonical.ply"
        if not file.is_file():
            return None
        means, rotations, scales, opacities, sh, parts = _native.read_splats(file)
        return Splats(means, rotations, scales, opacities, sh, np.zeros(len(means), "u2") if parts is None else parts)

    def export(
        self,
        formats: str | Sequence[str] | None = None,
        *,
        name: str | None = None,
        capture: PathLike | None = None,
        scale: float | None = None,
        up: str | None = None,
        front: str | None = None,
        mass: float | None = None,
        density: float | Mapping[str, float] | None = None,
        collision: Literal["hulls", "coacd", "none"] | None = None,
        observed_limits: bool = False,
        triangles: int | None = None,
        texel: float | None = None,
        threads: int | None = None,
        progress: Progress = True,
    ) -> dict[str, Any]:
        """Writes files for simulators, browsers and renderers to the folder ``exports`` of the replica; all formats if none are given.
        Arguments are the usual options of ``artgs export``. Returns its report; ``files`` lists what was written.

        >>> replica.export(["urdf", "mjcf"], triangles=2000, progress=False)["scale"]
        1.0
        """
        names = [] if formats is None else formats.split(",") if isinstance(formats, str) else list(formats)
        arguments: _native.ExportArguments = {
            "formats": names,
            "name": name,
            "capture": capture,
            "scale": scale,
            "up": up,
            "front": front,
            "mass": mass,
            "density": dict(density) if isinstance(density, Mapping) else density,
            "collision": collision,
            "observed_limits": observed_limits,
            "triangles": triangles,
            "texel": texel,
        }
        report: dict[str, Any] = json.loads(_native.export(self.path, arguments, receiver(progress), threads))
        return report

    def check(self, *, threads: int | None = None) -> Check:
        """Opens every export with another reader, and moves the joints in a physics engine. `Replica.export` comes first.

        >>> found = replica.check()
        >>> [all(joint["reached"]) for joint in found.report["joints"]]
        [True, True]
        """
        passed, report = _native.check(self.path, threads)
        return Check(passed, json.loads(report))

    def evaluate(
        self,
        ground_truth: PathLike | None = None,
        *,
        capture: PathLike | None = None,
        threads: int | None = None,
    ) -> dict[str, Any]:
        """Scores against the ground truth in a folder, against the held-out views of a capture, or both, as ``artgs evaluate --json``.

        >>> scores = replica.evaluate(capture_folder / "gt")
        >>> scores["joints"]["axis_angle_deg"] < 1.0
        True
        """
        scores: dict[str, Any] = json.loads(_native.evaluate(self.path, ground_truth, capture, threads))
        return scores

    def page(self) -> str:
        """The viewer with this replica as one HTML page that loads nothing."""
        return _page.page_of(self.path)

    def show(self, height: int = 600) -> None:
        """Shows the viewer: in a notebook below the cell, else in a browser. The page is self-contained."""
        _page.show(self.path, height)

    def __repr__(self) -> str:
        joints = ", ".join(_described(part) for part in self.movable)
        return f"Replica({str(self.path)!r}, {len(self.parts)} parts: {joints or 'none moves'})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (Replica, (str(self.path.absolute()), self._record))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Replica):
            return NotImplemented
        return self.path.absolute() == other.path.absolute() and self._record == other._record

    def __hash__(self) -> int:
        return hash(self._record)


def load(path: PathLike) -> Replica:
    """The replica in the folder of a run.

    >>> artgs.load(replica_folder) == replica
    True
    """
    return Replica(path)


def _described(part: Part) -> str:
    share = "" if part.confidence is None else f" {part.confidence:.2f}"
    return f"{part.name} {part.joint.type if part.joint else 'static'}{share}"


def _joint(fields: dict[str, Any]) -> Joint:
    values, limits = fields["state_values"], fields["limits"]
    return Joint(
        type=fields["type"],
        axis=np.array(fields["axis"]),
        origin=np.array(fields["origin"]),
        pitch=fields.get("pitch", 0.0),
        limits=(limits["lower"], limits["upper"]),
        state_values=(values["start"], values["end"]),
    )


def _part(fields: dict[str, Any]) -> Part:
    others, interval = fields.get("alternatives", []), fields.get("interval")
    return Part(
        id=fields["id"],
        name=fields["name"],
        parent=fields["parent"],
        joint=None if fields["joint"] is None else _joint(fields["joint"]),
        confidence=fields.get("confidence"),
        interval=None if interval is None else Interval(interval["axis_deg"], interval.get("position"), interval["motion"]),
        alternatives=tuple(Alternative(_joint(o["joint"]), o["cost"], o["what"], o.get("advice", "")) for o in others),
    )
