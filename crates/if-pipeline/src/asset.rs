//! Garments as assets: folders with the mesh, skinning weights, φ and metadata.
//!
//! ```text
//! NAME/
//!   asset.json      metadata: AssetInfo
//!   garment.ply     the mesh in the body's canonical pose, single precision, weights as j0..j3 and w0..w3, and what else its source has
//!   phi.safetensors φ as a network (optional)
//!   phi.baked       φ of the clothed body as a narrow-band grid (optional)
//!   thumbnail.png   front and back
//! ```
//!
//! The folder is written atomically ([`if_mesh::atomic`]). `asset.json` has the hashes of the
//! files, which [`read`] checks.

mod beside;
mod class;
mod error;
mod info;
mod phi;
mod thumbnail;

pub use beside::Beside;
pub use class::{GarmentClass, LayerHint};
pub(crate) use class::{is_wearable, least_openings};
pub use error::AssetError;
pub(crate) use info::files;
pub use info::{AssetInfo, BodyRef, FileInfo, Opening, Phi, Provenance};
pub use phi::PhiField;

use if_body::SkinWeights;
use if_core::mesh::TriMesh;
use if_mesh::atomic::FolderWriter;
use if_mesh::baked::Baked;
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::regular_file;
use if_outfit::digest::digest;
use std::fs;
use std::path::{Path, PathBuf};

/// The version of the format that is written.
const FORMAT: u32 = 1;
/// The file of the metadata.
pub(crate) const INFO: &str = "asset.json";
const GARMENT: &str = "garment.ply";
const NETWORK: &str = "phi.safetensors";
const BAKED: &str = "phi.baked";
const THUMBNAIL: &str = "thumbnail.png";

/// A garment, read from its folder.
#[derive(Clone, Debug)]
pub struct Asset {
    /// Metadata.
    pub info: AssetInfo,
    /// Its surface in the canonical pose of the body it was made on, in metres.
    pub mesh: TriMesh,
    /// Its skinning weights, if it has any.
    pub skin: Option<SkinWeights>,
    /// Other content of its file.
    pub beside: Beside,
    /// Its folder.
    pub folder: PathBuf,
}

/// The input of [`write()`].
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// Its name, and that of its folder.
    pub name: &'a str,
    /// Its layer.
    pub hint: LayerHint,
    /// The body it was made on.
    pub body: &'a BodyRef,
    /// The mesh, in the body's canonical pose and in metres. Positions are rounded to single
    /// precision.
    pub mesh: &'a TriMesh,
    /// Skinning weights, one record for each vertex.
    pub skin: Option<&'a SkinWeights>,
    /// Other content of its file.
    pub beside: Option<&'a Beside>,
    /// Its origin.
    pub provenance: &'a Provenance,
    /// φ as a network: the bytes of a checkpoint.
    pub network: Option<&'a [u8]>,
    /// φ of the clothed body as a grid.
    pub baked: Option<&'a Baked>,
}

/// Writes an asset as the folder `parts.name` of `assets`, replacing one of that name.
///
/// # Errors
///
/// [`AssetError`]: the name is invalid, the mesh has no triangles, weights or properties are for
/// other vertices, or files cannot be written.
pub fn write(assets: &FolderWriter, parts: &Parts) -> Result<AssetInfo, AssetError> {
    check_name(parts.name)?;
    if parts.mesh.triangles().is_empty() {
        return Err(AssetError::Empty { name: parts.name.into() });
    }
    parts
        .skin
        .map_or(Ok(()), |skin| skin.check_len(parts.mesh.vertices().len()))
        .map_err(|source| AssetError::SkinCount { name: parts.name.into(), source })?;
    let rounded = ply::quantise(parts.mesh.vertices(), CoordinateType::Float);
    let mesh = parts
        .mesh
        .with_vertices(rounded)
        .map_err(|source| AssetError::Rounding { name: parts.name.into(), source })?;
    assets.write(parts.name, |folder| {
        let store = |file: &str, bytes: &[u8]| -> Result<FileInfo, AssetError> {
            let path = folder.join(file);
            fs::write(&path, bytes).map_err(|source| AssetError::Io { path, source })?;
            Ok(FileInfo { file: file.into(), content: digest(bytes) })
        };
        let mut garment = parts.beside.unwrap_or(&Beside::default()).file(mesh.clone(), parts.skin);
        for licence in &parts.provenance.licence {
            let comment = format!("licence {}", one_line(licence));
            // The file of an asset that is added again already has the comment.
            if !garment.comments.contains(licence) && !garment.comments.contains(&comment) {
                garment.comments.push(comment);
            }
        }
        let mut bytes = Vec::new();
        ply::write(&garment, mesh.vertices(), &WriteParams::default(), &mut bytes)
            .map_err(|source| AssetError::Ply { name: parts.name.into(), source: source.into() })?;
        let garment = store(GARMENT, &bytes)?;
        let network = parts.network.map(|bytes| store(NETWORK, bytes)).transpose()?;
        let baked = parts.baked.map(|field| store(BAKED, &field.to_bytes())).transpose()?;
        let mut png = Vec::new();
        thumbnail::draw(&mesh)
            .write_png(&mut png)
            .map_err(|source| AssetError::Picture { name: parts.name.into(), source })?;
        store(THUMBNAIL, &png)?;
        let info = AssetInfo {
            asset: FORMAT,
            name: parts.name.into(),
            layer: parts.hint,
            body: parts.body.clone(),
            vertices: mesh.vertices().len(),
            triangles: mesh.triangles().len(),
            skinned: parts.skin.is_some(),
            garment,
            phi: Phi { network, baked },
            openings: info::openings(&mesh),
            provenance: parts.provenance.clone(),
        };
        let mut text = serde_json::to_vec_pretty(&info)
            .map_err(|e| AssetError::Json { path: folder.join(INFO), message: e.to_string() })?;
        text.push(b'\n');
        store(INFO, &text)?;
        Ok(info)
    })
}

