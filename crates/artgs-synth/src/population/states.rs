//! The values of all joints in all states.

use super::clearance::Clearance;
use super::dice::Dice;
use super::distribution::{EQUAL_MOTION, FROM_AJAR, FROM_CLOSED, ONE_WAY, REST, WIDE};
use super::model::{Body, Mechanism};

/// Tries to draw values with which no two bodies meet.
const TRIES: usize = 60;

/// How the bodies of an object are moved.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Opening,
    Closing,
    Mixed,
}

/// What a body does that rests closed by nature.
#[derive(Clone, Copy)]
enum Role {
    FromClosed,
    FromAjar,
    Wide,
}

/// For every body its value in every state; bodies of equal values are at rest. None if nothing can move without meeting
/// something.
pub(super) fn draw_states(bodies: &[Body], states: usize, dice: &mut Dice) -> Option<Vec<Vec<f64>>> {
    let clearance = Clearance::new(bodies)?;
    if clearance.conflict(&vec![0.0; bodies.len()]).is_some() {
        return None;
    }
    let way = match dice.chance(ONE_WAY) {
        true if dice.chance(0.7) => Way::Opening,
        true => Way::Closing,
        false => Way::Mixed,
    };
    let movable = bodies.len() - 1;
    let moves: Vec<bool> = (0..bodies.len()).map(|_| movable == 1 || !dice.chance(REST)).collect();
    let mut values = vec![vec![0.0; states]; bodies.len()];
    for body in 1..bodies.len() {
        redraw(bodies, &mut values, body, way, moves[body], dice);
    }
    if dice.chance(EQUAL_MOTION) {
        equalise(bodies, &mut values, dice);
    }
    for attempt in 0..TRIES {
        let Some(conflict) = conflict(&clearance, &values) else {
            return (1..bodies.len()).any(|b| is_moved(&values[b])).then_some(values);
        };
        let last = attempt + 10 >= TRIES;
        for body in chain(bodies, conflict) {
            if last {
                // What cannot move here stays closed.
                values[body] = vec![0.0; states];
            } else {
                redraw(bodies, &mut values, body, way, moves[body], dice);
            }
        }
    }
    None
}

pub(super) fn is_moved(values: &[f64]) -> bool {
    values.iter().any(|v| *v != values[0])
}

/// Two bodies that meet in a state or between two.
fn conflict(clearance: &Clearance, values: &[Vec<f64>]) -> Option<[usize; 2]> {
    let at = |state: usize| values.iter().map(|v| v[state]).collect::<Vec<f64>>();
    let states: Vec<Vec<f64>> = (0..values[0].len()).map(at).collect();
    let within = states.iter().find_map(|state| clearance.conflict(state));
    within.or_else(|| states.windows(2).find_map(|pair| clearance.conflict_between(&pair[0], &pair[1])))
}

/// The movable bodies of two and of what carries them.
fn chain(bodies: &[Body], ends: [usize; 2]) -> Vec<usize> {
    let mut chain = Vec::new();
    for mut body in ends {
        while body > 0 {
            if !chain.contains(&body) {
                chain.push(body);
            }
            body = bodies[body].parent;
        }
    }
    chain.sort_unstable();
    chain
}

/// Draws the values of a body. What is behind a door that is not open enough is closed.
fn redraw(bodies: &[Body], values: &mut [Vec<f64>], body: usize, way: Way, moves: bool, dice: &mut Dice) {
    let Some(mechanism) = &bodies[body].mechanism else { return };
    let states = values[body].len();
    let mut drawn = if moves { moving(mechanism, states, way, dice) } else { vec![resting(mechanism, dice); states] };
    if let Some((door, least)) = mechanism.behind {
        // A door before something is often found open in all states, with what is behind it pulled out.
        if values[door].iter().all(|v| *v < least) || dice.chance(0.5) {
            let widest = bodies[door].mechanism.as_ref().map_or(0.0, |m| m.range[1]);
            for value in &mut values[door] {
                *value = if dice.chance(0.8) { dice.within([least.min(widest), widest]) } else { *value };
            }
        }
        for (value, opened) in drawn.iter_mut().zip(&values[door]) {
            *value = if *opened < least { mechanism.range[0] } else { *value };
        }
    }
    let change = drawn.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    if change < 0.5 * mechanism.least {
        let first = drawn[0];
        drawn = vec![first; states];
    }
    values[body] = drawn;
}

fn resting(mechanism: &Mechanism, dice: &mut Dice) -> f64 {
    let [closed, open] = mechanism.range;
    if mechanism.rests_closed && dice.chance(0.7) { closed } else { dice.within([closed, open]) }
}

/// Values of a body that moves between any two states by at least its least change.
fn moving(mechanism: &Mechanism, states: usize, way: Way, dice: &mut Dice) -> Vec<f64> {
    let ([closed, open], least) = (mechanism.range, mechanism.least);
    let size = open - closed;
    let mut values = if mechanism.rests_closed {
        let role = dice.weighted(&[(Role::FromClosed, FROM_CLOSED), (Role::FromAjar, FROM_AJAR), (Role::Wide, WIDE)]);
        let (low, high) = match role {
            Role::FromClosed => (closed, dice.within([closed + least, open])),
            Role::FromAjar => {
                let low = closed + dice.within([0.03, 0.3]) * size;
                (low, dice.within([(low + least).min(open), open]))
            }
            Role::Wide => {
                let low = closed + dice.within([0.3, 0.6]) * size;
                (low.min(open - least), dice.within([(low + least).min(open), open]))
            }
        };
        let closes = way == Way::Closing || way == Way::Mixed && dice.chance(0.5);
        if closes { vec![high, low] } else { vec![low, high] }
    } else {
        vec![dice.within(mechanism.range), 0.0]
    };
    let first_free = if mechanism.rests_closed { 2 } else { 1 };
    values.resize(states, 0.0);
    for state in first_free..states {
        values[state] = away_from(values[state - 1], [closed, open], least, dice);
    }
    values
}

/// A value of a range that is at least `least` from another one.
fn away_from(value: f64, [closed, open]: [f64; 2], least: f64, dice: &mut Dice) -> f64 {
    let below = (value - least - closed).max(0.0);
    let above = (open - value - least).max(0.0);
    let at = dice.within([0.0, below + above]);
    if at < below { closed + at } else { open - (at - below) }
}

/// Gives some bodies of one group the values of one of them.
fn equalise(bodies: &[Body], values: &mut [Vec<f64>], dice: &mut Dice) {
    let mut groups: Vec<usize> = bodies.iter().filter_map(|body| body.group).collect();
    groups.sort_unstable();
    groups.dedup();
    let Some(group) = (!groups.is_empty()).then(|| dice.pick(&groups)) else { return };
    let members: Vec<usize> = (1..bodies.len()).filter(|&b| bodies[b].group == Some(group)).collect();
    let Some(&leader) = members.iter().find(|&&b| is_moved(&values[b])) else { return };
    for &member in members.iter().filter(|&&m| m != leader) {
        let same_axis = |a: &Body, b: &Body| match (&a.mechanism, &b.mechanism) {
            (Some(a), Some(b)) => a.axis.dot(b.axis) > 0.99,
            _ => false,
        };
        let within = |mechanism: &Mechanism| values[leader].iter().all(|v| *v <= mechanism.range[1]);
        let can = bodies[member].mechanism.as_ref().is_some_and(within);
        if can && same_axis(&bodies[leader], &bodies[member]) && dice.chance(0.6) {
            values[member] = values[leader].clone();
        }
    }
}
