//! Constraint groups that [`if_xpbd::stretch::Stretch`] and the product's distances across edges are
//! compared with in the error-versus-time benches. The product does not use them.

pub mod bending;
pub mod direct;
pub mod global;