/// Reads an asset, and checks the hash of its mesh.
///
/// # Errors
///
/// [`AssetError`], with the path of the file.
pub fn read(folder: &Path) -> Result<Asset, AssetError> {
    let info = read_info(folder)?;
    let bytes = load(folder, &info.garment)?;
    let path = || folder.join(&info.garment.file);
    let ply = ply::read_bytes(&bytes)
        .map_err(|e| AssetError::Garment { path: path(), source: e.into() })?;
    let found = (ply.mesh.vertices().len(), ply.mesh.triangles().len());
    if found != (info.vertices, info.triangles) {
        return Err(AssetError::Counts {
            path: path(),
            stated: (info.vertices, info.triangles),
            found,
        });
    }
    let skin = match info.skinned {
        true => Some(
            // The skeleton belongs to the body.
            SkinWeights::from_ply(&ply, SkinWeights::MAX_JOINTS)
                .map_err(|source| AssetError::Skin { path: path(), source })?,
        ),
        false => None,
    };
    let beside = Beside::of(&ply);
    Ok(Asset { info, mesh: ply.mesh, skin, beside, folder: folder.into() })
}

/// Reads only `asset.json`.
///
/// # Errors
///
/// [`AssetError`]: the file is missing, not valid JSON, or of another version.
pub(crate) fn read_info(folder: &Path) -> Result<AssetInfo, AssetError> {
    let path = folder.join(INFO);
    let text = regular_file::read(&path)
        .map_err(|source| AssetError::Io { path: path.clone(), source })?;
    let json =
        |e: serde_json::Error| AssetError::Json { path: path.clone(), message: e.to_string() };
    let value: serde_json::Value = serde_json::from_slice(&text).map_err(json)?;
    // The version first: errors of other versions' keys would be misleading.
    match value.get("asset").and_then(serde_json::Value::as_u64) {
        Some(v) if v == u64::from(FORMAT) => {}
        found => return Err(AssetError::Version { path, found, known: FORMAT }),
    }
    let info: AssetInfo = serde_json::from_value(value).map_err(json)?;
    check_name(&info.name)?;
    Ok(info)
}

/// That there is a file at `path`, without reading it.
pub(crate) fn check_there(path: &Path) -> Result<(), AssetError> {
    let found = fs::metadata(path).map(drop);
    found.map_err(|source| AssetError::Io { path: path.into(), source })
}

impl Asset {
    /// The content of the garment's file.
    pub fn file(&self) -> PlyMesh {
        self.beside.file(self.mesh.clone(), self.skin.as_ref())
    }

    /// The checkpoint of φ's network, if the asset has one.
    ///
    /// # Errors
    ///
    /// The file is missing or has changed.
    pub fn network(&self) -> Result<Option<Vec<u8>>, AssetError> {
        self.info.phi.network.as_ref().map(|file| load(&self.folder, file)).transpose()
    }

    /// φ of the clothed body as a grid, if the asset has one.
    ///
    /// # Errors
    ///
    /// The file is missing, has changed, or is not a valid grid.
    pub fn baked(&self) -> Result<Option<Baked>, AssetError> {
        let Some(file) = &self.info.phi.baked else { return Ok(None) };
        let bytes = load(&self.folder, file)?;
        let baked = Baked::from_bytes(&bytes)
            .map_err(|source| AssetError::Baked { path: self.folder.join(&file.file), source })?;
        Ok(Some(baked))
    }
}

/// Reads a file and checks its hash.
fn load(folder: &Path, file: &FileInfo) -> Result<Vec<u8>, AssetError> {
    let path = regular_file::inside(folder, &file.file)
        .ok_or_else(|| AssetError::Name { name: file.file.clone() })?;
    let bytes = regular_file::read(&path)
        .map_err(|source| AssetError::Io { path: path.clone(), source })?;
    let found = digest(&bytes);
    if found != file.content {
        return Err(AssetError::Changed {
            path,
            stated: file.content.sha256.clone(),
            found: found.sha256,
        });
    }
    Ok(bytes)
}

/// Characters of the longest name.
pub(crate) const LONGEST_NAME: usize = 64;

/// Checks the name of a garment or body. Names become folders on any system: 1 to 64 ASCII letters,
/// digits, `_`, `-` and `.`, without a dot at either end.
///
/// # Errors
///
/// [`AssetError::Name`].
pub fn check_name(name: &str) -> Result<(), AssetError> {
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.is_empty()
        || name.len() > LONGEST_NAME
        || !name.chars().all(fits)
        || name.starts_with('.')
        || name.ends_with('.')
    {
        return Err(AssetError::Name { name: name.into() });
    }
    Ok(())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests;
