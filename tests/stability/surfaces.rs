//! Surfaces of hostile fields, and fields of hostile surfaces: extraction, baking, closed layers.

use crate::cases::{Random, Tally, cases, check, finite, same_on_all_threads, share};
use crate::fields::{Fault, Hostile, Solid};
use crate::meshes;
use if_core::aabb::Aabb;
use if_core::edges::Edges;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{cuboid, icosphere, tube};
use if_mesh::baked::{BakeError, BakeParams, Baked, Redistance};
use if_mesh::extract::{ExtractError, ExtractParams, Resolution, Sampling, Slope, extract};
use if_mesh::solid::{ClosedLayer, ClothedField};

fn drawn(r: &mut Random) -> (Hostile, ExtractParams) {
    let size = r.power(-6.0, 6.0);
    let center = Point::origin() + r.offset(size, &[0.0, 1.0, 1e4]);
    let field = Hostile::any(r, center, size);
    let whole = Aabb { min: center, max: center }.inflated(size);
    let region = match r.below(5) {
        0 => Some(whole),
        1 => Some(Aabb { max: center + Vector::new(0.3, 0.9, 0.2) * size, ..whole }),
        _ => None,
    };
    let params = ExtractParams {
        region,
        resolution: match r.below(4) {
            0 => Resolution::Cell(size * r.between(0.05, 3.0)),
            1 => Resolution::Accuracy { error: size * r.power(-3.0, 0.0), finest: 0.1 * size },
            _ => Resolution::Cells(1 + r.below(20) as u32),
        },
        phase: [r.unit(), r.unit(), r.unit()],
        sampling: r.pick(&[Sampling::Sparse, Sampling::Dense]),
        slope: match r.below(4) {
            0 => Slope::Given(r.pick(&[1e-3, 1.0, 3.0, 1e6])),
            1 => Slope::Sampled { points: 200, factor: 1.5, seed: 1 },
            _ => Slope::Field,
        },
        noise: r.pick(&[0.0, 0.0, 1e-3]) * size,
        secant: r.chance(0.5),
        newton: r.below(3),
        relax: r.pick(&[0, 0, 0, 3]),
        check: 50,
        seed: 1,
        memory: 4 << 30,
    };
    (field, params)
}

fn kind(error: &ExtractError) -> &'static str {
    match error {
        ExtractError::NotANumber { .. } => "not a number",
        ExtractError::Slope { .. } => "no slope",
        ExtractError::NoRegion => "no region",
        ExtractError::TooFine { .. } => "too fine",
        _ => "other error",
    }
}

fn extracted(count: u32) -> Tally {
    cases("extraction", count, |r| {
        let (field, params) = drawn(r);
        let told = || format!("{field:?} {params:?}");
        let found = match extract(&field, &params, &mut Silent) {
            Ok(found) => found,
            Err(error) => {
                let faultless = matches!(field.fault, Fault::None) && field.solid != Solid::Ground;
                check(!faultless, || format!("{error}: {}", told()))?;
                return Ok(kind(&error));
            }
        };
        let region = found.report.region.inflated(found.report.cell);
        let inside = found.mesh.vertices().iter().all(|p| region.contains(p));
        check(inside, || format!("a vertex outside of the region: {}", told()))?;
        let edges = Edges::new(&found.mesh);
        check(edges.valence.iter().all(|v| *v <= 2), || {
            format!("an edge of three triangles: {}", told())
        })?;
        let numbers = found.report.error.worst();
        check(!numbers.is_nan(), || format!("an error of {numbers}: {}", told()))?;
        // The slow twin, where the bound on the slope is true.
        if params.sampling == Sampling::Sparse && field.is_honest() && params.slope == Slope::Field
        {
            let dense = extract(
                &field,
                &ExtractParams { sampling: Sampling::Dense, ..params },
                &mut Silent,
            );
            check(dense.is_ok_and(|d| d.mesh == found.mesh), || {
                format!("not as on the dense lattice: {}", told())
            })?;
        }
        Ok(if found.mesh.triangles().is_empty() { "no surface" } else { "surface" })
    })
}

