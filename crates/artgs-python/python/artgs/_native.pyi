import os
from collections.abc import Callable

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

__version__: str

class Capture:
    @staticmethod
    def load(folder: str | os.PathLike[str]) -> Capture: ...
    @staticmethod
    def from_arrays(start: _StateArrays, end: _StateArrays, opengl: bool) -> Capture: ...
    @property
    def warnings(self) -> list[str]: ...
    def count(self, state: int, test: bool) -> int: ...
    def view(self, state: int, test: bool, index: int) -> _ViewArrays | None: ...

def call(
    words: list[str],
    capture: Capture | None = None,
    callback: Callable[[str], object] | None = None,
    threads: int | None = None,
) -> str: ...
def command(program: str | os.PathLike[str], words: list[str]) -> int: ...
def read_mesh(
    path: str | os.PathLike[str],
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.uint32]]: ...
def read_splats(path: str | os.PathLike[str]) -> _SplatArrays: ...
def read_replica(folder: str | os.PathLike[str]) -> str: ...
def poses(replica: str, values: list[float]) -> NDArray[np.float64]: ...
