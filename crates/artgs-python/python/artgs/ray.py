"""Reconstruction of many captures on a Ray cluster. Needs ``pip install artgs[ray]`` on every node.

A task is one capture: it fetches the files, runs ``artgs batch`` for it in a process of its own, stores the replica, and then its row. A task
that a node or worker loses is repeated. What fails in the end is a row with a reason.
"""

from __future__ import annotations

import csv
import ctypes
import hashlib
import io
import json
import os
import posixpath
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path
from typing import Any

from artgs import _native
from artgs._errors import InputError

# Packages without types, or with those of some versions only.
fsspec: Any = import_module("fsspec")
pa: Any = import_module("pyarrow")
pq: Any = import_module("pyarrow.parquet")
ray: Any = import_module("ray")
url_to_fs: Any = import_module("fsspec.core").url_to_fs
LocalFileSystem: Any = import_module("fsspec.implementations.local").LocalFileSystem

Row = dict[str, Any]
Prepare = Callable[[str, str], object]

SCHEMA = pa.schema(
    [
        ("id", pa.string()),
        ("status", pa.string()),
        ("reason", pa.string()),
        ("retry", pa.bool_()),
        ("exit_code", pa.int64()),
        ("program", pa.string()),
        ("content", pa.string()),
        ("source", pa.string()),
        ("attempts", pa.int64()),
        ("started", pa.int64()),
        ("seconds", pa.float64()),
        ("cpu_seconds", pa.float64()),
        ("replica", pa.string()),
        ("parts", pa.int64()),
        ("joints", pa.string()),
        ("confidence", pa.float64()),
        ("psnr", pa.float64()),
        ("peak_memory_mib", pa.float64()),
        ("warnings", pa.int64()),
    ]
)
"""Columns of the table; the page Python of the book says what they hold."""

NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")
"""What an id may be, as in ``artgs batch``."""

SHARE = 20.0
"""Time between two tables, divided by the time that one takes, at least."""

FILES = ("start", "end", "config", "poses")
"""Fields of a manifest that name files."""


class _Again(Exception):
    """A run that failed and may succeed later."""

    def __init__(self, row: Row) -> None:
        super().__init__(row)
        self.row = row


def reconstruct(
    manifest: str | os.PathLike[str] | Iterable[dict[str, Any]],
    out: str | os.PathLike[str],
    *,
    formats: Iterable[str] = (),
    num_cpus: float = 1,
    num_gpus: float = 0,
    memory: int | None = None,
    retries: int = 2,
    retry_failed: bool = False,
    prepare: Prepare | None = None,
    leave_out: Iterable[str] = (),
    timeout: float | None = None,
    in_flight: int = 1000,
    table_seconds: float = 10.0,
    progress: bool = True,
) -> Any:
    """Reconstructs every capture of a manifest and returns the table of results, a `pyarrow.Table` with one row for each, in the order of the manifest.

    `manifest` is a CSV, JSONL or Parquet file, or its rows: ``id``, ``start`` (a capture, or the first recording), ``end`` (the second
    recording) and options of ``artgs reconstruct``. It, its paths and `out` are local paths or URIs that fsspec opens; relative paths start at
    the folder of the manifest. Local paths must exist on every node.

    `out` gets ``replicas/ID``, with exports to `formats`, ``rows/ID.json``, and ``results.parquet``, which is replaced every
    `table_seconds`, large tables less often, and can be read meanwhile. Captures whose row is there, of the same files, options and version of artgs, are skipped, those
    that failed for a reason that remains as well unless `retry_failed`. The same call continues after the driver was killed.

    A task takes `num_cpus` (threads of a run, too), `num_gpus` and `memory` in bytes, and is repeated `retries` times if its worker or node
    is lost or the failure may not remain. `prepare` is called in the task with the id and the path of the capture before the run; nodes must be able to import it. Files of
    replicas that match a pattern of `leave_out`, such as ``"stages/*"``, are not stored. A run that takes longer than `timeout` seconds is ended and fails without a retry. At most `in_flight` tasks are known to Ray at a time.
    """
    entries = _entries(manifest)
    if not ray.is_initialized():
        ray.init(log_to_driver=False)
    options: dict[str, Any] = {"num_cpus": num_cpus, "num_gpus": num_gpus, "max_retries": retries}
    options |= {"retry_exceptions": [_Again]} | ({} if memory is None else {"memory": memory})
    task: Any = ray.remote(_task).options(**options)
    target = os.fspath(out).rstrip("/")
    if "://" not in target:
        target = os.path.abspath(target)
    threads, unwanted = max(1, int(num_cpus)), tuple(leave_out)
    waiting = iter(entries)
    running: dict[Any, str] = {}
    rows: dict[str, Row] = {}
    begun = time.monotonic()
    due = begun + table_seconds
    while True:
        while len(running) < in_flight and (entry := next(waiting, None)) is not None:
            running[task.remote(entry, target, ",".join(formats), threads, retry_failed, prepare, unwanted, timeout)] = entry["id"]
        if not running:
            break
        done, _ = ray.wait(list(running), num_returns=1, timeout=1.0)
        for reference in done:
            name = running.pop(reference)
            rows[name] = _result(reference, name, target)
        if progress and done:
            _show(rows, len(entries), time.monotonic() - begun)
        if (now := time.monotonic()) > due:
            _write_table(entries, rows, target)
            # Large tables take seconds, in which no capture is started.
            due = time.monotonic() + max(table_seconds, SHARE * (time.monotonic() - now))
    if progress:
        sys.stderr.write("\n")
    return _write_table(entries, rows, target)


