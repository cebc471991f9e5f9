//! The neighbourhood of some contours, which alone moves while they are removed.

use super::contours::{Contour, Way, normal};
use crate::cloth::{quasi_static, step};
use crate::elastic_groups::ElasticGroups;
use crate::outfit::Layer;
use crate::params::ResolveParams;
use crate::separating_plane::least_motion_plane;
use if_core::aabb::Aabb;
use if_core::edges::{Edges, VertexTriangles};
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::monitor::Cancelled;
use if_mesh::index::Bvh;
use if_mesh::intersections::own_pairs;
use if_mesh::measure::strain_of;
use if_xpbd::constraint::Constraint;
use if_xpbd::particles::Particles;
use if_xpbd::separation::Separations;
use if_xpbd::solver::Solver;
use std::collections::{BTreeMap, BTreeSet};

/// Rounds in which the contours must vanish.
const ROUNDS: usize = 40;
/// Rounds without fewer pairs after which a way is given up.
const IN_VAIN: usize = 14;
/// Rounds in which the patch relaxes after that.
const RELAXING: usize = 16;
/// Rounds over which two triangles that intersected are held apart.
const KEPT: u32 = 12;
/// Pairs held apart for each free vertex that cost no more than the cloth does. Sequins have some, what is tangled all
/// over hundreds.
const HELD: usize = 32;
/// Maximum motion of a corner of an intersecting pair in a round, in metres. The deeper a region
/// is, the more rounds it takes; ten times more tears the cloth.
const STEP: Real = 2e-3;

/// A part of a garment, with its own numbers for vertices and triangles.
pub(super) struct Patch<'a> {
    garment: &'a Layer,
    pub(super) params: &'a ResolveParams,
    /// For each vertex that of the garment.
    vertices: Vec<u32>,
    /// The part in the input: the cloth at rest.
    pub(super) mesh: TriMesh,
    pub(super) edges: Edges,
    groups: ElasticGroups,
    inverse_masses: Vec<Real>,
    /// For each vertex how much nearer it is to the second sheet of its contour than to the first,
    /// in metres.
    sides: Vec<Real>,
    /// For each vertex the nearest contour.
    nearest: Vec<u32>,
    /// Contours of the patch, in numbers of the patch.
    pub(super) contours: Vec<Contour>,
}

/// What a patch came to.
#[derive(Clone)]
pub(super) struct Outcome {
    /// Own pairs of the patch.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Root mean square of the edge strain against the input.
    pub(super) strain: Real,
    /// The largest one.
    pub(super) largest: Real,
    /// Positions of the patch as they are stored.
    pub(super) positions: Vec<Point>,
    /// Rounds made until now.
    pub(super) rounds: usize,
    /// Pairs that were held apart beyond [`HELD`] for each free vertex, in all rounds together.
    pub(super) excess: usize,
}

impl Outcome {
    pub(super) fn rank(&self) -> (usize, Real) {
        (self.pairs.len(), self.strain)
    }
}

impl<'a> Patch<'a> {
    /// The part of `garment`, with its vertices at `x`, round the vertices that are `near` some sources along the
    /// surface, ascending and up to `reach` metres, and what lies near it. `tree` holds the garment at `x`.
    pub(super) fn new(
        garment: &'a Layer,
        x: &[Point],
        reach: Real,
        (near, triangles_at, tree): (&[(u32, Real)], &VertexTriangles, &Bvh),
        params: &'a ResolveParams,
    ) -> Self {
        let whole = garment.mesh.triangles();
        let far =
            |v: u32| near.binary_search_by_key(&v, |n| n.0).map_or(Real::INFINITY, |k| near[k].1);
        let region = Aabb::from_points(near.iter().map(|(v, _)| &x[*v as usize]));
        // What the free vertices can reach, and the triangles round them.
        let mut chosen = BTreeSet::new();
        tree.overlapping(&region.inflated(0.25 * reach), |t| {
            chosen.insert(t);
        });
        chosen.extend(near.iter().flat_map(|(v, _)| triangles_at.of(*v as usize)));
        let mut numbers: BTreeMap<u32, u32> = BTreeMap::new();
        let mut vertices = Vec::new();
        let triangles: Vec<[u32; 3]> = chosen
            .iter()
            .map(|t| {
                whole[*t as usize].map(|v| {
                    *numbers.entry(v).or_insert_with(|| {
                        vertices.push(v);
                        vertices.len() as u32 - 1
                    })
                })
            })
            .collect();
        let rest = garment.mesh.vertices();
        let rest = vertices.iter().map(|v| rest[*v as usize]).collect();
        let mesh = TriMesh::new(rest, triangles).expect("a part of a mesh");
        let edges = Edges::new(&mesh);
        let start: Vec<Point> = vertices.iter().map(|v| x[*v as usize]).collect();
        let mut groups = ElasticGroups::without_ties(&mesh, &start, &edges, &params.cloth);
        let softest = params.cloth.anchor_compliance;
        let mut inverse_masses = Vec::with_capacity(vertices.len());
        for (k, v) in vertices.iter().enumerate() {
            let d = far(*v);
            inverse_masses.push(Real::from(u8::from(d.is_finite())));
            let near = 1.0 - (d / reach).min(1.0);
            let compliance = crate::cloth::STIFFEST_ANCHOR
                + (softest - crate::cloth::STIFFEST_ANCHOR) * near * near;
            groups.anchors.set_compliance(k, compliance).expect("between two that are valid");
        }
        let mut this = Self {
            garment,
            params,
            mesh,
            edges,
            groups,
            inverse_masses,
            sides: vec![0.0; vertices.len()],
            nearest: vec![0; vertices.len()],
            vertices,
            contours: Vec::new(),
        };
        let mesh = this.at(&start);
        let pairs = this.pairs(&mesh, &Bvh::new(&mesh));
        this.contours = Contour::all(&mesh, &this.edges, &pairs);
        this.find_sides(reach);
        this
    }

