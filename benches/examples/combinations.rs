//! Resolves every ordered choice of 2 to 4 garments of `../shared/data/body_a` that a person could
//! wear, and writes one CSV row for each.
//!
//! ```text
//! cargo run --release -p if-benches --example combinations -- OUT.csv [--every N] \
//!     [--only "A < B < C"]... [--data DIR] [--tuck never|if_stuck|always]
//! ```
//!
//! Rows that OUT.csv holds already are skipped, so that a run can be continued; start a new file
//! after a change of the resolver. `--every N` takes each N-th outfit only, `--only` the one named
//! (several may be). The exit code is 1 where an outfit does not come out clean. A panic ends the
//! run.

#![allow(clippy::print_stdout)] // a program for the terminal

use if_core::monitor::Silent;
use if_mesh::file::MeshFile;
use if_mesh::ply::{CoordinateType, quantise};
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::resolve::{ResolveError, ResolveParams, Resolved, Tuck, resolve};
use if_outfit::storage::Storage;
use if_outfit::verify::verify;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// What a garment is worn as. The order is that of [`Class::GARMENTS`].
#[derive(Clone, Copy, PartialEq, Eq)]
enum Class {
    Legs,
    Skirt,
    Dress,
    Top,
    Outer,
}

impl Class {
    /// All garments, in the order in which those of one class are worn over each other.
    const GARMENTS: [(&str, Class); 13] = [
        ("shorts", Class::Legs),
        ("jeans", Class::Legs),
        ("trousers", Class::Legs),
        ("suit_trousers", Class::Legs),
        ("pencil_skirt", Class::Skirt),
        ("flared_skirt", Class::Skirt),
        ("dress", Class::Dress),
        ("tshirt", Class::Top),
        ("blouse", Class::Top),
        ("sweater", Class::Top),
        ("cardigan", Class::Outer),
        ("suit_jacket", Class::Outer),
        ("coat", Class::Outer),
    ];

    /// Whether garment `outer` may be worn right or further above garment `inner`, and in one
    /// outfit with it.
    fn may_cover(inner: usize, outer: usize) -> bool {
        use Class::{Dress, Legs, Outer, Skirt, Top};
        let ((inner_name, a), (_, b)) = (Self::GARMENTS[inner], Self::GARMENTS[outer]);
        match (a, b) {
            // One pair of trousers, one skirt or dress.
            (Legs, Legs) | (Skirt | Dress, Skirt | Dress) => false,
            // Skirts and dresses go over trousers, outer layers over all.
            (Skirt | Dress, Legs) | (Outer, Legs | Skirt | Dress | Top) => false,
            // The T-shirt goes below the blouse, that below the sweater; cardigan, jacket, coat
            // likewise.
            (Top, Top) | (Outer, Outer) => inner < outer,
            // Thin tops can be tucked in; a sweater hangs over.
            (Top, Legs | Skirt | Dress) => inner_name != "sweater",
            (Legs | Skirt | Dress, Top)
            | (Legs, Skirt | Dress)
            | (Legs | Skirt | Dress | Top, Outer) => true,
        }
    }

    /// Whether the garments cover both halves of the body.
    fn is_dressed(outfit: &[usize]) -> bool {
        let wears =
            |classes: &[Class]| outfit.iter().any(|g| classes.contains(&Self::GARMENTS[*g].1));
        wears(&[Class::Legs, Class::Skirt, Class::Dress])
            && wears(&[Class::Dress, Class::Top, Class::Outer])
    }
}

/// All outfits of 2 to 4 garments by the rule, each inner to outer, in lexicographic order.
fn outfits() -> Vec<Vec<usize>> {
    let mut found = Vec::new();
    let mut grow: Vec<Vec<usize>> = (0..Class::GARMENTS.len()).rev().map(|g| vec![g]).collect();
    while let Some(outfit) = grow.pop() {
        if outfit.len() >= 2 && Class::is_dressed(&outfit) {
            found.push(outfit.clone());
        }
        if outfit.len() < 4 {
            for g in (0..Class::GARMENTS.len()).rev() {
                if !outfit.contains(&g) && outfit.iter().all(|inner| Class::may_cover(*inner, g)) {
                    grow.push(outfit.iter().copied().chain([g]).collect());
                }
            }
        }
    }
    found
}

struct Args {
    out: PathBuf,
    every: usize,
    only: Vec<String>,
    data: PathBuf,
    tuck: Tuck,
}

