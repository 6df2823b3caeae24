import os
from collections.abc import Callable
from typing import Any, TypedDict

import numpy as np
from numpy.typing import NDArray

_StateArrays = tuple[NDArray[np.uint8], NDArray[np.float32] | None, NDArray[np.float64], NDArray[np.float64]]
_ViewArrays = tuple[
    str, NDArray[np.uint8], NDArray[np.float32] | None, NDArray[np.float64], tuple[float, float, float, float]
]
_SplatArrays = tuple[
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint16] | None,
]

_Path = str | os.PathLike[str]

__version__: str

class Capture:
    @staticmethod
    def load(folder: _Path) -> Capture: ...
    @staticmethod
    def from_arrays(start: _StateArrays, end: _StateArrays, opengl: bool) -> Capture: ...
    @property
    def warnings(self) -> list[str]: ...
    def count(self, state: int, test: bool) -> int: ...
    def view(self, state: int, test: bool, index: int) -> _ViewArrays | None: ...

class RecordingArguments(TypedDict):
    format: str | None
    frames: int | None
    every: int | None
    intrinsics: tuple[float, float, float, float] | None
    poses: list[_Path]
    depth_unit: str | None
    camera_axes: str | None
    invert_poses: bool

class RunArguments(TypedDict):
    out: _Path
    parts: int | str | tuple[int, int] | None
    preset: str
    seed: int | None
    device: str
    resume: bool
    force: bool
    force_input: bool
    memory: str | None
    box: list[float] | _Path | None
    recording: RecordingArguments

class ExportArguments(TypedDict):
    formats: list[str]
    name: str | None
    capture: _Path | None
    scale: float | None
    up: str | None
    front: str | None
    mass: float | None
    density: float | dict[str, float] | None
    collision: str | None
    observed_limits: bool
    triangles: int | None
    texel: float | None

class SynthArguments(TypedDict):
    views: int | None
    test_views: int | None
    size: int | None
    seed: int
    noise: list[str]
    force: bool

_Callback = Callable[[str], object] | None

_Config = _Path | dict[str, Any] | None

def reconstruct(
    start: Capture | _Path,
    end: _Path | None,
    arguments: RunArguments,
    config: _Config,
    callback: _Callback,
    threads: int | None,
) -> None: ...
def discover(
    start: Capture | _Path,
    end: _Path | None,
    arguments: RunArguments,
    config: _Config,
    callback: _Callback,
    threads: int | None,
) -> str: ...
def inspect(paths: list[_Path]) -> str: ...
def export(folder: _Path, arguments: ExportArguments, callback: _Callback, threads: int | None) -> str: ...
def check(folder: _Path, threads: int | None) -> tuple[bool, str]: ...
def evaluate(folder: _Path, ground_truth: _Path | None, capture: _Path | None, threads: int | None) -> str: ...
def page(folder: _Path) -> str: ...
def synth(what: str, out: _Path, arguments: SynthArguments) -> None: ...
def command(program: _Path, words: list[str]) -> int: ...
def read_mesh(
    path: _Path,
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.uint32]]: ...
def read_splats(path: _Path) -> _SplatArrays: ...
def read_replica(folder: _Path) -> str: ...
def poses(replica: str, values: list[float]) -> NDArray[np.float64]: ...
