//! The means to make a good open mesh of an extracted surface: [`clip`], [`collapse`] and
//! [`relax`].

mod clip;
mod collapse;
mod relax;

pub use clip::clip;
pub use collapse::collapse;
pub(crate) use relax::relax_within;
pub use relax::{RelaxError, RelaxParams, relax};
