//! Outfits as they are solved and proven: without the seams of exporters, and rounded to what will
//! be stored.

use crate::outfit::{Layer, Outfit};
use crate::storage::Storage;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::seams::{self, sew};
use rayon::prelude::*;

/// An outfit with the seams of its layers closed ([`sew`]), and the positions of garments in single
/// precision rounded to it. Solved open the seams would gape, and each would be a hem.
pub(crate) struct Sewn {
    pub(crate) outfit: Outfit,
    /// Of each garment; nothing where it has no seam.
    garments: Vec<Option<seams::Sewn>>,
}

impl Sewn {
    /// `None` where the outfit is such a one as it came. The garments' seams stay where their
    /// triangles are to be split: the two sides of a seam have attributes of their own.
    pub(crate) fn new(outfit: &Outfit, garments_too: bool) -> Option<Self> {
        let (body, garments) = rayon::join(
            || sew(&outfit.body.mesh),
            || {
                let prepare = |layer: &Layer| {
                    let sewn = garments_too.then(|| sew(&layer.mesh)).flatten();
                    let stored = stored(layer, sewn.as_ref().map_or(&layer.mesh, |s| &s.mesh));
                    (sewn, stored)
                };
                outfit.garments.par_iter().map(prepare).collect::<Vec<_>>()
            },
        );
        if body.is_none()
            && garments.iter().all(|(sewn, stored)| sewn.is_none() && stored.is_none())
        {
            return None;
        }
        let with = |layer: &Layer, sewn: Option<&seams::Sewn>, stored: Option<TriMesh>| Layer {
            name: layer.name.clone(),
            mesh: stored.unwrap_or_else(|| sewn.map_or(&layer.mesh, |s| &s.mesh).clone()),
            storage: layer.storage,
        };
        let body = with(&outfit.body, body.as_ref(), None);
        let (layers, garments) = outfit
            .garments
            .iter()
            .zip(garments)
            .map(|(layer, (sewn, stored))| (with(layer, sewn.as_ref(), stored), sewn))
            .unzip();
        let outfit = Outfit { body, garments: layers };
        Some(Self { outfit, garments })
    }

    /// The outfit that `came` with the positions that were found for this one.
    pub(crate) fn spread(&self, came: &Outfit, found: Outfit) -> Outfit {
        let opened = |((came, found), sewn): ((&Layer, Layer), &Option<seams::Sewn>)| match sewn {
            Some(sewn) => {
                let positions: Vec<Point> =
                    sewn.spread(found.mesh.vertices(), came.mesh.vertices());
                Layer {
                    mesh: came
                        .mesh
                        .with_vertices(positions)
                        .expect("positions of a mesh are finite"),
                    ..found
                }
            }
            None => found,
        };
        let garments =
            came.garments.iter().zip(found.garments).zip(&self.garments).map(opened).collect();
        Outfit { body: came.body.clone(), garments }
    }
}

/// `mesh` as the file of `layer` will hold it, where that is another one.
fn stored(layer: &Layer, mesh: &TriMesh) -> Option<TriMesh> {
    if layer.storage == Storage::F64 {
        return None;
    }
    let rounded = layer.storage.round(mesh.vertices());
    (rounded != mesh.vertices())
        .then(|| mesh.with_vertices(rounded).expect("rounded positions are finite"))
}
