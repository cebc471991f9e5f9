//! Template bodies: a closed mesh with skinning weights and a skeleton.

use crate::skeleton::{Skeleton, SkeletonError};
use crate::skin_weights::{SkinError, SkinWeights};
use crate::upright::{NotUpright, check_upright};
use if_core::mesh::TriMesh;
use if_mesh::ply::{self, CoordinateType, Keep, PlyMesh, WriteParams};
use std::io;
use std::path::{Path, PathBuf};

/// A closed body in its rest pose, with its joints and skinning weights: what captures are
/// reconstructed from.
#[derive(Clone, Debug)]
pub struct TemplateBody {
    /// The surface, in metres; y points up, and the person faces +z.
    pub mesh: TriMesh,
    /// The weights of its vertices.
    pub skin: SkinWeights,
    /// The joints.
    pub skeleton: Skeleton,
}

/// A template body cannot be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum TemplateError {
    /// The skeleton is missing or invalid.
    #[error("{}: {source}", path.display())]
    Skeleton { path: PathBuf, source: SkeletonError },
    /// The mesh is missing or invalid.
    #[error("{}: {source}", path.display())]
    Mesh { path: PathBuf, source: Box<ply::ReadError> },
    /// The skinning weights are missing or invalid.
    #[error("{}: {source}", path.display())]
    Weights { path: PathBuf, source: SkinError },
    /// The body does not stand along y.
    #[error("{}: {source}", path.display())]
    NotUpright { path: PathBuf, source: NotUpright },
    /// A file cannot be written.
    #[error("{}: {source}", path.display())]
    Write { path: PathBuf, source: Box<dyn std::error::Error + Send + Sync> },
}

/// Names of the mesh in a folder, in order of preference.
const MESHES: [&str; 2] = ["body_clean.ply", "body.ply"];
const SKELETON: &str = "skeleton.json";

impl TemplateBody {
    /// Reads `skeleton.json` and `body_clean.ply` (or, if that is missing, `body.ply`) of a folder.
    ///
    /// # Errors
    ///
    /// [`TemplateError`], with the path of the file.
    pub fn read(folder: &Path) -> Result<Self, TemplateError> {
        let mesh = MESHES
            .iter()
            .map(|name| folder.join(name))
            .find(|p| p.exists())
            .unwrap_or_else(|| folder.join(MESHES[0]));
        Self::read_files(&mesh, &folder.join(SKELETON))
    }

    /// Reads a mesh with weights, and a skeleton.
    ///
    /// # Errors
    ///
    /// [`TemplateError`], with the path of the file.
    fn read_files(mesh: &Path, skeleton: &Path) -> Result<Self, TemplateError> {
        let fault = |source| TemplateError::Skeleton { path: skeleton.into(), source };
        let skeleton = Skeleton::read_path(skeleton).map_err(fault)?;
        let path = || mesh.to_path_buf();
        let ply = ply::read_path(mesh)
            .map_err(|e| TemplateError::Mesh { path: path(), source: e.into() })?;
        let skin = SkinWeights::from_ply(&ply, skeleton.len());
        let skin = skin.map_err(|source| TemplateError::Weights { path: path(), source })?;
        check_upright(&ply.mesh, Some(&skeleton))
            .map_err(|source| TemplateError::NotUpright { path: path(), source })?;
        Ok(Self { mesh: ply.mesh, skin, skeleton })
    }

    /// Writes `body_clean.ply` and `skeleton.json` into an existing folder, each atomically.
    ///
    /// # Errors
    ///
    /// [`TemplateError::Write`].
    pub fn write(&self, folder: &Path) -> Result<(), TemplateError> {
        let (mesh, skeleton) = (folder.join(MESHES[0]), folder.join(SKELETON));
        if_mesh::atomic::write_file::<io::Error>(&skeleton, |file| self.skeleton.write(file))
            .map_err(|e| TemplateError::Write { path: skeleton.clone(), source: e.into() })?;
        let ply = PlyMesh {
            vertex_properties: self.skin.to_properties(),
            coordinates: CoordinateType::Float,
            ..PlyMesh::new(self.mesh.clone())
        };
        let params = WriteParams { keep: Keep::All, ..WriteParams::default() };
        ply::write_path(&ply, self.mesh.vertices(), &params, &mesh)
            .map_err(|e| TemplateError::Write { path: mesh.clone(), source: e.into() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::Joint;
    use if_core::math::Point;

    fn template() -> TemplateBody {
        let at = |x: f64| Point::new(x, 0.5, 0.25);
        let joint = |name: &str, parent, x| Joint {
            name: name.into(),
            parent,
            head: at(x),
            tail: at(x + 0.5),
        };
        TemplateBody {
            mesh: TriMesh::new(vec![at(0.0), at(0.5), Point::origin()], vec![[0, 1, 2]]).unwrap(),
            skin: SkinWeights::new(vec![[0, 1, 0, 0]; 3], vec![[0.5, 0.5, 0.0, 0.0]; 3], 2)
                .unwrap(),
            skeleton: Skeleton::new(vec![joint("a", None, 0.0), joint("b", Some(0), 0.5)]).unwrap(),
        }
    }

    #[test]
    fn a_written_template_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        template().write(folder.path()).unwrap();
        let read = TemplateBody::read(folder.path()).unwrap();
        assert_eq!(
            (read.mesh, read.skin, read.skeleton),
            (template().mesh, template().skin, template().skeleton)
        );
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = TemplateBody::read(folder.path()).unwrap_err();
        assert!(
            matches!(&error, TemplateError::Skeleton { .. })
                && error.to_string().contains("skeleton.json"),
            "{error}"
        );
        template().write(folder.path()).unwrap();
        std::fs::remove_file(folder.path().join("body_clean.ply")).unwrap();
        let error = TemplateBody::read(folder.path()).unwrap_err();
        assert!(
            matches!(&error, TemplateError::Mesh { .. })
                && error.to_string().contains("body_clean.ply"),
            "{error}"
        );
        let bare = PlyMesh::new(template().mesh);
        ply::write_path(
            &bare,
            bare.mesh.vertices(),
            &WriteParams::default(),
            &folder.path().join("body.ply"),
        )
        .unwrap();
        let error = TemplateBody::read(folder.path()).unwrap_err();
        assert!(
            matches!(&error, TemplateError::Weights { .. }) && error.to_string().contains("`j0`"),
            "{error}"
        );
    }

    #[test]
    fn a_body_that_lies_down_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let flat = |p: &Point| Point::new(p.x, 0.1 * p.y, p.z);
        let mesh = template().mesh;
        let mesh = mesh.with_vertices(mesh.vertices().iter().map(flat).collect()).unwrap();
        TemplateBody { mesh, ..template() }.write(folder.path()).unwrap();
        let error = TemplateBody::read(folder.path()).unwrap_err();
        assert!(matches!(&error, TemplateError::NotUpright { .. }), "{error}");
    }
}
