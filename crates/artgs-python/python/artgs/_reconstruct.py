"""Reconstruction, and captures of procedural objects."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, cast

from artgs import _native
from artgs._capture import Capture
from artgs._errors import InputError
from artgs._events import Progress, receiver
from artgs._replica import PathLike, Replica

Settings = Mapping[str, Any]


def reconstruct(
    start: PathLike | Capture,
    end: PathLike | None = None,
    *,
    out: PathLike,
    parts: int | str | tuple[int, int] | None = None,
    config: PathLike | Settings | None = None,
    device: str = "auto",
    progress: Progress = True,
    preset: Literal["default", "paper", "registration"] = "default",
    seed: int | None = None,
    threads: int | None = None,
    resume: bool = False,
    force: bool = False,
    box: Sequence[float] | PathLike | None = None,
    format: str | None = None,
    frames: int | None = None,
    every: int | None = None,
    intrinsics: tuple[float, float, float, float] | None = None,
    poses: Sequence[PathLike] = (),
    depth_unit: str | None = None,
    camera_axes: str | None = None,
    invert_poses: bool = False,
    memory: str | None = None,
    force_input: bool = False,
) -> Replica:
    """Makes a replica and returns it. The files in `out` are those that ``artgs reconstruct`` writes.

    `start` is a capture of both states, as a folder or in memory, or with `end` the recording of the first state. `parts` counts the
    static part: a number, or the least and the largest; if it is None the number is found. `config` is a TOML file or a mapping of
    settings, ``{"surface": {"resolution": 220.0}}``. `device` is ``auto``, ``cpu``, ``gpu`` or ``gpu:N``. `progress` is True for a bar, or a
    function that gets every `Event`. `resume` continues an earlier run in `out`, `force` discards it. `box`, `format`, `frames`, `every`,
    `intrinsics`, `poses`, `depth_unit` (``"mm"``), `camera_axes` (``"robot"``) and `invert_poses` are for recordings. `memory` is a limit such as ``"4GiB"``.

    Other threads of Python run meanwhile. Ctrl-C ends the run; it can be resumed.

    >>> settings = {"articulate": {"steps": 20}, "surface": {"resolution": 60.0}}
    >>> artgs.reconstruct(capture_folder, out=folder / "quick", parts=3, config=settings, progress=False)
    Replica('...quick', 3 parts: part_1 ...)
    """
    if resume and force:
        raise InputError("the argument 'resume' cannot be used with 'force'")
    recording: _native.RecordingArguments = {
        "format": format,
        "frames": frames,
        "every": every,
        "intrinsics": intrinsics,
        "poses": list(poses),
        "depth_unit": depth_unit,
        "camera_axes": camera_axes,
        "invert_poses": invert_poses,
    }
    arguments: _native.RunArguments = {
        "out": out,
        "parts": parts,
        "preset": preset,
        "seed": seed,
        "device": device,
        "resume": resume,
        "force": force,
        "force_input": force_input,
        "memory": memory,
        "box": _box(box),
        "recording": recording,
    }
    _native.reconstruct(_source(start, end), end, arguments, _settings(config), receiver(progress), threads)
    return Replica(out)


def discover(
    start: PathLike | Capture,
    end: PathLike | None = None,
    *,
    out: PathLike,
    parts: int | str | tuple[int, int] | None = None,
    config: PathLike | Settings | None = None,
    device: str = "auto",
    progress: Progress = True,
    preset: Literal["default", "paper", "registration"] = "default",
    seed: int | None = None,
    threads: int | None = None,
    force: bool = False,
    box: Sequence[float] | PathLike | None = None,
    format: str | None = None,
    frames: int | None = None,
    every: int | None = None,
    intrinsics: tuple[float, float, float, float] | None = None,
    poses: Sequence[PathLike] = (),
    depth_unit: str | None = None,
    camera_axes: str | None = None,
    invert_poses: bool = False,
    memory: str | None = None,
    force_input: bool = False,
) -> dict[str, Any]:
    """Finds parts and joints and stops before training, so that they can be corrected. Returns what ``artgs reconstruct --stop-after
    discover --json`` prints: ``parts`` are the movable ones, part 1 first. Arguments are those of `reconstruct`,
    which with the same arguments and ``resume=True`` makes the replica.

    >>> settings = {"articulate": {"steps": 20}, "surface": {"resolution": 60.0}}
    >>> found = artgs.discover(capture_folder, out=folder / "found", config=settings, progress=False)
    >>> sorted(part["type"] for part in found["parts"])
    ['prismatic', 'revolute']
    """
    recording: _native.RecordingArguments = {
        "format": format,
        "frames": frames,
        "every": every,
        "intrinsics": intrinsics,
        "poses": list(poses),
        "depth_unit": depth_unit,
        "camera_axes": camera_axes,
        "invert_poses": invert_poses,
    }
    arguments: _native.RunArguments = {
        "out": out,
        "parts": parts,
        "preset": preset,
        "seed": seed,
        "device": device,
        "resume": False,
        "force": force,
        "force_input": force_input,
        "memory": memory,
        "box": _box(box),
        "recording": recording,
    }
    text = _native.discover(_source(start, end), end, arguments, _settings(config), receiver(progress), threads)
    found: dict[str, Any] = json.loads(text)
    return found


def inspect(start: PathLike, end: PathLike | None = None) -> list[dict[str, Any]]:
    """Describes a capture, or each of one or two recordings, as ``artgs inspect --json``: one item for each.

    >>> artgs.inspect(capture_folder)[0]["consistency"]["states"][0]["agreement"] > 0.8
    True
    """
    reports: list[dict[str, Any]] = json.loads(_native.inspect([start] if end is None else [start, end]))
    return reports


def synth(
    what: str,
    out: PathLike,
    *,
    views: int | None = None,
    test_views: int | None = None,
    size: int | None = None,
    seed: int = 0,
    noise: Sequence[str] = (),
    force: bool = False,
) -> Path:
    """Renders a capture of a procedural object with its ground truth in ``gt``; ``artgs synth --list`` lists objects.

    >>> artgs.synth("storage2", folder / "small", views=4, test_views=0, size=64).name
    'small'
    """
    arguments: _native.SynthArguments = {
        "views": views,
        "test_views": test_views,
        "size": size,
        "seed": seed,
        "noise": list(noise),
        "force": force,
    }
    _native.synth(what, out, arguments)
    return Path(out)


def _source(start: PathLike | Capture, end: PathLike | None) -> PathLike | _native.Capture:
    """A path, or the images of a capture that was made in memory."""
    # Drivers of Mesa otherwise ask a display which device is best, and complain where there is none.
    os.environ.setdefault("NODEVICE_SELECT", "1")
    if not isinstance(start, Capture):
        return start
    if end is not None:
        raise InputError("a capture holds both states; give it alone")
    return start._native if start.path is None else start.path  # pyright: ignore[reportPrivateUsage]


def _box(box: Sequence[float] | PathLike | None) -> list[float] | PathLike | None:
    return box if box is None or isinstance(box, (str, os.PathLike)) else [float(value) for value in box]


def _settings(config: PathLike | Settings | None) -> PathLike | dict[str, Any] | None:
    return config if config is None or isinstance(config, (str, os.PathLike)) else _plain(config)


def _plain(mapping: Mapping[str, Any]) -> dict[str, Any]:
    """The same as dictionaries throughout."""
    inner = {key: cast("Settings", value) for key, value in mapping.items() if isinstance(value, Mapping)}
    return {**mapping, **{key: _plain(value) for key, value in inner.items()}}
