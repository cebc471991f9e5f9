//! The error of wardrobes.

use crate::asset::AssetError;
use if_body::NotUpright;
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

/// A wardrobe or combination is invalid, or cannot be read, written or resolved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum WardrobeError {
    /// An asset is invalid.
    #[error(transparent)]
    Asset(#[from] AssetError),
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Folder { path: PathBuf, source: io::Error },
    /// Something cannot be read or written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The folder is missing, or not a wardrobe.
    #[error("`{}` is not a wardrobe: it has neither `bodies` nor `garments`", path.display())]
    NoWardrobe { path: PathBuf },
    /// Another process writes into the wardrobe.
    #[error("another process is writing into `{}`; wait for it", path.display())]
    Busy { path: PathBuf },
    /// There is no body of this name.
    #[error("the wardrobe has no body `{name}`; it has: {}", listed(known))]
    NoBody { name: String, known: String },
    /// There is no garment of this name.
    #[error("the wardrobe has no garment `{name}`; it has: {}", listed(known))]
    NoGarment { name: String, known: String },
    /// The body that a garment was made on is missing.
    #[error(
        "garment `{garment}` was made on body `{body}` (SHA-256 {sha256}), which the wardrobe does not have; add it"
    )]
    ForeignBody { garment: String, body: String, sha256: String },
    /// The metadata of a body is invalid.
    #[error("{}: {message}", path.display())]
    BodyInfo { path: PathBuf, message: String },
    /// The mesh of a body is invalid.
    #[error("{}: {source}", path.display())]
    BodyMesh { path: PathBuf, source: Box<ply::ReadError> },
    /// The file of a new body cannot be read.
    #[error(transparent)]
    BodyFile(#[from] file::ReadError),
    /// A body does not stand along y.
    #[error("{}: {source}", path.display())]
    NotUpright { path: PathBuf, source: NotUpright },
    /// A template is not of its body.
    #[error(
        "{}: the template lies elsewhere than the body: a twentieth of the body's vertices are more than {centimetres:.0} cm from it; give one of the same body in the same pose and units",
        path.display()
    )]
    Template { path: PathBuf, centimetres: Real },
    /// A scaled mesh is not finite.
    #[error("{}: cannot be scaled by {scale}: {source}", path.display())]
    Scale { path: PathBuf, scale: Real, source: MeshError },
    /// A body is invalid for any outfit.
    #[error("{}: {source}", path.display())]
    Body { path: PathBuf, source: OutfitError },
    /// The skinning weights of a body are invalid.
    #[error("{}: {source}", path.display())]
    BodySkin { path: PathBuf, source: SkinError },
    /// The skeleton of a body is invalid.
    #[error("{}: {source}", path.display())]
    Skeleton { path: PathBuf, source: SkeletonError },
    /// A combination has no garments.
    #[error("the combination on body `{body}` has no garments; name at least one")]
    NoGarments { body: String },
    /// A garment is invalid for outfits on its body.
    #[error(transparent)]
    Misfit(OutfitError),
    /// A garment is named twice.
    #[error(
        "garment `{name}` occurs twice in a combination; remove one, or add it again under another name"
    )]
    Twice { name: String },
    /// A garment cannot be aligned.
    #[error("garment `{garment}` cannot be aligned on body `{body}`: {source}")]
    Align { garment: String, body: String, source: AlignError },
    /// The layers are not a valid outfit.
    #[error("the combination is not a valid outfit: {0}")]
    Outfit(#[from] OutfitError),
    /// The outfit cannot be resolved.
    #[error("{0}")]
    Resolve(ResolveError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A file or folder of the user's is in the way of outputs.
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
    /// The range of numbers of garments is empty.
    #[error(
        "combinations of {least} to {most} garments; the first must be at least 1 and not above the second"
    )]
    Sizes { least: usize, most: usize },
    /// A panic of this program.
    #[error("the program failed: {message}; please report it")]
    Panic { message: String },
}

impl WardrobeError {
    /// The kind of the error, for records.
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
            | Self::NotUpright { .. }
            | Self::Scale { .. }
            | Self::BodyMesh { .. }
            | Self::BodyFile(_)
            | Self::Body { .. }
            | Self::Template { .. }
            | Self::BodySkin { .. }
            | Self::Skeleton { .. } => "body",
            Self::NoGarments { .. }
            | Self::Twice { .. }
            | Self::TooFew { .. }
            | Self::Sizes { .. } => "combination",
            Self::Align { .. } => "align",
            Self::Outfit(_) | Self::Misfit(_) => "outfit",
            Self::Resolve(ResolveError::Unresolved { .. }) => "remaining",
            Self::Resolve(_) | Self::Files(_) => "resolve",
            Self::Parameter(_) => "parameter",
            Self::Picture(_) | Self::Write(_) | Self::Json { .. } => "write",
            Self::Cancelled(_) => "cancelled",
            Self::Panic { .. } => "panic",
        }
    }

    /// Whether a later run may succeed with the same input; such errors are not recorded.
    pub(crate) fn is_passing(&self) -> bool {
        matches!(self.kind(), "io" | "busy" | "write" | "cancelled")
    }
}

/// The names, or `none`.
fn listed(names: &str) -> &str {
    if names.is_empty() { "none" } else { names }
}
