"""Drives the joints of an opened model; the same for every engine.

An engine is an object with
  names, kinds ('hinge' or 'slide'), lower, upper, effort, damping, friction: one entry per joint, SI units;
  dt: seconds per step;
  set(q): puts all joints at `q`, at rest;
  get() -> (q, v);
  gravity(q) -> generalised forces that hold all joints against gravity;
  inertia(q) -> effective inertia of each joint;
  step(tau): a step under generalised forces `tau`;
  follow(target): a step of the engine's usual servo towards positions `target`, within the effort;
  contacts(q) -> {(link, link): metres}: penetration depths of links at `q` as the engine reports them, where the engine
    computes contacts, and for information {(link, link): metres} of pairs that it ignores, None if unknown.
"""

import numpy as np

from .report import DRIFT, PENETRATION, REACHED

POSES = 20
# Seconds for the whole range of a joint, about those of a human hand.
STROKE_S = 1.0
PATIENCE_S = 4.0
# The force rises from zero to its maximum in this time.
RISE_S = 0.2
HOLD_S = 1.0
# The target moves smoothly for this long, so that a jump does not saturate the effort; then it stays.
GLIDE_S = 2.0
WAIT_S = 3.0


def check_motion(engine, states, report):
    """Adds the findings of every joint to the report. `states` maps names of observed states to {joint: value}."""
    if not (np.isfinite(engine.lower) & np.isfinite(engine.upper) & (engine.lower < engine.upper)).all():
        report.add("-", "finite limits", False, note=f"{engine.lower} to {engine.upper}; nothing was driven")
        return
    rest = np.clip(np.zeros(len(engine.names)), engine.lower, engine.upper)
    for j in range(len(engine.names)):
        _limits(engine, j, rest, report)
        _sweep(engine, j, rest, report)
    _observed(engine, states, report)


def _force(engine, j, rest):
    """Twice what weight, friction, damping and inertia need over the range, at most the joint's effort."""
    span = engine.upper[j] - engine.lower[j]
    weight = inertia = 0.0
    for value in np.linspace(engine.lower[j], engine.upper[j], 9):
        q = rest.copy()
        q[j] = value
        weight = max(weight, abs(engine.gravity(q)[j]))
        inertia = max(inertia, engine.inertia(q)[j])
    # Half the stroke accelerates, half brakes: the range in time T takes 4 range / T^2.
    need = weight + engine.friction[j] + engine.damping[j] * span / STROKE_S + 4.0 * inertia * span / STROKE_S**2
    return min(engine.effort[j], 2.0 * need), need


