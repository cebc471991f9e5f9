//! What a cell blends, and how a finished field keeps it.

use super::bricks::{NODES, Node};
use if_core::math::{Real, Vector};

/// What a cell blends; in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Values at the corners: bit k of the index is the step along axis k.
    pub(super) values: [f32; 8],
    /// Bumps of the edges, in fours for each axis that they go along: the lower of the other two axes changes first.
    pub(super) bumps: [[f32; 4]; 3],
}

impl Cell {
    /// The cell whose lowest corner is the node `slot`.
    #[inline]
    pub(super) fn of(nodes: &[Node], slot: usize) -> Self {
        const Y: usize = NODES;
        const Z: usize = NODES * NODES;
        let n = &nodes[slot..slot + Z + Y + 2];
        let at = [[0, Y, Z, Z + Y], [0, 1, Z, Z + 1], [0, 1, Y, Y + 1]];
        Self {
            values: [0, 1, Y, Y + 1, Z, Z + 1, Z + Y, Z + Y + 1].map(|d| n[d][0]),
            bumps: [0, 1, 2].map(|axis| at[axis].map(|d| n[d][axis + 1])),
        }
    }

    /// Value and gradient of the blend at `u` in [0, 1]³; `inverse` is 1 / the edge h of the cell:
    ///
    /// ```text
    /// φ = T(φₖ) + Σ_axes uₐ (1 − uₐ) B(bₐ),   bₐ = ½ h (∂ₐφ at the edge's start − ∂ₐφ at its end)
    /// ```
    ///
    /// with T the trilinear blend of the corners, and B the bilinear one of the four edges along the axis. This is the
    /// half-Taylor blend `Σ wₖ (φₖ + ½ gₖ · (p − xₖ))`: the trilinear blend of the values errs by +½ Σ u (1 − u) h² ∂²φ, that of whole Taylor
    /// expansions by the opposite, and half of the slope is exact for quadratic fields. On a side of the cell it depends on that
    /// side alone; and the blend in a part of a cell, with values and bumps that are the cell's own there, is the cell's blend to the
    /// last term, so that small cells join large ones without a gap ([`super::join`]). The gradient is the blend's own.
    #[inline]
    pub(super) fn blend(&self, u: [Real; 3], inverse: Real) -> (Real, Vector) {
        let [ux, uy, uz] = u;
        let [cx, cy, cz] = [1.0 - ux, 1.0 - uy, 1.0 - uz];
        let v = self.values.map(Real::from);
        let [bx, by, bz] = self.bumps.map(|b| b.map(Real::from));
        let mix = |a: Real, b: Real, t: Real| a + (b - a) * t;
        // Along x: the value, and its slope.
        let row = |k: usize| {
            let (a, rise, bump) = (v[2 * k], v[2 * k + 1] - v[2 * k], bx[k]);
            (a + ux * (rise + cx * bump), rise + (cx - ux) * bump)
        };
        let [(a, da), (b, db), (c, dc), (d, dd)] = [row(0), row(1), row(2), row(3)];
        // Bumps along y at both ends along z, and along z at both ends along y: values and slopes along x.
        let line = |b: [Real; 4], k: usize| {
            let rise = b[2 * k + 1] - b[2 * k];
            (b[2 * k] + rise * ux, rise)
        };
        let [(y0, dy0), (y1, dy1)] = [line(by, 0), line(by, 1)];
        let [(z0, dz0), (z1, dz1)] = [line(bz, 0), line(bz, 1)];
        let (low, high) = (mix(a, b, uy), mix(c, d, uy));
        let (bump_y, bump_z) = (mix(y0, y1, uz), mix(z0, z1, uy));
        let (wy, wz) = (uy * cy, uz * cz);
        let value = mix(low, high, uz) + wy * bump_y + wz * bump_z;
        let gx = mix(mix(da, db, uy), mix(dc, dd, uy), uz) + wy * mix(dy0, dy1, uz) + wz * mix(dz0, dz1, uy);
        let gy = mix(b - a, d - c, uz) + (cy - uy) * bump_y + wz * (z1 - z0);
        let gz = high - low + wy * (y1 - y0) + (cz - uz) * bump_z;
        (value, Vector::new(gx, gy, gz) * inverse)
    }
}

/// Bits of a bump where three share a word: sign, exponent, and 12 of the 23 bits of the mantissa.
const BITS: u32 = 21;
/// Bits that are left off.
const DROPPED: u32 = 32 - BITS;

