//! Minimum cuts by Dinic's algorithm, in integers.

use std::collections::VecDeque;

/// The level of nodes that are not reached.
const FAR: u32 = u32::MAX;

/// A residual network between a source and a sink.
pub(super) struct Flow {
    /// Arcs that leave each node: `start[v] .. start[v + 1]`.
    start: Vec<u32>,
    head: Vec<u32>,
    /// The reverse arc.
    back: Vec<u32>,
    capacity: Vec<i64>,
    source: Vec<i64>,
    sink: Vec<i64>,
}

impl Flow {
    /// Nodes with arcs of these capacities. A positive `lead` is the capacity from the source, a
    /// negative one that to the sink.
    pub(super) fn new(nodes: usize, arcs: &[([u32; 2], i64)], lead: &[i64]) -> Self {
        let mut start = vec![0u32; nodes + 1];
        arcs.iter().flat_map(|(ends, _)| ends).for_each(|v| start[*v as usize + 1] += 1);
        for v in 0..nodes {
            start[v + 1] += start[v];
        }
        let mut fill = start.clone();
        let (mut head, mut back, mut capacity) =
            (vec![0; 2 * arcs.len()], vec![0; 2 * arcs.len()], vec![0; 2 * arcs.len()]);
        for &([a, b], c) in arcs {
            let (there, here) = (fill[a as usize], fill[b as usize]);
            fill[a as usize] += 1;
            fill[b as usize] += 1;
            (head[there as usize], back[there as usize], capacity[there as usize]) = (b, here, c);
            (head[here as usize], back[here as usize]) = (a, there);
        }
        let side = |sign: i64| lead.iter().map(|l| (sign * l).max(0)).collect();
        Self { start, head, back, capacity, source: side(1), sink: side(-1) }
    }

    /// Computes a maximum flow.
    pub(super) fn run(&mut self) {
        let nodes = self.source.len();
        let mut level = vec![FAR; nodes];
        let mut next = self.start.clone();
        while self.levels(&mut level) {
            next.copy_from_slice(&self.start);
            for s in 0..nodes {
                if self.source[s] > 0 {
                    self.augment(s, &mut level, &mut next);
                }
            }
        }
    }

    /// Breadth-first levels from the source; returns whether the sink is reached.
    fn levels(&self, level: &mut [u32]) -> bool {
        level.fill(FAR);
        let mut queue: VecDeque<usize> = (0..level.len()).filter(|v| self.source[*v] > 0).collect();
        queue.iter().for_each(|v| level[*v] = 0);
        let mut reached = false;
        while let Some(v) = queue.pop_front() {
            reached |= self.sink[v] > 0;
            for a in self.start[v] as usize..self.start[v + 1] as usize {
                let to = self.head[a] as usize;
                if self.capacity[a] > 0 && level[to] == FAR {
                    level[to] = level[v] + 1;
                    queue.push_back(to);
                }
            }
        }
        reached
    }

    /// Augments along shortest paths from `s` until it is exhausted, or there is no path.
    fn augment(&mut self, s: usize, level: &mut [u32], next: &mut [u32]) {
        let mut path: Vec<usize> = Vec::new();
        let mut v = s;
        loop {
            if self.sink[v] > 0 {
                let narrowest = path
                    .iter()
                    .map(|a| self.capacity[*a])
                    .fold(self.source[s].min(self.sink[v]), i64::min);
                self.source[s] -= narrowest;
                self.sink[v] -= narrowest;
                for a in path.drain(..) {
                    self.capacity[a] -= narrowest;
                    self.capacity[self.back[a] as usize] += narrowest;
                }
                if self.source[s] == 0 {
                    return;
                }
                v = s;
                continue;
            }
            let onward = (next[v]..self.start[v + 1]).find(|a| {
                self.capacity[*a as usize] > 0
                    && level[self.head[*a as usize] as usize] == level[v].wrapping_add(1)
            });
            match onward {
                Some(a) => {
                    next[v] = a;
                    path.push(a as usize);
                    v = self.head[a as usize] as usize;
                }
                None => {
                    next[v] = self.start[v + 1];
                    level[v] = FAR; // a dead end
                    let Some(a) = path.pop() else { return };
                    v = self.head[self.back[a] as usize] as usize;
                }
            }
        }
    }

    /// The nodes from which the sink can still be reached: the smallest sink side of a minimum cut.
    pub(super) fn sink_side(&self) -> Vec<bool> {
        let mut side: Vec<bool> = self.sink.iter().map(|c| *c > 0).collect();
        let mut stack: Vec<usize> = (0..side.len()).filter(|v| side[*v]).collect();
        while let Some(v) = stack.pop() {
            for a in self.start[v] as usize..self.start[v + 1] as usize {
                let from = self.head[a] as usize;
                if !side[from] && self.capacity[self.back[a] as usize] > 0 {
                    side[from] = true;
                    stack.push(from);
                }
            }
        }
        side
    }
}
