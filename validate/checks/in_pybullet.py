"""URDF in PyBullet."""

import numpy as np
import pybullet as bullet

from .drive import check_motion
from .drop import CELL, LEAST, RADIUS, TIME, places, report_drops
from .fingers import HALF, fingers, report_fingers, turned_to
from .fingers import RADIUS as FINGER
from .report import collect_warnings

# By default Bullet keeps a contact until its pieces have moved by 2 cm beside it: edges that pass each other within a few
# millimetres then stop a drawer that has room. With 2 mm a ball that falls by 2 mm per step passes a thin floor.
BREAKING = 0.005


class Engine:
    """A loaded robot with the interface of `drive`."""

    def __init__(self, client, body, path):
        self.client, self.body = client, body
        # The inverse dynamics of PyBullet fails if rounding leaves an inertia asymmetric by 1e-15. Loads of joints are
        # computed with a second copy that has inertias of boxes: accurate enough to choose forces.
        self.models = bullet.connect(bullet.DIRECT)
        bullet.setGravity(0.0, 0.0, -9.81, self.models)
        self.model = bullet.loadURDF(path, useFixedBase=True, physicsClientId=self.models)
        infos = [bullet.getJointInfo(body, i, client) for i in range(bullet.getNumJoints(body, client))]
        self.links = [bullet.getBodyInfo(body, client)[0].decode()] + [i[12].decode() for i in infos]
        self.parents = {i[0]: i[16] for i in infos}
        moving = [i for i in infos if i[2] in (bullet.JOINT_REVOLUTE, bullet.JOINT_PRISMATIC)]
        self.joints = [i[0] for i in moving]
        self.names = [i[1].decode() for i in moving]
        self.kinds = ["hinge" if i[2] == bullet.JOINT_REVOLUTE else "slide" for i in moving]
        self.lower, self.upper = (np.array([i[k] for i in moving]) for k in (8, 9))
        self.effort = np.array([i[10] for i in moving])
        self.damping = np.array([i[6] for i in moving])
        self.friction = np.array([i[7] for i in moving])
        self.dt = bullet.getPhysicsEngineParameters(client)["fixedTimeStep"]
        self.braked = False
        for joint in self.joints:
            bullet.changeDynamics(
                body, joint, activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING, physicsClientId=client
            )

    def set(self, q, v=None):
        v = np.zeros(len(q)) if v is None else v
        for joint, position, speed in zip(self.joints, q, v):
            bullet.resetJointState(self.body, joint, position, speed, self.client)

    def get(self):
        states = bullet.getJointStates(self.body, self.joints, self.client)
        return np.array([s[0] for s in states]), np.array([s[1] for s in states])

    def gravity(self, q):
        zero = [0.0] * len(q)
        return np.array(bullet.calculateInverseDynamics(self.model, list(q), zero, zero, physicsClientId=self.models))

    def inertia(self, q):
        return np.diag(np.array(bullet.calculateMassMatrix(self.model, list(q), physicsClientId=self.models))).copy()

    def step(self, tau):
        if not self.braked:
            # PyBullet reads the friction of a URDF but applies it with a braking motor; the default motor would hold the joint.
            bullet.setJointMotorControlArray(
                self.body,
                self.joints,
                bullet.VELOCITY_CONTROL,
                targetVelocities=[0.0] * len(self.joints),
                forces=self.friction.tolist(),
                physicsClientId=self.client,
            )
            self.braked = True
        bullet.setJointMotorControlArray(
            self.body, self.joints, bullet.TORQUE_CONTROL, forces=list(map(float, tau)), physicsClientId=self.client
        )
        bullet.stepSimulation(self.client)

    def follow(self, target):
        bullet.setJointMotorControlArray(
            self.body,
            self.joints,
            bullet.POSITION_CONTROL,
            targetPositions=target.tolist(),
            forces=self.effort.tolist(),
            physicsClientId=self.client,
        )
        self.braked = False
        bullet.stepSimulation(self.client)

    def contacts(self, q):
        kept = self.get()
        self.set(q)
        resisted, ignored = {}, {}
        for a in range(-1, len(self.links) - 1):
            for b in range(a + 1, len(self.links) - 1):
                near = bullet.getClosestPoints(self.body, self.body, 0.0, a, b, physicsClientId=self.client)
                depth = max((-point[8] for point in near), default=None)
                if depth is not None:
                    related = self.parents.get(b) == a or self.parents.get(a) == b
                    (ignored if related else resisted)[self.links[a + 1], self.links[b + 1]] = depth
        self.set(*kept)
        return resisted, ignored


