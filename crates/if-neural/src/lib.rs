//! Neural fields on CPUs: the canonical signed distance field and the deformation of *IF-Garments*
//! (supplement, Appendix E), fitted and evaluated by fused kernels, without a GPU.
//!
//! A [`Target`] (a signed distance field, or [`OrientedPoints`]) gives a [`TrainingSet`] and a
//! [`Network`] to begin with; a [`Fit`] trains it; [`NeuralField`] is the result as a signed distance
//! field in metres. [`fit_deformation`] trains a [`DeformationNetwork`] to follow points over time.
//! [`files`] reads and writes networks, deformations and checkpoints as safetensors.
//!
//! # Examples
//!
//! ```
//! use if_core::shapes::Sphere;
//! use if_core::{Point, SignedDistance, Silent};
//! use if_neural::{Fit, FitParams, GridConfig, NetworkConfig, NeuralField, SamplingParams, Target};
//!
//! let ball = Sphere { center: Point::new(0.0, 1.0, 0.0), radius: 0.3 };
//! let config = NetworkConfig::Grid(GridConfig { finest: 32, levels: 2, ..Default::default() });
//! let sampling = SamplingParams { near: 5000, far: 500, held_out: 500, ..Default::default() };
//! let (set, mut network) = Target::Field(&ball).begin(&config, &sampling)?;
//! let params = FitParams { steps: Some(20), seconds: None, ..config.fit_params() };
//! let report = Fit::new(params)?.run(&mut network, &set, &mut Silent)?;
//! assert!(report.error.mean < 1e-3); // metres
//!
//! let field = NeuralField::new(network, set.frame)?;
//! assert!((field.distance(&Point::new(0.0, 1.1, 0.0)) + 0.2).abs() < 0.01);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Features
//!
//! - `train` (default): targets, fits and checkpoints. Without it networks are read, written and
//!   evaluated. Adds no dependencies.
//! - `burn`: φ and d as burn modules on any backend, their fits by burn, and the kernels as a burn
//!   operation.

#[cfg(feature = "train")]
pub mod accuracy;
#[cfg(feature = "train")]
pub mod adam;
#[cfg(feature = "burn")]
pub mod burn;
#[cfg(feature = "train")]
pub mod cloud;
#[cfg(feature = "train")]
pub mod deform;
pub mod deformation;
mod encoding;
mod error;
pub mod field;
pub mod files;
#[cfg(feature = "train")]
pub mod fit;
pub mod frame;
pub mod frozen;
pub mod grid;
mod init;
mod kernel;
#[cfg(feature = "train")]
pub mod loss;
pub mod mlp;
pub mod network;
#[cfg(feature = "train")]
mod random;
#[doc(hidden)]
pub mod reference;
#[cfg(feature = "train")]
pub mod sampling;
#[cfg(feature = "train")]
pub mod schedule;
pub mod sdf;
mod step;
#[cfg(feature = "train")]
pub mod target;
pub mod trainable;
#[cfg(feature = "train")]
mod training;

#[cfg(feature = "train")]
pub use cloud::OrientedPoints;
#[cfg(feature = "train")]
pub use deform::{DeformParams, DeformReport, fit_deformation};
pub use deformation::DeformationNetwork;
pub use error::{FitError, NetworkError, TargetError};
pub use field::{FieldError, NeuralField};
#[cfg(feature = "train")]
pub use fit::{Ended, Fit, FitParams, FitReport};
pub use frame::Frame;
pub use grid::GridConfig;
#[doc(hidden)]
pub use kernel::isa::Isa;
pub use mlp::{DeformationConfig, SdfConfig};
pub use network::{Network, NetworkConfig};
#[cfg(feature = "train")]
pub use sampling::{SamplingParams, TrainingSet};
#[cfg(feature = "train")]
pub use target::Target;
pub use trainable::TrainableField;

/// The example in the README is a test.
#[cfg(all(doctest, feature = "train"))]
#[doc = include_str!("../README.md")]
struct Readme;