def _result(reference: Any, name: str, out: str) -> Row:
    """The row of a task, or the reason why there is none."""
    try:
        row: Row = ray.get(reference)
        return row
    except ray.exceptions.RayTaskError as error:
        cause = error.cause
        if isinstance(cause, _Again):
            return cause.row
        row = _failed(name, f"{type(cause).__name__}: {cause}", retry=True)
    except ray.exceptions.RayError as error:
        row = _failed(name, f"the worker was lost: {str(error).splitlines()[0]}", retry=True)
    _write(f"{out}/rows/{name}.json", json.dumps(row).encode())
    return row


def _failed(name: str, reason: str, *, retry: bool) -> Row:
    return {"id": name, "status": "failed", "reason": reason, "retry": retry, "program": _native.__version__}


def _show(rows: dict[str, Row], count: int, seconds: float) -> None:
    failed = sum(row["status"] != "done" for row in rows.values())
    per_minute = 60.0 * len(rows) / max(seconds, 1e-9)
    sys.stderr.write(f"\r{len(rows)} of {count} captures, {failed} failed, {per_minute:.1f} per minute ")
    sys.stderr.flush()


def _write_table(entries: list[dict[str, Any]], rows: dict[str, Row], out: str) -> Any:
    ordered = [rows[entry["id"]] for entry in entries if entry["id"] in rows]
    table = pa.Table.from_pylist([{name: row.get(name) for name in SCHEMA.names} for row in ordered], schema=SCHEMA)
    buffer = io.BytesIO()
    pq.write_table(table, buffer)
    _write(f"{out}/results.parquet", buffer.getvalue())
    return table


def _write(uri: str, data: bytes) -> None:
    """Replaces a file as a whole: under another name first where that is not how files are written anyway."""
    fs, path = url_to_fs(uri)
    if isinstance(fs, LocalFileSystem):
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".", delete=False) as file:
            file.write(data)
        os.replace(file.name, target)
    else:
        fs.pipe_file(path, data)


