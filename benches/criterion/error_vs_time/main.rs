//! Run time against error: every setting that trades the one for the other, on problems with known
//! answers.
//!
//! ```sh
//! # all; about half an hour
//! cargo bench -p if-benches --bench error_vs_time -- --out docs/evidence/records/NAME
//! # some, into the system's temporary folder
//! cargo bench -p if-benches --bench error_vs_time -- --only cloth,extract
//! # coarse: some minutes
//! cargo bench -p if-benches --bench error_vs_time -- --quick
//! # processor time, where others compute too
//! RAYON_NUM_THREADS=1 cargo bench -p if-benches --bench error_vs_time -- --processor
//! ```
//!
//! OUT gets `runs.csv` (one row a run: problem, method, parameter, milliseconds, error, its unit,
//! evaluations, skipped, whether it is the default), an SVG for each problem, and `pareto.md`, the
//! runs that no other beats in both.
//!
//! Times are medians of at least three runs where a run takes less than half a second, and single
//! runs else; wall time, unless `--processor` is given. Outfits come from `../shared/data/body_a`
//! where that is there, and always from the built-in scene.

#![allow(clippy::print_stdout, clippy::unwrap_used)] // a program for the terminal, on problems that are known to be sound

mod bending;
mod chains;
mod cloth;
mod contact;
mod fields;
mod implicit;
mod invariants;
mod networks;
mod outfits;
mod plot;
mod predicates;
mod record;
mod row;

use record::Record;
use std::error::Error;
use std::path::PathBuf;

/// A name to choose it by, or its beginning, and what it runs.
type Part = (&'static str, fn(&mut Record));

const PARTS: [Part; 11] = [
    ("bending", bending::run),
    ("chains", chains::run),
    ("cloth", cloth::run),
    ("contact", contact::run),
    ("fields", fields::run),
    ("invariants", invariants::run),
    ("networks", networks::run),
    ("outfits-demo", outfits::demo),
    ("outfits-o1", outfits::o1),
    ("outfits-o5", outfits::o5),
    ("predicates", predicates::run),
];

fn main() -> Result<(), Box<dyn Error>> {
    let (mut out, mut only, mut quick) = (None, Vec::new(), false);
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--out" => out = Some(PathBuf::from(args.next().ok_or("--out needs a folder")?)),
            "--only" => {
                only =
                    args.next().ok_or("--only needs names")?.split(',').map(str::to_owned).collect()
            }
            "--quick" => quick = true,
            "--processor" => record::count_processor_time()?,
            "--bench" => {} // cargo says so
            _ => return Err(format!(
                "`{arg}` is not understood: --out FOLDER, --only NAME,NAME, --quick, --processor"
            )
            .into()),
        }
    }
    if let Some(unknown) =
        only.iter().find(|name| !PARTS.iter().any(|(part, _)| part.starts_with(name.as_str())))
    {
        let known: Vec<&str> = PARTS.iter().map(|(part, _)| *part).collect();
        return Err(format!("no part is called `{unknown}`; there are {}", known.join(", ")).into());
    }
    let out = out.unwrap_or_else(|| std::env::temp_dir().join("error_vs_time"));
    let mut record = Record::new(quick);
    for (name, run) in PARTS {
        if only.is_empty() || only.iter().any(|o| name.starts_with(o.as_str())) {
            println!("== {name}");
            run(&mut record);
            record.write(&out)?; // so far
        }
    }
    println!("Wrote {}: runs.csv, pareto.md and a picture for each problem", out.display());
    Ok(())
}