fn args() -> Result<Args, Box<dyn Error>> {
    let (mut out, mut only) = (None, Vec::new());
    let (mut every, mut data, mut tuck) =
        (1, PathBuf::from("../shared/data/body_a"), Tuck::default());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--every" => every = args.next().ok_or("--every needs a number")?.parse()?,
            "--only" => only.push(args.next().ok_or("--only needs an outfit")?),
            "--data" => data = args.next().ok_or("--data needs a folder")?.into(),
            "--tuck" => {
                tuck = serde_json::from_value(
                    args.next().ok_or("--tuck needs never, if_stuck or always")?.into(),
                )?
            }
            _ if out.is_none() => out = Some(PathBuf::from(arg)),
            _ => return Err(format!("`{arg}` is not understood").into()),
        }
    }
    let out = out.ok_or("usage: combinations OUT.csv [--every N] [--only OUTFIT] [--data DIR] [--tuck never|if_stuck|always]")?;
    if every == 0 {
        return Err("--every needs a number above 0".into());
    }
    Ok(Args { out, every, only, data, tuck })
}

const HEADER: &str = "outfit,state,pairs_before,inside_before,pairs,inside,worst,own_pairs_added,moved_max_mm,strain_max_percent,rounds,seconds,\
     strain_rms_percent,strain_p99_percent,tucked";

fn main() -> Result<ExitCode, Box<dyn Error>> {
    let args = args()?;
    let body = load(&args.data.join("body_clean.ply"), "body")?;
    let mut layers = BTreeMap::new();
    for (name, _) in Class::GARMENTS {
        layers.insert(name, load(&args.data.join("garments").join(format!("{name}.ply")), name)?);
    }
    let mut done = rows(&args.out)?;
    let known: BTreeSet<String> = done.iter().map(|r| r[0].clone()).collect();
    let mut file = OpenOptions::new().create(true).append(true).open(&args.out)?;
    if file.metadata()?.len() == 0 {
        writeln!(file, "{HEADER}")?;
    }
    let all = outfits();
    let names =
        |garments: &[usize]| garments.iter().map(|g| Class::GARMENTS[*g].0).collect::<Vec<_>>();
    let named = |garments: &[usize]| {
        args.only.is_empty() || args.only.contains(&names(garments).join(" < "))
    };
    let chosen: Vec<&Vec<usize>> = all.iter().step_by(args.every).filter(|o| named(o)).collect();
    println!(
        "{} wearable outfits, {} chosen, {} rows in {}",
        all.len(),
        chosen.len(),
        known.len(),
        args.out.display()
    );
    for (k, garments) in chosen.iter().enumerate() {
        let names = names(garments);
        let title = names.join(" < ");
        if known.contains(&title) {
            continue;
        }
        let outfit = Outfit {
            body: body.clone(),
            garments: names.iter().map(|n| layers[n].clone()).collect(),
        };
        let row = row(&title, &outfit, args.tuck)?;
        writeln!(file, "{}", row.join(","))?;
        if row[1] != "clean" {
            println!("{}/{} {title}: {}", k + 1, chosen.len(), row[1..].join(","));
        }
        done.push(row);
    }
    let failures = summary(&done);
    Ok(ExitCode::from(u8::from(failures > 0)))
}

fn load(path: &Path, name: &str) -> Result<Layer, Box<dyn Error>> {
    let mesh = MeshFile::read(path)?.mesh().clone();
    // As `ifg fix` does: the files hold single precision.
    let rounded = quantise(mesh.vertices(), CoordinateType::Float);
    Ok(Layer { name: name.to_owned(), mesh: mesh.with_vertices(rounded)?, storage: Storage::F32 })
}

/// Finished rows of an earlier run; none where there is no file.
fn rows(path: &Path) -> Result<Vec<Vec<String>>, Box<dyn Error>> {
    let text = if path.exists() { fs::read_to_string(path)? } else { String::new() };
    let columns = HEADER.split(',').count();
    let rows = text.lines().skip(1).map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    let rows: Vec<_> = rows.collect();
    match rows.iter().position(|r| r.len() != columns) {
        Some(k) => {
            Err(format!("{}: line {} has not {columns} columns", path.display(), k + 2).into())
        }
        None => Ok(rows),
    }
}

