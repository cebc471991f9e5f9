//! What can go wrong with an animation.

use crate::load::LoadError;
use if_body::{MotionError, SequenceError, SkeletonError};
use if_core::parameter::ParameterError;
use if_outfit::NamedParameterError;
use if_outfit::outfit::OutfitError;
use if_outfit::unresolved::Unresolved;
use if_pipeline::animate::{AnimateError, SkinFault};
use miette::{Diagnostic, Report};
use std::path::PathBuf;

/// An outfit cannot be animated.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub(super) enum AnimateFault {
    #[error("{count} outfits are given, and one can be animated at a time")]
    #[diagnostic(
        code(ifg::arguments::one_outfit),
        help("give one outfit file, or --body and garments")
    )]
    Count { count: usize },
    #[error("the outfit is scaled by {scale}, and frames are in metres")]
    #[diagnostic(
        code(ifg::animate::scale),
        help("convert body, garments and skeleton to metres first, and leave out --scale")
    )]
    Scale { scale: f64 },
    #[error("`{}` cannot be animated", path.display())]
    #[diagnostic(
        code(ifg::animate::units),
        help(
            "export body, garments and skeleton in metres: frames are in metres, without --scale"
        )
    )]
    Units { path: PathBuf, source: OutfitError },
    #[error("triangles of garments cannot be split in a motion")]
    #[diagnostic(
        code(ifg::animate::split),
        help(
            "leave out split, or write the outfit with `ifg fix --set split=...` and animate what it writes"
        )
    )]
    Split,
    #[error("the body at rest cannot be drawn back in a motion: displacements are counted from it")]
    #[diagnostic(
        code(ifg::animate::pinch),
        help(
            "leave pinch = \"yield\" out of the outfit's parameters: --pinch says what the body does in frames; or write the outfit with `ifg fix --pinch yield` and animate what it writes"
        )
    )]
    Pinch,
    #[error("motion.glb cannot be written")]
    #[diagnostic(
        code(ifg::animate::gltf),
        help("leave out --gltf, or take fewer frames with --every or --frames")
    )]
    Gltf { source: if_mesh::gltf::MotionError },
    #[error("`{}` cannot be used", path.display())]
    #[diagnostic(
        code(ifg::input::skeleton),
        help(
            "give the skeleton of the body with --skeleton; docs/reference/capture.md specifies it"
        )
    )]
    Skeleton { path: PathBuf, source: SkeletonError },
    #[error("`{}` has no skin, and so no joints that a motion could turn", path.display())]
    #[diagnostic(
        code(ifg::input::skin),
        help(
            "export the body with its armature, as a skin; or give a body as PLY with weights and its skeleton with --skeleton, or as --motion a folder with the body in each frame"
        )
    )]
    NoSkin { path: PathBuf },
    #[error("`{}` cannot be used", path.display())]
    #[diagnostic(code(ifg::input::motion), help("docs/animate.md specifies motions"))]
    Motion { path: PathBuf, source: MotionError },
    #[error("the folder `{}` cannot be used", path.display())]
    #[diagnostic(
        code(ifg::input::bodies),
        help(
            "a folder has one mesh of the body for each frame, with the connectivity of the body at rest; docs/animate.md"
        )
    )]
    Bodies { path: PathBuf, source: SequenceError },
    #[error("{what} has no use for {option}")]
    #[diagnostic(code(ifg::arguments::no_use), help("leave {option} out"))]
    NoUse { what: &'static str, option: &'static str },
    #[error(
        "parameter `{name}` of the motion is given twice, or by --motion-set beside its own option"
    )]
    #[diagnostic(
        code(ifg::arguments::parameter),
        help("give it once; pinch and body_depth have the options --pinch and --body-depth")
    )]
    Twice { name: String },
    #[error(transparent)]
    #[diagnostic(
        code(ifg::arguments::parameter),
        help("docs/animate.md lists the parameters of the motion and their defaults")
    )]
    Name(#[from] NamedParameterError),
    #[error(transparent)]
    #[diagnostic(
        code(ifg::arguments::parameter),
        help("docs/animate.md lists the parameters of the motion and their defaults")
    )]
    Range(#[from] ParameterError),
    #[error("--frames {text}: {fault}")]
    #[diagnostic(
        code(ifg::arguments::frames),
        help("give one frame or a range, such as 37 or 20-29; 0 is the first")
    )]
    Frames { text: String, fault: String },
    #[error("the outfit has no valid skinning weights")]
    #[diagnostic(
        code(ifg::input::skin),
        help(
            "the body needs the vertex properties j0 to j3 and w0 to w3 (PLY); garments without them follow the body"
        )
    )]
    Skin { source: SkinFault },
    #[error("outfit `{outfit}` is not clean at rest: {unresolved}")]
    #[diagnostic(
        code(ifg::unresolved),
        help(
            "give other parameters with --set, or leave a layer out; `ifg check` counts where the body meets itself, as it does where the bind pose of its skin is wrong"
        )
    )]
    NotClean { outfit: String, unresolved: Box<Unresolved> },
    #[error("the outfit cannot be animated")]
    #[diagnostic(code(ifg::animate), help("look at the layer, frame or file that is named"))]
    Animate { source: AnimateError },
}

/// The error of files that cannot be read: animations have no scale.
pub(super) fn of_files(error: LoadError) -> Report {
    match error {
        LoadError::Outfit { path, source: source @ OutfitError::Units { .. }, .. } => {
            AnimateFault::Units { path, source }.into()
        }
        other => other.into(),
    }
}

/// Frames that are not clean, or not clean everywhere with --strict.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{} of {frames} frames are not clean{}: {}", bad.len(), if *strict { " everywhere" } else { "" }, listed(bad))]
#[diagnostic(
    code(ifg::animate::not_clean),
    help("report.json names what is left in each; they were written as far as they came")
)]
pub(super) struct NotClean {
    pub(super) bad: Vec<usize>,
    pub(super) frames: usize,
    pub(super) strict: bool,
}

/// Frames whose meshes are less clean than the frames.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error(
    "meshes of frame {} are rounded in the coordinates of their glTF nodes, and less clean so than the frame",
    listed(frames)
)]
#[diagnostic(
    code(ifg::animate::meshes),
    help(
        "point caches and --gltf hold what was proven; so do meshes of nodes without a transform"
    )
)]
pub(super) struct LessClean {
    pub(super) frames: Vec<usize>,
}

/// Something passes through something between two frames.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("in {} of {intervals} intervals triangles pass through one another, after frame {}", crossed.len(), listed(crossed))]
#[diagnostic(
    code(ifg::animate::not_clean_between),
    help(
        "report.json names layers and triangles under `between_frames`; frames that lie nearer together may avoid it"
    )
)]
pub(super) struct NotCleanBetween {
    pub(super) crossed: Vec<usize>,
    pub(super) intervals: usize,
}

fn listed(frames: &[usize]) -> String {
    /// More frames than these do not help a person.
    const SHOWN: usize = 12;
    let shown: Vec<String> = frames.iter().take(SHOWN).map(usize::to_string).collect();
    let more = if frames.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", shown.join(", "))
}
