//! A second encoding: features on grids of several resolutions, with a small network on top.

mod certificate;
mod head;
mod level;
mod seed;

use crate::trainable::{PointLoss, Sample32, TrainableField};
use head::{Head, LANES, Lanes, Tile, ZERO};
use level::Level;
use pulp::{Simd, WithSimd};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Points of one task.
const BLOCK: usize = 256;
/// More parameters than this are a mistake: 4 GiB.
const MOST: f64 = (1u64 << 30) as f64;

/// Sizes of a [`GridField`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridConfig {
    /// Cells along a side of the cube [−1, 1]³ at the coarsest level.
    pub coarsest: u32,
    /// At the finest level; those between grow by a constant factor.
    pub finest: u32,
    /// Number of levels.
    pub levels: u32,
    /// Features of a node: 1, 2 or 4. The first also adds to φ directly.
    pub features: u32,
    /// Entries of a level at most. A level of fewer nodes is dense; of more, rows of nodes share
    /// entries by a hash.
    pub table: u32,
    /// Units of the hidden layer; 0 leaves the linear path alone.
    pub hidden: u32,
    /// s of the activation `(z + √(z² + s)) / 2`: how softly it bends.
    pub softness: f32,
    /// Seed of the initial values.
    pub seed: u64,
}

impl Default for GridConfig {
    /// For a clothed body of 1.7 m: finest cells of 10 mm, 2.3 million parameters. Measured on one
    /// body (`docs/fitting.md`): the first values of 4 levels to 128 cells are off by 0.285 mm,
    /// these by 0.136 mm; at 128 cells, 2 features a node with a hidden layer and 1 feature without
    /// one end within 4 % of one another after 15 s.
    fn default() -> Self {
        Self {
            coarsest: 16,
            finest: 192,
            levels: 5,
            features: 1,
            table: 1 << 20,
            hidden: 16,
            softness: 0.25,
            seed: 1,
        }
    }
}

/// Why a grid cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// A size is out of range.
    #[error("{name} = {value}: {needs}")]
    Parameter {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it has to be.
        needs: &'static str,
    },
    /// A parameter is NaN or infinite.
    #[error("parameter {index} is {value}; all must be finite")]
    NotFinite {
        /// Which.
        index: usize,
        /// What stands there.
        value: f32,
    },
    /// Parameters that do not belong to this configuration.
    #[error("{got} parameters, where this configuration has {expected}")]
    Length {
        /// Parameters given.
        got: usize,
        /// Parameters of the configuration.
        expected: usize,
    },
}

impl GridConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first value out of range, or more than 2³⁰ parameters.
    pub fn validate(&self) -> Result<(), GridError> {
        let fault = |name, value: f64, needs| Err(GridError::Parameter { name, value, needs });
        if !(2..=4096).contains(&self.coarsest) {
            return fault("coarsest", self.coarsest.into(), "from 2 to 4096 cells");
        }
        if !(self.coarsest..=4096).contains(&self.finest) {
            return fault("finest", self.finest.into(), "from `coarsest` to 4096 cells");
        }
        if !(1..=16).contains(&self.levels) || (self.levels == 1) != (self.coarsest == self.finest)
        {
            return fault(
                "levels",
                self.levels.into(),
                "from 1 to 16; 1 exactly if `coarsest` is `finest`",
            );
        }
        if ![1, 2, 4].contains(&self.features) {
            return fault("features", self.features.into(), "1, 2 or 4");
        }
        if self.hidden > 256 {
            return fault("hidden", self.hidden.into(), "at most 256");
        }
        if !(self.softness >= 1e-6 && self.softness <= 1e6) {
            return fault("softness", self.softness.into(), "from 1e-6 to 1e6");
        }
        let nodes =
            f64::from(self.table).max(f64::from(self.finest) + 3.0) * f64::from(self.levels);
        if nodes * f64::from(self.features) > MOST {
            return fault(
                "table",
                self.table.into(),
                "so small that the grid has at most 2^30 parameters",
            );
        }
        Ok(())
    }

    /// Cells along a side, level by level: rounded from a geometric progression.
    pub fn cells(&self) -> Vec<u32> {
        let (first, last) = (f64::from(self.coarsest), f64::from(self.finest));
        (0..self.levels)
            .map(|l| {
                let share = f64::from(l) / f64::from(self.levels.max(2) - 1);
                (first * (last / first).powf(share)).round() as u32
            })
            .collect()
    }

    fn layout(&self) -> (Vec<Level>, Head) {
        let f = self.features as usize;
        let mut offset = 0;
        let levels: Vec<Level> = self
            .cells()
            .into_iter()
            .map(|cells| {
                let level = Level::new(cells as usize, self.table as usize, offset);
                offset += level.entries * f;
                level
            })
            .collect();
        let linear =
            levels.iter().flat_map(|l| (0..f).map(|k| if k == 0 { l.cell } else { 0.0 })).collect();
        (levels, Head { linear, hidden: self.hidden as usize, softness: self.softness })
    }
}

