//! Entries of the tree of bricks: brick, split, outside or inside.

/// Entry without a brick: the field is above the band.
pub(super) const OUTSIDE: u32 = u32::MAX;
/// Entry without a brick: the field is below the band.
pub(super) const INSIDE: u32 = u32::MAX - 1;
/// Entries from here to [`INSIDE`] are split into eight; below are bricks.
pub(super) const SPLIT: u32 = 1 << 31;

/// Position of a brick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Number of halvings of its cells.
    pub(super) level: u32,
    /// Coordinates, in bricks of that level.
    pub(super) at: [u32; 3],
}

impl Place {
    /// One of the eight halves: bit k of `half` selects the half along axis k.
    pub(super) fn half(&self, half: usize) -> Self {
        Self {
            level: self.level + 1,
            at: [0, 1, 2].map(|a| 2 * self.at[a] + (half >> a & 1) as u32),
        }
    }
}