def _drop(path, client, body, engine, report):
    """Drops a ball onto every flat place."""
    found = []
    for place in places(path):
        q = np.clip(np.array([place.values.get(name, 0.0) for name in engine.names]), engine.lower, engine.upper)
        shape = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=RADIUS, physicsClientId=client)
        ball = bullet.createMultiBody(0.02, shape, basePosition=place.start.tolist(), physicsClientId=client)
        bullet.changeDynamics(
            ball, -1, rollingFriction=1e-3, ccdSweptSphereRadius=0.5 * RADIUS, physicsClientId=client
        )
        low = np.inf
        for _ in range(int(TIME / engine.dt)):
            engine.set(q)
            bullet.stepSimulation(client)
            at = np.array(bullet.getBasePositionAndOrientation(ball, client)[0])
            # A ball that rolls off the place may fall there.
            if np.abs(at[:2] - place.start[:2]).max() <= LEAST // 2 * CELL:
                low = min(low, at[2])
        bullet.removeBody(ball, client)
        found.append((place, low))
    engine.set(np.clip(np.zeros(len(engine.names)), engine.lower, engine.upper))
    report_drops(found, report)


def _fingers(path, client, body, engine, report):
    """Puts a finger behind every handle, joints at 0, without simulating."""
    kept, found = engine.get(), []
    engine.set(np.zeros(len(engine.names)))
    for finger in fingers(path):
        shape = bullet.createCollisionShape(
            bullet.GEOM_CAPSULE, radius=FINGER, height=2.0 * HALF, physicsClientId=client
        )
        w, x, y, z = turned_to(finger.along)
        own = bullet.createMultiBody(
            0.0, shape, basePosition=finger.middle.tolist(), baseOrientation=[x, y, z, w], physicsClientId=client
        )
        near = bullet.getClosestPoints(own, body, 0.0, physicsClientId=client)
        found.append((finger, max([0.0] + [-point[8] for point in near])))
        bullet.removeBody(own, client)
    engine.set(*kept)
    report_fingers(found, report)


def check_urdf(path, states, report):
    """Opens, drives and sweeps a URDF."""
    client = bullet.connect(bullet.DIRECT)
    bullet.setGravity(0.0, 0.0, -9.81, client)
    bullet.setPhysicsEngineParameter(contactBreakingThreshold=BREAKING, physicsClientId=client)
    with collect_warnings(report):
        # Without the flags PyBullet would ignore every contact within the robot, and guess the inertia.
        flags = bullet.URDF_USE_SELF_COLLISION | bullet.URDF_USE_SELF_COLLISION_EXCLUDE_PARENT
        flags |= bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(path, flags=flags, physicsClientId=client)
    engine = Engine(client, body, path)
    if not engine.names:
        report.add("-", "has joints", False)
        return
    report.add("-", "joints limited", (engine.lower < engine.upper).all(), len(engine.names), "joints")
    # Frames of handles are links without mass and shapes on fixed joints.
    fixed = {i for i in range(bullet.getNumJoints(body, client)) if bullet.getJointInfo(body, i, client)[2] == bullet.JOINT_FIXED}
    empty = {i for i in fixed if not bullet.getCollisionShapeData(body, i, client)}
    shown = {shape[1] for shape in bullet.getVisualShapeData(body, physicsClientId=client)}
    links = [i for i in range(bullet.getNumJoints(body, client)) if i not in empty - shown]
    masses = [bullet.getDynamicsInfo(body, i, client)[0] for i in links]
    report.add("-", "masses above 0", min(masses) > 0, sum(masses), "kg")
    check_motion(engine, states, report)
    _drop(path, client, body, engine, report)
    _fingers(path, client, body, engine, report)
    # The file itself has to fix the base.
    moved = np.linalg.norm(bullet.getBasePositionAndOrientation(body, client)[0])
    report.add("-", "base stays", moved <= 1e-6, moved, "m")
    bullet.disconnect(client)
