//! The dresser: aligns garments on bodies, with caches.

use super::combination::Combination;
use super::{Wardrobe, WardrobeBody, WardrobeError};
use crate::asset::Asset;
use if_body::align::{AlignParams, AlignReport, BodyMap, measure};
use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_mesh::ply::{CoordinateType, quantise};
use if_outfit::PreparedBody;
use if_outfit::outfit::{Layer, Outfit};
use if_outfit::storage::Storage;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Aligns garments of one wardrobe, and caches what it has read and aligned. Threads may share it.
#[derive(Debug)]
pub struct Dresser<'a> {
    wardrobe: &'a Wardrobe,
    params: AlignParams,
    bodies: Cache<String, Dummy>,
    maps: Cache<(String, String), BodyMap>,
    garments: Cache<(String, String), AlignedGarment>,
}

/// A body, prepared for outfits.
#[derive(Debug)]
pub(crate) struct Dummy {
    /// As stored.
    pub(crate) body: WardrobeBody,
    /// Closed.
    pub(crate) prepared: Arc<PreparedBody>,
}

/// A garment on a body.
#[derive(Clone, Debug)]
pub struct AlignedGarment {
    /// As stored.
    pub asset: Asset,
    /// The mesh on the other body, in single precision.
    pub mesh: TriMesh,
    /// Report of the alignment.
    pub report: AlignReport,
    /// How the two bodies stand, if otherwise.
    pub turned: Option<TurnedBone>,
}

/// The bone of a garment's own body that points the farthest from where that of the same name on the other
/// body does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TurnedBone {
    /// Its name.
    pub bone: String,
    /// The angle, in degrees.
    pub degrees: Real,
}

/// Angle of a bone, in degrees, from which on two bodies stand in different poses. Between people who stand
/// alike spines differ by up to 21 degrees; a body that strides differs from them by 48 and 56.
const OTHER_POSE: Real = 25.0;

/// An aligned combination, not yet resolved.
#[derive(Clone, Debug)]
pub struct Dressed {
    /// Body and garments, inner to outer.
    pub outfit: Outfit,
    /// The garments, in the same order.
    pub garments: Vec<Arc<AlignedGarment>>,
    /// The body, prepared for outfits.
    pub body: Arc<PreparedBody>,
}

/// Largest number of cached bodies, maps and garments, each; then the cache is cleared. A garment of
/// 10,000 vertices needs 3 MB with its file.
const MOST: usize = 256;

/// A cache. Two threads may compute the same entry concurrently, with equal results.
#[derive(Debug)]
struct Cache<K, T>(Mutex<BTreeMap<K, Arc<T>>>);

impl<K: Ord, T> Cache<K, T> {
    fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    fn get<E>(&self, key: K, make: impl FnOnce() -> Result<T, E>) -> Result<Arc<T>, E> {
        // Entries are inserted whole, so a poisoned lock is usable.
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
    /// A dresser for the garments and bodies of `wardrobe`.
    pub fn new(wardrobe: &'a Wardrobe, params: AlignParams) -> Self {
        Self { wardrobe, params, bodies: Cache::new(), maps: Cache::new(), garments: Cache::new() }
    }

    /// The wardrobe.
    pub fn wardrobe(&self) -> &'a Wardrobe {
        self.wardrobe
    }

    /// Clears the caches, to free memory in long-running programs.
    pub fn clear(&self) {
        self.bodies.clear();
        self.maps.clear();
        self.garments.clear();
    }

    /// Parameters of the alignment.
    pub fn params(&self) -> &AlignParams {
        &self.params
    }

    /// A body.
    ///
    /// # Errors
    ///
    /// The body is missing or invalid.
    pub(crate) fn dummy(&self, body: &str) -> Result<Arc<Dummy>, WardrobeError> {
        self.bodies.get(body.to_owned(), || {
            let body = self.wardrobe.body(body)?;
            let prepared = Arc::new(PreparedBody::new(&body.mesh));
            Ok(Dummy { body, prepared })
        })
    }

    /// A garment on a body.
    ///
    /// # Errors
    ///
    /// One of them is missing or invalid, or the garment cannot be aligned.
    pub fn aligned(&self, garment: &str, body: &str) -> Result<Arc<AlignedGarment>, WardrobeError> {
        self.garments.get((garment.to_owned(), body.to_owned()), || {
            let info = self.wardrobe.garment_info(garment)?;
            let own_name = self.wardrobe.body_like(garment, &info.body)?.name.clone();
            let mut asset = self.wardrobe.garment(garment)?;
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
            // The proof must hold for what a reader of the file gets.
            let rounded = quantise(moved.vertices(), CoordinateType::Float);
            let mesh = moved.with_vertices(rounded).map_err(|e| align(e.into()))?;
            let [before, after] = [&own, &other].map(|dummy| dummy.prepared.closed());
            let report = measure(&map, (&asset.mesh, before), (&mesh, after));
            // Joints are numbers in the skeleton of the garment's own body, and readers of the file
            // take them for numbers in that of the body it is worn on.
            let skeletons = own.body.skeleton.as_ref().zip(other.body.skeleton.as_ref());
            if let Some((skin, (from, to))) =
                asset.skin.take_if(|_| skeletons.is_some()).zip(skeletons)
            {
                asset.skin = skin.for_skeleton(from, to);
                if asset.skin.is_none() {
                    asset.beside = asset.beside.without_weights();
                }
            }
            let turned = map.most_turned().map(|(bone, angle)| TurnedBone {
                bone: bone.to_owned(),
                degrees: angle.to_degrees(),
            });
            let turned = turned.filter(|turned| turned.degrees >= OTHER_POSE);
            Ok(AlignedGarment { asset, mesh, report, turned })
        })
    }

    /// A combination as an outfit.
    ///
    /// # Errors
    ///
    /// A body or garment is missing or invalid, a garment is named twice, or the layers are not a
    /// valid outfit.
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
        Ok(Dressed { outfit, garments, body: Arc::clone(&dummy.prepared) })
    }
}