fn row(title: &str, outfit: &Outfit, tuck: Tuck) -> Result<Vec<String>, Box<dyn Error>> {
    let start = Instant::now();
    let mut params = ResolveParams::default();
    params.goal.tuck = tuck;
    let outcome = resolve(outfit, &params, &mut Silent);
    let seconds = start.elapsed().as_secs_f64();
    let (state, resolved): (&str, Resolved) = match outcome {
        Ok(resolved) => ("clean", resolved),
        Err(ResolveError::Unresolved { result, .. }) => ("left", *result),
        Err(error) => return Err(format!("{title}: {error}").into()),
    };
    // Not what the report says, but what the meshes are.
    let after = verify(&resolved.outfit)?;
    let state = if state == "clean" && !after.is_clean() { "wrongly called clean" } else { state };
    let worst = after.pairs.iter().filter(|p| p.pairs.total() + p.vertices_inside > 0);
    let worst =
        worst.max_by_key(|p| (p.pairs.total(), p.vertices_inside)).map_or(String::new(), |p| {
            format!(
                "{} over {}: {} pairs {} inside",
                p.outer,
                p.inner,
                p.pairs.total(),
                p.vertices_inside
            )
        });
    let report = &resolved.report;
    let own = report.layers.iter().map(|l| l.own_pairs.new).sum::<usize>();
    let largest = |of: fn(&if_outfit::report::LayerReport) -> f64| {
        report.layers.iter().map(of).fold(0.0, f64::max)
    };
    Ok(vec![
        title.to_owned(),
        state.to_owned(),
        report.before.total_pairs().to_string(),
        report.before.total_inside().to_string(),
        after.total_pairs().to_string(),
        after.total_inside().to_string(),
        worst,
        own.to_string(),
        format!("{:.2}", largest(|l| l.moved.max) * 1e3),
        format!("{:.2}", largest(|l| l.strain.max) * 1e2),
        report.layers.iter().map(|l| l.rounds).max().unwrap_or(0).to_string(),
        format!("{seconds:.3}"),
        format!("{:.3}", largest(|l| l.strain.rms) * 1e2),
        format!("{:.3}", largest(|l| l.strain.p99) * 1e2),
        report.layers.iter().filter(|l| l.tucked[0] > 0).count().to_string(),
    ])
}

/// Prints the figures of `docs/evidence/outfits.md`. Returns how many outfits are not clean.
fn summary(rows: &[Vec<String>]) -> usize {
    let number = |row: &Vec<String>, k: usize| row[k].parse::<f64>().unwrap_or(f64::NAN);
    let sorted = |k: usize| {
        let mut column: Vec<f64> = rows.iter().map(|r| number(r, k)).collect();
        column.sort_by(f64::total_cmp);
        column
    };
    let at = |column: &[f64], share: f64| {
        column.get((share * (column.len() as f64 - 1.0)).round() as usize).copied().unwrap_or(0.0)
    };
    let failures: Vec<&Vec<String>> = rows.iter().filter(|r| r[1] != "clean").collect();
    let share = 100.0 * (rows.len() - failures.len()) as f64 / rows.len().max(1) as f64;
    println!("outfits                {}", rows.len());
    println!("clean                  {} ({share:.2} %)", rows.len() - failures.len());
    println!(
        "clean as they came     {}",
        rows.iter().filter(|r| number(r, 2) + number(r, 3) == 0.0).count()
    );
    println!("pairs before           {}", sorted(2).iter().sum::<f64>());
    println!("pairs left             {}", sorted(4).iter().sum::<f64>());
    println!(
        "own pairs added        {} in {} outfits",
        sorted(7).iter().sum::<f64>(),
        rows.iter().filter(|r| number(r, 7) > 0.0).count()
    );
    for (name, k, unit) in [
        ("largest displacement", 8, "mm"),
        ("largest strain", 9, "%"),
        ("strain, rms", 12, "%"),
        ("strain, p99", 13, "%"),
        ("rounds", 10, ""),
        ("seconds", 11, "s"),
    ] {
        let c = sorted(k);
        println!(
            "{name:<22} median {:.2}, p95 {:.2}, max {:.2} {unit}",
            at(&c, 0.5),
            at(&c, 0.95),
            at(&c, 1.0)
        );
    }
    println!(
        "layers were pressed in {} outfits",
        rows.iter().filter(|r| number(r, 14) > 0.0).count()
    );
    println!("seconds in all         {:.0}", sorted(11).iter().sum::<f64>());
    println!("peak memory            {}", peak_memory());
    for row in &failures {
        println!("  {}: {} ({})", row[1], row[0], row[6]);
    }
    failures.len()
}

/// The most memory that this process held, where the system tells.
fn peak_memory() -> String {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let kib = status
        .lines()
        .find_map(|l| l.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    kib.map_or("unknown".to_owned(), |k| format!("{:.0} MiB", k / 1024.0))
}
