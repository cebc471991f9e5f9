//! What can be at fault with a wardrobe and what is made of it.

use crate::asset::AssetError;
use if_body::SkeletonError;
use if_body::SkinError;
use if_body::align::AlignError;
use if_core::math::Real;
use if_core::mesh::MeshError;
use if_core::monitor::Cancelled;
use if_core::parameter::ParameterError;
use if_mesh::file;
use if_mesh::ply;
use if_outfit::files::FilesError;
use if_outfit::outfit::OutfitError;
use if_outfit::resolve::ResolveError;
use if_render::PngError;
use std::io;
use std::path::PathBuf;

/// Why a wardrobe, or a combination from it, is of no use.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum WardrobeError {
    /// An asset is at fault.
    #[error(transparent)]
    Asset(#[from] AssetError),
    /// The system does not give or take a folder.
    #[error("{}: {source}", path.display())]
    Folder { path: PathBuf, source: io::Error },
    /// The system does not give or take something.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// Neither bodies nor garments, or no folder at all.
    #[error("there is no wardrobe `{}`: it has neither `bodies` nor `garments`", path.display())]
    NoWardrobe { path: PathBuf },
    /// Another process writes there.
    #[error("another process is writing into `{}`; wait for it", path.display())]
    Busy { path: PathBuf },
    /// No body of this name.
    #[error("the wardrobe has no body `{name}`; it has: {}", listed(known))]
    NoBody { name: String, known: String },
    /// No garment of this name.
    #[error("the wardrobe has no garment `{name}`; it has: {}", listed(known))]
    NoGarment { name: String, known: String },
    /// A garment made on a body that is not there.
    #[error(
        "garment `{garment}` was made on body `{body}` (SHA-256 {sha256}), which the wardrobe does not have; add it"
    )]
    ForeignBody { garment: String, body: String, sha256: String },
    /// A body's description is at fault.
    #[error("{}: {message}", path.display())]
    BodyInfo { path: PathBuf, message: String },
    /// A body's mesh is at fault.
    #[error("{}: {source}", path.display())]
    BodyMesh { path: PathBuf, source: Box<ply::ReadError> },
    /// A file that is to become a body cannot be read.
    #[error(transparent)]
    BodyFile(#[from] file::ReadError),
    /// A factor of units that is none.
    #[error("the scale is {scale}; give a positive number, such as 0.001 for files in millimetres")]
    ScaleRange { scale: Real },
    /// A mesh that is not finite in metres.
    #[error("{}: cannot be scaled by {scale}: {source}", path.display())]
    Scale { path: PathBuf, scale: Real, source: MeshError },
    /// A body that no outfit can have.
    #[error("{}: {source}", path.display())]
    Body { path: PathBuf, source: OutfitError },
    /// A body's weights are at fault.
    #[error("{}: {source}", path.display())]
    BodySkin { path: PathBuf, source: SkinError },
    /// A body's skeleton is at fault.
    #[error("{}: {source}", path.display())]
    Skeleton { path: PathBuf, source: SkeletonError },
    /// A combination without garments.
    #[error("the combination on body `{body}` has no garments; name one at least")]
    NoGarments { body: String },
    /// A garment that no outfit on its body can have.
    #[error(transparent)]
    Misfit(OutfitError),
    /// A garment that is named twice.
    #[error(
        "garment `{name}` stands twice in a combination; leave one out, or add it again under another name"
    )]
    Twice { name: String },
    /// A garment cannot be aligned.
    #[error("garment `{garment}` cannot be aligned on body `{body}`: {source}")]
    Align { garment: String, body: String, source: AlignError },
    /// The layers make no outfit.
    #[error("the combination makes no outfit: {0}")]
    Outfit(#[from] OutfitError),
    /// The outfit cannot be resolved.
    #[error("{0}")]
    Resolve(ResolveError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A file or folder of the user's stands where outputs go.
    #[error("`{}` is in the way: {what}", path.display())]
    InTheWay { path: PathBuf, what: &'static str },
    /// A picture cannot be written.
    #[error(transparent)]
    Picture(#[from] PngError),
    /// A mesh cannot be written.
    #[error(transparent)]
    Write(#[from] file::WriteError),
    /// A garment's file cannot hold the result.
    #[error(transparent)]
    Files(FilesError),
    /// The monitor cancelled. Nothing is recorded.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A report cannot be written.
    #[error("{message}")]
    Json { message: String },
    /// Too few combinations.
    #[error(
        "only {found} different combinations of {least} to {most} garments were found, {count} are wanted; ask for fewer, or for any order"
    )]
    TooFew { found: usize, count: usize, least: usize, most: usize },
    /// Numbers of garments that make no range.
    #[error(
        "combinations of {least} to {most} garments; the first must be at least 1 and not above the second"
    )]
    Sizes { least: usize, most: usize },
    /// A height of pictures that cannot be drawn.
    #[error("pictures {height} pixels high; draw none (0), or from 16 to 8192")]
    PictureHeight { height: u32 },
    /// A fault of this program.
    #[error("the program failed: {message}; please report it")]
    Panic { message: String },
}

impl WardrobeError {
    /// A word for the kind of error, for records.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Asset(_) => "asset",
            Self::Folder { .. } | Self::Io(_) => "io",
            Self::Busy { .. } => "busy",
            Self::NoWardrobe { .. } => "no_wardrobe",
            Self::InTheWay { .. } => "in_the_way",
            Self::NoBody { .. } => "no_body",
            Self::NoGarment { .. } => "no_garment",
            Self::ForeignBody { .. } => "foreign_body",
            Self::BodyInfo { .. }
            | Self::ScaleRange { .. }
            | Self::Scale { .. }
            | Self::BodyMesh { .. }
            | Self::BodyFile(_)
            | Self::Body { .. }
            | Self::BodySkin { .. }
            | Self::Skeleton { .. } => "body",
            Self::NoGarments { .. }
            | Self::Twice { .. }
            | Self::TooFew { .. }
            | Self::Sizes { .. } => "combination",
            Self::Align { .. } => "align",
            Self::Outfit(_) | Self::Misfit(_) => "outfit",
            Self::Resolve(ResolveError::Remaining { .. }) => "remaining",
            Self::Resolve(_) | Self::Files(_) => "resolve",
            Self::PictureHeight { .. } | Self::Parameter(_) => "parameter",
            Self::Picture(_) | Self::Write(_) | Self::Json { .. } => "write",
            Self::Cancelled(_) => "cancelled",
            Self::Panic { .. } => "panic",
        }
    }

    /// Whether a later run may do better without any change of the inputs: such an end is not kept.
    pub(crate) fn is_passing(&self) -> bool {
        matches!(self.kind(), "io" | "busy" | "write" | "cancelled")
    }
}

/// Names, or that there are none.
fn listed(names: &str) -> &str {
    if names.is_empty() { "none" } else { names }
}
