"""A small capture and its replica, made once for all tests. `ARTGS_TEST_WORK` names a folder that keeps them."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import artgs
import pytest

SETTINGS: dict[str, Any] = {"articulate": {"steps": 20}, "surface": {"resolution": 60.0}}


@pytest.fixture(scope="session")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    named = os.environ.get("ARTGS_TEST_WORK")
    return Path(named) if named else tmp_path_factory.mktemp("work")


@pytest.fixture(scope="session")
def capture(work: Path) -> Path:
    folder = work / "capture"
    if not (folder / "gt" / "trans.json").exists():
        artgs.synth("storage2", folder, views=24, test_views=2, size=160, force=True)
    return folder


@pytest.fixture(scope="session")
def replica(work: Path, capture: Path) -> artgs.Replica:
    made = artgs.reconstruct(capture, out=work / "python", config=SETTINGS, progress=False, force=True)
    made.export(["urdf", "mjcf", "splats"], triangles=2000, progress=False)
    return made
