//! The command line.

use crate::reconstruct::ReconstructArgs;
use crate::wardrobe::WardrobeArgs;
use clap::builder::TypedValueParser;
use clap::{Args, Parser, Subcommand, ValueEnum};
use if_body::mannequin::Garment;
use if_core::math::Point;
use if_mesh::cleanup::boundary::MOST_PASSES;
use std::path::PathBuf;

const EXIT_CODES: &str = "\
Exit codes:
  0    clean: no intersecting triangle pairs and no vertex on a wrong side
  1    not clean: `check` found intersections, `fix`, `demo` and `wardrobe` could not remove all of
       them, or `fit` did not reach its --accuracy or diverged
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
    /// Say on stderr what is left of each garment at each verification, instead of a line of
    /// progress.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
}

#[derive(Subcommand, Debug)]
pub(crate) enum Command {
    /// Resolve the built-in scene: a mannequin in several layers with deep overlaps.
    Demo(DemoArgs),
    /// Resolve outfits: write each garment, free of intersections, under its own file name.
    Fix(FixArgs),
    /// Look at outfits without changing anything; exit code 0 clean, 1 not clean.
    Check(CheckArgs),
    /// Captures: a person who turns before a camera (docs/capture.md).
    #[command(subcommand)]
    Capture(CaptureCommand),
    /// Reconstruct a person and each garment from a capture of a turning video
    /// (docs/reconstruction.md).
    Reconstruct(ReconstructArgs),
    /// Keep bodies and garments in a folder, and combine them at will (docs/wardrobe.md).
    Wardrobe(WardrobeArgs),
    /// Cut a labelled mesh (.ply) into one mesh for each label, along smooth lines.
    Cut(CutArgs),
    /// Clean a garment that was cut out of a scan: isolated elements, holes, ragged boundary.
    Clean(CleanArgs),
    /// Fit a neural signed distance field to a mesh, and write it as a safetensors file.
    Fit(FitArgs),
    /// Extract the surface of a field as a mesh: remesh a closed mesh by its signed distance.
    Extract(ExtractArgs),
}

/// What to do with captures.
#[derive(Subcommand, Debug)]
pub(crate) enum CaptureCommand {
    /// Render the built-in scene as a capture: masks, labels and normals with noise, template and
    /// truth.
    Synth(SynthArgs),
}

