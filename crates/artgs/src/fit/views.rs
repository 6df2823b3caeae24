//! Which views a backend trains on, and in which order: the same on every device.

use super::FitError;
use super::backend::{PlateauConfig, TrainConfig};
use super::images::TrainImage;
use artgs_core::State;
use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;

/// Draws views and backgrounds; the same sequence for the same seed.
#[derive(Clone, Debug)]
pub struct ViewSampler {
    rng: Pcg64Mcg,
    order: Vec<usize>,
    next: usize,
    with_replacement: bool,
    /// Views of each state there is, for drawing with replacement; empty: without.
    states: Vec<Vec<usize>>,
}

impl ViewSampler {
    /// A sampler of views (at least one), given the state of each.
    pub fn new(states: &[State], with_replacement: bool, seed: u64) -> Self {
        let mut sampler = Self {
            rng: Pcg64Mcg::seed_from_u64(seed),
            order: Vec::new(),
            next: 0,
            with_replacement,
            states: Vec::new(),
        };
        sampler.restrict(states, |_| true);
        sampler
    }

    /// From now on draws only those of the views that `keep` says.
    pub fn restrict(&mut self, states: &[State], keep: impl Fn(usize) -> bool) {
        let kept = |&v: &usize| keep(v);
        self.order = (0..states.len()).filter(kept).collect();
        self.next = self.order.len();
        if self.with_replacement {
            let of_state = |s: State| self.order.iter().copied().filter(|&v| states[v] == s).collect::<Vec<usize>>();
            self.states = State::ALL.map(of_state).into_iter().filter(|g| !g.is_empty()).collect();
        }
    }

    /// Index of the next view: all of them in a random order before any comes again, or with replacement, states
    /// being equally likely.
    pub fn view(&mut self) -> usize {
        if let Some(first) = self.states.first() {
            let group =
                if self.states.len() > 1 { &self.states[self.rng.random_range(0..self.states.len())] } else { first };
            return group[self.rng.random_range(0..group.len())];
        }
        if self.next >= self.order.len() {
            self.order.shuffle(&mut self.rng);
            self.next = 0;
        }
        self.next += 1;
        self.order[self.next - 1]
    }

    /// A uniform colour.
    pub fn color(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| self.rng.random::<f32>())
    }
}

/// The views of a run: drawn from, some of them held back, and smaller than they are, until the run settles.
#[derive(Clone, Debug)]
pub struct ViewPlan<'a> {
    /// Draws the next view.
    pub sampler: ViewSampler,
    /// Views that are not trained on yet, ascending.
    pub held: Vec<usize>,
    /// State of every view.
    states: Vec<State>,
    /// The views at full size; empty if they are trained on so already.
    fine: Vec<TrainImage<'a>>,
}

impl<'a> ViewPlan<'a> {
    /// The plan, and the images to begin with: those of more than `config.plateau.coarse_pixels` pixels are made smaller.
    pub fn new(
        images: Vec<TrainImage<'a>>,
        config: &TrainConfig,
        seed: u64,
    ) -> Result<(Self, Vec<TrainImage<'a>>), FitError> {
        if images.is_empty() {
            return Err(FitError::NoViews);
        }
        let states: Vec<State> = images.iter().map(|image| image.state).collect();
        let held = held(&states, &config.plateau);
        let mut sampler = ViewSampler::new(&states, config.with_replacement, seed);
        sampler.restrict(&states, |v| !held.contains(&v));
        let (images, fine) = coarse_first(images, &config.plateau);
        Ok((Self { sampler, held, states, fine }, images))
    }

    /// From now on all views are drawn, at full size; returns their images if those were smaller so far.
    pub fn settle(&mut self) -> Option<Vec<TrainImage<'a>>> {
        if !self.held.is_empty() {
            self.held.clear();
            self.sampler.restrict(&self.states, |_| true);
        }
        (!self.fine.is_empty()).then(|| std::mem::take(&mut self.fine))
    }
}

/// The images to begin with and, if those are smaller, the ones to end with.
fn coarse_first<'a>(
    images: Vec<TrainImage<'a>>,
    plateau: &PlateauConfig,
) -> (Vec<TrainImage<'a>>, Vec<TrainImage<'a>>) {
    let largest = images.iter().map(TrainImage::area).max().unwrap_or(0);
    if plateau.settle == 0 || largest <= plateau.coarse_pixels {
        return (images, Vec::new());
    }
    let divisor = (largest as f64 / plateau.coarse_pixels.max(1) as f64).sqrt().ceil() as usize;
    (images.par_iter().map(|image| image.smaller(divisor)).collect(), images)
}

/// Views to hold back, ascending, given the state of each.
fn held(states: &[State], plateau: &PlateauConfig) -> Vec<usize> {
    let of_state = |s: State| (0..states.len()).filter(|&v| states[v] == s).collect::<Vec<usize>>();
    let mut held: Vec<usize> =
        State::ALL.map(of_state).iter().flat_map(|views| plateau.held(views.len()).map(|i| views[i])).collect();
    held.sort_unstable();
    held
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_show_every_view_once() {
        let mut sampler = ViewSampler::new(&[State::START; 7], false, 5);
        for _ in 0..3 {
            let mut round: Vec<usize> = (0..7).map(|_| sampler.view()).collect();
            round.sort_unstable();
            assert_eq!(round, [0, 1, 2, 3, 4, 5, 6]);
        }
        let mut sampler = ViewSampler::new(&[State::START; 7], true, 5);
        let draws: Vec<usize> = (0..700).map(|_| sampler.view()).collect();
        assert!((0..7).all(|v| draws.iter().filter(|&&d| d == v).count() > 60));
    }

    #[test]
    fn drawing_with_replacement_treats_states_alike() {
        let mut sampler = ViewSampler::new(&[State::START, State::END, State::END, State::END], true, 5);
        let first = (0..1000).filter(|_| sampler.view() == 0).count();
        assert!((450..550).contains(&first), "{first}");
    }
}
