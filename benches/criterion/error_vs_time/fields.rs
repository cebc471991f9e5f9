//! Surfaces of fields and baked fields: three fields with closed forms.

use crate::record::{Record, Run, timed};
use if_core::aabb::Aabb;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::{Gyroid, Sphere, Torus};
use if_mesh::baked::{BakeParams, Baked};
use if_mesh::extract::{ExtractParams, Resolution, Sampling, extract};
use if_mesh::sdf::MeshSdf;

pub(crate) fn run(record: &mut Record) {
    let center = Point::new(0.013, 0.021, -0.017);
    let torus = Torus { center, major: 0.6, minor: 0.25 };
    extraction(record, "sphere", &Sphere { center, radius: 0.8 });
    extraction(record, "torus", &torus);
    extraction(record, "gyroid", &Gyroid { period: 0.8 });
    let cells: &[Real] =
        if record.quick { &[0.024, 0.012] } else { &[0.048, 0.024, 0.012, 0.006, 0.004] };
    baking(record, "torus", &torus, cells);
    let mesh = extract(&torus, &ExtractParams::default(), &mut Silent).unwrap().mesh;
    let exact = MeshSdf::closed(&mesh).unwrap();
    baking(
        record,
        &format!("a mesh of {} triangles", mesh.triangles().len()),
        &exact,
        &cells[..cells.len().min(3)],
    );
}

/// Distance of the triangles from the surface, root of the mean square over corners, middles of
/// edges, and centres.
fn off(mesh: &TriMesh, field: &dyn SignedDistance) -> Real {
    let (mut sum, mut count) = (0.0, 0u32);
    for t in mesh.triangles() {
        let [a, b, c] = t.map(|v| mesh.vertices()[v as usize].coords);
        for p in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (a + b + c) / 3.0] {
            let s = field.sample(&p.into());
            sum += (s.distance / s.gradient.norm().max(1e-3)).powi(2);
            count += 1;
        }
    }
    (sum / Real::from(count)).sqrt()
}

fn extraction(record: &mut Record, name: &str, field: &dyn SignedDistance) {
    let problem = format!("extraction, {name}");
    let region = Aabb { min: Point::new(-1.2, -1.2, -1.2), max: Point::new(1.2, 1.2, 1.2) };
    let sizes: &[u32] = if record.quick { &[32, 64] } else { &[32, 64, 128, 256] };
    for &cells in sizes {
        let base = ExtractParams {
            region: Some(region),
            resolution: Resolution::Cells(cells),
            check: 0,
            ..Default::default()
        };
        let settings = [
            ("linear", ExtractParams { secant: false, newton: 0, ..base }),
            ("secant", ExtractParams { newton: 0, ..base }),
            ("secant, Newton", base),
            ("relaxed, 3 rounds", ExtractParams { relax: 3, ..base }),
            (
                "dense, linear",
                ExtractParams { secant: false, newton: 0, sampling: Sampling::Dense, ..base },
            ),
        ];
        for (method, params) in settings {
            if params.sampling == Sampling::Dense && cells > 128 {
                continue; // 17 million evaluations show nothing new
            }
            let (ms, found) = timed(|| extract(field, &params, &mut Silent).unwrap());
            let nodes: u64 = found.report.cells.iter().map(|n| u64::from(*n) + 1).product();
            let made = found.report.evaluations.total as u64;
            let skipped = nodes.saturating_sub(found.report.evaluations.refine as u64);
            let error = off(&found.mesh, field);
            // Second order: on record 0.12 to 0.42 cell² per metre of radius, for every method at
            // all four sizes.
            let cell = found.report.cell;
            let most = 0.5 * cell * cell;
            assert!(error < most, "{name}, {method}, {cells} cells: {error} m");
            let run = Run {
                problem: &problem,
                method,
                parameter: format!("{cells} cells"),
                unit: "m rms",
                default: params == base && cells == 256,
            };
            record.push(run, ms, error, [made, skipped]);
        }
    }
}

/// Points in a band of 20 mm around the surface, and elsewhere.
fn places(field: &dyn SignedDistance, count: usize) -> Vec<Point> {
    let region = field.bounds().unwrap().inflated(0.02);
    let mut state = 7u64;
    let mut unit = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as Real / (1u64 << 53) as Real
    };
    let mut found = Vec::new();
    while found.len() < count {
        let p = region.min + region.size().component_mul(&Vector::new(unit(), unit(), unit()));
        if field.distance(&p).abs() < 0.02 {
            found.push(p);
        }
    }
    found
}

/// What a query costs and how wrong it is, for the field itself and for its bakes; and what baking
/// costs.
fn baking(record: &mut Record, name: &str, field: &dyn SignedDistance, cells: &[Real]) {
    let points = places(field, 20_000);
    let truth: Vec<Real> = points.iter().map(|p| field.distance(p)).collect();
    let mut out = vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
    let mut query = |field: &dyn SignedDistance| {
        let (ms, ()) = timed(|| field.samples(&points, &mut out));
        let square: Real = out.iter().zip(&truth).map(|(s, d)| (s.distance - d).powi(2)).sum();
        (ms, (square / points.len() as Real).sqrt())
    };
    let problem = format!("20,000 queries, {name}");
    let (ms, error) = query(field);
    record.push(
        Run {
            problem: &problem,
            method: "the field itself",
            parameter: "exact".into(),
            unit: "m rms",
            default: false,
        },
        ms,
        error,
        [20_000, 0],
    );
    let even = cells.iter().map(|cell| BakeParams {
        cell: *cell,
        accuracy: Real::INFINITY,
        ..Default::default()
    });
    let halved = [3e-3, 1e-3, 3e-4].map(|accuracy| BakeParams { accuracy, ..Default::default() });
    let bands = [0.015, 0.15].map(|band| BakeParams { band, ..Default::default() });
    for params in even.chain(halved).chain(bands) {
        let default = params == BakeParams::default();
        let (baking_ms, baked) = timed(|| Baked::new(field, &params, &mut Silent).unwrap());
        let (ms, error) = query(&baked);
        // Points of the band have the stated bound; those beyond a narrower band read as the band.
        let beyond = (0.02 - params.band).max(0.0);
        let most = baked.error_bound().max(beyond);
        assert!(error <= most, "{name}, {params:?}: {error} m");
        // On record: 1.7e-7 m of the torus, 2.6e-5 m of its mesh, whose edges show.
        assert!(!default || error < 1e-4, "{name}: {error} m");
        let parameter = if params.band != BakeParams::default().band {
            format!("band {} mm", params.band * 1e3)
        } else if params.accuracy.is_finite() {
            format!("accuracy {} mm", params.accuracy * 1e3)
        } else {
            format!("cell {} mm", params.cell * 1e3)
        };
        let run = |problem, parameter| Run {
            problem,
            method: "baked",
            parameter,
            unit: "m rms",
            default,
        };
        record.push(run(&problem, parameter.clone()), ms, error, [20_000, 0]);
        let bytes = baked.bytes() as u64;
        record.push(
            run(&format!("baking, {name}"), format!("{parameter}, {:.1} MB", bytes as Real / 1e6)),
            baking_ms,
            error,
            [0, 0],
        );
    }
}