    /// Finds the nearest contour and the nearer sheet of each vertex.
    fn find_sides(&mut self, reach: Real) {
        let neighbours = Neighbours::new(&self.edges, self.mesh.vertices());
        let mut least = vec![Real::INFINITY; self.vertices.len()];
        for (k, contour) in self.contours.iter().enumerate() {
            let sheets = contour.vertices(self.mesh.triangles());
            let [first, second] =
                sheets.map(|sheet| neighbours.distances(sheet.iter().copied(), 4.0 * reach));
            for v in 0..least.len() {
                let (a, b) = (first[v], second[v]);
                if a.min(b) < least[v] {
                    least[v] = a.min(b);
                    self.nearest[v] = k as u32;
                    self.sides[v] = match (a.is_finite(), b.is_finite()) {
                        (true, true) => a - b,
                        (true, false) => -reach,
                        _ => reach,
                    };
                }
            }
        }
    }

    /// The positions of the patch, of those of the garment.
    pub(super) fn positions(&self, x: &[Point]) -> Vec<Point> {
        self.vertices.iter().map(|v| x[*v as usize]).collect()
    }

    /// Writes the free positions of the patch into those of the garment.
    pub(super) fn write(&self, positions: &[Point], x: &mut [Point]) {
        for (k, v) in self.vertices.iter().enumerate() {
            if self.inverse_masses[k] > 0.0 {
                x[*v as usize] = positions[k];
            }
        }
    }

    pub(super) fn at(&self, x: &[Point]) -> TriMesh {
        self.mesh.with_vertices(x.to_vec()).expect("the solver keeps positions finite")
    }

    /// Number of vertices that can move.
    pub(super) fn free_count(&self) -> usize {
        self.inverse_masses.iter().filter(|w| **w > 0.0).count()
    }

    /// Largest edge strain of a patch for which no other way is tried.
    pub(super) fn tolerable_strain(&self) -> Real {
        self.params.effort.polish_strain
    }

    /// The number of pairs of each contour: each pair counts for the nearest one.
    pub(super) fn remaining(&self, pairs: &[[u32; 2]]) -> Vec<usize> {
        let mut counts = vec![0; self.contours.len()];
        for pair in pairs {
            let corner = self.mesh.triangles()[pair[0] as usize][0];
            counts[self.nearest[corner as usize] as usize] += 1;
        }
        counts
    }

