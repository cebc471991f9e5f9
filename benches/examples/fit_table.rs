//! Error against time of fits to meshes, for the grid encoding and the paper's networks.
//!
//! ```text
//! cargo run --release -p if-benches --example fit_table -- FILES [--networks grid,fast,paper] \
//!     [--seconds 30,60,120,300]
//!     \
//!     [--truth SOLID.ply]    fit the files' vertices as oriented points, and judge the result by this closed mesh
//!     [--height 1.7]         scale every file to this height, in metres
//!     \
//!     [--set key=value …]    batch, rate, far, near, spread0, spread1, distance_scale, normal, normal_scale, eikonal, finest, coarsest,
//!                            levels, features, hidden, table, smoothing
//!     \
//!     [--dump DIR]           write the training and held-out points for crates/if-neural/tests/pytorch_fit.py
//!     [--save OUT.safetensors] the last network
//!     [--picture OUT.png]    the last fit, extracted at 5 mm and drawn beside its target
//! ```
//!
//! The time is all that passes from the mesh in memory to the network: its field, sampling, first
//! values and steps. Errors are at held-out points: 20,000 beside the surface, N(0, 1 % of half the
//! size), and 20,000 on it.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::file::MeshFile;
use if_mesh::sdf::MeshSdf;
use if_neural::cloud::OrientedPoints;
use if_neural::field::NeuralField;
use if_neural::files::{WeightNorm, write_network};
use if_neural::fit::{Fit, FitParams};
use if_neural::loss::Known;
use if_neural::network::{Network, NetworkConfig};
use if_neural::sampling::{SamplingParams, TrainingSet};
use if_neural::target::Target;
use if_neural::trainable::TrainableField;
use if_render::{PALETTE, RenderLayer, View, side_by_side};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;
use std::time::Instant;

type Settings = BTreeMap<String, Real>;

struct Args {
    files: Vec<String>,
    networks: Vec<String>,
    seconds: Vec<Real>,
    truth: Option<String>,
    height: Option<Real>,
    settings: Settings,
    picture: Option<String>,
    dump: Option<String>,
    save: Option<String>,
}

fn args() -> Result<Args, Box<dyn Error>> {
    let list = |text: String| text.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut args = Args {
        files: Vec::new(),
        networks: list("grid,fast,paper".into()),
        seconds: vec![30.0, 60.0, 120.0, 300.0],
        truth: None,
        height: None,
        settings: Settings::new(),
        picture: None,
        dump: None,
        save: None,
    };
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut next = || words.next().ok_or(format!("{word} needs a value"));
        match word.as_str() {
            "--networks" => args.networks = list(next()?),
            "--seconds" => {
                args.seconds = list(next()?).iter().map(|s| s.parse()).collect::<Result<_, _>>()?
            }
            "--truth" => args.truth = Some(next()?),
            "--height" => args.height = Some(next()?.parse()?),
            "--picture" => args.picture = Some(next()?),
            "--dump" => args.dump = Some(next()?),
            "--save" => args.save = Some(next()?),
            "--set" => {
                for pair in list(next()?) {
                    let (key, value) = pair.split_once('=').ok_or("--set takes key=value")?;
                    args.settings.insert(key.to_owned(), value.parse()?);
                }
            }
            file => args.files.push(file.to_owned()),
        }
    }
    Ok(args)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args = args()?;
    println!(
        "file | network | parameters | seconds (prepared) | steps | mean mm | p99 mm | surface mm | eikonal | normals °"
    );
    println!("--- | --- | --- | --- | --- | --- | --- | --- | --- | ---");
    for file in &args.files {
        let name = Path::new(file).file_stem().and_then(|s| s.to_str()).unwrap_or(file);
        let mesh = scaled(MeshFile::read(Path::new(file))?.mesh(), args.height)?;
        let truth = args.truth.as_ref().map(|t| MeshFile::read(Path::new(t))).transpose()?;
        let truth = truth.map(|t| scaled(t.mesh(), args.height)).transpose()?;
        for network in &args.networks {
            for seconds in &args.seconds {
                let fitted = one(&mesh, truth.as_ref(), network, *seconds, &args)?;
                println!("{name} | {network} | {}", fitted.1);
                if let Some(path) = &args.save {
                    let mut file = std::fs::File::create(path)?;
                    write_network(
                        &mut file,
                        fitted.0.network(),
                        fitted.0.frame(),
                        WeightNorm::Kept,
                    )?;
                }
                if let Some(path) = &args.picture {
                    picture(&fitted.0, truth.as_ref().unwrap_or(&mesh), path)?;
                }
            }
        }
    }
    Ok(())
}

