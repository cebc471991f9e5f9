//! Sets of places of a three-dimensional lattice, as bits: rows along x of words of 64 places.
//!
//! Empty words are not stored, so that memory follows the set, except for one number per row.

use rayon::prelude::*;

/// Places in a word.
pub(super) const WORD: u32 = u64::BITS;

/// Places along x in words of 64; rows by y, then by z.
#[derive(Clone, Debug)]
pub(super) struct Rows<T> {
    /// Places along each axis.
    pub(super) size: [u32; 3],
    /// First word of each row; one more for the end.
    start: Vec<u32>,
    words: Vec<T>,
}

/// An element of a row: 64 places.
pub(super) trait Word: Copy + Send + Sync {
    /// Index of the word along x: its first place is 64 times this.
    fn x(&self) -> u32;
}

/// A subset of 64 places.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bits {
    pub(super) x: u32,
    pub(super) bits: u64,
}

impl Word for Bits {
    fn x(&self) -> u32 {
        self.x
    }
}

/// 64 nodes along x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct NodeWord {
    pub(super) x: u32,
    /// Index of the value of the first known node.
    pub(super) base: u32,
    /// Bits of the nodes whose value is known.
    pub(super) known: u64,
    /// Bits of those with a negative value.
    pub(super) inside: u64,
}

impl Word for NodeWord {
    fn x(&self) -> u32 {
        self.x
    }
}

impl NodeWord {
    /// Index of the value of a known node of this word.
    #[inline]
    pub(super) fn value(&self, bit: u32) -> usize {
        self.base as usize + (self.known & below(bit)).count_ones() as usize
    }
}

impl<T: Word> Rows<T> {
    /// Bytes of the set.
    pub(super) fn bytes(&self) -> usize {
        self.start.len() * size_of::<u32>() + self.words.len() * size_of::<T>()
    }

    /// Builds each row by `row(y, z, out)`, which pushes the row's words in ascending order.
    pub(super) fn build(size: [u32; 3], row: impl Fn(u32, u32, &mut Vec<T>) + Sync) -> Self {
        let planes: Vec<(Vec<u32>, Vec<T>)> = (0..size[2])
            .into_par_iter()
            .map(|z| {
                let (mut ends, mut words) = (Vec::with_capacity(size[1] as usize), Vec::new());
                for y in 0..size[1] {
                    row(y, z, &mut words);
                    ends.push(words.len() as u32);
                }
                (ends, words)
            })
            .collect();
        let mut start = Vec::with_capacity(size[1] as usize * size[2] as usize + 1);
        start.push(0);
        let mut words = Vec::with_capacity(planes.iter().map(|p| p.1.len()).sum());
        for (ends, part) in planes {
            let before = words.len() as u32;
            start.extend(ends.iter().map(|e| before + e));
            words.extend(part);
        }
        Self { size, start, words }
    }

    /// All words, in the order of the rows.
    pub(super) fn words(&self) -> &[T] {
        &self.words
    }

    /// The same, mutable; their indices along x must not change.
    pub(super) fn words_mut(&mut self) -> &mut [T] {
        &mut self.words
    }

    /// Words of one row, and the index of the first. Empty beyond the rows.
    #[inline]
    pub(super) fn row(&self, y: u32, z: u32) -> (&[T], usize) {
        if y >= self.size[1] || z >= self.size[2] {
            return (&[], 0);
        }
        let at = (y + self.size[1] * z) as usize;
        let (from, to) = (self.start[at] as usize, self.start[at + 1] as usize);
        (&self.words[from..to], from)
    }

    /// Indices of the words of planes `z`.
    pub(super) fn planes(&self, z: std::ops::Range<u32>) -> std::ops::Range<usize> {
        let at = |z: u32| self.start[(self.size[1] * z) as usize] as usize;
        at(z.start)..at(z.end)
    }

    /// Index of the word of row (y, z) with places `64 x ..`, if it is stored.
    #[inline]
    pub(super) fn find(&self, x: u32, y: u32, z: u32) -> Option<usize> {
        let (row, first) = self.row(y, z);
        // In a complete row a word is stored at its own index.
        if row.get(x as usize).is_some_and(|w| w.x() == x) {
            return Some(first + x as usize);
        }
        row.binary_search_by_key(&x, |w| w.x()).ok().map(|k| first + k)
    }
}

