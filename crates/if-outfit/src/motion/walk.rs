//! Walking: from one clean state to the next, each verified exactly.

use super::attempt::{Attempt, Met};
use super::clean::Clean;
use super::equilibrium::Multipliers;
use super::locality::Yielding;
use super::params::WalkParams;
use super::proof::{Proof, prove};
use super::scene::Scene;
use super::tolerated::Tolerated;
use super::turn::turns;
use crate::findings::own_with;
use crate::outfit::{Outfit, OutfitError};
use crate::storage::Storage;
use if_core::math::{Point, Real, turned};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Monitor, Progress, Silent};
use if_core::parameter::ParameterError;
use if_mesh::index::Bvh;
use nalgebra::Matrix3;

/// A motion cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WalkError {
    /// The outfit is invalid.
    #[error(transparent)]
    Outfit(#[from] OutfitError),
    /// A parameter is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Layers of the rest state intersect.
    #[error(
        "{pairs} triangle pairs of the layers intersect in the rest state, triangles {triangles:?} of `{}` and `{}` first; resolve the outfit before it moves",
        layers[0], layers[1]
    )]
    NotClean {
        /// Number of pairs between layers.
        pairs: usize,
        /// The first of them.
        triangles: [u32; 2],
        /// The names of the layers of the first pair.
        layers: [String; 2],
    },
    /// The target has the wrong number of positions, or one that is not finite.
    #[error(
        "the target state has {got} finite positions before the first invalid one, of {expected}; give one for each vertex of all layers, the body first"
    )]
    Target {
        /// Leading positions that are finite.
        got: usize,
        /// Vertices of all layers.
        expected: usize,
    },
    /// The monitor cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// How far a walk came.
#[derive(Clone, Debug, PartialEq, Default)]
#[non_exhaustive]
pub struct Walked {
    /// Share of the path: 1 if its end was reached, and less if no smaller step was clean.
    pub reached: Real,
    /// Steps that were accepted.
    pub steps: usize,
    /// Steps that were halved.
    pub halved: usize,
    /// Solves of all steps.
    pub solves: usize,
    /// Sweeps of all solves.
    pub sweeps: usize,
    /// Contacts of the last solve.
    pub contacts: usize,
    /// Accepted steps in which the body yields farther from its own overlaps than
    /// [`WalkParams::body_reach`].
    pub wide: usize,
    /// Intersecting triangle pairs of the last step that was not accepted, with their layers (0 is
    /// the body) and triangles there; empty if the end was reached.
    pub unresolved: Vec<[(usize, u32); 2]>,
}

/// An outfit that follows a motion, free of intersections at each step.
///
/// Body and garments are solved in one problem, so that the body yields where it meets itself. All
/// states are rounded to single precision, or as [`stored_as`](Self::stored_as) says, before they are
/// verified.
#[derive(Clone, Debug)]
pub struct Walker {
    pub(super) scene: Scene,
    pub(super) params: WalkParams,
    /// The rest state, with layers a little apart.
    pub(super) rest: Vec<Point>,
    /// Own pairs of the rest state, which may stay, and what intersects a body that is kept.
    pub(super) tolerated: Tolerated,
    /// What the current state follows.
    pub(super) target: Vec<Point>,
    /// The tree of the rest state. Its shape serves all states, by a refit: searches then do not
    /// depend on the way that led to a state, and no tree is built again.
    shape: Bvh,
    /// The same of the body alone.
    body_shape: Bvh,
    pub(super) clean: Clean,
    pub(super) multipliers: Multipliers,
    pub(super) met: Met,
    /// Whether the body is let go where it alone keeps a step from being clean.
    pub(super) is_letting_go: bool,
    /// How states are stored: to what each is rounded before it is verified.
    pub(super) storage: Storage,
}

impl Walker {
    /// Takes an outfit whose layers do not intersect, and moves layers that lie nearer than [`WalkParams::gap`] apart, as far as there is room. Own pairs of layers may
    /// stay.
    ///
    /// # Errors
    ///
    /// An invalid outfit or parameter, or layers that intersect.
    pub fn new(outfit: &Outfit, params: WalkParams) -> Result<Self, WalkError> {
        let mut walker = Self::at_rest(outfit, params, Storage::F32)?;
        let everywhere = Yielding::everywhere(&walker.scene);
        walker.open(&everywhere, 0.0, &mut Silent)?;
        Ok(walker)
    }

