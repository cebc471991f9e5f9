//! The proof: exact intersections of every layer with every layer below, and sides by closed fields.

use crate::outfit::{Outfit, OutfitError};
use crate::report::Verification;

/// Checks an outfit without changing it.
///
/// # Errors
///
/// The outfit is not usable: see [`OutfitError`].
pub fn verify(outfit: &Outfit) -> Result<Verification, OutfitError> {
    outfit.check()?;
    Ok(Verification::default())
}
