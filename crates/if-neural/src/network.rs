//! One of the networks for φ, chosen at run time.

use crate::error::NetworkError;
use crate::grid::{GridConfig, GridField};
use crate::mlp::SdfConfig;
use crate::sdf::SdfNetwork;
use crate::trainable::{PointLoss, Sample32, TrainableField};
use serde::{Deserialize, Serialize};

/// Which network, and how large.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum NetworkConfig {
    /// Features on grids with a small network.
    Grid(GridConfig),
    /// The network of Appendix E.
    Sdf(SdfConfig),
}

impl NetworkConfig {
    /// The grid encoding.
    pub fn grid() -> Self {
        Self::Grid(GridConfig::default())
    }

    /// The paper's sizes.
    pub fn paper() -> Self {
        Self::Sdf(SdfConfig::paper())
    }

    /// The paper's network, 256 wide.
    pub fn fast() -> Self {
        Self::Sdf(SdfConfig::fast())
    }
}

/// A network for φ with its parameters.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // one per program
#[non_exhaustive]
pub enum Network {
    /// Features on grids with a small network.
    Grid(GridField),
    /// The network of Appendix E.
    Sdf(SdfNetwork),
}

impl Network {
    /// A network close to a sphere; the same for the same seed.
    ///
    /// # Errors
    ///
    /// A size is out of range.
    pub fn new(config: &NetworkConfig, seed: u64) -> Result<Self, NetworkError> {
        Ok(match config {
            NetworkConfig::Grid(config) => {
                Self::Grid(GridField::new(GridConfig { seed, ..*config })?)
            }
            NetworkConfig::Sdf(config) => Self::Sdf(SdfNetwork::new(config, seed)?),
        })
    }

    /// The network with the parameters `theta`.
    ///
    /// # Errors
    ///
    /// A size is out of range, or the parameters do not match.
    pub fn with_parameters(config: &NetworkConfig, theta: Vec<f32>) -> Result<Self, NetworkError> {
        Ok(match config {
            NetworkConfig::Grid(config) => Self::Grid(GridField::with_parameters(*config, theta)?),
            NetworkConfig::Sdf(config) => Self::Sdf(SdfNetwork::from_parameters(config, theta)?),
        })
    }

    /// The sizes.
    pub fn config(&self) -> NetworkConfig {
        match self {
            Self::Grid(grid) => NetworkConfig::Grid(*grid.config()),
            Self::Sdf(sdf) => NetworkConfig::Sdf(sdf.config().clone()),
        }
    }

    fn field(&self) -> &dyn TrainableField {
        match self {
            Self::Grid(grid) => grid,
            Self::Sdf(sdf) => sdf,
        }
    }

    fn field_mut(&mut self) -> &mut dyn TrainableField {
        match self {
            Self::Grid(grid) => grid,
            Self::Sdf(sdf) => sdf,
        }
    }
}

impl TrainableField for Network {
    fn parameters(&self) -> &[f32] {
        self.field().parameters()
    }

    fn parameters_mut(&mut self) -> &mut [f32] {
        self.field_mut().parameters_mut()
    }

    fn refresh(&mut self) {
        self.field_mut().refresh();
    }

    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        self.field().samples32(points, out);
    }

    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        self.field().loss_gradient(points, loss, gradient)
    }
}
