//! Any triangle soup cleaned: no panic, no hang, nothing that is not finite, a manifold that winds
//! one way, and no triangle that meets another one more than before.
//!
//! The first byte chooses what is done, the second how many vertices there are. Each takes four
//! bytes: three numbers and a choice between a lattice, a fraction of it, and places so near each
//! other, so far away or so flat that arithmetic shows. The rest are triangles, a byte for each
//! corner.
#![no_main]

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::icosphere;
use if_mesh::attributes::VertexAttributes;
use if_mesh::cleanup::{
    CleanupParams, Complement, ComponentParams, Openings, cleanup, make_manifold,
};
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::seams::weld;
use if_mesh::validate::{Fault, faults};
use libfuzzer_sys::fuzz_target;

/// A coordinate. Single precision holds all of them, so that a clean-up in single precision moves
/// nothing by rounding.
fn coordinate(byte: u8, kind: u8) -> f64 {
    let x = f64::from(byte as i8);
    match kind % 8 {
        0..=3 => (x / 32.0).round(),
        4 => x / 64.0,
        5 => x / 64.0 + f64::from(2.0f32.powi(-20)),
        6 => 1000.0 + x / 64.0,
        _ => x * f64::from(2.0f32.powi(-30)),
    }
}

fn soup(bytes: &[u8]) -> Option<(u8, TriMesh)> {
    let [choice, n, rest @ ..] = bytes else { return None };
    let n = usize::from(*n).clamp(3, 64);
    if rest.len() < 4 * n {
        return None;
    }
    let (places, corners) = rest.split_at(4 * n);
    let points =
        places.chunks_exact(4).map(|c| Point::new(coordinate(c[0], c[3]), coordinate(c[1], c[3]), coordinate(c[2], c[3])));
    let triangles = corners.chunks_exact(3).take(160).map(|c| [c[0], c[1], c[2]].map(|v| u32::from(v) % n as u32));
    let triangles = triangles.filter(|[a, b, c]| a != b && b != c && c != a).collect();
    Some((*choice, TriMesh::new(points.collect(), triangles).expect("finite places, corners in range and different")))
}

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, mesh)) = soup(bytes) else { return };
    let openings = match choice % 5 {
        0 => Openings::default(),
        1 => Openings::Count(usize::from(choice / 5) % 4),
        2 => Openings::Longer(f64::from(choice) / 32.0),
        3 => Openings::Near(vec![Point::origin()]),
        _ => Openings::Complement(Box::new(Complement::new(icosphere(1.0, 1)))),
    };
    let components = (choice & 64 == 0).then(ComponentParams::default);
    let params = CleanupParams { openings, components, single_precision: choice & 128 == 0, ..CleanupParams::default() };
    let clean = cleanup(&mesh, &VertexAttributes::none(mesh.vertices().len()), None, &params, &mut Silent).expect("parameters in range");
    assert!(clean.mesh.vertices().iter().all(|p| p.iter().all(|x| x.is_finite())));
    for fault in faults(&clean.mesh) {
        let allowed =
            matches!(fault, Fault::NoTriangles { .. } | Fault::Duplicates { .. } | Fault::Units { .. } | Fault::InsideOut { .. } | Fault::PartInsideOut { .. });
        assert!(allowed, "{fault}");
    }
    let pairs = |mesh: &TriMesh| own_pairs(mesh, &Bvh::new(mesh)).len();
    // With seams closed, as it is cleaned up.
    let closed = |mesh: &TriMesh| {
        let welded = weld(mesh).filter(|welded| welded.edges > 0 && welded.repeated == 0);
        welded.map_or_else(|| mesh.clone(), |welded| welded.mesh)
    };
    let (before, after) = (pairs(&make_manifold(&closed(&mesh)).0.mesh), pairs(&closed(&clean.mesh)));
    assert!(after <= before, "{before} pairs became {after}");
});
