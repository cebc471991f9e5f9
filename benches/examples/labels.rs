//! How many vertices get a wrong label: from single noisy labels, from votes of a sequence, and
//! after smoothing; with a mean filter beside it. Writes CSV to stdout.
//!
//! ```text
//! cargo run --release -p if-benches --example labels -- ../shared/data > labels.csv
//! ```
//!
//! Without more arguments it takes the scans of `clothed/` and the sequences of
//! `sequences/render_*`; captures named after the data folder (made by `render_sequence.py` of
//! body_a in the outfits o0_clean and o0_clean_suit) are added. Truth is the label of the nearest
//! place on the clothed body without noise.

#![allow(clippy::print_stdout, clippy::print_stderr)] // that is what it is for

use if_body::Skeleton;
use if_body::SkinWeights;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::index::Bvh;
use if_mesh::labels::{
    CutParams, LabelVotes, SmoothLabelParams, UNDECIDED, VoteParams, VoteReport, Voter, cut,
    smooth_labels,
};
use if_mesh::ply::{self, PlyMesh};
use if_pipeline::capture::Capture;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Reaches of a vote that are tried, in millimetres.
const LENGTHS: [Real; 5] = [5.0, 10.0, 20.0, 30.0, 50.0];
/// Margins that are tried, in pixels.
const MARGINS: [usize; 4] = [0, 1, 2, 3];
/// Rounds of the mean filter.
const ROUNDS: [usize; 3] = [1, 4, 16];

fn main() -> Result<()> {
    let mut args = std::env::args_os().skip(1).map(PathBuf::from);
    let data = args.next().ok_or("give the data folder, such as ../shared/data")?;
    println!("scene,vertices,margin_px,method,parameter,undecided,wrong,wrong_percent,ms");
    let mut scans: Vec<PathBuf> =
        std::fs::read_dir(data.join("clothed"))?.map(|f| Ok(f?.path())).collect::<Result<_>>()?;
    scans.retain(|p| p.to_string_lossy().contains("_scan"));
    scans.sort();
    for scan in &scans {
        let name = scan.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let solid = &name[..name.find("_scan").unwrap_or(0)];
        let solid = ply::read_path(&data.join(format!("clothed/{solid}_solid.ply")))?;
        let scan = ply::read_path(scan)?;
        let truth = truth(&solid, &scan.mesh)?;
        let votes = LabelVotes::from_labels(&labels(&scan, "label_noisy")?, count(&solid)?);
        judge(&name, "", &scan.mesh, &truth, &votes)?;
    }
    let mut captures: Vec<PathBuf> =
        std::fs::read_dir(data.join("sequences"))?.map(|f| Ok(f?.path())).collect::<Result<_>>()?;
    captures.retain(|p| p.join("meta.json").exists());
    captures.sort();
    captures.extend(args);
    for folder in captures {
        let capture = Capture::open(&folder)?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let scene = match capture.garments().join("+").as_str() {
            "trousers+sweater" => "c1_trousers_sweater",
            "suit_trousers+suit_jacket" => "c4_suit",
            other => return Err(format!("{name}: no clothed body wears {other}").into()),
        };
        let solid = ply::read_path(&data.join(format!("clothed/{scene}_solid.ply")))?;
        let (skeleton, skin) =
            rigged(&data.join("body_a"), &solid.mesh, &labels(&solid, "label")?, &capture)?;
        let truth = labels(&solid, "label")?;
        for margin in MARGINS {
            let start = Instant::now();
            let (votes, report) = voted(&capture, &solid.mesh, &skeleton, &skin, margin)?;
            let seconds = start.elapsed().as_secs_f64();
            eprintln!(
                "{name}, margin {margin}: {report:?}, {seconds:.2} s with posing and reading"
            );
            judge(&name, &margin.to_string(), &solid.mesh, &truth, &votes)?;
        }
    }
    Ok(())
}

/// Prints a line for each method.
fn judge(
    scene: &str,
    margin: &str,
    mesh: &TriMesh,
    truth: &[u8],
    votes: &LabelVotes,
) -> Result<()> {
    let n = truth.len();
    let print = |method: &str, parameter: Real, of: &[u8], ms: Real| {
        let undecided = of.iter().filter(|l| **l == UNDECIDED).count();
        let wrong = of.iter().zip(truth).filter(|(l, t)| l != t).count();
        let percent = 100.0 * wrong as Real / n as Real;
        println!(
            "{scene},{n},{margin},{method},{parameter},{undecided},{wrong},{percent:.3},{ms:.1}"
        );
    };
    let before: Vec<u8> = (0..n).map(|v| votes.winner(v)).collect();
    print("votes", 0.0, &before, 0.0);
    for rounds in ROUNDS {
        let start = Instant::now();
        let of = mean_filter(mesh, votes, rounds);
        print("mean filter (rounds)", rounds as Real, &of, 1e3 * start.elapsed().as_secs_f64());
    }
    for length in LENGTHS {
        let start = Instant::now();
        let scores = smooth_labels(
            mesh,
            votes,
            &SmoothLabelParams { length: 1e-3 * length, ..Default::default() },
            &mut Silent,
        )?;
        print("smooth_labels (mm)", length, &scores.winners(), 1e3 * start.elapsed().as_secs_f64());
    }
    // What a user gets is cut at once: borders and pieces are counted.
    let scores = smooth_labels(mesh, votes, &SmoothLabelParams::default(), &mut Silent)?;
    let start = Instant::now();
    let pieces = cut(mesh, &scores, &CutParams::default())?;
    let ms = 1e3 * start.elapsed().as_secs_f64();
    let loops: Vec<String> = pieces
        .iter()
        .map(|p| {
            format!(
                "{}: {} border loops, {:.3} m²",
                p.label,
                Edges::new(&p.mesh).boundary_loops(&p.mesh).len(),
                p.mesh.area()
            )
        })
        .collect();
    eprintln!("{scene}, margin {margin}: cut in {ms:.1} ms; {}", loops.join("; "));
    Ok(())
}

