//! Extraction on the matrix of fields: sparse against dense, vertices on the surface, manifolds,
//! angles.
#![allow(clippy::unwrap_used)] // also in what the tests share

use crate::fields::{BOX, Case, cases, flaws, region};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::{Progress, Silent};
use if_core::shapes::meshes;
use if_mesh::extract::ExtractError;
use if_mesh::extract::{ExtractParams, Resolution, Sampling, Slope, Warning, extract};
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::smallest_angles;
use if_mesh::sdf::MeshSdf;
use std::ops::ControlFlow;

fn params(case: &Case, cells: u32) -> ExtractParams {
    ExtractParams {
        region: Some(region()),
        resolution: Resolution::Cells(cells),
        phase: case.phase,
        noise: case.noise,
        ..ExtractParams::default()
    }
}

/// The mesh of the sparse lattice is that of the dense one, bit by bit.
fn sparse_is_dense(cells: u32) {
    for case in cases(cells) {
        let sparse = extract(&*case.field, &params(&case, cells), &mut Silent).unwrap();
        let dense = extract(
            &*case.field,
            &ExtractParams { sampling: Sampling::Dense, ..params(&case, cells) },
            &mut Silent,
        )
        .unwrap();
        assert!(sparse.mesh == dense.mesh, "{}: the triangles differ", case.name);
        let nodes: usize = dense.report.cells.iter().map(|c| *c as usize + 1).product();
        assert_eq!(dense.report.evaluations.refine, nodes);
        assert!(sparse.report.evaluations.refine < nodes, "{}", case.name);
    }
}

/// Vertices lie on the surface after two evaluations each, edges and vertices are manifold.
fn surfaces_are_sound(cells: u32) {
    for case in cases(cells) {
        let found = extract(&*case.field, &params(&case, cells), &mut Silent).unwrap();
        let (mesh, report) = (&found.mesh, &found.report);
        assert_eq!(report.evaluations.polish, 2 * mesh.vertices().len(), "{}", case.name);
        let worst = mesh.vertices().iter().map(|p| distance(&case, p)).fold(0.0, Real::max);
        // Layers half a cell apart share edges whose ends both lie in one of them: the crease
        // between them bends the field within the edge. Corners of the cuboid lie up to a cell's
        // part off all edges.
        let sharp = case.name.starts_with("zeros, cuboid");
        assert!(
            worst <= if sharp { 0.01 * report.cell } else { 1e-6 * BOX + case.noise },
            "{}: {worst:.2e} m",
            case.name
        );
        assert_eq!(
            flaws(mesh, &report.region, report.cell),
            [0; 3],
            "{}: fins, bow-ties, holes",
            case.name
        );
        match case.name.as_str() {
            "empty" | "full" => assert!(mesh.triangles().is_empty() && report.skipped > 0.99),
            _ => assert!(mesh.triangles().len() > 100, "{}", case.name),
        }
        let leaves = report.warnings.iter().any(|w| matches!(w, Warning::LeavesRegion { .. }));
        assert_eq!(
            leaves,
            ["gyroid", "through", "zeros, plane"].iter().any(|n| case.name.starts_with(n)),
            "{}",
            case.name
        );
    }
}

/// |φ| / |∇φ|, of the field without noise.
fn distance(case: &Case, p: &Point) -> Real {
    let s = case.field.sample(p);
    s.distance.abs() / s.gradient.norm()
}

fn no_slivers_after_relaxation(cells: u32) {
    for case in cases(cells).iter().filter(|c| c.resolved) {
        let found =
            extract(&*case.field, &ExtractParams { relax: 5, ..params(case, cells) }, &mut Silent)
                .unwrap();
        let least = smallest_angles(&found.mesh).into_iter().fold(Real::INFINITY, Real::min);
        assert!(least > 10.0, "{}: {least}°", case.name);
        assert_eq!(
            flaws(&found.mesh, &found.report.region, found.report.cell),
            [0; 3],
            "{}",
            case.name
        );
    }
}

#[test]
fn sparse_is_dense_at_64() {
    sparse_is_dense(64);
}

#[test]
fn surfaces_are_sound_at_64() {
    surfaces_are_sound(64);
}

#[test]
fn triangles_are_well_shaped_at_64() {
    no_slivers_after_relaxation(64);
}

