//! One step of a walk: contacts, a solve, exact verification.

use super::attempt::Attempt;
use super::concerned::concerned;
use super::contact::{Contact, Opening, Search};
use super::equilibrium::{Multipliers, Solved, solve};
use super::locality::Yielding;
use super::turn::turns;
use super::walk::Walker;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;

/// Steps for which triangles that intersected are held apart.
const KEPT: u32 = 12;
/// Displacement of a vertex, in metres, from which on a solve has diverged: contacts that cannot all be met
/// push without bound. More solves would push further, and triangles that reach through the whole scene take
/// minutes to compare.
const DIVERGED: Real = 0.5;
/// Violation of a contact, in metres, that says the same: hardly a solve that leaves more is followed by a
/// clean one with as much of the body held.
const UNMET: Real = 0.05;
/// Times as many sweeps of a solve, and solves, of a walk's step that did not end clean with the body held far
/// from its own overlaps: in a fold with many layers between skin and skin a push takes so many to come through,
/// and a step that is halved costs more.
const THOROUGH: [usize; 2] = [4, 2];

/// Times as many solves at most with the body held far from its own overlaps, while each leaves at most
/// [`FALLING`] of the pairs that the one before left. More of the body, and more effort, is tried only then.
const LONGEST: usize = 2;
/// See [`LONGEST`].
const FALLING: Real = 0.75;

impl Walker {
    /// Goes towards `target`: contacts along directions of the last clean state, a solve, exact
    /// verification; then again with what intersects held apart. Vertices yield as `yielding` has it, by
    /// default near the body's overlaps at the target; if that is not enough, or a solve diverges, the body
    /// near what is left as well, and then everywhere. By default these further solves are more thorough.
    pub(super) fn attempt(
        &self,
        target: &[Point],
        yielding: Option<Yielding>,
        opening: Option<Opening>,
    ) -> Attempt {
        let Self { scene, params, clean, .. } = self;
        let effort = if yielding.is_none() { THOROUGH } else { [1, 1] };
        let mut yielding = yielding.unwrap_or_else(|| self.yielding(target));
        let turns = turns(scene, &self.target, target);
        let mut predicted = self.predicted(target, &turns);
        for v in (0..predicted.len()).filter(|v| yielding.inverse_mass[*v] == 0.0) {
            predicted[v] = target[v];
        }
        let mut multipliers = self.multipliers.clone();
        multipliers.turn(scene, &turns);
        let concerned = if opening.is_some() {
            vec![true; scene.mesh.triangles().len()]
        } else {
            let fading = params.body_length.max(params.garment_length);
            concerned(scene, [&clean.x, &predicted], &multipliers, fading)
        };
        let search = Search {
            scene,
            params,
            rest: &self.rest,
            opening,
            clean: &clean.x,
            tree: &clean.tree,
            turns: &turns,
            predicted: &predicted,
            tolerated: &self.tolerated,
            concerned: &concerned,
        };
        let (mut contacts, mut known) = (search.contacts(), clean.known());
        let near = contacts.len();
        let mut met = self.met.clone();
        let (mut solves, mut sweeps) = (0, 0);
        let reach = params.body_reach;
        let (mut most, mut widened) = (params.solves, false);
        let mut most_sweeps = params.sweeps;
        // What is left after the last solve.
        let mut pairs: Vec<[u32; 2]> = Vec::new();
        loop {
            contacts.truncate(near);
            for (pair, (times, _)) in &met {
                search.separation(*pair, *times, &mut contacts);
            }
            let masses = &yielding.inverse_mass;
            let solution =
                self.solution((target, masses), &contacts, &mut multipliers, most_sweeps);
            let Solution { mesh, tree, solved, has_diverged } = solution;
            solves += 1;
            sweeps += solved.sweeps;
            if has_diverged {
                most = most.min(solves);
            }
            // A state that is not verified is not accepted: what was left before it counts as left.
            if !has_diverged || pairs.is_empty() {
                known.update(&mesh, &tree, &scene.fans);
                let found: Vec<[u32; 2]> = known.pairs.iter().map(|p| [p.a, p.b]).collect();
                let before = pairs.len();
                pairs = self.tolerated.left(&found);
                let is_falling = pairs.len() as Real <= FALLING * before as Real;
                if !widened && is_falling && solves == most && most < LONGEST * params.solves {
                    most += 1;
                }
            }
            tracing::debug!(
                pairs = pairs.len(),
                contacts = contacts.len(),
                sweeps = solved.sweeps,
                violation = solved.violation,
                "solve"
            );
            let is_local = yielding.is_local && !widened;
            if pairs.is_empty() || (solves >= most && !yielding.is_local) {
                let x = mesh.vertices().to_vec();
                let contacts = contacts.len();
                return Attempt {
                    x,
                    tree,
                    pairs,
                    multipliers,
                    met,
                    solves,
                    sweeps,
                    contacts,
                    is_local,
                };
            }
            if solves >= most {
                // More effort separates no fingers of a fist.
                let is_of_body = |t: &u32| (*t as usize) < scene.triangle_starts[1];
                let [sweeps, solves_more] =
                    if pairs.iter().flatten().all(is_of_body) { [1, 1] } else { effort };
                (most, most_sweeps) =
                    (solves + solves_more * params.solves, sweeps * params.sweeps);
                // What was tried with more of the body held counts for nothing.
                multipliers = self.multipliers.clone();
                multipliers.turn(scene, &turns);
                met = self.met.clone();
                if widened {
                    yielding = Yielding::everywhere(scene);
                } else {
                    let left = pairs.iter().flatten().copied();
                    yielding.free_near(scene, target, left, reach);
                    yielding.is_local = yielding.inverse_mass != scene.inverse_mass;
                    widened = true;
                }
                continue;
            }
            for pair in &pairs {
                met.entry(*pair)
                    .and_modify(|(times, left)| (*times, *left) = (*times + 1, KEPT))
                    .or_insert((0, KEPT));
            }
        }
    }

    /// Solves for the state nearest to `target` by at most `sweeps`, and rounds it.
    fn solution(
        &self,
        (target, inverse_mass): (&[Point], &[Real]),
        contacts: &[Contact],
        multipliers: &mut Multipliers,
        sweeps: usize,
    ) -> Solution {
        let Self { scene, storage, .. } = self;
        let mut x = Vec::new();
        let solved = solve(scene, (target, inverse_mass), contacts, multipliers, (sweeps, &mut x));
        scene.copy_doubled(&mut x);
        // What is not a number is not near, either.
        let is_near = |(x, target): (&Point, &Point)| (x - target).norm() <= DIVERGED;
        let has_diverged = solved.violation > UNMET || !x.iter().zip(target).all(is_near);
        if x.iter().flat_map(|p| p.iter()).any(|x| !x.is_finite()) {
            x.copy_from_slice(target);
        }
        let mesh = scene.mesh.with_vertices(storage.round(&x)).expect("solutions that are finite");
        let tree = self.tree(mesh.vertices());
        Solution { mesh, tree, solved, has_diverged }
    }
}

/// What a solve leads to.
struct Solution {
    mesh: TriMesh,
    tree: Bvh,
    solved: Solved,
    /// Whether contacts cannot all be met, and push without bound.
    has_diverged: bool,
}