    /// Moves the sheets of each contour apart along its way. Returns the best state. It stops once the
    /// [excess](Outcome::excess) of pairs comes to `most`.
    pub(super) fn separate(
        &self,
        start: &[Point],
        ways: &[Way],
        most: usize,
        poll: &mut dyn FnMut() -> Result<(), Cancelled>,
    ) -> Result<Outcome, Cancelled> {
        let gap = self.params.goal.clearance;
        let mut solver = Solver::new(quasi_static(self.params.effort.sweeps as u32, 2, 3))
            .expect("ResolveParams::validate checks the number of sweeps");
        let mut groups = self.groups.movable(&self.inverse_masses);
        let mut inverse_masses = self.inverse_masses.clone();
        let mut particles =
            Particles { velocities: vec![Vector::zeros(); start.len()], ..Particles::default() };
        let mut x = start.to_vec();
        let mut mesh = self.at(&x);
        let mut tree = Bvh::new(&mesh);
        let mut pairs = self.pairs(&mesh, &tree);
        let mut best = self.outcome(pairs.clone(), x.clone(), 0);
        // The planes of pairs that intersected, and for how many more rounds they hold; and all
        // pairs that ever did.
        let mut apart: BTreeMap<[u32; 2], (Vector, u32)> = BTreeMap::new();
        let mut met: BTreeSet<[u32; 2]> = BTreeSet::new();
        let (mut vain, mut relaxed, mut rounds, mut excess) = (0, 0, 0, 0);
        let free = self.free_count();
        for round in 0..ROUNDS + RELAXING {
            poll()?;
            let mut separations = Separations::new();
            if pairs.is_empty() {
                // Clean: each pair keeps to the sides where it lies, as far apart as it may be.
                for [first, second] in &met {
                    let [first, second] =
                        [*first, *second].map(|t: u32| self.mesh.triangles()[t as usize]);
                    separations.push(first, second, gap, mesh.vertices());
                }
            } else {
                for pair in &pairs {
                    let (ordered, direction) = self.direction(&mesh, *pair, ways);
                    let old = apart.remove(&[ordered[1], ordered[0]]).map(|(n, _)| -n);
                    let old = old.or(apart.get(&ordered).map(|a| a.0));
                    let direction =
                        if direction == Vector::zeros() { old } else { Some(direction) };
                    let plane = self.plane(&mesh, ordered, direction);
                    apart.insert(ordered, (plane, KEPT));
                    met.insert(*pair);
                }
                for (pair, (normal, _)) in &apart {
                    let [first, second] = pair.map(|t| self.mesh.triangles()[t as usize]);
                    separations.push_along([second, first], *normal, gap, STEP, &x);
                }
                apart.retain(|_, (_, rounds)| {
                    *rounds -= 1;
                    *rounds > 0
                });
            }
            excess += separations.len().saturating_sub(HELD * free);
            let mut all = groups.in_order();
            all.push(&mut separations as &mut dyn Constraint);
            if step(&mut solver, &mut particles, &mut x, &mut inverse_masses, &mut all).is_err() {
                break;
            }
            let now = self.stored_outcome(&x, &mut tree, round + 1);
            mesh = self.at(&now.positions);
            pairs = now.pairs.clone();
            (vain, rounds) = (vain + 1, round + 1);
            if now.pairs.len() < best.pairs.len() {
                vain = 0;
            }
            if now.rank() < best.rank() {
                best = now;
            }
            relaxed += usize::from(best.pairs.is_empty());
            if relaxed > RELAXING || vain > IN_VAIN || excess > most {
                break;
            }
        }
        Ok(Outcome { rounds, excess, ..best })
    }

    /// The patch before anything is done.
    pub(super) fn as_given(&self, start: &[Point]) -> Outcome {
        self.stored_outcome(start, &mut Bvh::new(&self.at(start)), 0)
    }

    /// What `x` is as it is stored. `tree` is of the patch, at any positions.
    pub(super) fn stored_outcome(&self, x: &[Point], tree: &mut Bvh, rounds: usize) -> Outcome {
        let stored = self.garment.storage.round(x);
        tree.refit(&stored);
        self.outcome(self.pairs(&self.at(&stored), tree), stored, rounds)
    }

    /// Whether a vertex can move.
    pub(super) fn is_free(&self, v: u32) -> bool {
        self.inverse_masses[v as usize] > 0.0
    }

    /// The own pairs of `mesh`, which `tree` holds, of triangles that can move.
    fn pairs(&self, mesh: &TriMesh, tree: &Bvh) -> Vec<[u32; 2]> {
        let is_free = |t: u32| mesh.triangles()[t as usize].iter().any(|v| self.is_free(*v));
        let pairs = own_pairs(mesh, tree).into_iter().map(|p| [p.a, p.b]);
        pairs.filter(|pair| pair.iter().any(|t| is_free(*t))).collect()
    }

    fn outcome(&self, pairs: Vec<[u32; 2]>, positions: Vec<Point>, rounds: usize) -> Outcome {
        let strain = strain_of(&self.edges.vertices, self.mesh.vertices(), &positions);
        Outcome { pairs, strain: strain.rms, largest: strain.max, positions, rounds, excess: 0 }
    }

    /// The pair with the triangle of the first sheet first, and the unit direction in which that is
    /// moved relative to the other; zero if the way says nothing about it.
    fn direction(&self, mesh: &TriMesh, pair: [u32; 2], ways: &[Way]) -> ([u32; 2], Vector) {
        let side = |t: u32| {
            let corners = mesh.triangles()[t as usize];
            corners.map(|v| self.sides[v as usize]).iter().sum::<Real>()
        };
        let [a, b] = pair;
        let pair = if side(b) < side(a) { [b, a] } else { [a, b] };
        let corner = mesh.triangles()[pair[0] as usize][0];
        let Some(way) = ways.get(self.nearest[corner as usize] as usize) else {
            return (pair, Vector::zeros());
        };
        let [of_first, of_second] = pair.map(|t| normal(mesh, t));
        let sum = of_second * Real::from(way[0]) - of_first * Real::from(way[1]);
        (pair, unit_or_zero(&sum))
    }

    /// The normal of the plane that separates the first triangle of `pair` from the second with the
    /// least motion, near `direction` if there is one.
    fn plane(&self, mesh: &TriMesh, pair: [u32; 2], direction: Option<Vector>) -> Vector {
        let [first, second] = pair.map(|t| mesh.corners(t as usize).map(|p| *p));
        let out = direction.unwrap_or_else(|| normal(mesh, pair[1]));
        least_motion_plane(&first, &second, &out).0
    }
}
