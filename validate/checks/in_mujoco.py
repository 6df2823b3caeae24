"""MJCF in MuJoCo; also opens the URDF."""

from pathlib import Path

import mujoco
import numpy as np

from .drive import check_motion
from .drop import CELL, LEAST, RADIUS, TIME, places, report_drops
from .fingers import HALF, fingers, report_fingers, turned_to
from .fingers import RADIUS as FINGER
from .report import collect_warnings

# Bandwidth of the servo, 1/s.
RATE = 15.0


class Engine:
    """A model with the interface of `drive`. The slide of a screw follows its hinge by an equality constraint."""

    def __init__(self, model, lifted):
        self.model, self.data = model, mujoco.MjData(model)
        self.lifted, self.lifted_data = lifted, mujoco.MjData(lifted)
        follows = {}
        for e in range(model.neq):
            if model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj2id[e] >= 0:
                follows[model.eq_obj1id[e]] = (model.eq_obj2id[e], model.eq_data[e, 0], model.eq_data[e, 1])
        self.joints = [j for j in range(model.njnt) if j not in follows]
        of = {j: i for i, j in enumerate(self.joints)}
        self.offset = np.zeros(model.njnt)
        # Positions of all joints are offset + coupling @ q; every joint has one degree of freedom.
        self.coupling = np.zeros((model.njnt, len(self.joints)))
        for j in range(model.njnt):
            leader, start, rate = follows.get(j, (j, 0.0, 1.0))
            self.offset[j] = start
            self.coupling[j, of[leader]] = rate
        self.names = [model.joint(j).name for j in self.joints]
        hinge = mujoco.mjtJoint.mjJNT_HINGE
        self.kinds = ["hinge" if model.jnt_type[j] == hinge else "slide" for j in self.joints]
        self.lower, self.upper = model.jnt_range[self.joints].T.copy()
        limited = model.jnt_actfrclimited[self.joints].astype(bool)
        self.effort = np.where(limited, model.jnt_actfrcrange[self.joints, 1], np.inf)
        self.damping = model.dof_damping[self.joints].reshape(len(self.joints), -1)[:, 0]
        self.friction = model.dof_frictionloss[self.joints]
        self.dt = model.opt.timestep
        self.probe = mujoco.MjData(model)
        self.missed = np.zeros(len(self.joints))

    def set(self, q, v=None):
        self.data.qpos[:] = self.offset + self.coupling @ q
        self.data.qvel[:] = 0.0 if v is None else self.coupling @ v
        self.missed[:] = 0.0

    def get(self):
        return self.data.qpos[self.joints].copy(), self.data.qvel[self.joints].copy()

    def _at(self, q):
        self.probe.qpos[:] = self.offset + self.coupling @ q
        self.probe.qvel[:] = 0.0
        mujoco.mj_kinematics(self.model, self.probe)
        mujoco.mj_comPos(self.model, self.probe)
        mujoco.mj_comVel(self.model, self.probe)

    def gravity(self, q):
        self._at(q)
        bias = np.zeros(self.model.nv)
        mujoco.mj_rne(self.model, self.probe, 0, bias)
        return self.coupling.T @ bias

    def inertia(self, q):
        self._at(q)
        mujoco.mj_crb(self.model, self.probe)
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.probe, full)
        return np.diag(self.coupling.T @ full @ self.coupling).copy()

    def step(self, tau):
        # The slide of a screw is moved by its hinge.
        self.data.qfrc_applied[:] = 0.0
        self.data.qfrc_applied[self.joints] = tau
        mujoco.mj_step(self.model, self.data)

    def follow(self, target):
        q, v = self.get()
        error, inertia = target - q, self.inertia(q)
        self.missed += error * self.dt
        # Damping resists the motion of a light part more than inertia; the stiffness must overcome both.
        stiff = np.maximum(inertia, self.damping / RATE)
        tau = self.gravity(q) + stiff * (RATE**2 * error + RATE**3 / 3.0 * self.missed) - 2.0 * RATE * inertia * v
        tau += self.friction * np.tanh(error / 1e-3)
        self.step(np.clip(tau, -self.effort, self.effort))

    def contacts(self, q):
        resisted = self._depths(self.model, self.probe, q)
        every = self._depths(self.lifted, self.lifted_data, q)
        return resisted, {pair: depth for pair, depth in every.items() if pair not in resisted}

    def _depths(self, model, data, q):
        data.qpos[:] = self.offset + self.coupling @ q
        data.qvel[:] = 0.0
        mujoco.mj_fwdPosition(model, data)
        depths = {}
        for contact in data.contact:
            bodies = [model.body(model.geom_bodyid[g]).name for g in contact.geom]
            pair = tuple(sorted(bodies))
            depths[pair] = max(depths.get(pair, 0.0), -contact.dist)
        return depths


