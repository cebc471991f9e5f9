//! Parameters of the training of φ and d.

use crate::reconstruct::phi::{PhiParams, TABLE};
use if_core::math::Real;
use if_core::parameter::ParameterError;
use if_neural::adam::AdamParams;
use if_neural::grid::GridConfig;
use if_neural::mlp::{DeformationConfig, SdfConfig};
use if_neural::network::NetworkConfig;
use if_neural::sampling::SamplingParams;
use if_neural::schedule::Schedule;

/// Parameters of [`fit_fields`](crate::reconstruct::fit_fields). Training has a fixed number of
/// steps, not of seconds, so that the same capture gives the same bits.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldsParams {
    /// The network of φ, and its fit to the start.
    pub phi: PhiParams,
    /// The network of d; its number of frames is replaced by that of the capture.
    pub deformation: DeformationConfig,
    /// Steps of the fit of d to the solved motion, if one is given; 0 leaves that out.
    pub motion_steps: u64,
    /// Steps.
    pub steps: u64,
    /// Steps from one rasterisation of all frames, and checkpoint, to the next.
    pub refresh: u64,
    /// Pixels with normals in a step.
    pub rays: usize,
    /// Points on silhouettes in a step.
    pub silhouettes: usize,
    /// Points near the surface in a step, for the eikonal term and the bending.
    pub points: usize,
    /// Points anywhere in the cube in a step, where φ stays as it was.
    pub far: usize,
    /// Evaluations of d on the surface in a step: all frames at as many points as it takes.
    pub material: usize,
    /// Newton's steps of each ray.
    pub newton: usize,
    /// Weights of the terms.
    pub weights: FieldsWeights,
    /// Learning rate of φ.
    pub phi_rate: Schedule,
    /// Learning rate of d.
    pub deformation_rate: Schedule,
    /// The optimiser of d; φ has that of its network ([`NetworkConfig::fit_params`]).
    pub deformation_adam: AdamParams,
    /// Seed of d's initial values and of the batches.
    pub seed: u64,
}

/// Weights of the terms of the loss, each a mean over its points:
///
/// ```text
/// normals      1 − n · N, by the area that a pixel sees: over the cosine between N and the line of sight
/// silhouettes  ρ(e), e the distance of the silhouette from the mask's border;  ρ = e² / (1 + e²), e in reach
/// eikonal      (|∇φ| − 1)²
/// stay         (φ − φ of the start)², farther than 5 cm from the surface
/// bending      |δ(a) − δ(b)|² of two points 1 cm apart, δ = ∇φ − ∇φ of the start
/// small        |d|², and along the surface |(1 − n nᵀ) d|²
///                            rigid  |∂d + ∂dᵀ|²          mean  |mean of d over the frames|²
/// smooth       |d of a frame − d of the frame before|²
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldsWeights {
    /// Of the normals.
    pub normals: Real,
    /// Of the silhouettes.
    pub silhouettes: Real,
    /// Distance from the mask's border beyond which a silhouette loses its pull, in metres.
    pub reach: Real,
    /// Of |∇φ| = 1.
    pub eikonal: Real,
    /// Of φ far from the surface, in 1/m².
    pub stay: Real,
    /// Of φ's change of curvature.
    pub bending: Real,
    /// Of d = 0, in 1/m².
    pub small: Real,
    /// Of d = 0 along the surface, which images hardly show, in 1/m².
    pub along: Real,
    /// Of rigidity.
    pub rigid: Real,
    /// Of a mean of d that is zero, in 1/m²: what all frames share belongs to φ.
    pub mean: Real,
    /// Of little change from frame to frame, in 1/m²: embeddings that are smooth in time.
    pub smooth: Real,
}

impl Default for FieldsWeights {
    fn default() -> Self {
        Self {
            normals: 0.35,
            silhouettes: 1.0,
            reach: 0.02,
            eikonal: 0.05,
            stay: 100.0,
            bending: 0.05,
            small: 10.0,
            along: 100.0,
            rigid: 0.01,
            mean: 500.0,
            smooth: 10.0,
        }
    }
}

impl Default for FieldsParams {
    /// The grid encoding for φ, without a hidden layer: its units would act everywhere at once.
    fn default() -> Self {
        let grid = GridConfig { hidden: 0, table: TABLE, ..GridConfig::default() };
        let sampling = SamplingParams { near: 60_000, far: 20_000, ..SamplingParams::default() };
        Self {
            phi: PhiParams { network: NetworkConfig::Grid(grid), steps: 20, sampling },
            deformation: DeformationConfig::fast(1),
            motion_steps: 400,
            steps: 700,
            refresh: 100,
            rays: 2048,
            silhouettes: 768,
            points: 1024,
            far: 256,
            material: 1536,
            newton: 1,
            weights: FieldsWeights::default(),
            phi_rate: Schedule { rate: 5e-4, warmup: 20, last: 0.05 },
            deformation_rate: Schedule { rate: 3e-4, warmup: 20, last: 0.05 },
            deformation_adam: AdamParams {
                beta2: 0.999,
                epsilon: 1e-8,
                sparse: false,
                ..AdamParams::default()
            },
            seed: 1,
        }
    }
}

impl FieldsParams {
    /// φ as the network of Appendix E, 256 wide, instead of the grid encoding.
    pub fn mlp() -> Self {
        let grid = Self::default();
        Self {
            phi: PhiParams {
                network: NetworkConfig::Sdf(SdfConfig { features: 0, ..SdfConfig::fast() }),
                steps: 600,
                ..grid.phi.clone()
            },
            phi_rate: Schedule { rate: 1e-4, ..grid.phi_rate },
            ..grid
        }
    }

    /// Checks the ranges; the sizes of the networks are checked when they are created.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.phi.validate().map_err(|e| e.within("phi"))?;
        for (name, count) in [
            ("rays", self.rays),
            ("silhouettes", self.silhouettes),
            ("points", self.points),
            ("far", self.far),
            ("material", self.material),
        ] {
            let fits = (1..=1 << 20).contains(&count);
            ParameterError::check(name, count as Real, fits, "from 1 to 2^20 points")?;
        }
        let newton = (1..=20).contains(&self.newton);
        ParameterError::check("newton", self.newton as Real, newton, "from 1 to 20 steps")?;
        let refresh = self.refresh > 0;
        ParameterError::check("refresh", self.refresh as Real, refresh, "at least 1 step")?;
        let w = &self.weights;
        for (name, value) in [
            ("normals", w.normals),
            ("silhouettes", w.silhouettes),
            ("eikonal", w.eikonal),
            ("stay", w.stay),
            ("bending", w.bending),
            ("small", w.small),
            ("along", w.along),
            ("rigid", w.rigid),
            ("mean", w.mean),
            ("smooth", w.smooth),
        ] {
            ParameterError::check_not_negative(name, value).map_err(|e| e.within("weights"))?;
        }
        ParameterError::check_positive("reach", w.reach).map_err(|e| e.within("weights"))?;
        self.phi_rate.validate().map_err(|e| e.within("phi_rate"))?;
        self.deformation_rate.validate().map_err(|e| e.within("deformation_rate"))?;
        self.deformation_adam.validate().map_err(|e| e.within("deformation_adam"))
    }
}
