"""Captures: posed images of an object in two states."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgs import _native
from artgs._errors import InputError

State = Literal["start", "end", 0, 1]
"""A state of the object: the first or the second."""

STATES = ("start", "end")


def state_index(state: State | str | int) -> int:
    """0 or 1."""
    for index, name in enumerate(STATES):
        if state in (index, name):
            return index
    raise InputError(f"there is no state {state!r}; there are 'start' and 'end'")


@dataclass(frozen=True, eq=False)
class View:
    """One image with its camera."""

    name: str
    """Path of the image in its capture, or its state and number."""
    rgba: NDArray[np.uint8]
    """Straight RGBA, ``[height, width, 4]``; alpha is the mask of the object."""
    depth: NDArray[np.float32] | None
    """Depth along the optical axis, units of the capture, ``[height, width]``; 0: none. Held-out views have no depth."""
    camera_to_world: NDArray[np.float64]
    """Pose of the camera, ``[4, 4]``; axes x right, y down, z forward."""
    intrinsics: NDArray[np.float64]
    """Camera matrix, pixels, ``[3, 3]``; the centre of the top left pixel is (0.5, 0.5)."""


class Capture:
    """Posed images of an object in two states. `read_capture` reads one, `Capture.from_arrays` makes one.

    >>> capture = artgs.read_capture(capture_folder)
    >>> capture
    Capture(24 + 24 views, 2 + 2 held out)
    >>> capture.views("start")[0].rgba.shape
    (160, 160, 4)
    """

    def __init__(self, native: _native.Capture, path: Path | None = None) -> None:
        self._native = native
        self.path = path
        """The folder that it was read from."""

    @staticmethod
    def from_arrays(
        colors: Sequence[ArrayLike],
        depths: Sequence[ArrayLike] | None,
        camera_to_world: Sequence[ArrayLike],
        intrinsics: ArrayLike | Sequence[ArrayLike],
        masks: Sequence[ArrayLike] | None = None,
        *,
        axes: Literal["opencv", "opengl"] = "opencv",
    ) -> Capture:
        """A capture from arrays. Every argument is a pair: the arrays of the start, and those of the end.

        `colors` are ``uint8`` of shape ``[n, height, width, 3]``, or 4 with the mask in alpha; `depths` are along the optical axis, in the
        unit of the poses, ``[n, height, width]``, 0 where there is none, or None for a capture without depth; `camera_to_world`
        are ``[n, 4, 4]`` with cameras that look along +z (``axes="opengl"``: along -z); `masks` are ``bool`` or ``uint8`` (255: the object),
        ``[n, height, width]``. `intrinsics` is a camera matrix ``[3, 3]`` in pixels for all images, or a pair of ``[3, 3]`` or ``[n, 3, 3]``.

        >>> views = [capture.views(state) for state in ("start", "end")]
        >>> copy = artgs.Capture.from_arrays(
        ...     [[v.rgba for v in state] for state in views],
        ...     [[v.depth for v in state] for state in views],
        ...     [[v.camera_to_world for v in state] for state in views],
        ...     views[0][0].intrinsics,
        ... )
        >>> copy
        Capture(24 + 24 views, 0 + 0 held out)
        """
        pairs = {"colors": colors, "depths": depths, "camera_to_world": camera_to_world, "masks": masks}
        for name, pair in pairs.items():
            if pair is not None and len(pair) != 2:
                raise InputError(f"`{name}` has {len(pair)} items; give a pair: the arrays of the start and of the end")
        if axes not in ("opencv", "opengl"):
            raise InputError(f"`axes` is {axes!r}; there are 'opencv' and 'opengl'")
        lenses = _lenses(intrinsics)
        both = [
            _state(
                STATES[i],
                colors[i],
                None if depths is None else depths[i],
                camera_to_world[i],
                lenses[i],
                None if masks is None else masks[i],
            )
            for i in range(2)
        ]
        return Capture(_native.Capture.from_arrays(both[0], both[1], axes == "opengl"))

    @property
    def warnings(self) -> list[str]:
        """What was unexpected, one sentence each."""
        return self._native.warnings

    def views(self, state: State, split: Literal["train", "test"] = "train") -> list[View]:
        """Copies of the views of a state: those to reconstruct from, or those that are held out for scores."""
        index, test = state_index(state), split == "test"
        found = (self._native.view(index, test, i) for i in range(self._native.count(index, test)))
        return [_view(view) for view in found if view is not None]

    def __repr__(self) -> str:
        count = self._native.count
        train, test = (f"{count(0, test)} + {count(1, test)}" for test in (False, True))
        return f"Capture({train} views, {test} held out)"

    def __reduce__(self) -> tuple[Any, ...]:
        if self.path is None:
            raise TypeError("a capture of arrays cannot be pickled; pickle its arrays, or the path of a folder")
        return (read_capture, (str(self.path.absolute()),))


def read_capture(path: str | os.PathLike[str]) -> Capture:
    """Reads a capture: a folder with posed images of both states, in one of the layouts of the capture guide.

    >>> artgs.read_capture("absent")
    Traceback (most recent call last):
    artgs.InputError: absent: no such directory; give the folder of the capture
    """
    return Capture(_native.Capture.load(path), Path(path))


def _view(arrays: Any) -> View:
    name, rgba, depth, pose, (fx, fy, cx, cy) = arrays
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return View(name, rgba, depth, pose, matrix)


def _lenses(intrinsics: ArrayLike | Sequence[ArrayLike]) -> list[NDArray[np.float64]]:
    """The camera matrices of both states, ``[3, 3]`` or ``[n, 3, 3]``."""
    pair: Any = intrinsics
    if isinstance(intrinsics, (list, tuple)) and len(pair) == 2:
        given = [np.asarray(k, dtype=np.float64) for k in pair]
    else:
        given = [np.asarray(intrinsics, dtype=np.float64)] * 2
    for matrices in given:
        if matrices.ndim not in (2, 3) or matrices.shape[-2:] != (3, 3):
            raise InputError(f"`intrinsics` has the shape {list(matrices.shape)}; give camera matrices [3, 3] or [n, 3, 3]")
    return given


def _state(
    name: str,
    colors: ArrayLike,
    depths: ArrayLike | None,
    poses: ArrayLike,
    lens: NDArray[np.float64],
    masks: ArrayLike | None,
) -> Any:
    def require(what: str, array: NDArray[Any], shape: tuple[int, ...]) -> None:
        if array.shape != shape:
            raise InputError(f"state {name}: `{what}` has the shape {list(array.shape)}, expected {list(shape)}")

    rgb = np.asarray(colors)
    if rgb.dtype != np.uint8 or rgb.ndim != 4 or rgb.shape[3] not in (3, 4):
        raise InputError(
            f"state {name}: `colors` is {rgb.dtype} of shape {list(rgb.shape)}, expected uint8 of [n, height, width, 3 or 4]"
        )
    n, height, width = rgb.shape[:3]
    rgba = np.full((n, height, width, 4), 255, dtype=np.uint8)
    rgba[..., : rgb.shape[3]] = rgb
    if masks is not None:
        mask = np.asarray(masks)
        require("masks", mask, (n, height, width))
        if mask.dtype == np.bool_:
            mask = np.where(mask, 255, 0)
        elif mask.dtype != np.uint8:
            raise InputError(f"state {name}: `masks` is {mask.dtype}, expected bool or uint8")
        rgba[..., 3] = mask
    depth = None
    if depths is not None:
        depth = np.ascontiguousarray(depths, dtype=np.float32)
        require("depths", depth, (n, height, width))
    pose = np.ascontiguousarray(poses, dtype=np.float64)
    require("camera_to_world", pose, (n, 4, 4))
    matrices = np.broadcast_to(lens, (n, 3, 3)) if lens.ndim == 2 else lens
    require("intrinsics", matrices, (n, 3, 3))
    numbers = np.stack([matrices[:, 0, 0], matrices[:, 1, 1], matrices[:, 0, 2], matrices[:, 1, 2]], axis=1)
    return rgba, depth, pose, np.ascontiguousarray(numbers)