#[derive(Args, Debug, Clone)]
pub(crate) struct CutArgs {
    /// The mesh (.ply), in metres, with a label at each vertex.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,
    /// Output folder: NAME.ply for each label, and pictures.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// The vertex property that holds the labels: 0 unknown, 1 skin, garments from 2 on.
    #[arg(long, value_name = "PROPERTY", default_value = "label")]
    pub(crate) labels: String,
    /// What a label is called, such as 2=trousers; once for each.
    #[arg(long = "name", value_name = "LABEL=NAME", value_parser = label_name)]
    pub(crate) names: Vec<(u8, String)>,
    /// How far labels are smoothed, with a unit; 0 cuts between the vertices as they are labelled.
    #[arg(long, value_name = "LENGTH", value_parser = length, default_value = "30mm")]
    pub(crate) smooth: f64,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw labels_before.png and labels_after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct SynthArgs {
    /// Output folder. It must not exist.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// What the mannequin wears, with commas; trousers, T-shirt and jacket by default.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "GARMENTS")]
    pub(crate) garments: Vec<Worn>,
    /// Pictures of one full turn.
    #[arg(long, value_name = "N", default_value_t = 24)]
    pub(crate) frames: usize,
    /// Pixels on each side.
    #[arg(long, value_name = "PIXELS", default_value_t = 256)]
    pub(crate) size: usize,
    /// How badly labels and masks are seen, from 0 to 1.
    #[arg(long, value_name = "NOISE", default_value_t = 0.3)]
    pub(crate) noise: f64,
    /// The same for the labels alone.
    #[arg(long, value_name = "NOISE")]
    pub(crate) label_noise: Option<f64>,
    /// The same for the masks alone.
    #[arg(long, value_name = "NOISE")]
    pub(crate) mask_noise: Option<f64>,
    /// How far clothes move by themselves, with a unit, such as 1cm; each frame as it is goes to
    /// truth/ then.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero)]
    pub(crate) nonrigid: Option<f64>,
    /// Another number, another noise and another motion.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(crate) seed: u64,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

/// What the mannequin can wear.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Worn {
    Trousers,
    Tshirt,
    Skirt,
    Jacket,
    Coat,
}

impl From<Worn> for Garment {
    fn from(worn: Worn) -> Self {
        match worn {
            Worn::Trousers => Self::Trousers,
            Worn::Tshirt => Self::Tshirt,
            Worn::Skirt => Self::Skirt,
            Worn::Jacket => Self::Jacket,
            Worn::Coat => Self::Coat,
        }
    }
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
    /// Any other parameter, as in the `params` table of an outfit file; may be given more than
    /// once.
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
pub(crate) struct CleanArgs {
    /// The garment (.ply, .obj), in metres.
    #[arg(value_name = "MESH")]
    pub(crate) file: PathBuf,
    /// The clean garment (.ply), with all properties of the vertices.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) open: Openness,
    /// The clothed body that the garment was cut from: a loop that bounds a large part of the rest
    /// of it is an opening. Instead of --openings, --longer and --open-at, but for --project.
    #[arg(long, value_name = "MESH")]
    pub(crate) body: Option<PathBuf>,
    /// Put patches and smoothed boundaries onto the surface of --body, which must be closed.
    #[arg(long)]
    pub(crate) project: bool,
    /// Drop parts with less than this share of the largest part's area, in percent.
    #[arg(long, value_name = "PERCENT", default_value_t = 1.0)]
    pub(crate) least_share: f64,
    /// Keep at most so many parts, the largest.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..).map(|n| n as usize))]
    pub(crate) parts: Option<usize>,
    /// Leave holes open.
    #[arg(long, conflicts_with = "Openness")]
    pub(crate) no_fill: bool,
    /// Leave the boundary as it is.
    #[arg(long)]
    pub(crate) no_smooth: bool,
    /// Smooth the whole surface but for its boundary, by so many passes of Laplacian smoothing.
    #[arg(long, value_name = "N", default_value_t = 0,
          value_parser = clap::value_parser!(u64).range(0..=MOST_PASSES as u64).map(|n| n as usize))]
    pub(crate) surface_passes: usize,
    /// Allow the output to replace the input.
    #[arg(long)]
    pub(crate) in_place: bool,
    /// Print the report as JSON on stdout, and no table.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw FILE_before.png and FILE_after.png.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

/// How openings are told from holes; by their shape where nothing is said.
#[derive(Args, Debug, Clone, Default)]
#[group(multiple = false)]
pub(crate) struct Openness {
    /// The garment has so many openings: 4 for a top or a dress, 3 for trousers, 2 for a skirt.
    #[arg(long, value_name = "N")]
    pub(crate) openings: Option<usize>,
    /// Loops from this length are openings, such as 20cm.
    #[arg(long, value_name = "LENGTH", value_parser = length, allow_hyphen_values = true)]
    pub(crate) longer: Option<f64>,
    /// The loop nearest to this point is an opening; once for each.
    #[arg(long, value_name = "X,Y,Z", value_parser = point, allow_hyphen_values = true)]
    pub(crate) open_at: Vec<Point>,
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
pub(crate) struct ExtractArgs {
    /// The field: a closed mesh (.ply, .obj), whose signed distance it is, or a network that `ifg
    /// fit` wrote (.safetensors).
    #[arg(value_name = "FIELD")]
    pub(crate) field: PathBuf,
    /// The mesh to write (.ply). Pictures come beside it, as .before.png (of a mesh) and
    /// .after.png, slivers in red.
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Side of the cells, with a unit: about the mean edge length that comes out.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, conflicts_with_all = ["cells", "accuracy"])]
    pub(crate) cell: Option<f64>,
    /// Cells along the longest side.
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = clap::value_parser!(u32).range(1..=16384),
          conflicts_with = "accuracy")]
    pub(crate) cells: u32,
    /// Choose the cells so that triangles are this near to the surface, with a unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero)]
    pub(crate) accuracy: Option<f64>,
    /// The smallest cells that --accuracy may choose, with a unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, default_value = "1mm", requires = "accuracy")]
    pub(crate) finest: f64,
    /// Rounds of relaxation, which make slivers into triangles; 0 is plain marching cubes.
    #[arg(long, value_name = "ROUNDS", default_value_t = 3, value_parser = clap::value_parser!(u64).range(0..=100).map(|n| n as usize))]
    pub(crate) relax: usize,
    /// Number of the layer: each has a lattice of its own, so that layers do not touch in
    /// degenerate ways.
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub(crate) layer: usize,
    /// Factor from the units of a mesh to metres; the output keeps its units. Networks are in
    /// metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    pub(crate) scale: Option<f64>,
    /// Print the report as JSON on stdout, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
    /// Do not draw pictures.
    #[arg(long)]
    pub(crate) no_pictures: bool,
}

