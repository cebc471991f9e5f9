//! Large triangles are split where they cannot lie round what is below, and only where that is
//! allowed.

use crate::scenes::moved;
use if_core::edges::Edges;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::seams::weld;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, Resolved, Split, resolve};
use if_outfit::storage::Storage;
use if_outfit::verify::verify;
use std::collections::BTreeSet;

/// A ball of 0.3 m radius in a band of `sides` flat sides whose corners are 0.33 m from the axis,
/// as a file in single precision holds it.
fn angular(sides: u32) -> Outfit {
    let single = |x: Real| Real::from(x as f32);
    let band =
        moved(&tube(0.33, 0.1, sides, 1, false), |p| Point::new(p.x, p.y - 0.05, p.z).map(single));
    Outfit::new(
        Layer::new("ball", icosphere(0.3, 4)),
        vec![Layer { storage: Storage::F32, ..Layer::new("band", band) }],
    )
    .unwrap()
}

fn run(outfit: &Outfit, split: Split, rounds: usize) -> Result<Resolved, ResolveError> {
    let mut params = ResolveParams::default();
    (params.goal.split, params.effort.rounds) = (split, rounds);
    resolve(outfit, &params, &mut Silent)
}

/// What was split is the input's surface, with its vertices first.
fn assert_split(input: &TriMesh, resolved: &Resolved) {
    let split = resolved.splits[0].as_ref().expect("triangles were split");
    let output = &resolved.outfit.garments[0].mesh;
    assert_eq!(split.mesh.triangles(), output.triangles());
    assert_eq!(split.mesh.vertices()[..input.vertices().len()], *input.vertices());
    assert!(
        split.sources.len() == output.vertices().len()
            && split.parts.len() == output.triangles().len()
    );
    assert!((split.mesh.area() / input.area() - 1.0).abs() < 1e-6);
    assert_eq!(resolved.report.layers[0].split, split.split_triangles());
    assert!(
        output
            .vertices()
            .iter()
            .flat_map(|p| p.coords.iter().copied().collect::<Vec<Real>>())
            .all(|x| x == Real::from(x as f32))
    );
    let after = verify(&resolved.outfit).unwrap();
    assert_eq!((after.total_pairs(), after.total_inside()), (0, 0));
}

/// The same surface with vertices of its own for each triangle, as in a file without indices.
fn soup(mesh: &TriMesh) -> TriMesh {
    let corners = mesh.triangles().as_flattened();
    let vertices = corners.iter().map(|v| mesh.vertices()[*v as usize]).collect();
    let triangles = (0..mesh.triangles().len() as u32).map(|t| [0, 1, 2].map(|k| 3 * t + k));
    TriMesh::new(vertices, triangles.collect()).unwrap()
}

#[test]
fn seams_stay_closed_where_triangles_are_split() {
    let band = angular(3);
    let mesh = &band.garments[0].mesh;
    // Front and back of a sheet, as two-sided exports have them, are split alike.
    let back = mesh.triangles().iter().map(|[a, b, c]| [*a, *c, *b]);
    let both = mesh.triangles().iter().copied().chain(back).collect();
    let two_sided = TriMesh::new(mesh.vertices().to_vec(), both).unwrap();
    for input in [soup(mesh), soup(&two_sided)] {
        let mut outfit = band.clone();
        outfit.garments[0].mesh = input;
        let result = run(&outfit, Split::IfStrained, 100).unwrap();
        assert_split(&outfit.garments[0].mesh, &result);
        assert!(result.report.after.own_pairs.iter().all(|n| *n == 0));
        // A band: all edges but those of its two hems have two triangles, so none has a vertex of the
        // other side on it, and all fronts have their backs.
        let closed = weld(&result.outfit.garments[0].mesh).unwrap().mesh;
        let mut known = BTreeSet::new();
        let mut triangles = closed.triangles().to_vec();
        triangles.retain(|t| {
            let mut corners = *t;
            corners.sort_unstable();
            known.insert(corners)
        });
        let sides = outfit.garments[0].mesh.triangles().len() / mesh.triangles().len();
        assert_eq!(triangles.len() * sides, closed.triangles().len());
        let closed = TriMesh::new(closed.vertices().to_vec(), triangles).unwrap();
        let edges = Edges::new(&closed);
        assert_eq!(edges.boundary_loops(&closed).len(), 2);
        assert_eq!(closed.vertices().len() + closed.triangles().len(), edges.len());
    }
}

#[test]
fn a_band_of_three_sides_lies_round_a_ball_once_it_has_more() {
    let outfit = angular(3);
    let never = run(&outfit, Split::Never, 100).unwrap();
    assert_eq!((never.splits.as_slice(), never.report.layers[0].split), (&[None][..], 0));
    let split = run(&outfit, Split::IfStrained, 100).unwrap();
    assert_split(&outfit.garments[0].mesh, &split);
    let strain = |r: &Resolved| r.report.layers[0].strain.rms;
    assert!(strain(&never) > 0.5, "{}", strain(&never));
    assert!(strain(&split) < 0.5 * strain(&never), "{} {}", strain(&split), strain(&never));
    let moved = |r: &Resolved| r.report.layers[0].moved;
    assert!(moved(&split).mean < moved(&never).mean, "{:?} {:?}", moved(&split), moved(&never));
    assert_eq!(
        split.report.before.pairs, never.report.before.pairs,
        "what is said of the input is said of the input"
    );
}

#[test]
fn what_is_clean_anyhow_is_not_split() {
    let outfit = angular(3);
    let (never, left) =
        (run(&outfit, Split::Never, 100).unwrap(), run(&outfit, Split::IfLeft, 100).unwrap());
    assert_eq!(never.outfit, left.outfit);
    let round = angular(24);
    let (never, strained) =
        (run(&round, Split::Never, 100).unwrap(), run(&round, Split::IfStrained, 100).unwrap());
    assert_eq!((never.outfit, strained.splits), (strained.outfit, vec![None]));
}

#[test]
fn vertices_of_no_triangle_stay_and_count_nowhere() {
    // In the middle of the ball, a little below its surface, far away, beyond single precision, and
    // at the ends of double precision.
    let strays = [
        [0.0; 3],
        [0.0, 0.296875, 0.0],
        [1e6, 0.0, 0.0],
        [0.0, 1e39, 0.0],
        [1.7e308, 0.0, 0.0],
        [-1.7e308, 0.0, 0.0],
    ]
    .map(Point::from);
    let with_strays = |radius| {
        let mut outfit = crate::scenes::ball_in_tube("band", radius);
        let band = &mut outfit.garments[0];
        let single = moved(&band.mesh, |p| p.map(|x| Real::from(x as f32)));
        let vertices = [single.vertices(), &strays].concat();
        (band.mesh, band.storage) =
            (TriMesh::new(vertices, single.triangles().to_vec()).unwrap(), Storage::F32);
        outfit
    };
    for split in [Split::Never, Split::IfLeft, Split::IfStrained] {
        let clean = with_strays(0.31);
        let found = run(&clean, split, 100).unwrap();
        assert_eq!(found.report.layers[0].rounds, 0, "{split:?} {:?}", found.report.before.pairs);
        assert!(found.outfit == clean, "{split:?}");
        let sunk = with_strays(0.295);
        let found = run(&sunk, split, 100).unwrap();
        assert!(found.report.before.total_pairs() > 0 && found.report.after.is_clean());
        let n = sunk.garments[0].mesh.vertices().len();
        assert!(
            found.outfit.garments[0].mesh.vertices()[n - strays.len()..n] == strays,
            "{split:?}"
        );
    }
}
