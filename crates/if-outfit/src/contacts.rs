//! The search for contacts: samples on a garment's triangles against the closed layers below.
//!
//! There are two kinds of samples. *Own samples* are fixed on the garment: its vertices, and the
//! middles of long edges and of the triangles at them; if they are not very long, only where
//! something is left to repair. *Foreign samples* follow the vertices of the
//! layers below: each has a nearest point on the garment, and where a fine mesh pokes through a
//! coarse triangle that point is the place to push.
//!
//! A sample that is further from a layer than the clearance and a reserve is skipped until it has
//! moved that far: a distance has Lipschitz bound 1. Samples whose vertices are all held are
//! skipped. A sample that is nearer is queried in each round: if it moves little, the nearest
//! triangle is found among those that were near before.

mod foreign;
mod own;

use foreign::ForeignSamples;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, barycentric_point};
use if_core::mesh::TriMesh;
use if_mesh::index::{Bvh, Nearby};
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::half_space::HalfSpaces;
pub(crate) use own::COARSE;
use own::OwnSamples;

/// A point of the garment by the vertices it depends on.
#[derive(Clone, Copy, Debug)]
struct Sample {
    vertices: [u32; 3],
    weights: [Real; 3],
}

impl Sample {
    fn at(&self, x: &[Point]) -> Point {
        barycentric_point(self.vertices.map(|v| &x[v as usize]), self.weights)
    }

    fn gap(&self, gaps: &[Real]) -> Real {
        (0..3).map(|k| self.weights[k] * gaps[self.vertices[k] as usize]).sum()
    }

    /// Whether one of its vertices takes a way of its own.
    fn is_planned(&self, exits: &[Exit]) -> bool {
        self.vertices.iter().any(|v| exits[*v as usize] == Exit::Planned)
    }

    fn is_held(&self, inverse_masses: &[Real]) -> bool {
        self.vertices.iter().all(|v| inverse_masses[*v as usize] == 0.0)
    }
}

/// How a vertex is led out of a layer that it is inside of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Step by step, the nearest way unless that leads through the wall of a fold.
    #[default]
    Steps,
    /// In leaps, the nearest way.
    Nearest,
    /// In leaps, the way out on the scale of centimetres.
    Outward,
    /// On a way of its own ([`crate::ways_out`]): no contact is looked for.
    Planned,
}

/// The half-space that a contact keeps a sample in: at least `gap` beyond `point` along `normal`.
struct Plane {
    normal: Vector,
    point: Point,
    gap: Real,
}

/// Found in one chunk of samples: contacts, queries made, queries skipped.
#[derive(Default)]
struct Found {
    contacts: Vec<(Sample, Plane)>,
    queries: usize,
    skipped: usize,
}

/// Lengths that the search for contacts works with, in metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ContactParams {
    /// Maximum correction of a violated contact in one round.
    pub(crate) step: Real,
    /// Contacts are kept for samples up to this far beyond their clearance.
    pub(crate) margin: Real,
    /// How much further a query searches, to avoid later ones.
    pub(crate) reserve: Real,
    /// Edges longer than this get a sample in the middle, and their triangles too: at once if they are
    /// much longer, else where something is left to repair.
    pub(crate) long_edge: Real,
    /// Whether queries that cannot find a contact are skipped.
    pub(crate) skip: bool,
}

impl ContactParams {
    /// Maximum correction in one round of a vertex that is led out at once, in metres.
    pub(crate) fn leap(&self) -> Real {
        LEAP * self.step
    }
}

/// Samples per task: enough work to hide the fork, few enough to balance where most samples of a task
/// are queried and those of the next are held.
const CHUNK: usize = 64;
/// Steps that a vertex which is led out at once may take in one round.
const LEAP: Real = 4.0;

/// A garment as it is in one round.
#[derive(Clone, Copy)]
pub(crate) struct Garment<'a> {
    /// Its vertices, and their triangles.
    pub(crate) x: &'a [Point],
    pub(crate) triangles: &'a [[u32; 3]],
    /// Holds it at `x`.
    pub(crate) tree: &'a Bvh,
    /// The clearances of its vertices, in metres.
    pub(crate) gaps: &'a [Real],
    /// Vertices of inverse mass zero are held.
    pub(crate) inverse_masses: &'a [Real],
    /// How its vertices are led out.
    pub(crate) exits: &'a [Exit],
}

/// What a search works with.
#[derive(Clone, Copy)]
struct Scene<'a> {
    below: &'a [&'a ClosedLayer],
    outward: &'a Outward,
    params: ContactParams,
}

/// The search for contacts of one garment.
pub(crate) struct Contacts<'a> {
    scene: Scene<'a>,
    own: OwnSamples,
    foreign: ForeignSamples,
    /// Sum over the rounds of the largest motion of any vertex, in metres.
    path: Real,
    /// Nearest-point queries made.
    pub(crate) queries: usize,
    /// Queries skipped by the Lipschitz bound or because all vertices are held.
    pub(crate) skipped: usize,
}

impl<'a> Contacts<'a> {
    pub(crate) fn new(
        mesh: &TriMesh,
        edges: &Edges,
        below: &'a [&'a ClosedLayer],
        outward: &'a Outward,
        params: ContactParams,
    ) -> Self {
        Self {
            scene: Scene { below, outward, params },
            own: OwnSamples::new(mesh, edges, params.long_edge, below.len()),
            foreign: ForeignSamples::new(below),
            path: 0.0,
            queries: 0,
            skipped: 0,
        }
    }

    /// The lengths that it works with.
    pub(crate) fn params(&self) -> &ContactParams {
        &self.scene.params
    }

    /// Makes samples of the middles that are not held.
    pub(crate) fn refine(&mut self, inverse_masses: &[Real]) {
        self.own.refine(inverse_masses);
    }

    /// Makes the samples at `vertices` query again wherever they are: the side of a point can jump
    /// where a layer is closed by voxels, and no Lipschitz bound holds there.
    pub(crate) fn forget(&mut self, vertices: &[u32]) {
        self.own.forget(vertices);
    }

    /// Records that no vertex moved further than `most` metres since the last
    /// [`Contacts::detect`].
    pub(crate) fn moved(&mut self, most: Real) {
        self.path += most;
    }

    /// Fills `out` with the contacts of the `garment`.
    pub(crate) fn detect(&mut self, garment: Garment<'_>, out: &mut HalfSpaces) {
        out.clear();
        let Self { scene, own, foreign, path, .. } = self;
        let (own, foreign) = rayon::join(
            || own.contacts(*scene, garment),
            || foreign.contacts(*scene, garment, *path),
        );
        for found in own.into_iter().chain(foreign) {
            self.queries += found.queries;
            self.skipped += found.skipped;
            for (s, plane) in found.contacts {
                out.push(s.vertices, s.weights, plane.normal, &plane.point, plane.gap);
            }
        }
    }

    /// For each vertex of a triangle, in ascending order, and for each layer the triangles near it,
    /// if it was queried more than once.
    pub(crate) fn nearby_of_vertices(&mut self) -> &mut [Option<Box<Nearby>>] {
        self.own.nearby_of_vertices()
    }
}
