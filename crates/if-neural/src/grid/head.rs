//! The small network on top of the grid: one hidden layer beside a linear path, its gradient by the
//! features, and the reverse of both; on tiles of points side by side.

use super::level::mul_add;
use pulp::Simd;

/// Points of a tile.
pub(super) const LANES: usize = 16;
/// One number of each point of a tile.
pub(super) type Lanes = [f32; LANES];
/// Zeros.
pub(super) const ZERO: Lanes = [0.0; LANES];

/// Sizes of the network. Its parameters are W (hidden × inputs), b (hidden), v (hidden) and c (1),
/// in this order:
///
/// ```text
/// φ = Σ linear_d f_d + c + Σ_j v_j σ(z_j),   z = W f + b,   σ(z) = (z + √(z² + s)) / 2
/// ∂φ/∂f = linear + Wᵀ (v ∘ σ′(z))
/// ```
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Head {
    /// Weight of each feature on the linear path.
    pub(super) linear: Vec<f32>,
    /// Hidden units.
    pub(super) hidden: usize,
    /// s: how softly σ bends.
    pub(super) softness: f32,
}

/// What a tile needs.
pub(super) struct Tile {
    /// Features.
    pub(super) f: Vec<Lanes>,
    /// Their gradients: x, y and z of each.
    pub(super) jacobian: Vec<[Lanes; 3]>,
    /// ∂φ/∂f; after [`Head::reverse`] still.
    pub(super) q: Vec<Lanes>,
    /// ∂L/∂f, by [`Head::reverse`].
    pub(super) adjoint: Vec<Lanes>,
    z: Vec<Lanes>,
    p: Vec<Lanes>,
}

impl Tile {
    pub(super) fn new(head: &Head) -> Self {
        let d = head.linear.len();
        Self {
            f: vec![ZERO; d],
            jacobian: vec![[ZERO; 3]; d],
            q: vec![ZERO; d],
            adjoint: vec![ZERO; d],
            z: vec![ZERO; head.hidden],
            p: vec![ZERO; d],
        }
    }
}

#[inline(always)]
fn add_scaled<S: Simd>(to: &mut Lanes, a: f32, x: &Lanes) {
    for l in 0..LANES {
        to[l] = mul_add::<S>(a, x[l], to[l]);
    }
}

#[inline(always)]
fn add_product<S: Simd>(to: &mut Lanes, a: &Lanes, b: &Lanes) {
    for l in 0..LANES {
        to[l] = mul_add::<S>(a[l], b[l], to[l]);
    }
}

impl Head {
    /// Number of parameters.
    pub(super) fn len(&self) -> usize {
        self.hidden * (self.linear.len() + 2) + 1
    }

    /// φ and ∇φ of a tile.
    #[inline(always)]
    pub(super) fn forward<S: Simd>(&self, params: &[f32], tile: &mut Tile) -> (Lanes, [Lanes; 3]) {
        let (d, h) = (self.linear.len(), self.hidden);
        let (w, rest) = params.split_at(h * d);
        let (b, rest) = rest.split_at(h);
        let (v, c) = rest.split_at(h);
        let mut value = [c[0]; LANES];
        for i in 0..d {
            tile.q[i] = [self.linear[i]; LANES];
            add_scaled::<S>(&mut value, self.linear[i], &tile.f[i]);
        }
        for j in 0..h {
            let row = &w[j * d..][..d];
            let mut z = [b[j]; LANES];
            for i in 0..d {
                add_scaled::<S>(&mut z, row[i], &tile.f[i]);
            }
            tile.z[j] = z;
            let mut slope = ZERO;
            for l in 0..LANES {
                let root = mul_add::<S>(z[l], z[l], self.softness).sqrt();
                value[l] = mul_add::<S>(v[j], 0.5 * (z[l] + root), value[l]);
                slope[l] = 0.5 * v[j] * (1.0 + z[l] / root);
            }
            for i in 0..d {
                add_scaled::<S>(&mut tile.q[i], row[i], &slope);
            }
        }
        let mut gradient = [ZERO; 3];
        for i in 0..d {
            for k in 0..3 {
                add_product::<S>(&mut gradient[k], &tile.q[i], &tile.jacobian[i][k]);
            }
        }
        (value, gradient)
    }

    /// After [`Head::forward`]: adds the derivatives by the parameters, lane by lane, to `sums`,
    /// and leaves those by the features in `tile.adjoint`. (Those by the features' gradients are `q
    /// · d_gradient`.)
    #[inline(always)]
    pub(super) fn reverse<S: Simd>(
        &self,
        params: &[f32],
        tile: &mut Tile,
        d_value: &Lanes,
        d_gradient: &[Lanes; 3],
        sums: &mut [Lanes],
    ) {
        let (d, h) = (self.linear.len(), self.hidden);
        let (w, rest) = params.split_at(h * d);
        let v = &rest[h..2 * h];
        let (dw, rest) = sums.split_at_mut(h * d);
        let (db, rest) = rest.split_at_mut(h);
        let (dv, dc) = rest.split_at_mut(h);
        for i in 0..d {
            // How φ's gradient moves along ∂L/∂∇φ with q_i.
            let mut p = ZERO;
            for k in 0..3 {
                add_product::<S>(&mut p, &d_gradient[k], &tile.jacobian[i][k]);
            }
            tile.p[i] = p;
            for l in 0..LANES {
                tile.adjoint[i][l] = d_value[l] * self.linear[i];
            }
        }
        for l in 0..LANES {
            dc[0][l] += d_value[l];
        }
        for j in 0..h {
            let row = &w[j * d..][..d];
            let mut t = ZERO;
            for i in 0..d {
                add_scaled::<S>(&mut t, row[i], &tile.p[i]);
            }
            let (mut delta, mut along) = (ZERO, ZERO);
            for l in 0..LANES {
                let z = tile.z[j][l];
                let square = mul_add::<S>(z, z, self.softness);
                let root = square.sqrt();
                let (act, slope) = (0.5 * (z + root), 0.5 * (1.0 + z / root));
                let bend = 0.5 * self.softness / (square * root);
                delta[l] = v[j] * mul_add::<S>(d_value[l], slope, bend * t[l]);
                along[l] = v[j] * slope;
                dv[j][l] += mul_add::<S>(d_value[l], act, slope * t[l]);
                db[j][l] += delta[l];
            }
            for i in 0..d {
                add_product::<S>(&mut dw[j * d + i], &delta, &tile.f[i]);
                add_product::<S>(&mut dw[j * d + i], &along, &tile.p[i]);
                add_scaled::<S>(&mut tile.adjoint[i], row[i], &delta);
            }
        }
    }
}
