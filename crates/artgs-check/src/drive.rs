//! Drives one joint of the URDF in Rapier from limit to limit while the others are locked at 0.
//!
//! The moving links are one rigid body on a joint in reduced coordinates, all other links are fixed. All hulls of the moving
//! body collide with all fixed hulls, those of the parent included. A motor with limited force and moderate speed drives the
//! joint.

use crate::model::{Model, Motion, tensor};
use crate::poses::{Scene, distance, names, pose, vector};
use crate::report::JointFinding;
use crate::table::{quantity, stopped_at};
use crate::{CheckOptions, mass};
use artgs_core::{Inertial, PerState, Rigid};
use glam::{DMat3, DVec3};
use rapier3d::prelude::*;

const GRAVITY: f64 = 9.81;

/// Checks the joint of link `index`; none if the link has no joint.
pub(crate) fn joint(model: &Model, scene: &Scene, index: usize, options: &CheckOptions) -> Option<JointFinding> {
    let link = &model.links[index];
    let motion = link.motion.as_ref()?;
    let mut out = JointFinding {
        joint: motion.name.clone(),
        link: link.name.clone(),
        kind: motion.kind,
        limits: motion.limits,
        stopped: [Some(0.0); 2],
        reached: [false; 2],
        blocked_by: [None, None],
        force: 0.0,
        drift: [None; 2],
        penetration: 0.0,
        penetration_at: 0.0,
        penetration_between: None,
        observed: motion.observed,
        problems: Vec::new(),
    };
    let carried = model.carried(index);
    let load = load(model, index, &carried);
    let [lower, upper] = motion.limits;
    let sound = lower < upper && (upper - lower).is_finite() && (motion.axis.length() - 1.0).abs() < 1e-3;
    let solid = mass::principal(load.inertia)[0] > 0.0 && load.mass > 0.0;
    if !sound || !solid || !load.center.is_finite() {
        out.problems.push("cannot be driven: axis, limits, mass or inertia are invalid".into());
        return Some(out);
    }
    let poses = options.poses.max(2);
    let sweep = |range: [f64; 2], out: &mut JointFinding| sweep(model, scene, index, &carried, range, poses, out);
    sweep(motion.limits, &mut out);
    let need = Need::of(model, index, motion, &load, options);
    out.force = need.force;
    match Rig::new(model, scene, index, &carried, &load, &need, options) {
        // From 0 to the lower limit, to the upper one and back, because gravity may help in one direction only.
        Some(mut rig) => [0, 1, 0].into_iter().for_each(|end| rig.drive(end, model, motion, options, &mut out)),
        None => out.problems.push("cannot be driven: the engine refuses the joint".into()),
    }
    // The sweep misses obstacles thinner than the distance between poses; the range where one stopped the joint is swept again.
    for end in 0..2 {
        let (Some(stopped), Some(_)) = (out.stopped[end], &out.blocked_by[end]) else { continue };
        let ahead = 2.0 * (motion.limits[end] - motion.limits[1 - end]) / (poses - 1) as f64;
        sweep([stopped, (stopped + ahead).clamp(lower, upper)], &mut out);
    }
    add_problems(motion, options, &mut out);
    Some(out)
}

fn tolerance(motion: &Motion, options: &CheckOptions) -> f64 {
    if motion.turns() { options.angle } else { options.length }
}

/// Penetration at poses spread over a range of values, the other joints at 0; the deepest is kept.
fn sweep(
    model: &Model,
    scene: &Scene,
    index: usize,
    carried: &[bool],
    range: [f64; 2],
    poses: usize,
    out: &mut JointFinding,
) {
    let mut values = vec![0.0; model.links.len()];
    for step in 0..poses {
        values[index] = range[0] + (range[1] - range[0]) * step as f64 / (poses - 1) as f64;
        let (depth, pair) = scene.deepest(&model.poses(&values), |a, b| carried[a] != carried[b]);
        if depth > out.penetration {
            (out.penetration, out.penetration_at, out.penetration_between) = (depth, values[index], names(model, pair));
        }
    }
}

