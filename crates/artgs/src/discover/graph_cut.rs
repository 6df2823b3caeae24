//! Labelling by graph cuts: a Potts energy lowered by alpha expansion (Boykov, Veksler and Zabih 2001) over a maximum
//! flow that keeps its two search trees (Boykov and Kolmogorov 2004).

use std::collections::VecDeque;

/// Energies are rounded to thousandths, so that the flow is exact and terminates.
const UNIT: f32 = 1000.0;
const NO_ARC: u32 = u32::MAX;
const TERMINAL: u32 = u32::MAX - 1;
const ORPHAN: u32 = u32::MAX - 2;

/// Lowers `sum data[i][label_i] + smooth * sum weight_ij [label_i != label_j]` from the given labels by at most `sweeps`
/// rounds of expansion. `data` is `[n * parts]`; no expansion raises the energy, so the result is never worse.
pub(super) fn expand(
    data: &[f32],
    parts: usize,
    edges: &[(u32, u32, f32)],
    smooth: f32,
    labels: &mut [u16],
    sweeps: usize,
) {
    let units = |x: f32| (x * UNIT).round() as i32;
    let weights: Vec<i32> = edges.iter().map(|e| units(smooth * e.2)).collect();
    let data: Vec<i32> = data.iter().map(|x| units(*x)).collect();
    let mut flow = Flow::new(labels.len(), edges);
    for _ in 0..sweeps {
        let mut changed = false;
        for alpha in 0..parts as u16 {
            flow.clear();
            for (i, label) in labels.iter().enumerate().filter(|(_, l)| **l != alpha) {
                let row = &data[i * parts..(i + 1) * parts];
                flow.excess[i] += row[usize::from(alpha)] - row[usize::from(*label)];
            }
            for (e, (edge, &w)) in edges.iter().zip(&weights).enumerate() {
                let (i, j) = (edge.0 as usize, edge.1 as usize);
                match (labels[i] == alpha, labels[j] == alpha) {
                    (true, true) => {}
                    (true, false) => flow.excess[j] -= w,
                    (false, true) => flow.excess[i] -= w,
                    (false, false) if labels[i] == labels[j] => flow.connect(e, w, w),
                    (false, false) => {
                        flow.excess[j] -= w;
                        flow.connect(e, w, 0);
                    }
                }
            }
            flow.run();
            for (i, label) in labels.iter_mut().enumerate().filter(|(_, l)| **l != alpha) {
                if !flow.on_source_side(i) {
                    *label = alpha;
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Tree {
    Free,
    Source,
    Sink,
}

/// Where the steps from each node start in a list of all of them, both ways of every edge, and the end: `[nodes + 1]`.
pub(super) fn first_steps(nodes: usize, edges: &[(u32, u32, f32)]) -> Vec<u32> {
    let mut first = vec![0u32; nodes + 1];
    for (i, j, _) in edges {
        first[*i as usize + 1] += 1;
        first[*j as usize + 1] += 1;
    }
    for i in 0..nodes {
        first[i + 1] += first[i];
    }
    first
}

/// Maximum flow on a fixed undirected graph whose capacities are set again for each run.
struct Flow {
    /// Arcs of node i are `first[i]..first[i + 1]`.
    first: Vec<u32>,
    head: Vec<u32>,
    twin: Vec<u32>,
    /// The two arcs of each edge, forwards and back.
    arcs_of_edge: Vec<[u32; 2]>,
    capacity: Vec<i32>,
    /// Capacity left from the source (positive) or to the sink (negative).
    excess: Vec<i32>,
    tree: Vec<Tree>,
    /// Arc from a node to its parent.
    parent: Vec<u32>,
    stamp: Vec<u32>,
    distance: Vec<u32>,
    now: u32,
    queued: Vec<bool>,
    active: VecDeque<u32>,
    orphans: VecDeque<u32>,
    steps: Vec<(usize, u32)>,
}

impl Flow {
    fn new(nodes: usize, edges: &[(u32, u32, f32)]) -> Self {
        let first = first_steps(nodes, edges);
        let mut next = first.clone();
        let (mut head, mut twin) = (vec![0; 2 * edges.len()], vec![0; 2 * edges.len()]);
        let mut arcs_of_edge = Vec::with_capacity(edges.len());
        for (i, j, _) in edges {
            let (a, b) = (next[*i as usize], next[*j as usize]);
            next[*i as usize] += 1;
            next[*j as usize] += 1;
            (head[a as usize], head[b as usize]) = (*j, *i);
            (twin[a as usize], twin[b as usize]) = (b, a);
            arcs_of_edge.push([a, b]);
        }
        Self {
            first,
            capacity: vec![0; head.len()],
            head,
            twin,
            arcs_of_edge,
            excess: vec![0; nodes],
            tree: vec![Tree::Free; nodes],
            parent: vec![NO_ARC; nodes],
            stamp: vec![0; nodes],
            distance: vec![0; nodes],
            now: 0,
            queued: vec![false; nodes],
            active: VecDeque::new(),
            orphans: VecDeque::new(),
            steps: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.capacity.fill(0);
        self.excess.fill(0);
    }

    fn connect(&mut self, edge: usize, forwards: i32, back: i32) {
        let [a, b] = self.arcs_of_edge[edge];
        self.capacity[a as usize] = forwards;
        self.capacity[b as usize] = back;
    }

    fn on_source_side(&self, node: usize) -> bool {
        // Nodes that neither tree reaches keep their label.
        self.tree[node] != Tree::Sink
    }

    fn activate(&mut self, node: u32) {
        if !std::mem::replace(&mut self.queued[node as usize], true) {
            self.active.push_back(node);
        }
    }

    /// Capacity left on the way between the two ends of an arc that leaves a node of `tree`.
    fn residual(&self, tree: Tree, arc: u32) -> i32 {
        self.capacity[if tree == Tree::Source { arc } else { self.twin[arc as usize] } as usize]
    }

    fn run(&mut self) {
        self.active.clear();
        self.orphans.clear();
        self.queued.fill(false);
        self.stamp.fill(0);
        self.now = 0;
        for i in 0..self.tree.len() {
            self.tree[i] = match self.excess[i] {
                0 => Tree::Free,
                x if x > 0 => Tree::Source,
                _ => Tree::Sink,
            };
            self.parent[i] = NO_ARC;
            if self.tree[i] != Tree::Free {
                self.parent[i] = TERMINAL;
                self.distance[i] = 1;
                self.activate(i as u32);
            }
        }
        while let Some(&node) = self.active.front() {
            if self.tree[node as usize] != Tree::Free
                && let Some(arc) = self.grow(node)
            {
                self.now += 1;
                self.augment(arc);
                self.adopt();
                continue;
            }
            self.active.pop_front();
            self.queued[node as usize] = false;
        }
    }

    /// Extends the tree of a node to its neighbours; returns an arc from the source tree to the sink tree if they meet.
    fn grow(&mut self, node: u32) -> Option<u32> {
        let i = node as usize;
        let tree = self.tree[i];
        for arc in self.first[i]..self.first[i + 1] {
            if self.residual(tree, arc) == 0 {
                continue;
            }
            let other = self.head[arc as usize];
            let j = other as usize;
            if self.tree[j] == Tree::Free {
                self.tree[j] = tree;
                self.parent[j] = self.twin[arc as usize];
                self.stamp[j] = self.stamp[i];
                self.distance[j] = self.distance[i] + 1;
                self.activate(other);
            } else if self.tree[j] != tree {
                return Some(if tree == Tree::Source { arc } else { self.twin[arc as usize] });
            } else if self.stamp[j] <= self.stamp[i] && self.distance[j] > self.distance[i] + 1 {
                self.parent[j] = self.twin[arc as usize];
                self.stamp[j] = self.stamp[i];
                self.distance[j] = self.distance[i] + 1;
            }
        }
        None
    }

    /// Calls `visit` with every node from `from` to the root of its tree and the arc to the parent.
    fn path(&self, from: u32, mut visit: impl FnMut(usize, u32)) {
        let mut node = from as usize;
        loop {
            let up = self.parent[node];
            visit(node, up);
            if up == TERMINAL {
                return;
            }
            node = self.head[up as usize] as usize;
        }
    }

    /// Pushes as much as the path through the arc takes.
    fn augment(&mut self, arc: u32) {
        let (source_end, sink_end) = (self.head[self.twin[arc as usize] as usize], self.head[arc as usize]);
        let mut amount = self.capacity[arc as usize];
        for end in [source_end, sink_end] {
            let tree = self.tree[end as usize];
            self.path(end, |node, up| {
                let left = match (up, tree) {
                    (TERMINAL, _) => self.excess[node].abs(),
                    (_, Tree::Source) => self.capacity[self.twin[up as usize] as usize],
                    _ => self.capacity[up as usize],
                };
                amount = amount.min(left);
            });
        }
        self.push(arc, amount);
        for end in [source_end, sink_end] {
            let tree = self.tree[end as usize];
            let mut steps = std::mem::take(&mut self.steps);
            steps.clear();
            self.path(end, |node, up| steps.push((node, up)));
            for &(node, up) in &steps {
                let full = if up == TERMINAL {
                    self.excess[node] -= if tree == Tree::Source { amount } else { -amount };
                    self.excess[node] == 0
                } else {
                    let along = if tree == Tree::Source { self.twin[up as usize] } else { up };
                    self.push(along, amount);
                    self.capacity[along as usize] == 0
                };
                if full {
                    self.parent[node] = ORPHAN;
                    self.orphans.push_back(node as u32);
                }
            }
            self.steps = steps;
        }
    }

    fn push(&mut self, arc: u32, amount: i32) {
        self.capacity[arc as usize] -= amount;
        self.capacity[self.twin[arc as usize] as usize] += amount;
    }

    /// Distance of a node to the root of its tree, if it is still connected to one. Stores the distances of the nodes on the way.
    fn depth(&mut self, node: u32) -> Option<u32> {
        let (mut at, mut steps) = (node as usize, 0);
        loop {
            if self.stamp[at] == self.now {
                steps += self.distance[at];
                break;
            }
            match self.parent[at] {
                TERMINAL => {
                    self.stamp[at] = self.now;
                    self.distance[at] = 1;
                    steps += 1;
                    break;
                }
                ORPHAN | NO_ARC => return None,
                up => at = self.head[up as usize] as usize,
            }
            steps += 1;
        }
        let (mut at, mut left) = (node as usize, steps);
        while self.stamp[at] != self.now {
            self.stamp[at] = self.now;
            self.distance[at] = left;
            left -= 1;
            at = self.head[self.parent[at] as usize] as usize;
        }
        Some(steps)
    }

    /// Finds new parents for nodes cut off from their root, or takes them out of their tree.
    fn adopt(&mut self) {
        while let Some(node) = self.orphans.pop_front() {
            let i = node as usize;
            let tree = self.tree[i];
            let mut best: Option<(u32, u32)> = None;
            for arc in self.first[i]..self.first[i + 1] {
                // Flow runs from the parent to the node in the source tree, and from the node to the parent in the sink tree.
                if self.residual(tree, self.twin[arc as usize]) == 0
                    || self.tree[self.head[arc as usize] as usize] != tree
                {
                    continue;
                }
                if let Some(d) = self.depth(self.head[arc as usize])
                    && best.is_none_or(|b| d < b.0)
                {
                    best = Some((d, arc));
                }
            }
            if let Some((d, arc)) = best {
                self.parent[i] = arc;
                self.stamp[i] = self.now;
                self.distance[i] = d + 1;
                continue;
            }
            self.tree[i] = Tree::Free;
            self.parent[i] = NO_ARC;
            for arc in self.first[i]..self.first[i + 1] {
                let other = self.head[arc as usize];
                let j = other as usize;
                if self.tree[j] != tree {
                    continue;
                }
                if self.residual(tree, self.twin[arc as usize]) > 0 {
                    self.activate(other);
                }
                let up = self.parent[j];
                if up < ORPHAN && self.head[up as usize] == node {
                    self.parent[j] = ORPHAN;
                    self.orphans.push_back(other);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    fn energy(data: &[f32], parts: usize, edges: &[(u32, u32, f32)], labels: &[u16]) -> f32 {
        let own: f32 = labels.iter().enumerate().map(|(i, l)| data[i * parts + usize::from(*l)]).sum();
        let cut = edges.iter().filter(|e| labels[e.0 as usize] != labels[e.1 as usize]);
        own + cut.map(|e| e.2).sum::<f32>()
    }

    fn problem(rng: &mut Pcg64Mcg, nodes: usize, parts: usize) -> (Vec<f32>, Vec<(u32, u32, f32)>) {
        let thousandths = |rng: &mut Pcg64Mcg| (rng.random::<f32>() * 1000.0).round() / 1000.0;
        let data = (0..nodes * parts).map(|_| thousandths(rng)).collect();
        let mut edges = Vec::new();
        for i in 0..nodes as u32 {
            for j in i + 1..nodes as u32 {
                if rng.random::<f32>() < 0.4 {
                    edges.push((i, j, 0.7 * thousandths(rng)));
                }
            }
        }
        (data, edges)
    }

    fn every_labelling(nodes: usize, parts: usize) -> impl Iterator<Item = Vec<u16>> {
        (0..parts.pow(nodes as u32))
            .map(move |c| (0..nodes).map(|i| (c / parts.pow(i as u32) % parts) as u16).collect())
    }

    #[test]
    fn two_labels_are_cut_exactly() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        for _ in 0..60 {
            let (data, edges) = problem(&mut rng, 11, 2);
            let mut labels = vec![0; 11];
            expand(&data, 2, &edges, 1.0, &mut labels, 3);
            let best = every_labelling(11, 2).map(|l| energy(&data, 2, &edges, &l)).fold(f32::INFINITY, f32::min);
            let found = energy(&data, 2, &edges, &labels);
            assert!(found < best + 0.02, "{found} against {best}");
        }
    }

    #[test]
    fn four_labels_come_close_to_the_best() {
        let mut rng = Pcg64Mcg::seed_from_u64(6);
        let (mut found, mut best) = (0.0, 0.0);
        for _ in 0..20 {
            let (data, edges) = problem(&mut rng, 7, 4);
            let mut labels = vec![3; 7];
            expand(&data, 4, &edges, 1.0, &mut labels, 5);
            found += energy(&data, 4, &edges, &labels);
            best += every_labelling(7, 4).map(|l| energy(&data, 4, &edges, &l)).fold(f32::INFINITY, f32::min);
        }
        assert!(found < 1.02 * best + 0.1, "{found} against {best}");
    }

    #[test]
    fn a_tie_is_cut_where_the_graph_is_thinnest() {
        // A strip of 40 x 6 points, sure at both ends only; the weak seam lies off the middle.
        let (long, wide) = (40usize, 6usize);
        let at = |x: usize, y: usize| (x * wide + y) as u32;
        let mut data = vec![0.0; long * wide * 2];
        let mut edges = Vec::new();
        for x in 0..long {
            for y in 0..wide {
                if x == 0 || x == long - 1 {
                    data[at(x, y) as usize * 2 + usize::from(x == 0)] = 1.0;
                }
                if x + 1 < long {
                    edges.push((at(x, y), at(x + 1, y), if x == 29 { 0.2 } else { 1.0 }));
                }
                if y + 1 < wide {
                    edges.push((at(x, y), at(x, y + 1), 1.0));
                }
            }
        }
        let mut labels = vec![0; long * wide];
        expand(&data, 2, &edges, 0.4, &mut labels, 3);
        for x in 0..long {
            assert!((0..wide).all(|y| labels[at(x, y) as usize] == u16::from(x >= 30)), "column {x}");
        }
    }
}
