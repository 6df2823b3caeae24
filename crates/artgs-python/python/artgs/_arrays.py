"""Meshes and Gaussians as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh, world frame and unit of the capture."""

    vertices: NDArray[np.float32]
    """Positions, ``[n, 3]``."""
    colors: NDArray[np.uint8]
    """sRGB colours of the vertices, ``[n, 3]``; of no rows if there are none."""
    triangles: NDArray[np.uint32]
    """Indices of vertices, ``[m, 3]``, counter-clockwise seen from outside."""

    def moved(self, motion: ArrayLike) -> Mesh:
        """The mesh after a motion, a matrix ``[4, 4]``.

        >>> box = artgs.Mesh(np.zeros((1, 3), "f4"), np.zeros((0, 3), "u1"), np.zeros((0, 3), "u4"))
        >>> shift = np.eye(4)
        >>> shift[:3, 3] = [1, 2, 3]
        >>> box.moved(shift).vertices.tolist()
        [[1.0, 2.0, 3.0]]
        """
        matrix = np.asarray(motion, dtype=np.float64)
        points = self.vertices.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        return Mesh(points.astype(np.float32), self.colors, self.triangles)

    def to_trimesh(self) -> trimesh.Trimesh:
        """The same for the package trimesh, with vertex colours. Needs ``pip install artgs[viz]``."""
        import trimesh

        colors: Any = self.colors if len(self.colors) else None
        return trimesh.Trimesh(self.vertices, self.triangles, vertex_colors=colors, process=False)

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.triangles)} triangles)"


@dataclass(frozen=True, eq=False)
class Splats:
    """Gaussians midway between the states, world frame, in the raw parameters of 3DGS files."""

    means: NDArray[np.float32]
    """Centres, ``[n, 3]``."""
    rotations: NDArray[np.float32]
    """Quaternions (w, x, y, z), not normalised, ``[n, 4]``."""
    log_scales: NDArray[np.float32]
    """Natural logarithms of the standard deviations along the local axes, ``[n, 3]``."""
    logit_opacities: NDArray[np.float32]
    """Opacities before the sigmoid, ``[n]``."""
    sh: NDArray[np.float32]
    """Spherical harmonics, ``[n, coefficients, 3]``; colour is ``max(0, 0.5 + sum)``."""
    parts: NDArray[np.uint16]
    """Part of each, ``[n]``."""

    @property
    def scales(self) -> NDArray[np.float32]:
        """Standard deviations along the local axes, ``[n, 3]``."""
        return np.exp(self.log_scales)

    @property
    def opacities(self) -> NDArray[np.float32]:
        """Opacities, 0 to 1, ``[n]``."""
        return np.asarray(1.0 / (1.0 + np.exp(-self.logit_opacities.astype(np.float64))), dtype=np.float32)

    def of_part(self, part: int) -> Splats:
        """Those of one part."""
        own = self.parts == part
        return Splats(
            self.means[own],
            self.rotations[own],
            self.log_scales[own],
            self.logit_opacities[own],
            self.sh[own],
            self.parts[own],
        )

    def __len__(self) -> int:
        return len(self.means)

    def __repr__(self) -> str:
        return f"Splats({len(self)} Gaussians)"
