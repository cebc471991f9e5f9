//! A body that is let go: where it meets itself, and no step is clean otherwise, it may.
//!
//! Fingers of a fist pass through one another in most motions, and so does skin in a fold that is finer than
//! the triangles around. Such places would stop a whole outfit that does not come near them.

use super::locality::near;
use super::walk::{WalkError, Walker};
use crate::findings::own_with;
use if_core::math::{Point, Real};

/// Distance, in metres, from the corners of triangles that meet, up to which the body is let go: a finger is
/// that thick, or two.
const REACH: Real = 0.03;

impl Walker {
    /// Whether later walks let the body go where it meets itself in a step that cannot be made clean: its
    /// triangles within 30 mm of there have no contacts with one another from then on. Contacts with
    /// garments stay.
    pub fn set_letting_go(&mut self, is_letting_go: bool) {
        self.is_letting_go = is_letting_go;
    }

    /// Triangles of the body that are let go.
    pub fn triangles_let_go(&self) -> usize {
        self.tolerated.let_go.iter().filter(|is| **is).count()
    }

    /// Lets the body go where it meets itself in `positions`, and nowhere else.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn let_go_as_in(&mut self, positions: &[Point]) -> Result<(), WalkError> {
        self.hold_all();
        let mesh = self.mesh(positions)?;
        let found = own_with(&mesh, &self.tree(positions), &self.scene.fans);
        self.let_go_near(&self.tolerated.left(&found), positions);
        Ok(())
    }

    /// Lets the body go nowhere.
    pub fn hold_all(&mut self) {
        self.tolerated.let_go.clear();
    }

    /// Lets the body go near those of the `pairs` that are of it alone, as they are at `reference`. Returns
    /// whether more of it is let go than before.
    pub(super) fn let_go_near(&mut self, pairs: &[[u32; 2]], reference: &[Point]) -> bool {
        let (vertices, body) = (self.scene.starts[1], self.scene.triangle_starts[1]);
        let is_of_body = |pair: &&[u32; 2]| pair.iter().all(|t| (*t as usize) < body);
        let triangles = self.scene.mesh.triangles();
        let met = pairs.iter().filter(is_of_body).flatten();
        let places: Vec<Point> =
            met.flat_map(|t| triangles[*t as usize]).map(|v| reference[v as usize]).collect();
        let is_near = near(&reference[..vertices], &places, REACH);
        let before = self.triangles_let_go();
        if !places.is_empty() {
            self.tolerated.let_go.resize(body, false);
        }
        for (let_go, t) in self.tolerated.let_go.iter_mut().zip(triangles) {
            *let_go |= t.iter().any(|v| is_near[*v as usize]);
        }
        let Self { met, tolerated, .. } = self;
        met.retain(|pair, _| !tolerated.permits(*pair));
        let let_go = self.triangles_let_go();
        tracing::debug!(let_go, before, "let go");
        let_go > before
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{arm, outfit};
    use super::super::{WalkParams, Walker};
    use super::*;
    use if_core::math::Vector;
    use if_core::mesh::TriMesh;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes::icosphere;

    /// The arm, and two balls 1 cm apart and 30 cm away from it, which belong to the body: the first of
    /// the second one's vertices, and the outfit.
    fn arm_and_fingers() -> (usize, crate::outfit::Outfit) {
        let scene = arm();
        let (mut vertices, mut triangles) =
            (scene.body.mesh.vertices().to_vec(), scene.body.mesh.triangles().to_vec());
        let mut second = 0;
        for x in [0.30, 0.33] {
            second = vertices.len();
            let ball = icosphere(0.01, 2);
            vertices.extend(ball.vertices().iter().map(|p| p + Vector::x() * x));
            triangles.extend(ball.triangles().iter().map(|t| t.map(|v| v + second as u32)));
        }
        let garments = scene.garments.into_iter().map(|g| g.mesh).collect();
        (second, outfit(TriMesh::new(vertices, triangles).unwrap(), garments))
    }

    #[test]
    fn a_body_that_meets_itself_far_from_garments_is_let_go_there_alone() {
        let (second, scene) = arm_and_fingers();
        let (skin, body) = (scene.body.mesh.vertices().len(), scene.body.mesh.triangles().len());
        // One solve of one sweep separates nothing: no step is clean.
        let weak = WalkParams { solves: 1, sweeps: 1, halvings: 0, ..WalkParams::default() };
        let mut walker = Walker::new(&scene, WalkParams::default()).unwrap();
        walker.params = weak;
        let rest = walker.rest().to_vec();
        let path = |t: Real| {
            let mut x = rest.clone();
            x[second..skin].iter_mut().for_each(|p| p.x -= 0.02 * t);
            x
        };
        let walked = walker.walk(1, &path, &mut Silent).unwrap();
        assert!(walked.reached < 1.0 && walker.triangles_let_go() == 0, "{walked:?}");
        assert!(walked.unresolved.iter().flatten().all(|(layer, _)| *layer == 0));

        walker.restart(rest.clone()).unwrap();
        walker.set_letting_go(true);
        assert_eq!(walker.walk(1, &path, &mut Silent).unwrap().reached, 1.0);
        let (let_go, now) = (walker.triangles_let_go(), walker.positions().to_vec());
        assert!(let_go > 100 && let_go <= 640, "the balls alone, of {body}: {let_go}");
        assert!(walker.intersections(&now).unwrap().is_empty());
        let proof = walker.prove(&now).unwrap();
        assert!(proof.own_pairs[0] > 10, "{proof:?}");
        assert_eq!((proof.pairs, proof.inside, proof.new_own_pairs), (0, 0, 0));

        // A snapshot holds it, and so does another walker that takes the state.
        let mut other = Walker::new(&scene, weak).unwrap();
        other.restore(&walker.snapshot()).unwrap();
        assert_eq!(other.triangles_let_go(), let_go);
        other.hold_all();
        assert!(other.triangles_let_go() == 0 && !other.intersections(&now).unwrap().is_empty());
        other.let_go_as_in(&now).unwrap();
        assert!(other.intersections(&now).unwrap().is_empty());
    }

    #[test]
    fn a_garment_in_the_way_is_never_let_go() {
        let scene = arm();
        let weak = WalkParams { solves: 1, sweeps: 1, halvings: 0, ..WalkParams::default() };
        let mut walker = Walker::new(&scene, WalkParams::default()).unwrap();
        walker.params = weak;
        let rest = walker.rest().to_vec();
        let skin = scene.body.mesh.vertices().len();
        // Half of the sleeve shrinks into the arm.
        let path = |t: Real| {
            let mut x = rest.clone();
            for p in x[skin..].iter_mut().filter(|p| p.y < 0.0) {
                (p.x, p.z) = (p.x * (1.0 - 0.3 * t), p.z * (1.0 - 0.3 * t));
            }
            x
        };
        walker.set_letting_go(true);
        let walked = walker.walk(1, &path, &mut Silent).unwrap();
        assert!(walked.reached < 1.0 && walker.triangles_let_go() == 0, "{walked:?}");
    }
}
