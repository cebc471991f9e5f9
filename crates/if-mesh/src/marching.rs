//! Operations that turn an extracted surface into a good open mesh: [`clip`], [`collapse`] and
//! [`relax`].

mod clip;
mod collapse;
mod newton;
mod relax;

pub use clip::clip;
pub use collapse::collapse;
pub(crate) use newton::newton_step;
pub(crate) use relax::relax_within;
pub use relax::{RelaxParams, relax};
