//! Nested dissection: a numbering for sparse factors in which few rows separate large parts.
//!
//! A. George (1973), SIAM J. Numer. Anal. 10:345. A part is cut where the distances to two of its far nodes are equal; of
//! several such pairs the smallest cut that leaves a fair share on both sides is taken. The nodes of a cut are numbered
//! after both sides. Distances count edges and ties go by the user's numbering, so the result is reproducible.

use std::collections::VecDeque;

use super::SymMatrix;

/// Parts of at most this many nodes are not cut.
const SMALLEST: usize = 24;
/// Far nodes of a part.
const LANDMARKS: usize = 5;
/// Least share of a part that either side of a cut must have.
const FAIR: f64 = 0.2;

const UNREACHED: u32 = u32::MAX;

/// User's index of each new index.
#[must_use]
pub fn nested_dissection(matrix: &SymMatrix) -> Vec<u32> {
    let n = matrix.n();
    let mut graph = Graph {
        matrix,
        part_of: vec![0; n],
        parts: 0,
        distance: [(); LANDMARKS].map(|()| vec![UNREACHED; n]),
        side: vec![false; n],
        queue: VecDeque::new(),
    };
    let mut order = vec![0u32; n];
    // Parts with the first of their new indices.
    let mut waiting = vec![((0..n as u32).collect::<Vec<u32>>(), 0)];
    while let Some((nodes, begin)) = waiting.pop() {
        match graph.cut(&nodes) {
            Some(cut) => {
                let second = begin + cut.one.len();
                let last = second + cut.other.len();
                order[last..last + cut.between.len()].copy_from_slice(&cut.between);
                waiting.push((cut.one, begin));
                waiting.push((cut.other, second));
            }
            None => order[begin..begin + nodes.len()].copy_from_slice(&nodes),
        }
    }
    order
}

/// Two landmarks, the key that parts the nodes between them, and the side that gives its border up.
#[derive(Debug, Clone, Copy)]
struct Split {
    a: usize,
    b: usize,
    limit: i64,
    inner: bool,
}

/// A part in three: no edge joins `one` and `other`.
struct Cut {
    one: Vec<u32>,
    other: Vec<u32>,
    between: Vec<u32>,
}

struct Graph<'a> {
    matrix: &'a SymMatrix,
    /// Part of each node, when it was last visited.
    part_of: Vec<u32>,
    parts: u32,
    /// Edges from each landmark.
    distance: [Vec<u32>; LANDMARKS],
    /// Side of each node in the present trial cut.
    side: Vec<bool>,
    queue: VecDeque<u32>,
}

