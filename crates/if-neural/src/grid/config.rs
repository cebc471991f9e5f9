//! Sizes of a grid, and where its parameters are.

use super::head::Head;
use super::level::Level;
use super::seed::LARGEST;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Most parameters, 4 GiB: larger configurations are mistakes.
const MOST: f64 = (1u64 << 30) as f64;

/// Sizes of a [`GridField`](super::GridField).
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
    /// Seed of the initial values. [`Network::new`](crate::network::Network::new) takes its own.
    pub seed: u64,
}

impl Default for GridConfig {
    /// For a clothed body of 1.7 m: finest cells of 10 mm, 2.3 million parameters.
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

impl GridConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first value out of range, or more than 2³⁰ parameters.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = |name, value: f64, ok, needs| ParameterError::check(name, value, ok, needs);
        let most = LARGEST as u32 - 3;
        let ok = (2..=most).contains(&self.coarsest);
        check("coarsest", self.coarsest.into(), ok, "from 2 to 509 cells")?;
        let ok = (self.coarsest..=4096).contains(&self.finest);
        check("finest", self.finest.into(), ok, "from `coarsest` to 4096 cells")?;
        let one = (self.levels == 1) == (self.coarsest == self.finest);
        let needs = "from 1 to 16; 1 exactly if `coarsest` is `finest`";
        check("levels", self.levels.into(), one && (1..=16).contains(&self.levels), needs)?;
        let ok = [1, 2, 4].contains(&self.features);
        check("features", self.features.into(), ok, "1, 2 or 4")?;
        check("hidden", self.hidden.into(), self.hidden <= 256, "at most 256")?;
        let ok = self.softness >= 1e-6 && self.softness <= 1e6;
        check("softness", self.softness.into(), ok, "from 1e-6 to 1e6")?;
        let nodes =
            f64::from(self.table).max(f64::from(self.finest) + 3.0) * f64::from(self.levels);
        let ok = nodes * f64::from(self.features) <= MOST;
        check("table", self.table.into(), ok, "small enough for 2^30 parameters in all levels")
    }

    /// Cells along a side, level by level: rounded from a geometric progression.
    pub(crate) fn cells(&self) -> Vec<u32> {
        let (first, last) = (f64::from(self.coarsest), f64::from(self.finest));
        (0..self.levels)
            .map(|l| {
                let share = f64::from(l) / f64::from(self.levels.max(2) - 1);
                (first * (last / first).powf(share)).round() as u32
            })
            .collect()
    }

    /// The levels and the network on top, with their places in the parameters.
    pub(super) fn layout(&self) -> (Vec<Level>, Head) {
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
