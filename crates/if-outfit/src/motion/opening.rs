//! Opening: layers of a clean outfit that nearly touch are moved apart, as far as there is room.
//!
//! Contacts of the rest state are those of a step in which nothing goes anywhere, with whole gaps
//! between layers; then, as in a step, exact verification.

use super::contact::Opening;
use super::equilibrium::Multipliers;
use super::locality::Yielding;
use super::params::WalkParams;
use super::walk::Walker;
use crate::outfit::{Layer, Outfit};
use if_core::math::{Point, Real};
use if_core::monitor::{Cancelled, Monitor, Progress};

/// Times that the opening of the rest state is tried with other gaps.
const OPENINGS: usize = 10;
/// Distance beyond the gap at which primitives are watched, in gaps: both may move by one.
const MARGIN: Real = 2.0;

/// Most gap of a garment to itself, in metres. With 0.3 mm single edges of two of the 14 test outfits are
/// strained by 156 and 220 %: folds that were made nearer.
pub(crate) const OWN: Real = 1e-4;

impl Walker {
    /// Moves layers apart in the rest state. Where a whole gap is not clean, less is kept.
    /// A garment keeps a gap of at most `own` metres to itself.
    ///
    /// # Errors
    ///
    /// The monitor, which receives a report before each opening, cancelled.
    pub(super) fn open(
        &mut self,
        yielding: &Yielding,
        own: Real,
        monitor: &mut dyn Monitor,
    ) -> Result<(), Cancelled> {
        let mut share = 1.0;
        for done in 0..OPENINGS {
            monitor.report(&Progress { done, ..Progress::stage("apart") })?;
            let target = self.target.clone();
            let layers = share * self.params.gap;
            let opening = Opening { layers, own: own.min(layers) };
            let attempt = self.attempt(&target, Some(yielding.clone()), Some(opening));
            tracing::debug!(
                share,
                pairs = attempt.pairs.len(),
                contacts = attempt.contacts,
                "opening"
            );
            if attempt.pairs.is_empty() {
                self.accept(attempt, target);
                if share == 1.0 {
                    break;
                }
                share = (2.0 * share).min(1.0);
            } else {
                share *= 0.5;
            }
        }
        self.rest = self.clean.x.clone();
        self.target = self.rest.clone();
        self.multipliers = Multipliers::default();
        self.met.clear();
        Ok(())
    }
}

/// The positions of the garments of `outfit`, with `gap` metres between any two layers where there is
/// room, over the body as it is; `None` if layers intersect. No pair of triangles meets that did not
/// before, as far as all layers round alike.
///
/// # Errors
///
/// The monitor cancelled.
pub(crate) fn moved_apart(
    outfit: &Outfit,
    gap: Real,
    monitor: &mut dyn Monitor,
) -> Result<Option<Vec<Vec<Point>>>, Cancelled> {
    let params = WalkParams { gap, margin: MARGIN * gap, ..WalkParams::default() };
    let mut storages = outfit.layers().map(|layer| layer.storage);
    let first = storages.next();
    let storage = first.filter(|first| storages.all(|other| other == *first)).unwrap_or_default();
    let Ok(mut walker) = Walker::at_rest(outfit, params, storage) else { return Ok(None) };
    let mut yielding = Yielding::everywhere(&walker.scene);
    yielding.inverse_mass[..walker.scene.starts[1]].fill(0.0);
    walker.open(&yielding, OWN, monitor)?;
    let garments = outfit.garments.iter().enumerate();
    let of =
        |(k, garment): (usize, &Layer)| garment.storage.round(walker.layer(walker.rest(), k + 1));
    Ok(Some(garments.map(of).collect()))
}