/// φ over the cube [−1, 1]³ from features on nested grids.
///
/// ```text
/// f_l(x) = Σ B²(x / h_l − n) c_l,n         over the 27 nodes n round x of each level l
/// φ = Σ_l h_l f_l,0  +  v · σ(W f + b) + c,   σ(z) = (z + √(z² + s)) / 2
/// ```
///
/// B² is the uniform quadratic B-spline, so that φ has a continuous gradient: with trilinear
/// features ∇φ jumps at every face of a cell, and the eikonal and normal terms of a fit, which are
/// losses on ∇φ, could not be met. (Smoothed trilinear weights are continuous too, but make ∇φ
/// vanish at the nodes.) σ is a softplus without transcendental functions, so that the same bits
/// come out wherever products are fused.
///
/// Parameters: the tables level by level, entry by entry, feature by feature; then W, b, v and c.
///
/// # Source
///
/// Müller et al. 2022, *Instant neural graphics primitives*: grids of several resolutions with
/// hashing. Splines, hashing of rows instead of nodes (three nodes of a row are neighbours in
/// memory), and the linear path are ours.
#[derive(Clone, Debug)]
pub struct GridField {
    config: GridConfig,
    levels: Vec<Level>,
    head: Head,
    params: Vec<f32>,
}

impl GridField {
    /// A grid that holds the sphere of radius 0.5.
    ///
    /// # Errors
    ///
    /// A configuration out of range.
    pub fn new(config: GridConfig) -> Result<Self, GridError> {
        config.validate()?;
        let (levels, head) = config.layout();
        let tables = levels.last().map_or(0, |l| l.offset + l.entries * config.features as usize);
        let mut params = vec![0.0; tables + head.len()];
        let mut random = Pcg64Mcg::seed_from_u64(config.seed);
        let features = config.features as usize;
        // The first feature is the field itself; the others only have to differ.
        for (k, c) in params[..tables].iter_mut().enumerate() {
            if k % features > 0 {
                *c = random.random_range(-0.01..0.01);
            }
        }
        let inputs = head.linear.len();
        let reach = (1.0 / inputs as f32).sqrt();
        let (weights, rest) = params[tables..].split_at_mut(head.hidden * inputs);
        weights.iter_mut().for_each(|w| *w = random.random_range(-reach..reach));
        // v stays 0: the network begins as the linear path.
        rest[..head.hidden].iter_mut().for_each(|b| *b = random.random_range(-0.5..0.5));
        let mut grid = Self { config, levels, head, params };
        grid.seed(1, |points, out| {
            for (p, o) in points.iter().zip(out) {
                *o = p.iter().map(|x| x * x).sum::<f32>().sqrt() - 0.5;
            }
        });
        Ok(grid)
    }

    /// A grid of given parameters, as [`TrainableField::parameters`] has them.
    ///
    /// # Errors
    ///
    /// A configuration out of range, or another number of parameters.
    pub fn with_parameters(config: GridConfig, params: Vec<f32>) -> Result<Self, GridError> {
        config.validate()?;
        let (levels, head) = config.layout();
        let expected = levels.last().map_or(0, |l| l.offset + l.entries * config.features as usize)
            + head.len();
        if params.len() != expected {
            return Err(GridError::Length { got: params.len(), expected });
        }
        if let Some(index) = params.iter().position(|p| !p.is_finite()) {
            return Err(GridError::NotFinite { index, value: params[index] });
        }
        Ok(Self { config, levels, head, params })
    }

