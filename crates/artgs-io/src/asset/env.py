"""Gymnasium environment of this replica: open one of its parts by a force at its handle.

    import gymnasium, env                       # in the folder of this file; needs gymnasium and mujoco
    task = env.OpenPart(joint="door_joint", render_mode="rgb_array")

`make_env` is what LeRobot's EnvHub calls: a suite with one task for each joint.
"""

from pathlib import Path

import gymnasium as gym
import mujoco
import numpy as np

SCENE = Path(__file__).resolve().parent / "scene.xml"


def joints(model):
    """Names of the joints that a task can open; the slide of a screw follows its hinge."""
    names = [model.joint(j).name for j in range(model.njnt) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]
    return [name for name in names if not name.endswith("_thread")]


class OpenPart(gym.Env):
    """One part is closed and is to be opened.

    Action: force at the handle, or at the centre of mass of a part without one, in world axes; 1 is `force` newtons. Observation: opened
    share of every joint (0 at the lower limit, 1 at the upper one), speeds in shares per second, and the place where the force acts,
    metres; with `obs_type="pixels_agent_pos"` also what the camera `front` sees. Reward: the share by which a step opened the part, and 1
    when it is open. The task ends when the part is open by `goal`, or after `limit` steps.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 25}

    def __init__(self, joint=None, obs_type="state", render_mode=None, force=30.0, goal=0.9, limit=250, size=(320, 240)):
        self.model = mujoco.MjModel.from_xml_path(str(SCENE))
        self.data = mujoco.MjData(self.model)
        self.names = joints(self.model)
        if joint is not None and joint not in self.names:
            raise ValueError(f"no joint is called {joint!r}; there are {', '.join(self.names)}")
        if obs_type not in ("state", "pixels_agent_pos"):
            raise ValueError(f"obs_type is {obs_type!r}; it must be 'state' or 'pixels_agent_pos'")
        self.joint, self.obs_type, self.render_mode = joint, obs_type, render_mode
        self.force, self.goal, self.limit, self.size = force, goal, limit, size
        self.skip = max(1, round(1.0 / self.metadata["render_fps"] / self.model.opt.timestep))
        ids = [self.model.joint(name).id for name in self.names]
        self.places, self.speeds = self.model.jnt_qposadr[ids], self.model.jnt_dofadr[ids]
        self.lower, self.range = self.model.jnt_range[ids, 0], np.ptp(self.model.jnt_range[ids], axis=1)
        self.action_space = gym.spaces.Box(-1.0, 1.0, (3,), np.float32)
        state = gym.spaces.Box(-np.inf, np.inf, (2 * len(ids) + 3,), np.float64)
        pixels = gym.spaces.Box(0, 255, (size[1], size[0], 3), np.uint8)
        both = gym.spaces.Dict({"pixels": pixels, "agent_pos": state})
        self.observation_space = state if obs_type == "state" else both
        self.renderer, self.task, self.count = None, 0, 0

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        key = self.model.key("closed").id
        mujoco.mj_resetDataKeyframe(self.model, self.data, key)
        self.task = self.names.index(self.joint) if self.joint else int(self.np_random.integers(len(self.names)))
        self.body = self.model.jnt_bodyid[self.model.joint(self.names[self.task]).id]
        sites = np.flatnonzero(self.model.site_bodyid == self.body)
        self.site, self.count = (sites[0] if len(sites) else None), 0
        mujoco.mj_forward(self.model, self.data)
        return self._observation(), self._info()

    def step(self, action):
        before, self.count = self._opened()[self.task], self.count + 1
        force = self.force * np.clip(np.asarray(action, float), -1.0, 1.0)
        for _ in range(self.skip):
            self.data.qfrc_applied[:] = 0.0
            mujoco.mj_applyFT(
                self.model, self.data, force, np.zeros(3), self._place(), self.body, self.data.qfrc_applied
            )
            mujoco.mj_step(self.model, self.data)
        opened = self._opened()[self.task]
        done = bool(opened >= self.goal)
        return self._observation(), float(opened - before + done), done, self.count >= self.limit, self._info()

    def render(self):
        if self.renderer is None:
            self.renderer = mujoco.Renderer(self.model, height=self.size[1], width=self.size[0])
        self.renderer.update_scene(self.data, camera="front")
        return self.renderer.render()

    def close(self):
        if self.renderer is not None:
            self.renderer.close()
            self.renderer = None

    def _place(self):
        return self.data.xipos[self.body] if self.site is None else self.data.site_xpos[self.site]

    def _opened(self):
        return (self.data.qpos[self.places] - self.lower) / self.range

    def _observation(self):
        state = np.concatenate([self._opened(), self.data.qvel[self.speeds] / self.range, self._place()])
        return state if self.obs_type == "state" else {"pixels": self.render(), "agent_pos": state}

    def _info(self):
        opened = float(self._opened()[self.task])
        return {"joint": self.names[self.task], "opened": opened, "is_success": opened >= self.goal}


def make_env(n_envs=1, use_async_envs=False, cfg=None):
    """{suite: {task: vector environment}}, one task for each joint."""
    vector = gym.vector.AsyncVectorEnv if use_async_envs else gym.vector.SyncVectorEnv

    def made(name):
        return lambda: OpenPart(joint=name, obs_type="pixels_agent_pos", render_mode="rgb_array")

    names = joints(mujoco.MjModel.from_xml_path(str(SCENE)))
    return {"open_part": {task: vector([made(name)] * n_envs) for task, name in enumerate(names)}}
