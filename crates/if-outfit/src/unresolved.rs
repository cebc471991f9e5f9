//! What is not proven of a resolved outfit.

use crate::obstacle::Obstacle;
use crate::outfit::Outfit;
use crate::report::{PairReport, ResolveReport};
use crate::verify::compare_own_pairs;
use if_core::math::Point;
use if_mesh::index::Bvh;
use if_mesh::intersections::pairs;
use std::fmt;

/// Intersections that could not be removed: those between layers, with the two layers where most
/// remain, and those that a garment newly has with itself.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Unresolved {
    /// What remains between layers; `None` if nothing does.
    pub between: Option<Between>,
    /// Garments with intersections with themselves that the input does not have, and how many.
    pub own: Vec<(String, usize)>,
    /// Why the two layers cannot lie one over the other, if that is known. They are then the two of
    /// [`Unresolved::between`].
    pub obstacle: Option<Box<Obstacle>>,
    /// Some of the triangle pairs: (triangle of the inner layer, of the outer layer) of the worst
    /// two layers; or new pairs of the garment that newly intersects itself most, if nothing
    /// remains between layers. Empty if only vertices are on a wrong side.
    pub triangles: Vec<[u32; 2]>,
    /// The middle of the first of these triangles, in metres.
    pub place: Option<Point>,
}

/// What remains between layers.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Between {
    /// Intersecting triangle pairs of all layers.
    pub pairs: usize,
    /// Vertices on the wrong side of a layer below, of all layers.
    pub inside: usize,
    /// The upper one of the two layers where most remains.
    pub outer: String,
    /// The lower one.
    pub inner: String,
}

/// The largest number of triangle pairs in [`Unresolved::triangles`].
const NAMED: usize = 16;

impl Unresolved {
    /// What remains in the outfit `found`, by its report. `given` is the input with its triangles
    /// split as there. `None` if it is proven ([`ResolveReport::is_proven`]).
    pub(crate) fn of(given: &Outfit, (found, report): (&Outfit, &ResolveReport)) -> Option<Self> {
        let mut unresolved = Self::in_report(report)?;
        unresolved.triangles = match &unresolved.between {
            Some(between) => between.triangles(found),
            None => new_own_triangles(unresolved.worst_own(), [given, found]),
        };
        let [_, inner] = unresolved.worst();
        let layer = found.layers().find(|layer| layer.name == inner);
        unresolved.place = unresolved.triangles.first().zip(layer).map(|(pair, layer)| {
            let [a, b, c] = layer.mesh.corners(pair[0] as usize);
            Point::from((a.coords + b.coords + c.coords) / 3.0)
        });
        Some(unresolved)
    }

    /// The upper and the lower one of the two layers where most remains; the garment that newly
    /// intersects itself most, twice, if nothing remains between layers.
    pub fn worst(&self) -> [&str; 2] {
        match &self.between {
            Some(Between { outer, inner, .. }) => [outer, inner],
            None => [self.worst_own(); 2],
        }
    }

    /// The garment that newly intersects itself most; empty if none does.
    fn worst_own(&self) -> &str {
        self.own.iter().max_by_key(|own| own.1).map_or("", |(name, _)| name)
    }

    /// What remains according to a report, without triangles; `None` if it is proven.
    pub fn in_report(report: &ResolveReport) -> Option<Self> {
        if report.is_proven() {
            return None;
        }
        let count = |p: &&PairReport| (p.pairs.total(), p.vertices_inside);
        let after = &report.after;
        // The garments that were not tried have most pairs; the reason is what matters.
        let obstacle_of = |p: &PairReport| {
            report.obstacles.iter().find(|o| (&o.inner, &o.outer) == (&p.inner, &p.outer))
        };
        let is_hopeless = |p: &PairReport| obstacle_of(p).is_some_and(Obstacle::is_hopeless);
        let worst = after.pairs.iter().max_by_key(|&p| (is_hopeless(p), count(&p)));
        let worst = worst.filter(|p| !p.is_clean());
        let between = worst.map(|worst| Between {
            pairs: after.total_pairs(),
            inside: after.total_inside(),
            outer: worst.outer.clone(),
            inner: worst.inner.clone(),
        });
        let new = report.layers.iter().map(|l| (l.name.clone(), l.own_pairs.new));
        let own = new.filter(|(_, n)| *n > 0).collect();
        let obstacle = worst.and_then(obstacle_of).cloned().map(Box::new);
        Some(Self { between, own, obstacle, triangles: Vec::new(), place: None })
    }
}

impl Between {
    /// Some of the triangle pairs of the worst two layers.
    fn triangles(&self, outfit: &Outfit) -> Vec<[u32; 2]> {
        let tree = |name: &str| {
            outfit.layers().find(|layer| layer.name == name).map(|layer| Bvh::new(&layer.mesh))
        };
        let (Some(inner), Some(outer)) = (tree(&self.inner), tree(&self.outer)) else {
            return Vec::new();
        };
        pairs(&inner, &outer).iter().take(NAMED).map(|p| [p.a, p.b]).collect()
    }
}

