//! Outfits as they are solved and proven: with the seams of exporters welded, and positions rounded
//! to what will be stored.

use crate::outfit::{Layer, Outfit};
use crate::report::LayerReport;
use crate::storage::Storage;
use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::measure::{displacement, strain};
use if_mesh::seams::{self, weld, weld_all};
use if_mesh::split::SplitMesh;
use rayon::prelude::*;

/// An outfit with the seams of its body welded ([`weld`]), all vertices at one position of a garment
/// ([`weld_all`]), and the positions of garments rounded to their storage. Solved open, seams would gape, and
/// pockets come off.
pub(crate) struct Welded {
    pub(crate) outfit: Outfit,
    /// For each garment its welded seams; `None` if it has no seam.
    garments: Vec<Option<seams::Welded>>,
    /// Whether rounding moved it.
    rounded: Vec<bool>,
}

impl Welded {
    /// Welds the layers. Returns `None` if nothing needs welding or rounding.
    pub(crate) fn new(outfit: &Outfit) -> Option<Self> {
        let (body, garments) = rayon::join(
            || weld(&outfit.body.mesh),
            || {
                let prepare = |layer: &Layer| {
                    let welded = weld_all(&layer.mesh);
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
        let rounded = garments.iter().map(|(_, stored)| stored.is_some()).collect();
        let (layers, garments) = outfit
            .garments
            .iter()
            .zip(garments)
            .map(|(layer, (welded, stored))| (with(layer, welded.as_ref(), stored), welded))
            .unzip();
        let outfit = Outfit { body, garments: layers };
        Some(Self { outfit, garments, rounded })
    }

    /// The outfit `given` with the positions that were found for this one, and its garments split as
    /// these were: `splits` become those of `given`, and the seams those of what is returned.
    pub(crate) fn unweld(
        &mut self,
        given: &Outfit,
        found: Outfit,
        splits: &mut [Option<SplitMesh>],
    ) -> Outfit {
        let layers = given.garments.iter().zip(found.garments);
        let layers = layers.zip(self.garments.iter_mut().zip(splits));
        let garments = layers.map(|((given, found), (welded, split))| {
            let Some(welded) = welded else { return found };
            let mut mesh = &given.mesh;
            if let Some(split) = split {
                let open = split.unweld(welded, mesh);
                (*split, *welded) = open.expect("fewer vertices than 32-bit indices");
                mesh = &split.mesh;
            }
            let positions: Vec<Point> = welded.unweld(found.mesh.vertices(), mesh.vertices());
            let mesh = mesh.with_vertices(positions).expect("positions of a mesh are finite");
            Layer { mesh, ..found }
        });
        Outfit { body: given.body.clone(), garments: garments.collect() }
    }
}

impl Welded {
    /// Measures garments that rounding moved against those given instead of the rounded ones; those that were
    /// split have other vertices.
    pub(crate) fn measure_rounded(&self, [given, found]: [&Outfit; 2], layers: &mut [LayerReport]) {
        let garments = given.garments.iter().zip(&found.garments).zip(layers).zip(&self.rounded);
        for (((given, found), report), _) in garments.filter(|(_, rounded)| **rounded) {
            let [before, after] = [given, found].map(|layer| &layer.mesh);
            if before.triangles() == after.triangles() {
                report.moved = displacement(before.vertices(), after.vertices());
                report.strain = strain(before, after.vertices());
            }
        }
    }
}

/// Whether the seams of the garments `found` are those that were welded in `given` before it was solved.
/// Moves can decide which edges are seams: of more than two that coincide, as in a soup, and where hems come
/// to lie on one another.
pub(crate) fn seams_hold(welded: Option<&Welded>, given: &Outfit, found: &Outfit) -> bool {
    let same = |(k, layer): (usize, &Layer)| {
        if layer.mesh.vertices() == given.garments[k].mesh.vertices() {
            return true;
        }
        let was = welded.and_then(|w| w.garments[k].as_ref()).map(|w| &w.vertex_map);
        weld_all(&layer.mesh).as_ref().map(|now| &now.vertex_map) == was
    };
    found.garments.par_iter().enumerate().all(same)
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

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes::icosphere;

    /// Two triangles beside one another, `apart` metres.
    fn patches(apart: f64) -> TriMesh {
        let corner = |x: f64, y: f64| Point::new(2.0 + x, y, 0.0);
        let left = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0)];
        let right = [corner(1.0 + apart, 1.0), corner(1.0 + apart, 0.0), corner(2.0, 0.0)];
        TriMesh::new([left, right].concat(), vec![[0, 1, 2], [3, 4, 5]]).unwrap()
    }

    fn outfit(mesh: TriMesh) -> Outfit {
        let body = Layer::new("body", icosphere(1.0, 1));
        Outfit { body, garments: vec![Layer::new("patches", mesh)] }
    }

    #[test]
    fn seams_that_open_or_close_do_not_hold() {
        let (open, sewn) = (outfit(patches(0.1)), outfit(patches(0.0)));
        assert!(Welded::new(&open).is_none());
        assert!(seams_hold(None, &open, &open) && !seams_hold(None, &open, &sewn));
        let welded = Welded::new(&sewn).unwrap();
        assert!(seams_hold(Some(&welded), &sewn, &sewn));
        assert!(!seams_hold(Some(&welded), &sewn, &open));
    }
}
