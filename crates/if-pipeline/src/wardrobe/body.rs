//! Bodies of a wardrobe.

use super::WardrobeError;
use crate::asset::{BodyRef, FileInfo};
use if_body::SkinWeights;
use if_body::align::BodyShape;
use if_body::{Skeleton, check_upright};
use if_core::aabb::Aabb;
use if_core::closest::ClosestPoint;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use if_mesh::atomic::FolderWriter;
use if_mesh::file::{self, Content, MeshFile, is_gltf};
use if_mesh::index::Bvh;
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::regular_file;
use if_outfit::digest::{FileDigest, digest};
use if_outfit::outfit::{Layer, Outfit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

const FORMAT: u32 = 1;
pub(super) const INFO: &str = "body.json";
const MESH: &str = "body.ply";
const TEMPLATE: &str = "template.ply";
const SKELETON: &str = "skeleton.json";
/// Distance from the template that at most a twentieth of a body's vertices exceed, as a share of its longest
/// side: 7 cm for a person. Templates of scanned people lie below their clothes; that of a person 14 cm
/// taller is off by more.
const TEMPLATE_OFF: Real = 0.04;

/// Metadata of a body: `body.json`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyInfo {
    /// The version of the format.
    pub body: u32,
    /// Its name.
    pub name: String,
    /// The mesh, in metres.
    pub mesh: FileInfo,
    /// A mesh of the same body in a topology that other bodies share.
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

/// The files of a new body.
#[derive(Clone, Copy, Debug)]
pub struct NewBody<'a> {
    /// Its name.
    pub name: &'a str,
    /// A PLY, OBJ or glTF file; skinning weights are used, those of a glTF file with a skeleton that has
    /// its joints.
    pub mesh: &'a Path,
    /// A PLY or OBJ file of the same body in a topology that other bodies share.
    pub template: Option<&'a Path>,
    /// Its joints: `skeleton.json`, or a glTF file with a skin.
    pub skeleton: Option<&'a Path>,
    /// Factor from the units of all these files to metres.
    pub scale: Real,
}

impl<'a> NewBody<'a> {
    /// A body with only a mesh, in metres.
    pub fn new(name: &'a str, mesh: &'a Path) -> Self {
        Self { name, mesh, template: None, skeleton: None, scale: 1.0 }
    }
}

/// A file as stored in the wardrobe, and its original path.
struct Source {
    path: PathBuf,
    bytes: Vec<u8>,
    content: FileDigest,
}

impl Source {
    fn new(path: &Path, bytes: Vec<u8>) -> Self {
        Self { path: path.into(), content: digest(&bytes), bytes }
    }
}

/// The files of a body as stored in the wardrobe: PLY, in metres.
pub(super) struct BodyFiles {
    mesh: Source,
    template: Option<Source>,
    skeleton: Option<Source>,
}

impl BodyFiles {
    /// Reads them.
    pub(super) fn read(new: &NewBody) -> Result<Self, WardrobeError> {
        let range = "positive, such as 0.001 for files in millimetres";
        ParameterError::check("scale", new.scale, new.scale.is_finite() && new.scale > 0.0, range)?;
        let skeleton = |path: &Path| {
            Ok::<_, WardrobeError>(Source::new(path, skeleton_bytes(path, new.scale)?))
        };
        // Its faults are told after those of the mesh.
        let skeleton = new.skeleton.map(skeleton).transpose();
        let joints = skeleton.as_ref().ok().and_then(Option::as_ref);
        let joints = joints.and_then(|source| read_skeleton(source).ok());
        let mesh = |path: &Path| {
            let bytes = ply_bytes(path, new.scale, joints.as_ref())?;
            Ok::<_, WardrobeError>(Source::new(path, bytes))
        };
        let (mesh, template) = (mesh(new.mesh)?, new.template.map(mesh).transpose()?);
        Ok(Self { mesh, template, skeleton: skeleton? })
    }

    /// Whether `body` has this mesh.
    pub(super) fn has_mesh_of(&self, body: &BodyInfo) -> bool {
        self.mesh.content == body.mesh.content
    }

    /// Whether `body` has all these files.
    pub(super) fn are_of(&self, body: &BodyInfo) -> bool {
        let same = |new: &Option<Source>, file: &Option<FileInfo>| {
            new.is_none()
                || new.as_ref().map(|source| &source.content) == file.as_ref().map(|f| &f.content)
        };
        self.has_mesh_of(body)
            && same(&self.template, &body.template)
            && same(&self.skeleton, &body.skeleton)
    }

    /// Adds the template and skeleton of the `body` in `folder` where none is given.
    pub(super) fn completed(self, folder: &Path, body: &BodyInfo) -> Result<Self, WardrobeError> {
        let kept = |new: Option<Source>, file: &Option<FileInfo>| match (new, file) {
            (None, Some(file)) => load(folder, file).map(Some),
            (new, _) => Ok(new),
        };
        let (template, skeleton) =
            (kept(self.template, &body.template)?, kept(self.skeleton, &body.skeleton)?);
        Ok(Self { mesh: self.mesh, template, skeleton })
    }
}

