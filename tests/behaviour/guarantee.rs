//! What `resolve` promises: no intersecting pair and no vertex on a wrong side, as little motion as
//! it takes, or an error that says what is left.

use crate::scenes::{
    assert_clean, assert_clean_or_left, ball_in_tube, flipped, mannequin, moved, resolved,
};
use if_body::mannequin::Garment;
use if_core::aabb::Aabb;
use if_core::intersect;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Progress, Silent};
use if_core::shapes::meshes::tube;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{EffortParams, ResolveError, ResolveParams, Split, resolve};
use if_outfit::storage::Storage;
use if_outfit::verify::verify;
use rayon::prelude::*;
use std::ops::ControlFlow;

const LAYERED: [Garment; 4] = [Garment::Tshirt, Garment::Skirt, Garment::Jacket, Garment::Coat];

#[test]
fn the_built_in_scene_comes_out_clean_and_far_vertices_do_not_move() {
    let outfit = mannequin(&LAYERED, 1.0);
    let before = verify(&outfit).unwrap();
    assert!(
        before.total_pairs() > 1000 && before.total_inside() > 100,
        "the scene is too easy: {before:?}"
    );
    let result = assert_clean(&outfit, resolved(&outfit));
    for (garment, layer) in outfit.garments.iter().zip(&result.report.layers) {
        let after = result.outfit.garments.iter().find(|g| g.name == garment.name).unwrap();
        let moved = garment
            .mesh
            .vertices()
            .iter()
            .zip(after.mesh.vertices())
            .filter(|(a, b)| a != b)
            .count();
        assert_eq!(moved, layer.moved.vertices);
        assert!(layer.moved.max < 0.15, "{}: a vertex went {} m", layer.name, layer.moved.max);
    }
}

/// Pairs of triangles that share a point: each of `a` with each of `b`, by the exact predicate
/// where their boxes overlap.
fn meeting(a: &TriMesh, b: &TriMesh) -> usize {
    let boxes = |mesh: &TriMesh| -> Vec<[[f64; 2]; 3]> {
        let span = |t: usize, k: usize| {
            let x = mesh.corners(t).map(|p| p[k]);
            [x[0].min(x[1]).min(x[2]), x[0].max(x[1]).max(x[2])]
        };
        (0..mesh.triangles().len()).map(|t| [0, 1, 2].map(|k| span(t, k))).collect()
    };
    let (of_a, of_b) = (boxes(a), boxes(b));
    let near = |s: usize, t: usize| {
        (0..3).all(|k| of_a[s][k][0] <= of_b[t][k][1] && of_b[t][k][0] <= of_a[s][k][1])
    };
    let meets = |s: usize, t: usize| {
        near(s, t) && intersect::triangles(a.corners(s), b.corners(t)).is_some()
    };
    (0..of_a.len()).into_par_iter().map(|s| (0..of_b.len()).filter(|t| meets(s, *t)).count()).sum()
}

