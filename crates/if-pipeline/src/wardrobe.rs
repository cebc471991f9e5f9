//! Wardrobes and clothing matching (Appendix D): folders of bodies and garments, whose combinations
//! are made free of intersections.
//!
//! ```text
//! WARDROBE/
//!   bodies/NAME/    body.json, body.ply, optionally template.ply and skeleton.json
//!   garments/NAME/  an asset: crate::asset
//! ```
//!
//! A [`Wardrobe`] lists its content. A [`dresser::Dresser`] aligns garments on a body. [`matching`]
//! resolves one combination into a result folder, [`batch`] many.

pub mod batch;
mod begun;
mod body;
pub mod combination;
pub mod dresser;
mod error;
mod layer_fields;
pub mod matching;
mod pages;
mod result;
mod result_folder;
mod summary;

pub use body::{BodyInfo, NewBody, WardrobeBody};
pub use error::WardrobeError;

use crate::asset::{self, Asset, AssetError, AssetInfo, BodyRef, Parts};
use body::BodyFiles;
use if_mesh::atomic::{self, FolderWriter, PATIENCE};
use if_outfit::outfit::{OutfitError, check_garment};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

const BODIES: &str = "bodies";
const GARMENTS: &str = "garments";
/// Subfolder of clothed persons, which captures fill.
pub const CLOTHED: &str = "clothed";

/// A part of a wardrobe.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// A body.
    Body,
    /// A garment.
    Garment,
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Body => "body",
            Self::Garment => "garment",
        })
    }
}

/// An unreadable folder of a wardrobe.
#[derive(Debug)]
pub struct Unreadable {
    /// Body or garment.
    pub part: Part,
    /// Its name.
    pub name: String,
    /// The error.
    pub error: WardrobeError,
}

/// A folder of bodies and garments.
#[derive(Debug)]
pub struct Wardrobe {
    root: PathBuf,
    bodies: BTreeMap<String, BodyInfo>,
    garments: BTreeMap<String, AssetInfo>,
    faults: Vec<Unreadable>,
}

impl Wardrobe {
    /// Opens a wardrobe; an empty or missing folder is an empty wardrobe. Unreadable bodies and
    /// garments are listed in [`Wardrobe::faults`]. Interrupted writes of killed processes are undone.
    ///
    /// # Errors
    ///
    /// The folder cannot be read.
    pub fn open(root: &Path) -> Result<Self, WardrobeError> {
        let fault = |source| WardrobeError::Folder { path: root.into(), source };
        let mut wardrobe = Self {
            root: root.into(),
            bodies: BTreeMap::new(),
            garments: BTreeMap::new(),
            faults: Vec::new(),
        };
        [BODIES, GARMENTS].iter().for_each(|part| atomic::restore(&root.join(part)));
        for name in atomic::names(&root.join(BODIES)).map_err(fault)? {
            match wardrobe.stored_body(&name) {
                Ok(info) => drop(wardrobe.bodies.insert(name, info)),
                Err(error) => wardrobe.faults.push(Unreadable { part: Part::Body, name, error }),
            }
        }
        for name in atomic::names(&root.join(GARMENTS)).map_err(fault)? {
            match wardrobe.stored_garment(&name) {
                Ok(info) => drop(wardrobe.garments.insert(name, info)),
                Err(error) => wardrobe.faults.push(Unreadable { part: Part::Garment, name, error }),
            }
        }
        Ok(wardrobe)
    }

    /// Opens an existing wardrobe.
    ///
    /// # Errors
    ///
    /// As [`Wardrobe::open`]; or the folder is missing, or has neither bodies nor garments.
    pub fn open_existing(root: &Path) -> Result<Self, WardrobeError> {
        if [BODIES, GARMENTS].iter().any(|part| root.join(part).is_dir()) {
            return Self::open(root);
        }
        Err(WardrobeError::NoWardrobe { path: root.into() })
    }

    /// Adds a body, or replaces the one of this name.
    ///
    /// # Errors
    ///
    /// The name is invalid, a file is missing or invalid, the body does not stand along y, a folder of
    /// this name is there and is no body, or another process writes there for too long.
    pub fn add_body(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        let writer = self.writer(BODIES)?;
        self.put_body(&writer, new.name, &BodyFiles::read(new)?)
    }

