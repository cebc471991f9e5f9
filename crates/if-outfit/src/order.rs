//! An order from the meshes: which of two garments lies inside the other.
//!
//! Each garment is closed over the body ([`ClosedLayer`]). Where two garments overlap, the vertices
//! of each lie inside or outside the other one:
//!
//! ```text
//! P = ∫_A depth inside B + ∫_B height outside A      evidence that A is the inner one
//! N = ∫_B depth inside A + ∫_A height outside B      evidence that B is
//! confidence = |P − N| / (P + N)
//! ```
//!
//! with depths and heights of up to [`REACH`], over the areas of the vertices. The order is the one
//! of all that agrees with the most evidence, `Σ (P − N)` over all pairs.

use crate::outfit::{Layer, Outfit, OutfitError};
use crate::welded::Welded;
use if_core::math::{Real, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::solid::ClosedLayer;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Depth and height up to which a vertex is evidence, in metres: more than clothes are apart, and
/// less than a sleeve is from the torso.
pub const REACH: Real = 0.03;
/// Confidence from which on the order of a pair is not ambiguous. The pairs of the test data that
/// are proposed against the order of their outfits have up to 0.6, most of the others more.
pub const SURE: Real = 0.3;
/// Number of garments up to which all orders are compared; more are sorted by their evidence.
const ALL_ORDERS: usize = 12;
/// Least evidence for which a garment is moved: less is rounding.
const LEAST_GAIN: Real = 1e-12;

/// Two garments that overlap, in the order proposed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct PairOrder {
    /// The inner one.
    pub inner: String,
    /// The outer one.
    pub outer: String,
    /// From 1, where all evidence is for this order, through 0 to −1, where all is against it:
    /// other pairs can outweigh a pair.
    pub confidence: Real,
    /// Area of both that was evidence, in square metres.
    pub area: Real,
}

/// An order of garments, inner to outer, and how sure it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, Default)]
#[non_exhaustive]
pub struct OrderProposal {
    /// Indices of the garments as given, innermost first.
    pub order: Vec<usize>,
    /// Their names.
    pub names: Vec<String>,
    /// All pairs that overlap, the least sure first.
    pub pairs: Vec<PairOrder>,
    /// The least confidence of a pair; 1 if none overlap.
    pub confidence: Real,
}

impl OrderProposal {
    /// The least sure pair, if it is ambiguous.
    pub fn ambiguous(&self) -> Option<&PairOrder> {
        self.pairs.first().filter(|pair| pair.confidence < SURE)
    }
}

/// Evidence on one pair: for the first garment as the inner one, for the second, and its area.
#[derive(Clone, Copy, Default)]
struct Evidence {
    inner_first: Real,
    inner_second: Real,
    area: Real,
}

/// Proposes an order of the garments of `outfit` from where they lie, whatever their order is.
///
/// Garments that do not overlap keep the order given.
///
/// # Errors
///
/// The outfit is invalid: see [`OutfitError`].
pub fn propose_order(outfit: &Outfit) -> Result<OrderProposal, OutfitError> {
    outfit.check()?;
    let welded = Welded::new(outfit);
    let outfit = welded.as_ref().map_or(outfit, |w| &w.outfit);
    let body = ClosedLayer::body(&outfit.body.mesh);
    let close = |g: &Layer| ClosedLayer::garment(&g.mesh, &body, &outfit.body.mesh);
    let closed: Vec<ClosedLayer> = outfit.garments.par_iter().map(close).collect();
    let n = closed.len();
    let mut evidence = vec![Evidence::default(); n * n];
    for second in 0..n {
        for first in 0..second {
            let meshes = [first, second].map(|k| &outfit.garments[k].mesh);
            evidence[first * n + second] = compare(meshes, [&closed[first], &closed[second]]);
        }
    }
    Ok(proposal(&outfit.garments, &evidence))
}

fn compare(meshes: [&TriMesh; 2], closed: [&ClosedLayer; 2]) -> Evidence {
    let [first, second] = [(0, 1), (1, 0)].map(|(k, other)| lies(meshes[k], closed[other]));
    Evidence {
        inner_first: first.inside + second.outside,
        inner_second: second.inside + first.outside,
        area: first.area + second.area,
    }
}

