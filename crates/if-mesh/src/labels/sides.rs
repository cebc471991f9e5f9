//! Frames that agree among themselves on another label than most.
//!
//! A program that labels videos may take one garment for another for seconds: from behind a jacket is a T-shirt, as no
//! frame of these sees its front. Within such a run of frames all agree, and where no others look they
//! decide. But at both ends of it frames see the same surface and give it two labels. For each pair of labels that
//! surface is disputed between:
//!
//! ```text
//! two frames that look at the same surface are opposed if one calls most of what the other calls a label by the
//! other label, and agree else; the evidence is the number of votes
//! of the plainest evidence first, frames are put on the same side or on opposite ones
//! of two sides the one with fewer frames is wrong, if it has more than one: half of its votes for the label that it
//! gives go to the other one, so that the surface beside decides
//! ```
//!
//! Single frames are left to [`super::contradictions`].

use super::contradictions::{Contradiction, FrameVotes, LEAST, MOST};
use if_core::math::Real;
use rayon::prelude::*;
use std::cmp::Ordering;

/// Most vertices that are looked at, evenly among all.
const VERTICES: usize = 10_000;
/// The evidence between two sides counts if it is so many times that against it.
const PLAIN: Real = 2.0;

/// The label that a frame gives a vertex, and its vote.
#[derive(Clone, Copy)]
struct Called {
    frame: u32,
    label: u8,
    vote: Real,
}

/// Votes of two frames where they both look, by the label that the first one gives and the one that the second
/// gives: either of the disputed ones, or another.
type Shared = [[Real; 3]; 3];

/// The frames of a side that is wrong.
struct Minority {
    frames: Vec<usize>,
    pair: [u8; 2],
    /// Which labels of the pair they give to what is of the other one.
    doubted: [bool; 2],
}

/// Gives half of each doubted vote of a side that is wrong to either label of the pair, and returns which were
/// doubted: without any vote the cloth would count as not seen. `vertices` is the number of vertices.
pub(super) fn withdraw_minorities(
    frames: &mut [FrameVotes],
    vertices: usize,
    labels: usize,
) -> Vec<Contradiction> {
    let called = called(frames, vertices);
    let minorities: Vec<Minority> = disputed(&called, labels)
        .into_par_iter()
        .flat_map_iter(|pair| minorities(&called, frames.len(), pair))
        .collect();
    let mut found = Vec::new();
    for Minority { frames: few, pair, doubted } in minorities {
        for frame in &few {
            frames[*frame].votes = halved(&frames[*frame].votes, pair, doubted);
        }
        for k in (0..2).filter(|k| doubted[*k]) {
            let of = |frame: &usize| Contradiction {
                frame: frames[*frame].frame,
                label: pair[k],
                others: pair[1 - k],
            };
            found.extend(few.iter().map(of));
        }
    }
    found
}

/// The votes of a frame with each for a doubted label of the pair given to both.
fn halved(votes: &[(u32, u8, f32)], pair: [u8; 2], doubted: [bool; 2]) -> Vec<(u32, u8, f32)> {
    let mut all = Vec::with_capacity(2 * votes.len());
    for of_vertex in votes.chunk_by(|a, b| a.0 == b.0) {
        let of = |label| of_vertex.iter().find(|v| v.1 == label).map_or(0.0, |v| v.2);
        let own = pair.map(of);
        let shared: f32 = (0..2).filter(|k| doubted[*k]).map(|k| 0.5 * own[k]).sum();
        all.extend(of_vertex.iter().filter(|v| !pair.contains(&v.1)));
        for k in 0..2 {
            let vote = shared + if doubted[k] { 0.0 } else { own[k] };
            if vote > 0.0 {
                all.push((of_vertex[0].0, pair[k], vote));
            }
        }
    }
    all
}

/// What frames call each vertex that is looked at; frames are in order.
fn called(frames: &[FrameVotes], vertices: usize) -> Vec<Vec<Called>> {
    let step = vertices.div_ceil(VERTICES).max(1) as u32;
    let mut called = vec![Vec::new(); vertices.div_ceil(step as usize)];
    for (frame, own) in (0..).zip(frames) {
        for of_vertex in own.votes.chunk_by(|a, b| a.0 == b.0) {
            let v = of_vertex[0].0;
            if v % step == 0 {
                // Of equal ones the smaller label.
                let most = of_vertex.iter().rev().max_by(|a, b| a.2.total_cmp(&b.2));
                let (_, label, vote) = *most.expect("groups are not empty");
                called[(v / step) as usize].push(Called { frame, label, vote: vote.into() });
            }
        }
    }
    called
}

/// The pairs of labels that more than a border is disputed between.
fn disputed(called: &[Vec<Called>], labels: usize) -> Vec<[u8; 2]> {
    let (mut all, mut both) = (vec![0.0; labels], vec![0.0; labels * labels]);
    let mut sums = vec![0.0; labels];
    for of_vertex in called {
        sums.fill(0.0);
        of_vertex.iter().for_each(|c| sums[usize::from(c.label)] += c.vote);
        for a in (0..labels).filter(|a| sums[*a] > 0.0) {
            all[a] += sums[a];
            for b in (0..a).filter(|b| sums[*b] > 0.0) {
                both[a * labels + b] += sums[a].min(sums[b]);
            }
        }
    }
    let pairs = (0..labels).flat_map(|a| (0..a).map(move |b| (a, b)));
    let is_disputed = |(a, b): &(usize, usize)| both[a * labels + b] > LEAST * all[*a].min(all[*b]);
    pairs.filter(is_disputed).map(|(a, b)| [b as u8, a as u8]).collect()
}

