//! The canonical mesh in each frame: vertex k is the same material point in all frames.

use super::error::ReconstructError;
use super::motion::MeshMotion;
use crate::capture::Capture;
use if_body::SkinWeights;
use if_body::skinning::{blends, pose_points};
use if_body::{Pose, PoseError, Skeleton};
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_mesh::ply::{self, PlyMesh, WriteParams};
use std::path::Path;

/// The vertices LBS(x + d) of a canonical mesh in a pose, in world space. `offsets` are the d of
/// the frame, in canonical space; empty for none.
///
/// # Errors
///
/// The pose has another number of joints.
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

/// Creates `folder` and writes `frame_NNNN.ply` for each frame of a capture: binary, in metres, in
/// world space. Vertices are LBS(x + d), with the d of `motion` if given.
///
/// # Errors
///
/// [`ReconstructError`].
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
) -> Result<(), ReconstructError> {
    std::fs::create_dir_all(folder)
        .map_err(|source| ReconstructError::FramesFolder { path: folder.into(), source })?;
    let file = PlyMesh::new(mesh.clone());
    for frame in 0..capture.len() {
        let offsets = motion.map(|m| m.offsets(frame)).unwrap_or_default();
        let points = posed(mesh, skin, skeleton, capture.pose(frame), &offsets)
            .map_err(|source| ReconstructError::Pose { frame, source })?;
        let path = folder.join(format!("frame_{:04}.ply", capture.number(frame)));
        ply::write_path(&file, &points, &WriteParams::default(), &path).map_err(|source| {
            ReconstructError::FrameFile { path: path.clone(), source: Box::new(source) }
        })?;
    }
    Ok(())
}
