//! A population of random objects: [`random_object`] draws one by its seed from the distribution that the page "Population" of the book
//! describes, [`write_random`] records it.

mod appliances;
mod assemble;
mod chains;
mod clearance;
mod dice;
mod distribution;
mod fronts;
mod furniture;
mod looks;
mod model;
mod record;
mod states;
#[cfg(test)]
mod tests;
mod things;
mod undecidable;
mod write;

pub use record::{Device, RandomCapture, RandomOptions, random_capture};
pub use undecidable::{Reason, Undecidable};
pub use write::{RandomInfo, random_info, write_random};

use crate::{Object, SynthError};
use dice::Dice;
use distribution::FURNITURE;
use looks::Looks;
use model::{Model, Studio};
use std::collections::BTreeSet;

/// Objects that are drawn for a seed until one of them can move without meeting itself.
const ATTEMPTS: u64 = 50;
/// Smaller objects are enlarged to this diagonal, metres: no sensor for rooms resolves them, and depth files count millimetres.
const LEAST_DIAGONAL: f64 = 0.6;

/// An object of the population.
#[derive(Clone, Debug)]
pub struct RandomObject {
    /// What it is, such as `chest`.
    pub category: &'static str,
    /// The object in its first two states, metres.
    pub object: Object,
    /// Properties that results are grouped by, such as `look-alike`.
    pub features: BTreeSet<&'static str>,
}

/// Makes an object of one category.
type Maker = fn(&mut Studio) -> Model;

/// Categories that are no furniture, with their weights; those of furniture have 0.67 together.
const MAKERS: [(Maker, f64); 19] = [
    (appliances::fridge, 0.035),
    (appliances::oven, 0.035),
    (appliances::microwave, 0.02),
    (appliances::washer, 0.02),
    (appliances::dishwasher, 0.035),
    (things::laptop, 0.03),
    (things::chest_with_lid, 0.03),
    (things::bin, 0.015),
    (things::toolbox, 0.015),
    (things::scissors, 0.01),
    (things::stapler, 0.01),
    (things::tap, 0.01),
    (things::window, 0.02),
    (things::dial_panel, 0.01),
    (things::bottle, 0.01),
    (things::folding_chair, 0.015),
    (chains::desk_lamp, 0.02),
    (chains::monitor_arm, 0.015),
    (chains::office_chair, 0.015),
];
/// Weight of a cabinet whose door carries a drawer.
const DOOR_WITH_DRAWER: f64 = 0.025;

/// Draws the object of a seed with `states` states, at least 2. The same seed gives the same object; its category, materials and sizes
/// do not depend on the number of states.
pub fn random_object(seed: u64, states: usize) -> Result<RandomObject, SynthError> {
    drawn_object(seed, states, false)
}

/// The object of a seed where nothing moves: in all states it is as [`random_object`] has it in the first one, a single part.
pub fn still_object(seed: u64, states: usize) -> Result<RandomObject, SynthError> {
    drawn_object(seed, states, true)
}

fn drawn_object(seed: u64, states: usize, still: bool) -> Result<RandomObject, SynthError> {
    if !(2..=100).contains(&states) {
        return Err(SynthError::Options("the number of states must be 2 to 100"));
    }
    (0..ATTEMPTS)
        .find_map(|attempt| attempt_at(seed, attempt, states, still))
        .ok_or(SynthError::Options("no object of this seed can move; give another seed"))
}

fn attempt_at(seed: u64, attempt: u64, states: usize, still: bool) -> Option<RandomObject> {
    let mut dice = Dice::new(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ attempt << 17 ^ 0x0061_7274_6773);
    let (mut model, looks) = draw_model(&mut dice);
    model.group_equals();
    let mut values = states::draw_states(&model.bodies, states, &mut dice.branch())?;
    if still {
        values.iter_mut().for_each(|of_body| *of_body = vec![of_body[0]; states]);
    }
    Some(assemble::assemble(model, &looks, values, seed))
}

fn draw_model(dice: &mut Dice) -> (Model, Looks) {
    let mut looks = Looks::new(dice);
    let mut makers: Vec<(Option<Maker>, f64)> = MAKERS.iter().map(|(maker, weight)| (Some(*maker), *weight)).collect();
    makers.push((Some(chains::door_with_drawer), DOOR_WITH_DRAWER));
    makers.push((None, FURNITURE.iter().map(|kind| kind.weight).sum()));
    let maker = dice.weighted(&makers);
    let kinds: Vec<(usize, f64)> = FURNITURE.iter().enumerate().map(|(k, kind)| (k, kind.weight)).collect();
    let kind = dice.weighted(&kinds);
    let mut own = dice.branch();
    let mut studio = Studio { dice: &mut own, looks: &mut looks };
    let model = match maker {
        Some(make) => make(&mut studio),
        None => furniture::furniture(&FURNITURE[kind], &mut studio),
    };
    (model, looks)
}
