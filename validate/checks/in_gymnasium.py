"""The Gymnasium environment beside the MJCF."""

import importlib.util

import mujoco
import numpy as np
from gymnasium.utils.env_checker import check_env

from .report import collect_warnings

# Newtons of the pull; parts of furniture move by less than half of it.
FORCE = 60.0


def check_environment(path, _states, report):
    """Runs Gymnasium's own checks, and opens every part by a pull along its motion."""
    spec = importlib.util.spec_from_file_location("env", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    suite = module.OpenPart()
    check_env(suite, skip_render_check=True)
    with collect_warnings(report):
        for name in suite.names:
            opened, steps = _opened(module.OpenPart(joint=name, force=FORCE))
            report.add(name, "opens", opened >= 0.9, opened, "of its range", note=f"{steps} steps")


def _opened(env):
    """Share by which a part opens, and the steps it takes, if it is pulled where its handle would go next."""
    env.reset(seed=0)
    done = ended = False
    info, steps = {"opened": 0.0}, 0
    while not (done or ended):
        jacobian = np.zeros((3, env.model.nv))
        mujoco.mj_jac(env.model, env.data, jacobian, None, env._place(), env.body)
        along = jacobian[:, env.speeds[env.task]]
        action = along / max(np.linalg.norm(along), 1e-9)
        _, _, done, ended, info = env.step(action)
        steps += 1
    return info["opened"], steps