impl Graph<'_> {
    /// Cuts a part, unless it is small or too densely joined.
    fn cut(&mut self, nodes: &[u32]) -> Option<Cut> {
        if nodes.len() <= SMALLEST {
            return None;
        }
        self.parts += 1;
        for &node in nodes {
            self.part_of[node as usize] = self.parts;
        }
        let start = *nodes.first()?;
        self.measure(0, start, nodes);
        if let Some(parted) = self.parted(nodes) {
            return Some(parted);
        }
        // A far node to begin with, then always the one farthest from all before.
        let mut found = 1;
        let first = self.farthest(1, nodes);
        self.measure(0, first, nodes);
        while found < LANDMARKS {
            let next = self.farthest(found, nodes);
            self.measure(found, next, nodes);
            found += 1;
        }
        let pairs = (0..found).flat_map(|a| (a + 1..found).map(move |b| (a, b)));
        let mut best: Option<((usize, usize), Split)> = None;
        for (a, b) in pairs {
            let mut keys: Vec<i64> = nodes.iter().map(|&node| self.key(a, b, node)).collect();
            let middle = keys.len() / 2;
            let (_, &mut median, _) = keys.select_nth_unstable(middle);
            for limit in [median, median + 1] {
                for inner in [true, false] {
                    let (one, between) = self.sizes(a, b, limit, inner, nodes);
                    let smaller = one.min(nodes.len() - one - between);
                    if (smaller as f64) < FAIR * nodes.len() as f64 {
                        continue;
                    }
                    // The smallest cut; of equal ones the most even.
                    let rank = (between, nodes.len() - smaller);
                    if best.is_none_or(|(best, _)| rank < best) {
                        let split = Split { a, b, limit, inner };
                        best = Some((rank, split));
                    }
                }
            }
        }
        let (_, Split { a, b, limit, inner }) = best?;
        self.take_sides(a, b, limit, nodes);
        let mut cut = Cut {
            one: Vec::new(),
            other: Vec::new(),
            between: Vec::new(),
        };
        for &node in nodes {
            let list = if self.touches(node, inner) {
                &mut cut.between
            } else if self.side[node as usize] {
                &mut cut.one
            } else {
                &mut cut.other
            };
            list.push(node);
        }
        Some(cut)
    }

    /// Splits the nodes into those that the search from the first node has reached and the rest, if there is a rest.
    fn parted(&self, nodes: &[u32]) -> Option<Cut> {
        let (one, other): (Vec<u32>, Vec<u32>) = nodes
            .iter()
            .partition(|&&node| self.distance[0][node as usize] != UNREACHED);
        (!other.is_empty()).then_some(Cut {
            one,
            other,
            between: Vec::new(),
        })
    }

    /// Distances within the part from one node, as those of landmark `which`.
    fn measure(&mut self, which: usize, from: u32, nodes: &[u32]) {
        let distance = &mut self.distance[which];
        for &node in nodes {
            distance[node as usize] = UNREACHED;
        }
        distance[from as usize] = 0;
        self.queue.push_back(from);
        while let Some(node) = self.queue.pop_front() {
            let next = distance[node as usize] + 1;
            for (neighbour, _) in self.matrix.row(node as usize) {
                if self.part_of[neighbour] == self.parts && distance[neighbour] == UNREACHED {
                    distance[neighbour] = next;
                    self.queue.push_back(neighbour as u32);
                }
            }
        }
    }

    /// The first of the nodes that are farthest from the nearest of the first `known` landmarks.
    fn farthest(&self, known: usize, nodes: &[u32]) -> u32 {
        let nearest = |node: u32| {
            let all = self.distance[..known].iter();
            all.map(|of| of[node as usize]).min().unwrap_or(0)
        };
        let mut far = (0, nodes.first().copied().unwrap_or(0));
        for &node in nodes {
            let distance = nearest(node);
            if distance > far.0 {
                far = (distance, node);
            }
        }
        far.1
    }

    fn key(&self, a: usize, b: usize, node: u32) -> i64 {
        let of = |which: usize| i64::from(self.distance[which][node as usize]);
        of(a) - of(b)
    }

    fn take_sides(&mut self, a: usize, b: usize, limit: i64, nodes: &[u32]) {
        for &node in nodes {
            self.side[node as usize] = self.key(a, b, node) < limit;
        }
    }

    /// True if a node is on the side that gives its border to the cut and touches the other side.
    fn touches(&self, node: u32, inner: bool) -> bool {
        self.side[node as usize] == inner
            && self.matrix.row(node as usize).any(|(neighbour, _)| {
                self.part_of[neighbour] == self.parts && self.side[neighbour] != inner
            })
    }

    /// Nodes on the nearer side without the cut, and in the cut.
    fn sizes(
        &mut self,
        a: usize,
        b: usize,
        limit: i64,
        inner: bool,
        nodes: &[u32],
    ) -> (usize, usize) {
        self.take_sides(a, b, limit, nodes);
        let (mut one, mut between) = (0, 0);
        for &node in nodes {
            if self.touches(node, inner) {
                between += 1;
            } else if self.side[node as usize] {
                one += 1;
            }
        }
        (one, between)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(side: usize) -> SymMatrix {
        let at = |i: usize, j: usize| i * side + j;
        let mut entries = Vec::new();
        for i in 0..side {
            for j in 0..side {
                entries.push((at(i, j), at(i, j), 4.0));
                if i + 1 < side {
                    entries.push((at(i, j), at(i + 1, j), -1.0));
                }
                if j + 1 < side {
                    entries.push((at(i, j), at(i, j + 1), -1.0));
                }
            }
        }
        SymMatrix::from_triplets(side * side, entries)
    }

    #[test]
    fn every_node_is_numbered_once() {
        let parted = SymMatrix::diagonal(&[1.0; 100]);
        let full =
            SymMatrix::from_triplets(40, (0..40).flat_map(|i| (i..40).map(move |j| (i, j, 1.0))));
        for matrix in [grid(1), grid(3), grid(17), parted, full] {
            let mut order = nested_dissection(&matrix);
            order.sort_unstable();
            let all: Vec<u32> = (0..matrix.n() as u32).collect();
            assert_eq!(order, all);
        }
    }

    #[test]
    fn square_grid_is_first_cut_along_a_line() {
        // No set of fewer nodes than a row parts a square into two fair shares.
        let side = 31;
        let order = nested_dissection(&grid(side));
        let cut = &order[side * side - side..];
        let mut parted = vec![false; side * side];
        for &node in cut {
            parted[node as usize] = true;
        }
        // From the first node of the remainder, a search reaches only the nodes of its side.
        let matrix = grid(side);
        let start = (0..side * side).find(|&node| !parted[node]).unwrap();
        let mut waiting = vec![start];
        parted[start] = true;
        let mut reached = 1;
        while let Some(node) = waiting.pop() {
            for (next, _) in matrix.row(node) {
                if !std::mem::replace(&mut parted[next], true) {
                    reached += 1;
                    waiting.push(next);
                }
            }
        }
        let left = side * side - side;
        assert!(
            (left / 4..=3 * left / 4).contains(&reached),
            "{reached} of {left}"
        );
    }
}
