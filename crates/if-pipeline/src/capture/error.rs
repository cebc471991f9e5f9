//! The error of captures.

use super::picture::PictureError;
use if_body::PoseError;
use if_mesh::camera::CameraError;
use std::io;
use std::path::PathBuf;

/// A capture cannot be opened, read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum CaptureError {
    /// A file cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    /// `meta.json` is not as docs/reference/capture.md specifies.
    #[error("{}: not as docs/reference/capture.md specifies: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
    /// The camera is invalid.
    #[error("{}: {source}", path.display())]
    Camera { path: PathBuf, source: CameraError },
    /// There are no frames.
    #[error("{}: the capture has no frames", path.display())]
    NoFrames { path: PathBuf },
    /// The indices of frames are not increasing.
    #[error("{}: frame {frame} has the index {index}, after {previous}; indices must increase", path.display())]
    FrameOrder { path: PathBuf, frame: usize, index: u32, previous: u32 },
    /// The pose of a frame is invalid.
    #[error("{}: frame {frame}: {source}", path.display())]
    Pose { path: PathBuf, frame: usize, source: PoseError },
    /// A stated error of poses or camera is negative, or too large.
    #[error("{}: `{key}` is {value}; it must be from 0 to {most}", path.display())]
    Sigma { path: PathBuf, key: &'static str, value: f64, most: f64 },
    /// `labels` does not begin with `background` and `skin`.
    #[error("{}: label {index} is called `{found}`; labels must begin with `background`, `skin`", path.display())]
    LabelName { path: PathBuf, index: usize, found: String },
    /// `labels` and `layers_inner_to_outer` name different garments.
    #[error(
        "{}: garment {index} is `{label}` among the labels but `{layer}` among the layers; they must be the same, in the same order",
        path.display()
    )]
    LayerName { path: PathBuf, index: usize, label: String, layer: String },
    /// Two garments have the same name.
    #[error("{}: garments {first} and {second} are both called `{name}`; each needs its own name", path.display())]
    SameLayer { path: PathBuf, first: usize, second: usize, name: String },
    /// A garment's name is not valid in a file name, or that of another label.
    #[error("{}: `{name}` is not a valid name: use letters, digits, blanks, `_`, `-` and `.`, and do not begin with `.`; `background` and `skin` are labels of their own", path.display())]
    BadName { path: PathBuf, name: String },
    /// More labels than an image can hold.
    #[error("{}: {count} labels; there must be from 2 to 255", path.display())]
    LabelCount { path: PathBuf, count: usize },
    /// An image is missing.
    #[error("frame {frame} of {frames} lacks {}; every frame needs a mask, a label image and normals", path.display())]
    Missing { frame: usize, frames: usize, path: PathBuf },
    /// An image is invalid.
    #[error("frame {frame}: {}: {source}", path.display())]
    Picture { frame: usize, path: PathBuf, source: PictureError },
    /// A label has no name.
    #[error("{}: the pixel in column {column}, row {row} has the label {label}, but only {names} labels have names", path.display())]
    Label { path: PathBuf, column: usize, row: usize, label: u8, names: usize },
    /// The skeleton has another number of joints.
    #[error(
        "the capture's poses rotate {capture} joints, but the skeleton has {skeleton}; use the skeleton of the capture"
    )]
    JointCount { capture: usize, skeleton: usize },
    /// A joint has another name.
    #[error(
        "joint {joint} is `{capture}` in the capture but `{skeleton}` in the skeleton; use the skeleton of the capture"
    )]
    JointName { joint: usize, capture: String, skeleton: String },
    /// The folder to write already exists.
    #[error("{}: already exists; a capture is written into a new folder", path.display())]
    InTheWay { path: PathBuf },
    /// Another process writes the folder.
    #[error("another process is writing `{}`; wait for it", path.display())]
    Busy { path: PathBuf },
    /// An image has another number of pixels than the camera.
    #[error("frame {frame}: the {what} has {got} pixels, the camera {expected}")]
    PixelCount { frame: usize, what: &'static str, got: usize, expected: usize },
    /// Only some frames have noisy images.
    #[error("frame {frame}: give a noisy {what} for all frames or for none")]
    NoisyPicture { frame: usize, what: &'static str },
}