/// How a garment lies in another one: integrals over its area.
struct Lies {
    inside: Real,
    outside: Real,
    area: Real,
}

fn lies(mesh: &TriMesh, layer: &ClosedLayer) -> Lies {
    let mut areas = vec![0.0; mesh.vertices().len()];
    for (t, corners) in mesh.triangles().iter().enumerate() {
        let [a, b, c] = mesh.corners(t);
        let share = area_vector(a, b, c).norm() / 6.0;
        corners.iter().for_each(|v| areas[*v as usize] += share);
    }
    let distance = |p| layer.sided(p, REACH).filter(|s| !s.boundary).map(|s| s.distance);
    let found: Vec<Option<Real>> = mesh.vertices().par_iter().map(distance).collect();
    let mut lies = Lies { inside: 0.0, outside: 0.0, area: 0.0 };
    for (distance, area) in found.iter().zip(areas) {
        let Some(distance) = distance.map(|d| d.clamp(-REACH, REACH)) else { continue };
        lies.area += area;
        lies.inside += area * (-distance).max(0.0);
        lies.outside += area * distance.max(0.0);
    }
    lies
}

fn proposal(garments: &[Layer], evidence: &[Evidence]) -> OrderProposal {
    let n = garments.len();
    // Evidence that garment a lies below garment b.
    let net = |a: usize, b: usize| {
        let e = evidence[a.min(b) * n + a.max(b)];
        let forward = e.inner_first - e.inner_second;
        if a < b { forward } else { -forward }
    };
    let order = if n <= ALL_ORDERS { best_order(n, &net) } else { sorted_order(n, &net) };
    let name = |k: usize| garments[k].name.clone();
    let mut pairs = Vec::new();
    for (place, outer) in order.iter().enumerate() {
        for inner in &order[..place] {
            let e = evidence[inner.min(outer) * n + inner.max(outer)];
            let all = e.inner_first + e.inner_second;
            if all > 0.0 {
                let confidence = net(*inner, *outer) / all;
                let (inner, outer) = (name(*inner), name(*outer));
                pairs.push(PairOrder { inner, outer, confidence, area: e.area });
            }
        }
    }
    pairs.sort_by(|a, b| a.confidence.total_cmp(&b.confidence));
    let confidence = pairs.first().map_or(1.0, |pair| pair.confidence);
    OrderProposal { names: order.iter().map(|k| name(*k)).collect(), order, pairs, confidence }
}

/// The order with the most evidence; of equal ones the one nearest to the given order.
fn best_order(n: usize, net: &impl Fn(usize, usize) -> Real) -> Vec<usize> {
    // For each set of garments the most evidence of an order in which they are the innermost, and
    // the outermost of them.
    let mut best: Vec<(Real, usize)> = vec![(Real::NEG_INFINITY, 0); 1 << n];
    best[0].0 = 0.0;
    for set in 1..1usize << n {
        for outer in (0..n).rev().filter(|k| set >> k & 1 == 1) {
            let below = set & !(1 << outer);
            let gain: Real =
                (0..n).filter(|k| below >> k & 1 == 1).map(|inner| net(inner, outer)).sum();
            let sum = best[below].0 + gain;
            if sum > best[set].0 {
                best[set] = (sum, outer);
            }
        }
    }
    let mut set = (1usize << n) - 1;
    let mut order = Vec::with_capacity(n);
    while set != 0 {
        let outer = best[set].1;
        order.push(outer);
        set &= !(1 << outer);
    }
    order.reverse();
    order
}

