//! `Method::Paper`: garments settle by Algorithm 1 over the masked field of the layers below.

use crate::scenes::{ball_in_tube, moved};
use if_core::SignedDistance;
use if_core::math::Point;
use if_core::monitor::{Progress, Silent};
use if_core::shapes::Sphere;
use if_core::shapes::meshes::{icosphere, tube};
use if_outfit::report::LayerField;
use if_outfit::resolve::{EffortParams, Method, ResolveError, ResolveParams, Resolved, resolve};
use if_outfit::{Layer, Outfit, resolve_on_fields, verify};
use std::ops::ControlFlow;

fn paper() -> ResolveParams {
    let effort = EffortParams { method: Method::Paper, ..Default::default() };
    ResolveParams { effort, ..Default::default() }
}

/// A ball in a belt, and a wide tube that the belt passes through.
fn outfit() -> Outfit {
    let mut outfit = ball_in_tube("belt", 0.31);
    let wide = moved(&tube(0.305, 0.26, 48, 8, false), |p| Point::new(p.x, p.y - 0.13, p.z));
    outfit.garments.push(Layer::new("wide", wide));
    outfit
}

#[test]
fn what_algorithm_1_leaves_is_repaired_and_it_moves_more_than_contacts_do() {
    let outfit = outfit();
    assert!(!verify(&outfit).unwrap().is_clean());
    let count = |found: &Resolved| -> usize {
        let [before, after] = [&outfit, &found.outfit].map(|o| o.garments[1].mesh.vertices());
        before.iter().zip(after).filter(|(p, q)| p != q).count()
    };
    let [by_paper, by_contacts] = [paper(), ResolveParams::default()].map(|params| {
        let found = resolve(&outfit, &params, &mut Silent).unwrap();
        assert!(verify(&found.outfit).unwrap().is_clean());
        count(&found)
    });
    // Algorithm 1 moves all of a garment, contacts the neighbourhoods of intersections.
    assert!(by_paper > by_contacts, "{by_paper} and {by_contacts} vertices moved");
}

#[test]
fn algorithm_1_reads_the_field_that_a_garment_comes_with() {
    // The scene of `outfit`, in few triangles.
    let [belt, wide] = [(0.31, 0.2, 0.1), (0.305, 0.26, 0.13)].map(|(radius, height, down)| {
        moved(&tube(radius, height, 24, 5, false), |p| Point::new(p.x, p.y - down, p.z))
    });
    let garments = vec![Layer::new("belt", belt), Layer::new("wide", wide)];
    let outfit = Outfit::new(Layer::new("ball", icosphere(0.3, 2)), garments).unwrap();
    // φ of the person that the belt is of: 2 cm wider than its mesh.
    let phi = Sphere { center: Point::origin(), radius: 0.33 };
    let by_mesh = resolve(&outfit, &paper(), &mut Silent).unwrap();
    let by = |fields: [Option<&dyn SignedDistance>; 2], params: &ResolveParams| {
        let found = resolve_on_fields(&outfit, &fields, params, &mut Silent).unwrap();
        assert!(verify(&found.outfit).unwrap().is_clean());
        found
    };
    let by_phi = by([Some(&phi), None], &paper());
    let read = |found: &Resolved| found.report.layers[1].algorithm1.as_ref().unwrap().below.clone();
    assert_eq!(read(&by_mesh), [LayerField::Mesh, LayerField::Mesh]);
    assert_eq!(read(&by_phi), [LayerField::Mesh, LayerField::Given]);
    // In the box of the belt φ keeps the outer tube out; beyond it φ does not bind.
    let belt = outfit.garments[0].mesh.aabb();
    let inside = |found: &Resolved, [within, beyond]: [bool; 2]| -> usize {
        let vertices = found.outfit.garments[1].mesh.vertices().iter();
        let counts = |p: &&Point| if belt.contains(p) { within } else { beyond };
        vertices.filter(counts).filter(|p| phi.distance(p) < -2e-3).count()
    };
    let counts = [&by_phi, &by_mesh].map(|found| inside(found, [true, false]));
    assert!(4 * counts[0] < counts[1], "{counts:?} vertices inside");
    assert!(inside(&by_phi, [false, true]) > 0);
    // The other method does not read it.
    let contacts = ResolveParams::default();
    let found = by([Some(&phi), None], &contacts);
    assert!(found.report.layers.iter().all(|layer| layer.algorithm1.is_none()));
    assert_eq!(found.outfit, resolve(&outfit, &contacts, &mut Silent).unwrap().outfit);
}

#[test]
fn algorithm_1_can_be_cancelled() {
    let mut steps = 0;
    let stopped = resolve(&outfit(), &paper(), &mut |p: &Progress<'_>| {
        steps += usize::from(p.stage == "step");
        if steps > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(ResolveError::Cancelled(_))), "{stopped:?}");
    assert_eq!(steps, 4);
}
