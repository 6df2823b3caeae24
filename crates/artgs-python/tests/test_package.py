"""The package as its users meet it."""

from __future__ import annotations

import doctest
import importlib
import json
import pickle
import pkgutil
import shutil
import signal
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import artgs
import numpy as np
import pytest
from conftest import SETTINGS

COMMAND = shutil.which("artgs", path=str(Path(sys.executable).parent))


def command(*words: object) -> subprocess.CompletedProcess[str]:
    assert COMMAND is not None
    return subprocess.run([COMMAND, *map(str, words)], capture_output=True, text=True, check=False)


def floats(path: Path, names: list[str]) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Columns of the vertices of a binary PLY file, read without artgs."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    sizes = {"float": "<f4", "uchar": "u1", "ushort": "<u2", "int": "<i4", "uint": "<u4"}
    count, inside = 0, False
    fields: list[tuple[str, str]] = []
    for line in lines:
        if line.startswith("element"):
            inside = line.startswith("element vertex")
            count = int(line.split()[-1]) if inside else count
        elif line.startswith("property") and inside:
            _, kind, name = line.split()
            fields.append((name, sizes[kind]))
    rows = np.frombuffer(body, dtype=np.dtype(fields), count=count)
    return np.stack([rows[name] for name in names], axis=1)


def files_of(folder: Path) -> dict[str, bytes]:
    """What a run computes; times and events differ between runs."""
    kept = ["replica.json", "config.toml"]
    found = [folder / name for name in kept] + sorted(folder.glob("meshes/*/*.ply")) + sorted(folder.glob("splats/*.ply"))
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def test_the_files_are_those_of_the_command(work: Path, capture: Path, replica: artgs.Replica) -> None:
    config = work / "quick.toml"
    config.write_text("[articulate]\nsteps = 20\n[surface]\nresolution = 60.0\n")
    out = work / "command"
    done = command("reconstruct", capture, "-o", out, "--config", config, "--quiet", "--force")
    assert done.returncode == 0, done.stderr
    ours, theirs = files_of(replica.path), files_of(out)
    assert len(ours) > 8 and ours == theirs


def test_arrays_are_those_of_the_files(replica: artgs.Replica) -> None:
    for part in replica.parts:
        for state in ("start", "end"):
            mesh = replica.mesh(part.id, state)
            path = replica.path / "meshes" / state / f"part_{part.id}.ply"
            assert np.array_equal(mesh.vertices, floats(path, ["x", "y", "z"]))
            assert np.array_equal(mesh.colors, floats(path, ["red", "green", "blue"]))
            assert mesh.triangles.max() == len(mesh.vertices) - 1
    splats = replica.splats
    assert splats is not None
    path = replica.path / "splats" / "canonical.ply"
    assert np.array_equal(splats.means, floats(path, ["x", "y", "z"]))
    assert np.array_equal(splats.rotations, floats(path, ["rot_0", "rot_1", "rot_2", "rot_3"]))
    assert np.array_equal(splats.sh[:, 0], floats(path, ["f_dc_0", "f_dc_1", "f_dc_2"]))
    assert np.array_equal(splats.parts, floats(path, ["part"])[:, 0])
    record = json.loads((replica.path / "replica.json").read_text())
    for part, fields in zip(replica.movable, record["parts"][1:], strict=True):
        assert part.joint is not None
        assert part.joint.axis.tolist() == fields["joint"]["axis"]
        assert part.joint.limits == (fields["joint"]["limits"]["lower"], fields["joint"]["limits"]["upper"])
        assert (part.confidence, part.parent) == (fields["confidence"], fields["parent"])


def test_poses_lead_from_one_state_to_the_other(replica: artgs.Replica) -> None:
    joints = [part.joint for part in replica.movable]
    end = [joint.state_values[1] for joint in joints if joint is not None]
    moved = replica.posed(end)
    for part in replica.parts:
        low, high = (replica.mesh(part.id, "end").vertices.min(0), replica.mesh(part.id, "end").vertices.max(0))
        assert np.allclose(moved[part.name].vertices.min(0), low, atol=0.05)
        assert np.allclose(moved[part.name].vertices.max(0), high, atol=0.05)
    still = replica.posed({})
    assert np.array_equal(still["part_1"].vertices, replica.mesh("part_1", "start").vertices)
    with pytest.raises(artgs.InputError, match="3 values; there are 2 movable parts"):
        replica.posed([0.0, 0.0, 0.0])


