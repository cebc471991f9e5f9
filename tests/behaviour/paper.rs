//! `Method::Paper`: garments settle by Algorithm 1 over the masked field of the layers below.

use crate::scenes::moved;
use if_core::SignedDistance;
use if_core::math::Point;
use if_core::monitor::{Progress, Silent};
use if_core::shapes::Sphere;
use if_core::shapes::meshes::{icosphere, tube};
use if_outfit::report::LayerField;
use if_outfit::resolve::{EffortParams, Method, ResolveError, ResolveParams, Resolved, resolve};
use if_outfit::{Layer, Outfit, PaperParams, resolve_on_fields, verify};
use std::ops::ControlFlow;

fn paper() -> ResolveParams {
    let effort = EffortParams { method: Method::Paper, ..Default::default() };
    ResolveParams { effort, ..Default::default() }
}

/// A ball in a belt, and a wide tube that the belt passes through. Small, because fields are baked on
/// cells of 5 mm.
fn outfit() -> Outfit {
    let [belt, wide] = [(0.104, 0.06, 0.03), (0.102, 0.08, 0.04)].map(|(radius, height, down)| {
        moved(&tube(radius, height, 24, 5, false), |p| Point::new(p.x, p.y - down, p.z))
    });
    let garments = vec![Layer::new("belt", belt), Layer::new("wide", wide)];
    Outfit::new(Layer::new("ball", icosphere(0.1, 2)), garments).unwrap()
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
        (count(&found), found.report.layers[1].skipped.vertices)
    });
    // It holds no vertex, contacts those that are far from intersections.
    assert!(by_paper.1 == 0 && by_contacts.1 > 0, "{by_paper:?} and {by_contacts:?} held");
    // Algorithm 1 moves all of a garment, contacts the neighbourhoods of intersections.
    let (by_paper, by_contacts) = (by_paper.0, by_contacts.0);
    assert!(by_paper > by_contacts, "{by_paper} and {by_contacts} vertices moved");
}

#[test]
fn algorithm_1_reads_the_field_that_a_garment_comes_with() {
    let outfit = outfit();
    // φ of the person that the belt is of: 5 mm wider than its mesh.
    let phi = Sphere { center: Point::origin(), radius: 0.109 };
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
    let depths = |found: &Resolved, in_box: bool| -> f64 {
        let vertices = found.outfit.garments[1].mesh.vertices().iter();
        let there = vertices.filter(|p| belt.contains(p) == in_box);
        there.map(|p| (-phi.distance(p)).max(0.0)).sum()
    };
    let inside = [&by_phi, &by_mesh].map(|found| depths(found, true));
    assert!(2.0 * inside[0] < inside[1], "{inside:?} m in the box");
    assert!(depths(&by_phi, false) > 0.0);
    // One that is NaN in the box is an error, not no constraint.
    let undefined = Sphere { radius: f64::NAN, ..phi };
    let found = resolve_on_fields(&outfit, &[Some(&undefined), None], &paper(), &mut Silent);
    assert!(
        matches!(found, Err(ResolveError::Field { layer, at }) if layer == "belt" && belt.contains(&at))
    );
    // The other method does not read it.
    let contacts = ResolveParams::default();
    let found = by([Some(&phi), None], &contacts);
    assert!(found.report.layers.iter().all(|layer| layer.algorithm1.is_none()));
    assert_eq!(found.outfit, resolve(&outfit, &contacts, &mut Silent).unwrap().outfit);
}

/// The gap of air is at least the clearance, also where that is more than air keeps by default; and a
/// field round a wide garment has larger cells instead of more memory than baking may use.
#[test]
fn algorithm_1_takes_any_clearance_and_any_size() {
    let mut params = paper();
    params.goal.clearance = 6e-3;
    let found = resolve(&outfit(), &params, &mut Silent).unwrap();
    assert!(verify(&found.outfit).unwrap().is_clean());

    let mut outfit = outfit();
    // From within the belt down to a radius of 0.8 m.
    let flared = |p: &Point| {
        let wider = 1.0 + 7.0 * (1.0 - p.y);
        Point::new(wider * p.x, p.y - 1.0, wider * p.z)
    };
    outfit.garments[1] = Layer::new("gown", moved(&tube(0.1, 1.0, 24, 8, false), flared));
    let found = resolve(&outfit, &paper(), &mut Silent).unwrap();
    assert!(found.report.layers[1].algorithm1.is_some());
    assert!(verify(&found.outfit).unwrap().is_clean());
}

#[test]
fn algorithm_1_has_the_parameters_that_are_asked_for() {
    // To one side, so that there is air between the garments on the other.
    let mut aside = outfit();
    let wide = &mut aside.garments[1].mesh;
    *wide = moved(wide, |p| Point::new(p.x + 4e-3, p.y, p.z));
    let settled = |paper_params: PaperParams| {
        let params = ResolveParams { paper: paper_params, ..paper() };
        let found = resolve(&aside, &params, &mut Silent).unwrap();
        let report = found.report.layers[1].algorithm1.clone().unwrap();
        (found.outfit.garments[1].mesh.vertices().to_vec(), report)
    };
    let default = PaperParams::default();
    let by_default = settled(default.clone());
    let one_step = settled(PaperParams { steps: 1, ..default.clone() });
    assert!(one_step.1.steps == 1 && by_default.1.steps > 1);
    for other in [
        PaperParams { time_step: 0.1 * default.time_step, ..default.clone() },
        PaperParams { substeps: 2, ..default.clone() },
        PaperParams { compliance: 1e3 * default.compliance, ..default.clone() },
        PaperParams { friction: 0.5, ..default.clone() },
        PaperParams { air_distance: 0.0, ..default.clone() },
        PaperParams { air_gap: 0.2 * default.air_gap, ..default.clone() },
    ] {
        assert_ne!(settled(other.clone()).0, by_default.0, "{other:?}");
    }
}

#[test]
fn parameters_of_algorithm_1_are_checked() {
    for (name, value) in
        [("steps", 0), ("substeps", 0), ("time_step", 0), ("friction", -1), ("air_gap", 0)]
    {
        let error = paper().with(name, &value).unwrap().validate().unwrap_err();
        assert!(error.to_string().starts_with(&format!("parameter `paper.{name}` is ")), "{error}");
    }
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
