//! What keeps a garment outside the layers below, below those above, and off itself: the contact
//! groups of the solver, and what repair strategies set in them.

use crate::contacts::{ContactParams, Contacts, Exit, Garment};
use crate::params::ResolveParams;
use crate::upper_layers::UpperLayers;
use crate::way::Way;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::outward::Outward;
use if_mesh::solid::ClosedLayer;
use if_xpbd::constraint::{Constraint, Stage};
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::separation::Separations;
use std::collections::BTreeSet;
use tracing::trace_span;

/// How much further than needed a query searches, in metres, to avoid later ones.
const RESERVE: Real = 0.012;
/// Middles of edges and triangles land at once; a corner that alone is free is not thrown.
const MAX_LEVER: Real = 4.0;

/// The contact groups of one garment.
pub(crate) struct ContactGroups<'a> {
    triangles: &'a [[u32; 3]],
    clearance: Real,
    pub(crate) search: Contacts<'a>,
    /// Half-spaces outside the layers below.
    below: HalfSpaces,
    /// The layers above, and half-spaces below them.
    above: UpperLayers<'a>,
    pressed: HalfSpaces,
    /// Vertices that are not, or no longer, pressed in below the layers above.
    released: Vec<bool>,
    /// For each vertex the gap to keep, in metres.
    pub(crate) gaps: Vec<Real>,
    /// For each vertex how it is led out of a layer that it is inside of.
    pub(crate) exits: Vec<Exit>,
    /// The ways of vertices that are still on them.
    pub(crate) ways_out: Vec<Way>,
    /// For each vertex how often it was found inside.
    pub(crate) times_inside: Vec<u32>,
    /// Planes that separate intersecting triangles: vertex, normal, point.
    pub(crate) separating: Vec<(u32, Vector, Point)>,
    /// Pairs of the garment's own triangles that are held apart.
    pub(crate) self_separations: Separations,
}

impl<'a> ContactGroups<'a> {
    pub(crate) fn new(
        mesh: &'a TriMesh,
        edges: &Edges,
        below: &'a [&'a ClosedLayer],
        above: UpperLayers<'a>,
        outward: &'a Outward,
        params: &ResolveParams,
        skip: bool,
    ) -> Self {
        let n = mesh.vertices().len();
        let mut planes = HalfSpaces::new();
        planes.max_push = params.effort.max_push;
        planes.max_lever = MAX_LEVER;
        let mut pressed = planes.clone();
        pressed.stage = Stage::Elastic;
        let search = ContactParams {
            step: params.effort.contact_step,
            margin: params.effort.contact_margin,
            reserve: RESERVE,
            long_edge: params.effort.long_edge,
            skip,
        };
        Self {
            triangles: mesh.triangles(),
            clearance: params.goal.clearance,
            search: Contacts::new(mesh, edges, below, outward, search),
            below: planes,
            above,
            pressed,
            // Vertices of no triangle stay, wherever they are.
            released: mesh.used_vertices().iter().map(|used| !used).collect(),
            gaps: vec![params.goal.clearance; n],
            exits: vec![Exit::default(); n],
            ways_out: Vec::new(),
            times_inside: vec![0; n],
            separating: Vec::new(),
            self_separations: Separations::new(),
        }
    }

    /// Finds the half-spaces outside the layers below, for the garment at `x`, which `tree` holds.
    pub(crate) fn detect(&mut self, x: &[Point], inverse_masses: &[Real], tree: &Bvh) {
        let _phase = trace_span!("contacts").entered();
        let Self { search, triangles, gaps, exits, below, ways_out, .. } = self;
        ways_out.retain(|way| {
            let v = way.vertex as usize;
            let is_on_it = way.left(&x[v]) > 0.0;
            exits[v] = if is_on_it { Exit::Planned } else { Exit::Steps };
            is_on_it
        });
        search.detect(Garment { x, triangles, tree, gaps, inverse_masses, exits }, below);
        for (v, normal, point) in &self.separating {
            below.push_vertex(*v, *normal, point, 0.0);
        }
        for way in &*ways_out {
            let p = &x[way.vertex as usize];
            let push = (way.left(p) + gaps[way.vertex as usize]).min(search.params().leap());
            below.push_vertex(way.vertex, way.direction, p, push);
        }
    }

    /// Finds the half-spaces below the layers above.
    pub(crate) fn detect_above(&mut self, x: &[Point], inverse_masses: &[Real]) {
        let _phase = trace_span!("contacts").entered();
        self.above.detect(x, inverse_masses, &self.released, &mut self.pressed);
    }

    /// The groups of layers below and of the garment itself.
    pub(crate) fn below_and_own(&mut self) -> [&mut dyn Constraint; 2] {
        [&mut self.below, &mut self.self_separations]
    }

    /// All groups in the order in which the solver visits them.
    pub(crate) fn in_order(&mut self) -> [&mut dyn Constraint; 3] {
        [&mut self.pressed, &mut self.below, &mut self.self_separations]
    }

    /// Records that no vertex moved further than `most` metres since the last detection.
    pub(crate) fn moved(&mut self, most: Real) {
        self.search.moved(most);
    }

    /// Vertices that stick out of a layer above and are still to be pressed in.
    pub(crate) fn sticking_out(&self, x: &[Point]) -> Vec<u32> {
        self.above.sticking_out(x, &self.released)
    }

    /// Stops pressing the `vertices` in below the layers above. Returns how many were pressed.
    pub(crate) fn release(&mut self, vertices: &BTreeSet<u32>) -> usize {
        let pressed = vertices.iter().filter(|v| !self.released[**v as usize]).count();
        vertices.iter().for_each(|v| self.released[*v as usize] = true);
        if self.above.layers.is_empty() { 0 } else { pressed }
    }

    /// Forgets what was set for a vertex in vain.
    pub(crate) fn reset(&mut self, vertex: usize) {
        self.gaps[vertex] = self.clearance;
        self.times_inside[vertex] = 0;
    }

    /// Sets the gaps of all vertices to the clearance.
    pub(crate) fn reset_gaps(&mut self) {
        self.gaps.fill(self.clearance);
    }
}