#[derive(Args, Debug, Clone)]
pub(crate) struct FitArgs {
    /// The mesh (.ply, .obj), in metres, wound outwards. Of an open mesh, such as a scan, the
    /// vertices are fitted as points with normals: noise is averaged and holes are closed.
    #[arg(value_name = "MESH")]
    pub(crate) mesh: PathBuf,
    /// Where to write the network (.safetensors).
    #[arg(short, long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Time for the whole fit; 60 where neither steps nor an accuracy are given, 600 with an
    /// accuracy.
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub(crate) seconds: Option<f64>,
    /// Stop as soon as the mean error near the surface is at most this: 0.5mm, 0.0005m; metres
    /// without unit.
    #[arg(long, value_name = "LENGTH", value_parser = above_zero, allow_hyphen_values = true)]
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
    /// Store the fit here (.safetensors) once a minute and on Ctrl-C, so that --resume can go on
    /// with it.
    #[arg(long, value_name = "FILE")]
    pub(crate) checkpoint: Option<PathBuf>,
    /// Go on with the fit that --checkpoint stored: the same mesh, --points and --scale must be
    /// given; network, seed and limits are those of the fit.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["seconds", "accuracy", "steps", "network", "seed"])]
    pub(crate) resume: Option<PathBuf>,
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
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value.is_finite() && value > 0.0 => Ok(value),
        _ => Err("give a positive number, such as 0.001".into()),
    }
}

/// A length in metres from text with a unit.
fn length(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let unit_at =
        text.find(|c: char| c.is_ascii_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
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

/// Three coordinates in metres, with commas between them.
fn point(text: &str) -> Result<Point, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|x| x.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z] if text.split(',').count() == 3 && [x, y, z].iter().all(|x| x.is_finite()) => {
            Ok(Point::new(x, y, z))
        }
        _ => Err("give three numbers, such as 0.1,1.2,-0.05".into()),
    }
}

/// `2=trousers`.
fn label_name(text: &str) -> Result<(u8, String), String> {
    let (label, name) = text.split_once('=').ok_or("give LABEL=NAME, such as 2=trousers")?;
    match label.trim().parse::<u8>() {
        Ok(label @ 1..=254) => Ok((label, name.trim().to_owned())),
        _ => Err("a label is a whole number from 1 to 254".into()),
    }
}

/// A length above zero.
pub(crate) fn above_zero(text: &str) -> Result<f64, String> {
    length(text).and_then(|value| {
        if value > 0.0 { Ok(value) } else { Err("a length above zero is needed".into()) }
    })
}

/// `key=value` with a TOML value, or a word without quotes; dots in the key step into groups.
fn assignment(text: &str) -> Result<(String, toml::Value), String> {
    let (key, value) = text.split_once('=').ok_or("give KEY=VALUE, such as clearance=0.0005")?;
    let (key, value) = (key.trim().to_owned(), value.trim());
    let parsed =
        format!("v = {value}").parse::<toml::Table>().map(|table| table.into_iter().next());
    match parsed {
        Ok(Some((_, value))) => Ok((key, value)),
        Ok(None) => Err("the value is empty".into()),
        Err(_)
            if value.starts_with(|c: char| c.is_ascii_alphabetic())
                && value.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') =>
        {
            Ok((key, value.into()))
        }
        Err(e) => Err(format!(
            "the value is not TOML ({}); text with other characters than letters needs quotes inside the shell's quotes",
            e.message()
        )),
    }
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
    fn assignments_are_toml_or_words() {
        assert_eq!(assignment("split=if_left").unwrap(), ("split".into(), "if_left".into()));
        assert_eq!(assignment(" a.b = \"two words\"").unwrap(), ("a.b".into(), "two words".into()));
        assert_eq!(assignment("rounds=3"), Ok(("rounds".into(), toml::Value::Integer(3))));
        assert_eq!(assignment("a.b = true"), Ok(("a.b".into(), toml::Value::Boolean(true))));
        assert_eq!(assignment("skip=false").unwrap().1, toml::Value::Boolean(false));
        assert_eq!(assignment("clearance=5e-4").unwrap().1, toml::Value::Float(5e-4));
        for text in ["rounds", "rounds=", "split=two words", "split=-x", "split=3d"] {
            assert!(assignment(text).is_err(), "{text}");
        }
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
    fn points_have_three_coordinates() {
        assert_eq!(point("0.1, -2,3e-1"), Ok(Point::new(0.1, -2.0, 0.3)));
        for text in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan"] {
            assert!(point(text).is_err(), "{text}");
        }
    }

    #[test]
    fn labels_have_names() {
        assert_eq!(label_name("2 = trousers"), Ok((2, "trousers".into())));
        for text in ["trousers", "0=skin", "255=x", "two=x"] {
            assert!(label_name(text).is_err(), "{text}");
        }
    }
}