    /// Its sizes.
    pub fn config(&self) -> &GridConfig {
        &self.config
    }

    /// Names and shapes of the parts of the parameters, in their order.
    pub fn parts(&self) -> Vec<(String, Vec<usize>)> {
        parts(&self.config, &self.levels, &self.head)
    }

    /// The same for a grid that is not there yet.
    ///
    /// # Errors
    ///
    /// A configuration out of range.
    pub fn parts_of(config: &GridConfig) -> Result<Vec<(String, Vec<usize>)>, GridError> {
        config.validate()?;
        let (levels, head) = config.layout();
        Ok(parts(config, &levels, &head))
    }

    fn tables(&self) -> usize {
        self.params.len() - self.head.len()
    }

    /// Reads all features of up to [`LANES`] points; lanes beyond hold the last of them.
    #[inline(always)]
    fn read_tile<S: Simd, const F: usize>(&self, points: &[[f32; 3]], tile: &mut Tile) {
        for (l, level) in self.levels.iter().enumerate() {
            let table = &self.params[level.offset..][..level.entries * F];
            for lane in 0..LANES {
                let (value, gradient) =
                    level.read::<S, F>(table, &points[lane.min(points.len() - 1)]);
                for f in 0..F {
                    tile.f[l * F + f][lane] = value[f];
                    for k in 0..3 {
                        tile.jacobian[l * F + f][k][lane] = gradient[k][f];
                    }
                }
            }
        }
    }
}

fn parts(config: &GridConfig, levels: &[Level], head: &Head) -> Vec<(String, Vec<usize>)> {
    let (f, d, h) = (config.features as usize, head.linear.len(), head.hidden);
    let tables =
        levels.iter().enumerate().map(|(l, level)| (format!("grid.{l}"), vec![level.entries, f]));
    let head = [
        ("hidden.weight", vec![h, d]),
        ("hidden.bias", vec![h]),
        ("out.weight", vec![1, h]),
        ("out.bias", vec![1]),
    ];
    tables.chain(head.map(|(name, shape)| (name.to_owned(), shape))).collect()
}

/// φ and ∇φ of one block.
struct Read<'a, const F: usize> {
    grid: &'a GridField,
    points: &'a [[f32; 3]],
    out: &'a mut [Sample32],
}

impl<const F: usize> WithSimd for Read<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let head = &self.grid.head;
        let mut tile = Tile::new(head);
        for (points, out) in self.points.chunks(LANES).zip(self.out.chunks_mut(LANES)) {
            self.grid.read_tile::<S, F>(points, &mut tile);
            let (value, gradient) =
                head.forward::<S>(&self.grid.params[self.grid.tables()..], &mut tile);
            for (lane, o) in out.iter_mut().enumerate() {
                *o = Sample32 {
                    value: value[lane],
                    gradient: [gradient[0][lane], gradient[1][lane], gradient[2][lane]],
                };
            }
        }
    }
}

/// Loss, its derivatives by the head, and those by the features, of one block.
struct Reverse<'a, const F: usize> {
    grid: &'a GridField,
    points: &'a [[f32; 3]],
    /// Index of the first point.
    first: usize,
    loss: &'a (dyn Fn(usize, Sample32) -> PointLoss + Sync),
    /// For each level and point of the block: derivatives by the value and the gradient of the F
    /// features.
    adjoint: &'a mut [[[f32; F]; 4]],
}

impl<const F: usize> WithSimd for Reverse<'_, F> {
    type Output = (f64, Vec<f32>);

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> (f64, Vec<f32>) {
        let (head, levels) = (&self.grid.head, self.grid.levels.len());
        let params = &self.grid.params[self.grid.tables()..];
        let mut tile = Tile::new(head);
        let mut sums = vec![ZERO; head.len()];
        let mut total = 0.0;
        let n = self.points.len();
        for (t, points) in self.points.chunks(LANES).enumerate() {
            self.grid.read_tile::<S, F>(points, &mut tile);
            let (value, gradient) = head.forward::<S>(params, &mut tile);
            // Lanes without a point have no loss.
            let (mut d_value, mut d_gradient) = (ZERO, [ZERO; 3]);
            for lane in 0..points.len() {
                let sample = Sample32 {
                    value: value[lane],
                    gradient: [gradient[0][lane], gradient[1][lane], gradient[2][lane]],
                };
                let l = (self.loss)(self.first + t * LANES + lane, sample);
                total += l.loss;
                d_value[lane] = l.d_value;
                (0..3).for_each(|k| d_gradient[k][lane] = l.d_gradient[k]);
            }
            head.reverse::<S>(params, &mut tile, &d_value, &d_gradient, &mut sums);
            for level in 0..levels {
                for lane in 0..points.len() {
                    let to = &mut self.adjoint[level * n + t * LANES + lane];
                    for f in 0..F {
                        let d = level * F + f;
                        to[0][f] = tile.adjoint[d][lane];
                        (0..3).for_each(|k| to[1 + k][f] = tile.q[d][lane] * d_gradient[k][lane]);
                    }
                }
            }
        }
        (total, sums.iter().map(|lanes: &Lanes| lanes.iter().sum()).collect())
    }
}

