//! A body of a wardrobe: what outfits are made on, and what aligns them.

use super::WardrobeError;
use crate::align::BodyShape;
use crate::asset::{BodyRef, FileInfo};
use crate::content::content;
use crate::skeleton::Skeleton;
use crate::skin_weights::SkinWeights;
use crate::whole_folder::Writer;
use if_core::mesh::TriMesh;
use if_mesh::file::{Content, MeshFile};
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};

const FORMAT: u32 = 1;
const INFO: &str = "body.json";
const MESH: &str = "body.ply";
const TEMPLATE: &str = "template.ply";
const SKELETON: &str = "skeleton.json";
/// What a PLY file's byte can name, where no skeleton says how many joints there are.
const JOINTS: usize = 256;

/// What is known of a body: `body.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyInfo {
    /// The version of the format.
    pub body: u32,
    /// What it is called.
    pub name: String,
    /// Closed, wound outwards, in metres: what outfits are made on.
    pub mesh: FileInfo,
    /// A mesh of the same body whose vertices mean the same on every body.
    pub template: Option<FileInfo>,
    /// Its joints.
    pub skeleton: Option<FileInfo>,
}

impl BodyInfo {
    /// The body by name and content.
    pub fn reference(&self) -> BodyRef {
        BodyRef { name: self.name.clone(), sha256: self.mesh.content.sha256.clone() }
    }
}

/// The files of a body that is added.
#[derive(Clone, Copy, Debug)]
pub struct NewBody<'a> {
    /// What it is to be called.
    pub name: &'a str,
    /// A PLY or OBJ file: closed, wound outwards, in metres, with weights where a PLY file has some.
    pub mesh: &'a Path,
    /// A PLY or OBJ file of the same body with a topology that other bodies have too.
    pub template: Option<&'a Path>,
    /// Its joints.
    pub skeleton: Option<&'a Path>,
}

/// A body that was read.
#[derive(Clone, Debug)]
pub struct WardrobeBody {
    /// What it is called.
    pub name: String,
    /// Closed, wound outwards, in metres.
    pub mesh: TriMesh,
    /// Its weights.
    pub skin: Option<SkinWeights>,
    /// The template, and its weights.
    pub template: Option<(TriMesh, Option<SkinWeights>)>,
    /// Its joints.
    pub skeleton: Option<Skeleton>,
}

impl WardrobeBody {
    /// As alignment needs it.
    pub fn shape(&self) -> BodyShape<'_> {
        BodyShape {
            mesh: &self.mesh,
            skin: self.skin.as_ref(),
            template: self.template.as_ref().map(|(mesh, skin)| (mesh, skin.as_ref())),
            skeleton: self.skeleton.as_ref(),
        }
    }
}

/// Copies the files of a body, if they can be read.
pub(super) fn write(bodies: &Writer, new: &NewBody) -> Result<BodyInfo, WardrobeError> {
    let load = |path: &Path| fs::read(path).map_err(|source| WardrobeError::Folder { path: path.into(), source });
    let mesh = ply_bytes(new.mesh)?;
    let template = new.template.map(ply_bytes).transpose()?;
    let skeleton = new.skeleton.map(load).transpose()?;
    let parsed =
        parse(new.name, (new.mesh, &mesh), new.template.zip(template.as_deref()), new.skeleton.zip(skeleton.as_deref()))?;
    // A body that no outfit could have is refused here, and not at every combination.
    crate::outfit::Outfit::new(crate::outfit::Layer::new(new.name, parsed.mesh), vec![])
        .map_err(|source| WardrobeError::Body { path: new.mesh.into(), source })?;
    bodies.write(new.name, |folder| {
        let store = |file: &str, bytes: &[u8]| -> Result<FileInfo, WardrobeError> {
            let path = folder.join(file);
            fs::write(&path, bytes).map_err(|source| WardrobeError::Folder { path, source })?;
            Ok(FileInfo { file: file.into(), content: content(bytes) })
        };
        let info = BodyInfo {
            body: FORMAT,
            name: new.name.into(),
            mesh: store(MESH, &mesh)?,
            template: template.as_deref().map(|bytes| store(TEMPLATE, bytes)).transpose()?,
            skeleton: skeleton.as_deref().map(|bytes| store(SKELETON, bytes)).transpose()?,
        };
        let mut text = serde_json::to_vec_pretty(&info).map_err(|e| WardrobeError::Json { message: e.to_string() })?;
        text.push(b'\n');
        store(INFO, &text)?;
        Ok(info)
    })
}