/// A body, read from the wardrobe.
#[derive(Clone, Debug)]
pub struct WardrobeBody {
    /// Its name.
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
    /// The input of alignment.
    pub fn shape(&self) -> BodyShape<'_> {
        BodyShape {
            mesh: &self.mesh,
            skin: self.skin.as_ref(),
            template: self.template.as_ref().map(|(mesh, skin)| (mesh, skin.as_ref())),
            skeleton: self.skeleton.as_ref(),
        }
    }
}

/// Checks that files are a body. Bodies that are invalid for any outfit are rejected here, not at every
/// combination.
pub(super) fn check(name: &str, files: &BodyFiles) -> Result<(), WardrobeError> {
    let parsed = parse(name, files)?;
    let path = || files.mesh.path.clone();
    let outfit = Outfit::new(Layer::new(name, parsed.mesh), vec![])
        .map_err(|source| WardrobeError::Body { path: path(), source })?;
    check_upright(&outfit.body.mesh, parsed.skeleton.as_ref())
        .map_err(|source| WardrobeError::NotUpright { path: path(), source })?;
    if let (Some((template, _)), Some(source)) = (&parsed.template, &files.template) {
        check_template(&outfit.body.mesh, template, &source.path)?;
    }
    Ok(())
}

/// Stores the files of a body after validation.
pub(super) fn write(
    bodies: &FolderWriter,
    name: &str,
    files: &BodyFiles,
) -> Result<BodyInfo, WardrobeError> {
    check(name, files)?;
    bodies.write(name, |folder| {
        let put = |file: &str, bytes: &[u8]| {
            let path = folder.join(file);
            fs::write(&path, bytes).map_err(|source| WardrobeError::Folder { path, source })
        };
        let store = |file: &str, source: &Source| -> Result<FileInfo, WardrobeError> {
            put(file, &source.bytes)?;
            Ok(FileInfo { file: file.into(), content: source.content.clone() })
        };
        let info = BodyInfo {
            body: FORMAT,
            name: name.into(),
            mesh: store(MESH, &files.mesh)?,
            template: files.template.as_ref().map(|source| store(TEMPLATE, source)).transpose()?,
            skeleton: files.skeleton.as_ref().map(|source| store(SKELETON, source)).transpose()?,
        };
        let mut text = serde_json::to_vec_pretty(&info)
            .map_err(|e| WardrobeError::Json { message: e.to_string() })?;
        text.push(b'\n');
        put(INFO, &text)?;
        Ok(info)
    })
}

/// A mesh file as stored in the wardrobe: PLY files in metres unchanged; files in other units, and OBJ
/// and glTF files, as PLY in double precision. Weights of glTF files name joints, of a skeleton.
fn ply_bytes(
    path: &Path,
    scale: Real,
    skeleton: Option<&Skeleton>,
) -> Result<Vec<u8>, WardrobeError> {
    let file = MeshFile::read(path)?;
    if let (Content::Ply(_), true) = (file.content(), scale == 1.0) {
        return Ok(file.bytes().to_vec());
    }
    let scaled = file.mesh().scaled(scale);
    let mesh =
        scaled.map_err(|source| WardrobeError::Scale { path: path.into(), scale, source })?;
    let (positions, mut bytes) = (mesh.vertices().to_vec(), Vec::new());
    let params = WriteParams { coordinates: CoordinateType::Double, ..WriteParams::default() };
    let written = match file.content() {
        Content::Ply(ply) => ply::write(ply, &positions, &params, &mut bytes),
        Content::Gltf(_) => {
            let skin = skeleton.map(|skeleton| SkinWeights::from_file(&file, skeleton));
            let skin = skin
                .transpose()
                .map_err(|source| WardrobeError::BodySkin { path: path.into(), source })?
                .flatten();
            let vertex_properties = skin.map(|skin| skin.to_properties()).unwrap_or_default();
            let ply = PlyMesh { vertex_properties, ..PlyMesh::new(mesh) };
            ply::write(&ply, &positions, &params, &mut bytes)
        }
        _ => ply::write(&PlyMesh::new(mesh), &positions, &params, &mut bytes),
    };
    written.map_err(|e| file::WriteError::Ply { path: path.into(), source: e.into() })?;
    Ok(bytes)
}

/// A skeleton as stored in the wardrobe: JSON, in metres.
fn skeleton_bytes(path: &Path, scale: Real) -> Result<Vec<u8>, WardrobeError> {
    let fault = |source| WardrobeError::Skeleton { path: path.into(), source };
    let skeleton = if is_gltf(path) {
        Skeleton::read_path(path)
    } else {
        let bytes = read_file(path)?;
        if scale == 1.0 {
            return Ok(bytes);
        }
        Skeleton::read(&bytes[..])
    };
    let scaled = skeleton.and_then(|skeleton| skeleton.scaled(scale)).map_err(fault)?;
    let mut bytes = Vec::new();
    scaled.write(&mut bytes)?;
    Ok(bytes)
}

