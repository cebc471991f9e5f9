//! The triangles of a layer that tell on which side of it a vertex lies: of a body without the parts that are
//! hidden in it, of a garment as one sheet that is wound away from the body.

use if_core::math::Point;
use if_core::mesh::TriMesh;
use if_mesh::body_surface::without_hidden_parts;
use if_mesh::index::Bvh;
use if_mesh::sheet::away_from;

/// Some of a layer's triangles, perhaps turned.
#[derive(Clone, Debug)]
pub(super) struct Sides {
    triangles: Vec<[u32; 3]>,
    /// The number of each in the layer.
    given: Vec<u32>,
}

impl Sides {
    /// Those of each layer, the body first, wound outwards; `None` where they are the layer's own.
    pub(super) fn new(layers: &[TriMesh]) -> Vec<Option<Self>> {
        let Some((body, garments)) = layers.split_first() else { return Vec::new() };
        let of_body = without_hidden_parts(body).map(|given| {
            let triangles = given.iter().map(|t| body.triangles()[*t as usize]).collect();
            Self { triangles, given }
        });
        let skin = of_body.as_ref().map(|sides| sides.mesh(body.vertices()));
        let tree = Bvh::new(skin.as_ref().unwrap_or(body));
        let of_garment = |mesh: &TriMesh| {
            away_from(mesh, &tree).map(|(triangles, given)| Self { triangles, given })
        };
        std::iter::once(of_body).chain(garments.iter().map(of_garment)).collect()
    }

    /// The surface, with the layer's vertices at `positions`.
    pub(super) fn mesh(&self, positions: &[Point]) -> TriMesh {
        TriMesh::new(positions.to_vec(), self.triangles.clone())
            .expect("positions that were checked, and triangles of a mesh")
    }

    /// The number in the layer of the surface's triangle `t`.
    pub(super) fn given(&self, t: u32) -> u32 {
        self.given[t as usize]
    }
}
