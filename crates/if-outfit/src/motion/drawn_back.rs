//! A body that is drawn back where it meets itself or leaves no room for cloth: what a single posed
//! outfit is resolved on.
//!
//! ```text
//! vertices near garments whose normals point at the body's own skin within `room`, or past it
//! repeat: n · (what v faces − v) ≥ room for all of them,  min E(u),  |u| ≤ depth
//!         what intersects all the same gets more room
//! ```
//!
//! There is no clean state to begin from, as [`Walker`](super::Walker) has it: directions are the
//! normals of the body as given. They fail where it is folded over by more than half of its thickness.

use super::contact::Contact;
use super::equilibrium::{Multipliers, solve};
use super::facing::{Facing, facings};
use super::locality::near;
use super::params::WalkParams;
use super::scene::Scene;
use crate::findings::own_of;
use crate::outfit::Outfit;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use std::collections::BTreeMap;

/// A body that was drawn back.
#[derive(Clone, Debug)]
pub(crate) struct DrawnBack {
    /// Its positions, rounded to the storage of the body.
    pub(crate) positions: Vec<Point>,
    /// Triangles of the given body that meet it near garments, in pairs.
    pub(crate) met: Vec<[u32; 2]>,
    /// Vertices of the given body near garments that have less room than was asked for.
    pub(crate) narrow: Vec<u32>,
    /// The same of the body that was drawn back.
    pub(crate) left: Vec<[u32; 2]>,
}

/// Rounds, each with what the surface faces then.
const ROUNDS: usize = 24;
/// Distance of a garment, in metres, up to which the body makes room. Fingers and lips keep theirs.
const NEAR: Real = 0.03;
/// Vertices that face the body at up to this many times the room are watched.
const WATCHED: Real = 3.0;
/// Room that is given to the corners of triangles that still meet, as a share of what was wanted, for
/// each round in which they do.
const GROWTH: Real = 0.5;

/// The body of `outfit`, drawn back so that it leaves `room` metres near garments, moved by at most
/// `depth` metres; `None` if it leaves as much as it is.
pub(crate) fn drawn_back(outfit: &Outfit, room: Real, depth: Real) -> Option<DrawnBack> {
    let params = WalkParams::default();
    let alone = Outfit { body: outfit.body.clone(), garments: Vec::new() };
    let scene = Scene::new(&alone, &params);
    let target = scene.mesh.vertices();
    let garments: Vec<Point> =
        outfit.garments.iter().flat_map(|g| g.mesh.vertices()).copied().collect();
    let is_covered = near(target, &garments, NEAR);
    let normals = scene.mesh.vertex_normals();
    let mut tree = Bvh::new(&scene.mesh);
    let is_near = |pair: &[u32; 2]| {
        let corners = pair.iter().flat_map(|t| scene.mesh.triangles()[*t as usize]);
        corners.clone().any(|v| is_covered[v as usize])
    };
    let of_state = |mesh: &TriMesh, tree: &Bvh| -> Vec<[u32; 2]> {
        own_of(mesh, tree).into_iter().filter(is_near).collect()
    };
    let met = of_state(&scene.mesh, &tree);
    let first = facings((&scene.mesh, &tree), &normals, &is_covered, limits(room, depth));
    let narrow: Vec<u32> = first.iter().filter(|f| f.room < room).map(|f| f.vertex).collect();
    let corners = met.iter().flatten().flat_map(|t| scene.mesh.triangles()[*t as usize]);
    let places: Vec<Point> =
        narrow.iter().copied().chain(corners).map(|v| target[v as usize]).collect();
    if places.is_empty() {
        return None;
    }
    let yields = near(target, &places, params.body_reach);
    let w: Vec<Real> =
        yields.iter().zip(&scene.inverse_mass).map(|(y, w)| if *y { *w } else { 0.0 }).collect();
    let mut wanted = vec![room; target.len()];
    let (mut multipliers, mut x) = (Multipliers::default(), target.to_vec());
    let mut best: Option<(Vec<Point>, Vec<[u32; 2]>)> = None;
    let mut mesh = scene.mesh.clone();
    for round in 0..ROUNDS {
        let found = facings((&mesh, &tree), &normals, &yields, limits(room, depth));
        let contacts: Vec<Contact> = found
            .iter()
            .filter(|f| f.room < WATCHED * wanted[f.vertex as usize])
            .map(|f| contact(f, &scene.mesh, &normals, wanted[f.vertex as usize]))
            .collect();
        multipliers.follow(&contacts);
        let solved =
            solve(&scene, (target, &w), &contacts, &mut multipliers, (params.sweeps, &mut x));
        for (x, target) in x.iter_mut().zip(target) {
            *x = target + (*x - target).cap_magnitude(depth);
        }
        scene.copy_doubled(&mut x);
        let rounded = outfit.body.storage.round(&x);
        mesh = scene.mesh.with_vertices(rounded).expect("solutions are finite");
        tree.refit(mesh.vertices());
        let left = of_state(&mesh, &tree);
        let least = found.iter().map(|f| f.room).fold(Real::INFINITY, Real::min);
        tracing::debug!(
            round,
            pairs = left.len(),
            contacts = contacts.len(),
            sweeps = solved.sweeps,
            violation = solved.violation,
            least,
            "drawing back"
        );
        for v in left.iter().flatten().flat_map(|t| scene.mesh.triangles()[*t as usize]) {
            wanted[v as usize] += GROWTH * room;
        }
        let is_done = left.is_empty() && solved.violation <= 0.5 * room && round > 0;
        if best.as_ref().is_none_or(|(_, fewest)| left.len() <= fewest.len()) {
            best = Some((mesh.vertices().to_vec(), left));
        }
        if is_done {
            break;
        }
    }
    best.map(|(positions, left)| DrawnBack { positions, met, narrow, left })
}

/// Rooms that are watched. What lies deeper cannot be led out.
fn limits(room: Real, depth: Real) -> [Real; 2] {
    [WATCHED * room + 2.0 * depth, 4.0 * depth]
}

/// `n · (what the vertex faces − the vertex) ≥ room`.
fn contact(facing: &Facing, mesh: &TriMesh, normals: &[Vector], room: Real) -> Contact {
    let [a, b, c] = mesh.triangles()[facing.triangle as usize];
    let [wa, wb, wc] = facing.weights;
    Contact {
        vertices: [facing.vertex, a, b, c],
        coefficients: [-1.0, wa, wb, wc],
        normal: normals[facing.vertex as usize],
        gap: room,
    }
}

impl Multipliers {
    /// Gives forces of earlier contacts to those of the same vertices among `contacts`: what a
    /// vertex faces changes from triangle to triangle.
    fn follow(&mut self, contacts: &[Contact]) {
        let mut of_vertex: BTreeMap<u32, Real> = BTreeMap::new();
        let (_, forces) = self.parts();
        for (vertices, force) in forces {
            *of_vertex.entry(vertices[0]).or_default() += force;
        }
        let force = |c: &Contact| Some((c.vertices, *of_vertex.get(&c.vertices[0])?));
        self.replace_forces(contacts.iter().filter_map(force).collect());
    }
}
