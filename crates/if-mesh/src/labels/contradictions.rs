//! Labels of whole frames that the other frames contradict.
//!
//! Programs that label images take one garment for another in whole pictures, now and then: a frame calls
//! all trousers jacket. Where many frames look, they outvote it. Where no other frame does, as between
//! the legs, its word would stand, so that none of its votes for this label count.
//!
//! Frames that are wrong contradict the right ones, too. So the plainest contradiction is withdrawn
//! first, and the others are judged without it.

use super::votes::winner;
use if_core::math::Real;
use rayon::prelude::*;
use std::borrow::Cow;

/// Least sum of the other frames' votes for a label, and so at least two frames, to contradict one.
const SURE: Real = 1.0;
/// A frame calls one label another if it does so with more than this share of what it sees of it.
pub(super) const MOST: Real = 0.5;
/// And if at least this share of its votes for the other label are of that: what is so little seen may
/// lie on the border of two labels, which frames do not know well.
pub(super) const LEAST: Real = 0.05;

/// The votes of one frame: vertex, label and vote, the labels of a vertex one after the other.
#[derive(Debug, Default)]
pub(super) struct FrameVotes {
    /// Number of the frame.
    pub(super) frame: usize,
    pub(super) votes: Vec<(u32, u8, f32)>,
}

/// A frame that gives a label to most of what it sees of another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Contradiction {
    /// Number of the frame, from 0, of those that were looked at.
    pub frame: usize,
    /// The label that it gives. None of its votes for it count.
    pub label: u8,
    /// The label that the other frames give.
    pub others: u8,
}

/// Takes from `frames` the votes that others contradict, and returns which. `votes` are the sums of all,
/// `labels` for each vertex.
pub(super) fn withdraw_contradicted(
    frames: &mut [FrameVotes],
    votes: &[Real],
    labels: usize,
) -> Vec<Contradiction> {
    let (mut found, mut votes) = (Vec::new(), Cow::Borrowed(votes));
    loop {
        let of_frames: Vec<Option<(Real, Contradiction)>> =
            frames.par_iter().map(|own| plainest(own, &votes, labels)).collect();
        let order = |a: &(Real, Contradiction), b: &(Real, Contradiction)| a.0.total_cmp(&b.0);
        // Of two equal ones the first.
        let Some((_, plainest)) = of_frames.into_iter().flatten().rev().max_by(order) else {
            break;
        };
        for own in frames.iter_mut().filter(|own| own.frame == plainest.frame) {
            let votes = votes.to_mut();
            own.votes.retain(|(v, label, vote)| {
                if *label == plainest.label {
                    votes[*v as usize * labels + usize::from(*label)] -= Real::from(*vote);
                }
                *label != plainest.label
            });
        }
        found.push(plainest);
    }
    found.sort_unstable_by_key(|c| (c.frame, c.others, c.label));
    found
}

/// The plainest contradiction of a frame to the sums of all votes, and how plain it is: the share of
/// what the frame sees of the true label.
fn plainest(own: &FrameVotes, votes: &[Real], labels: usize) -> Option<(Real, Contradiction)> {
    // called[true label · labels + label]: votes of the frame.
    let mut called = vec![0.0; labels * labels];
    let mut rest = vec![0.0; labels];
    for of_vertex in own.votes.chunk_by(|a, b| a.0 == b.0) {
        let all = &votes[of_vertex[0].0 as usize * labels..][..labels];
        rest.copy_from_slice(all);
        of_vertex
            .iter()
            .for_each(|(_, label, vote)| rest[usize::from(*label)] -= Real::from(*vote));
        let truth = usize::from(winner(&rest));
        let sum: Real = of_vertex.iter().map(|(.., vote)| Real::from(*vote)).sum();
        // Where its own votes turn the scale, who is right is not known.
        if rest[truth] >= SURE.max(sum) && usize::from(winner(all)) == truth {
            for (_, label, vote) in of_vertex {
                called[truth * labels + usize::from(*label)] += Real::from(*vote);
            }
        }
    }
    let mut plainest: Option<(Real, Contradiction)> = None;
    for truth in 0..labels {
        let seen: Real = called[truth * labels..][..labels].iter().sum();
        for label in (0..labels).filter(|l| *l != truth) {
            let wrong = called[truth * labels + label];
            let all: Real = (0..labels).map(|t| called[t * labels + label]).sum();
            let plain = wrong / seen;
            if wrong > MOST * seen
                && wrong > LEAST * all
                && plainest.is_none_or(|(most, _)| plain > most)
            {
                let (frame, label, others) = (own.frame, label as u8, truth as u8);
                plainest = Some((plain, Contradiction { frame, label, others }));
            }
        }
    }
    plainest
}
