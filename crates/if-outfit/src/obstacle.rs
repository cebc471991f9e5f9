//! Where an inner garment spans two parts of the body that an outer one encloses one by one: a skirt
//! under trousers, a wide sleeve under a narrow one.
//!
//! No fixed mesh can lie inside there but by being lifted to where the outer garment joins its
//! parts: a skirt to the crotch of the trousers, the armpit of a coat to that of the shirt over it.
//! If the outer garment passes between each end of a bridge ([`crate::bridges`]) and its skin, and
//! between bridge and junction, then the bridge must be lifted as far as the outer garment is away,
//! towards the junction or along the inner garment's own normal, whichever is nearer. Garments that
//! are pressed in are led that way ([`crate::ways_in`]).

use crate::bridges::bridges;
use crate::findings::Findings;
use crate::outfit::Outfit;
use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real};
use if_mesh::index::Bvh;
use if_mesh::solid::ClosedLayer;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Why a garment cannot lie over another: it would have to be lifted between two parts of the body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Obstacle {
    /// The garment that spans both parts.
    pub inner: String,
    /// The one that encloses each part on its own.
    pub outer: String,
    /// Where the inner garment would have to be lifted farthest.
    pub at: Point,
    /// How far, in metres.
    pub lift: Real,
}

impl Obstacle {
    /// Whether the garments cannot be worn in this order, so that nothing is tried.
    ///
    /// In the test data the largest lift in an outfit that ends clean is 17 cm (a waistcoat under a
    /// jacket, in an order that was drawn), and the smallest of a skirt under trousers 20 cm. A coat under
    /// jeans, 18 to 20 cm, may be tried in vain.
    pub fn is_hopeless(&self) -> bool {
        self.lift > HOPELESS
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { inner, outer, at, lift } = self;
        write!(
            f,
            "`{inner}` spans two parts of the body that `{outer}` encloses one by one; near \
             ({:.2}, {:.2}, {:.2}) it would have to be lifted by {:.0} cm to lie below",
            at.x,
            at.y,
            at.z,
            1e2 * lift
        )?;
        if self.is_hopeless() {
            write!(
                f,
                ", so `{outer}` and what is over it stayed as they came; wear `{outer}` below \
                 `{inner}`"
            )?;
        }
        Ok(())
    }
}

/// Lifts of more than this, in metres, are not tried.
pub(crate) const HOPELESS: Real = 0.2;
/// Lifts of less than this hinder nobody, in metres.
const SMALL: Real = 0.03;
/// So many bridges of a garment are looked at.
const MOST: usize = 64;
/// Only garments that lie this deep in the one below are looked at, in metres: a shallower overlap
/// has no bridges of note.
const DEEP: Real = 0.03;

/// The obstacles of `outfit`, in which `found` was found; `closed` are its body and garments but the
/// outermost, closed.
pub(crate) fn obstacles(
    outfit: &Outfit,
    found: &[Findings],
    closed: &[Arc<ClosedLayer>],
) -> Vec<Obstacle> {
    let deep = |inner: usize, outer: usize| found[outer].below[inner + 1].deepest > DEEP;
    let mut body = None;
    let mut obstacles = Vec::new();
    for inner in 0..outfit.garments.len() {
        let outers: Vec<usize> =
            (inner + 1..outfit.garments.len()).filter(|outer| deep(inner, *outer)).collect();
        if outers.is_empty() {
            continue;
        }
        let skin = &outfit.body.mesh;
        let ways = body.get_or_insert_with(|| Neighbours::new(&Edges::new(skin), skin.vertices()));
        let garment = &outfit.garments[inner];
        let bridges = bridges(&garment.mesh, &closed[inner + 1], &closed[0], skin, ways, MOST);
        for outer in outers {
            let tree = Bvh::new(&outfit.garments[outer].mesh);
            let lifts = bridges.iter().filter_map(|b| Some((b.lift(&tree)?, b.middle)));
            let highest = lifts.max_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((lift, at)) = highest.filter(|(lift, _)| *lift > SMALL) {
                let [inner, outer] = [inner, outer].map(|k| outfit.garments[k].name.clone());
                obstacles.push(Obstacle { inner, outer, at, lift });
            }
        }
    }
    obstacles
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::params::ResolveParams;
    use crate::resolve::{ResolveError, resolve};
    use crate::unresolved::Unresolved;
    use crate::verify::verify_layers;
    use if_body::mannequin::{self, Garment, MannequinParams};
    use if_core::monitor::Silent;

    pub(crate) fn worn(garments: [Garment; 2]) -> Outfit {
        let scene = MannequinParams { resolution: 0.7, ..Default::default() };
        let layer = |g: Garment| Layer::new(g.name(), mannequin::garment(g, &scene));
        let body = Layer::new("body", mannequin::body(&scene));
        Outfit::new(body, garments.map(layer).to_vec()).unwrap()
    }

    fn found(outfit: &Outfit) -> Vec<Obstacle> {
        let (found, closed) = verify_layers(outfit, None);
        obstacles(outfit, &found, &closed)
    }

    #[test]
    fn a_skirt_cannot_be_worn_under_trousers_and_nothing_is_tried() {
        let outfit = worn([Garment::Skirt, Garment::Trousers]);
        let [obstacle] = &found(&outfit)[..] else { panic!("one is in the way") };
        assert_eq!((obstacle.inner.as_str(), obstacle.outer.as_str()), ("skirt", "trousers"));
        assert!(obstacle.is_hopeless(), "{obstacle}");
        // Between the legs, and not higher than from the hem to the crotch.
        assert!(obstacle.at.x.abs() < 0.05 && obstacle.lift < 0.4, "{obstacle}");
        let resolved = resolve(&outfit, &ResolveParams::default(), &mut Silent);
        let Err(ResolveError::Unresolved { outer, inner, result, .. }) = resolved else {
            panic!("it cannot be resolved")
        };
        assert_eq!((inner.as_str(), outer.as_str()), ("skirt", "trousers"));
        assert_eq!(result.outfit.garments[1], outfit.garments[1]);
        let unresolved = Unresolved::in_report(&result.report).unwrap();
        assert_eq!(unresolved.obstacle.as_deref(), Some(obstacle));
        let text = unresolved.to_string();
        assert!(text.contains("wear `trousers` below `skirt`"), "{text}");
    }

    #[test]
    fn garments_in_the_usual_order_have_no_obstacles() {
        assert_eq!(found(&worn([Garment::Trousers, Garment::Skirt])), []);
        assert_eq!(found(&worn([Garment::Tshirt, Garment::Jacket])), []);
    }
}