/// Garments by how many others they lie below, then moved one by one as long as that adds evidence.
fn sorted_order(n: usize, net: &impl Fn(usize, usize) -> Real) -> Vec<usize> {
    let below = |k: usize| (0..n).filter(|other| *other != k && net(k, *other) > 0.0).count();
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by_key(|k| std::cmp::Reverse(below(*k)));
    for _ in 0..n * n {
        let mut best = (LEAST_GAIN, 0, 0);
        for from in 0..n {
            // What is gained by passing one garment after the other, outwards and inwards.
            let mut gain = 0.0;
            for to in from + 1..n {
                gain += net(order[to], order[from]);
                best = if gain > best.0 { (gain, from, to) } else { best };
            }
            gain = 0.0;
            for to in (0..from).rev() {
                gain += net(order[from], order[to]);
                best = if gain > best.0 { (gain, from, to) } else { best };
            }
        }
        let (gain, from, to) = best;
        if gain <= LEAST_GAIN {
            break;
        }
        let moved = order.remove(from);
        order.insert(to, moved);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::meshes::{icosphere, tube};

    /// A ball in bands of these radii.
    fn bands(radii: &[Real]) -> Outfit {
        let band = |radius: Real| {
            let tube = tube(radius, 0.2, 48, 8, false);
            let centred = tube.vertices().iter().map(|p| Point::new(p.x, p.y - 0.1, p.z));
            tube.with_vertices(centred.collect()).unwrap()
        };
        let layer = |(k, radius): (usize, &Real)| Layer::new(format!("band{k}"), band(*radius));
        let garments = radii.iter().enumerate().map(layer).collect();
        Outfit::new(Layer::new("ball", icosphere(0.3, 4)), garments).unwrap()
    }

    #[test]
    fn bands_are_ordered_by_radius() {
        let found = propose_order(&bands(&[0.33, 0.31, 0.34, 0.32])).unwrap();
        assert_eq!(found.order, [1, 3, 0, 2]);
        assert_eq!(found.names, ["band1", "band3", "band0", "band2"]);
        assert!(found.confidence > 0.9 && found.ambiguous().is_none(), "{found:?}");
        let many: Vec<Real> =
            (0..14).map(|k| 0.31 + 0.005 * Real::from((5 * k + 3) % 14)).collect();
        let found = propose_order(&bands(&many)).unwrap();
        assert!(found.order.is_sorted_by(|a, b| many[*a] < many[*b]), "{found:?}");
    }

    #[test]
    fn many_garments_of_which_few_overlap_are_ordered_by_those() {
        // The last lies below garment 0, which lies below three others; the rest lie apart.
        let below = [(13, 0), (0, 1), (0, 2), (0, 3)];
        let net = |a: usize, b: usize| {
            let is = |pair: (usize, usize)| Real::from(u8::from(below.contains(&pair)));
            is((a, b)) - is((b, a))
        };
        for order in [sorted_order(14, &net), best_order(14, &net)] {
            let place = |k: usize| order.iter().position(|o| *o == k).unwrap();
            assert!(below.iter().all(|(a, b)| place(*a) < place(*b)), "{order:?}");
        }
    }

    #[test]
    fn bands_of_one_radius_are_ambiguous_and_keep_their_order() {
        let mut outfit = bands(&[0.32, 0.32]);
        let waves = |k: usize, sign: Real| {
            let mesh = &outfit.garments[k].mesh;
            let wave = |p: &Point| {
                let scale = 1.0 + sign * 0.02 * (4.0 * p.z.atan2(p.x)).sin();
                Point::new(p.x * scale, p.y, p.z * scale)
            };
            mesh.with_vertices(mesh.vertices().iter().map(wave).collect()).unwrap()
        };
        let meshes = [waves(0, 1.0), waves(1, -1.0)];
        outfit.garments.iter_mut().zip(meshes).for_each(|(g, mesh)| g.mesh = mesh);
        let found = propose_order(&outfit).unwrap();
        assert!(found.confidence.abs() < 0.1, "{found:?}");
        let pair = found.ambiguous().unwrap();
        assert!(pair.inner.starts_with("band") && pair.area > 0.5, "{pair:?}");
    }

    #[test]
    fn garments_apart_keep_the_order_given() {
        let mut outfit = bands(&[0.31, 0.32]);
        for (garment, y) in outfit.garments.iter_mut().zip([0.2, -0.2]) {
            let mesh = &garment.mesh;
            let moved = mesh.vertices().iter().map(|p| Point::new(p.x, 0.3 * p.y + y, p.z));
            garment.mesh = mesh.with_vertices(moved.collect()).unwrap();
        }
        let found = propose_order(&outfit).unwrap();
        assert_eq!((found.order, found.confidence), (vec![0, 1], 1.0));
        assert!(found.pairs.is_empty());
    }
}
