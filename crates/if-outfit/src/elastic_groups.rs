//! The constraints that hold a garment together: anchors to the input, bending, stretch, ties of
//! folds, a limit of strain, and fixed offsets of very short edges.

use crate::facing_sheets::facing_sheets;
use crate::params::ClothParams;
use if_core::edges::{Edges, NONE};
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_mesh::index::Bvh;
use if_xpbd::attach::Attachments;
use if_xpbd::constraint::Constraint;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::fixed_offsets::FixedOffsets;
use if_xpbd::params::LambdaForm;
use if_xpbd::strain_limit::StrainLimit;
use if_xpbd::stretch::Stretch;
use if_xpbd::tie::Ties;

/// Why the parameters of groups are valid.
const IN_RANGE: &str = "ResolveParams::validate checks compliances";

/// The constraint groups of a garment alone.
pub(crate) struct ElasticGroups {
    /// One for each vertex, to its position at the start.
    pub(crate) anchors: Attachments,
    bending: Stretch,
    stretch: Vec<Stretch>,
    ties: Ties,
    limit: StrainLimit,
    short: FixedOffsets,
}

impl ElasticGroups {
    /// The groups of `mesh`, which `tree` holds.
    pub(crate) fn new(mesh: &TriMesh, tree: &Bvh, edges: &Edges, params: &ClothParams) -> Self {
        let mut groups = Self::without_ties(mesh, mesh.vertices(), edges, params);
        for f in facing_sheets(mesh, tree, params.fold_distance) {
            let share = 0.7 * (1.0 - 0.7 * f.distance / params.fold_distance);
            let corners = mesh.triangles()[f.triangle as usize];
            groups
                .ties
                .push(f.vertex, corners, f.barycentric, share, mesh.vertices())
                .expect("a vertex and a triangle of the mesh, and a share from 0.21 to 0.7");
        }
        groups
    }

    /// The groups of `mesh` anchored at the positions `start`, without ties: sheets that face each
    /// other move on their own.
    pub(crate) fn without_ties(
        mesh: &TriMesh,
        start: &[Point],
        edges: &Edges,
        params: &ClothParams,
    ) -> Self {
        let x = mesh.vertices();
        let mut anchors = Attachments::new();
        anchors.form = LambdaForm::Pbd;
        for (v, p) in start.iter().enumerate() {
            anchors.push(v as u32, *p, params.anchor_compliance).expect(IN_RANGE);
        }
        let mut bending =
            Stretch::new(hinge_edges(mesh, edges), params.bending_compliance).expect(IN_RANGE);
        bending.form = LambdaForm::Pbd;
        let mut stretch = stretch_groups(edges, x, params.stretch_compliance);
        stretch.iter_mut().for_each(|group| group.form = LambdaForm::Pbd);
        let lengths: Vec<Real> = edges.vertices.iter().map(|e| length(x, e)).collect();
        let all = EdgeSet::new(&edges.vertices, &lengths, x.len());
        let limit = StrainLimit::new(
            all.expect("two different vertices of a mesh, and a finite length"),
            (1.0 - params.strain_limit).max(0.0),
            1.0 + params.strain_limit,
        );
        Self {
            anchors,
            bending,
            stretch,
            ties: Ties::new(),
            limit: limit.expect("a limit that was checked"),
            short: FixedOffsets::new(short_edges(edges, x), x),
        }
    }

    /// The constraints that can move something: those whose vertices are all held are left out.
    pub(crate) fn movable(&self, inverse_masses: &[Real]) -> Self {
        Self {
            anchors: self.anchors.movable(inverse_masses),
            bending: self.bending.movable(inverse_masses),
            stretch: self.stretch.iter().map(|group| group.movable(inverse_masses)).collect(),
            ties: self.ties.movable(inverse_masses),
            limit: self.limit.movable(inverse_masses),
            short: self.short.clone(),
        }
    }

    /// All groups in the order in which the solver visits them.
    pub(crate) fn in_order(&mut self) -> Vec<&mut dyn Constraint> {
        let mut groups: Vec<&mut dyn Constraint> = vec![&mut self.anchors, &mut self.bending];
        groups.extend(self.stretch.iter_mut().map(|group| group as &mut dyn Constraint));
        groups.extend([&mut self.ties as &mut dyn Constraint, &mut self.limit, &mut self.short]);
        groups
    }
}

fn length(x: &[Point], [a, b]: &[u32; 2]) -> Real {
    (x[*a as usize] - x[*b as usize]).norm()
}

/// The edges in groups of similar length, the shorter the stiffer: β ~ ℓ², so that what is spread
/// evenly is strain, and not the change of length.
fn stretch_groups(edges: &Edges, x: &[Point], compliance: Real) -> Vec<Stretch> {
    /// Bounds of the groups, relative to the mean length.
    const BOUNDS: [Real; 5] = [0.25, 0.5, 0.8, 1.2, 1.8];
    let length = |e: &[u32; 2]| length(x, e);
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    let group_of = |l: Real| BOUNDS.iter().take_while(|b| l > **b * mean).count();
    (0..=BOUNDS.len())
        .filter_map(|g| {
            let ends: Vec<[u32; 2]> =
                edges.vertices.iter().filter(|e| group_of(length(e)) == g).copied().collect();
            let rests: Vec<Real> = ends.iter().map(length).collect();
            let typical = rests.iter().sum::<Real>() / (rests.len().max(1) as Real * mean);
            // Of points, or of edges whose squared lengths are zero or infinite, there is no mean.
            let typical = if typical.is_finite() { typical } else { 1.0 };
            let set = EdgeSet::new(&ends, &rests, x.len())
                .expect("two different vertices of a mesh, and a finite length");
            (!ends.is_empty()).then(|| {
                Stretch::new(set, compliance * typical * typical)
                    .expect("a checked compliance and a finite length")
            })
        })
        .collect()
}

/// Share of the mean length below which contacts cannot separate the ends of an edge: it is a
/// doubled point, and only translates. Ten times less
/// leaves a 0.1 mm edge of the test data strained by 150 %; ten times more stiffens fine details.
const SHORT: Real = 0.03;

/// The edges that are doubled points.
fn short_edges(edges: &Edges, x: &[Point]) -> Vec<[u32; 2]> {
    let length = |e: &[u32; 2]| length(x, e);
    let mean = edges.vertices.iter().map(length).sum::<Real>() / edges.len().max(1) as Real;
    edges.vertices.iter().filter(|e| length(e) < SHORT * mean).copied().collect()
}

/// For each inner edge the two corners across it: kept at their distance, they keep the fold's
/// angle.
fn hinge_edges(mesh: &TriMesh, edges: &Edges) -> EdgeSet {
    let x = mesh.vertices();
    let mut across = Vec::new();
    let mut rest = Vec::new();
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        let [t, u] = edges.triangles[e];
        if u == NONE {
            continue;
        }
        let opposite =
            |t: u32| mesh.triangles()[t as usize].into_iter().find(|v| *v != a && *v != b);
        if let (Some(c), Some(d)) = (opposite(t), opposite(u))
            && c != d
        {
            across.push([c, d]);
            rest.push((x[c as usize] - x[d as usize]).norm());
        }
    }
    EdgeSet::new(&across, &rest, x.len())
        .expect("two different vertices of a mesh, and a finite length")
}