def _limits(engine, j, rest, report):
    kind, name = engine.kinds[j], engine.names[j]
    force, need = _force(engine, j, rest)
    note = f"{force:.3g} {'N m' if kind == 'hinge' else 'N'}"
    report.add(name, "effort suffices", force >= need, force / need if need > 0 else 1.0, "x", note)
    q = rest.copy()
    q[j] = engine.lower[j]
    engine.set(q)
    for label, sign, limit in (("upper", 1.0, engine.upper[j]), ("lower", -1.0, engine.lower[j])):
        arrived, touching = _approach(engine, j, rest, sign, limit, force)
        held = []
        while arrived and len(held) * engine.dt < HOLD_S:
            tau = engine.gravity(_pinned(engine, rest, j))
            tau[j] = sign * force
            engine.step(tau)
            held.append(_pinned(engine, rest, j)[j])
        value = engine.get()[0][j]
        off = abs(value - limit)
        note = "" if arrived else f"stopped at {value:.4f} of {limit:.4f}{touching}"
        report.add(name, f"reaches {label}", arrived and off <= REACHED[kind], off, _unit(kind), note)
        if held:
            # The first tenth may still settle.
            tail = held[len(held) // 10 :]
            drift = max(tail) - min(tail)
            report.add(name, f"holds {label}", drift <= DRIFT[kind], drift, _unit(kind))


def _approach(engine, j, rest, sign, limit, force):
    """Pushes a joint to a limit: the force grows while the joint lags behind a constant speed, up to `force`.

    Returns whether it arrived and, if not, the links that it touches."""
    tolerance, span = REACHED[engine.kinds[j]], engine.upper[j] - engine.lower[j]
    # An engine may detect a limit only one step after the joint passed it (PyBullet does, and stays there).
    pace = min(span / STROKE_S, 0.4 * tolerance / engine.dt)
    level = 0.0
    for _ in range(int((PATIENCE_S + 1.5 * span / pace) / engine.dt)):
        q = _pinned(engine, rest, j)
        speed = engine.get()[1][j]
        if abs(q[j] - limit) <= tolerance and abs(speed) <= 1.1 * pace:
            return True, ""
        lag = pace - sign * speed
        rate = force / (pace * RISE_S)
        inertia = engine.inertia(q)[j]
        level = float(np.clip(level + rate * lag * engine.dt, -force, force))
        grip = min(2.0 * np.sqrt(rate * inertia), 0.5 * inertia / engine.dt)
        tau = engine.gravity(q)
        tau[j] = np.clip(tau[j] + sign * (level + grip * lag), -force, force)
        engine.step(tau)
    return False, _blocked(engine)


def _pinned(engine, rest, j):
    """Resets every joint but `j`, so that only `j` is tested; returns the positions."""
    q, v = engine.get()
    if len(q) > 1:
        pinned, still = rest.copy(), np.zeros_like(v)
        pinned[j], still[j] = q[j], v[j]
        if not (np.array_equal(pinned, q) and np.array_equal(still, v)):
            engine.set(pinned, still)
        return pinned
    return q


def _blocked(engine):
    touching = engine.contacts(engine.get()[0])[0]
    pairs = [f"{a}/{b}" for (a, b), depth in sorted(touching.items()) if depth > -1e-3]
    return f", touching {', '.join(pairs)}" if pairs else ""


def _sweep(engine, j, rest, report):
    worst, note, ignored, ignored_note = 0.0, "", 0.0, ""
    for value in np.linspace(engine.lower[j], engine.upper[j], POSES):
        q = rest.copy()
        q[j] = value
        resisted, passed_over = engine.contacts(q)
        for pair, depth in resisted.items():
            if depth > worst:
                worst, note = depth, f"{'/'.join(pair)} at {value:.3f}"
        for pair, depth in (passed_over or {}).items():
            if depth > ignored:
                ignored, ignored_note = depth, f"{'/'.join(pair)} at {value:.3f}"
    report.add(engine.names[j], "penetration", worst <= PENETRATION, worst, "m", note)
    if passed_over is not None:
        report.add(engine.names[j], "overlap of pairs that it ignores", None, ignored, "m", ignored_note)


def _observed(engine, states, report):
    """Moves all joints together from one observed state to the next, within their efforts."""
    if not states:
        report.add("-", "observed states", None, note="no MJCF keyframes beside this export, not visited")
        return
    goals = {name: np.array([at.get(n, np.nan) for n in engine.names]) for name, at in states.items()}
    for name, goal in goals.items():
        missing = [n for n, g in zip(engine.names, goal) if not np.isfinite(g)]
        if missing:
            report.add("-", f"state {name}", False, note=f"the keyframe lacks {', '.join(missing)}")
            return
    names = list(goals)
    for name in names:
        other = goals[names[names.index(name) - 1]]
        goal = goals[name]
        depth = max(engine.contacts(goal)[0].values(), default=0.0)
        report.add("-", f"penetration in state {name}", depth <= PENETRATION, max(depth, 0.0), "m")
        engine.set(other)
        final = _servo(engine, goal)
        for j, joint in enumerate(engine.names):
            off = abs(final[j] - goal[j])
            report.add(joint, f"visits {name}", off <= REACHED[engine.kinds[j]], off, _unit(engine.kinds[j]))


def _servo(engine, goal):
    start, _ = engine.get()
    last = []
    steps = int((GLIDE_S + WAIT_S) / engine.dt)
    for i in range(steps):
        engine.follow(start + (goal - start) * min(1.0, i * engine.dt / GLIDE_S))
        if i >= steps - int(0.5 / engine.dt):
            last.append(engine.get()[0])
    # The largest error of the last half second, so that an oscillating servo does not count as settled.
    last = np.array(last)
    return last[np.abs(last - goal).argmax(axis=0), np.arange(len(goal))]


def _unit(kind):
    return "rad" if kind == "hinge" else "m"