impl Rows<Bits> {
    /// All places.
    pub(super) fn full(size: [u32; 3]) -> Self {
        Self::build(size, |_, _, out| {
            for x in 0..size[0].div_ceil(WORD) {
                let left = size[0] - x * WORD;
                out.push(Bits { x, bits: if left < WORD { (1 << left) - 1 } else { u64::MAX } });
            }
        })
    }

    /// Number of places.
    pub(super) fn count(&self) -> usize {
        self.words.iter().map(|w| w.bits.count_ones() as usize).sum()
    }

    /// Whether the place is in the set.
    #[cfg(test)]
    pub(super) fn contains(&self, x: u32, y: u32, z: u32) -> bool {
        self.find(x / WORD, y, z).is_some_and(|w| self.words[w].bits >> (x % WORD) & 1 == 1)
    }

    /// Both sets together.
    pub(super) fn union(&self, other: &Self) -> Self {
        let words = self.size[0].div_ceil(WORD) as usize;
        Self::build(self.size, |y, z, out| {
            let mut scratch = Scratch::new(words);
            for set in [self, other] {
                set.row(y, z).0.iter().for_each(|w| scratch.or(w.x, w.bits));
            }
            scratch.push_into(out);
        })
    }

    /// The places of this set that are not in `other`.
    pub(super) fn minus(&self, other: &Self) -> Self {
        Self::build(self.size, |y, z, out| {
            let left = self.row(y, z).0.iter().map(|w| {
                let taken = other.find(w.x, y, z).map_or(0, |k| other.words[k].bits);
                Bits { x: w.x, bits: w.bits & !taken }
            });
            out.extend(left.filter(|w| w.bits != 0));
        })
    }

    /// The places of this set and their 26 neighbours.
    pub(super) fn dilated(&self) -> Self {
        let words = self.size[0].div_ceil(WORD) as usize;
        Self::build(self.size, |y, z, out| {
            let mut scratch = Scratch::new(words);
            for r in 0..9 {
                // An index below the first row wraps beyond the last, where rows are empty.
                for w in self.row((y + r % 3).wrapping_sub(1), (z + r / 3).wrapping_sub(1)).0 {
                    scratch.or(w.x, w.bits);
                    scratch.or_up(w.x, w.bits);
                    scratch.or_down(w.x, w.bits);
                }
            }
            scratch.cut(self.size[0]);
            scratch.push_into(out);
        })
    }

    /// The nodes at the corners of these cells.
    pub(super) fn corners(&self) -> Self {
        let size = self.size.map(|s| s + 1);
        let words = size[0].div_ceil(WORD) as usize;
        Self::build(size, |y, z, out| {
            let mut scratch = Scratch::new(words);
            for (y, z) in [
                (y.wrapping_sub(1), z.wrapping_sub(1)),
                (y, z.wrapping_sub(1)),
                (y.wrapping_sub(1), z),
                (y, z),
            ] {
                for w in self.row(y, z).0 {
                    scratch.or(w.x, w.bits);
                    scratch.or_up(w.x, w.bits);
                }
            }
            scratch.push_into(out);
        })
    }
}

/// One row with all of its words, to collect bits.
pub(super) struct Scratch(Vec<u64>);

impl Scratch {
    pub(super) fn new(words: usize) -> Self {
        Self(vec![0; words])
    }

    /// Adds places.
    #[inline]
    pub(super) fn or(&mut self, x: u32, bits: u64) {
        if let Some(word) = self.0.get_mut(x as usize) {
            *word |= bits;
        }
    }

    /// Adds the places one further along x.
    #[inline]
    pub(super) fn or_up(&mut self, x: u32, bits: u64) {
        self.or(x, bits << 1);
        self.or(x + 1, bits >> (WORD - 1));
    }

    /// Adds the places one back along x, from the second on.
    #[inline]
    pub(super) fn or_down(&mut self, x: u32, bits: u64) {
        self.or(x, bits >> 1);
        if x > 0 {
            self.or(x - 1, bits << (WORD - 1));
        }
    }

