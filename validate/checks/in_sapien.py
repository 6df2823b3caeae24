"""URDF and the PartNet-Mobility folder in SAPIEN, physics only."""

import numpy as np
import sapien
from sapien import physx

from .drive import check_motion
from .report import collect_warnings

# Bandwidth of the drives, 1/s; they are implicit, so it may exceed that of a step.
RATE = 100.0


class Engine:
    """An articulation with the interface of `drive`."""

    def __init__(self, scene, articulation):
        self.scene, self.body = scene, articulation
        self.model = articulation.create_pinocchio_model()
        joints = articulation.get_active_joints()
        self.active, self.driven = joints, False
        self.names = [j.name for j in joints]
        self.kinds = ["slide" if j.type == "prismatic" else "hinge" for j in joints]
        self.lower, self.upper = articulation.get_qlimits().astype(float).T
        self.effort = np.full(len(joints), np.inf)
        self.damping = np.array([float(j.damping) for j in joints])
        # The loader ignores the friction of a URDF. PhysX gives all joints one coefficient, which it multiplies by the
        # load, here the weight that a joint carries.
        self.friction = np.array([float(j.friction) * 9.81 * self._carried(j.child_link) for j in joints])
        self.dt = scene.get_timestep()
        articulation.set_sleep_threshold(0.0)

    def _carried(self, link):
        below = [j.child_link for j in self.body.joints if j.parent_link == link]
        return link.mass + sum(self._carried(other) for other in below)

    def set(self, q, v=None):
        self.body.set_qpos(np.asarray(q, np.float32))
        self.body.set_qvel(np.zeros(len(q), np.float32) if v is None else np.asarray(v, np.float32))

    def get(self):
        return self.body.get_qpos().astype(float), self.body.get_qvel().astype(float)

    def gravity(self, q):
        return self._at(q, lambda: self.body.compute_passive_force(True, False).astype(float).reshape(-1))

    def inertia(self, q):
        return np.diag(self.model.compute_generalized_mass_matrix(np.asarray(q, float))).copy()

    def _at(self, q, ask):
        kept = self.get()
        if np.array_equal(kept[0], q) and not kept[1].any():
            return ask()
        self.set(q)
        answer = ask()
        self.set(*kept)
        return answer

    def _drive(self, on):
        if self.driven == on:
            return
        inertia = self.inertia(self.get()[0])
        for joint, m, damping, effort in zip(self.active, inertia, self.damping, self.effort):
            # The loader turns the damping of a URDF into a drive without stiffness.
            stiffness = float(m) * RATE**2 if on else 0.0
            limit = float(effort) if on and np.isfinite(effort) else 3.4e38
            joint.set_drive_properties(stiffness, float(damping + on * 2.0 * m * RATE), limit, "force")
        self.driven = on

    def follow(self, target):
        self._drive(True)
        for joint, value in zip(self.active, target):
            joint.set_drive_target(float(value))
        self.body.set_qf(self.gravity(self.get()[0]).astype(np.float32))
        self.scene.step()

    def step(self, tau):
        self._drive(False)
        self.body.set_qf(np.asarray(tau, np.float32))
        self.scene.step()

    def contacts(self, q):
        kept = self.get()
        self.set(q)
        self.body.set_qf(np.zeros(len(q), np.float32))
        # Contacts are computed at the start of a step; a short step moves nothing.
        self.scene.set_timestep(1e-6)
        self.scene.step()
        self.scene.set_timestep(self.dt)
        depths = {}
        for contact in self.scene.get_contacts():
            pair = tuple(sorted(b.entity.name for b in contact.bodies))
            depth = max((-p.separation for p in contact.points), default=None)
            if depth is not None:
                depths[pair] = max(depths.get(pair, -np.inf), depth)
        self.set(*kept)
        # Contacts with the parent are filtered out before they are measured.
        return depths, None


def _load(path, report):
    scene = sapien.Scene([physx.PhysxCpuSystem()])
    with collect_warnings(report):
        loader = scene.create_urdf_loader()
        loader.fix_root_link = True
        # As ManiSkill does for PartNet-Mobility.
        loader.load_multiple_collisions_from_file = "partnet" in path
        builder = loader.load_file_as_articulation_builder(path)
        for link in builder.link_builders:
            # Visuals need a renderer.
            link.visual_records = []
        return scene, builder.build()


def check_urdf(path, states, report):
    """Opens, drives and sweeps a URDF, also that of a PartNet folder."""
    scene, articulation = _load(path, report)
    if articulation.dof == 0:
        report.add("-", "has joints", False)
        return
    engine = Engine(scene, articulation)
    effort = _efforts(path)
    engine.effort = np.array([effort.get(name, np.inf) for name in engine.names])
    limits = np.isfinite(articulation.get_qlimits())
    report.add("-", "joints limited", limits.all(), len(engine.names), "joints")
    masses = [link.mass for link in articulation.links[1:]]
    report.add("-", "masses above 0", min(masses) > 0, sum(masses), "kg")
    check_motion(engine, states, report)


def _efforts(path):
    """Efforts of a URDF, which SAPIEN does not load."""
    from xml.etree import ElementTree

    joints = ElementTree.parse(path).getroot().iterfind("joint")
    found = ((j.get("name"), j.find("limit")) for j in joints)
    return {name: float(limit.get("effort", "inf")) for name, limit in found if limit is not None}
