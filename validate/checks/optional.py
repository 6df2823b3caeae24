"""Large engines: run on request, and only if they are installed."""

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from .report import DRIFT, REACHED, collect_warnings


def _lacks(report, module, packages):
    """True if a module is not installed; adds a finding then."""
    if importlib.util.find_spec(module) is not None:
        return False
    report.absent = True
    report.add("-", "not installed", None, note=f"pip install {packages}")
    return True


def check_newton(path, _states, report):
    """Opens a USD stage in Newton on the CPU: joints, limits and masses."""
    if _lacks(report, "newton", "newton warp-lang scipy newton-usd-schemas usd-core"):
        return
    import newton
    import warp

    # Warns about a missing CUDA driver on most machines, which is no error of the stage.
    warp.init()
    with collect_warnings(report):
        builder = newton.ModelBuilder()
        builder.add_usd(path)
        model = builder.finalize(device="cpu")
    lower, upper = (np.asarray(a.numpy()) for a in (model.joint_limit_lower, model.joint_limit_upper))
    report.add("-", "has joints", len(lower) > 0, len(lower), "degrees of freedom")
    report.add("-", "joints limited", bool((lower < upper).all()), note=f"{lower} to {upper}")
    masses = np.asarray(model.body_mass.numpy())
    report.add("-", "masses above 0", bool((masses > 0).all()), masses.sum(), "kg")


def check_drake(path, _states, report):
    """Opens an SDF in Drake, which reads it by the library of SDFormat itself."""
    if _lacks(report, "pydrake", "drake"):
        return
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    with collect_warnings(report):
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(path)
        plant.Finalize()
    lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
    report.add("-", "has joints", len(lower) > 0, len(lower), "degrees of freedom")
    # Drake loads screws without limits.
    report.add("-", "lower below upper", bool((lower < upper).all()), note=f"{lower} to {upper}")
    mass = plant.CalcTotalMass(plant.CreateDefaultContext())
    report.add("-", "masses above 0", mass > 0, mass, "kg")


def check_simready(path, _states, report):
    """Runs NVIDIA's SimReady validator with two versions of its profile for articulated props, a finding per feature.

    A feature that the profile requires, or that the asset claims, must pass; others are listed with what they lack.
    """
    if _lacks(report, "simready", "simready-validate simready-foundation-tier-core usd-core"):
        return
    program = str(Path(sys.executable).with_name("simready-validate"))
    for version in ("3.1.0", "4.0.0"):
        with tempfile.TemporaryDirectory() as scratch:
            answer = Path(scratch, "report.json")
            command = [program, "--profile", "Robotics-Prop", "--version", version, "--output", str(answer), path]
            done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
            if not answer.is_file():
                lines = (done.stdout + done.stderr).splitlines() or ["no output"]
                report.add(f"Robotics-Prop {version}", "runs", False, note=lines[-1])
                continue
            runs = json.loads(answer.read_text())
        (result,) = runs[-1].values() if isinstance(runs, list) else runs.values()
        for name, feature in sorted(result["features_summary"].items()):
            wanting = feature.get("failing requirements") or feature.get("optional requirements") or ""
            passed = True if feature["passed"] else False if feature.get("blocking_failure") else None
            report.add(f"Robotics-Prop {version}", f"{name} {feature['version']}", passed, note=str(wanting))
        report.add(f"Robotics-Prop {version}", "whole profile", done.returncode == 0)


def check_physx(path, _states, report):
    """Opens a USD stage in PhysX on the CPU and pushes every joint to both limits with the largest force of its drive."""
    if _lacks(report, "ovphysx", "ovphysx ovstage physx-usd-schemas newton-usd-schemas usd-core"):
        return
    import ovphysx
    import ovstage
    from ovphysx import PhysX
    from ovphysx.samples.python_samples.schema_support import physx_schema_paths
    from ovphysx.types import TensorType

    root = _articulation(path)
    PhysX.set_cpu_mode(True)
    with collect_warnings(report):
        physx = PhysX()
        schemas = [str(p) for p in physx_schema_paths()] + [str(ovphysx.newton_schema_root())]
        ovstage.population.register_usd_schemas(schemas)
        stage = ovstage.Stage("artgs-validate")
        ovstage.population.open_usd(stage, path, ordinal=1, domains=ovstage.PopulationDomain.ALL)
        stage.advance_write_floor(ordinal=1).wait()
        physx.wait_task(physx.attach_ovstage(stage, read_ordinal=1))

    def bind(name):
        kind = getattr(TensorType, f"ARTICULATION_DOF_{name}")
        return physx.create_tensor_binding(pattern=root, tensor_type=kind, raise_if_empty=True)

    bindings = {name: bind(name) for name in ("POSITION", "VELOCITY", "ACTUATION_FORCE", "LIMIT", "MAX_FORCE")}

    def read(name):
        values = np.zeros(bindings[name].shape, np.float32)
        bindings[name].read(values)
        return values[0].astype(float)

    def write(name, values):
        bindings[name].write(np.asarray(values, np.float32).reshape(bindings[name].shape))

    _push(physx, read, write, report)
    for binding in bindings.values():
        binding.destroy()
    physx.wait_task(physx.detach_ovstage())
    stage.destroy()
    physx.destroy()


def _push(physx, read, write, report, dt=1.0 / 240.0):
    limits, efforts = read("LIMIT"), read("MAX_FORCE")
    report.add(
        "-",
        "joints limited",
        bool(np.isfinite(limits).all() and (limits[:, 0] < limits[:, 1]).all()),
        len(limits),
        "joints",
    )
    rest = np.clip(np.zeros(len(limits)), limits[:, 0], limits[:, 1])
    for j, (lower, upper) in enumerate(limits):
        # PhysX reports no joint type; the smaller of the two tolerances is used.
        tolerance, drift_tolerance = REACHED["slide"], DRIFT["slide"]
        most = efforts[j] if 0 < efforts[j] < 1e6 else 100.0
        for label, sign, limit in (("upper", 1.0, upper), ("lower", -1.0, lower)):
            q = rest.copy()
            q[j] = 0.5 * (lower + upper)
            write("POSITION", q)
            write("VELOCITY", np.zeros(len(limits)))
            level, held = 0.0, []
            pace = (upper - lower) / 2.0
            for _ in range(int(10.0 / dt)):
                speed = read("VELOCITY")[j]
                level = float(np.clip(level + most / (pace * 2.0) * (pace - sign * speed) * dt, 0.0, most))
                force = np.zeros(len(limits))
                force[j] = sign * level
                write("ACTUATION_FORCE", force)
                physx.step_sync(dt)
                value = read("POSITION")[j]
                if abs(value - limit) <= tolerance:
                    held.append(value)
                if len(held) * dt >= 1.0:
                    break
            off = abs(read("POSITION")[j] - limit)
            report.add(
                f"joint {j}", f"reaches {label}", off <= tolerance, off, "rad or m", f"at most {most:.3g} N or N m"
            )
            if held:
                tail = held[len(held) // 2 :]
                drift = max(tail) - min(tail)
                report.add(f"joint {j}", f"holds {label}", drift <= drift_tolerance, drift, "rad or m")


def _articulation(path):
    from pxr import Usd, UsdPhysics

    stage = Usd.Stage.Open(path)
    roots = [str(p.GetPath()) for p in stage.Traverse() if p.HasAPI(UsdPhysics.ArticulationRootAPI)]
    if len(roots) != 1:
        raise ValueError(f"{len(roots)} articulation roots, expected one")
    return roots[0]