/// The links that a joint moves, as one body in the frame of the first of them.
fn load(model: &Model, index: usize, carried: &[bool]) -> Inertial {
    let to_first = model.links[index].pose.inverse();
    let bodies: Vec<(Inertial, Rigid)> = (0..model.links.len())
        .filter(|i| carried[*i])
        .filter_map(|i| Some((model.links[i].inertial?, to_first * model.links[i].pose)))
        .collect();
    let mass: f64 = bodies.iter().map(|(i, _)| i.mass).sum();
    let center = bodies.iter().map(|(i, at)| at.apply(i.center) * i.mass).sum::<DVec3>() / mass;
    let mut total = DMat3::ZERO;
    for (inertial, at) in &bodies {
        let turn = at.matrix();
        let arm = at.apply(inertial.center) - center;
        total += turn * tensor(inertial.inertia) * turn.transpose() + offset(inertial.mass, arm);
    }
    Inertial { mass, center, inertia: crate::model::moments(total) }
}

/// Inertia of a point about the origin.
fn offset(mass: f64, arm: DVec3) -> DMat3 {
    let outer = DMat3::from_cols(arm * arm.x, arm * arm.y, arm * arm.z);
    (DMat3::from_diagonal(DVec3::splat(arm.length_squared())) - outer) * mass
}

/// Force and speed for moving a joint.
struct Need {
    force: f64,
    speed: f64,
}

impl Need {
    fn of(model: &Model, index: usize, motion: &Motion, load: &Inertial, options: &CheckOptions) -> Self {
        /// Share of the travel time in which full speed is reached.
        const START: f64 = 0.1;
        let at = &model.links[index].pose;
        let (axis, [lower, upper]) = (motion.axis, motion.limits);
        let speed =
            ((upper - lower) / options.travel).min(motion.velocity.filter(|v| *v > 0.0).unwrap_or(f64::INFINITY));
        let (weight, inertia) = if motion.turns() {
            let last = options.poses.max(2) - 1;
            let torque = |step: usize| {
                let value = lower + (upper - lower) * step as f64 / last as f64;
                let placed = *at * motion.motion(value);
                let arm = placed.turn(load.center);
                at.turn(axis).dot(arm.cross(DVec3::NEG_Z * (load.mass * GRAVITY))).abs()
            };
            let about = tensor(load.inertia) + offset(load.mass, load.center);
            ((0..=last).map(torque).fold(0.0, f64::max), axis.dot(about * axis))
        } else {
            (load.mass * GRAVITY * at.turn(axis).z.abs(), load.mass)
        };
        let slow = motion.friction.unwrap_or(0.0) + motion.damping.unwrap_or(0.0) * speed;
        let needed = weight + slow + inertia * speed / (START * options.travel);
        let effort = motion.effort.unwrap_or(f64::INFINITY);
        Self { force: (options.reserve * needed).min(effort), speed }
    }
}

/// Lets hulls overlap a little before they touch, and corrects false penetrations: contact manifolds of the engine sometimes
/// extend a face far beyond its rim (example: a reported depth of 74 mm for hulls 4 mm apart).
struct Touch {
    depth: Real,
}

impl PhysicsHooks for Touch {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext) {
        let distances = context.rigid().into_iter().flat_map(|m| m.solver_contacts.iter()).map(|c| c.dist);
        let deepest = distances.fold(0.0, Real::min);
        let least = if deepest < 0.0 { separation(context) } else { None };
        if let Some(manifold) = context.rigid_mut() {
            for contact in manifold.solver_contacts.iter_mut() {
                contact.dist = least.map_or(contact.dist, |least| contact.dist.max(least)) + self.depth;
            }
        }
    }
}

/// Distance of the hulls of a contact, negative where they penetrate.
fn separation(context: &ContactModificationContext) -> Option<Real> {
    let [a, b] = [context.collider1, context.collider2].map(|handle| context.colliders.get(handle));
    let (a, b) = (a?, b?);
    distance([a.position(), b.position()], [a.shape(), b.shape()])
}