fn read_skeleton(Source { path, bytes, .. }: &Source) -> Result<Skeleton, WardrobeError> {
    Skeleton::read(&bytes[..])
        .map_err(|source| WardrobeError::Skeleton { path: path.clone(), source })
}

/// The mesh file of a body, if it has not changed.
pub(super) fn read_mesh(folder: &Path, info: &BodyInfo) -> Result<Vec<u8>, WardrobeError> {
    Ok(load(folder, &info.mesh)?.bytes)
}

/// The bounding box of a body's surface.
pub(super) fn read_box(bodies: &Path, info: &BodyInfo) -> Result<Aabb, WardrobeError> {
    let Source { path, bytes, .. } = load(&bodies.join(&info.name), &info.mesh)?;
    let ply =
        ply::read_bytes(&bytes).map_err(|e| WardrobeError::BodyMesh { path, source: e.into() })?;
    Ok(ply.mesh.surface_aabb())
}

pub(super) fn read_info(folder: &Path) -> Result<BodyInfo, WardrobeError> {
    let path = folder.join(INFO);
    let text = read_file(&path)?;
    let info: BodyInfo = serde_json::from_slice(&text)
        .map_err(|e| WardrobeError::BodyInfo { path: path.clone(), message: e.to_string() })?;
    if info.body != FORMAT {
        let message = format!(
            "the version of the body is {}, known is {FORMAT}; add the body again",
            info.body
        );
        return Err(WardrobeError::BodyInfo { path, message });
    }
    Ok(info)
}

pub(super) fn read(folder: &Path, info: &BodyInfo) -> Result<WardrobeBody, WardrobeError> {
    let load = |file| load(folder, file);
    let files = BodyFiles {
        mesh: load(&info.mesh)?,
        template: info.template.as_ref().map(load).transpose()?,
        skeleton: info.skeleton.as_ref().map(load).transpose()?,
    };
    parse(&info.name, &files)
}

/// Checks that a template is of the body in its pose.
fn check_template(body: &TriMesh, template: &TriMesh, path: &Path) -> Result<(), WardrobeError> {
    let surface = Bvh::new(template);
    let off = |p: &Point| surface.closest(p, Real::INFINITY).map_or(Real::INFINITY, |c| c.distance);
    let mut off: Vec<Real> = body.vertices().par_iter().map(off).collect();
    off.sort_unstable_by(Real::total_cmp);
    match off[off.len() * 19 / 20] {
        most if most > TEMPLATE_OFF * body.surface_aabb().size().max() => {
            Err(WardrobeError::Template { path: path.into(), centimetres: 100.0 * most })
        }
        _ => Ok(()),
    }
}

fn read_file(path: &Path) -> Result<Vec<u8>, WardrobeError> {
    regular_file::read(path).map_err(|source| WardrobeError::Folder { path: path.into(), source })
}

/// The error of a body without a file.
pub(super) fn missing(path: &Path) -> WardrobeError {
    let message = "the file is missing; add the body again".into();
    WardrobeError::BodyInfo { path: path.into(), message }
}

/// Reads a file and checks its hash.
fn load(folder: &Path, file: &FileInfo) -> Result<Source, WardrobeError> {
    let path = regular_file::inside(folder, &file.file).ok_or_else(|| {
        let message =
            format!("`{}` is not the name of a file beside it; add the body again", file.file);
        WardrobeError::BodyInfo { path: folder.join(INFO), message }
    })?;
    let bytes = regular_file::read(&path).map_err(|source| match source.kind() {
        // It stays so: other outfits go on.
        io::ErrorKind::NotFound => missing(&path),
        _ => WardrobeError::Folder { path: path.clone(), source },
    })?;
    let source = Source::new(&path, bytes);
    if source.content != file.content {
        let message = "the file has changed since the body was added; add it again".into();
        return Err(WardrobeError::BodyInfo { path, message });
    }
    Ok(source)
}

fn parse(name: &str, files: &BodyFiles) -> Result<WardrobeBody, WardrobeError> {
    let skeleton = files.skeleton.as_ref().map(read_skeleton).transpose()?;
    let joints = skeleton.as_ref().map_or(SkinWeights::MAX_JOINTS, Skeleton::len);
    let skinned = |Source { path, bytes, .. }: &Source| {
        let ply = ply::read_bytes(bytes)
            .map_err(|e| WardrobeError::BodyMesh { path: path.clone(), source: e.into() })?;
        let skin = match ply.vertex_property("j0") {
            Some(_) => Some(
                SkinWeights::from_ply(&ply, joints)
                    .map_err(|source| WardrobeError::BodySkin { path: path.clone(), source })?,
            ),
            None => None,
        };
        Ok::<_, WardrobeError>((ply.mesh, skin))
    };
    let (mesh, skin) = skinned(&files.mesh)?;
    let template = files.template.as_ref().map(skinned).transpose()?;
    Ok(WardrobeBody { name: name.into(), mesh, skin, template, skeleton })
}
