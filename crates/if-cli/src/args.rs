//! The command line.

use crate::wardrobe::WardrobeArgs;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

const EXIT_CODES: &str = "\
Exit codes:
  0    clean: no intersecting triangle pairs and no vertex on a wrong side
  1    not clean: `check` found intersections, `fix` and `demo` could not remove all of them, or
       `fit` did not reach its --accuracy
  2    unusable: arguments, an input, or the output folder; the message names file and cause
  130  cancelled by Ctrl-C or SIGTERM; nothing half-written is left

Formats of outfit.toml and receipt.json: docs/outfit.md";

/// Makes layered garments intersection-free, and proves it.
#[derive(Parser, Debug)]
#[command(name = "ifg", version, after_help = EXIT_CODES, max_term_width = 100)]
pub(crate) struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Number of threads; all cores by default. Results do not depend on it.
    #[arg(short = 'j', long, visible_alias = "jobs", global = true, value_name = "N",
          value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Resolve the built-in scene: a mannequin in several layers with deep overlaps.
    Demo(DemoArgs),
    /// Resolve outfits: write each garment, free of intersections, under its own file name.
    Fix(FixArgs),
    /// Look at outfits without changing anything; exit code 0 clean, 1 not clean.
    Check(CheckArgs),
    /// Keep bodies and garments in a folder, and combine them at will (docs/wardrobe.md).
    Wardrobe(WardrobeArgs),
    /// Fit a neural signed distance field to a mesh, and write it as a safetensors file.
    Fit(FitArgs),
}

/// Which outfits.
#[derive(Args, Debug, Clone)]
pub(crate) struct InputArgs {
    /// Outfit files (.toml); or, with --body, the garments (.ply, .obj), innermost first.
    #[arg(required = true, value_name = "FILES")]
    pub(crate) files: Vec<PathBuf>,
    /// The body: closed, wound outwards, in metres. It never moves.
    #[arg(long, value_name = "MESH")]
    pub(crate) body: Option<PathBuf>,
    /// Factor from the units of the files to metres, such as 0.001 for millimetres; output files
    /// keep the units of the input.
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    pub(crate) scale: Option<f64>,
    /// Print reports as JSON on stdout, one line an outfit, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What to aim at.
#[derive(Args, Debug, Clone, Default)]
pub(crate) struct ParamArgs {
    /// Gap to keep between layers, with a unit: 0.5mm, 0.0005m; metres without one.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) clearance: Option<f64>,
    /// Any other parameter, as in the `params` table of an outfit file; may be given more than once.
    #[arg(long, value_name = "KEY=VALUE", value_parser = assignment)]
    pub(crate) set: Vec<(String, toml::Value)>,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct FixArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// Output folder. Several outfits go into one folder each below it, named after their files.
    /// Default for outfit files: `out/NAME`; needed with --body.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Allow outputs to replace the input files.
    #[arg(long)]
    pub(crate) in_place: bool,
    /// Write what was reached even where intersections are left (the exit code is 1 all the same).
    #[arg(long)]
    pub(crate) write_unproven: bool,
    /// In a batch, do finished outfits again.
    #[arg(long)]
    pub(crate) again: bool,
    /// Do not draw before.png and after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) input: InputArgs,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct DemoArgs {
    /// Output folder.
    #[arg(short, long, value_name = "DIR", default_value = "out/demo")]
    pub(crate) out: PathBuf,
    /// T-shirt, skirt, jacket and coat; or trousers, T-shirt, jacket and coat.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) variant: Variant,
    /// How fine the meshes are: coarse has half, fine four times the triangles of normal.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) size: Size,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// Print the report as JSON on stdout, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw before.png and after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct FitArgs {
    /// The mesh (.ply, .obj), in metres, wound outwards. Of an open mesh, such as a scan, the vertices are
    /// fitted as points with normals: noise is averaged and holes are closed.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,
    /// Where to write the network (.safetensors).
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Time for the whole fit; 60 where neither steps nor an accuracy are given, 600 with an accuracy.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: Option<f64>,
    /// Stop as soon as the mean error near the surface is at most this: 0.5mm, 0.0005m; metres without unit.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) accuracy: Option<f64>,
    /// Stop after so many steps; the same steps give the same bits, on any number of threads.
    #[arg(long, value_name = "N", conflicts_with = "seconds")]
    pub(crate) steps: Option<u64>,
    /// Which network.
    #[arg(long, value_enum, default_value_t)]
    pub(crate) network: NetworkName,
    /// Fit the vertices as points even where the mesh is closed.
    #[arg(long)]
    pub(crate) points: bool,
    /// Factor from the units of the file to metres; the network is in metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    pub(crate) scale: Option<f64>,
    /// Seed of sampling and first values.
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Networks of `fit`.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum NetworkName {
    /// Features on grids with a small network: the most accurate in a given time.
    #[default]
    Grid,
    /// The network of Appendix E, 256 wide.
    Fast,
    /// The network of Appendix E, 512 wide.
    Paper,
}

/// Scenes of the demo.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Variant {
    #[default]
    Skirt,
    Trousers,
}

/// Sizes of the demo.
#[derive(ValueEnum, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Size {
    Coarse,
    #[default]
    Normal,
    Fine,
}

/// A positive, finite factor.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive number, such as 0.001".into()),
    }
}

/// A length in metres from text with a unit.
fn length(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let unit_at = text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    // Divided, not multiplied: 0.5 / 1000 is the nearest number to 0.0005, 0.5 · 0.001 need not be.
    let per_metre = match unit {
        "" | "m" => 1.0,
        "cm" => 100.0,
        "mm" => 1000.0,
        "um" => 1e6,
        _ => return Err(format!("unit `{unit}` is unknown; use m, cm, mm or um")),
    };
    match number.trim().parse::<f64>() {
        Ok(value) if value < 0.0 => Err("a length cannot be negative".into()),
        Ok(value) if value.is_finite() => Ok(value / per_metre),
        _ => Err(format!("`{}` is not a number; give a length such as 0.5mm", number.trim())),
    }
}

/// `key=value` with a TOML value; dots in the key step into groups.
fn assignment(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text.split_once('=').ok_or("give KEY=VALUE, such as clearance=0.0005")?;
    let table: toml::Table = format!("v = {}", value.trim()).parse().map_err(|e: toml::de::Error| {
        format!("the value is not TOML ({}); text needs quotes inside the shell's quotes", e.message())
    })?;
    let value = table.into_iter().next().ok_or("the value is empty")?.1;
    Ok((key.trim().to_owned(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        use clap::CommandFactory;
        Cli::command().debug_assert();
    }

    #[test]
    fn lengths_have_units() {
        for text in ["0.5mm", "0.0005", "0.0005m", "0.05 cm", "5e-4", "5e-4m", "500um"] {
            assert_eq!(length(text), Ok(0.0005), "{text}");
        }
        for text in ["", "mm", "0.5ft", "nan", "inf", "1 2mm", "0.5 mm mm", "-1mm"] {
            assert!(length(text).is_err(), "{text}");
        }
    }

    #[test]
    fn assignments_are_toml() {
        assert_eq!(assignment("rounds=3"), Ok(("rounds".into(), toml::Value::Integer(3))));
        assert_eq!(assignment("a.b = true"), Ok(("a.b".into(), toml::Value::Boolean(true))));
        for text in ["rounds", "rounds=", "rounds=three"] {
            assert!(assignment(text).is_err(), "{text}");
        }
    }
}
