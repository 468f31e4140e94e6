//! Reverse Cuthill–McKee: a numbering with a narrow band.
//!
//! E. Cuthill, J. McKee (1969), Proc. 24th ACM Nat. Conf., 157; starts from a pseudo-peripheral node
//! (A. George, J. Liu 1979). Ties are broken by the user's numbering, so the result is reproducible.

use std::collections::VecDeque;

use super::SymMatrix;

/// A numbering and the half bandwidth it gives.
#[derive(Debug, Clone)]
pub(super) struct Order {
    /// User's index of each new index; `None` keeps the user's numbering.
    pub old_of_new: Option<Vec<u32>>,
    /// Half bandwidth in the new numbering.
    pub half_bandwidth: usize,
}

/// The narrower of the user's numbering and reverse Cuthill–McKee.
pub(super) fn narrowest(matrix: &SymMatrix) -> Order {
    let natural = Order {
        old_of_new: None,
        half_bandwidth: matrix.half_bandwidth(),
    };
    if natural.half_bandwidth <= 1 {
        return natural;
    }
    let old_of_new = reverse_cuthill_mckee(matrix);
    let mut new_of_old = vec![0usize; matrix.n()];
    for (new, &old) in old_of_new.iter().enumerate() {
        new_of_old[old as usize] = new;
    }
    let half_bandwidth = matrix
        .entries()
        .map(|(i, j, _)| new_of_old[i].abs_diff(new_of_old[j]))
        .max()
        .unwrap_or(0);
    if half_bandwidth < natural.half_bandwidth {
        Order {
            old_of_new: Some(old_of_new),
            half_bandwidth,
        }
    } else {
        natural
    }
}

fn reverse_cuthill_mckee(matrix: &SymMatrix) -> Vec<u32> {
    let n = matrix.n();
    let degree: Vec<usize> = (0..n).map(|i| matrix.row(i).count()).collect();
    let mut placed = vec![false; n];
    let mut order: Vec<u32> = Vec::with_capacity(n);
    for seed in 0..n {
        if placed[seed] {
            continue;
        }
        let start = peripheral(matrix, &degree, seed);
        let first = order.len();
        order.push(start as u32);
        placed[start] = true;
        let mut next = first;
        while let Some(&node) = order.get(next) {
            next += 1;
            let mut neighbours: Vec<usize> = matrix
                .row(node as usize)
                .map(|(j, _)| j)
                .filter(|&j| !placed[j])
                .collect();
            neighbours.sort_by_key(|&j| (degree[j], j));
            for j in neighbours {
                placed[j] = true;
                order.push(j as u32);
            }
        }
    }
    order.reverse();
    order
}

/// A node far from the others of its component: repeat breadth-first search while the depth grows.
fn peripheral(matrix: &SymMatrix, degree: &[usize], seed: usize) -> usize {
    let (mut start, mut depth) = (seed, 0);
    // The depth grows with each turn and is bounded by n; in practice two or three turns.
    loop {
        let (last_level, found) = deepest_level(matrix, start);
        match last_level.into_iter().min_by_key(|&i| (degree[i], i)) {
            Some(candidate) if found > depth => (start, depth) = (candidate, found),
            _ => return start,
        }
    }
}

fn deepest_level(matrix: &SymMatrix, start: usize) -> (Vec<usize>, usize) {
    let mut level = vec![usize::MAX; matrix.n()];
    let mut queue = VecDeque::from([start]);
    level[start] = 0;
    let mut reached = vec![start];
    while let Some(i) = queue.pop_front() {
        for (j, _) in matrix.row(i) {
            if level[j] == usize::MAX {
                level[j] = level[i] + 1;
                queue.push_back(j);
                reached.push(j);
            }
        }
    }
    let depth = reached.last().map_or(0, |&i| level[i]);
    reached.retain(|&i| level[i] == depth);
    (reached, depth)
}