    /// Takes an outfit as [`Walker::new`] does, with its layers where they are, rounded to `storage`.
    pub(super) fn at_rest(
        outfit: &Outfit,
        params: WalkParams,
        storage: Storage,
    ) -> Result<Self, WalkError> {
        params.validate()?;
        outfit.check()?;
        let scene = Scene::new(outfit, &params);
        let x = storage.round(scene.mesh.vertices());
        let mesh = scene.mesh.with_vertices(x.clone()).expect("a mesh in metres stays finite");
        let tree = Bvh::new(&mesh);
        let tolerated = own_with(&mesh, &tree, &scene.fans);
        let layers = |pair: &[u32; 2]| pair.map(|t| scene.local_triangle(t));
        let between: Vec<_> = tolerated.iter().map(layers).filter(|[a, b]| a.0 != b.0).collect();
        if let Some([a, b]) = between.first() {
            let names: Vec<&String> = outfit.layers().map(|layer| &layer.name).collect();
            return Err(WalkError::NotClean {
                pairs: between.len(),
                triangles: [a.1, b.1],
                layers: [a.0, b.0].map(|k| names[k].clone()),
            });
        }
        Ok(Self {
            rest: x.clone(),
            target: x.clone(),
            shape: tree.clone(),
            body_shape: Bvh::new(&scene.layer_mesh(&x, 0)),
            clean: Clean { x, tree, is_verified: true },
            multipliers: Multipliers::default(),
            met: Met::new(),
            is_letting_go: false,
            scene,
            params,
            tolerated: Tolerated { own: tolerated, ..Tolerated::default() },
            storage,
        })
    }

    /// The walker with all later states rounded to `storage`, and so verified; by default to
    /// [`Storage::F32`].
    pub fn stored_as(self, storage: Storage) -> Self {
        Self { storage, ..self }
    }

    /// The rest state, the body first: what targets are computed from.
    pub fn rest(&self) -> &[Point] {
        &self.rest
    }

    /// The current state, the body first.
    pub fn positions(&self) -> &[Point] {
        &self.clean.x
    }

