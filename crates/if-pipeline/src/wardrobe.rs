//! Clothing matching (Appendix D): a folder of bodies and garments, combined at will and made
//! intersection-free.
//!
//! ```text
//! WARDROBE/
//!   bodies/NAME/    body.json, body.ply (closed), and where there are any template.ply and skeleton.json
//!   garments/NAME/  an asset: crate::asset
//! ```
//!
//! A [`Wardrobe`] knows what is there. A [`dresser::Dresser`] aligns garments on a body and keeps
//! what it has aligned.
//! [`matching`] resolves one combination into a result folder; [`batch`] many, and goes on where it was stopped.

pub mod batch;
mod body;
pub mod combination;
pub mod dresser;
mod error;
pub mod matching;
mod pages;
mod result_folder;

pub use body::{BodyInfo, NewBody, WardrobeBody};
pub use error::WardrobeError;

use crate::asset::{self, Asset, AssetError, AssetInfo, BodyRef, Parts};
use body::BodyFiles;
use if_mesh::whole_folder::{self, PATIENCE, Writer};
use if_outfit::outfit::check_garment;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BODIES: &str = "bodies";
const GARMENTS: &str = "garments";

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

/// A folder of a wardrobe that cannot be read.
#[derive(Debug)]
pub struct Unreadable {
    /// What it should be.
    pub part: Part,
    /// Its name.
    pub name: String,
    /// Why.
    pub error: WardrobeError,
}

/// What a folder of bodies and garments holds.
#[derive(Debug)]
pub struct Wardrobe {
    root: PathBuf,
    bodies: BTreeMap<String, BodyInfo>,
    garments: BTreeMap<String, AssetInfo>,
    faults: Vec<Unreadable>,
}

impl Wardrobe {
    /// Reads what is there; an empty or missing folder is an empty wardrobe. A body or garment that
    /// cannot be read does not stop the others: see [`Wardrobe::faults`]. What a process that was
    /// killed had moved away is put back.
    ///
    /// # Errors
    ///
    /// A folder that the system does not give.
    pub fn open(root: &Path) -> Result<Self, WardrobeError> {
        let fault = |source| WardrobeError::Folder { path: root.into(), source };
        let mut wardrobe = Self {
            root: root.into(),
            bodies: BTreeMap::new(),
            garments: BTreeMap::new(),
            faults: Vec::new(),
        };
        [BODIES, GARMENTS].iter().for_each(|part| whole_folder::restore(&root.join(part)));
        for name in whole_folder::names(&root.join(BODIES)).map_err(fault)? {
            match wardrobe.stored_body(&name) {
                Ok(info) => drop(wardrobe.bodies.insert(name, info)),
                Err(error) => wardrobe.faults.push(Unreadable { part: Part::Body, name, error }),
            }
        }
        for name in whole_folder::names(&root.join(GARMENTS)).map_err(fault)? {
            match wardrobe.stored_garment(&name) {
                Ok(info) => drop(wardrobe.garments.insert(name, info)),
                Err(error) => wardrobe.faults.push(Unreadable { part: Part::Garment, name, error }),
            }
        }
        Ok(wardrobe)
    }

    /// As [`Wardrobe::open`], for those who have nothing to add.
    ///
    /// # Errors
    ///
    /// Also a folder that is missing, or that holds neither bodies nor garments.
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
    /// A name that is no folder's, a file that is missing or of no use, or another process that
    /// writes there and does not end.
    pub fn add_body(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        let writer = self.writer(BODIES)?;
        self.put_body(&writer, new.name, &BodyFiles::read(new)?)
    }

    /// Adds a body unless one that has its files is there, whatever it is called, and replaces none
    /// that has another mesh: where the name is taken the new one gets a number. So garments keep
    /// the body they were made on, also where several processes add bodies at once. A body that has
    /// the mesh, but another template or skeleton, takes the new one; what is not given it keeps.
    ///
    /// # Errors
    ///
    /// As [`Wardrobe::add_body`].
    pub fn add_body_once(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        let writer = self.writer(BODIES)?;
        self.bodies = Self::open(&self.root)?.bodies; // what others have added
        let files = BodyFiles::read(new)?;
        if let Some(body) = self.bodies.values().find(|body| files.are_of(body)) {
            return Ok(body.reference());
        }
        if let Some(body) = self.bodies.values().find(|body| files.has_mesh_of(body)) {
            let (name, folder) = (body.name.clone(), self.root.join(BODIES).join(&body.name));
            return self.put_body(&writer, &name, &files.completed(&folder, body)?);
        }
        let mut names =
            std::iter::once(new.name.to_owned()).chain((2..).map(|k| format!("{}_{k}", new.name)));
        let name = names
            .find(|name| !self.root.join(BODIES).join(name).exists())
            .expect("some number is free");
        self.put_body(&writer, &name, &files)
    }

    fn put_body(
        &mut self,
        writer: &Writer,
        name: &str,
        files: &BodyFiles,
    ) -> Result<BodyRef, WardrobeError> {
        asset::check_name(name)?;
        let info = body::write(writer, name, files)?;
        let found = info.reference();
        self.faults.retain(|f| (f.part, f.name.as_str()) != (Part::Body, name));
        self.bodies.insert(name.to_owned(), info);
        Ok(found)
    }