def test_errors_of_files_have_the_text_of_the_command(tmp_path: Path, replica: artgs.Replica) -> None:
    cases: list[tuple[list[object], Callable[[], object]]] = [
        (["reconstruct", "absent", "-o", tmp_path / "x"], lambda: artgs.reconstruct("absent", out=tmp_path / "x")),
        (["evaluate", replica.path, "--gt", "absent"], lambda: replica.evaluate("absent")),
        (["export", "absent"], lambda: artgs.Replica("absent", replica._record).export()),  # pyright: ignore[reportPrivateUsage]
        (["inspect", "absent"], lambda: artgs.inspect("absent")),
    ]
    for words, call in cases:
        expected = command(*words)
        with pytest.raises(artgs.InputError) as raised:
            call()
        assert expected.returncode == raised.value.exit_code == 2
        assert str(raised.value).splitlines()[0] in expected.stderr, expected.stderr
    assert not (tmp_path / "x").exists()
    assert issubclass(artgs.InputError, ValueError) and issubclass(artgs.RunError, RuntimeError)
    with pytest.raises(artgs.InputError, match="there is no part 'lid'; there are base, part_1"):
        replica.mesh("lid")
    with pytest.raises(artgs.InputError, match="replica.json"):
        artgs.load(tmp_path)


def test_errors_name_the_arguments_of_python(tmp_path: Path, capture: Path, replica: artgs.Replica) -> None:
    out = tmp_path / "x"
    wrong: dict[str, tuple[dict[str, Any], str]] = {
        "parts": ({"parts": 1}, "`parts`: .*counts the static part"),
        "range": ({"parts": (8, 3)}, "`parts`"),
        "setting": ({"config": {"surface": {"resolution": -1.0}}}, "`config`: .*resolution"),
        "unknown": ({"config": {"surfaces": {}}}, "`config`: .*surfaces"),
        "preset": ({"preset": "magic"}, "`preset` is \"magic\"; there are default, paper"),
        "device": ({"device": "cuda"}, "`device` is \"cuda\"; give auto, cpu"),
        "memory": ({"memory": "much"}, "`memory` is \"much\""),
        "little": ({"memory": "10MiB"}, "`memory`: 10.0 MiB of memory are allowed"),
        "box": ({"box": [0, 0, 0, 1, 1, 1]}, "a box selects the object in two recordings"),
        "frames": ({"frames": 5}, "`frames` is for the recordings of two states"),
        "both": ({"resume": True, "force": True}, "'resume' cannot be used with 'force'"),
        "earlier": ({"out": replica.path}, "holds an earlier run; `resume=True` continues it, `force=True` discards it"),
    }
    for change, words in wrong.values():
        given: dict[str, Any] = {"out": out, "progress": False, **change}
        with pytest.raises(artgs.InputError, match=words):
            artgs.reconstruct(capture, **given)
    assert not out.exists()
    for name in ("seed", "parts"):
        wrong_number: dict[str, Any] = {"out": out, name: -1}
        with pytest.raises(artgs.InputError, match="is -1; give a whole number"):
            artgs.reconstruct(capture, **wrong_number)
    with pytest.raises(artgs.InputError, match="needs `parts`"):
        artgs.reconstruct(capture, out=out, progress=False, preset="paper")
    with pytest.raises(artgs.InputError, match="learnt in training"):
        artgs.discover(capture, out=replica.path, parts=3, progress=False, preset="paper", force=True)
    assert replica.path.joinpath("replica.json").exists()
    with pytest.raises(TypeError, match="a setting is a"):
        artgs.reconstruct(capture, out=out, config={"seed": object()}, progress=False)
    exports: list[tuple[dict[str, Any], str]] = [
        ({"formats": "dxf"}, "there is no format `dxf`"),
        ({"scale": 1e30}, "`scale` is 1e30; give a number from"),
        ({"up": "down"}, "`up`: `down` is no direction"),
        ({"front": "back"}, "`front`: no front is called `back`"),
        ({"collision": "spheres"}, "`collision`: no collision is called"),
    ]
    for options, words in exports:
        with pytest.raises(artgs.InputError, match=words):
            replica.export(**options)
    with pytest.raises(artgs.InputError, match="there is no object or suite `sofa`"):
        artgs.synth("sofa", out)
    with pytest.raises(artgs.InputError, match="give `ground_truth`"):
        replica.evaluate()


