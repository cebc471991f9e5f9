//! Nodes of a brick, and the blend of them in a cell.

use if_core::math::{Real, Vector};

/// Cells along the side of a brick.
pub(super) const SIDE: usize = 4;
/// Nodes along the side of a brick. Nodes on the border are stored in every brick that shares them,
/// so that a query reads one brick.
pub(super) const NODES: usize = SIDE + 1;
/// Nodes of a brick.
pub(super) const BRICK: usize = NODES * NODES * NODES;
/// Value at a node, and the bumps of the edges that lead from it along x, y and z; all in metres.
pub(super) type Node = [f32; 4];

/// The blend in the cell whose lowest corner is `slot`, at `u` in [0, 1]³; `inverse` is 1 / its
/// edge h:
///
/// ```text
/// φ = T(φₖ) + Σ_axes uₐ (1 − uₐ) B(bₐ),   bₐ = ½ h (∂ₐφ at the edge's start − ∂ₐφ at its end)
/// ```
///
/// with T the trilinear blend of the corners, and B the bilinear blend of the four edges along the
/// axis. This is the half-Taylor blend `Σ wₖ (φₖ + ½ gₖ · (p − xₖ))`: the trilinear blend of the
/// values errs by +½ Σ u (1 − u) h² ∂²φ, that of whole Taylor expansions by the opposite, and half
/// of the slope is exact for quadratic fields. On a side of the cell it depends on that side alone;
/// and the blend in a part of a cell, with values and bumps that are the cell's own there, is the
/// cell's blend to the last term, so that small cells join large ones without a gap
/// ([`super::join::join`]). The gradient is the blend's own.
#[inline]
pub(super) fn blend(nodes: &[Node], slot: usize, u: [Real; 3], inverse: Real) -> (Real, Vector) {
    let n = &nodes[slot..slot + NODES * NODES + NODES + 2];
    let [ux, uy, uz] = u;
    let [cx, cy, cz] = [1.0 - ux, 1.0 - uy, 1.0 - uz];
    let get = |at: usize, k: usize| Real::from(n[at][k]);
    let mix = |a: Real, b: Real, t: Real| a + (b - a) * t;
    const Y: usize = NODES;
    const Z: usize = NODES * NODES;
    // Along x: the value, and its slope.
    let row = |at: usize| {
        let (a, rise, bump) = (get(at, 0), get(at + 1, 0) - get(at, 0), get(at, 1));
        (a + ux * (rise + cx * bump), rise + (cx - ux) * bump)
    };
    let [(a, da), (b, db), (c, dc), (d, dd)] = [row(0), row(Y), row(Z), row(Y + Z)];
    // Bumps along y at both ends along z, and along z at both ends along y: values and slopes along
    // x.
    let line = |at: usize, k: usize| {
        let rise = get(at + 1, k) - get(at, k);
        (get(at, k) + rise * ux, rise)
    };
    let [(y0, dy0), (y1, dy1)] = [line(0, 2), line(Z, 2)];
    let [(z0, dz0), (z1, dz1)] = [line(0, 3), line(Y, 3)];
    let (low, high) = (mix(a, b, uy), mix(c, d, uy));
    let (bump_y, bump_z) = (mix(y0, y1, uz), mix(z0, z1, uy));
    let (wy, wz) = (uy * cy, uz * cz);
    let value = mix(low, high, uz) + wy * bump_y + wz * bump_z;
    let gx =
        mix(mix(da, db, uy), mix(dc, dd, uy), uz) + wy * mix(dy0, dy1, uz) + wz * mix(dz0, dz1, uy);
    let gy = mix(b - a, d - c, uz) + (cy - uy) * bump_y + wz * (z1 - z0);
    let gz = high - low + wy * (y1 - y0) + (cz - uz) * bump_z;
    (value, Vector::new(gx, gy, gz) * inverse)
}

/// Indices in a brick of the lowest corners of its cells.
pub(super) fn cells() -> impl Iterator<Item = usize> {
    (0..SIDE * SIDE * SIDE)
        .map(|c| ((c / SIDE / SIDE) * NODES + c / SIDE % SIDE) * NODES + c % SIDE)
}

/// The eight corners of the cell whose lowest is `slot`: bit k of the index is the step along axis
/// k.
pub(super) fn corners(nodes: &[Node], slot: usize) -> [&Node; 8] {
    const Z: usize = NODES * NODES;
    [0, 1, NODES, NODES + 1, Z, Z + 1, Z + NODES, Z + NODES + 1].map(|d| &nodes[slot + d])
}

/// The twelve bumps of a cell, in threes for each axis of their edges.
pub(super) fn bumps(nodes: &[Node], slot: usize) -> [[f32; 4]; 3] {
    const Z: usize = NODES * NODES;
    let at = [[0, NODES, Z, Z + NODES], [0, 1, Z, Z + 1], [0, 1, NODES, NODES + 1]];
    [0, 1, 2].map(|axis| at[axis].map(|d| nodes[slot + d][axis + 1]))
}

/// Coordinates of a node in its brick.
pub(super) fn local(index: usize) -> [usize; 3] {
    [index % NODES, index / NODES % NODES, index / NODES / NODES]
}