    /// Pushes the words that are not empty.
    pub(super) fn push_into(&self, out: &mut Vec<Bits>) {
        out.extend(
            self.0
                .iter()
                .enumerate()
                .filter(|w| *w.1 != 0)
                .map(|(x, bits)| Bits { x: x as u32, bits: *bits }),
        );
    }

    /// Removes the places from `size` on.
    pub(super) fn cut(&mut self, size: u32) {
        for (x, word) in self.0.iter_mut().enumerate() {
            let valid = size.saturating_sub(x as u32 * WORD);
            *word &= if valid < WORD { below(valid) } else { u64::MAX };
        }
    }
}

/// Calls `visit` with each set bit's number, ascending.
#[inline]
pub(super) fn each_bit(mut bits: u64, mut visit: impl FnMut(u32)) {
    while bits != 0 {
        visit(bits.trailing_zeros());
        bits &= bits - 1;
    }
}

/// The bits below bit `n`.
#[inline]
pub(super) fn below(n: u32) -> u64 {
    (1 << n) - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(size: [u32; 3], contains: impl Fn(u32, u32, u32) -> bool + Sync) -> Rows<Bits> {
        Rows::build(size, |y, z, out| {
            let mut scratch = Scratch::new(size[0].div_ceil(WORD) as usize);
            (0..size[0])
                .filter(|x| contains(*x, y, z))
                .for_each(|x| scratch.or(x / WORD, 1 << (x % WORD)));
            scratch.push_into(out);
        })
    }

    #[test]
    fn sets_hold_what_was_put_in_and_their_corners() {
        let size = [150, 3, 2];
        let rule = |x: u32, y: u32, z: u32| {
            (x * 7 + y * 3 + z).is_multiple_of(11) || [63, 64, 127].contains(&x)
        };
        let cells = set(size, rule);
        let nodes = cells.corners();
        assert_eq!(nodes.size, [151, 4, 3]);
        let mut count = 0;
        for z in 0..=2u32 {
            for y in 0..=3u32 {
                for x in 0..=150u32 {
                    let inside = |x, y, z| x < 150 && y < 3 && z < 2;
                    if inside(x, y, z) {
                        assert_eq!(cells.contains(x, y, z), rule(x, y, z));
                        count += usize::from(rule(x, y, z));
                    }
                    let corner = (0..8).any(|c| {
                        let [x, y, z] = [
                            x.wrapping_sub(c & 1),
                            y.wrapping_sub(c >> 1 & 1),
                            z.wrapping_sub(c >> 2),
                        ];
                        inside(x, y, z) && rule(x, y, z)
                    });
                    assert_eq!(nodes.contains(x, y, z), corner, "{x} {y} {z}");
                }
            }
        }
        assert_eq!(cells.count(), count);
        assert_eq!(Rows::full(size).count(), 900);
        assert_eq!(cells.union(&Rows::full(size)).count(), 900);
        assert_eq!(cells.union(&set(size, |_, _, _| false)).words(), cells.words());
        assert_eq!(Rows::full(size).minus(&cells).count(), 900 - count);
        assert_eq!(cells.minus(&cells).words(), []);
        let one = set(size, |x, y, z| [x, y, z] == [64, 0, 1]);
        assert_eq!(one.dilated().count(), 3 * 2 * 2);
        assert!(one.dilated().contains(63, 1, 0) && one.dilated().contains(65, 0, 1));
        assert_eq!(set(size, |x, y, z| [x, y, z] == [149, 2, 1]).dilated().count(), 8);
    }

    #[test]
    fn shifts_carry_over_words() {
        let mut scratch = Scratch::new(2);
        scratch.or_up(0, 1 << 63 | 1);
        assert_eq!(scratch.0, [2, 1]);
        scratch.cut(65);
        assert_eq!(scratch.0, [2, 1]);
        scratch.cut(1);
        assert_eq!(scratch.0, [0, 0]);
        scratch.or_down(1, 1 | 4);
        scratch.or_down(0, 1);
        assert_eq!(scratch.0, [1 << 63, 2]);
    }
}