fn scaled(mesh: &TriMesh, height: Option<Real>) -> Result<TriMesh, Box<dyn Error>> {
    let Some(height) = height else { return Ok(mesh.clone()) };
    let (low, size) = (mesh.aabb().min, mesh.aabb().size());
    Ok(mesh.with_vertices(
        mesh.vertices().iter().map(|p| Point::from((p - low) * (height / size.amax()))).collect(),
    )?)
}

/// The field and the row of the table.
fn one(
    mesh: &TriMesh,
    truth: Option<&TriMesh>,
    network: &str,
    seconds: Real,
    args: &Args,
) -> Result<(NeuralField<Network>, String), Box<dyn Error>> {
    let mut config = match network {
        "grid" => NetworkConfig::grid(),
        "fast" => NetworkConfig::fast(),
        "paper" => NetworkConfig::paper(),
        other => {
            return Err(
                format!("no network is called {other}; there are grid, fast and paper").into()
            );
        }
    };
    let start = Instant::now();
    let (cloud, sdf);
    let target = if truth.is_some() {
        // Vertices without a triangle have no normal.
        let normals = mesh.vertex_normals();
        let (p, n): (Vec<_>, Vec<_>) =
            mesh.vertices().iter().zip(normals).filter(|(_, n)| n.norm() > 0.5).unzip();
        cloud = OrientedPoints::new(p, n)?;
        Target::Points(&cloud)
    } else {
        sdf = MeshSdf::closed(mesh)?;
        Target::Field(&sdf)
    };
    let mut sampling = SamplingParams::default();
    let mut fit = FitParams { loss: target.loss(), ..config.fit_params() };
    apply(&args.settings, &mut config, &mut sampling, &mut fit)?;
    let (set, mut network) = target.begin(&config, &sampling)?;
    if let Some(folder) = &args.dump {
        dump(&set, Path::new(folder))?;
    }
    let prepared = start.elapsed().as_secs_f64();
    let seeded = set.held_out.accuracy(&set.frame, |p, o| network.samples32(p, o));
    fit.seconds = Some((seconds - prepared).max(0.1));
    let report = Fit::new(fit)?.run(&mut network, &set, &mut Silent)?;
    let mut error = report.error;
    if let Some(truth) = truth {
        let field = MeshSdf::closed(truth)?;
        let judge =
            TrainingSet::of_field(&field, &SamplingParams { near: 64, far: 64, ..sampling })?;
        error = judge.held_out.accuracy(&set.frame, |p, o| network.samples32(p, o));
        let raw: Vec<Real> = mesh.vertices().iter().map(|p| field.distance(p).abs()).collect();
        let raw_mean = raw.iter().sum::<Real>() / raw.len() as Real;
        println!("(the scan's own vertices: mean {:.3} mm from the truth)", raw_mean * 1e3);
    }
    println!(
        "(before the first step: mean {:.3} mm, p99 {:.3} mm, eikonal {:.4})",
        seeded.mean * 1e3,
        seeded.p99 * 1e3,
        seeded.eikonal
    );
    let row = format!(
        "{} | {:.1} ({prepared:.1}) | {} | {:.3} | {:.3} | {:.3} | {:.4} | {:.2}",
        network.parameters().len(),
        prepared + report.seconds,
        report.steps,
        error.mean * 1e3,
        error.p99 * 1e3,
        error.surface * 1e3,
        error.eikonal,
        error.normal_degrees
    );
    Ok((NeuralField::new(network, set.frame)?, row))
}