    /// Adds a body unless the wardrobe has one with the same files, under any name. Bodies with other
    /// meshes are not replaced: if the name is taken, a number is appended. So garments keep the body
    /// they were made on, even if several processes add bodies concurrently. A body with the same
    /// mesh but another template or skeleton gets the new ones; files that are not given are kept.
    ///
    /// # Errors
    ///
    /// As [`Wardrobe::add_body`].
    pub fn add_body_once(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        asset::check_name(new.name)?;
        let writer = self.writer(BODIES)?;
        // Other processes may have added bodies.
        self.bodies = Self::open(&self.root)?.bodies;
        let files = BodyFiles::read(new)?;
        if let Some(body) = self.bodies.values().find(|body| files.are_of(body)) {
            return Ok(body.reference());
        }
        if let Some(body) = self.bodies.values().find(|body| files.has_mesh_of(body)) {
            let (name, folder) = (body.name.clone(), self.root.join(BODIES).join(&body.name));
            return self.put_body(&writer, &name, &files.completed(&folder, body)?);
        }
        let numbered = |k: u32| {
            let end = format!("_{k}");
            // Names are ASCII.
            let kept = new.name.len().min(asset::LONGEST_NAME - end.len());
            new.name[..kept].to_owned() + &end
        };
        let mut names = std::iter::once(new.name.to_owned()).chain((2..).map(numbered));
        let name = names
            .find(|name| !self.root.join(BODIES).join(name).exists())
            .expect("some number is free");
        self.put_body(&writer, &name, &files)
    }

    fn put_body(
        &mut self,
        writer: &FolderWriter,
        name: &str,
        files: &BodyFiles,
    ) -> Result<BodyRef, WardrobeError> {
        asset::check_name(name)?;
        own_or_free(&self.root.join(BODIES).join(name), body::INFO)?;
        let info = body::write(writer, name, files)?;
        let found = info.reference();
        self.faults.retain(|f| (f.part, f.name.as_str()) != (Part::Body, name));
        self.bodies.insert(name.to_owned(), info);
        Ok(found)
    }

    /// Checks that a body can be added, without adding it: what [`Wardrobe::add_body_once`] finds at fault.
    ///
    /// # Errors
    ///
    /// As [`Wardrobe::add_body`].
    pub fn check_body(new: &NewBody) -> Result<(), WardrobeError> {
        asset::check_name(new.name)?;
        body::check(new.name, &BodyFiles::read(new)?)
    }

    /// Adds a garment, or replaces the one of this name that the wardrobe had when it was opened.
    ///
    /// # Errors
    ///
    /// [`WardrobeError::Busy`] if another process has written a garment of this name since then.
    /// The wardrobe does not have the body, a folder of this name is there and is no garment, the garment
    /// is called as its body, too large or too far from the body ([`if_outfit::outfit::Outfit::new`]), the errors of [`asset::write()`], or another process
    /// writes there for too long.
    pub fn add(&mut self, parts: &Parts) -> Result<&AssetInfo, WardrobeError> {
        let body = self.body_like(parts.name, parts.body)?;
        if parts.name == body.name {
            let twice = OutfitError::DuplicateName { layer: parts.name.to_owned() };
            return Err(WardrobeError::Misfit(twice));
        }
        if !parts.mesh.triangles().is_empty() {
            let body = body::read_box(&self.root.join(BODIES), body)?;
            check_garment(&body, parts.name, parts.mesh).map_err(WardrobeError::Misfit)?;
        }
        asset::check_name(parts.name)?;
        let writer = self.writer(GARMENTS)?;
        let path = self.root.join(GARMENTS).join(parts.name);
        own_or_free(&path, asset::INFO)?;
        // Another process may have written it since the caller decided to replace it.
        let identity = |g: &AssetInfo| (g.garment.clone(), g.phi.clone(), g.provenance.clone());
        let stored = self.stored_garment(parts.name).ok();
        let known = self.garments.get(parts.name).map(identity);
        if stored.is_some_and(|stored| Some(identity(&stored)) != known) {
            return Err(WardrobeError::Busy { path });
        }
        let info = asset::write(&writer, parts)?;
        self.faults.retain(|f| (f.part, f.name.as_str()) != (Part::Garment, parts.name));
        self.garments.insert(parts.name.to_owned(), info);
        Ok(&self.garments[parts.name])
    }

    fn writer(&self, part: &str) -> Result<FolderWriter, WardrobeError> {
        let path = self.root.join(part);
        let opened = FolderWriter::wait(&path, PATIENCE)
            .map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
        opened.ok_or(WardrobeError::Busy { path })
    }

    /// The metadata of a body's folder. Renaming the folder renames the body.
    fn stored_body(&self, name: &str) -> Result<BodyInfo, WardrobeError> {
        asset::check_name(name)?;
        let folder = self.root.join(BODIES).join(name);
        let info = body::read_info(&folder)?;
        let mesh = folder.join(&info.mesh.file);
        if !mesh.exists() {
            return Err(body::missing(&mesh));
        }
        Ok(BodyInfo { name: name.into(), ..info })
    }

    /// The metadata of a garment's folder.
    fn stored_garment(&self, name: &str) -> Result<AssetInfo, WardrobeError> {
        asset::check_name(name)?;
        let folder = self.root.join(GARMENTS).join(name);
        let info = asset::read_info(&folder)?;
        asset::check_there(&folder.join(&info.garment.file))?;
        Ok(AssetInfo { name: name.into(), ..info })
    }

