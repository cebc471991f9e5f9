//! The arguments of `ifg wardrobe`.

use crate::args::{ParamArgs, positive};
use clap::{Args, Subcommand, ValueEnum};
use if_pipeline::asset::GarmentClass;
use std::path::PathBuf;

#[derive(Args, Debug)]
pub(crate) struct WardrobeArgs {
    #[command(subcommand)]
    pub(crate) command: WardrobeCommand,
}

#[derive(Subcommand, Debug)]
pub(crate) enum WardrobeCommand {
    /// Add a body, or garments that were made on it, or both; what is there under the same name is
    /// replaced.
    Add(AddArgs),
    /// Tell what is there.
    List(ListArgs),
    /// Put garments on a body, inner to outer, and make them intersection-free.
    Match(MatchArgs),
    /// Do many combinations; a run that was stopped goes on where it was.
    Batch(BatchArgs),
}

#[derive(Args, Debug)]
pub(crate) struct AddArgs {
    /// The wardrobe's folder; made where it is missing.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Garments (.ply, .obj) in the canonical pose of the body, in metres or with --scale. Each is
    /// called after its file.
    #[arg(value_name = "GARMENTS", required_unless_present = "mesh")]
    pub(crate) garments: Vec<PathBuf>,
    /// The body that the garments were made on.
    #[arg(long, value_name = "NAME")]
    pub(crate) body: String,
    /// Adds the body, with this mesh (.ply, .obj): closed, in metres or with --scale.
    #[arg(long, value_name = "FILE")]
    pub(crate) mesh: Option<PathBuf>,
    /// A mesh (.ply, .obj) of the same body whose topology other bodies share.
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) template: Option<PathBuf>,
    /// Its joints (skeleton.json).
    #[arg(long, value_name = "FILE", requires = "mesh")]
    pub(crate) skeleton: Option<PathBuf>,
    /// Factor from the units of all these files to metres, such as 0.01 for centimetres; the
    /// wardrobe is in metres.
    #[arg(long, value_name = "FACTOR", value_parser = positive, default_value_t = 1.0)]
    pub(crate) scale: f64,
    /// Put before each garment's name.
    #[arg(long, value_name = "TEXT", default_value = "")]
    pub(crate) prefix: String,
    /// Where the garments are worn; by default their names tell (jeans, tshirt, coat …).
    #[arg(long, value_enum)]
    pub(crate) class: Option<Class>,
    /// Place within the class, 0 next to the skin; by default their names tell.
    #[arg(long, value_name = "N")]
    pub(crate) order: Option<u8>,
    /// Bake the field of the clothed body beside each garment.
    #[arg(long)]
    pub(crate) bake: bool,
}

/// [`GarmentClass`] as an argument.
#[derive(ValueEnum, Clone, Copy, Debug)]
pub(crate) enum Class {
    Legs,
    Skirt,
    Dress,
    Top,
    Outer,
    Other,
}

impl From<Class> for GarmentClass {
    fn from(class: Class) -> Self {
        match class {
            Class::Legs => Self::Legs,
            Class::Skirt => Self::Skirt,
            Class::Dress => Self::Dress,
            Class::Top => Self::Top,
            Class::Outer => Self::Outer,
            Class::Other => Self::Other,
        }
    }
}

#[derive(Args, Debug)]
pub(crate) struct ListArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Print one JSON object, and no table.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct MatchArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Names of garments, innermost first.
    #[arg(value_name = "GARMENTS", required = true)]
    pub(crate) garments: Vec<String>,
    /// Name of the body.
    #[arg(long, value_name = "NAME")]
    pub(crate) body: String,
    /// Output folder; the files of a result that stands there are replaced by those of one that is
    /// no worse.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// Write the meshes even where intersections are left.
    #[arg(long)]
    pub(crate) write_unproven: bool,
    /// Do it again even if it is done.
    #[arg(long)]
    pub(crate) again: bool,
    /// Print the result as JSON, and no tables.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Debug)]
pub(crate) struct BatchArgs {
    /// The wardrobe's folder.
    #[arg(value_name = "WARDROBE")]
    pub(crate) root: PathBuf,
    /// Output folder; what is done there already is taken.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
    /// A list of combinations (.toml or .json).
    #[arg(
        long,
        value_name = "FILE",
        required_unless_present = "random",
        conflicts_with = "random"
    )]
    pub(crate) list: Option<PathBuf>,
    /// Draw this many combinations.
    #[arg(long, value_name = "N")]
    pub(crate) random: Option<usize>,
    /// For --random: the same seed draws the same.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "random")]
    pub(crate) seed: u64,
    /// For --random: garments at least.
    #[arg(long, value_name = "N", default_value_t = 2, requires = "random")]
    pub(crate) least: usize,
    /// For --random: garments at most.
    #[arg(long, value_name = "N", default_value_t = 4, requires = "random")]
    pub(crate) most: usize,
    /// For --random: any order and any garments, also a coat below a T-shirt.
    #[arg(long, requires = "random")]
    pub(crate) any_order: bool,
    /// For --random: bodies, which take turns; all by default.
    #[arg(long, value_name = "NAME", requires = "random")]
    pub(crate) body: Vec<String>,
    #[command(flatten)]
    pub(crate) params: ParamArgs,
    /// Combinations done at once. More than one takes more memory, and pays where single steps do
    /// not fill all cores.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(crate) at_once: u16,
    /// Do everything again.
    #[arg(long)]
    pub(crate) again: bool,
    /// Do not write meshes.
    #[arg(long)]
    pub(crate) no_meshes: bool,
    /// Do not draw.
    #[arg(long)]
    pub(crate) no_pictures: bool,
    /// Print one JSON line for each combination.
    #[arg(long)]
    pub(crate) json: bool,
}
