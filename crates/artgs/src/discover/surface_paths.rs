//! Shortest paths along the surface, from step to step of the neighbour graph.

use super::graph_cut::first_steps;

/// Neighbours of every point, with the lengths of the steps to them.
#[derive(Default)]
pub(super) struct SurfaceGraph {
    first: Vec<u32>,
    steps: Vec<(u32, f32)>,
    /// Width of a bucket.
    width: f32,
    longest: f32,
}

/// Least weight of an edge: the longest step is 1 / this.
const LEAST_WEIGHT: f32 = 1e-3;

/// Buckets of the longest step at most.
const MOST_BUCKETS: f32 = 4096.0;

impl SurfaceGraph {
    /// An edge of weight w is a step of length 1 / w.
    pub(super) fn new(nodes: usize, edges: &[(u32, u32, f32)]) -> Self {
        let first = first_steps(nodes, edges);
        let mut next = first.clone();
        let mut steps = vec![(0, 0.0); 2 * edges.len()];
        let (mut shortest, mut longest) = (f32::INFINITY, 0.0f32);
        for (i, j, weight) in edges {
            let length = 1.0 / weight.max(LEAST_WEIGHT);
            (shortest, longest) = (shortest.min(length), longest.max(length));
            for (from, to) in [(i, j), (j, i)] {
                steps[next[*from as usize] as usize] = (*to, length);
                next[*from as usize] += 1;
            }
        }
        Self { first, steps, width: shortest.max(longest / MOST_BUCKETS), longest }
    }

    /// Length of the shortest path from any source to every node; infinite if there is none.
    ///
    /// Nodes wait in a ring of buckets that are as wide as the shortest step (Dial 1969), so that hardly a node is visited
    /// twice. The lengths do not depend on the order of the visits.
    pub(super) fn distances(&self, sources: impl Iterator<Item = usize>) -> Vec<f32> {
        let mut distance = vec![f32::INFINITY; self.first.len().saturating_sub(1)];
        let bucket = |length: f32| (length / self.width) as usize;
        // One more than the longest step reaches, and one for rounding.
        let mut ring = vec![Vec::new(); if self.steps.is_empty() { 1 } else { bucket(self.longest) + 3 }];
        let mut waiting = 0usize;
        for i in sources {
            distance[i] = 0.0;
            ring[0].push((0.0, i as u32));
            waiting += 1;
        }
        let mut at = 0;
        while waiting > 0 {
            let slot = at % ring.len();
            while let Some((length, node)) = ring[slot].pop() {
                waiting -= 1;
                let i = node as usize;
                if length > distance[i] {
                    continue;
                }
                for (to, step) in &self.steps[self.first[i] as usize..self.first[i + 1] as usize] {
                    let through_here = length + step;
                    if through_here < distance[*to as usize] {
                        distance[*to as usize] = through_here;
                        // By rounding, a bucket may be the present one again, but not an earlier one.
                        let slot = bucket(through_here).max(at) % ring.len();
                        ring[slot].push((through_here, *to));
                        waiting += 1;
                    }
                }
            }
            at += 1;
        }
        distance
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    /// Relaxes all edges until nothing changes (Bellman 1958).
    fn slowly(nodes: usize, edges: &[(u32, u32, f32)], sources: &[usize]) -> Vec<f32> {
        let mut distance = vec![f32::INFINITY; nodes];
        sources.iter().for_each(|&i| distance[i] = 0.0);
        loop {
            let before = distance.clone();
            for (i, j, weight) in edges {
                let (i, j, length) = (*i as usize, *j as usize, 1.0 / weight.max(LEAST_WEIGHT));
                distance[j] = distance[j].min(distance[i] + length);
                distance[i] = distance[i].min(distance[j] + length);
            }
            if distance == before {
                return distance;
            }
        }
    }

    #[test]
    fn paths_are_the_shortest_ones_to_the_last_bit() {
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        for case in 0..40 {
            let nodes = 60;
            let mut edges = Vec::new();
            for i in 0..nodes as u32 {
                for j in i + 1..nodes as u32 {
                    if rng.random::<f32>() < 0.05 {
                        // From short steps of one length to the longest ones.
                        let weight = rng.random::<f32>().powi(1 + case % 4 * 3);
                        edges.push((i, j, if case % 3 == 0 { weight.max(0.9) } else { weight }));
                    }
                }
            }
            let sources: Vec<usize> = (0..nodes).filter(|_| rng.random::<f32>() < 0.1).collect();
            let found = SurfaceGraph::new(nodes, &edges).distances(sources.iter().copied());
            assert_eq!(found, slowly(nodes, &edges, &sources), "case {case}");
        }
        assert_eq!(SurfaceGraph::new(3, &[]).distances([1].into_iter()), [f32::INFINITY, 0.0, f32::INFINITY]);
    }
}