    /// The folder of the wardrobe.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Checks that a folder for results is not among those of bodies and garments.
    pub(crate) fn keep_out(&self, out: &Path) -> Result<(), WardrobeError> {
        let there = std::path::absolute(out).ok();
        let there = there.iter().flat_map(|out| out.ancestors());
        let there = there.filter_map(|ancestor| ancestor.canonicalize().ok()).next();
        let is_inside = |part: &str| {
            let part = self.root.join(part).canonicalize();
            there.iter().zip(part).any(|(there, part)| there.starts_with(part))
        };
        if [BODIES, GARMENTS, CLOTHED].into_iter().any(is_inside) {
            let what = "it belongs to the wardrobe";
            return Err(WardrobeError::InTheWay { path: out.into(), what });
        }
        Ok(())
    }

    /// All bodies, by name.
    pub fn bodies(&self) -> &BTreeMap<String, BodyInfo> {
        &self.bodies
    }

    /// All garments, by name.
    pub fn garments(&self) -> &BTreeMap<String, AssetInfo> {
        &self.garments
    }

    /// Unreadable folders of bodies and garments.
    pub fn faults(&self) -> &[Unreadable] {
        &self.faults
    }

    /// Whether the folder of this name is unreadable.
    fn is_faulty(&self, part: Part, name: &str) -> bool {
        self.faults.iter().any(|f| (f.part, f.name.as_str()) == (part, name))
    }

    /// The metadata of a body.
    ///
    /// # Errors
    ///
    /// There is no body of this name, or it is unreadable.
    pub fn body_info(&self, name: &str) -> Result<&BodyInfo, WardrobeError> {
        if self.is_faulty(Part::Body, name) {
            self.stored_body(name)?; // returns the error again
        }
        let known = || self.bodies.keys().cloned().collect::<Vec<_>>().join(", ");
        self.bodies
            .get(name)
            .ok_or_else(|| WardrobeError::NoBody { name: name.into(), known: known() })
    }

    /// The metadata of a garment.
    ///
    /// # Errors
    ///
    /// There is no garment of this name, or it is unreadable.
    pub(crate) fn garment_info(&self, name: &str) -> Result<&AssetInfo, WardrobeError> {
        if self.is_faulty(Part::Garment, name) {
            self.stored_garment(name)?;
        }
        let known = || self.garments.keys().cloned().collect::<Vec<_>>().join(", ");
        self.garments
            .get(name)
            .ok_or_else(|| WardrobeError::NoGarment { name: name.into(), known: known() })
    }

    /// The body that a garment was made on, identified by its hash.
    ///
    /// # Errors
    ///
    /// The wardrobe does not have it.
    pub fn body_like(&self, garment: &str, body: &BodyRef) -> Result<&BodyInfo, WardrobeError> {
        self.bodies.values().find(|b| b.reference().sha256 == body.sha256).ok_or_else(|| {
            WardrobeError::ForeignBody {
                garment: garment.into(),
                body: body.name.clone(),
                sha256: body.sha256.clone(),
            }
        })
    }

    /// Reads a body.
    ///
    /// # Errors
    ///
    /// There is none of this name, or its files have changed.
    pub fn body(&self, name: &str) -> Result<WardrobeBody, WardrobeError> {
        body::read(&self.root.join(BODIES).join(name), self.body_info(name)?)
    }

    /// The file of a body's mesh.
    ///
    /// # Errors
    ///
    /// There is none of this name, or its file has changed.
    pub(crate) fn body_file(&self, name: &str) -> Result<Vec<u8>, WardrobeError> {
        body::read_mesh(&self.root.join(BODIES).join(name), self.body_info(name)?)
    }

    /// Reads a garment.
    ///
    /// # Errors
    ///
    /// There is none of this name, or its files have changed.
    pub fn garment(&self, name: &str) -> Result<Asset, WardrobeError> {
        let known = self.garment_info(name)?;
        let folder = self.root.join(GARMENTS).join(name);
        let asset = asset::read(&folder)?;
        // Keys are hashes of the known metadata; another process may have replaced the folder.
        let body = |info: &AssetInfo| info.body.sha256.clone();
        let mut files: Vec<_> =
            asset::files(known).into_iter().zip(asset::files(&asset.info)).collect();
        files.push(((asset::INFO, body(known)), (asset::INFO, body(&asset.info))));
        if let Some(((file, stated), (_, found))) = files.into_iter().find(|(a, b)| a != b) {
            return Err(AssetError::Changed { path: folder.join(file), stated, found }.into());
        }
        Ok(asset)
    }
}

/// Checks that a folder is free, or one that a wardrobe has written: another one is the user's own.
fn own_or_free(folder: &Path, info: &str) -> Result<(), WardrobeError> {
    let is_empty = || fs::read_dir(folder).is_ok_and(|mut files| files.next().is_none());
    if fs::symlink_metadata(folder).is_err() || folder.join(info).is_file() || is_empty() {
        return Ok(());
    }
    let what = "it is no body or garment of a wardrobe, and would be replaced";
    Err(WardrobeError::InTheWay { path: folder.into(), what })
}

#[cfg(test)]
mod tests;
