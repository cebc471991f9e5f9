//! The voxels that a flood may still enter, a bit each.

use super::Voxel;
use rayon::prelude::*;
use std::ops::Range;

/// Voxels of a word.
const WORD: usize = u64::BITS as usize;

/// Which voxels of each row are open. A row begins with a new word.
pub(super) struct OpenRows {
    words: Vec<u64>,
    words_per_row: usize,
}

impl OpenRows {
    /// Those of `states`, in rows of `length`, that are inside.
    pub(super) fn inside(states: &[Voxel], length: usize) -> Self {
        let words_per_row = length.div_ceil(WORD);
        let mut words = vec![0; states.len() / length * words_per_row];
        words.par_chunks_mut(words_per_row).zip(states.par_chunks(length)).for_each(
            |(row, states)| {
                for (word, states) in row.iter_mut().zip(states.chunks(WORD)) {
                    for (k, state) in states.iter().enumerate() {
                        *word |= u64::from(*state == Voxel::Inside) << k;
                    }
                }
            },
        );
        Self { words, words_per_row }
    }

    /// The open voxels of a row from the last closed one before `x` to the first one after it; none
    /// if that at `x` is closed.
    pub(super) fn run(&self, row: usize, x: usize) -> Range<usize> {
        let row = self.row(row);
        let (first, at) = (x / WORD, x % WORD);
        let before = (row[first] << (WORD - 1 - at)).leading_ones() as usize;
        if before == 0 {
            return x..x;
        }
        let (mut from, mut end) = (x + 1 - before, x + (row[first] >> at).trailing_ones() as usize);
        for word in row[..first].iter().rev() {
            if from % WORD != 0 {
                break;
            }
            from -= word.leading_ones() as usize;
            if *word != u64::MAX {
                break;
            }
        }
        for word in &row[first + 1..] {
            if end % WORD != 0 {
                break;
            }
            end += word.trailing_ones() as usize;
            if *word != u64::MAX {
                break;
            }
        }
        from..end
    }

    /// Closes voxels of a row.
    pub(super) fn close(&mut self, row: usize, range: Range<usize>) {
        let start = row * self.words_per_row;
        for (k, mask) in masks(range) {
            self.words[start + k] &= !mask;
        }
    }

    /// Calls `visit` with the first voxel of each run of open ones within `range` of a row.
    pub(super) fn starts(&self, row: usize, range: Range<usize>, mut visit: impl FnMut(usize)) {
        let row = self.row(row);
        let mut last = 0;
        for (k, mask) in masks(range) {
            let open = row[k] & mask;
            let mut starts = open & !(open << 1 | last);
            last = open >> (WORD - 1);
            while starts != 0 {
                visit(k * WORD + starts.trailing_zeros() as usize);
                starts &= starts - 1;
            }
        }
    }

    fn row(&self, row: usize) -> &[u64] {
        &self.words[row * self.words_per_row..][..self.words_per_row]
    }
}

/// The words of a row that hold voxels of `range`, and their bits there.
fn masks(range: Range<usize>) -> impl Iterator<Item = (usize, u64)> {
    let below = |k: usize, x: usize| match x.saturating_sub(k * WORD) {
        WORD.. => u64::MAX,
        bits => (1 << bits) - 1,
    };
    (range.start / WORD..range.end.div_ceil(WORD))
        .map(move |k| (k, below(k, range.end) & !below(k, range.start)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of voxels that are inside where a number of a fixed sequence is at least `least`.
    fn rows(length: usize, least: usize) -> (Vec<Voxel>, OpenRows) {
        let state = |k: usize| match k * k * 31 % 97 >= least {
            true => Voxel::Inside,
            false => Voxel::Wall,
        };
        let states: Vec<Voxel> = (0..5 * length).map(state).collect();
        let open = OpenRows::inside(&states, length);
        (states, open)
    }

    #[test]
    fn runs_and_their_starts_are_those_of_single_voxels() {
        for (length, least) in [(1, 40), (63, 0), (64, 3), (65, 0), (130, 1), (200, 50), (300, 0)] {
            let (states, mut open) = rows(length, least);
            for (row, states) in states.chunks(length).enumerate() {
                let is_open = |x: usize| states[x] == Voxel::Inside;
                for x in 0..length {
                    let from = (0..=x).rev().take_while(|k| is_open(*k)).count();
                    let end = (x..length).take_while(|k| is_open(*k)).count();
                    let expected = if is_open(x) { x + 1 - from..x + end } else { x..x };
                    assert_eq!(open.run(row, x), expected, "{length} {least} {row}");
                    let range = x / 3..x;
                    let (mut starts, mut expected) = (Vec::new(), Vec::new());
                    open.starts(row, range.clone(), |x| starts.push(x));
                    expected.extend(
                        range
                            .clone()
                            .filter(|k| is_open(*k) && (*k == range.start || !is_open(*k - 1))),
                    );
                    assert_eq!(starts, expected, "{length} {least} {row} {range:?}");
                }
                let range = length / 4..length - length / 4;
                open.close(row, range.clone());
                for x in 0..length {
                    let is_left = is_open(x) && !range.contains(&x);
                    assert_eq!(!open.run(row, x).is_empty(), is_left, "{length} {least} {row} {x}");
                }
            }
        }
    }
}
