//! Which frames follow one another, and which are computed side by side.

use super::shots::Shots;
use std::ops::Range;

/// The runs of frames of a motion: the first frame of each is reached from the rest pose, the others
/// from the one before.
#[derive(Clone, Debug)]
pub(super) struct Runs(Vec<Range<usize>>);

impl Runs {
    /// Of each shot as few runs as have at most `most` frames each, as equal as they can be.
    pub(super) fn new(shots: &Shots, most: usize) -> Self {
        Self(shots.all().flat_map(|shot| divided(shot, most)).collect())
    }

    /// All of them.
    pub(super) fn all(&self) -> impl Iterator<Item = Range<usize>> {
        self.0.iter().cloned()
    }

    /// The run of a frame.
    ///
    /// # Panics
    ///
    /// If there are fewer frames.
    pub(super) fn of(&self, frame: usize) -> Range<usize> {
        self.all().find(|run| run.contains(&frame)).expect("a frame of the motion")
    }
}

/// As few equal parts of some frames as have at most `most` each.
fn divided(frames: Range<usize>, most: usize) -> impl Iterator<Item = Range<usize>> {
    let count = frames.len().div_ceil(most.max(1));
    let bound = move |part: usize| {
        // A product of two counts of what is in memory or on disk.
        frames.start + (part as u128 * frames.len() as u128 / count as u128) as usize
    };
    (0..count).map(move |part| bound(part)..bound(part + 1))
}

/// Some ascending frames, in at most `count` parts of the same number of frames.
pub(super) fn parts(frames: &[usize], count: usize) -> Vec<Vec<usize>> {
    let each = frames.len().div_ceil(count.max(1));
    if each == 0 { Vec::new() } else { frames.chunks(each).map(<[usize]>::to_vec).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_have_every_frame_once_and_are_as_equal_as_they_can_be() {
        for (frames, most) in [(0, 4), (1, 4), (4, 4), (5, 4), (84, 48), (97, 48), (10, 1)] {
            let runs: Vec<_> = Runs::new(&Shots::new(frames, &[], 1.0), most).all().collect();
            let lengths: Vec<usize> = runs.iter().map(Range::len).collect();
            assert!(runs.iter().cloned().flatten().eq(0..frames));
            let [least, largest] = [lengths.iter().min(), lengths.iter().max()];
            assert!(largest.is_none_or(|l| *l <= most && l - least.unwrap() <= 1), "{lengths:?}");
            assert_eq!(runs.len(), frames.div_ceil(most));
        }
        let runs = Runs::new(&Shots::new(84, &[], 1.0), 48);
        assert_eq!([0, 41, 42, 83].map(|k| runs.of(k)), [0..42, 0..42, 42..84, 42..84]);
        // A cut before the sixth frame.
        let ways: Vec<f64> = (0..83).map(|k| if k == 4 { 9.0 } else { 0.0 }).collect();
        let runs = Runs::new(&Shots::new(84, &ways, 0.03), 48);
        assert!(runs.all().eq([0..5, 5..44, 44..84]));
    }

    #[test]
    fn parts_have_every_frame_once() {
        let frames = [0, 1, 2, 5, 6, 9, 10];
        assert_eq!(parts(&frames, 3), [vec![0, 1, 2], vec![5, 6, 9], vec![10]]);
        assert_eq!(parts(&frames, 100).concat(), frames);
        assert!(parts(&[], 3).is_empty());
    }
}
