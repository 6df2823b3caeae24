"""Reconstruction, and captures of procedural objects."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

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
    with tempfile.TemporaryDirectory() as scratch:
        options = _method(out, parts, config, Path(scratch)) | {
            "device": device,
            "preset": preset,
            "seed": seed,
            "format": format,
            "frames": frames,
            "every": every,
            "intrinsics": None if intrinsics is None else ",".join(map(str, intrinsics)),
            "depth-unit": depth_unit,
            "camera-axes": camera_axes,
            "memory": memory,
            "box": _box(box),
        }
        words = [f"--poses={os.fspath(file)}" for file in poses]
        flags = {"--resume": resume, "--force": force, "--force-input": force_input, "--invert-poses": invert_poses}
        words += [flag for flag, given in flags.items() if given]
        _execute(start, end, options, words, progress, threads)
    return Replica(out)


def discover(
    start: PathLike | Capture,
    end: PathLike | None = None,
    *,
    out: PathLike,
    parts: int | str | tuple[int, int] | None = None,
    config: PathLike | Settings | None = None,
    progress: Progress = True,
    seed: int | None = None,
    threads: int | None = None,
    force: bool = False,
) -> dict[str, Any]:
    """Finds parts and joints and stops before training, so that they can be corrected. Returns what ``artgs reconstruct --stop-after
    discover --json`` prints: ``parts`` are the movable ones, part 1 first. Arguments are those of `reconstruct`, which with the same arguments and ``resume=True`` makes the replica.

    >>> settings = {"articulate": {"steps": 20}, "surface": {"resolution": 60.0}}
    >>> found = artgs.discover(capture_folder, out=folder / "found", config=settings, progress=False)
    >>> sorted(part["type"] for part in found["parts"])
    ['prismatic', 'revolute']
    """
    with tempfile.TemporaryDirectory() as scratch:
        options = _method(out, parts, config, Path(scratch)) | {
            "seed": seed,
        }
        words = ["--stop-after=discover", *(["--force"] if force else [])]
        found: dict[str, Any] = json.loads(_execute(start, end, options, words, progress, threads))
        return found


def inspect(start: PathLike, end: PathLike | None = None) -> list[dict[str, Any]]:
    """Describes a capture, or each of two recordings, as ``artgs inspect --json``: one item for each.

    >>> artgs.inspect(capture_folder)[0]["consistency"]["states"][0]["agreement"] > 0.8
    True
    """
    words = ["inspect", "--", os.fspath(start), *([] if end is None else [os.fspath(end)])]
    reports: list[dict[str, Any]] = json.loads(_native.call(words))
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
    options = {"out": os.fspath(out), "views": views, "test-views": test_views, "size": size, "seed": seed}
    words = ["synth", *(f"--{key}={value}" for key, value in options.items() if value is not None)]
    words += [f"--noise={setting}" for setting in noise] + (["--force"] if force else [])
    _native.call([*words, "--", what])
    return Path(out)


def _method(
    out: PathLike, parts: int | str | tuple[int, int] | None, config: PathLike | Settings | None, scratch: Path
) -> dict[str, object]:
    return {
        "out": os.fspath(out),
        "parts": "..".join(map(str, parts)) if isinstance(parts, tuple) else parts,
        "config": _config_file(config, scratch),
    }


def _execute(
    start: PathLike | Capture,
    end: PathLike | None,
    options: Mapping[str, object],
    words: list[str],
    progress: Progress,
    threads: int | None,
) -> str:
    """Calls ``artgs reconstruct`` with options that are not None and further words, and returns its result as JSON."""
    words = ["reconstruct", *(f"--{key}={value}" for key, value in options.items() if value is not None), *words]
    native, sources = _sources(start, end)
    # Drivers of Mesa otherwise ask a display which device is best, and complain where there is none.
    os.environ.setdefault("NODEVICE_SELECT", "1")
    return _native.call([*words, "--", *sources], native, receiver(progress), threads)


def _sources(start: PathLike | Capture, end: PathLike | None) -> tuple[_native.Capture | None, list[str]]:
    if not isinstance(start, Capture):
        return None, [os.fspath(start), *([] if end is None else [os.fspath(end)])]
    if end is not None:
        raise InputError("a capture holds both states; give it alone")
    if start.path is not None:
        return None, [os.fspath(start.path)]
    return start._native, ["arrays"]  # pyright: ignore[reportPrivateUsage]


def _box(box: Sequence[float] | PathLike | None) -> str | None:
    if box is None or isinstance(box, str):
        return box
    if isinstance(box, os.PathLike):
        return os.fspath(box)
    return ",".join(str(float(value)) for value in box)


def _config_file(config: PathLike | Settings | None, scratch: Path) -> str | None:
    if not isinstance(config, Mapping):
        return None if config is None else os.fspath(config)
    file = scratch / "settings.toml"
    file.write_text(to_toml(config), encoding="utf-8")
    return str(file)


def to_toml(settings: Settings) -> str:
    """Settings as TOML."""
    sections: dict[str, Any] = {key: value for key, value in settings.items() if isinstance(value, Mapping)}
    lines = [f"{json.dumps(key)} = {_value(value)}" for key, value in settings.items() if key not in sections]
    for section, values in sections.items():
        lines.append(f"[{json.dumps(section)}]")
        lines += [f"{json.dumps(key)} = {_value(value)}" for key, value in _items(values)]
    return "\n".join(lines) + "\n"


def _items(values: Any) -> Iterable[tuple[str, Any]]:
    return sorted(dict(values).items())


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_value(inner)}" for key, inner in _items(value)) + " }"
    if type(value) in (list, tuple):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value)
