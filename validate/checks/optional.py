"""Engines that are large or need more than a CPU wheel: run on request, and only if installed."""

import importlib.util
import subprocess

from .report import listening


def check_newton(path, _states, report):
    """Opens a USD stage in Newton; compares nothing, but it must have joints and finite limits."""
    if importlib.util.find_spec("newton") is None:
        report.add("-", "not installed", None, note="pip install newton warp-lang newton-usd-schemas")
        return
    import newton
    import numpy as np

    with listening(report):
        builder = newton.ModelBuilder()
        builder.add_usd(path)
        model = builder.finalize(device="cpu")
    lower, upper = (np.asarray(a.numpy()) for a in (model.joint_limit_lower, model.joint_limit_upper))
    report.add("-", "has joints", len(lower) > 0, len(lower), "degrees of freedom")
    report.add("-", "joints limited", bool((lower < upper).all()), note=f"{lower} to {upper}")
    masses = np.asarray(model.body_mass.numpy())
    report.add("-", "masses above 0", bool((masses > 0).all()), masses.sum(), "kg")


def check_physx(path, _states, report):
    """Opens a USD stage in PhysX on the CPU and steps it for a second."""
    if importlib.util.find_spec("ovphysx") is None:
        report.add("-", "not installed", None, note="pip install ovphysx ovstage physx-usd-schemas newton-usd-schemas")
        return
    from ovphysx import PhysX

    with listening(report):
        engine = PhysX(device="cpu")
        engine.add_usd(path)
        engine.wait_all()
        for i in range(60):
            engine.step(1.0 / 60.0, i / 60.0)
        engine.wait_all()
    report.add("-", "opens and steps", True)


def check_simready(path, _states, report):
    """Runs NVIDIA's SimReady validator with the profile for articulated props."""
    if importlib.util.find_spec("simready") is None and importlib.util.find_spec("simready_validate") is None:
        report.add("-", "not installed", None, note="pip install simready-validate simready-foundation-tier-core")
        return
    command = ["simready-validate", "--profile", "Robotics-Prop", path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    lines = (done.stdout + done.stderr).strip().splitlines()
    report.add("-", "Robotics-Prop", done.returncode == 0, note=" | ".join(lines[-5:]))
