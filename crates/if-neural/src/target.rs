//! What a network is fitted to, and how a fit begins.

use crate::cloud::OrientedPoints;
use crate::fit::FitParams;
use crate::grid::GridConfig;
use crate::loss::LossParams;
use crate::mlp::SdfConfig;
use crate::network::{Network, NetworkConfig, NetworkError};
use crate::sampling::{SamplingError, SamplingParams, TrainingSet};
use crate::schedule::Schedule;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use rayon::prelude::*;

/// What a network is fitted to.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub enum Target<'a> {
    /// A field that is finite in its box, such as that of a closed mesh.
    Field(&'a dyn SignedDistance),
    /// Points with normals, such as a scan: noisy, and with holes.
    Points(&'a OrientedPoints),
}

impl std::fmt::Debug for Target<'_> {
    /// Without the field, which cannot tell what it is.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Field(_) => f.debug_tuple("Field").finish_non_exhaustive(),
            Self::Points(points) => f.debug_tuple("Points").field(points).finish(),
        }
    }
}

/// Why a fit cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BeginError {
    /// The target or the sampling parameters.
    #[error(transparent)]
    Sampling(#[from] SamplingError),
    /// The sizes of the network.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

impl Target<'_> {
    /// Training and held-out points.
    ///
    /// # Errors
    ///
    /// See [`SamplingError`].
    pub fn training_set(&self, params: &SamplingParams) -> Result<TrainingSet, SamplingError> {
        match self {
            Self::Field(field) => TrainingSet::of_field(*field, params),
            Self::Points(cloud) => TrainingSet::of_points(cloud, params),
        }
    }

    /// Training points, and a network to begin with: of grids the first values are the target's,
    /// level by level,
    /// [`GridField::seed`](crate::grid::GridField::seed); other networks begin as a sphere.
    ///
    /// # Errors
    ///
    /// A target that is none, parameters or sizes out of range.
    pub fn begin(
        &self,
        config: &NetworkConfig,
        params: &SamplingParams,
    ) -> Result<(TrainingSet, Network), BeginError> {
        let mut network = Network::new(config, params.seed)?;
        let set = self.training_set(params)?;
        if let Network::Grid(grid) = &mut network {
            let levels = grid.config().levels as usize;
            grid.seed(levels, |units, out| {
                let points: Vec<Point> = units.iter().map(|u| set.frame.to_metres(u)).collect();
                let mut distances = vec![0.0; points.len()];
                match self {
                    Self::Field(field) => field.distances(&points, &mut distances),
                    Self::Points(cloud) => {
                        let smoothing = params.smoothing_of(cloud);
                        points
                            .par_iter()
                            .zip(&mut distances)
                            .for_each(|(p, d)| *d = cloud.estimate(p, smoothing).distance);
                    }
                }
                for (o, d) in out.iter_mut().zip(&distances) {
                    // Nodes of a field that is not finite everywhere keep out of the way.
                    let d: Real = if d.is_finite() { *d } else { 1.0 / set.frame.scale };
                    *o = (d * set.frame.scale) as f32;
                }
            });
        }
        Ok((set, network))
    }

    /// The losses that suit the target: errors of points are forgiven up to their noise.
    pub fn loss(&self) -> LossParams {
        match self {
            Self::Field(_) => LossParams::default(),
            Self::Points(_) => LossParams {
                distance_scale: 5e-3,
                normal: 0.01,
                normal_scale: 0.5,
                eikonal: 0.02,
                ..LossParams::default()
            },
        }
    }
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

    /// How to fit it: batches and rates that suit the kind of network. What they reach on clothed
    /// bodies is in `docs/fitting.md`; others were tried, but not tabled.
    pub fn fit_params(&self) -> FitParams {
        match self {
            Self::Grid(_) => FitParams::default(),
            Self::Sdf(_) => FitParams {
                batch: 2048,
                check_every: 25,
                schedule: Schedule { rate: 1e-3, warmup: 50, last: 0.02 },
                adam: crate::adam::AdamParams {
                    beta2: 0.999,
                    epsilon: 1e-8,
                    sparse: false,
                    ..Default::default()
                },
                ..FitParams::default()
            },
        }
    }
}