/// Adds the derivatives by the features of one level to those by its nodes.
struct Scatter<'a, const F: usize> {
    level: &'a Level,
    points: &'a [[f32; 3]],
    adjoint: &'a [[[f32; F]; 4]],
    table: &'a mut [f32],
}

impl<const F: usize> WithSimd for Scatter<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for (p, a) in self.points.iter().zip(self.adjoint) {
            self.level.scatter::<S, F>(self.table, p, a);
        }
    }
}

impl GridField {
    fn samples_of<const F: usize>(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        let arch = pulp::Arch::new();
        let one = |(points, out): (&[[f32; 3]], &mut [Sample32])| {
            arch.dispatch(Read::<F> { grid: self, points, out })
        };
        if points.len() <= BLOCK {
            return points.chunks(BLOCK).zip(out.chunks_mut(BLOCK)).for_each(one);
        }
        points.par_chunks(BLOCK).zip(out.par_chunks_mut(BLOCK)).for_each(one);
    }

    fn loss_gradient_of<const F: usize>(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        let arch = pulp::Arch::new();
        let levels = self.levels.len();
        let mut adjoint = vec![[[0.0f32; F]; 4]; levels * points.len()];
        let parts: Vec<(f64, Vec<f32>)> = points
            .par_chunks(BLOCK)
            .zip(adjoint.par_chunks_mut(BLOCK * levels))
            .enumerate()
            .map(|(b, (points, adjoint))| {
                arch.dispatch(Reverse::<F> { grid: self, points, first: b * BLOCK, loss, adjoint })
            })
            .collect();
        let (mut tables, head) = gradient.split_at_mut(self.tables());
        head.fill(0.0);
        let mut total = 0.0;
        for (loss, part) in &parts {
            total += loss;
            head.iter_mut().zip(part).for_each(|(h, p)| *h += p);
        }
        // One task a level, so that every node is summed in the order of the points.
        let mut tasks = Vec::with_capacity(levels);
        for (l, level) in self.levels.iter().enumerate() {
            let (table, rest) = tables.split_at_mut(level.entries * F);
            tables = rest;
            tasks.push((l, level, table));
        }
        tasks.into_par_iter().rev().for_each(|(l, level, table)| {
            table.fill(0.0);
            for (points, adjoint) in points.chunks(BLOCK).zip(adjoint.chunks(BLOCK * levels)) {
                let adjoint = &adjoint[l * points.len()..][..points.len()];
                arch.dispatch(Scatter::<F> { level, points, adjoint, table: &mut *table });
            }
        });
        total
    }
}

impl TrainableField for GridField {
    fn parameters(&self) -> &[f32] {
        &self.params
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.params
    }

    fn refresh(&mut self) {}

    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        assert_eq!(points.len(), out.len(), "one output for each point");
        match self.config.features {
            1 => self.samples_of::<1>(points, out),
            2 => self.samples_of::<2>(points, out),
            _ => self.samples_of::<4>(points, out),
        }
    }

    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        assert_eq!(gradient.len(), self.params.len(), "one derivative for each parameter");
        match self.config.features {
            1 => self.loss_gradient_of::<1>(points, loss, gradient),
            2 => self.loss_gradient_of::<2>(points, loss, gradient),
            _ => self.loss_gradient_of::<4>(points, loss, gradient),
        }
    }
}

#[cfg(test)]
mod tests;