fn apply(
    settings: &Settings,
    config: &mut NetworkConfig,
    sampling: &mut SamplingParams,
    fit: &mut FitParams,
) -> Result<(), Box<dyn Error>> {
    for (key, value) in settings {
        match (key.as_str(), &mut *config) {
            ("batch", _) => fit.batch = *value as usize,
            ("rate", _) => fit.schedule.rate = *value,
            ("far", _) => fit.far = *value,
            ("distance_scale", _) => fit.loss.distance_scale = *value,
            ("normal", _) => fit.loss.normal = *value,
            ("normal_scale", _) => fit.loss.normal_scale = *value,
            ("eikonal", _) => fit.loss.eikonal = *value,
            ("near", _) => sampling.near = *value as usize,
            ("spread0", _) => sampling.spread[0] = *value,
            ("spread1", _) => sampling.spread[1] = *value,
            ("smoothing", _) => sampling.smoothing = Some(*value),
            ("finest", NetworkConfig::Grid(g)) => g.finest = *value as u32,
            ("coarsest", NetworkConfig::Grid(g)) => g.coarsest = *value as u32,
            ("levels", NetworkConfig::Grid(g)) => g.levels = *value as u32,
            ("features", NetworkConfig::Grid(g)) => g.features = *value as u32,
            ("hidden", NetworkConfig::Grid(g)) => g.hidden = *value as u32,
            ("table", NetworkConfig::Grid(g)) => g.table = *value as u32,
            ("softness", NetworkConfig::Grid(g)) => g.softness = *value as f32,
            _ => return Err(format!("--set {key}: no such setting of this network").into()),
        }
    }
    Ok(())
}

/// Rows of f32: place, distance, gradient and its trust; of held-out points place and distance. In
/// network units.
fn dump(set: &TrainingSet, folder: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(folder)?;
    let bytes = |rows: Vec<f32>| rows.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    for (name, samples) in [("near", &set.near), ("far", &set.far)] {
        let row = |(p, k): (&[f32; 3], &Known)| {
            [&p[..], &[k.distance], &k.gradient[..], &[k.gradient_trust]].concat()
        };
        let rows = samples.points.iter().zip(&samples.known).flat_map(row).collect();
        std::fs::write(folder.join(format!("{name}.f32")), bytes(rows))?;
    }
    let (points, distances) = set.held_out.beside();
    let row = |(p, d): (&Point, &Real)| {
        [&set.frame.to_unit(p)[..], &[(d * set.frame.scale) as f32]].concat()
    };
    std::fs::write(
        folder.join("held.f32"),
        bytes(points.iter().zip(distances).flat_map(row).collect()),
    )?;
    std::fs::write(folder.join("frame.json"), format!("{{\"scale\": {}}}", set.frame.scale))?;
    Ok(())
}

fn picture(
    field: &NeuralField<Network>,
    target: &TriMesh,
    path: &str,
) -> Result<(), Box<dyn Error>> {
    let region = field.bounds().ok_or("no bounds")?;
    let params = ExtractParams {
        region: Some(region),
        resolution: Resolution::Cell(0.005),
        ..ExtractParams::default()
    };
    let marched = extract(field, &params, &mut Silent)?;
    println!("(extracted: {} triangles)", marched.mesh.triangles().len());
    let views = [View::FRONT, View::THREE_QUARTER];
    for (mesh, path) in
        [(&marched.mesh, path.to_owned()), (target, path.replace(".png", "_target.png"))]
    {
        let layer = RenderLayer { mesh, color: PALETTE[0], highlight: &[] };
        let image = side_by_side(&[layer], &views, 700, 1000);
        image.write_png(std::io::BufWriter::new(std::fs::File::create(path)?))?;
    }
    Ok(())
}
