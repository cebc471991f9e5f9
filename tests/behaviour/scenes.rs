//! Small outfits, and what must hold of every resolved one.

#![allow(dead_code)] // each test file uses some of these

use if_body::mannequin::{Garment, MannequinParams, body, garment};
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{icosphere, tube};
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, Resolved, resolve};
use if_outfit::verify::verify;

/// The coarsest mannequin, with these garments, each dipping into those below by `overlap`.
pub fn mannequin(garments: &[Garment], overlap: f64) -> Outfit {
    let params = MannequinParams { resolution: 0.7, overlap };
    let layers = garments.iter().map(|g| Layer::new(g.name(), garment(*g, &params))).collect();
    Outfit::new(Layer::new("body", body(&params)), layers).unwrap()
}

/// A ball of 0.3 m radius as the body, in a tube round its equator of `radius`, called `name`.
pub fn ball_in_tube(name: &str, radius: f64) -> Outfit {
    let band = moved(&tube(radius, 0.2, 48, 6, false), |p| Point::new(p.x, p.y - 0.1, p.z));
    Outfit::new(Layer::new("ball", icosphere(0.3, 4)), vec![Layer::new(name, band)]).unwrap()
}

/// The mesh with every vertex moved.
pub fn moved(mesh: &TriMesh, f: impl Fn(&Point) -> Point) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(f).collect()).unwrap()
}

/// The mesh with its triangles turned over.
pub fn flipped(mesh: &TriMesh) -> TriMesh {
    let turned = mesh.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect();
    TriMesh::new(mesh.vertices().to_vec(), turned).unwrap()
}

/// Resolves with the default parameters.
pub fn resolved(outfit: &Outfit) -> Result<Resolved, ResolveError> {
    resolve(outfit, &ResolveParams::default(), &mut Silent)
}

/// Checks what is promised of every outcome, and that this one is clean.
pub fn assert_clean(input: &Outfit, outcome: Result<Resolved, ResolveError>) -> Resolved {
    let result = outcome.unwrap_or_else(|error| panic!("{error}"));
    assert_kept(input, &result);
    let after = verify(&result.outfit).unwrap();
    assert_eq!((after.total_pairs(), after.total_inside()), (0, 0), "{after:?}");
    result
}

/// Checks what is promised of every outcome, clean or not; anything but a result or what is left of
/// one fails.
pub fn assert_clean_or_left(input: &Outfit, outcome: Result<Resolved, ResolveError>) {
    match outcome {
        Ok(result) => {
            assert_clean(input, Ok(result));
        }
        Err(ResolveError::Unresolved { outer, inner, triangles, result }) => {
            assert_kept(input, &result);
            let after = verify(&result.outfit).unwrap();
            assert!(after.total_pairs() + after.total_inside() > 0, "an error without a fault");
            let worst = after.pairs.iter().find(|p| p.outer == outer && p.inner == inner).unwrap();
            assert_eq!(triangles.is_empty(), worst.pairs.total() == 0);
        }
        Err(error) => panic!("{error}"),
    }
}

/// The body, names, triangles and numbers of vertices stay; no own pair is new; the report
/// says what an independent look at the meshes says.
fn assert_kept(input: &Outfit, result: &Resolved) {
    let (output, report) = (&result.outfit, &result.report);
    assert_eq!(output.body, input.body);
    assert_eq!(output.garments.len(), input.garments.len());
    for (k, (a, b)) in input.garments.iter().zip(&output.garments).enumerate() {
        assert_eq!(a.name, b.name);
        assert_eq!(a.mesh.triangles(), b.mesh.triangles());
        assert_eq!(a.mesh.vertices().len(), b.mesh.vertices().len());
        let own = report.layers[k].own_pairs;
        assert!(own.new == 0 && own.after <= own.before, "{}: own pairs {own:?}", a.name);
    }
    let (before, after) = (verify(input).unwrap(), verify(output).unwrap());
    // Distances of the input are not measured.
    let mut pairs = before.pairs;
    pairs.iter_mut().for_each(|pair| pair.least_distance = None);
    assert_eq!(pairs, report.before.pairs);
    assert_eq!(after.pairs, report.after.pairs);
    assert_eq!(after.own_pairs, report.after.own_pairs);
    assert_eq!(after.own_least_distances, report.after.own_least_distances);
}
