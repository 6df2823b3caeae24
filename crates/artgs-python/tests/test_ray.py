"""Batches on a local cluster of three nodes, one of which is lost half way. `ARTGS_RAY_CAPTURES` is the number of captures."""

from __future__ import annotations

import importlib
import json
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import artgs
import pytest
from conftest import SETTINGS

ray: Any = pytest.importorskip("ray")
pytest.importorskip("pyarrow")
pytest.importorskip("fsspec")

CAPTURES = int(os.environ.get("ARTGS_RAY_CAPTURES", "10"))


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    utils: Any = importlib.import_module("ray.cluster_utils")
    # A node that does not answer counts as lost after a few seconds.
    system = {"health_check_initial_delay_ms": 0, "health_check_period_ms": 1000, "health_check_failure_threshold": 5}
    made = utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "_system_config": system})
    made.nodes = [made.add_node(num_cpus=1, wait=True) for _ in range(3)]
    ray.init(address=made.address, log_to_driver=False)
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("batch")
    (folder / "quick.toml").write_text("[articulate]\nsteps = 20\n[surface]\nresolution = 60.0\n")
    rows: list[dict[str, object]] = []
    for number in range(CAPTURES):
        artgs.synth("storage2", folder / f"c{number}", views=12, test_views=0, size=80, seed=number)
        rows.append({"id": f"good-{number}", "start": f"c{number}", "parts": 3, "config": "quick.toml", "device": "cpu"})
    broken = folder / "broken"
    shutil.copytree(folder / "c0", broken)
    (broken / "transforms_train_end.json").write_text("{")
    rows[1:1] = [
        {"id": "absent", "start": "nowhere"},
        {"id": "json", "start": "broken"},
        {"id": "parts", "start": "c0", "parts": "1"},
        {"id": "killer", "start": "c0", "parts": 3, "config": "quick.toml"},
    ]
    file = folder / "captures.jsonl"
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return file


def files_of(folder: Path) -> dict[str, bytes]:
    found = [folder / "replica.json", *sorted(folder.glob("meshes/*/*.ply")), *sorted(folder.glob("splats/*.ply"))]
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


@pytest.mark.skipif(sys.platform != "linux", reason="clusters of several nodes on one machine are for Linux")
def test_a_lost_node_and_worker_cost_no_capture(cluster: Any, manifest: Path, tmp_path: Path) -> None:
    import artgs.ray

    # Inside of this function, because nodes do not know this module.
    def kill_for(name: str, _path: str) -> None:
        """Stands for a capture whose memory a node does not have."""
        if name == "killer":
            os.kill(os.getpid(), signal.SIGKILL)

    out = tmp_path / "out"
    lost = threading.Event()

    def lose_a_node() -> None:
        while len(list((out / "rows").glob("good-*.json")) if out.exists() else []) < CAPTURES // 2:
            time.sleep(0.1)
        cluster.remove_node(cluster.nodes[0], allow_graceful=False)
        lost.set()

    thread = threading.Thread(target=lose_a_node, daemon=True)
    thread.start()
    table = artgs.ray.reconstruct(manifest, out, prepare=kill_for, retries=2, table_seconds=1.0, progress=False)
    assert lost.is_set()
    rows: dict[str, Any] = {row["id"]: row for row in table.to_pylist()}
    assert len(rows) == table.num_rows == CAPTURES + 4
    failed = {name: row["reason"] for name, row in rows.items() if row["status"] != "done"}
    assert set(failed) == {"absent", "json", "parts", "killer"}
    assert "nowhere" in failed["absent"] and "transforms_train_end.json" in failed["json"]
    assert "counts the static part" in failed["parts"] and "worker" in failed["killer"]
    assert rows["killer"]["retry"] and not rows["json"]["retry"]
    assert artgs.ray.pq.read_table(out / "results.parquet").equals(table)
    single = artgs.reconstruct(
        manifest.parent / "c2", out=tmp_path / "single", parts=3, config=SETTINGS, device="cpu", progress=False
    )
    assert files_of(single.path) == files_of(out / "replicas" / "good-2")
    # A second call finds everything but what may succeed now.
    begun = time.monotonic()
    again = artgs.ray.reconstruct(manifest, out, progress=False).to_pylist()
    assert [row["status"] for row in again].count("done") == CAPTURES + 1
    same = {row["id"]: row["started"] for row in again if row["id"] != "killer"}
    assert same == {name: row["started"] for name, row in rows.items() if name != "killer"}
    assert time.monotonic() - begun < 60.0
    # A run that takes too long is ended.
    rows_late = artgs.ray.reconstruct(
        [{"id": "late", "start": str(manifest.parent / "c0")}], tmp_path / "late", timeout=0.5, progress=False
    ).to_pylist()
    assert [(row["status"], row["reason"], row["retry"]) for row in rows_late] == [
        ("failed", "the run took longer than 0.5 s", False)
    ]


def test_files_can_be_left_out(tmp_path: Path) -> None:
    import artgs.ray

    folder = tmp_path / "replica"
    for name in ("replica.json", "stages/parts.json", "meshes/start/part_1.ply", "exports/urdf/replica.urdf"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    target = tmp_path / "stored"
    for patterns in ((), ("stages/*", "meshes/*")):
        artgs.ray.store(folder, str(target), patterns)
    stored = sorted(path.relative_to(target).as_posix() for path in target.rglob("*") if path.is_file())
    assert stored == ["exports/urdf/replica.urdf", "replica.json"]


def test_wrong_manifests_are_refused(tmp_path: Path) -> None:
    import artgs.ray

    wrong: list[tuple[list[dict[str, Any]], str]] = [
        ([{"id": "a", "start": "x"}, {"id": "A", "start": "y"}], "'A' is that of two captures"),
        ([{"id": "../a", "start": "x"}], "the id '../a' must be"),
        ([{"id": "a"}], "`start` is missing"),
    ]
    for rows, words in wrong:
        with pytest.raises(artgs.InputError, match=words):
            artgs.ray.reconstruct(rows, tmp_path)
    with pytest.raises(artgs.InputError, match="no manifest"):
        (tmp_path / "m.txt").write_text("")
        artgs.ray.reconstruct(tmp_path / "m.txt", tmp_path)
