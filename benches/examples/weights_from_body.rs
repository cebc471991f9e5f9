//! How far garments whose skinning weights come from the body are from where their own carry them.
//!
//! ```text
//! cargo run --release -p if-benches --example weights_from_body -- ../shared/data/body_a MOTION.json
//! ```
//!
//! For each garment of the folder, a row: by `transferred_weights` and by `WeightGrid`, the mean and
//! 99th percentile of the distance in every seventh frame, before contacts, and the 99th percentile of
//! the change of length of edges; and that of the garment's own weights.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_body::skinning::{WeightGrid, WeightGridParams, blends, pose_points, transferred_weights};
use if_body::{Motion, Pose, Skeleton, SkinWeights};
use if_core::edges::Edges;
use if_core::math::{Point, Real};
use if_mesh::ply::read_path;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [folder, motion] = args.as_slice() else {
        return Err("usage: weights_from_body BODY_FOLDER MOTION".into());
    };
    let skeleton = Skeleton::read_path(&folder.join("skeleton.json"))?;
    let joints = skeleton.len();
    let motion = Motion::read_path(motion, &skeleton)?.every(7);
    let body = read_path(&folder.join("body_clean.ply"))?;
    let skin = SkinWeights::from_ply(&body, joints)?;
    let grid = WeightGrid::new(body.mesh.vertices(), &skin, joints, &WeightGridParams::default())?;
    println!("garment, weights, mean mm, p99 mm, strain p99 %, seconds");
    for path in garments(folder)? {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let garment = read_path(&path)?;
        let own = SkinWeights::from_ply(&garment, joints)?;
        let rest = garment.mesh.vertices();
        let edges = Edges::new(&garment.mesh).vertices;
        let start = Instant::now();
        let ours = transferred_weights(&body.mesh, &skin, &garment.mesh, joints)?;
        let seconds = start.elapsed().as_secs_f64();
        let rows =
            [("own", &own, 0.0), ("transferred", &ours, seconds), ("grid", &grid.skin(rest), 0.0)];
        for (kind, weights, seconds) in rows {
            let (mut far, mut strains) = (Vec::new(), Vec::new());
            for pose in &motion.poses {
                let [a, b] = [&own, weights].map(|w| posed(rest, w, &skeleton, pose));
                let (a, b) = (a?, b?);
                far.extend(a.iter().zip(&b).map(|(p, q)| (p - q).norm()));
                let length =
                    |x: &[Point], e: &[u32; 2]| (x[e[0] as usize] - x[e[1] as usize]).norm();
                // Shorter edges are nothing but rounding.
                let long = edges.iter().filter(|e| length(rest, e) > 1e-3);
                strains.extend(long.map(|e| (length(&b, e) / length(rest, e) - 1.0).abs()));
            }
            let mean = far.iter().sum::<Real>() / far.len() as Real;
            println!(
                "{name}, {kind}, {:.1}, {:.1}, {:.0}, {seconds:.2}",
                1e3 * mean,
                1e3 * p99(far),
                1e2 * p99(strains)
            );
        }
    }
    Ok(())
}

/// The garments of a body, sorted.
fn garments(folder: &Path) -> Result<Vec<PathBuf>, std::io::Error> {
    let entries = std::fs::read_dir(folder.join("garments"))?;
    let mut paths = entries.map(|e| Ok(e?.path())).collect::<Result<Vec<_>, std::io::Error>>()?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "ply"));
    paths.sort();
    Ok(paths)
}

fn posed(
    rest: &[Point],
    skin: &SkinWeights,
    skeleton: &Skeleton,
    pose: &Pose,
) -> Result<Vec<Point>, Box<dyn Error>> {
    Ok(pose_points(rest, &blends(skin, &skeleton.transforms(pose)?)))
}

fn p99(mut all: Vec<Real>) -> Real {
    all.sort_by(Real::total_cmp);
    all[(0.99 * (all.len() - 1) as Real) as usize]
}