#[test]
#[ignore = "stress"]
fn the_matrix_holds_at_128_and_256() {
    for cells in [128, 256] {
        sparse_is_dense(cells);
        surfaces_are_sound(cells);
        no_slivers_after_relaxation(cells);
    }
}

#[test]
fn near_sheets_and_lost_ones_are_told() {
    let of = |field: &dyn SignedDistance, cells| {
        let params = ExtractParams {
            region: Some(region()),
            resolution: Resolution::Cells(cells),
            ..ExtractParams::default()
        };
        extract(field, &params, &mut Silent).unwrap().report.warnings
    };
    // Gaps of 4 cells and of one cell.
    let h = BOX / 64.0;
    assert_eq!(of(&crate::fields::layers(4.0 * h), 64), []);
    let near = of(&crate::fields::layers(h), 64);
    assert!(
        matches!(near[..], [Warning::NearSheets { pairs: 100.., gap }] if gap < 1.1 * h),
        "{near:?}"
    );
    // A shell of 8 mm in cells of 37 mm is lost in most places.
    let lost = of(&crate::fields::shell(), 64);
    assert!(lost.iter().any(|w| matches!(w, Warning::Unresolved { cells: 100.. })), "{lost:?}");
    assert!(
        of(&crate::fields::sphere(), 64).is_empty() && of(&crate::fields::torus(), 64).is_empty()
    );
}

#[test]
fn triangles_of_sheets_nearer_than_a_cell_do_not_meet() {
    let h = BOX / 64.0;
    let of = |half: Real, relax: usize| {
        let shell = crate::fields::Shell { field: crate::fields::sphere(), half };
        let params = ExtractParams {
            region: Some(region()),
            resolution: Resolution::Cells(64),
            relax,
            ..ExtractParams::default()
        };
        let found = extract(&shell, &params, &mut Silent).unwrap();
        let pairs = own_pairs(&found.mesh, &Bvh::new(&found.mesh)).len();
        (pairs, found.report.moved_back, found.mesh)
    };
    for relax in [0, 3] {
        let (pairs, moved_back, mesh) = of(0.4 * h, relax);
        let few = 1..mesh.vertices().len() / 10;
        assert!(pairs == 0 && few.contains(&moved_back), "{pairs} pairs, {moved_back} moved back");
    }
    // Sheets farther apart are relaxed as any other.
    let ((_, _, plain), (pairs, moved_back, relaxed)) = (of(0.8 * h, 0), of(0.8 * h, 3));
    let moved = plain.vertices().iter().zip(relaxed.vertices()).filter(|(a, b)| a != b).count();
    assert!(pairs == 0 && moved * 10 > plain.vertices().len() * 9, "{pairs}, {moved}");
    assert_eq!(moved_back, 0);
}

#[test]
fn a_wrong_slope_is_mended_and_told() {
    let steep = if_core::shapes::ScaledGradient { field: crate::fields::torus(), factor: 2.0 };
    let base = ExtractParams {
        region: Some(region()),
        resolution: Resolution::Cells(64),
        ..ExtractParams::default()
    };
    let honest = extract(&steep, &base, &mut Silent).unwrap();
    for slope in [0.3, 0.9, 1.5] {
        let lying =
            extract(&steep, &ExtractParams { slope: Slope::Given(slope), ..base }, &mut Silent)
                .unwrap();
        let warned = &lying.report.warnings[..];
        assert!(
            matches!(warned, [Warning::Slope { given, used, .. }] if *given == slope && *used > 1.9),
            "{slope}: {warned:?}"
        );
        assert_eq!(honest.mesh, lying.mesh);
    }
    let sampled = Slope::Sampled { points: 256, factor: 1.5, seed: 1 };
    let sampled = extract(&steep, &ExtractParams { slope: sampled, ..base }, &mut Silent).unwrap();
    approx::assert_relative_eq!(sampled.report.slope, 3.0, max_relative = 1e-12);
    assert_eq!(honest.mesh, sampled.mesh);
    assert!(honest.report.evaluations.refine < sampled.report.evaluations.refine);
}

