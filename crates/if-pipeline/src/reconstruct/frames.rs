//! The canonical mesh as it stands in each frame: the same triangles, and vertex k is the same
//! material point in all.

use super::motion::MeshMotion;
use crate::capture::Capture;
use if_body::SkinWeights;
use if_body::skinning::{blends, pose_points};
use if_body::{Pose, PoseError, Skeleton};
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_mesh::ply::{self, PlyMesh, WriteError, WriteParams};
use std::io;
use std::path::{Path, PathBuf};

/// Why frames cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramesError {
    /// The folder cannot be made.
    #[error("cannot make the folder {}: {source}", path.display())]
    Folder {
        /// Which folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {}: {source}", path.display())]
    File {
        /// Which file.
        path: PathBuf,
        /// What is at fault.
        source: Box<WriteError>,
    },
    /// A pose does not fit the skeleton.
    #[error("frame {frame}: {source}")]
    Pose {
        /// Its place in the capture.
        frame: usize,
        /// What is wrong with it.
        source: PoseError,
    },
}

/// LBS(x + d) of the vertices of a canonical mesh in a pose, in the world. `offsets` are the d of
/// the frame, in canonical space; empty for none.
///
/// # Errors
///
/// A pose of another number of joints.
///
/// # Panics
///
/// If there is not one record of weights, or not one offset, for each vertex.
pub fn posed(
    mesh: &TriMesh,
    skin: &SkinWeights,
    skeleton: &Skeleton,
    pose: &Pose,
    offsets: &[Vector],
) -> Result<Vec<Point>, PoseError> {
    let maps = blends(skin, &skeleton.transforms(pose)?);
    if offsets.is_empty() {
        return Ok(pose_points(mesh.vertices(), &maps));
    }
    assert_eq!(offsets.len(), mesh.vertices().len(), "one offset for each vertex");
    let moved: Vec<Point> = mesh.vertices().iter().zip(offsets).map(|(p, d)| p + d).collect();
    Ok(pose_points(&moved, &maps))
}

/// Writes `frame_NNNN.ply` for each frame of a capture into `folder`, which is made: binary, in
/// metres, in the world. Vertices are LBS(x + d), with the d of `motion`, or with none.
///
/// # Errors
///
/// [`FramesError`].
///
/// # Panics
///
/// If there is not one record of weights for each vertex, or the motion is of another mesh or
/// capture.
pub fn write_frames(
    folder: &Path,
    mesh: &TriMesh,
    skin: &SkinWeights,
    skeleton: &Skeleton,
    capture: &Capture,
    motion: Option<&MeshMotion>,
) -> Result<(), FramesError> {
    std::fs::create_dir_all(folder)
        .map_err(|source| FramesError::Folder { path: folder.into(), source })?;
    let file = PlyMesh::new(mesh.clone());
    for frame in 0..capture.len() {
        let offsets = motion.map(|m| m.offsets(frame)).unwrap_or_default();
        let points = posed(mesh, skin, skeleton, capture.pose(frame), &offsets)
            .map_err(|source| FramesError::Pose { frame, source })?;
        let path = folder.join(format!("frame_{:04}.ply", capture.number(frame)));
        ply::write_path(&file, &points, &WriteParams::default(), &path)
            .map_err(|source| FramesError::File { path: path.clone(), source: Box::new(source) })?;
    }
    Ok(())
}
