//! Edges of a garment between two parts of the body, such as an arm and the trunk.
//!
//! A *bridge* is an edge whose ends have their nearest skin on two parts of the body, far from one
//! another along the skin and both on the garment's inner side. The middle of that way along the
//! skin is the *junction*, in the crotch or the armpit.

use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_mesh::solid::{ClosedLayer, Sided};
use rayon::prelude::*;

/// The ends of a bridge have nearest points on the skin that are at least this far apart, in
/// metres, and that many lengths of the bridge.
const APART: Real = 0.02;
const LENGTHS: Real = 2.0;
/// Length of the search for an outer garment along the normal, in metres.
const FAR: Real = 1.0;

/// An edge of a garment between two parts of the body.
pub(crate) struct Bridge {
    pub(crate) vertices: [u32; 2],
    pub(crate) middle: Point,
    /// The garment's unit normal there, inwards.
    inward: Vector,
    /// Its ends and their nearest points on the skin.
    pub(crate) ends: [[Point; 2]; 2],
    pub(crate) junction: Point,
}

impl Bridge {
    /// How far it must be lifted to lie inside the garment in `outer`, towards the junction or along
    /// its normal, whichever is nearer; `None` if that garment is not in the way.
    pub(crate) fn lift(&self, outer: &Bvh) -> Option<Real> {
        let covers = |[end, skin]: &[Point; 2]| way_to(outer, end, skin).is_some();
        let up = way_to(outer, &self.middle, &self.junction)?;
        let inwards = way_to(outer, &self.middle, &self.beyond(&self.middle));
        self.ends.iter().all(covers).then(|| inwards.map_or(up, |inwards| up.min(inwards)))
    }

    /// A point far inwards of `p`.
    pub(crate) fn beyond(&self, p: &Point) -> Point {
        p + self.inward * FAR
    }
}

/// How far it is from one point towards another to the garment in `tree`, in metres; `None` if that
/// does not pass between them.
pub(crate) fn way_to(tree: &Bvh, from: &Point, to: &Point) -> Option<Real> {
    tree.first_hit(from, to, |_| true).map(|hit| hit.parameter * (to - from).norm())
}

/// At most `most` of the bridges of the garment `mesh`, evenly chosen; `ways` are the edges of the
/// body `skin`.
pub(crate) fn bridges(
    mesh: &TriMesh,
    closed: &ClosedLayer,
    body: &ClosedLayer,
    skin: &TriMesh,
    ways: &Neighbours,
    most: usize,
) -> Vec<Bridge> {
    let x = mesh.vertices();
    let feet: Vec<Option<Sided>> =
        x.par_iter().with_min_len(64).map(|p| body.sided(p, Real::INFINITY)).collect();
    let spans = |[a, b]: &[u32; 2]| {
        let ends = [*a, *b].map(|v| v as usize);
        let [Some(f), Some(g)] = ends.map(|v| feet[v]) else { return false };
        let [p, q] = ends.map(|v| x[v]);
        let apart = (f.point - g.point).norm();
        let inner_side =
            |v: usize, foot: &Sided| closed.vertex_normal(v).dot(&(foot.point - x[v])) < 0.0;
        apart > LENGTHS * (p - q).norm() + APART
            && inner_side(ends[0], &f)
            && inner_side(ends[1], &g)
    };
    let edges: Vec<[u32; 2]> = Edges::new(mesh).vertices.into_iter().filter(spans).collect();
    let every = edges.len().div_ceil(most).max(1);
    let chosen: Vec<[u32; 2]> = edges.into_iter().step_by(every).collect();
    let bridge = |edge: &[u32; 2]| {
        let [v, w] = edge.map(|v| v as usize);
        let [f, g] = [v, w].map(|v| feet[v].expect("both ends have one"));
        let [from, to] = [f, g].map(|foot| skin.triangles()[foot.triangle as usize][0]);
        let junction = ways.middle_of_path(from, to)?;
        Some(Bridge {
            vertices: *edge,
            middle: nalgebra::center(&x[v], &x[w]),
            junction: skin.vertices()[junction as usize],
            inward: -unit_or_zero(&(closed.vertex_normal(v) + closed.vertex_normal(w))),
            ends: [[x[v], f.point], [x[w], g.point]],
        })
    };
    chosen.par_iter().filter_map(bridge).collect()
}