/// The joint in the engine.
struct Rig {
    world: PhysicsWorld,
    handle: MultibodyJointHandle,
    axis: JointAxis,
    movers: Vec<ColliderHandle>,
    speed: f64,
    touch: Touch,
}

impl Rig {
    fn new(
        model: &Model,
        scene: &Scene,
        index: usize,
        carried: &[bool],
        load: &Inertial,
        need: &Need,
        options: &CheckOptions,
    ) -> Option<Self> {
        let motion = model.links[index].motion.as_ref()?;
        let mut world = PhysicsWorld { gravity: Vector::Z * -GRAVITY as Real, ..PhysicsWorld::default() };
        let settings = &mut world.integration_parameters;
        settings.dt = options.step as Real;
        // Contacts are computed at every step and at smaller distances than the default of 5 mm.
        settings.contact_recycling = false;
        settings.normalized_allowed_linear_error = 1e-4;
        settings.num_solver_iterations = 8;
        let frame = model.links[index].pose;
        let scenery = world.insert_body(RigidBodyBuilder::fixed());
        let root = world.insert_body(RigidBodyBuilder::fixed().pose(pose(&frame)));
        let matrix = tensor(load.inertia).as_mat3().to_cols_array_2d();
        let inertia = Matrix::from_cols_array_2d(&matrix);
        let solid = MassProperties::with_inertia_matrix(vector(load.center), load.mass as Real, inertia);
        let mover = RigidBodyBuilder::dynamic().pose(pose(&frame)).additional_mass_properties(solid).can_sleep(false);
        let mover = world.insert_body(mover);
        let mut movers = Vec::new();
        for (i, hulls) in scene.hulls.iter().enumerate() {
            let (body, at) = match carried[i] {
                true => (mover, frame.inverse() * model.links[i].pose),
                false => (scenery, model.links[i].pose),
            };
            for hull in hulls {
                let collider = ColliderBuilder::new(hull.clone())
                    .position(pose(&at))
                    .density(0.0)
                    .friction(options.friction as Real)
                    .active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS)
                    .user_data(i as u128);
                let handle = world.insert_collider(collider, Some(body));
                movers.extend(carried[i].then_some(handle));
            }
        }
        let limits = motion.limits.map(|v| v as Real);
        let axis = vector(motion.axis).normalize();
        let (joint, dof): (GenericJoint, JointAxis) = match motion.turns() {
            true => (RevoluteJointBuilder::new(axis).limits(limits).into(), JointAxis::AngX),
            false => (PrismaticJointBuilder::new(axis).limits(limits).into(), JointAxis::LinX),
        };
        let mut joint = joint;
        joint.set_motor_max_force(dof, need.force as Real);
        let handle = world.insert_multibody_joint(root, mover, joint)?;
        let (multibody, _) = world.multibody_joints.get_mut(handle)?;
        multibody.damping_mut().fill(motion.damping.unwrap_or(0.0) as Real);
        multibody.frictions_mut().fill(motion.friction.unwrap_or(0.0) as Real);
        let touch = Touch { depth: options.touch as Real };
        Some(Self { world, handle, axis: dof, movers, speed: need.speed, touch })
    }

    /// Joint value; none if the engine lost the joint or computed no finite value.
    fn value(&self) -> Option<f64> {
        let (multibody, id) = self.world.multibody_joints.get(self.handle)?;
        let value = f64::from(multibody.link(id)?.joint.coords()[self.axis as usize]);
        value.is_finite().then_some(value)
    }

    /// Sets the target speed of the motor. The motor is stiff: only its largest force limits it.
    fn set_speed(&mut self, speed: f64) {
        const STIFF: Real = 1e4;
        let axis = self.axis;
        if let Some((multibody, id)) = self.world.multibody_joints.get_mut(self.handle)
            && let Some(link) = multibody.link_mut(id)
        {
            link.joint.data.set_motor_velocity(axis, speed as Real, STIFF);
        }
    }

    fn step(&mut self) {
        self.world.step_with_events(&self.touch, &());
    }

    /// Drives to a limit (0: lower, 1: upper) and holds there.
    fn drive(&mut self, end: usize, model: &Model, motion: &Motion, options: &CheckOptions, out: &mut JointFinding) {
        /// Seconds without progress, of a thousandth of the range, after which a joint counts as stopped.
        const PATIENCE: f64 = 0.5;
        let (limit, range) = (motion.limits[end], motion.limits[1] - motion.limits[0]);
        let sign = if end == 0 { -1.0 } else { 1.0 };
        let near = 0.1 * tolerance(motion, options);
        let steps = |seconds: f64| (seconds / options.step).ceil() as usize;
        self.set_speed(sign * self.speed);
        let (mut best, mut since) = (self.value(), 0);
        for _ in 0..steps(10.0 * range / self.speed) {
            self.step();
            let Some(value) = self.value().filter(|v| (limit - v) * sign >= near) else { break };
            since += 1;
            if best.is_some_and(|best| (value - best) * sign > 1e-3 * range) {
                (best, since) = (Some(value), 0);
            }
            if since > steps(PATIENCE) {
                break;
            }
        }
        // A limit that was reached before but is not reached again counts as not reached.
        let again = out.drift[end].is_some();
        out.stopped[end] = self.value();
        out.reached[end] = out.stopped[end].is_some_and(|v| (v - limit).abs() <= tolerance(motion, options));
        if !out.reached[end] {
            out.drift[end] = None;
            out.blocked_by[end] = self.blocking_link().map(|i| model.links[i].name.clone());
            return;
        }
        if again {
            return;
        }
        self.set_speed(0.0);
        let from = self.value();
        let moved = (0..steps(options.hold)).map(|_| {
            self.step();
            self.value().zip(from).map_or(f64::INFINITY, |(value, from)| (value - from).abs())
        });
        out.drift[end] = Some(moved.fold(0.0, f64::max));
    }

    /// The link with the largest contact impulse.
    fn blocking_link(&self) -> Option<usize> {
        let mut hardest: (Real, Option<usize>) = (0.0, None);
        for mover in &self.movers {
            for pair in self.world.narrow_phase.contact_pairs_with(*mover) {
                let other = if pair.collider1 == *mover { pair.collider2 } else { pair.collider1 };
                let push = pair.total_impulse_magnitude();
                if push > hardest.0 {
                    hardest = (push, self.world.colliders.get(other).map(|c| c.user_data as usize));
                }
            }
        }
        hardest.1
    }
}

