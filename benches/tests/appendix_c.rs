//! Appendix C: with the original field of the clothed body a jacket's sleeves are moved far from
//! the garments below it; masked by the boxes of those garments, they are not.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use if_benches::baselines::algorithm1::{ClothedBody, run};
use if_body::mannequin::{Garment, MannequinParams, body, garment};
use if_core::masked::{BoxesMask, Mask};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::solid::{ClosedLayer, ClothedField};
use if_xpbd::params::SolverParams;
use std::sync::LazyLock;

/// Fig. 3 on the built-in mannequin: what is below the jacket, and the jacket.
struct Scene {
    body: ClosedLayer,
    skirt: ClosedLayer,
    tshirt: ClosedLayer,
    jacket: TriMesh,
}

static SCENE: LazyLock<Scene> = LazyLock::new(Scene::new);

impl Scene {
    fn new() -> Self {
        let params = MannequinParams::default();
        let naked = body(&params);
        let closed = ClosedLayer::body(&naked);
        let inner = |g| ClosedLayer::garment(&garment(g, &params), &closed, &naked);
        let (skirt, tshirt) = (inner(Garment::Skirt), inner(Garment::Tshirt));
        let jacket = garment(Garment::Jacket, &params);
        // Not aligned well: the sleeves cut through the arms.
        let shifted = jacket.vertices().iter().map(|p| p + Vector::new(0.0, 0.0, -0.03)).collect();
        Self { skirt, tshirt, jacket: jacket.with_vertices(shifted).unwrap(), body: closed }
    }

    fn field(&self) -> ClothedField<'_> {
        ClothedField::new(vec![&self.body, &self.skirt, &self.tshirt])
    }

    fn boxes(&self) -> BoxesMask {
        BoxesMask::new([self.skirt.bvh().aabb(), self.tshirt.bvh().aabb()]).unwrap()
    }

    /// How far the jacket's vertices move, in metres: those outside the boxes, and those inside
    /// one.
    fn moved(&self, masked: bool, params: &SolverParams) -> [Vec<Real>; 2] {
        let field = self.field();
        let below = ClothedBody { field: &field, mask: masked.then(|| self.boxes()), air: None };
        let after = run(&self.jacket, &below, params).unwrap();
        let boxes = self.boxes();
        let select = |binds: bool| {
            let far = |(p, q): (&Point, &Point)| (boxes.binds(p) == binds).then(|| (p - q).norm());
            self.jacket.vertices().iter().zip(&after).filter_map(far).collect()
        };
        [select(false), select(true)]
    }
}

fn most(moved: &[Real]) -> Real {
    moved.iter().copied().fold(0.0, Real::max)
}

#[test]
fn the_masked_field_moves_no_vertex_outside_the_boxes_and_the_original_one_does() {
    let scene = &*SCENE;
    for params in [
        SolverParams { steps: 1, ..SolverParams::literal() },
        SolverParams { steps: 1, ..Default::default() },
    ] {
        // Lines 6 to 10 alone: the field is the only thing that moves a vertex.
        let params = SolverParams { compliance: Real::INFINITY, ..params };
        let [outside, inside] = scene.moved(false, &params);
        assert!(outside.len() > 50 && most(&outside) > 2e-3, "{} mm", 1e3 * most(&outside));
        assert!(most(&inside) > 2e-3);
        let [outside, inside] = scene.moved(true, &params);
        assert_eq!(most(&outside), 0.0);
        assert!(most(&inside) > 2e-3);
    }
}

#[test]
fn stretch_drags_some_of_the_sleeves_along_but_less_than_the_original_field_pushes_them() {
    let scene = &*SCENE;
    let params = SolverParams { steps: 2, ..Default::default() };
    let mean = |m: &[Real]| m.iter().sum::<Real>() / m.len() as Real;
    let [original, _] = scene.moved(false, &params);
    let [masked, _] = scene.moved(true, &params);
    assert!(
        0.0 < mean(&masked) && mean(&masked) < 0.6 * mean(&original),
        "{} against {} mm",
        1e3 * mean(&masked),
        1e3 * mean(&original)
    );
}
