//! What a network is fitted to, and how a fit begins.

use crate::cloud::OrientedPoints;
use crate::error::TargetError;
use crate::loss::LossParams;
use crate::network::{Network, NetworkConfig};
use crate::sampling::{SamplingParams, Scan, TrainingSet};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};

/// The distances at points.
type Distances<'a> = Box<dyn Fn(&[Point], &mut [Real]) + 'a>;

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
    /// Without the field, which need not implement `Debug`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Field(_) => f.debug_tuple("Field").finish_non_exhaustive(),
            Self::Points(points) => f.debug_tuple("Points").field(points).finish(),
        }
    }
}

impl Target<'_> {
    /// Training and held-out points.
    ///
    /// # Errors
    ///
    /// See [`TargetError`].
    pub fn training_set(&self, params: &SamplingParams) -> Result<TrainingSet, TargetError> {
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
    /// An invalid target, or parameters or sizes out of range.
    pub fn begin(
        &self,
        config: &NetworkConfig,
        params: &SamplingParams,
    ) -> Result<(TrainingSet, Network), TargetError> {
        let mut network = Network::new(config, params.seed)?; // sizes are checked before sampling
        params.validate()?;
        let (set, distances): (TrainingSet, Distances<'_>) = match self {
            Self::Field(field) => {
                let set = TrainingSet::of_field(*field, params)?;
                (set, Box::new(|points, out| field.distances(points, out)))
            }
            Self::Points(cloud) => {
                let scan = Scan::new(cloud, params)?;
                (
                    scan.training_set(params)?,
                    Box::new(move |points, out| scan.distances(points, out)),
                )
            }
        };
        if let Network::Grid(grid) = &mut network {
            let levels = grid.config().levels as usize;
            grid.seed(levels, |units, out| {
                let points: Vec<Point> = units.iter().map(|u| set.frame.to_metres(u)).collect();
                let mut found = vec![0.0; points.len()];
                distances(&points, &mut found);
                for (o, d) in out.iter_mut().zip(&found) {
                    // Where the field is not finite, nodes start outside the surface.
                    let d: Real = if d.is_finite() { *d } else { 1.0 / set.frame.scale };
                    *o = (d * set.frame.scale) as f32;
                }
            });
        }
        Ok((set, network))
    }

    /// The losses that suit the target: points are weighted for noise.
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