/// The baseline: shares of labels, averaged with those of the neighbours.
fn mean_filter(mesh: &TriMesh, votes: &LabelVotes, rounds: usize) -> Vec<u8> {
    let (n, k) = (votes.vertices(), votes.labels);
    let mut shares: Vec<Real> = votes.weights.clone();
    for v in 0..n {
        let sum: Real = votes.of(v).iter().sum();
        shares[v * k..(v + 1) * k].iter_mut().for_each(|s| *s /= sum.max(1e-300));
    }
    let edges = Edges::new(mesh);
    for _ in 0..rounds {
        let mut next = shares.clone();
        let mut counts = vec![1.0; n];
        for &[a, b] in &edges.vertices {
            for (a, b) in [(a as usize, b as usize), (b as usize, a as usize)] {
                counts[a] += 1.0;
                (0..k).for_each(|l| next[a * k + l] += shares[b * k + l]);
            }
        }
        (0..n * k).for_each(|at| next[at] /= counts[at / k]);
        shares = next;
    }
    let shares = LabelVotes { labels: k, weights: shares };
    (0..n).map(|v| shares.winner(v)).collect()
}

fn labels(ply: &PlyMesh, name: &str) -> Result<Vec<u8>> {
    let property =
        ply.vertex_property(name).ok_or_else(|| format!("no vertex property `{name}`"))?;
    Ok(property.values.to_f64().into_iter().map(|l| l as u8).collect())
}

/// Number of labels, with that of the background.
fn count(solid: &PlyMesh) -> Result<usize> {
    Ok(labels(solid, "label")?.into_iter().max().map_or(1, |l| usize::from(l) + 1))
}

/// For each vertex the label at the nearest place of the solid.
fn truth(solid: &PlyMesh, mesh: &TriMesh) -> Result<Vec<u8>> {
    let labels = labels(solid, "label")?;
    let bvh = Bvh::new(&solid.mesh);
    let label = |p: &Point| {
        let near = bvh.closest(p, Real::INFINITY)?;
        let corner = (0..3).max_by(|a, b| near.barycentric[*a].total_cmp(&near.barycentric[*b]))?;
        Some(labels[solid.mesh.triangles()[near.triangle as usize][corner] as usize])
    };
    mesh.vertices()
        .iter()
        .map(|p| label(p).ok_or_else(|| "the solid has no triangles".into()))
        .collect()
}

/// The weights of a clothed body: those of the nearest vertex of the layer that each of its
/// vertices belongs to.
fn rigged(
    body: &Path,
    mesh: &TriMesh,
    labels: &[u8],
    capture: &Capture,
) -> Result<(Skeleton, SkinWeights)> {
    let skeleton = Skeleton::read_path(&body.join("skeleton.json"))?;
    capture.check_skeleton(&skeleton)?;
    let mut files = vec![body.join("body.ply")];
    files.extend(capture.garments().iter().map(|g| body.join(format!("garments/{g}.ply"))));
    let mut layers = Vec::new();
    for file in files {
        let ply = ply::read_path(&file)?;
        layers.push((SkinWeights::from_ply(&ply, skeleton.len())?, Bvh::new(&ply.mesh), ply.mesh));
    }
    let (mut joints, mut weights) = (Vec::new(), Vec::new());
    for (p, label) in mesh.vertices().iter().zip(labels) {
        let (skin, bvh, layer) = &layers[usize::from(*label).clamp(1, layers.len()) - 1];
        let near = bvh.closest(p, Real::INFINITY).ok_or("a layer has no triangles")?;
        let corner = (0..3)
            .max_by(|a, b| near.barycentric[*a].total_cmp(&near.barycentric[*b]))
            .unwrap_or(0);
        let v = layer.triangles()[near.triangle as usize][corner] as usize;
        joints.push(skin.joints()[v]);
        weights.push(skin.weights()[v]);
    }
    let count = skeleton.len();
    Ok((skeleton, SkinWeights::new(joints, weights, count)?))
}

/// Lets all frames vote.
fn voted(
    capture: &Capture,
    mesh: &TriMesh,
    skeleton: &Skeleton,
    skin: &SkinWeights,
    margin: usize,
) -> Result<(LabelVotes, VoteReport)> {
    let params = VoteParams { margin, ..Default::default() };
    let mut voter = Voter::new(mesh, capture.labels().len(), &params)?;
    for frame in 0..capture.len() {
        let transforms = skeleton.transforms(capture.pose(frame))?;
        let posed = |v: usize| {
            let parts = skin.joints()[v].iter().zip(skin.weights()[v]);
            let sum: Vector = parts
                .map(|(j, w)| {
                    (transforms[usize::from(*j)] * mesh.vertices()[v]).coords * Real::from(w)
                })
                .sum();
            Point::from(sum)
        };
        let positions: Vec<Point> = (0..mesh.vertices().len()).map(posed).collect();
        voter.add(&positions, capture.camera(), &capture.label_image(frame)?)?;
    }
    Ok(voter.finish())
}
