//! Least distances: those of the report are those of what is returned.

use crate::scenes::{assert_clean, ball_in_tube, mannequin, resolved};
use if_body::mannequin::Garment;
use if_core::distance::triangle_distance;
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_outfit::outfit::Outfit;
use if_outfit::report::Verification;
use if_outfit::verify::verify;

/// The least distance of the triangles of two meshes by all pairs.
fn by_all_pairs(a: &TriMesh, b: &TriMesh) -> Real {
    let pairs = (0..a.triangles().len())
        .flat_map(|i| (0..b.triangles().len()).map(move |j| (a.corners(i), b.corners(j))));
    pairs.map(|(a, b)| triangle_distance(a, b).upper).fold(Real::INFINITY, Real::min)
}

/// Checks that distances are 0 where triangles meet, and only there.
fn assert_agrees(found: &Verification, outfit: &Outfit) {
    assert_eq!(found.own_least_distances.len(), outfit.garments.len());
    for pair in &found.pairs {
        let least = pair.least_distance.expect("no layer is empty");
        assert_eq!(least.distance == 0.0, pair.pairs.total() > 0, "{pair:?}");
        assert!(least.error < 1e-12, "{pair:?}");
    }
    for (least, pairs) in found.own_least_distances.iter().zip(&found.own_pairs) {
        let least = least.expect("more than one triangle");
        assert!(least.distance > 0.0 || *pairs > 0, "{least:?}");
    }
}

#[test]
fn the_report_has_the_distances_of_what_is_returned() {
    let outfit = mannequin(&[Garment::Tshirt, Garment::Jacket], 1.0);
    let given = verify(&outfit).unwrap();
    assert!(given.total_pairs() > 0);
    assert_agrees(&given, &outfit);
    let result = assert_clean(&outfit, resolved(&outfit));
    let (after, verified) = (&result.report.after, verify(&result.outfit).unwrap());
    assert_agrees(after, &outfit);
    let distances = |v: &Verification| -> Vec<_> {
        v.pairs.iter().map(|p| p.least_distance).chain(v.own_least_distances.clone()).collect()
    };
    assert_eq!(distances(after), distances(&verified));
    let least = after.pairs.iter().map(|p| p.least_distance.unwrap().distance).reduce(Real::min);
    assert_eq!(after.least_distance(), least);
    // The default clearance is 0.3 mm.
    let reached = result.report.clearance_reached.unwrap();
    assert!((reached * 0.3e-3 - least.unwrap()).abs() < 1e-15, "{reached} {least:?}");
    assert_eq!(result.report.before.least_distance(), None);
}

#[test]
fn the_distance_of_two_layers_is_that_of_their_nearest_triangles() {
    let outfit = ball_in_tube("belt", 0.303);
    let found = verify(&outfit).unwrap().pairs[0].least_distance.unwrap();
    let expected = by_all_pairs(&outfit.body.mesh, &outfit.garments[0].mesh);
    assert_eq!(found.distance, expected);
    // The body lies inside a ball of 0.3 m, the middles of the tube's 48 sides at 0.3024 m.
    assert!(expected > 2e-3 && expected < 3.5e-3, "{expected}");
}