def test_replicas_survive_pickling(work: Path, replica: artgs.Replica) -> None:
    copy = pickle.loads(pickle.dumps(replica))
    assert copy == replica and repr(copy.parts) == repr(replica.parts)
    assert np.array_equal(copy.mesh(1).vertices, replica.mesh(1).vertices)
    assert repr(replica).startswith("Replica(") and "part_1 " in repr(replica)
    error = pickle.loads(pickle.dumps(artgs.InputError("a")))
    assert isinstance(error, artgs.InputError) and str(error) == "a"


def test_arrays_become_a_capture_and_a_replica(work: Path, capture: Path, replica: artgs.Replica) -> None:
    read = artgs.read_capture(capture)
    views = [read.views("start"), read.views("end")]
    colors = [np.stack([v.rgba[..., :3] for v in state]) for state in views]
    masks = [np.stack([v.rgba[..., 3] > 127 for v in state]) for state in views]
    depths = [np.stack([v.depth for v in state if v.depth is not None]) for state in views]
    poses = [np.stack([v.camera_to_world for v in state]) for state in views]
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    lens = views[0][0].intrinsics
    in_memory = artgs.Capture.from_arrays(colors, depths, [p @ flip for p in poses], lens, masks, axes="opengl")
    again = in_memory.views("end")[3]
    assert np.allclose(again.camera_to_world, poses[1][3], atol=1e-9) and np.allclose(again.intrinsics, lens)
    made = artgs.reconstruct(in_memory, out=work / "arrays", config=SETTINGS, progress=False, force=True)
    assert [p.joint.type for p in made.movable if p.joint] == [p.joint.type for p in replica.movable if p.joint]
    for ours, theirs in zip(made.movable, replica.movable, strict=True):
        assert ours.joint is not None and theirs.joint is not None
        assert abs(float(ours.joint.axis @ theirs.joint.axis)) > 0.9999
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"colors": [colors[0]]}, "give a pair"),
        ({"colors": [c.astype("f4") for c in colors]}, "expected uint8"),
        ({"depths": [d[:, 1:] for d in depths]}, "`depths` has the shape"),
        ({"camera_to_world": [2.0 * p for p in poses]}, "state start, image 0"),
        ({"intrinsics": np.eye(4)}, "give camera matrices"),
    ]
    for change, words in wrong:
        given: dict[str, Any] = {"colors": colors, "depths": depths, "camera_to_world": poses, "intrinsics": lens}
        with pytest.raises(artgs.InputError, match=words):
            artgs.Capture.from_arrays(**(given | change))


def test_events_reach_a_function_and_its_exception_ends_the_run(tmp_path: Path, capture: Path) -> None:
    events: list[artgs.Event] = []
    ticks = 0

    def receive(event: artgs.Event) -> None:
        events.append(event)
        if event.kind == "progress" and event.stage == "articulate" and (event.step or 0) >= 5:
            raise LookupError("enough")

    def count() -> None:
        nonlocal ticks
        while running:
            ticks += 1
            time.sleep(0.01)

    running = True
    other = threading.Thread(target=count)
    other.start()
    with pytest.raises(LookupError, match="enough"):
        artgs.reconstruct(capture, out=tmp_path / "out", config=SETTINGS, progress=receive)
    running = False
    other.join()
    assert {e.kind for e in events} >= {"stage_started", "progress", "stage_finished"}
    # The interpreter was free meanwhile.
    assert ticks > 20
    stages = [e.stage for e in events if e.kind == "stage_finished"]
    assert stages == ["discover"]
    again: list[artgs.Event] = []
    artgs.reconstruct(capture, out=tmp_path / "out", config=SETTINGS, progress=again.append, resume=True)
    assert [e.stage for e in again if e.kind == "stage_finished" and e.reused] == ["discover"]