/// Some of the triangle pairs in which the garment `name` newly intersects itself.
fn new_own_triangles(name: &str, [given, found]: [&Outfit; 2]) -> Vec<[u32; 2]> {
    let garments = given.garments.iter().zip(&found.garments);
    let found = garments.filter(|(given, _)| given.name == name);
    let new = found.flat_map(|(given, now)| compare_own_pairs(&given.mesh, &now.mesh).1);
    new.take(NAMED).collect()
}

impl fmt::Display for Unresolved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let between = self.between.iter().map(|b| {
            let Between { pairs, inside, outer, inner } = b;
            format!(
                "{pairs} intersecting triangle pairs and {inside} vertices on a wrong side, most \
                 of them of `{outer}` over `{inner}`,"
            )
        });
        let own = self
            .own
            .iter()
            .map(|(name, n)| format!("{n} new intersections of `{name}` with itself"));
        let parts: Vec<String> = between.chain(own).collect();
        write!(f, "{} remain", parts.join(" and "))?;
        self.obstacle.iter().try_for_each(|obstacle| write!(f, ": {obstacle}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outfit::Layer;
    use crate::report::{LayerReport, OwnPairs, PairCount};
    use if_core::math::Real;
    use if_core::mesh::TriMesh;
    use if_core::shapes::meshes::icosphere;

    fn layer(name: &str, [before, after, new]: [usize; 3]) -> LayerReport {
        let own_pairs = OwnPairs::new(before, after, new);
        LayerReport { name: name.into(), own_pairs, ..LayerReport::default() }
    }

    #[test]
    fn the_worst_pair_of_layers_is_named_and_a_clean_outfit_has_none() {
        let pair = |outer: &str, crossing, vertices_inside| PairReport {
            inner: "body".into(),
            outer: outer.into(),
            pairs: PairCount { crossing, ..Default::default() },
            vertices_inside,
            vertices: 10,
            ..PairReport::default()
        };
        let found = |pairs| {
            let mut report = ResolveReport::default();
            report.after.pairs = pairs;
            Unresolved::in_report(&report)
        };
        assert!(found(vec![pair("a", 0, 0)]).is_none());
        let text = found(vec![pair("a", 1, 0), pair("b", 3, 5)]).unwrap().to_string();
        assert_eq!(
            text,
            "4 intersecting triangle pairs and 5 vertices on a wrong side, most of them of `b` \
             over `body`, remain"
        );
        let outer = |pairs| found(pairs).unwrap().between.unwrap().outer;
        assert_eq!(outer(vec![pair("a", 1, 0), pair("b", 3, 0), pair("c", 2, 9)]), "b");
        assert_eq!(outer(vec![pair("a", 0, 1), pair("b", 0, 2)]), "b");
    }

    #[test]
    fn new_own_intersections_are_unresolved_and_old_ones_are_not() {
        let found = |layers| Unresolved::in_report(&ResolveReport { layers, ..Default::default() });
        assert!(found(vec![layer("a", [7, 7, 0]), layer("b", [9, 2, 0])]).is_none());
        let text =
            found(vec![layer("a", [7, 7, 0]), layer("coat", [2, 2, 2])]).unwrap().to_string();
        assert_eq!(text, "2 new intersections of `coat` with itself remain");
    }

    #[test]
    fn the_triangles_of_new_own_intersections_are_named() {
        let corner = |x: Real, y: Real, z: Real| Point::new(x, y, z);
        // Two triangles that cross as they came, and one that crosses the first in the result.
        let flat = |y| [corner(0.0, y, 0.0), corner(1.0, y, 0.0), corner(0.0, y, 1.0)];
        let upright = |x| [corner(x, -0.5, 0.2), corner(x, 0.5, 0.2), corner(x, 0.5, 0.3)];
        let with = |x| {
            TriMesh::new(
                [flat(0.0), upright(0.2), upright(x)].concat(),
                vec![[0, 1, 2], [3, 4, 5], [6, 7, 8]],
            )
            .unwrap()
        };
        let outfit = |shirt| Outfit {
            body: Layer::new("body", icosphere(1.0, 1)),
            garments: vec![Layer::new("vest", icosphere(1.1, 1)), Layer::new("shirt", shirt)],
        };
        let report = ResolveReport {
            layers: vec![layer("vest", [0, 0, 0]), layer("shirt", [1, 2, 1])],
            ..ResolveReport::default()
        };
        let found = Unresolved::of(&outfit(with(5.0)), (&outfit(with(0.3)), &report)).unwrap();
        assert_eq!(found.triangles, vec![[0, 2]]);
        assert!((found.place.unwrap() - corner(1.0 / 3.0, 0.0, 1.0 / 3.0)).norm() < 1e-12);
        assert_eq!(found.to_string(), "1 new intersections of `shirt` with itself remain");
    }
}