/// A mesh file as the wardrobe keeps it: a PLY file as it is, the mesh of an OBJ file without loss.
pub(super) fn ply_bytes(path: &Path) -> Result<Vec<u8>, WardrobeError> {
    let file = MeshFile::read(path)?;
    if let Content::Ply(_) = file.content() {
        return Ok(file.bytes().to_vec());
    }
    let (mesh, mut bytes) = (file.mesh(), Vec::new());
    let params = WriteParams { coordinates: CoordinateType::Double, ..WriteParams::default() };
    ply::write(&PlyMesh::new(mesh.clone()), mesh.vertices(), &params, &mut bytes)
        .map_err(|e| WardrobeError::Write { path: path.into(), source: e.into() })?;
    Ok(bytes)
}

/// The mesh file of a body, if it is the one that was added.
pub(super) fn read_mesh(folder: &Path, info: &BodyInfo) -> Result<Vec<u8>, WardrobeError> {
    Ok(load(folder, &info.mesh)?.1)
}

pub(super) fn read_info(folder: &Path) -> Result<BodyInfo, WardrobeError> {
    let path = folder.join(INFO);
    let text = fs::read(&path).map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
    let info: BodyInfo =
        serde_json::from_slice(&text).map_err(|e| WardrobeError::BodyInfo { path: path.clone(), message: e.to_string() })?;
    if info.body != FORMAT {
        let message = format!("the version of the body is {}, known is {FORMAT}; add the body again", info.body);
        return Err(WardrobeError::BodyInfo { path, message });
    }
    Ok(info)
}

pub(super) fn read(folder: &Path, info: &BodyInfo) -> Result<WardrobeBody, WardrobeError> {
    let load = |file| load(folder, file);
    let mesh = load(&info.mesh)?;
    let template = info.template.as_ref().map(load).transpose()?;
    let skeleton = info.skeleton.as_ref().map(load).transpose()?;
    parse(
        &info.name,
        (&mesh.0, &mesh.1),
        template.as_ref().map(|(path, bytes)| (path.as_path(), bytes.as_slice())),
        skeleton.as_ref().map(|(path, bytes)| (path.as_path(), bytes.as_slice())),
    )
}

/// The bytes of a file, if they are those that were stated.
fn load(folder: &Path, file: &FileInfo) -> Result<(PathBuf, Vec<u8>), WardrobeError> {
    let path = folder.join(&file.file);
    let bytes = fs::read(&path).map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
    if content(&bytes) != file.content {
        let message = "the file has changed since the body was added; add it again".into();
        return Err(WardrobeError::BodyInfo { path, message });
    }
    Ok((path, bytes))
}

fn parse(
    name: &str,
    mesh: (&Path, &[u8]),
    template: Option<(&Path, &[u8])>,
    skeleton: Option<(&Path, &[u8])>,
) -> Result<WardrobeBody, WardrobeError> {
    let skeleton = skeleton
        .map(|(path, bytes)| Skeleton::read(bytes).map_err(|source| WardrobeError::Skeleton { path: path.into(), source }))
        .transpose()?;
    let joints = skeleton.as_ref().map_or(JOINTS, Skeleton::len);
    let skinned = |(path, bytes): (&Path, &[u8])| {
        let ply = ply::read_bytes(bytes).map_err(|e| WardrobeError::BodyMesh { path: path.into(), source: e.into() })?;
        let skin = match ply.vertex_property("j0") {
            Some(_) => Some(
                SkinWeights::from_ply(&ply, joints).map_err(|source| WardrobeError::BodySkin { path: path.into(), source })?,
            ),
            None => None,
        };
        Ok::<_, WardrobeError>((ply.mesh, skin))
    };
    let (mesh, skin) = skinned(mesh)?;
    Ok(WardrobeBody { name: name.into(), mesh, skin, template: template.map(skinned).transpose()?, skeleton })
}
