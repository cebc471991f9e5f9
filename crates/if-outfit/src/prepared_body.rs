//! A body that is prepared once for many outfits.

use crate::findings::own_of;
use if_core::mesh::TriMesh;
use if_mesh::seams::weld;
use if_mesh::solid::ClosedLayer;
use std::sync::Arc;

/// A body as outfits on it need it: closed, its seams welded, and its intersections with itself
/// counted.
///
/// [`OutfitFiles::with_body`](crate::files::OutfitFiles::with_body) takes it. Results are the same as
/// without it.
#[derive(Clone, Debug)]
pub struct PreparedBody {
    mesh: TriMesh,
    pub(crate) closed: Arc<ClosedLayer>,
    pub(crate) own_pairs: usize,
}

impl PreparedBody {
    /// Prepares the body with this mesh.
    pub fn new(mesh: &TriMesh) -> Self {
        let mesh = weld(mesh).map_or_else(|| mesh.clone(), |welded| welded.mesh);
        let closed = Arc::new(ClosedLayer::body(&mesh));
        let own_pairs = own_of(&mesh, closed.bvh()).len();
        Self { mesh, closed, own_pairs }
    }

    /// The closed surface.
    pub fn closed(&self) -> &ClosedLayer {
        &self.closed
    }

    /// Whether this is the body with this mesh, whose seams are welded.
    pub(crate) fn is_of(&self, mesh: &TriMesh) -> bool {
        self.mesh == *mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::OutfitFiles;
    use crate::outfit::{Layer, Outfit};
    use crate::params::ResolveParams;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::icosphere;
    use if_mesh::file::MeshFile;
    use if_mesh::ply::PlyMesh;

    #[test]
    fn a_prepared_body_changes_no_result_and_another_body_is_closed_anew() {
        let body = icosphere(1.0, 3);
        let vest = icosphere(0.99, 3);
        let outfit =
            Outfit::new(Layer::new("body", body.clone()), vec![Layer::new("vest", vest.clone())]);
        let files = vec![MeshFile::from_ply(PlyMesh::new(vest))];
        let files = OutfitFiles::from_memory(outfit.unwrap(), files);
        let resolve = |files: &OutfitFiles| {
            let found = files.resolve(&ResolveParams::default(), &mut Silent).unwrap();
            (found.outfit, found.report.without_seconds())
        };
        let expected = resolve(&files);
        let own = Arc::new(PreparedBody::new(&body));
        assert!(own.is_of(&body) && expected.1.layers[0].moved.max > 0.01);
        for prepared in [own, Arc::new(PreparedBody::new(&icosphere(0.5, 2)))] {
            assert_eq!(resolve(&files.clone().with_body(prepared)), expected);
        }
    }
}