/// The frames that take a label of a pair for the other one: those that are fewer than the ones that say so.
fn minorities(called: &[Vec<Called>], frames: usize, pair: [u8; 2]) -> Vec<Minority> {
    let shared = shared(called, frames, pair);
    let pairs = (0..frames).flat_map(|j| (0..j).map(move |i| (i, j)));
    let mut evidence: Vec<(Real, usize, usize)> =
        pairs.zip(&shared).map(|((i, j), shared)| (agreement(shared), i, j)).collect();
    evidence.retain(|(weight, ..)| *weight != 0.0);
    evidence.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let mut sides = Sides::new(frames);
    evidence.iter().for_each(|(weight, i, j)| sides.join(*i, *j, *weight < 0.0));
    let of: Vec<(usize, bool)> = (0..frames).map(|k| sides.of(k)).collect();

    let minority = |group: usize| {
        let of_side = |side| (0..frames).filter(|k| of[*k] == (group, side)).collect::<Vec<_>>();
        let [one, other] = [false, true].map(of_side);
        // Of as many on both sides none knows better.
        let (few, side) = match one.len().cmp(&other.len()) {
            Ordering::Less => (one, false),
            Ordering::Greater => (other, true),
            Ordering::Equal => return None,
        };
        let (mut between, mut against) = (0.0, 0.0);
        // What the few call by each label, by what the others call it.
        let mut sum = Shared::default();
        for &(weight, i, j) in evidence.iter().filter(|(_, i, _)| of[*i].0 == group) {
            match (of[i].1 != of[j].1, weight < 0.0) {
                (true, true) => between -= weight,
                (true, false) | (false, true) => against += weight.abs(),
                (false, false) => {}
            }
            if of[i].1 != of[j].1 {
                let shared = &shared[row(j) + i];
                for (a, b) in (0..3).flat_map(|a| (0..3).map(move |b| (a, b))) {
                    sum[a][b] += if of[i].1 == side { shared[a][b] } else { shared[b][a] };
                }
            }
        }
        let doubted = [(0, 1), (1, 0)].map(|(label, others)| {
            sum[label][others] > MOST * sum.iter().map(|of| of[others]).sum::<Real>()
        });
        // A single frame is judged by itself, not by those that agree with it.
        let is_plain = few.len() > 1 && between > PLAIN * against;
        is_plain.then_some(Minority { frames: few, pair, doubted })
    };
    (0..frames).filter(|k| of[*k].0 == *k).filter_map(minority).collect()
}

/// Where the pairs of frame `j` with those before it begin.
fn row(j: usize) -> usize {
    j * j.saturating_sub(1) / 2
}

/// For each two frames i < j, at row(j) + i, what they both see.
fn shared(called: &[Vec<Called>], frames: usize, pair: [u8; 2]) -> Vec<Shared> {
    let mut shared = vec![Shared::default(); row(frames)];
    let class = |label: u8| pair.iter().position(|l| *l == label).unwrap_or(2);
    for of_vertex in called.iter().filter(|c| c.iter().any(|c| pair.contains(&c.label))) {
        for (k, second) in of_vertex.iter().enumerate() {
            let row = row(second.frame as usize);
            for first in &of_vertex[..k] {
                shared[row + first.frame as usize][class(first.label)][class(second.label)] +=
                    first.vote.min(second.vote);
            }
        }
    }
    shared
}

/// Votes by which two frames agree; negative if they are opposed.
fn agreement(shared: &Shared) -> Real {
    let opposed = |(a, b): (usize, usize)| {
        let row: Real = shared[a].iter().sum();
        let column: Real = shared.iter().map(|of| of[b]).sum();
        let votes = shared[a][b];
        (votes > MOST * row.min(column) && votes > LEAST * row.max(column)).then_some(votes)
    };
    match [(0, 1), (1, 0)].into_iter().filter_map(opposed).sum::<Real>() {
        0.0 => shared[0][0] + shared[1][1],
        opposed => -opposed,
    }
}

/// Groups of frames, each of two sides.
struct Sides {
    /// A frame of the same group, and whether it is of the other side.
    to: Vec<(usize, bool)>,
}

impl Sides {
    fn new(frames: usize) -> Self {
        Self { to: (0..frames).map(|k| (k, false)).collect() }
    }

    /// The first frame of the group of frame `k`, and whether it is of the other side.
    fn of(&self, mut k: usize) -> (usize, bool) {
        let mut is_other = false;
        while self.to[k].0 != k {
            is_other ^= self.to[k].1;
            k = self.to[k].0;
        }
        (k, is_other)
    }

    /// Puts two frames on the same side, or on opposite ones, unless that is decided.
    fn join(&mut self, i: usize, j: usize, are_opposed: bool) {
        let ((first, a), (second, b)) = (self.of(i), self.of(j));
        if first != second {
            self.to[first.max(second)] = (first.min(second), a ^ b ^ are_opposed);
        }
    }
}