#[test]
fn surfaces_of_hostile_fields_stay_in_their_region_or_are_refused() {
    let tally = extracted(400);
    assert!(share(&tally, "surface") > 0.5, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_surfaces_of_hostile_fields_stay_in_their_region_or_are_refused() {
    extracted(20_000);
}

#[test]
fn surfaces_have_the_same_bits_on_any_number_of_threads() {
    let tally = cases("extraction on threads", 10, |r| {
        let (field, params) = drawn(r);
        let found = same_on_all_threads(|| extract(&field, &params, &mut Silent).map(|f| f.mesh))?;
        Ok(match found {
            Ok(mesh) if mesh.triangles().is_empty() => "no surface",
            Ok(_) => "surface",
            Err(_) => "error",
        })
    });
    // More than half of 400 are, as `extracted` sees.
    assert!(share(&tally, "surface") > 0.2, "{tally:?}");
}

fn baked(count: u32) -> Tally {
    cases("baking", count, |r| {
        let size = r.power(-6.0, 6.0);
        let center = Point::origin() + r.offset(size, &[0.0, 1.0]);
        let field = Hostile::any(r, center, size);
        let whole = Aabb { min: center, max: center }.inflated(size);
        let cell = size * r.pick(&[0.05, 0.1, 0.3, 1.0, 10.0]);
        let params = BakeParams {
            cell,
            accuracy: size * r.pick(&[1e-3, 0.1, Real::INFINITY]),
            reach: size * r.pick(&[0.02, 1.0]),
            levels: r.pick(&[0, 2]),
            band: cell * r.pick(&[0.1, 1.0, 2.0, 5.0]),
            depth: r.pick(&[0.05 * size, Real::INFINITY]),
            region: r.chance(0.3).then_some(whole),
            redistance: r.pick(&[Redistance::WhenNeeded, Redistance::Always, Redistance::Never]),
            memory: 64 << 20,
        };
        let told = || format!("{field:?} {params:?}");
        let baked = match Baked::new(&field, &params, &mut Silent) {
            Ok(baked) => baked,
            Err(error) => {
                let faultless = field.fault == Fault::None && field.solid != Solid::Ground;
                let narrow = params.band < params.cell;
                let refusable = narrow || matches!(error, BakeError::TooLarge { .. });
                check(!faultless || refusable, || format!("{error}: {}", told()))?;
                return Ok(match error {
                    BakeError::Parameter(e) if narrow && e.name == "band" => "narrow band",
                    BakeError::NotFinite { .. } => "not finite",
                    BakeError::Steep { .. } => "steep",
                    BakeError::Leaves { .. } => "leaves",
                    BakeError::TooLarge { .. } => "too large",
                    BakeError::Unbounded => "unbounded",
                    _ => "other error",
                });
            }
        };
        let bounds = [baked.error_bound(), baked.lipschitz(), baked.band()];
        check(bounds.iter().all(|b| b.is_finite() && *b >= 0.0), || {
            format!("bounds {bounds:?}: {}", told())
        })?;
        for _ in 0..50 {
            let p = center + r.offset(size, &[0.6, 2.0, 1e9]);
            let FieldSample { distance, gradient } = baked.sample(&p);
            let good = distance.is_finite() && gradient.norm() <= baked.lipschitz() * (1.0 + 1e-9);
            check(good, || format!("{distance} with gradient {gradient:?} in {p}: {}", told()))?;
            let true_distance = field.sample(&p).distance;
            if field.fault == Fault::None
                && true_distance < params.band
                && true_distance > -params.depth
                && field.solid == Solid::Ball
            {
                let off = (distance - true_distance).abs();
                check(off <= baked.error_bound().max(1e-6 * size), || {
                    format!("off by {off:e} for {:e} in {p}: {}", baked.error_bound(), told())
                })?;
            }
        }
        Ok("baked")
    })
}

#[test]
fn baked_hostile_fields_are_finite_everywhere_or_refused() {
    let tally = baked(300);
    assert!(share(&tally, "baked") > 0.3, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_baked_hostile_fields_are_finite_everywhere_or_refused() {
    baked(10_000);
}

/// A body of about one metre, sound or not.
fn body(r: &mut Random) -> TriMesh {
    let ball = icosphere(0.5, 2);
    match r.below(6) {
        0 => ball.clone(),
        1 => cuboid(Vector::new(0.3, 0.5, 0.2)),
        2 => meshes::spoiled(r, &ball),
        3 => meshes::soup(r, 20, 30),
        4 => TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap(),
        _ => tube(0.3, 1.0, 8, 4, false),
    }
}

/// A garment round, in or through it: sound, spoiled, inside out, doubled or pierced.
fn garment(r: &mut Random) -> TriMesh {
    let band = tube(r.between(0.3, 0.7), 0.5, 12, 4, r.chance(0.3));
    match r.below(6) {
        0 => band,
        1 => TriMesh::new(
            band.vertices().to_vec(),
            band.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect(),
        )
        .unwrap(),
        2 => {
            let twice = band.triangles().iter().chain(band.triangles()).copied().collect();
            TriMesh::new(band.vertices().to_vec(), twice).unwrap()
        }
        3 => meshes::spoiled(r, &band),
        4 => meshes::soup(r, 15, 25),
        _ => {
            let (turn, by) = (r.rotation(), r.vector(0.3));
            band.with_vertices(band.vertices().iter().map(|p| turn * p + by).collect()).unwrap()
        }
    }
}

fn layers(count: u32) -> Tally {
    cases("closed layers", count, |r| {
        let scale = r.pick(&[1e-6, 1e-3, 1.0, 1.0, 1e3, 1e6]);
        let offset = r.offset(scale, &[0.0, 1.0, 1e4]);
        // Slim, as a person is: the number of voxels goes with the height.
        let slim = |p: &Point| Point::new(0.15 * p.x, p.y, 0.15 * p.z) * scale + offset;
        let place = |m: &TriMesh| m.with_vertices(m.vertices().iter().map(slim).collect()).unwrap();
        let (naked, worn) = (place(&body(r)), place(&garment(r)));
        let closed = ClosedLayer::body(&naked);
        let layer = ClosedLayer::garment(&worn, &closed, &naked);
        let field = ClothedField::new(vec![&closed, &layer]);
        let points: Vec<Point> = (0..40).map(|_| Point::from(offset) + r.vector(scale)).collect();
        let mut samples =
            vec![FieldSample { distance: 0.0, gradient: Vector::zeros() }; points.len()];
        field.samples(&points, &mut samples);
        let size = naked.aabb().merged(&worn.aabb()).diagonal() + 2.0 * scale;
        for (p, s) in points.iter().zip(&samples) {
            let good = s.distance.is_finite()
                && s.distance.abs() <= 2.0 * size
                && s.gradient.norm() < 1.0 + 1e-9;
            check(good, || format!("{s:?} in {p}, scale {scale}"))?;
            check(field.sample(p) == *s, || format!("a batch differs in {p}"))?;
        }
        Ok("ok")
    })
}

#[test]
fn layers_that_are_spoiled_still_have_a_finite_field() {
    layers(20);
}

#[test]
#[ignore = "stress"]
fn many_layers_that_are_spoiled_still_have_a_finite_field() {
    layers(3_000);
}

#[test]
fn a_layer_has_the_same_field_on_any_number_of_threads() {
    let mut r = Random::new("a layer on threads", 0);
    let slim = |m: &TriMesh| {
        m.with_vertices(
            m.vertices().iter().map(|p| Point::new(0.15 * p.x, p.y, 0.15 * p.z)).collect(),
        )
    };
    let (naked, worn) = (slim(&icosphere(0.5, 2)).unwrap(), slim(&garment(&mut r)).unwrap());
    let points: Vec<Point> = (0..500).map(|_| r.point(1.0)).collect();
    let bits = same_on_all_threads(|| {
        let closed = ClosedLayer::body(&naked);
        let layer = ClosedLayer::garment(&worn, &closed, &naked);
        let field = ClothedField::new(vec![&closed, &layer]);
        let mut out = vec![0.0; points.len()];
        field.distances(&points, &mut out);
        out.iter().map(|x| x.to_bits()).collect::<Vec<_>>()
    });
    assert!(finite(&points) && bits.is_ok(), "{bits:?}");
}
