//! Small outfits of every kind of fault: clean with a proof, or an error with what is left.

use crate::cases::{Random, Tally, cases, check, finite, same_on_all_threads, share};
use crate::meshes;
use crate::scenes::assert_clean;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::{icosphere, tube};
use if_outfit::outfit::{Layer, Outfit, OutfitError};
use if_outfit::resolve::{ResolveError, ResolveParams, Resolved, resolve};
use if_outfit::verify::verify;

fn mapped(mesh: &TriMesh, f: impl Fn(&Point) -> Point) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(f).collect()).unwrap()
}

/// Vertices and triangles in another order.
fn permuted(r: &mut Random, mesh: &TriMesh) -> TriMesh {
    let mesh = meshes::renumbered(r, mesh);
    let mut triangles = mesh.triangles().to_vec();
    r.shuffle(&mut triangles);
    TriMesh::new(mesh.vertices().to_vec(), triangles).unwrap()
}

/// A slim body of 1.7 m with one to three bands round it, sound or not, in the right order or not.
fn outfit(r: &mut Random) -> (Layer, Vec<Layer>) {
    let body = mapped(&icosphere(0.85, 3), |p| Point::new(0.25 * p.x, p.y, 0.25 * p.z));
    let mut garments: Vec<TriMesh> = Vec::new();
    for _ in 0..1 + r.below(3) {
        let radius = r.pick(&[0.1, 0.195, 0.205, 0.21, 0.215, 0.23]);
        let (lift, around) = (r.between(-0.3, 0.1), 12 + r.below(8) as u32);
        let band = mapped(&tube(radius, 0.25, around, 4, r.chance(0.1)), |p| {
            Point::new(p.x, p.y + lift, p.z)
        });
        let garment = match r.below(13) {
            0 => meshes::spoiled(r, &band),
            1 => TriMesh::new(
                band.vertices().to_vec(),
                band.triangles().iter().map(|t| [t[1], t[0], t[2]]).collect(),
            )
            .unwrap(),
            2 => permuted(r, &band),
            3 => mapped(&meshes::soup(r, 12, 14), |p| p * 0.25),
            4 => garments.last().cloned().unwrap_or(band),
            5 => {
                let (turn, by) = (r.rotation(), r.vector(0.1));
                mapped(&band, |p| turn * p + by)
            }
            6 => {
                let factor = r.pick(&[0.01, 0.3, 3.0, 100.0]);
                mapped(&band, |p| p * factor)
            }
            7 => {
                let vertices = band.vertices().iter().map(|p| p + r.vector(0.02)).collect();
                band.with_vertices(vertices).unwrap()
            }
            8 => {
                // The hem goes in through whatever is below.
                let (low, depth) = (band.aabb().min.y + 0.05, r.between(0.3, 1.0));
                mapped(&band, |p| {
                    if p.y < low { Point::new(depth * p.x, p.y, depth * p.z) } else { *p }
                })
            }
            _ => band,
        };
        garments.push(garment);
    }
    // The whole of it smaller, larger, or far away.
    let (scale, far) = (r.pick(&[1.0, 1.0, 1.0, 0.01, 10.0, 1000.0]), r.pick(&[0.0, 0.0, 1e4]));
    let away = r.vector(far);
    let place = |m: &TriMesh| mapped(m, |p| p * scale + away);
    let layers = garments
        .iter()
        .enumerate()
        .map(|(k, g)| Layer::new(format!("band {k}"), place(g)))
        .collect();
    (Layer::new("body", place(&body)), layers)
}

fn params() -> ResolveParams {
    // Every path is met in a few rounds; many of these outfits cannot become clean.
    let mut params = ResolveParams::default();
    let effort = &mut params.effort;
    (effort.rounds, effort.settle_rounds, effort.polish_rounds) = (3, 2, 1);
    params
}

fn run(outfit: &Outfit) -> Result<Resolved, ResolveError> {
    resolve(outfit, &params(), &mut Silent)
}

/// What is promised where something is left: the same triangles, and a report that says what an
/// independent look says.
fn left(input: &Outfit, result: &Resolved) -> Result<(), String> {
    let after = verify(&result.outfit).map_err(|e| e.to_string())?;
    let report = &result.report;
    let same = after.pairs == report.after.pairs && after.own_pairs == report.after.own_pairs;
    check(same, || {
        let found = (&report.after.pairs, &report.after.own_pairs);
        format!("the report is wrong: {found:?} are {:?}", (&after.pairs, &after.own_pairs))
    })?;
    let faults = after.total_pairs() + after.total_inside() + report.new_own_pairs();
    check(faults > 0, || "an error without a fault".into())?;
    let same =
        |(a, b): (&Layer, &Layer)| a.name == b.name && a.mesh.triangles() == b.mesh.triangles();
    check(input.layers().zip(result.outfit.layers()).all(same), || "other triangles".into())
}

fn resolved(count: u32) -> Tally {
    cases("outfits", count, |r| {
        let (body, garments) = outfit(r);
        let refused = |error: &OutfitError| {
            check(error.to_string().contains('`'), || format!("{error} names no layer"))
                .map(|()| "refused")
        };
        let outfit = match Outfit::new(body, garments) {
            Ok(outfit) => outfit,
            Err(error) => return refused(&error),
        };
        let outcome = run(&outfit);
        // A garment of less than a hundredth of the body is taken for one in other units.
        if let Err(ResolveError::Outfit(error @ OutfitError::TooSmall { .. })) = &outcome {
            return refused(error);
        }
        let (result, kind) = match &outcome {
            Ok(result) => (result.clone(), "clean"),
            Err(ResolveError::Unresolved { result, .. }) => ((**result).clone(), "left"),
            Err(error) => return Err(error.to_string()),
        };
        // Nothing flies off: no further than the garment and the body are large.
        let whole =
            outfit.layers().fold(if_core::aabb::Aabb::EMPTY, |b, l| b.merged(&l.mesh.aabb()));
        let room = whole.inflated(whole.diagonal());
        for layer in result.outfit.layers() {
            let inside = layer.mesh.vertices().iter().all(|p| room.contains(p));
            check(inside && finite(layer.mesh.vertices()), || {
                format!("`{}` flies off", layer.name)
            })?;
        }
        match outcome {
            Ok(result) => drop(assert_clean(&outfit, Ok(result))),
            Err(_) => left(&outfit, &result)?,
        }
        Ok(kind)
    })
}

#[test]
fn small_outfits_end_clean_or_with_what_is_left() {
    let tally = resolved(40);
    assert!(tally.contains_key("clean") && tally.contains_key("left"), "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn many_small_outfits_end_clean_or_with_what_is_left() {
    resolved(2_000);
}

#[test]
fn small_outfits_end_with_the_same_bits_on_any_number_of_threads() {
    let tally = cases("outfits on threads", 3, |r| {
        let (body, garments) = outfit(r);
        let Ok(outfit) = Outfit::new(body, garments) else { return Ok("refused") };
        let bits = |outfit: &Outfit| -> Vec<u64> {
            outfit
                .layers()
                .flat_map(|l| l.mesh.vertices())
                .flat_map(|p| p.iter().map(|c: &Real| c.to_bits()))
                .collect()
        };
        let ended = same_on_all_threads(|| match run(&outfit) {
            Ok(result) => (true, bits(&result.outfit)),
            Err(ResolveError::Unresolved { result, .. }) => (false, bits(&result.outfit)),
            Err(error) => panic!("{error}"),
        })?;
        Ok(if ended.0 { "clean" } else { "left" })
    });
    assert!(share(&tally, "clean") + share(&tally, "left") > 0.0, "{tally:?}");
}
