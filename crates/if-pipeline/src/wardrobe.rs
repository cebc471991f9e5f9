//! Clothing matching (Appendix D): a folder of bodies and garments, combined at will and made intersection-free.
//!
//! ```text
//! WARDROBE/
//!   bodies/NAME/    body.json, body.ply (closed), and where there are any template.ply and skeleton.json
//!   garments/NAME/  an asset: crate::asset
//! ```
//!
//! A [`Wardrobe`] knows what is there. A [`dresser::Dresser`] aligns garments on a body and keeps what it has aligned.
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

use crate::asset::{self, Asset, AssetError, AssetInfo, BodyRef, FileInfo, Parts};
use crate::content::{self, Content};
use crate::whole_folder::{self, PATIENCE, Writer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const BODIES: &str = "bodies";
const GARMENTS: &str = "garments";

/// What a folder of bodies and garments holds.
#[derive(Debug)]
pub struct Wardrobe {
    root: PathBuf,
    bodies: BTreeMap<String, BodyInfo>,
    garments: BTreeMap<String, AssetInfo>,
    faults: Vec<(String, AssetError)>,
}

impl Wardrobe {
    /// Reads what is there; an empty or missing folder is an empty wardrobe. A garment that cannot be read does not stop
    /// the others: see [`Wardrobe::faults`].
    ///
    /// # Errors
    ///
    /// A body that cannot be read, or a folder that the system does not give.
    pub fn open(root: &Path) -> Result<Self, WardrobeError> {
        let fault = |source| WardrobeError::Folder { path: root.into(), source };
        let mut wardrobe = Self { root: root.into(), bodies: BTreeMap::new(), garments: BTreeMap::new(), faults: Vec::new() };
        for name in whole_folder::names(&root.join(BODIES)).map_err(fault)? {
            let info = body::read_info(&root.join(BODIES).join(&name))?;
            wardrobe.bodies.insert(name, info);
        }
        for name in whole_folder::names(&root.join(GARMENTS)).map_err(fault)? {
            match asset::read_info(&root.join(GARMENTS).join(&name)) {
                Ok(info) => drop(wardrobe.garments.insert(name, info)),
                Err(error) => wardrobe.faults.push((name, error)),
            }
        }
        Ok(wardrobe)
    }

    /// Adds a body, or replaces the one of this name.
    ///
    /// # Errors
    ///
    /// A name that is no folder's, a file that is missing or of no use, or another process that writes there and does not end.
    pub fn add_body(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        let writer = self.writer(BODIES)?;
        self.put_body(&writer, new)
    }

    /// Adds a body unless one that has its files is there, whatever it is called, and replaces none that has another mesh: where the name
    /// is taken the new one gets a number. So garments keep the body they were made on, also where several processes add bodies at once.
    ///
    /// # Errors
    ///
    /// As [`Wardrobe::add_body`].
    pub fn add_body_once(&mut self, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        let writer = self.writer(BODIES)?;
        self.bodies = Self::open(&self.root)?.bodies; // what others have added
        let content = |path: &Path| content::of_file(path).map_err(|source| WardrobeError::Folder { path: path.into(), source });
        let (mesh, template) = (content(new.mesh)?, new.template.map(content).transpose()?);
        let skeleton = new.skeleton.map(content).transpose()?;
        let is =
            |file: &Option<FileInfo>, new: &Option<Content>| new.is_none() || file.as_ref().map(|f| &f.content) == new.as_ref();
        let name = match self.bodies.values().find(|body| body.mesh.content == mesh) {
            Some(body) if is(&body.template, &template) && is(&body.skeleton, &skeleton) => return Ok(body.reference()),
            Some(body) => body.name.clone(),
            None => {
                let mut names = std::iter::once(new.name.to_owned()).chain((2..).map(|k| format!("{}_{k}", new.name)));
                names.find(|name| !self.bodies.contains_key(name)).expect("some number is free")
            }
        };
        self.put_body(&writer, &NewBody { name: &name, ..*new })
    }

    fn put_body(&mut self, writer: &Writer, new: &NewBody) -> Result<BodyRef, WardrobeError> {
        asset::check_name(new.name)?;
        let info = body::write(writer, new)?;
        let found = info.reference();
        self.bodies.insert(new.name.to_owned(), info);
        Ok(found)
    }

    /// Adds a garment, or replaces the one of this name.
    ///
    /// # Errors
    ///
    /// A body that the wardrobe does not have, those of [`asset::write`], or another process that writes there and does not end.
    pub fn add(&mut self, parts: &Parts) -> Result<&AssetInfo, WardrobeError> {
        self.body_like(parts.name, parts.body)?;
        let info = asset::write(&self.writer(GARMENTS)?, parts)?;
        self.faults.retain(|(name, _)| name != parts.name);
        self.garments.insert(parts.name.to_owned(), info);
        Ok(&self.garments[parts.name])
    }

    fn writer(&self, part: &str) -> Result<Writer, WardrobeError> {
        let path = self.root.join(part);
        let opened = Writer::wait(&path, PATIENCE).map_err(|source| WardrobeError::Folder { path: path.clone(), source })?;
        opened.ok_or(WardrobeError::Busy { path })
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

    /// Folders of garments that cannot be read, and why.
    pub fn faults(&self) -> &[(String, AssetError)] {
        &self.faults
    }

    /// What is known of a body.
    ///
    /// # Errors
    ///
    /// There is none of this name.
    pub fn body_info(&self, name: &str) -> Result<&BodyInfo, WardrobeError> {
        let known = || self.bodies.keys().cloned().collect::<Vec<_>>().join(", ");
        self.bodies.get(name).ok_or_else(|| WardrobeError::NoBody { name: name.into(), known: known() })
    }

    /// What is known of a garment.
    ///
    /// # Errors
    ///
    /// There is none of this name, or it cannot be read.
    pub fn garment_info(&self, name: &str) -> Result<&AssetInfo, WardrobeError> {
        let known = || self.garments.keys().cloned().collect::<Vec<_>>().join(", ");
        self.garments.get(name).ok_or_else(|| WardrobeError::NoGarment { name: name.into(), known: known() })
    }

    /// The body that a garment was made on: by its content, whatever it is called here.
    ///
    /// # Errors
    ///
    /// The wardrobe does not have it.
    pub fn body_like(&self, garment: &str, body: &BodyRef) -> Result<&BodyInfo, WardrobeError> {
        self.bodies.values().find(|b| b.reference().sha256 == body.sha256).ok_or_else(|| WardrobeError::ForeignBody {
            garment: garment.into(),
            body: body.name.clone(),
            sha256: body.sha256.clone(),
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

    /// Reads a garment.
    ///
    /// # Errors
    ///
    /// There is none of this name, or a file of it has changed.
    pub fn garment(&self, name: &str) -> Result<Asset, WardrobeError> {
        self.garment_info(name)?;
        Ok(asset::read(&self.root.join(GARMENTS).join(name))?)
    }
}

#[cfg(test)]
mod tests;
