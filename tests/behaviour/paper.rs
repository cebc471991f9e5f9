//! `Method::Paper`: garments settle by Algorithm 1 over the masked field of the layers below.

use crate::scenes::{ball_in_tube, moved};
use if_core::math::Point;
use if_core::monitor::{Progress, Silent};
use if_core::shapes::meshes::tube;
use if_outfit::resolve::{EffortParams, Method, ResolveError, ResolveParams, Resolved, resolve};
use if_outfit::{Layer, Outfit, verify};
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
fn algorithm_1_can_be_cancelled() {
    let mut steps = 0;
    let stopped = resolve(&outfit(), &paper(), &mut |p: &Progress<'_>| {
        steps += usize::from(p.stage == "step");
        if steps > 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(ResolveError::Cancelled(_))), "{stopped:?}");
    assert_eq!(steps, 4);
}
