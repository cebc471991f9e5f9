//! A garment as an asset: a folder with its mesh and skinning weights, its φ where there is one,
//! and what is known of it.
//!
//! ```text
//! NAME/
//!   asset.json      what is known: AssetInfo
//!   garment.ply     the mesh in the body's canonical pose, single precision, weights as j0..j3 and w0..w3, and what else its source has
//!   phi.safetensors φ as a network, where there is one
//!   phi.baked       φ of the clothed body as a narrow-band grid, where there is one
//!   thumbnail.png   front and back
//! ```
//!
//! The folder is written whole or not at all ([`if_mesh::whole_folder`]); its files are named with
//! their hashes in `asset.json`, which [`read`] checks.

mod beside;
mod class;
mod error;
mod info;
mod thumbnail;

pub use beside::Beside;
pub use class::{GarmentClass, LayerHint, is_wearable};
pub use error::AssetError;
pub use info::{AssetInfo, BodyRef, FileInfo, Opening, Phi, Provenance};

use if_body::SkinWeights;
use if_core::mesh::TriMesh;
use if_mesh::baked::Baked;
use if_mesh::ply::{self, CoordinateType, PlyMesh, WriteParams};
use if_mesh::whole_folder::Writer;
use if_outfit::content::content;
use std::fs;
use std::path::{Path, PathBuf};

/// The version of the format that is written.
pub const FORMAT: u32 = 1;
/// What is known of the garment.
pub const INFO: &str = "asset.json";
const GARMENT: &str = "garment.ply";
const NETWORK: &str = "phi.safetensors";
const BAKED: &str = "phi.baked";
const THUMBNAIL: &str = "thumbnail.png";
/// Weights may name any joint that a PLY file's byte can: the skeleton that has them belongs to the
/// body.
const JOINTS: usize = 256;

/// A garment that was read.
#[derive(Clone, Debug)]
pub struct Asset {
    /// What is known of it.
    pub info: AssetInfo,
    /// Its surface in the canonical pose of the body it was made on, in metres.
    pub mesh: TriMesh,
    /// Its skinning weights, where it has some.
    pub skin: Option<SkinWeights>,
    /// What else its file holds.
    pub beside: Beside,
    /// Where it stands.
    pub folder: PathBuf,
}

/// What an asset is made of.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// What it is called, and its folder too.
    pub name: &'a str,
    /// Where it is worn.
    pub hint: LayerHint,
    /// The body it was made on.
    pub body: &'a BodyRef,
    /// The mesh, in the body's canonical pose and in metres. Positions are rounded to single
    /// precision.
    pub mesh: &'a TriMesh,
    /// One record for each vertex.
    pub skin: Option<&'a SkinWeights>,
    /// What its file holds beside.
    pub beside: Option<&'a Beside>,
    /// Where it comes from.
    pub provenance: &'a Provenance,
    /// φ as a network: the bytes of a checkpoint.
    pub network: Option<&'a [u8]>,
    /// φ of the clothed body as a grid.
    pub baked: Option<&'a Baked>,
}