def test_an_interruption_ends_a_run_soon(tmp_path: Path, capture: Path) -> None:
    script = (
        "import artgs, signal\n"
        # A shell starts what runs in the background without interruptions.
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "try:\n"
        f"    artgs.reconstruct({str(capture)!r}, out={str(tmp_path / 'out')!r}, progress=lambda e: print(e.kind, flush=True))\n"
        "except KeyboardInterrupt:\n"
        "    print('interrupted', flush=True)\n"
    )
    child = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    for line in child.stdout:
        if line == "progress\n":
            break
    begun = time.monotonic()
    child.send_signal(signal.SIGINT)
    assert "interrupted" in child.stdout.read()
    child.wait()
    assert time.monotonic() - begun < 10.0
    # Its folder is free.
    quick = artgs.reconstruct(capture, out=tmp_path / "out", config=SETTINGS, progress=False, force=True)
    assert len(quick.parts) == 3


def test_the_command_is_that_of_the_program(capture: Path) -> None:
    version = command("--version")
    assert version.stdout.strip() == f"artgs {artgs.__version__}"
    assert command("inspect", capture, "--json").returncode == 0
    wrong = command("reconstruct", capture)
    assert wrong.returncode == 2 and "--out" in wrong.stderr
    module = subprocess.run([sys.executable, "-m", "artgs", "--version"], capture_output=True, text=True, check=True)
    assert module.stdout == version.stdout


def test_the_command_starts_without_numpy() -> None:
    program = "import sys, artgs._command; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "artgs._native" in loaded and "numpy" not in loaded and "artgs._arrays" not in loaded


def test_the_names_of_the_package_are_there() -> None:
    assert set(artgs.__all__) <= set(dir(artgs))
    assert all(hasattr(artgs, name) for name in artgs.__all__) and not hasattr(artgs, "no_such_name")


def test_the_page_is_complete_in_itself(replica: artgs.Replica) -> None:
    from artgs import _page

    page = replica.page()
    assert page.lstrip().lower().startswith("<!doctype html") and "src=\"http" not in page
    assert _page.frame('<p class="a">', 300) == (
        '<iframe srcdoc="&lt;p class=&quot;a&quot;&gt;" style="width: 100%; height: 300px; border: 0"></iframe>'
    )


def test_a_notebook_gets_the_page_as_a_frame(monkeypatch: pytest.MonkeyPatch, replica: artgs.Replica) -> None:
    from artgs import _page

    shown: list[tuple[dict[str, str], bool]] = []

    def display(data: dict[str, str], *, raw: bool) -> None:
        shown.append((data, raw))

    display_module: Any = types.ModuleType("IPython.display")
    display_module.display = display
    monkeypatch.setitem(sys.modules, "IPython.display", display_module)
    monkeypatch.setattr(_page, "_shell", object)
    replica.show(height=300)
    [(data, raw)] = shown
    assert raw and data["text/html"] == _page.frame(replica.page(), 300) and str(replica.path) in data["text/plain"]


def test_meshes_become_those_of_trimesh(replica: artgs.Replica) -> None:
    pytest.importorskip("trimesh")
    mesh = replica.mesh("part_1", "end")
    other = mesh.to_trimesh()
    assert other.faces.shape == mesh.triangles.shape and np.allclose(other.vertices, mesh.vertices)


def test_examples_in_docstrings_run(tmp_path: Path, capture: Path, replica: artgs.Replica) -> None:
    attempted = 0
    for found in pkgutil.iter_modules(artgs.__path__):
        if found.name in ("__main__", "_native", "ray", "rerun"):
            continue
        module = importlib.import_module(f"artgs.{found.name}")
        known = {"artgs": artgs, "np": np, "folder": tmp_path, "replica": replica, "capture_folder": capture}
        known |= {"replica_folder": replica.path, "capture": artgs.read_capture(capture)}
        result = doctest.testmod(module, extraglobs=known, optionflags=doctest.ELLIPSIS)
        assert result.failed == 0
        attempted += result.attempted
    assert attempted > 20