    /// The positions of one layer, 0 for the body, in `positions` of all.
    ///
    /// # Panics
    ///
    /// If there are fewer positions than vertices, or no such layer.
    pub fn layer<'a>(&self, positions: &'a [Point], layer: usize) -> &'a [Point] {
        self.scene.of_layer(positions, layer)
    }

    /// Intersecting triangle pairs of `positions`, which the rest state does not have: for both
    /// triangles the layer, 0 for the body, and the index there.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn intersections(&self, positions: &[Point]) -> Result<Vec<[(usize, u32); 2]>, WalkError> {
        let mesh = self.mesh(positions)?;
        let pairs = self.tolerated.left(&own_with(&mesh, &self.tree(positions), &self.scene.fans));
        Ok(pairs.iter().map(|p| p.map(|t| self.scene.local_triangle(t))).collect())
    }

    /// `target` with the displacements of the current state from its own target, turned along: a
    /// guess that need not be clean.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn carried(&self, target: &[Point]) -> Result<Vec<Point>, WalkError> {
        self.check(target)?;
        let turns = turns(&self.scene, &self.target, target);
        let mut x = self.storage.round(&self.predicted(target, &turns));
        self.scene.copy_doubled(&mut x);
        Ok(x)
    }

    /// Verifies `positions` exactly.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn prove(&self, positions: &[Point]) -> Result<Proof, WalkError> {
        self.check(positions)?;
        Ok(prove(&self.scene, positions, &self.tolerated))
    }

    /// Goes back to the rest state, moved as a whole: `target` is the rest state after a rotation
    /// and translation. What was let go stays so.
    ///
    /// # Errors
    ///
    /// [`WalkError::Target`].
    pub fn restart(&mut self, target: Vec<Point>) -> Result<(), WalkError> {
        let mut x = self.storage.round(&target);
        self.scene.copy_doubled(&mut x);
        self.check(&x)?;
        self.clean = Clean { tree: self.tree(&x), x, is_verified: false };
        self.target = target;
        self.multipliers = Multipliers::default();
        self.met.clear();
        Ok(())
    }

    /// Follows the `path` of targets, from the current one at 0 to 1, in `steps` steps or smaller
    /// ones.
    ///
    /// If a step does not end clean after it was halved [`WalkParams::halvings`] times, the walk
    /// ends early, in the last clean state; but where the body alone is in the way, it may be
    /// [let go](Self::set_letting_go).
    ///
    /// # Errors
    ///
    /// An invalid target, or the monitor cancelled.
    pub fn walk(
        &mut self,
        steps: usize,
        path: &dyn Fn(Real) -> Vec<Point>,
        monitor: &mut dyn Monitor,
    ) -> Result<Walked, WalkError> {
        self.follow(steps, path, None, monitor)
    }

    /// As [`walk`](Self::walk), with where the body yields; by default near its overlaps at the
    /// target of each step.
    pub(super) fn follow(
        &mut self,
        steps: usize,
        path: &dyn Fn(Real) -> Vec<Point>,
        yielding: Option<Yielding>,
        monitor: &mut dyn Monitor,
    ) -> Result<Walked, WalkError> {
        let largest = 1.0 / steps.max(1) as Real;
        let least = largest * 0.5_f64.powi(self.params.halvings as i32);
        let (mut walked, mut step) = (Walked::default(), largest);
        while walked.reached < 1.0 {
            let left = 1.0 - walked.reached;
            // No last step is a small rest.
            let to = if step > 0.999 * left { 1.0 } else { walked.reached + step };
            let target = path(to);
            self.check(&target)?;
            let attempt = self.attempt(&target, yielding.clone(), None);
            walked.solves += attempt.solves;
            walked.sweeps += attempt.sweeps;
            walked.contacts = attempt.contacts;
            let pairs = attempt.pairs.len();
            tracing::debug!(
                to,
                pairs,
                contacts = attempt.contacts,
                sweeps = attempt.sweeps,
                solves = attempt.solves,
                "step"
            );
            monitor.report(&Progress {
                done: walked.steps,
                measures: &[("reached", walked.reached), ("pairs", pairs as Real)],
                ..Progress::stage("walk")
            })?;
            if pairs == 0 {
                walked.wide += usize::from(!attempt.is_local);
                self.accept(attempt, target);
                walked.reached = to;
                walked.steps += 1;
                step = (2.0 * step).min(largest);
                continue;
            }
            walked.halved += 1;
            step = 0.5 * (to - walked.reached);
            if step < 0.999 * least {
                if self.is_letting_go && self.let_go_near(&attempt.pairs, &target) {
                    step = least;
                    continue;
                }
                walked.unresolved =
                    attempt.pairs.iter().map(|p| p.map(|t| self.scene.local_triangle(t))).collect();
                break;
            }
        }
        Ok(walked)
    }

    /// The body yields near its overlaps at `reference`.
    pub(super) fn yielding(&self, reference: &[Point]) -> Yielding {
        let reach = self.params.body_reach;
        Yielding::near_overlaps(&self.scene, reference, &self.body_shape, reach)
    }

    pub(super) fn accept(&mut self, attempt: Attempt, target: Vec<Point>) {
        self.clean = Clean { x: attempt.x, tree: attempt.tree, is_verified: true };
        self.multipliers = attempt.multipliers;
        self.met = attempt.met;
        self.met.retain(|_, (times, left)| {
            // A gap that was needed once need not stay.
            *times /= 2;
            *left -= 1;
            *left > 0
        });
        self.target = target;
    }

    pub(super) fn check(&self, target: &[Point]) -> Result<(), WalkError> {
        check_positions(target, self.rest.len())
    }

    /// The tree of a state.
    pub(super) fn tree(&self, positions: &[Point]) -> Bvh {
        let mut tree = self.shape.clone();
        tree.refit(positions);
        tree
    }

    pub(super) fn mesh(&self, positions: &[Point]) -> Result<TriMesh, WalkError> {
        self.check(positions)?;
        let expected = self.rest.len();
        let mesh = self.scene.mesh.with_vertices(positions.to_vec());
        mesh.map_err(|_| WalkError::Target { got: 0, expected })
    }

    /// `target` with the displacements of the current state, turned along.
    pub(super) fn predicted(&self, target: &[Point], turns: &[Matrix3<Real>]) -> Vec<Point> {
        (0..target.len())
            .map(|v| target[v] + turned(&turns[v], &(self.clean.x[v] - self.target[v])))
            .collect()
    }
}

/// Checks that there are as many finite positions as expected.
pub(super) fn check_positions(target: &[Point], expected: usize) -> Result<(), WalkError> {
    let finite = |p: &Point| p.iter().all(|x| x.is_finite());
    let got = target.iter().take_while(|p| finite(p)).count();
    if got == expected && target.len() == expected {
        Ok(())
    } else {
        Err(WalkError::Target { got, expected })
    }
}