def _entries(manifest: str | os.PathLike[str] | Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a manifest with absolute paths and without empty fields."""
    if isinstance(manifest, (str, os.PathLike)):
        uri = os.fspath(manifest)
        base = posixpath.dirname(uri)
        rows: Iterable[dict[str, Any]] = _rows(uri)
    else:
        base, rows = "", manifest
    entries: list[dict[str, Any]] = []
    seen: set[str] = set()
    for number, row in enumerate(rows):
        entry = {str(key).lower().replace("_", "-"): value for key, value in row.items() if value not in (None, "")}
        for field in ("id", "start"):
            if field not in entry:
                raise InputError(f"manifest, capture {number}: `{field}` is missing")
        for field in FILES:
            if field in entry:
                entry[field] = _absolute(base, str(entry[field]))
        entry["id"] = str(entry["id"])
        # It names files of the batch.
        if not NAME.fullmatch(entry["id"]):
            raise InputError(
                f"manifest, capture {number}: the id {entry['id']!r} must be 1 to 100 letters, digits, `-`, `_` and `.`, and not begin with `.` or `-`"
            )
        if entry["id"].lower() in seen:
            raise InputError(f"manifest: the id {entry['id']!r} is that of two captures")
        seen.add(entry["id"].lower())
        entries.append(entry)
    return entries


def _rows(uri: str) -> Iterator[dict[str, Any]]:
    with fsspec.open(uri, "rb") as file:
        data: bytes = file.read()
    kind = uri.rsplit(".", 1)[-1].lower()
    if kind == "parquet":
        yield from pq.read_table(io.BytesIO(data)).to_pylist()
    elif kind == "csv":
        yield from csv.DictReader(io.StringIO(data.decode("utf-8-sig")), skipinitialspace=True)
    elif kind in ("jsonl", "ndjson"):
        yield from (json.loads(line) for line in data.decode("utf-8-sig").splitlines() if line.strip())
    else:
        raise InputError(f"{uri}: is no manifest; its name must end in .csv, .jsonl or .parquet")


def _absolute(base: str, path: str) -> str:
    if "://" in path or os.path.isabs(path):
        return path
    return posixpath.join(base, path) if "://" in base else os.path.abspath(os.path.join(base, path))


def _task(
    entry: dict[str, Any],
    out: str,
    formats: str,
    threads: int,
    retry_failed: bool,
    prepare: Prepare | None,
    leave_out: tuple[str, ...],
    timeout: float | None,
) -> Row:
    """Makes the replica of a capture, stores it and then its row, and returns the row."""
    name = entry["id"]
    source = _source(entry, formats)
    earlier = _earlier(f"{out}/rows/{name}.json")
    if earlier is not None and earlier.get("source") == source and earlier.get("program") == _native.__version__:
        if earlier["status"] == "done" or not (earlier["retry"] or retry_failed):
            return earlier
    with tempfile.TemporaryDirectory(prefix="artgs-") as folder:
        work = Path(folder)
        try:
            local = {**entry, **_fetched(entry, work)}
        except FileNotFoundError as error:
            row = _failed(name, f"no such file: {error}", retry=False)
        else:
            if prepare is not None:
                prepare(name, str(local["start"]))
            local.setdefault("threads", threads)
            row = _run(local, work, formats, timeout)
        row["source"] = source
        if row.get("replica") is not None:
            row["replica"] = f"{out}/replicas/{name}"
            store(work / "out" / "replicas" / name, row["replica"], leave_out)
    # After the replica: a row says that it is complete.
    _write(f"{out}/rows/{name}.json", json.dumps(row).encode())
    if row["retry"]:
        raise _Again(row)
    return row


def _earlier(uri: str) -> Row | None:
    try:
        with fsspec.open(uri, "rb") as file:
            row: Row = json.loads(file.read())
            return row
    except (OSError, ValueError):
        return None


def _source(entry: dict[str, Any], formats: str) -> str:
    """Hash of names, sizes and versions of the files of a capture, and of its options; empty if they cannot be listed."""
    digest = hashlib.sha256(json.dumps([formats, {k: v for k, v in entry.items() if k not in FILES}]).encode())
    for field in FILES:
        if field not in entry:
            continue
        try:
            fs, path = url_to_fs(entry[field])
            found: dict[str, Any] = fs.find(path, detail=True)
        except OSError:
            return ""
        for file, info in sorted(found.items()):
            version = next((info[key] for key in ("ETag", "md5Hash", "etag", "mtime", "LastModified") if key in info), "")
            digest.update(json.dumps([field, file[len(path) :], info["size"], str(version)]).encode())
    return digest.hexdigest()


def _fetched(entry: dict[str, Any], work: Path) -> dict[str, str]:
    """Local paths of the files of a capture; those of other file systems are copied."""
    local: dict[str, str] = {}
    for field in FILES:
        if field in entry:
            fs, path = url_to_fs(entry[field])
            local[field] = path
            if not isinstance(fs, LocalFileSystem):
                target = work / field / posixpath.basename(path.rstrip("/"))
                target.parent.mkdir()
                fs.get(path, str(target), recursive=True)
                local[field] = str(target)
    return local


def _run(entry: dict[str, Any], work: Path, formats: str, timeout: float | None) -> Row:
    """The row of ``artgs batch`` for one capture."""
    manifest = work / "manifest.jsonl"
    manifest.write_text(json.dumps(entry) + "\n")
    words = [sys.executable, "-m", "artgs", "batch", str(manifest), "-o", str(work / "out"), "--index", "0", "--quiet"]
    words += [f"--to={formats}"] if formats else []
    with subprocess.Popen(
        words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, preexec_fn=_end_with_parent
    ) as child:
        try:
            _, errors = child.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            # It ends the run that it has started, and then itself.
            child.terminate()
            child.communicate()
            return _failed(entry["id"], f"the run took longer than {timeout:g} s", retry=False)
    file = work / "out" / "rows" / f"{entry['id']}.json"
    if file.exists():
        row: Row = json.loads(file.read_text())
        return row
    # The manifest of this task says nothing to users.
    message = errors.partition("error: ")[2].replace(f"{manifest}: line 1: ", "").strip() or f"artgs batch ended with {child.returncode}"
    row = _failed(entry["id"], message, retry=child.returncode not in (2, 70))
    return row | {"exit_code": child.returncode}


def _end_with_parent() -> None:
    """In a new process: it is ended when its parent, a worker of Ray, is killed."""
    if sys.platform == "linux":
        set_death_signal = 1
        ctypes.CDLL(None).prctl(set_death_signal, signal.SIGTERM)


def store(folder: Path, uri: str, leave_out: tuple[str, ...] = ()) -> None:
    """Copies a replica without the files that match a pattern; one that is there is replaced."""
    fs, path = url_to_fs(uri)
    if fs.exists(path):
        fs.rm(path, recursive=True)
    for file in sorted(p for p in folder.rglob("*") if p.is_file() and not p.name.startswith(".artgs.")):
        name = file.relative_to(folder).as_posix()
        if any(fnmatch(name, pattern) for pattern in leave_out):
            continue
        target = posixpath.join(path, name)
        fs.makedirs(posixpath.dirname(target), exist_ok=True)
        fs.put_file(str(file), target)
