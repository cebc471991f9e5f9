//! The built-in scene: STAND-IN until the mannequin lands.

use crate::args::{Size, Variant};
use if_core::mesh::TriMesh;

/// Body first, then garments, inner to outer.
pub(crate) fn layers(_variant: Variant, _size: Size) -> Vec<(String, TriMesh)> {
    let ball = |r: f64| {
        let t = 0.5 * (1.0 + 5f64.sqrt());
        let v = [
            [-1., t, 0.],
            [1., t, 0.],
            [-1., -t, 0.],
            [1., -t, 0.],
            [0., -1., t],
            [0., 1., t],
            [0., -1., -t],
            [0., 1., -t],
            [t, 0., -1.],
            [t, 0., 1.],
            [-t, 0., -1.],
            [-t, 0., 1.],
        ];
        let f = vec![
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ];
        TriMesh::new(v.map(|p| if_core::math::Point::new(p[0] * r, p[1] * r, p[2] * r)).to_vec(), f)
            .expect("an icosahedron is a mesh")
    };
    vec![("body".into(), ball(0.3)), ("tshirt".into(), ball(0.31)), ("coat".into(), ball(0.32))]
}
