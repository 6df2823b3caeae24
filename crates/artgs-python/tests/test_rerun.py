"""What a recording of Rerun holds, read back with the reader of Rerun."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import artgs
import numpy as np
import pytest

pytest.importorskip("rerun")


def chunks_of(path: Path) -> dict[str, list[Any]]:
    """The data of a recording by entity."""
    module: Any = importlib.import_module("rerun.chunk")
    found: dict[str, list[Any]] = {}
    for chunk in module.RrdReader(path).stream().to_chunks():
        found.setdefault(chunk.entity_path, []).append(chunk)
    return found


def rows_of(chunks: list[Any], column: str) -> list[Any]:
    """Values of the first column whose name contains a text."""
    rows: list[Any] = []
    for chunk in chunks:
        batch: Any = chunk.to_record_batch()
        for name in batch.schema.names:
            if column in name:
                rows += batch.column(name).to_pylist()
    return rows


def test_a_recording_holds_capture_parts_joints_and_their_movement(tmp_path: Path, capture: Path, replica: artgs.Replica) -> None:
    import artgs.rerun

    steps = 4
    file = artgs.rerun.save(replica, tmp_path / "run.rrd", artgs.read_capture(capture), every=6, steps=steps, points=5000)
    found = chunks_of(file)
    expected = {"/about"} | {f"/replica/{part.name}" for part in replica.parts}
    for part in replica.movable:
        expected |= {f"/joints/{part.name}", f"/values/{part.name}"}
    for state in ("start", "end"):
        expected |= {f"/capture/{state}/{name}" for name in ("camera", "camera/image", "camera/depth", "points")}
    assert expected <= set(found), sorted(found)
    frames = (steps + 1) * (1 + len(replica.movable))
    assert len(rows_of(found["/values/part_1"], "scalars")) == frames
    (vertices,) = [row for row in rows_of(found["/replica/part_1"], "vertex_positions") if row is not None]
    assert np.array_equal(np.array(vertices, dtype=np.float32), replica.mesh("part_1").vertices)
    assert len([row for row in rows_of(found["/capture/start/camera/image"], "Image:blob") if row is not None]) == 4
    (points,) = [row for row in rows_of(found["/capture/end/points"], "positions") if row is not None]
    assert 1000 < len(points) <= 5000
    # They lie on the surface of the object.
    whole = replica.mesh("whole", "end").vertices
    assert (np.array(points).min(0) > whole.min(0) - 0.1).all() and (np.array(points).max(0) < whole.max(0) + 0.1).all()


def test_movements_pass_both_states_and_all_limits(replica: artgs.Replica) -> None:
    import artgs.rerun

    values = np.array(list(artgs.rerun.movements(replica, 3)))
    for index, part in enumerate(replica.movable):
        assert part.joint is not None
        assert (values[0, index], values[3, index]) == part.joint.state_values
        own = values[4 * (index + 1) : 4 * (index + 2), index]
        assert np.allclose((own[0], own[-1]), part.joint.limits)


def test_wrong_arguments_are_refused(tmp_path: Path, replica: artgs.Replica) -> None:
    import artgs.rerun

    with pytest.raises(artgs.InputError, match="give a replica"):
        artgs.rerun.save(None, tmp_path / "a.rrd")
    with pytest.raises(artgs.InputError, match="does not exist"):
        artgs.rerun.save(replica, tmp_path / "absent" / "a.rrd")
    with pytest.raises(artgs.InputError, match="1 or more"):
        artgs.rerun.save(replica, tmp_path / "a.rrd", steps=0)