    /// Adds a garment, or replaces the one of this name.
    ///
    /// # Errors
    ///
    /// A body that the wardrobe does not have, a garment too large for it or too far from it
    /// ([`if_outfit::outfit::Outfit::new`]), those of
    /// [`asset::write`], or another process that writes there and does not end.
    pub fn add(&mut self, parts: &Parts) -> Result<&AssetInfo, WardrobeError> {
        let body = self.body_like(parts.name, parts.body)?;
        if !parts.mesh.triangles().is_empty() {
            let body = body::read_box(&self.root.join(BODIES), body)?;
            check_garment(&body, parts.name, parts.mesh).map_err(WardrobeError::Misfit)?;
        }
        let info = asset::write(&self.writer(GARMENTS)?, parts)?;
        self.faults.retain(|f| (f.part, f.name.as_str()) != (Part::Garment, parts.name));
        self.garments.insert(parts.name.to_owned(), info);
        Ok(&self.garments[parts.name])
    }

    fn writer(&self, part: &str) -> Result<Writer, WardrobeError> {
        let path = self.root.join(part);
        let opened = Writer::wait(&path, PATIENCE)
            .map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
        opened.ok_or(WardrobeError::Busy { path })
    }

    /// What the folder of a body says. Whoever has renamed it has renamed the body; a name that no
    /// combination can have is an error.
    fn stored_body(&self, name: &str) -> Result<BodyInfo, WardrobeError> {
        asset::check_name(name)?;
        Ok(BodyInfo { name: name.into(), ..body::read_info(&self.root.join(BODIES).join(name))? })
    }

    /// The same of a garment.
    fn stored_garment(&self, name: &str) -> Result<AssetInfo, WardrobeError> {
        asset::check_name(name)?;
        Ok(AssetInfo {
            name: name.into(),
            ..asset::read_info(&self.root.join(GARMENTS).join(name))?
        })
    }

    /// Where it stands.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// All bodies, by name.
    pub fn bodies(&self) -> &BTreeMap<String, BodyInfo> {
        &self.bodies
    }

    /// All garments, by name.
    pub fn garments(&self) -> &BTreeMap<String, AssetInfo> {
        &self.garments
    }

    /// Folders of bodies and garments that cannot be read, and why.
    pub fn faults(&self) -> &[Unreadable] {
        &self.faults
    }

    /// Whether the folder of this name cannot be read.
    fn is_faulty(&self, part: Part, name: &str) -> bool {
        self.faults.iter().any(|f| (f.part, f.name.as_str()) == (part, name))
    }

    /// What is known of a body.
    ///
    /// # Errors
    ///
    /// There is none of this name, or it cannot be read.
    pub fn body_info(&self, name: &str) -> Result<&BodyInfo, WardrobeError> {
        if self.is_faulty(Part::Body, name) {
            self.stored_body(name)?; // says once more what is wrong
        }
        let known = || self.bodies.keys().cloned().collect::<Vec<_>>().join(", ");
        self.bodies
            .get(name)
            .ok_or_else(|| WardrobeError::NoBody { name: name.into(), known: known() })
    }

    /// What is known of a garment.
    ///
    /// # Errors
    ///
    /// There is none of this name, or it cannot be read.
    pub fn garment_info(&self, name: &str) -> Result<&AssetInfo, WardrobeError> {
        if self.is_faulty(Part::Garment, name) {
            self.stored_garment(name)?;
        }
        let known = || self.garments.keys().cloned().collect::<Vec<_>>().join(", ");
        self.garments
            .get(name)
            .ok_or_else(|| WardrobeError::NoGarment { name: name.into(), known: known() })
    }

    /// The body that a garment was made on: by its content, whatever it is called here.
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
    /// There is none of this name, or a file of it has changed.
    pub fn body(&self, name: &str) -> Result<WardrobeBody, WardrobeError> {
        body::read(&self.root.join(BODIES).join(name), self.body_info(name)?)
    }

    /// The file of a body's mesh.
    ///
    /// # Errors
    ///
    /// There is none of this name, or the file has changed.
    pub fn body_file(&self, name: &str) -> Result<Vec<u8>, WardrobeError> {
        body::read_mesh(&self.root.join(BODIES).join(name), self.body_info(name)?)
    }

    /// Reads a garment.
    ///
    /// # Errors
    ///
    /// There is none of this name, or a file of it has changed.
    pub fn garment(&self, name: &str) -> Result<Asset, WardrobeError> {
        let known = self.garment_info(name)?;
        let folder = self.root.join(GARMENTS).join(name);
        let asset = asset::read(&folder)?;
        // Keys are made of what is known: another process may have replaced the folder since.
        if (&asset.info.garment, &asset.info.body) != (&known.garment, &known.body) {
            let path = folder.join(&known.garment.file);
            let (stated, found) =
                (known.garment.content.sha256.clone(), asset.info.garment.content.sha256);
            return Err(AssetError::Changed { path, stated, found }.into());
        }
        Ok(asset)
    }
}

#[cfg(test)]
mod tests;