#[test]
fn a_requested_accuracy_is_reached_with_few_cells() {
    let ask = |error| ExtractParams {
        region: Some(region()),
        resolution: Resolution::Accuracy { error, finest: 1e-3 },
        ..ExtractParams::default()
    };
    for error in [5e-3, 5e-4] {
        let found = extract(&crate::fields::torus(), &ask(error), &mut Silent).unwrap();
        let report = &found.report;
        assert!(report.error.worst() <= error && report.warnings.is_empty(), "{report:?}");
        let mesh = &found.mesh;
        let center = |t: usize| if_core::math::barycentric_point(mesh.corners(t), [1.0 / 3.0; 3]);
        let worst = (0..mesh.triangles().len())
            .map(|t| crate::fields::torus().distance(&center(t)).abs())
            .fold(0.0, Real::max);
        // Of all triangles, and the cell is not much finer than needed.
        assert!(worst <= error && worst >= 0.2 * error, "{error}: {worst}");
        assert_eq!(report.attempts.last().unwrap().cell, report.cell);
    }
    let unreachable = ExtractParams {
        resolution: Resolution::Accuracy { error: 1e-9, finest: 0.05 },
        ..ask(1.0)
    };
    let found = extract(&crate::fields::torus(), &unreachable, &mut Silent).unwrap();
    assert!(matches!(found.report.warnings[..], [Warning::Inaccurate { .. }]));
}

#[test]
fn an_accuracy_holds_at_sharp_edges_and_is_enough_where_cells_are_unresolved() {
    let half = Vector::new(0.3, 0.5, 0.4);
    let field = MeshSdf::sewn(&meshes::cuboid(half)).unwrap();
    let ask = |error, finest| ExtractParams {
        resolution: Resolution::Accuracy { error, finest },
        ..ExtractParams::default()
    };
    for error in [4e-3, 2e-3] {
        let found = extract(&field, &ask(error, 1e-4), &mut Silent).unwrap();
        let center =
            |t: usize| if_core::math::barycentric_point(found.mesh.corners(t), [1.0 / 3.0; 3]);
        let worst = (0..found.mesh.triangles().len())
            .map(|t| field.distance(&center(t)).abs())
            .fold(0.0, Real::max);
        assert!(worst <= error && worst > 0.2 * error, "{error}: {worst}");
        approx::assert_relative_eq!(found.report.error.center_max, worst, max_relative = 1e-9);
    }
    // With a bound on the slope that rules out little.
    let loose = ExtractParams { slope: Slope::Given(4.0), ..ask(2e-3, 1e-3) };
    let found = extract(&field, &loose, &mut Silent).unwrap();
    let hidden = |w: &Warning| matches!(w, Warning::Unresolved { .. });
    assert!(found.report.warnings.iter().any(hidden), "{:?}", found.report.warnings);
    let tight = extract(&field, &ask(2e-3, 1e-3), &mut Silent).unwrap();
    assert_eq!(found.report.cell, tight.report.cell);
    assert!(found.report.error.worst() <= 2e-3 && found.report.cell > 2e-3);
}

#[test]
fn progress_is_reported_and_the_monitor_can_cancel() {
    let params =
        ExtractParams { resolution: Resolution::Cells(32), relax: 1, ..ExtractParams::default() };
    let mut evaluations = Vec::new();
    let mut monitor = |p: &Progress| {
        evaluations.push(p.measure("evaluations").expect("every report has it") as usize);
        ControlFlow::Continue(())
    };
    let found = extract(&crate::fields::sphere(), &params, &mut monitor).unwrap();
    assert!(evaluations.is_sorted() && evaluations.len() >= 6);
    assert_eq!(evaluations.last(), Some(&found.report.evaluations.total));
    let mut stop = |_: &Progress| ControlFlow::Break(());
    let stopped = extract(&crate::fields::sphere(), &params, &mut stop);
    assert!(matches!(stopped, Err(ExtractError::Cancelled(_))));
}

#[test]
fn layers_on_lattices_of_their_own_do_not_touch() {
    // Two equal planes, and lattices that differ: the layers cross nowhere in a degenerate way.
    let at = |layer| {
        let params = ExtractParams {
            resolution: Resolution::Cells(24),
            phase: if_mesh::extract::layer_phase(layer),
            ..ExtractParams::default()
        };
        extract(&crate::fields::sphere(), &params, &mut Silent).unwrap().mesh
    };
    let (a, b) = (at(0), at(1));
    assert!(a.vertices().iter().all(|p| b.vertices().iter().all(|q| (p - q).norm() > 1e-6)));
}
