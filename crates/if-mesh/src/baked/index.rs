//! Finds the brick of a point in one or two steps, however often cells were halved.

use super::directory::{INSIDE, Place, SPLIT};
use if_core::math::Real;

/// Maximum halvings that one table spans: 8³ entries of 4 bytes.
const SPAN: u32 = 3;
/// An entry below [`SPLIT`] is a brick, and above this bit its level.
const LEVEL: u32 = 27;
/// An entry from [`SPLIT`] on is a table: above this bit its span less one, below where it begins.
const SPAN_BIT: u32 = 29;

/// Maximum entries of all tables together: the start of a table has so many bits, and 2³² bytes
/// hold them.
pub(super) const MOST: usize = 1 << SPAN_BIT;
/// Maximum number of bricks: an entry has so many bits for it. They need 268 GB.
pub(super) const BRICKS: usize = 1 << LEVEL;

/// Tables built from the splits: the number of steps follows the tables, not the halvings, so that
/// branches are predictable.
#[derive(Clone, Default)]
pub(super) struct Index {
    roots: Vec<u32>,
    tables: Vec<u32>,
}

impl Index {
    /// The tables for roots and splits ([`super::bricks::Bricks`]); `None` if they would have more
    /// than `most` or [`MOST`] entries, or if there are more than [`BRICKS`] bricks.
    pub(super) fn new(
        roots: &[u32],
        splits: &[[u32; 8]],
        places: &[Place],
        most: usize,
    ) -> Option<Self> {
        if places.len() > BRICKS {
            return None;
        }
        let most = most.min(MOST);
        let mut index = Self { roots: Vec::with_capacity(roots.len()), tables: Vec::new() };
        for root in roots {
            let entry = index.entry(*root, splits, places, most)?;
            index.roots.push(entry);
        }
        Some(index)
    }

    fn entry(
        &mut self,
        entry: u32,
        splits: &[[u32; 8]],
        places: &[Place],
        most: usize,
    ) -> Option<u32> {
        if entry >= INSIDE {
            return Some(entry);
        }
        if entry < SPLIT {
            return Some(places[entry as usize].level << LEVEL | entry);
        }
        let span = depth(entry, splits, SPAN);
        let (side, first) = (1usize << span, self.tables.len());
        if first + side * side * side > most {
            return None;
        }
        self.tables.resize(first + side * side * side, 0);
        for k in 0..side * side * side {
            let at = [k % side, k / side % side, k / side / side];
            let mut below = entry;
            for up in (0..span).rev() {
                if !(SPLIT..INSIDE).contains(&below) {
                    break;
                }
                let half = (0..3).fold(0, |h, a| h | (at[a] >> up & 1) << a);
                below = splits[(below - SPLIT) as usize][half];
            }
            self.tables[first + k] = self.entry(below, splits, places, most)?;
        }
        Some(SPLIT | (span - 1) << SPAN_BIT | first as u32)
    }

    /// The brick at `f` in [0, 1)³ of a root, and its level; or [`INSIDE`] or
    /// [`super::directory::OUTSIDE`].
    #[inline]
    pub(super) fn find(&self, root: usize, f: [Real; 3]) -> (u32, u32) {
        let mut entry = self.roots[root];
        let mut level = 0;
        while entry >= SPLIT {
            if entry >= INSIDE {
                return (entry, 0);
            }
            let span = (entry >> SPAN_BIT & 3) + 1;
            level += span;
            let scale = power(level);
            let mask = (1u32 << span) - 1;
            let [x, y, z] = f.map(|f| (f * scale) as u32 & mask);
            let first = (entry & ((1 << SPAN_BIT) - 1)) as usize;
            entry = self.tables[first + (((z << span | y) << span | x) as usize)];
        }
        (entry & ((1 << LEVEL) - 1), entry >> LEVEL)
    }

    /// Bytes of the tables.
    pub(super) fn bytes(&self) -> usize {
        (self.roots.len() + self.tables.len()) * 4
    }
}

/// 2ⁿ.
#[inline]
pub(super) fn power(n: u32) -> Real {
    Real::from_bits(u64::from(1023 + n) << 52)
}

/// Halvings below an entry, `most` at most.
fn depth(entry: u32, splits: &[[u32; 8]], most: u32) -> u32 {
    if most == 0 || !(SPLIT..INSIDE).contains(&entry) {
        return 0;
    }
    1 + splits[(entry - SPLIT) as usize]
        .iter()
        .map(|half| depth(*half, splits, most - 1))
        .max()
        .unwrap_or(0)
}
