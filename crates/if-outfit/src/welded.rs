//! Outfits as they are solved and proven: with the seams of exporters welded, and positions rounded
//! to what will be stored.

use crate::outfit::{Layer, Outfit};
use crate::storage::Storage;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::seams::{self, weld};
use rayon::prelude::*;

/// An outfit with the seams of its layers welded ([`weld`]), and the positions of garments rounded to
/// their storage. Solved open, the seams would gape, and each would be a hem.
pub(crate) struct Welded {
    pub(crate) outfit: Outfit,
    /// For each garment its welded seams; `None` if it has no seam.
    garments: Vec<Option<seams::Welded>>,
}

impl Welded {
    /// Welds the body, and the garments if `garments_too`. Returns `None` if nothing needs welding
    /// or rounding. Triangles at an open seam can be split: its two sides have attributes of their
    /// own.
    pub(crate) fn new(outfit: &Outfit, garments_too: bool) -> Option<Self> {
        let (body, garments) = rayon::join(
            || weld(&outfit.body.mesh),
            || {
                let prepare = |layer: &Layer| {
                    let welded = garments_too.then(|| weld(&layer.mesh)).flatten();
                    let stored = stored(layer, welded.as_ref().map_or(&layer.mesh, |s| &s.mesh));
                    (welded, stored)
                };
                outfit.garments.par_iter().map(prepare).collect::<Vec<_>>()
            },
        );
        if body.is_none()
            && garments.iter().all(|(welded, stored)| welded.is_none() && stored.is_none())
        {
            return None;
        }
        let with = |layer: &Layer, welded: Option<&seams::Welded>, stored: Option<TriMesh>| Layer {
            name: layer.name.clone(),
            mesh: stored.unwrap_or_else(|| welded.map_or(&layer.mesh, |s| &s.mesh).clone()),
            storage: layer.storage,
        };
        let body = with(&outfit.body, body.as_ref(), None);
        let (layers, garments) = outfit
            .garments
            .iter()
            .zip(garments)
            .map(|(layer, (welded, stored))| (with(layer, welded.as_ref(), stored), welded))
            .unzip();
        let outfit = Outfit { body, garments: layers };
        Some(Self { outfit, garments })
    }

    /// The outfit `given` with the positions that were found for this one.
    pub(crate) fn unweld(&self, given: &Outfit, found: Outfit) -> Outfit {
        let open =
            |((given, found), welded): ((&Layer, Layer), &Option<seams::Welded>)| match welded {
                Some(welded) => {
                    let positions: Vec<Point> =
                        welded.unweld(found.mesh.vertices(), given.mesh.vertices());
                    let mesh = given.mesh.with_vertices(positions);
                    Layer { mesh: mesh.expect("positions of a mesh are finite"), ..found }
                }
                None => found,
            };
        let garments =
            given.garments.iter().zip(found.garments).zip(&self.garments).map(open).collect();
        Outfit { body: given.body.clone(), garments }
    }

    /// Whether the seams of an outfit that was [unwelded](Self::unweld) are those that were welded.
    /// Where more than two triangles meet along coincident edges, as in a soup, moves decide which of
    /// them are seams.
    pub(crate) fn holds(&self, found: &Outfit) -> bool {
        let same = |(layer, welded): (&Layer, &Option<seams::Welded>)| {
            let now = |w: &seams::Welded| weld(&layer.mesh).map(|n| n.vertex_map == w.vertex_map);
            welded.as_ref().is_none_or(|welded| now(welded) == Some(true))
        };
        found.garments.par_iter().zip(&self.garments).all(same)
    }
}

/// `mesh` rounded to the storage of `layer`; `None` if rounding changes nothing.
fn stored(layer: &Layer, mesh: &TriMesh) -> Option<TriMesh> {
    if layer.storage == Storage::F64 {
        return None;
    }
    let rounded = layer.storage.round(mesh.vertices());
    (rounded != mesh.vertices())
        .then(|| mesh.with_vertices(rounded).expect("rounded positions are finite"))
}
