//! What is skipped changes no result: with and without, the same bits; and a scene that needs
//! nothing costs nothing but looking at it. The same of single parts stands beside them: contacts
//! with fields (`if_xpbd::collision`), sparse and dense extraction
//! (`crates/if-mesh/tests/surfaces/extraction.rs`), finished outfits of a batch
//! (`crates/if-cli/tests/cli/batch.rs`), frames without a person
//! (`crates/if-pipeline/tests/captures/reconstruct.rs`). docs/evidence/outfits.md has the list.

use if_body::mannequin::{MannequinParams, layered};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::masked::{BoxMask, Masked};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Silent;
use if_core::shapes::Torus;
use if_core::shapes::meshes::{icosphere, tube};
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::extract::{ExtractParams, Sampling, extract};
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveParams, resolve, resolve_without_skipping};
use std::sync::atomic::{AtomicUsize, Ordering};

fn scene() -> Outfit {
    let mut layers = layered(&MannequinParams { resolution: 0.7, ..Default::default() })
        .into_iter()
        .map(|(n, m)| Layer::new(n, m));
    let body = layers.next().expect("the scene begins with the body");
    Outfit::new(body, layers.collect()).expect("the scene is an outfit")
}

#[test]
fn resolve_gives_the_same_bits_whether_it_skips_or_not() {
    let outfit = scene();
    let run = |skip| {
        let resolve = if skip { resolve } else { resolve_without_skipping };
        resolve(&outfit, &ResolveParams::default(), &mut Silent)
            .expect("the built-in scene comes out clean")
    };
    let (with, without) = (run(true), run(false));
    assert!(with.outfit == without.outfit, "skipping changed the result");
    for (a, b) in with.report.layers.iter().zip(&without.report.layers) {
        assert_eq!((a.rounds, a.sweeps, b.skipped.queries), (b.rounds, b.sweeps, 0), "{}", a.name);
        assert!(
            a.queries < b.queries,
            "{}: {} queries, {} without skipping",
            a.name,
            a.queries,
            b.queries
        );
    }
}

#[test]
fn a_scene_that_needs_nothing_is_only_looked_at() {
    let params = ResolveParams::default();
    let clean = resolve(&scene(), &params, &mut Silent).expect("clean").outfit;
    let again = resolve(&clean, &params, &mut Silent).expect("still clean");
    assert!(again.outfit == clean, "a clean scene was changed");
    for layer in &again.report.layers {
        assert_eq!(
            (layer.rounds, layer.sweeps, layer.queries, layer.moved.vertices),
            (0, 0, 0, 0),
            "{}",
            layer.name
        );
        let vertices = clean
            .garments
            .iter()
            .find(|g| g.name == layer.name)
            .map_or(0, |g| g.mesh.vertices().len());
        assert_eq!(layer.skipped.vertices, vertices, "{}", layer.name);
    }
}

#[test]
fn a_layer_that_does_not_meet_another_is_counted_and_ends_with_the_same_bits_without_it() {
    let body = icosphere(0.5, 4);
    // Two bands that dip into a ball, far above each other.
    let band = |name: &str, height: Real| {
        let radius = (0.25 - (height + 0.05) * (height + 0.05)).sqrt() - 0.003;
        let tube = tube(radius, 0.1, 48, 4, false);
        Layer::new(
            name,
            tube.with_vertices(tube.vertices().iter().map(|p| p + Vector::y() * height).collect())
                .expect("moved"),
        )
    };
    let worn = |garments| {
        let outfit = Outfit::new(Layer::new("body", body.clone()), garments).expect("an outfit");
        resolve(&outfit, &ResolveParams::default(), &mut Silent).expect("clean")
    };
    let both = worn(vec![band("low", -0.25), band("high", 0.15)]);
    let alone = worn(vec![band("high", 0.15)]);
    assert_eq!(
        (both.report.layers[1].skipped.layers, alone.report.layers[0].skipped.layers),
        (1, 0)
    );
    assert!(both.report.layers.iter().all(|l| l.moved.vertices > 0), "both had to move");
    assert!(
        both.outfit.garments[1] == alone.outfit.garments[0],
        "a layer that is not met changed the result"
    );
}

/// A field that counts how often it is asked.
struct Counted<F> {
    field: F,
    asked: AtomicUsize,
}

impl<F: SignedDistance> SignedDistance for Counted<F> {
    fn distance(&self, p: &Point) -> Real {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.field.distance(p)
    }
    fn sample(&self, p: &Point) -> FieldSample {
        self.asked.fetch_add(1, Ordering::Relaxed);
        self.field.sample(p)
    }
    fn bounds(&self) -> Option<Aabb> {
        self.field.bounds()
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz()
    }
}

fn torus() -> Counted<Torus> {
    Counted {
        field: Torus { center: Point::new(0.01, 0.02, 0.03), major: 0.6, minor: 0.15 },
        asked: AtomicUsize::new(0),
    }
}

#[test]
fn certified_empty_boxes_are_not_evaluated_and_the_triangles_are_the_same() {
    let run = |sampling| {
        let field = torus();
        let found = extract(
            &field,
            &ExtractParams { sampling, check: 0, ..Default::default() },
            &mut Silent,
        )
        .expect("a torus has a surface");
        (found.mesh, field.asked.into_inner())
    };
    let ((sparse, few), (dense, many)) = (run(Sampling::Sparse), run(Sampling::Dense));
    assert!(sparse == dense, "sparse and dense extraction differ");
    assert!(3 * few < many, "{few} evaluations of {many}");
}

#[test]
fn bricks_far_from_the_surface_are_not_baked_and_what_is_baked_is_right() {
    let field = torus();
    let (cell, band) = (0.008, 0.03);
    let params =
        BakeParams { cell, accuracy: Real::INFINITY, band, depth: band, ..Default::default() };
    let baked = Baked::new(&field, &params, &mut Silent).expect("a torus can be baked");
    let asked = field.asked.load(Ordering::Relaxed);
    let size: Vector = field.bounds().expect("a torus has bounds").inflated(band).size();
    let nodes = (size.x / cell) * (size.y / cell) * (size.z / cell);
    assert!((asked as Real) < 0.8 * nodes, "{asked} evaluations, {nodes} nodes");
    for k in 0..1000 {
        let angle = 0.1 * Real::from(k);
        let p = field.field.center
            + Vector::new(0.75 * angle.cos(), 0.02 * (7.0 * angle).sin(), 0.75 * angle.sin());
        assert!((baked.distance(&p) - field.field.distance(&p)).abs() <= baked.error_bound());
    }
}

#[test]
fn a_masked_field_is_not_evaluated_outside_its_box_and_is_the_same_inside() {
    let field = torus();
    let window = Aabb { min: Point::new(0.0, -1.0, -1.0), max: Point::new(1.0, 1.0, 1.0) };
    let masked = Masked { field: &field, mask: BoxMask::new(window).expect("a box") };
    let points: Vec<Point> = (0..400)
        .map(|k| {
            Point::new(0.7 * (0.1 * Real::from(k)).cos(), 0.0, 0.7 * (0.1 * Real::from(k)).sin())
        })
        .collect();
    let mut out = vec![0.0; points.len()];
    masked.distances(&points, &mut out);
    let inside = points.iter().filter(|p| window.contains(p)).count();
    assert!(inside > 100 && inside < 300);
    assert_eq!(field.asked.load(Ordering::Relaxed), inside, "evaluations");
    for (p, d) in points.iter().zip(&out).filter(|(p, _)| window.contains(p)) {
        assert_eq!(*d, field.field.distance(p));
    }
}
