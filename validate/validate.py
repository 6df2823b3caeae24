#!/usr/bin/env python3
"""Opens exported replicas in MuJoCo, PyBullet, SAPIEN and usd-core, drives every joint, and reports failures.

Each check runs in its own process, so that a crash of one engine does not stop the others.
Exit code 0: all passed; 3: a check failed; 2: wrong command.
"""

import argparse
import json
import signal
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

# (engine, module, function, pattern below FOLDER). `CHECKS` always run, `ON_REQUEST` only with their option.
CHECKS = [
    ("mujoco", "in_mujoco", "check_mjcf", "mjcf/*.xml"),
    ("mujoco", "in_mujoco", "check_scene", "mjcf/scene.xml"),
    ("mujoco", "in_mujoco", "check_urdf", "urdf/*.urdf"),
    ("gymnasium", "in_gymnasium", "check_environment", "mjcf/env.py"),
    ("pybullet", "in_pybullet", "check_urdf", "urdf/*.urdf"),
    ("sapien", "in_sapien", "check_urdf", "urdf/*.urdf"),
    ("sapien", "in_sapien", "check_urdf", "partnet/mobility.urdf"),
    ("usd-core", "in_usd", "check_usd", "usd/*.usd*"),
    ("usd-core", "in_usd", "check_scene", "usd/scene.usda"),
    ("usd-core", "in_usd", "check_variants", "simready/*/simready_usd/*.usda"),
    ("xml", "in_xml", "check_sdf", "sdf/model.sdf"),
]
ON_REQUEST = [
    ("physx", "optional", "check_physx", "usd/*.usd*"),
    ("newton", "optional", "check_newton", "usd/*.usd*"),
    ("simready", "optional", "check_simready", "simready/*/simready_usd/*.usda"),
    ("drake", "optional", "check_drake", "sdf/model.sdf"),
]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "folders", nargs="+", metavar="FOLDER", type=Path, help="holds urdf/, mjcf/, usd/, simready/, sdf/, partnet/"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write every finding as JSON")
    parser.add_argument("--engine", action="append", metavar="NAME", help="only this engine; may be repeated")
    parser.add_argument("--all", action="store_true", help="also list passed checks")
    parser.add_argument(
        "--timeout", type=float, default=900.0, metavar="SECONDS", help="for each file and engine (900)"
    )
    for name, *_ in ON_REQUEST:
        parser.add_argument(f"--{name}", action="store_true", help=f"also run {name}, if it is installed")
    return parser.parse_args()


def main():
    if len(sys.argv) > 1 and sys.argv[1] == "--worker":
        return work(*sys.argv[2:])
    args = arguments()
    checks = CHECKS + [c for c in ON_REQUEST if getattr(args, c[0])]
    known = sorted({c[0] for c in checks})
    unknown = [e for e in args.engine or [] if e not in known]
    if unknown:
        print(f"no engine {', '.join(unknown)}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    checks = [c for c in checks if not args.engine or c[0] in args.engine]
    results = []
    for folder in args.folders:
        # A scene shows another file; only checks that name it open it.
        found = [(c, p) for c in checks for p in sorted(folder.glob(c[3])) if p.stem != "scene" or "/scene." in c[3]]
        if not found:
            print(f"{folder}: holds no exports; expected one of {', '.join(c[3] for c in checks)}", file=sys.stderr)
            return 2
        for check, path in found:
            result = isolated(check, folder, path, args.timeout)
            results.append(dict(folder=str(folder), **result))
            print_result(results[-1], args.all)
    if args.json:
        args.json.write_text(json.dumps(results, indent=1) + "\n")
    failed = [r for r in results if r["passed"] is False]
    absent = [r for r in results if r["passed"] is None]
    run = len(results) - len(absent)
    print(f"{run - len(failed)} of {run} passed" + (f", {len(absent)} not run" if absent else ""))
    return 3 if failed else 0


def isolated(check, folder, path, timeout):
    """The data of a report, computed in a separate process."""
    engine = check[0]
    with tempfile.TemporaryDirectory() as scratch:
        answer = Path(scratch, "report.json")
        command = [
            sys.executable,
            str(Path(__file__).resolve()),
            "--worker",
            *check[:3],
            str(folder.resolve()),
            str(path.resolve()),
            str(answer),
        ]
        try:
            # Some engines write logs into the working directory.
            done = subprocess.run(command, cwd=scratch, capture_output=True, text=True, timeout=timeout, check=False)
        except subprocess.TimeoutExpired:
            return failure(engine, path, f"not done after {timeout:.0f} s")
        if answer.is_file():
            return json.loads(answer.read_text())
        code = done.returncode
        reason = f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return failure(engine, path, f"{reason}: {' | '.join(done.stderr.strip().splitlines()[-3:])}")


def failure(engine, path, note):
    finding = {"subject": "-", "check": "opens", "passed": False, "value": None, "unit": "", "note": note}
    return {"engine": engine, "file": str(path), "passed": False, "findings": [finding]}


def work(engine, module, function, folder, path, answer):
    """Runs one check and writes its report to a file."""
    from checks.report import Report
    from checks.states import observed_states, partnet_states

    report = Report(engine, path)
    try:
        states = observed_states(folder)
        if Path(path).parent.name == "partnet":
            states = partnet_states(folder, states)
        loaded = __import__(f"checks.{module}", fromlist=[function])
        getattr(loaded, function)(path, states, report)
    except ModuleNotFoundError as error:
        report.add("-", "opens", False, note=f"{error}; pip install -r validate/requirements.txt")
    except Exception as error:  # Any exception of an engine is a finding.
        last = traceback.extract_tb(error.__traceback__)[-1]
        report.add(
            "-", "opens", False, note=f"{type(error).__name__}: {error} ({Path(last.filename).name}:{last.lineno})"
        )
    Path(answer).write_text(json.dumps(report.data()))
    return 0


def print_result(result, everything):
    """A heading, failed checks, and a row per joint with its worst values."""
    file = Path(result["file"])
    mark = {True: "ok  ", False: "FAIL", None: "--  "}[result["passed"]]
    print(f"{mark} {result['engine']:9} {file.parent.name}/{file.name}  ({result['folder']})")
    for finding in result["findings"]:
        note = f"  {finding['note']}" if finding["note"] else ""
        value = "" if finding["value"] is None else f"{finding['value']:.4g} {finding['unit']}".strip()
        failed = finding["passed"] is False
        info = finding["passed"] is None
        if failed or everything or (info and finding["value"] is None):
            mark = "FAIL" if failed else "info" if info else "ok"
            print(f"       {mark:4} {finding['subject']:20} {finding['check']:34} {value:14}{note}")
    if not everything:
        print_joints(result)


def print_joints(result):
    rows = {}
    for finding in result["findings"]:
        if finding["value"] is not None and finding["passed"] is not None and finding["subject"] != "-":
            rows.setdefault(finding["subject"], {})[finding["check"]] = finding
    columns = [("limits off", "reaches"), ("drift", "holds"), ("states off", "visits"), ("penetration", "penetration")]
    for joint, found in rows.items():
        cells = [f"{label} {worst(found, prefix)}" for label, prefix in columns if worst(found, prefix)]
        if cells:
            print(f"            {joint:20} {', '.join(cells)}")


def worst(found, prefix):
    """The largest value among the checks of a joint whose names start with `prefix`."""
    values = [f for check, f in found.items() if check.startswith(prefix)]
    top = max(values, key=lambda f: f["value"], default=None)
    return "" if top is None else f"{top['value']:.2e} {top['unit']}"


if __name__ == "__main__":
    sys.exit(main())