def check_mjcf(path, states, report):
    """Opens, drives and sweeps an MJCF."""
    with collect_warnings(report):
        model = mujoco.MjModel.from_xml_path(path)
        spec = mujoco.MjSpec.from_file(path)
        for exclude in list(spec.excludes):
            spec.delete(exclude)
        lifted = spec.compile()
    engine = Engine(model, lifted)
    if not engine.names:
        report.add("-", "has joints", False)
        return
    limited = model.jnt_limited[engine.joints].astype(bool)
    report.add("-", "joints limited", limited.all(), limited.sum(), "joints")
    with collect_warnings(report):
        check_motion(engine, states, report)
        _drop(path, report)
        _fingers(path, report)
    counts = {mujoco.mjtWarning(i).name: w.number for i, w in enumerate(engine.data.warning) if w.number}
    report.add("-", "simulates without warnings", not counts, note=str(counts or ""))


def check_scene(path, _states, report):
    """Opens the scene, and looks at the object with its camera at the keyframes of the limits."""
    with collect_warnings(report):
        model = mujoco.MjModel.from_xml_path(path)
    data, camera = mujoco.MjData(model), model.camera("front")
    slope = np.tan(np.radians(0.5 * camera.fovy[0]))
    for name, end in (("closed", 0), ("open", 1)):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        mujoco.mj_forward(model, data)
        joints = [j for j in range(model.njnt) if model.jnt_limited[j]]
        error = max(abs(data.qpos[model.jnt_qposadr[j]] - model.jnt_range[j, end]) for j in joints)
        report.add(name, "at the limits", error < 1e-9, error)
        drawn = np.flatnonzero((model.geom_group == 2) & (model.geom_bodyid > 0))
        back = data.cam_xmat[camera.id].reshape(3, 3)
        seen = (data.geom_xpos[drawn] - data.cam_xpos[camera.id]) @ back
        inside = np.abs(seen[:, :2]) < slope * -seen[:, 2:]
        report.add(name, "camera shows every part", inside.all(), inside.all(axis=1).sum(), f"of {len(drawn)} meshes")


def _with_body(path, **geom):
    """The model of an MJCF with one more, free body, the number of this body, and the address of its position."""
    spec = mujoco.MjSpec.from_file(path)
    # Keyframes do not know the body.
    for key in list(spec.keys):
        spec.delete(key)
    body = spec.worldbody.add_body(name="tested_body")
    body.add_freejoint()
    body.add_geom(mass=0.02, **geom)
    model = spec.compile()
    body = model.body("tested_body")
    return model, body.id, model.joint(body.jntadr[0]).qposadr[0]


def _drop(path, report):
    """Drops a ball onto every flat place of the URDF beside the MJCF, if there is one."""
    urdf = next(iter(sorted(Path(path).parent.parent.glob("urdf/*.urdf"))), None)
    wanted = [] if urdf is None else places(urdf)
    if not wanted:
        return
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    model, _, at = _with_body(path, type=sphere, size=[RADIUS, 0, 0], condim=6, friction=[0.6, 5e-3, 1e-3])
    data, found = mujoco.MjData(model), []
    for place in wanted:
        mujoco.mj_resetData(model, data)
        values = {model.joint(name).qposadr[0]: value for name, value in place.values.items()}
        data.qpos[at : at + 3] = place.start
        low = np.inf
        for _ in range(int(TIME / model.opt.timestep)):
            for address, value in values.items():
                data.qpos[address] = value
            mujoco.mj_step(model, data)
            # A ball that rolls off the place may fall there.
            if np.abs(data.qpos[at : at + 2] - place.start[:2]).max() <= LEAST // 2 * CELL:
                low = min(low, data.qpos[at + 2])
        found.append((place, low))
    report_drops(found, report)


def _fingers(path, report):
    """Puts a finger behind every handle, joints at 0, without simulating."""
    urdf = next(iter(sorted(Path(path).parent.parent.glob("urdf/*.urdf"))), None)
    wanted = [] if urdf is None else fingers(urdf)
    if not wanted:
        return
    model, own, at = _with_body(path, type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[FINGER, HALF, 0])
    data, found = mujoco.MjData(model), []
    for finger in wanted:
        data.qpos[:] = 0.0
        data.qpos[at : at + 3], data.qpos[at + 3 : at + 7] = finger.middle, turned_to(finger.along)
        mujoco.mj_fwdPosition(model, data)
        touched = [c.dist for c in data.contact if own in (model.geom_bodyid[c.geom[0]], model.geom_bodyid[c.geom[1]])]
        found.append((finger, max([0.0] + [-dist for dist in touched])))
    report_fingers(found, report)


def check_urdf(path, _states, report):
    """Opens a URDF; the MJCF is the file to simulate."""
    with collect_warnings(report):
        model = mujoco.MjModel.from_xml_path(path)
    report.add("-", "has joints", model.njnt > 0, model.njnt, "joints")
    report.add("-", "joints limited", model.jnt_limited.all(), model.jnt_limited.sum(), "joints")
    moving = model.body_mass[1:]
    report.add("-", "masses above 0", (moving > 0).all(), moving.sum(), "kg")
