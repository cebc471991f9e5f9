//! Why own pairs of a garment remain.

use crate::report::{KeptOwnPair, KeptReason};
use if_core::edges::Edges;
use if_core::intersect::Contact;
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use std::collections::BTreeSet;

/// The largest number of pairs that are named.
const NAMED: usize = 256;

/// The own pairs of `mesh` that the input had, `given`, with the reason why each is kept. `untangled`
/// are those that untangling left before the garment settled, and `costly` those that came apart at too
/// high a cost. `given` and `untangled` are sorted.
pub(crate) fn kept(
    mesh: &TriMesh,
    given: &[[u32; 2]],
    untangled: &[[u32; 2]],
    costly: &BTreeSet<[u32; 2]>,
) -> Vec<KeptOwnPair> {
    let edges = Edges::new(mesh);
    let is_fan =
        |t: u32| edges.of_triangle[t as usize].iter().any(|e| edges.valence[*e as usize] > 2);
    let pairs = own_pairs(mesh, &Bvh::new(mesh)).into_iter();
    let pairs = pairs.filter(|pair| given.binary_search(&[pair.a, pair.b]).is_ok());
    let named = pairs.take(NAMED).map(|pair| {
        let triangles = [pair.a, pair.b];
        let reason = match pair.contact {
            Contact::Coplanar => KeptReason::Coincident,
            _ if triangles.into_iter().any(is_fan) => KeptReason::NonManifold,
            _ if costly.contains(&triangles) => KeptReason::Strain,
            _ if untangled.binary_search(&triangles).is_err() => KeptReason::Layers,
            _ => KeptReason::Contour,
        };
        KeptOwnPair { triangles, reason }
    });
    named.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;

    #[test]
    fn every_reason_is_found() {
        let p = |x: f64, y: f64, z: f64| Point::new(x, y, z);
        let flat = |z: f64| [p(0.0, 0.0, z), p(1.0, 0.0, z), p(0.0, 1.0, z)];
        let wall = |x: f64, z: f64| [p(x, 0.2, z - 0.1), p(x, 0.2, z + 0.1), p(x, 0.3, z + 0.2)];
        let mut v = [flat(0.0), wall(0.1, 0.0), wall(0.3, 0.0)].concat();
        // A sheet on another, and three triangles at an edge.
        v.extend([p(0.6, 0.1, 0.0), p(0.7, 0.1, 0.0), p(0.6, 0.2, 0.0)]);
        v.extend([p(0.5, 0.3, -0.1), p(0.5, 0.3, 0.1), p(0.5, 0.4, 0.0)]);
        v.extend([p(0.5, 2.0, 0.0), p(0.6, 3.0, 0.0)]);
        let t = [0, 3, 6, 9, 12].map(|k| [k, k + 1, k + 2]);
        let mut t = t.to_vec();
        t.extend([[12, 13, 15], [13, 12, 16]]);
        let mesh = TriMesh::new(v, t).unwrap();
        let given = [[0, 1], [0, 2], [0, 3], [0, 4]];
        let found = kept(&mesh, &given, &[[0, 1]], &BTreeSet::from([[0, 3]]));
        let reason = |a: u32, b: u32| found.iter().find(|k| k.triangles == [a, b]).unwrap().reason;
        assert_eq!(reason(0, 1), KeptReason::Contour);
        assert_eq!(reason(0, 2), KeptReason::Layers);
        assert_eq!(reason(0, 3), KeptReason::Coincident);
        assert_eq!(reason(0, 4), KeptReason::NonManifold);
        let costly = kept(&mesh, &given, &[[0, 1]], &BTreeSet::from([[0, 1]]));
        assert_eq!(costly[0], KeptOwnPair { triangles: [0, 1], reason: KeptReason::Strain });
        let known = kept(&mesh, &given[..2], &[], &BTreeSet::new());
        assert_eq!(known.len(), 2, "what the input did not have is new, and not kept");
    }
}
