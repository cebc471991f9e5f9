//! Aligns garments on bodies, and keeps what it has read and aligned.

use super::combination::Combination;
use super::{Wardrobe, WardrobeBody, WardrobeError};
use crate::asset::Asset;
use if_body::align::{AlignParams, AlignReport, BodyMap, measure};
use if_core::mesh::TriMesh;
use if_mesh::ply::{CoordinateType, quantise};
use if_mesh::solid::ClosedLayer;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::storage::Storage;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Aligns garments of one wardrobe. Threads may share it.
#[derive(Debug)]
pub struct Dresser<'a> {
    wardrobe: &'a Wardrobe,
    params: AlignParams,
    bodies: Kept<String, Dummy>,
    maps: Kept<(String, String), BodyMap>,
    garments: Kept<(String, String), AlignedGarment>,
}

/// A body, ready to be worn on.
#[derive(Debug)]
pub struct Dummy {
    /// As it was read.
    pub body: WardrobeBody,
    /// Its inside.
    pub closed: ClosedLayer,
}

/// A garment on a body.
#[derive(Clone, Debug)]
pub struct AlignedGarment {
    /// As it was read.
    pub asset: Asset,
    /// On the other body, in single precision.
    pub mesh: TriMesh,
    /// What the alignment did.
    pub report: AlignReport,
}

/// A combination, aligned but not resolved.
#[derive(Clone, Debug)]
pub struct Dressed {
    /// Body and garments, inner to outer.
    pub outfit: Outfit,
    /// The garments, in the same order.
    pub garments: Vec<Arc<AlignedGarment>>,
}

/// Bodies, maps or garments that are kept, each: beyond, all go, and are made again where they are
/// asked for. A garment of 10,000 vertices takes 3 MB with its file.
const MOST: usize = 256;

/// What was made once. Two threads may make the same at once; they make the same.
#[derive(Debug)]
struct Kept<K, T>(Mutex<BTreeMap<K, Arc<T>>>);

impl<K: Ord, T> Kept<K, T> {
    fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    fn get<E>(&self, key: K, make: impl FnOnce() -> Result<T, E>) -> Result<Arc<T>, E> {
        // A thread that panicked left whole entries behind.
        let lock = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = lock().get(&key) {
            return Ok(found.clone());
        }
        let made = Arc::new(make()?);
        let mut all = lock();
        if all.len() >= MOST {
            all.clear();
        }
        Ok(all.entry(key).or_insert(made).clone())
    }

    fn clear(&self) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }
}

impl<'a> Dresser<'a> {
    /// For the garments and bodies of `wardrobe`.
    pub fn new(wardrobe: &'a Wardrobe, params: AlignParams) -> Self {
        Self { wardrobe, params, bodies: Kept::new(), maps: Kept::new(), garments: Kept::new() }
    }

    /// The wardrobe.
    pub fn wardrobe(&self) -> &'a Wardrobe {
        self.wardrobe
    }

    /// Forgets what it has read and aligned, at most some hundred garments on their bodies: a
    /// program that runs for long gets the memory back once nobody else holds them.
    pub fn clear(&self) {
        self.bodies.clear();
        self.maps.clear();
        self.garments.clear();
    }

    /// How it aligns.
    pub fn params(&self) -> &AlignParams {
        &self.params
    }

    /// A body.
    ///
    /// # Errors
    ///
    /// It is not there, or of no use.
    pub fn dummy(&self, body: &str) -> Result<Arc<Dummy>, WardrobeError> {
        self.bodies.get(body.to_owned(), || {
            let body = self.wardrobe.body(body)?;
            let closed = ClosedLayer::body(&body.mesh);
            Ok(Dummy { body, closed })
        })
    }

    /// A garment on a body.
    ///
    /// # Errors
    ///
    /// One of them is not there or of no use, or the garment cannot be aligned.
    pub fn aligned(&self, garment: &str, body: &str) -> Result<Arc<AlignedGarment>, WardrobeError> {
        self.garments.get((garment.to_owned(), body.to_owned()), || {
            let info = self.wardrobe.garment_info(garment)?;
            let own_name = self.wardrobe.body_like(garment, &info.body)?.name.clone();
            let asset = self.wardrobe.garment(garment)?;
            let (own, other) = (self.dummy(&own_name)?, self.dummy(body)?);
            let align = |source| WardrobeError::Align {
                garment: garment.into(),
                body: body.into(),
                source,
            };
            let map = self.maps.get((own_name, body.to_owned()), || {
                BodyMap::new(&own.body.shape(), &other.body.shape(), &self.params).map_err(align)
            })?;
            let moved = map.align(&asset.mesh, asset.skin.as_ref()).map_err(align)?;
            // What will be proven must be what a reader of the file gets.
            let rounded = quantise(moved.vertices(), CoordinateType::Float);
            let mesh = moved.with_vertices(rounded).map_err(|e| align(e.into()))?;
            let report = measure(&map, (&asset.mesh, &own.closed), (&mesh, &other.closed));
            Ok(AlignedGarment { asset, mesh, report })
        })
    }

    /// A combination as layers of one body.
    ///
    /// # Errors
    ///
    /// A body or garment that is not there or of no use, one that is named twice, or layers that
    /// make no outfit.
    pub fn dress(&self, combination: &Combination) -> Result<Dressed, WardrobeError> {
        combination.check()?;
        let names = &combination.garments;
        let dummy = self.dummy(&combination.body)?;
        let garments = names
            .iter()
            .map(|name| self.aligned(name, &combination.body))
            .collect::<Result<Vec<_>, _>>()?;
        let layer = |name: &str, mesh: &TriMesh| Layer {
            name: name.into(),
            mesh: mesh.clone(),
            storage: Storage::F32,
        };
        let layers = names.iter().zip(&garments).map(|(name, g)| layer(name, &g.mesh)).collect();
        let outfit = Outfit::new(layer(&combination.body, &dummy.body.mesh), layers)?;
        Ok(Dressed { outfit, garments })
    }
}