/// Writes an asset as the folder `parts.name` of `assets`, in place of one of that name.
///
/// # Errors
///
/// [`AssetError`]: a name that is no folder's, a mesh without triangles, weights or properties for other vertices, or the system.
pub fn write(assets: &Writer, parts: &Parts) -> Result<AssetInfo, AssetError> {
    check_name(parts.name)?;
    if parts.mesh.triangles().is_empty() {
        return Err(AssetError::Empty { name: parts.name.into() });
    }
    if let Some(skin) = parts.skin
        && skin.len() != parts.mesh.vertices().len()
    {
        let (vertices, records) = (parts.mesh.vertices().len(), skin.len());
        return Err(AssetError::SkinCount { name: parts.name.into(), vertices, records });
    }
    let rounded = ply::quantise(parts.mesh.vertices(), CoordinateType::Float);
    let mesh = parts
        .mesh
        .with_vertices(rounded)
        .map_err(|source| AssetError::Rounding { name: parts.name.into(), source })?;
    assets.write(parts.name, |folder| {
        let store = |file: &str, bytes: &[u8]| -> Result<FileInfo, AssetError> {
            let path = folder.join(file);
            fs::write(&path, bytes).map_err(|source| AssetError::Io { path, source })?;
            Ok(FileInfo { file: file.into(), content: content(bytes) })
        };
        let mut garment = parts.beside.unwrap_or(&Beside::default()).file(mesh.clone(), parts.skin);
        for licence in &parts.provenance.licence {
            let told = format!("licence {}", one_line(licence));
            // The file of an asset that is added again says so already.
            if !garment.comments.contains(licence) && !garment.comments.contains(&told) {
                garment.comments.push(told);
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

/// Reads an asset, and checks that its files are those that `asset.json` names.
///
/// # Errors
///
/// [`AssetError`], with the file at fault.
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
            SkinWeights::from_ply(&ply, JOINTS)
                .map_err(|source| AssetError::Skin { path: path(), source })?,
        ),
        false => None,
    };
    let beside = Beside::of(&ply);
    Ok(Asset { info, mesh: ply.mesh, skin, beside, folder: folder.into() })
}

/// Reads `asset.json` alone.
///
/// # Errors
///
/// [`AssetError`]: a file that is missing, is no JSON, or has another version.
pub fn read_info(folder: &Path) -> Result<AssetInfo, AssetError> {
    let path = folder.join(INFO);
    let text = fs::read(&path).map_err(|source| AssetError::Io { path: path.clone(), source })?;
    let json =
        |e: serde_json::Error| AssetError::Json { path: path.clone(), message: e.to_string() };
    let value: serde_json::Value = serde_json::from_slice(&text).map_err(json)?;
    // Before anything else: of another version, other keys would be at fault.
    match value.get("asset").and_then(serde_json::Value::as_u64) {
        Some(v) if v == u64::from(FORMAT) => {}
        found => return Err(AssetError::Version { path, found, known: FORMAT }),
    }
    let info: AssetInfo = serde_json::from_value(value).map_err(json)?;
    check_name(&info.name)?;
    Ok(info)
}

impl Asset {
    /// The garment's file, as it was read.
    pub fn file(&self) -> PlyMesh {
        self.beside.file(self.mesh.clone(), self.skin.as_ref())
    }

    /// The checkpoint of φ's network, where the asset has one.
    ///
    /// # Errors
    ///
    /// A file that is missing or has changed.
    pub fn network(&self) -> Result<Option<Vec<u8>>, AssetError> {
        self.info.phi.network.as_ref().map(|file| load(&self.folder, file)).transpose()
    }

    /// φ of the clothed body as a grid, where the asset has one.
    ///
    /// # Errors
    ///
    /// A file that is missing, has changed, or is no grid.
    pub fn baked(&self) -> Result<Option<Baked>, AssetError> {
        let Some(file) = &self.info.phi.baked else { return Ok(None) };
        let bytes = load(&self.folder, file)?;
        let baked = Baked::from_bytes(&bytes)
            .map_err(|source| AssetError::Baked { path: self.folder.join(&file.file), source })?;
        Ok(Some(baked))
    }
}

/// The bytes of a file, if they are those that were stated.
fn load(folder: &Path, file: &FileInfo) -> Result<Vec<u8>, AssetError> {
    let name = Path::new(&file.file);
    if name.components().count() != 1 || name.file_name().is_none() {
        return Err(AssetError::Name { name: file.file.clone() });
    }
    let path = folder.join(name);
    let bytes = fs::read(&path).map_err(|source| AssetError::Io { path: path.clone(), source })?;
    let found = content(&bytes);
    if found != file.content {
        return Err(AssetError::Changed {
            path,
            stated: file.content.sha256.clone(),
            found: found.sha256,
        });
    }
    Ok(bytes)
}

/// Whether a name can be that of a garment or body. Names become folders, on any system: 1 to 64
/// ASCII letters, digits, `_`, `-` and `.`, the last neither first nor at the end.
///
/// # Errors
///
/// [`AssetError::Name`].
pub fn check_name(name: &str) -> Result<(), AssetError> {
    const LONGEST: usize = 64;
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.is_empty()
        || name.len() > LONGEST
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