/// Adds problems to the findings.
fn add_problems(motion: &Motion, options: &CheckOptions, out: &mut JointFinding) {
    let text = |value: f64| quantity(motion.kind, value);
    let unit = if motion.turns() { "N m" } else { "N" };
    let tolerance = tolerance(motion, options);
    let mut problems = Vec::new();
    for (end, name) in ["lower", "upper"].into_iter().enumerate() {
        let (stopped, limit) = (stopped_at(motion.kind, out.stopped[end]), text(out.limits[end]));
        if !out.reached[end] {
            let why = match &out.blocked_by[end] {
                Some(link) => format!("`{link}` blocks it"),
                None => format!("{:.3} {unit} do not move it", out.force),
            };
            problems.push(format!("stops at {stopped} on the way to its {name} limit {limit}: {why}"));
        }
        if let Some(drift) = out.drift[end].filter(|d| *d > tolerance) {
            problems.push(format!("drifts by {} while held at its {name} limit", text(drift)));
        }
    }
    if let Some([a, b]) = out.penetration_between.as_ref().filter(|_| out.penetration > options.penetration) {
        let (depth, at) = (1e3 * out.penetration, text(out.penetration_at));
        problems.push(format!("at {at} `{a}` and `{b}` penetrate each other by {depth:.1} mm"));
    }
    let [least, most] = out.stopped;
    let reachable = |value: f64| {
        least.is_some_and(|least| value >= least - tolerance) && most.is_some_and(|most| value <= most + tolerance)
    };
    for (state, value) in out.observed.iter().flat_map(PerState::enumerate) {
        if !reachable(*value) {
            problems.push(format!("was observed at {} ({}), which is not reachable", text(*value), state.name()));
        }
    }
    out.problems.extend(problems);
}
