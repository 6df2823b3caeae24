//! Materials of an object: which family of patterns, which colours, and which parts share them.

use super::dice::Dice;
use super::distribution::{EQUAL_MATERIALS, FAMILIES, OWN_MATERIALS};
use crate::Material;

/// What surfaces look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Family {
    /// One colour.
    Plain,
    /// Grain.
    Wood,
    /// Clouds of a second colour.
    Noise,
    /// Brushed metal, on which sensors lose depth.
    Gloss,
}

impl Family {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Wood => "wood",
            Self::Noise => "noise",
            Self::Gloss => "gloss",
        }
    }
}

/// Which parts share a material.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sharing {
    /// The whole object has one.
    All,
    /// Fronts have one, the body another.
    Fronts,
    /// Each part has its own.
    Own,
}

/// The materials of one object.
pub(super) struct Looks {
    pub(super) family: Family,
    sharing: Sharing,
    body: Material,
    front: Material,
    inside: Material,
    handle: Material,
    dice: Dice,
}

impl Looks {
    pub(super) fn new(dice: &mut Dice) -> Self {
        let family = dice.weighted(&FAMILIES);
        let sharing = match () {
            () if dice.chance(EQUAL_MATERIALS) => Sharing::All,
            () if dice.chance(OWN_MATERIALS) => Sharing::Own,
            () => Sharing::Fronts,
        };
        let mut dice = dice.branch();
        let body = material(family, &mut dice);
        let second = dice.weighted(&FAMILIES);
        let front = material(if dice.chance(0.7) { family } else { second }, &mut dice);
        let inside = material(if dice.chance(0.5) { Family::Wood } else { Family::Plain }, &mut dice);
        let handle = metal(&mut dice);
        let mut looks = Self { family, sharing, body, front, inside, handle, dice };
        if sharing == Sharing::All {
            (looks.front, looks.inside, looks.handle) = (body, body, body);
        }
        looks
    }

    /// True if all parts have one material.
    pub(super) fn is_equal(&self) -> bool {
        self.sharing == Sharing::All
    }

    /// True if fronts of the same size look alike.
    pub(super) fn fronts_look_alike(&self) -> bool {
        self.sharing != Sharing::Own
    }

    /// Of the static part.
    pub(super) fn body(&self) -> Material {
        self.body
    }

    /// Of the front of the next part.
    pub(super) fn front(&mut self) -> Material {
        if self.sharing == Sharing::Own { material(self.family, &mut self.dice) } else { self.front }
    }

    /// Of trays, shelves and linings.
    pub(super) fn inside(&self) -> Material {
        self.inside
    }

    /// Of handles and frames of metal.
    pub(super) fn handle(&self) -> Material {
        self.handle
    }

    /// Of something that lies in or on the object, which never has the material of the object.
    pub(super) fn thing(&mut self) -> Material {
        let family = self.dice.pick(&[Family::Plain, Family::Noise, Family::Noise]);
        material(family, &mut self.dice)
    }

    /// Dark glass or a screen.
    pub(super) fn glass(&self) -> Material {
        if self.is_equal() { self.body } else { Material::Plain { color: [0.17, 0.19, 0.22] } }
    }
}

fn metal(dice: &mut Dice) -> Material {
    let (along, grey) = (dice.count(0, 2), dice.within([0.55, 0.8]));
    Material::Brushed { along, color: [grey, grey + 0.01, grey + 0.03], period: dice.within([0.005, 0.012]) }
}

/// A colour of furniture: light and pale, or strong.
fn color(dice: &mut Dice) -> [f64; 3] {
    if dice.chance(0.5) {
        let light = dice.within([0.7, 0.9]);
        return [0, 1, 2].map(|_| light + dice.within([-0.06, 0.04]));
    }
    let (hue, value) = (dice.within([0.0, 6.0]), dice.within([0.3, 0.75]));
    let strength = dice.within([0.15, 0.6]);
    [0.0, 2.0, 4.0].map(|shift| {
        let ramp = ((hue + shift).rem_euclid(6.0) - 3.0).abs() - 1.0;
        value * (1.0 - strength * (1.0 - ramp.clamp(0.0, 1.0)))
    })
}

fn material(family: Family, dice: &mut Dice) -> Material {
    let base = color(dice);
    let shade = dice.within([0.55, 0.8]);
    let darker = base.map(|c| c * shade);
    match family {
        Family::Plain => Material::Plain { color: base },
        Family::Wood => {
            let light = [dice.within([0.45, 0.9]), dice.within([0.3, 0.66]), dice.within([0.2, 0.5])];
            let light = [light[0], light[1].min(0.85 * light[0]), light[2].min(0.65 * light[0])];
            let dark = light.map(|c| c * shade);
            Material::Wood { grain: dice.count(0, 2), light, dark, period: dice.within([0.04, 0.1]) }
        }
        Family::Noise => Material::Speckle { base, spots: darker, size: dice.within([0.015, 0.06]) },
        Family::Gloss => {
            Material::Brushed { along: dice.count(0, 2), color: base, period: dice.within([0.006, 0.012]) }
        }
    }
}
