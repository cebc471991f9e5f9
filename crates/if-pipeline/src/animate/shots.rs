//! Shots: the frames between two cuts, at which the pose or the place of the body jumps.

use if_core::math::Real;
use std::ops::Range;

/// Speed, in m/s, above which a part of the body may jump: a hand comes to it in a punch, within some frames.
const FAST: Real = 6.0;
/// Distance, in metres, that a jump has at least. Over less, displacements stay comparable, as where captured
/// motion slips.
const FAR: Real = 0.25;
/// A jump is longer than this many times the longer way of the frames before and after it: what is fast was so
/// before, or is so later. With 1 the first frame of a sprint at 5 frames per second counts as one.
const SUDDEN: Real = 2.0;
/// Percentile of the ways of the body's vertices that counts: a limb has more of them, and noise fewer.
const PERCENTILE: Real = 0.95;

/// The shots of a movement.
#[derive(Clone, Debug)]
pub(super) struct Shots {
    /// The first frames of all but the first shot.
    cuts: Vec<usize>,
    frames: usize,
}

impl Shots {
    /// Of `frames` frames, by the ways from each to the next, in metres, and the seconds between two.
    ///
    /// ```text
    /// a cut: way > max(25 cm, 6 m/s · seconds) + 2 · (the longer of the ways before and after)
    /// ```
    pub(super) fn new(frames: usize, ways: &[Real], seconds: Real) -> Self {
        let least = FAR.max(FAST * seconds);
        let way = |k: Option<usize>| k.and_then(|k| ways.get(k)).copied().unwrap_or(0.0);
        let is_cut = |k: &usize| {
            let beside = way(k.checked_sub(1)).max(way(k.checked_add(1)));
            ways[*k] > least + SUDDEN * beside
        };
        Self { cuts: (0..ways.len()).filter(is_cut).map(|k| k + 1).collect(), frames }
    }

    /// The frames after cuts, ascending.
    pub(super) fn cuts(&self) -> &[usize] {
        &self.cuts
    }

    /// All shots.
    pub(super) fn all(&self) -> impl Iterator<Item = Range<usize>> {
        let starts = std::iter::once(0).chain(self.cuts.iter().copied());
        let ends = self.cuts.iter().copied().chain([self.frames]);
        starts.zip(ends).map(|(start, end)| start..end)
    }

    /// The frames of the shot of frame `k` that are at most `radius` from it.
    pub(super) fn window(&self, k: usize, radius: usize) -> Range<usize> {
        let next = self.cuts.partition_point(|cut| *cut <= k);
        let start = if next == 0 { 0 } else { self.cuts[next - 1] };
        let end = self.cuts.get(next).copied().unwrap_or(self.frames);
        k.saturating_sub(radius).max(start)..end.min(k + radius + 1)
    }
}

/// The way of most of the body from one frame to the next: 95 % of its vertices go less far.
pub(super) fn way(mut ways: Vec<Real>) -> Real {
    let Some(last) = ways.len().checked_sub(1) else { return 0.0 };
    let at = (PERCENTILE * last as Real) as usize;
    *ways.select_nth_unstable_by(at, Real::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cuts(ways: &[Real], rate: Real) -> Vec<usize> {
        Shots::new(ways.len() + 1, ways, 1.0 / rate).cuts().to_vec()
    }

    #[test]
    fn jumps_are_cuts_and_fast_motions_are_none() {
        // Who stands lies 5 m away in the next frame; two seconds later he runs elsewhere.
        assert_eq!(cuts(&[0.01, 0.0, 5.0, 0.01, 0.1, 0.2, 1.5, 0.2], 30.0), [3, 7]);
        // A T-pose before the motion, and an arm that is raised at once.
        assert_eq!(cuts(&[0.7, 0.02, 0.02], 30.0), [1]);
        assert_eq!(cuts(&[0.0, 0.4, 0.0], 30.0), [2]);
        // A punch of 9 m/s, a run that begins, a fall, and captured motion that slips by 20 cm.
        assert_eq!(cuts(&[0.0, 0.06, 0.2, 0.3, 0.14, 0.02], 30.0), [0; 0]);
        assert_eq!(cuts(&[0.0, 0.03, 0.1, 0.2, 0.3, 0.33], 30.0), [0; 0]);
        assert_eq!(cuts(&[0.0, 0.05, 0.16, 0.27, 0.38, 0.0], 30.0), [0; 0]);
        assert_eq!(cuts(&[0.0, 0.2, 0.0], 120.0), [0; 0]);
        // The same at 10 and 5 frames per second, and what rides at 30 m/s.
        assert_eq!(cuts(&[0.0, 0.5, 0.4, 0.0], 10.0), [0; 0]);
        assert_eq!(cuts(&[0.0, 1.1, 1.1, 0.1, 1.2], 5.0), [0; 0]);
        assert_eq!(cuts(&[1.0; 5], 30.0), [0; 0]);
        assert_eq!(cuts(&[], 30.0), [0; 0]);
    }

    #[test]
    fn windows_end_at_cuts() {
        let shots = Shots::new(10, &[0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 9.0], 0.03);
        assert!(shots.all().eq([0..4, 4..9, 9..10]));
        let windows = [0, 3, 4, 6, 9].map(|k| shots.window(k, 2));
        assert_eq!(windows, [0..3, 1..4, 4..7, 4..9, 9..10]);
    }

    #[test]
    fn a_way_is_that_of_most_vertices() {
        let mut ways = vec![0.1; 100];
        assert_eq!(way(ways.clone()), 0.1);
        ways[..3].fill(9.0);
        assert_eq!(way(ways.clone()), 0.1);
        ways[..8].fill(0.6);
        assert_eq!((way(ways), way(vec![])), (0.6, 0.0));
    }
}
