//! One level of the grid: where its nodes lie in the table, reading them and its reverse.

use pulp::Simd;

/// `a · b + c`, fused where the vector unit fuses.
#[inline(always)]
pub(super) fn mul_add<S: Simd>(a: f32, b: f32, c: f32) -> f32 {
    if S::IS_SCALAR { a * b + c } else { a.mul_add(b, c) }
}

/// One level: nodes at distance `cell` over the cube [−1, 1]³ and one cell beyond it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Cells along a side.
    pub(super) cells: usize,
    /// Nodes along a side, `cells + 3`.
    pub(super) side: usize,
    /// Edge of a cell.
    pub(super) cell: f32,
    /// Its inverse.
    pub(super) inverse: f32,
    /// Entries of the table.
    pub(super) entries: usize,
    /// Where the table begins among the parameters.
    pub(super) offset: usize,
}

/// The 27 nodes around a point: nine rows of three, and the weights along each axis.
pub(super) struct Stencil {
    rows: [u32; 9],
    weight: [[f32; 3]; 3],
    slope: [[f32; 3]; 3],
}

impl Level {
    /// A level of `cells`, dense if its nodes fit into `table` entries, hashed by rows otherwise.
    pub(super) fn new(cells: usize, table: usize, offset: usize) -> Self {
        let side = cells + 3;
        Self {
            cells,
            side,
            cell: 2.0 / cells as f32,
            inverse: cells as f32 / 2.0,
            entries: (side * side * side).min(table.max(side)),
            offset,
        }
    }

    /// Whether each node has an entry of its own.
    pub(super) fn is_dense(&self) -> bool {
        self.entries == self.side * self.side * self.side
    }

    /// First entry of the row of nodes `(·, j, k)`: rows of a hashed level overlap.
    #[inline(always)]
    pub(super) fn row(&self, j: usize, k: usize) -> usize {
        if self.is_dense() {
            return (k * self.side + j) * self.side;
        }
        // The finaliser of MurmurHash3 (Appleby) over both indices.
        let mut h = (j as u32).wrapping_mul(0x9e37_79b1) ^ (k as u32).wrapping_mul(0x85eb_ca77);
        h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
        h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
        h ^= h >> 16;
        ((u64::from(h) * (self.entries - self.side + 1) as u64) >> 32) as usize
    }

    /// The place of node `(i, j, k)`, counted from one cell below the cube.
    pub(super) fn node(&self, ijk: [usize; 3]) -> [f32; 3] {
        ijk.map(|i| (i as f32 - 1.0) * self.cell - 1.0)
    }

    /// Weights of the uniform quadratic B-spline. Beyond the cube the outermost piece goes on.
    #[inline(always)]
    pub(super) fn stencil(&self, p: &[f32; 3]) -> Stencil {
        let mut first = [0usize; 3];
        let (mut weight, mut slope) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
        for axis in 0..3 {
            let u = (p[axis] + 1.0) * self.inverse;
            // NaN becomes 0 here, and goes on in `t`.
            let nearest = (u + 0.5).floor().clamp(0.0, self.cells as f32);
            first[axis] = nearest as usize;
            let t = u - nearest;
            let (a, b) = (0.5 - t, 0.5 + t);
            weight[axis] = [0.5 * a * a, 0.75 - t * t, 0.5 * b * b];
            slope[axis] = [-a, -2.0 * t, b];
        }
        let mut rows = [0; 9];
        for (r, row) in rows.iter_mut().enumerate() {
            *row = (self.row(first[1] + r % 3, first[2] + r / 3) + first[0]) as u32;
        }
        Stencil { rows, weight, slope }
    }

    /// The features at a point and their gradients.
    #[inline(always)]
    pub(super) fn read<S: Simd, const F: usize>(
        &self,
        table: &[f32],
        p: &[f32; 3],
    ) -> ([f32; F], [[f32; F]; 3]) {
        let s = self.stencil(p);
        let (mut value, mut gradient) = ([0.0; F], [[0.0; F]; 3]);
        for r in 0..9 {
            let (j, k) = (r % 3, r / 3);
            let row = &table[s.rows[r] as usize * F..][..3 * F];
            let (mut along, mut sloped) = ([0.0; F], [0.0; F]);
            for i in 0..3 {
                for f in 0..F {
                    along[f] = mul_add::<S>(s.weight[0][i], row[i * F + f], along[f]);
                    sloped[f] = mul_add::<S>(s.slope[0][i], row[i * F + f], sloped[f]);
                }
            }
            let w = s.weight[1][j] * s.weight[2][k];
            let (wy, wz) = (s.slope[1][j] * s.weight[2][k], s.weight[1][j] * s.slope[2][k]);
            for f in 0..F {
                value[f] = mul_add::<S>(w, along[f], value[f]);
                gradient[0][f] = mul_add::<S>(w, sloped[f], gradient[0][f]);
                gradient[1][f] = mul_add::<S>(wy, along[f], gradient[1][f]);
                gradient[2][f] = mul_add::<S>(wz, along[f], gradient[2][f]);
            }
        }
        for g in gradient.iter_mut().flatten() {
            *g *= self.inverse;
        }
        (value, gradient)
    }

    /// The reverse of [`Level::read`]: adds what a loss with derivatives `value` and `gradient` by
    /// the features and their gradients has by the nodes.
    #[inline(always)]
    pub(super) fn scatter<S: Simd, const F: usize>(
        &self,
        table: &mut [f32],
        p: &[f32; 3],
        adjoint: &[[f32; F]; 4],
    ) {
        let s = self.stencil(p);
        let [value, x, y, z] = adjoint;
        for r in 0..9 {
            let (j, k) = (r % 3, r / 3);
            let row = &mut table[s.rows[r] as usize * F..][..3 * F];
            let w = s.weight[1][j] * s.weight[2][k];
            let wi = w * self.inverse;
            let (wy, wz) = (
                s.slope[1][j] * s.weight[2][k] * self.inverse,
                s.weight[1][j] * s.slope[2][k] * self.inverse,
            );
            for f in 0..F {
                let along = mul_add::<S>(w, value[f], mul_add::<S>(wy, y[f], wz * z[f]));
                let sloped = wi * x[f];
                for i in 0..3 {
                    let at = &mut row[i * F + f];
                    *at = mul_add::<S>(
                        s.weight[0][i],
                        along,
                        mul_add::<S>(s.slope[0][i], sloped, *at),
                    );
                }
            }
        }
    }
}
