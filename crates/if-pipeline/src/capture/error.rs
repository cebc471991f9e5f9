//! Why a folder is no capture.

use super::picture::PictureError;
use if_body::PoseError;
use if_mesh::camera::CameraError;
use std::io;
use std::path::PathBuf;

/// Why a capture cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum CaptureError {
    /// The system does not give or take a file.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// `meta.json` has another form.
    #[error("{}: not what docs/capture.md describes: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
    /// The numbers of the camera make none.
    #[error("{}: {source}", path.display())]
    Camera { path: PathBuf, source: CameraError },
    /// No frames.
    #[error("{}: the capture has no frames", path.display())]
    NoFrames { path: PathBuf },
    /// Frames must be numbered upwards.
    #[error("{}: frame {frame} has the index {index}, after {previous}; indices must grow", path.display())]
    FrameOrder { path: PathBuf, frame: usize, index: u32, previous: u32 },
    /// The pose of a frame fits no joints.
    #[error("{}: frame {frame}: {source}", path.display())]
    Pose { path: PathBuf, frame: usize, source: PoseError },
    /// `labels` must begin with the two that are always there.
    #[error("{}: label {index} is called `{found}`; labels must begin with `background`, `skin`", path.display())]
    LabelName { path: PathBuf, index: usize, found: String },
    /// `labels` and `layers_inner_to_outer` name other garments.
    #[error(
        "{}: garment {index} is `{label}` among the labels but `{layer}` among the layers; they must be the same, in the same order",
        path.display()
    )]
    LayerName { path: PathBuf, index: usize, label: String, layer: String },
    /// Two garments of one name.
    #[error("{}: garments {first} and {second} are both called `{name}`; each needs its own name", path.display())]
    SameLayer { path: PathBuf, first: usize, second: usize, name: String },
    /// A name that cannot be part of a file name.
    #[error("{}: `{name}` is no name: use letters, digits, blanks, `_`, `-` and `.`, and do not begin with `.`", path.display())]
    BadName { path: PathBuf, name: String },
    /// More labels than a picture can hold.
    #[error("{}: {count} labels; there must be from 2 to 255", path.display())]
    LabelCount { path: PathBuf, count: usize },
    /// A picture that should be there is not.
    #[error("frame {frame} of {frames} lacks {}; every frame needs a mask, a label image and normals", path.display())]
    Missing { frame: usize, frames: usize, path: PathBuf },
    /// A picture is at fault.
    #[error("frame {frame}: {}: {source}", path.display())]
    Picture { frame: usize, path: PathBuf, source: PictureError },
    /// A label without a name.
    #[error("{}: the pixel in column {column}, row {row} has the label {label}, but only {names} labels have names", path.display())]
    Label { path: PathBuf, column: usize, row: usize, label: u8, names: usize },
    /// The skeleton has more or fewer joints.
    #[error(
        "the capture's poses turn {capture} joints, but the skeleton has {skeleton}; use the skeleton it was posed with"
    )]
    JointCount { capture: usize, skeleton: usize },
    /// A joint has another name.
    #[error(
        "joint {joint} is `{capture}` in the capture but `{skeleton}` in the skeleton; use the skeleton it was posed with"
    )]
    JointName { joint: usize, capture: String, skeleton: String },
    /// The folder to write is there already.
    #[error("{}: already there; a capture is written into a new folder", path.display())]
    InTheWay { path: PathBuf },
    /// A picture to be written has another number of pixels.
    #[error("frame {frame}: the {what} has {got} pixels, the camera {expected}")]
    PixelCount { frame: usize, what: &'static str, got: usize, expected: usize },
    /// The first frame had noisy pictures and this one has none, or the other way round.
    #[error("frame {frame}: a noisy {what} must be there for all frames or for none")]
    NoisyPicture { frame: usize, what: &'static str },
}