/// The solid angle of a closed mesh as seen from `p`, over 4π: 1 inside, 0 outside.
fn winding(mesh: &TriMesh, p: &Point) -> f64 {
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let half_angle = |t: usize| {
        let [a, b, c] = mesh.corners(t).map(|q| [q.x - p.x, q.y - p.y, q.z - p.z]);
        let [la, lb, lc] = [dot(&a, &a).sqrt(), dot(&b, &b).sqrt(), dot(&c, &c).sqrt()];
        let across =
            [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        dot(&a, &across)
            .atan2(la * lb * lc + dot(&a, &b) * lc + dot(&b, &c) * la + dot(&c, &a) * lb)
    };
    (0..mesh.triangles().len()).map(half_angle).sum::<f64>() / (2.0 * std::f64::consts::PI)
}

#[test]
fn a_look_at_everything_without_trees_and_fields_says_the_same() {
    let outfit = mannequin(&[Garment::Tshirt, Garment::Skirt], 1.0);
    let pairs = |outfit: &Outfit| {
        let layers: Vec<&Layer> = outfit.layers().collect();
        let below =
            |k: usize| layers[..k].iter().map(|l| meeting(&l.mesh, &layers[k].mesh)).sum::<usize>();
        (1..layers.len()).map(below).sum::<usize>()
    };
    // Of every so many vertices of garments those inside the body.
    let inside = |outfit: &Outfit, every: usize| {
        let vertices: Vec<Point> = outfit
            .garments
            .iter()
            .flat_map(|g| g.mesh.vertices())
            .step_by(every)
            .copied()
            .collect();
        vertices.par_iter().filter(|p| winding(&outfit.body.mesh, p) > 0.5).count()
    };
    let found = pairs(&outfit);
    assert_eq!(found, verify(&outfit).unwrap().total_pairs());
    assert!(found > 100 && inside(&outfit, 10) > 0, "the scene is too easy: {found}");
    let result = assert_clean(&outfit, resolved(&outfit));
    assert_eq!((pairs(&result.outfit), inside(&result.outfit, 1)), (0, 0));
}

/// The same surface with a seam along x = 0, as exporters leave it where texture coordinates jump;
/// the new vertices come last.
fn with_a_seam(mesh: &TriMesh) -> (TriMesh, Vec<u32>) {
    let mut of: Vec<u32> = (0..mesh.vertices().len() as u32).collect();
    let left = |t: &[u32; 3]| t.iter().map(|v| mesh.vertices()[*v as usize].x).sum::<f64>() < 0.0;
    let mut on_the_right = vec![false; of.len()];
    mesh.triangles()
        .iter()
        .filter(|t| !left(t))
        .flatten()
        .for_each(|v| on_the_right[*v as usize] = true);
    let mut twin = std::collections::BTreeMap::new();
    let mut triangles = mesh.triangles().to_vec();
    for v in
        triangles.iter_mut().filter(|t| left(t)).flatten().filter(|v| on_the_right[**v as usize])
    {
        *v = *twin.entry(*v).or_insert_with(|| {
            of.push(*v);
            of.len() as u32 - 1
        });
    }
    (
        TriMesh::new(of.iter().map(|v| mesh.vertices()[*v as usize]).collect(), triangles).unwrap(),
        of,
    )
}

#[test]
fn seams_of_exporters_neither_gape_nor_change_the_result() {
    let whole = mannequin(&[Garment::Tshirt, Garment::Jacket], 1.0);
    let mut cut = whole.clone();
    let of: Vec<Vec<u32>> = cut
        .garments
        .iter_mut()
        .map(|layer| {
            let (mesh, of) = with_a_seam(&layer.mesh);
            assert!(of.len() > layer.mesh.vertices().len() + 10, "a seam");
            layer.mesh = mesh;
            of
        })
        .collect();
    cut.body.mesh = with_a_seam(&whole.body.mesh).0;
    let mut may_split = ResolveParams::default();
    may_split.goal.split = Split::IfLeft;
    let unsplit = resolve(&cut, &may_split, &mut Silent).unwrap();
    let (whole, cut) = (assert_clean(&whole, resolved(&whole)), assert_clean(&cut, resolved(&cut)));
    assert!(unsplit.splits.iter().all(Option::is_none) && unsplit.outfit == cut.outfit);
    assert!(whole.report.layers.iter().all(|l| l.moved.vertices > 0));
    for ((whole, cut), of) in whole.outfit.garments.iter().zip(&cut.outfit.garments).zip(&of) {
        let expected = of.iter().map(|v| whole.mesh.vertices()[*v as usize]);
        assert!(cut.mesh.vertices().iter().copied().eq(expected), "{}: the seam gapes", cut.name);
    }
}

#[test]
fn positions_that_are_no_single_precision_are_rounded_before_they_are_proven() {
    let mut outfit = mannequin(&LAYERED, 0.0);
    outfit.garments.iter_mut().for_each(|g| g.storage = Storage::F32);
    let result = assert_clean(&outfit, resolved(&outfit));
    let single = |p: &Point| p.iter().all(|x| f64::from(*x as f32) == *x);
    assert!(result.outfit.garments.iter().all(|g| g.mesh.vertices().iter().all(single)));
    // What rounding moves is reported: files with one decimal are off by up to 9 cm.
    outfit.garments.truncate(1);
    outfit.garments[0].storage = Storage::Text { decimals: 1 };
    let coarse = match resolve(&outfit, &ResolveParams::default(), &mut Silent) {
        Err(ResolveError::Unresolved { result, .. }) => *result,
        result => result.unwrap(),
    };
    let [before, after] = [&outfit, &coarse.outfit].map(|o| o.garments[0].mesh.vertices());
    let truly = before.iter().zip(after).map(|(p, q)| (q - p).norm()).fold(0.0, f64::max);
    assert!(truly > 0.05, "{truly}");
    assert_eq!(coarse.report.layers[0].moved.max, truly);
}

#[test]
fn what_needs_nothing_is_returned_bit_for_bit() {
    let outfit = mannequin(&LAYERED, 0.0);
    assert!(verify(&outfit).unwrap().is_clean(), "the scene hangs cleanly");
    let result = assert_clean(&outfit, resolved(&outfit));
    assert_eq!(result.outfit, outfit);
    assert!(result.report.layers.iter().all(|l| l.rounds == 0 && l.moved.vertices == 0));
}

#[test]
fn clean_layers_below_and_above_a_dirty_one_keep_their_bits() {
    let clean = mannequin(&[Garment::Tshirt, Garment::Jacket], 0.0);
    // A dent in the skirt's place: the clean jacket hangs over a T-shirt whose hem alone is pushed
    // in.
    let mut outfit = clean.clone();
    let low = clean.garments[0].mesh.aabb().min.y;
    outfit.garments[0].mesh = moved(&clean.garments[0].mesh, |p| {
        let dip = ((low + 0.04 - p.y) / 0.04).clamp(0.0, 1.0);
        Point::new(p.x * (1.0 - 0.15 * dip), p.y, p.z * (1.0 - 0.15 * dip))
    });
    assert!(!verify(&outfit).unwrap().is_clean());
    let result = assert_clean(&outfit, resolved(&outfit));
    assert_ne!(result.outfit.garments[0], outfit.garments[0]);
    // Against the T-shirt as it is now, is the jacket as it was clean? Then it must not have moved.
    let mut lower_done = result.outfit.clone();
    lower_done.garments[1] = outfit.garments[1].clone();
    assert!(
        verify(&lower_done).unwrap().is_clean(),
        "the T-shirt came up to the jacket: dent it less"
    );
    assert_eq!(result.outfit.garments[1], outfit.garments[1]);
    // The other way round: the T-shirt is clean, the jacket is not.
    let mut outfit = clean.clone();
    outfit.garments[1] = mannequin(&[Garment::Jacket], 1.0).garments.remove(0);
    let result = assert_clean(&outfit, resolved(&outfit));
    assert_eq!(result.outfit.garments[0], outfit.garments[0]);
    assert_ne!(result.outfit.garments[1], outfit.garments[1]);
}

#[test]
fn vertices_outside_the_boxes_of_all_lower_layers_stay() {
    // A disc with a hole too small for the ball, and a brim that reaches far beyond its box.
    let mut outfit = ball_in_tube("brim", 0.29);
    outfit.garments[0].mesh = moved(&outfit.garments[0].mesh, |p| {
        let t = (p.y + 0.1) / 0.2;
        let r = 0.28 + 0.4 * t;
        Point::new(p.x / 0.29 * r, 0.02 * t, p.z / 0.29 * r)
    });
    assert!(!verify(&outfit).unwrap().is_clean());
    let result = assert_clean(&outfit, resolved(&outfit));
    let region = outfit.body.mesh.aabb();
    let (before, after) =
        (outfit.garments[0].mesh.vertices(), result.outfit.garments[0].mesh.vertices());
    // A vertex whose triangle reaches into the box is not clear: that triangle may intersect the
    // ball.
    let mut clear = vec![true; before.len()];
    for t in outfit.garments[0].mesh.triangles() {
        let corners = t.map(|v| &before[v as usize]);
        if Aabb::from_points(corners).overlaps(&region) {
            t.iter().for_each(|v| clear[*v as usize] = false);
        }
    }
    let outside: Vec<usize> = (0..before.len()).filter(|v| clear[*v]).collect();
    assert!(outside.len() > 100);
    for v in outside {
        assert!(
            (before[v] - after[v]).norm() <= 1e-4,
            "vertex {v} went {} m",
            (before[v] - after[v]).norm()
        );
    }
}

#[test]
fn positions_in_single_precision_are_proven_as_they_are_stored() {
    let mut outfit = mannequin(&[Garment::Tshirt, Garment::Jacket], 1.0);
    for layer in std::iter::once(&mut outfit.body).chain(&mut outfit.garments) {
        layer.mesh = moved(&layer.mesh, |p| p.map(|x| f64::from(x as f32)));
        layer.storage = Storage::F32;
    }
    let result = assert_clean(&outfit, resolved(&outfit));
    for garment in &result.outfit.garments {
        assert!(
            garment
                .mesh
                .vertices()
                .iter()
                .flat_map(|p| p.iter())
                .all(|x| f64::from(*x as f32) == *x)
        );
    }
}

#[test]
fn of_two_identical_layers_the_upper_one_gives_way() {
    let mut outfit = mannequin(&[Garment::Tshirt], 0.0);
    outfit.garments.push(Layer::new("twin", outfit.garments[0].mesh.clone()));
    let before = verify(&outfit).unwrap();
    assert!(
        before.pairs.iter().any(|p| p.pairs.coplanar >= outfit.garments[0].mesh.triangles().len())
    );
    let result = assert_clean(&outfit, resolved(&outfit));
    assert_eq!(result.outfit.garments[0], outfit.garments[0]);
}

#[test]
fn layers_in_the_wrong_order_end_clean_or_with_what_is_left() {
    let outfit = mannequin(&[Garment::Jacket, Garment::Tshirt], 0.0);
    assert!(!verify(&outfit).unwrap().is_clean());
    assert_clean_or_left(&outfit, resolved(&outfit));
}

#[test]
fn a_garment_far_too_small_for_what_it_goes_over_comes_out_clean() {
    // A T-shirt over a coat: cloth and contacts alone do not agree; the cloth has to yield.
    let outfit = mannequin(&[Garment::Coat, Garment::Tshirt], 1.0);
    let result = assert_clean(&outfit, resolved(&outfit));
    let tshirt = &result.report.layers[1];
    assert!(tshirt.strain.max > 0.5 && tshirt.repairs > 15, "the scene is too easy: {tshirt:?}");
}

#[test]
fn a_garment_wholly_inside_the_body_comes_out() {
    let outfit = ball_in_tube("band", 0.26);
    let before = verify(&outfit).unwrap();
    assert_eq!(
        (before.total_pairs(), before.total_inside()),
        (0, outfit.garments[0].mesh.vertices().len())
    );
    assert_clean(&outfit, resolved(&outfit));
}

#[test]
fn sleeves_of_fingers_do_not_slide_off_through_the_tips() {
    // Fingers 16 mm thick and 4 mm apart, thinner than the blur of coarse ways out.
    let radius = 8e-3;
    let four = |mesh: &TriMesh, lift: f64| {
        let (mut v, mut t) = (Vec::new(), Vec::new());
        for k in 0..4u32 {
            let first = v.len() as u32;
            let x = (f64::from(k) - 1.5) * (2.0 * radius + 4e-3);
            v.extend(mesh.vertices().iter().map(|p| Point::new(p.x + x, p.y + lift, p.z)));
            t.extend(mesh.triangles().iter().map(|tri| tri.map(|c| c + first)));
        }
        TriMesh::new(v, t).unwrap()
    };
    let fingers = four(&tube(radius, 0.12, 16, 30, true), 0.0);
    // Waves of 2.5 mm about half a millimetre above the skin.
    let sleeve = moved(&tube(1.0, 0.07, 16, 18, false), |p| {
        let r = radius + 0.5e-3 + 2.5e-3 * (150.0 * p.y + 3.0 * p.z.atan2(p.x)).sin();
        Point::new(r * p.x, p.y, r * p.z)
    });
    let glove = Layer::new("glove", four(&sleeve, 0.045));
    let outfit = Outfit::new(Layer::new("fingers", fingers), vec![glove]).unwrap();
    let result = assert_clean(&outfit, resolved(&outfit));
    let glove = &result.report.layers[0];
    assert!(glove.moved.max < 4e-3 && glove.moved.mean < 1.5e-3, "{:?}", glove.moved);
    assert!(glove.strain.max < 0.2, "{:?}", glove.strain);
}

#[test]
fn a_garment_with_inverted_winding_comes_out_clean() {
    let mut outfit = mannequin(&[Garment::Tshirt], 1.0);
    let turned = flipped(&outfit.garments[0].mesh);
    outfit.garments[0].mesh = turned;
    assert_clean(&outfit, resolved(&outfit));
}

#[test]
fn the_scene_at_half_and_at_twice_its_size_ends_clean_or_with_what_is_left() {
    let outfit = mannequin(&[Garment::Tshirt, Garment::Jacket], 1.0);
    let mut clean = 0;
    for scale in [0.5, 2.0] {
        let mut scaled = outfit.clone();
        for layer in std::iter::once(&mut scaled.body).chain(&mut scaled.garments) {
            layer.mesh = moved(&layer.mesh, |p| p * scale);
        }
        let outcome = resolved(&scaled);
        clean += u32::from(outcome.is_ok());
        assert_clean_or_left(&scaled, outcome);
    }
    assert!(clean > 0, "neither is clean");
}

#[test]
fn a_naked_body_is_clean() {
    let mut outfit = ball_in_tube("band", 0.4);
    outfit.garments.clear();
    assert_clean(&outfit, resolved(&outfit));
}

#[test]
fn a_monitor_can_cancel_at_any_time() {
    let outfit = ball_in_tube("band", 0.295);
    let mut stages = Vec::new();
    let result = resolve(&outfit, &ResolveParams::default(), &mut |p: &Progress| {
        stages.push(p.stage);
        ControlFlow::Continue(())
    });
    assert_clean(&outfit, result);
    assert!(
        stages.contains(&"verify") && stages.contains(&"settle") && stages.last() == Some(&"done")
    );
    for stop in 0..stages.len() {
        let mut calls = 0;
        let result = resolve(&outfit, &ResolveParams::default(), &mut |_: &Progress| {
            calls += 1;
            if calls > stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(result.unwrap_err(), ResolveError::Cancelled(Cancelled));
        assert_eq!(calls, stop + 1, "no progress is reported after the cancellation");
    }
}

#[test]
fn what_is_not_done_in_the_rounds_is_an_error_that_names_the_pairs() {
    let outfit: Outfit = ball_in_tube("band", 0.295);
    // One round of a hundredth of a millimetre, where half a centimetre is to go.
    let effort = EffortParams {
        rounds: 1,
        settle_rounds: 1,
        contact_step: 1e-5,
        separation_step: 1e-5,
        max_push: 1e-5,
        ease_rounds: 0,
        ..EffortParams::default()
    };
    let slow = ResolveParams { effort, ..ResolveParams::default() };
    let outcome = resolve(&outfit, &slow, &mut Silent);
    let Err(ResolveError::Unresolved { outer, inner, triangles, result }) = &outcome else {
        panic!("{outcome:?}")
    };
    assert_eq!((outer.as_str(), inner.as_str()), ("band", "ball"));
    assert!(!triangles.is_empty());
    let layer = |name: &str| result.outfit.layers().find(|l| l.name == name).unwrap();
    let (ball, band) = (&layer(inner).mesh, &layer(outer).mesh);
    for [a, b] in triangles {
        let (a, b) = (ball.corners(*a as usize), band.corners(*b as usize));
        assert!(intersect::triangles(a, b).is_some(), "{a:?} and {b:?} do not meet");
    }
    assert_clean_or_left(&outfit, outcome);
}

#[test]
fn no_rounds_at_all_are_refused() {
    let mut params = ResolveParams::default();
    params.effort.rounds = 0;
    let outcome = resolve(&ball_in_tube("band", 0.295), &params, &mut Silent);
    assert!(
        matches!(&outcome, Err(ResolveError::Parameter(error)) if error.name == "effort.rounds"),
        "{outcome:?}"
    );
}
