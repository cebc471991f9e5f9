//! Outfits as they are solved and proven: without the seams of exporters, and rounded to what will be stored.

use crate::outfit::{Layer, Outfit};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::seams::{self, sew};
use rayon::prelude::*;

/// An outfit with the seams of its layers closed ([`sew`]), and the positions of garments in single precision rounded to it.
/// Solved open the seams would gape, and each would be a hem.
pub(crate) struct Sewn {
    pub(crate) outfit: Outfit,
    /// Of each garment; nothing where it has no seam.
    garments: Vec<Option<seams::Sewn>>,
}

impl Sewn {
    /// `None` where the outfit is such a one as it came. The garments' seams stay where their triangles are to be
    /// split: the two sides of a seam have attributes of their own.
    pub(crate) fn new(outfit: &Outfit, garments_too: bool) -> Option<Self> {
        let sewn: Vec<_> = outfit.layers().collect::<Vec<_>>().into_par_iter().map(|l| sew(&l.mesh)).collect();
        let mut garments = sewn.into_iter();
        let body = garments.next().flatten();
        let garments: Vec<_> = garments.map(|sewn| sewn.filter(|_| garments_too)).collect();
        let rounded: Vec<_> = outfit.garments.iter().map(|layer| stored(layer).is_some()).collect();
        if body.is_none() && garments.iter().all(Option::is_none) && !rounded.contains(&true) {
            return None;
        }
        let closed = |layer: &Layer, sewn: Option<&seams::Sewn>| match sewn {
            Some(sewn) => Layer { mesh: sewn.mesh.clone(), ..layer.clone() },
            None => layer.clone(),
        };
        let in_store = |layer: Layer| stored(&layer).map_or(layer.clone(), |mesh| Layer { mesh, ..layer });
        let outfit = Outfit {
            body: closed(&outfit.body, body.as_ref()),
            garments: outfit.garments.iter().zip(&garments).map(|(layer, sewn)| in_store(closed(layer, sewn.as_ref()))).collect(),
        };
        Some(Self { outfit, garments })
    }

    /// The outfit that `came` with the positions that were found for this one.
    pub(crate) fn spread(&self, came: &Outfit, found: Outfit) -> Outfit {
        let opened = |((came, found), sewn): ((&Layer, Layer), &Option<seams::Sewn>)| match sewn {
            Some(sewn) => {
                let positions: Vec<Point> = sewn.spread(found.mesh.vertices(), came.mesh.vertices());
                Layer { mesh: came.mesh.with_vertices(positions).expect("positions of a mesh are finite"), ..found }
            }
            None => found,
        };
        let garments = came.garments.iter().zip(found.garments).zip(&self.garments).map(opened).collect();
        Outfit { body: came.body.clone(), garments }
    }
}

/// The mesh as its file will hold it, where that is another one.
fn stored(layer: &Layer) -> Option<TriMesh> {
    let single = |p: &Point| p.map(|x| Real::from(x as f32));
    let vertices = layer.mesh.vertices();
    let other = layer.single_precision && vertices.iter().any(|p| single(p) != *p);
    // Beyond the range of single precision there is nothing to round to: the garment is refused as too large before.
    other.then(|| layer.mesh.with_vertices(vertices.iter().map(single).collect()).ok()).flatten()
}