/// The nearest bump that can be packed, the even one of two, in metres. What would round to infinity is cut off.
pub(super) fn rounded(bump: Real) -> f32 {
    let bits = (bump as f32).to_bits();
    let up = bits.wrapping_add((1 << (DROPPED - 1)) - 1 + (bits >> DROPPED & 1));
    f32::from_bits((if f32::from_bits(up).is_finite() { up } else { bits }) >> DROPPED << DROPPED)
}

/// Three bumps that were [`rounded`] as one word, the first in its lowest bits.
pub(super) fn packed(bumps: [f32; 3]) -> u64 {
    debug_assert!(bumps.iter().all(|b| b.to_bits() % (1 << DROPPED) == 0), "{bumps:?} lose bits");
    bumps.into_iter().rev().fold(0, |word, bump| word << BITS | u64::from(bump.to_bits() >> DROPPED))
}

/// The bumps that were packed.
#[inline]
pub(super) fn unpacked(word: u64) -> [f32; 3] {
    [0, 1, 2].map(|k| f32::from_bits(((word >> (k * BITS)) as u32) << DROPPED))
}

/// A cell in one line of a processor's cache, so that a query waits for memory once.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(align(64))]
pub(super) struct PackedCell {
    values: [f32; 8],
    /// The k-th bumps of the three axes.
    bumps: [u64; 4],
}

impl PackedCell {
    pub(super) fn new(cell: &Cell) -> Self {
        Self { values: cell.values, bumps: [0, 1, 2, 3].map(|k| packed(cell.bumps.map(|b| b[k]))) }
    }

    #[inline]
    pub(super) fn cell(&self) -> Cell {
        let [a, b, c, d] = self.bumps.map(unpacked);
        Cell { values: self.values, bumps: [0, 1, 2].map(|axis| [a[axis], b[axis], c[axis], d[axis]]) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_cell_is_a_line_and_its_bumps_are_rounded_to_nearest() {
        assert_eq!((size_of::<PackedCell>(), align_of::<PackedCell>()), (64, 64));
        let mut state = 1u32;
        for _ in 0..100_000 {
            let mut next = || {
                state = state.wrapping_mul(1664525).wrapping_add(1013904223);
                // Any bits, but for numbers that are not finite or lose bits below the normal ones.
                let value = f32::from_bits(state);
                if value.is_normal() { value } else { 0.0 }
            };
            let bumps = [next(), next(), next()];
            let found = bumps.map(|b| rounded(Real::from(b)));
            let word = packed(found);
            assert!(word >> (3 * BITS) == 0 && unpacked(word) == found, "{bumps:?}");
            for (bump, found) in bumps.into_iter().zip(found) {
                let (bump, found) = (Real::from(bump), Real::from(found));
                // 12 bits of a mantissa; twice as much where rounding up would leave the numbers.
                let most = if bump.abs() < 3e38 { 0.5f64.powi(13) } else { 0.5f64.powi(12) };
                assert!(found.is_finite() && (found - bump).abs() <= most * bump.abs(), "{bump} {found}");
            }
        }
        assert_eq!([f32::MAX, f32::MIN, -0.0].map(|b| rounded(b.into()).is_finite()), [true; 3]);
        // Halfway between two: to the even one.
        let (one, step) = (1.0f32.to_bits(), 1 << DROPPED);
        let of = |bits: u32| rounded(f32::from_bits(bits).into()).to_bits();
        assert_eq!([of(one + step / 2), of(one + step / 2 + 1), of(one + step + step / 2)], [one, one + step, one + 2 * step]);
    }

    #[test]
    fn a_cell_keeps_which_edge_a_bump_is_of() {
        let nodes: Vec<Node> = (0..NODES * NODES * NODES).map(|i| [0, 1, 2, 3].map(|k| (4 * i + k) as f32)).collect();
        let slot = (NODES + 2) * NODES + 3;
        let cell = Cell::of(&nodes, slot);
        assert_eq!(PackedCell::new(&cell).cell(), cell);
        let node = |x: usize, y: usize, z: usize| nodes[slot + (z * NODES + y) * NODES + x];
        assert_eq!(cell.values[0b110], node(0, 1, 1)[0]);
        assert_eq!(cell.bumps[0], [node(0, 0, 0)[1], node(0, 1, 0)[1], node(0, 0, 1)[1], node(0, 1, 1)[1]]);
        assert_eq!(cell.bumps[1], [node(0, 0, 0)[2], node(1, 0, 0)[2], node(0, 0, 1)[2], node(1, 0, 1)[2]]);
        assert_eq!(cell.bumps[2], [node(0, 0, 0)[3], node(1, 0, 0)[3], node(0, 1, 0)[3], node(1, 1, 0)[3]]);
    }
}
