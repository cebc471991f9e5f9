//! Cuts of a labelled mesh into one mesh per label, along lines through its triangles.
//!
//! Every vertex belongs to the label of its highest score. An edge between vertices of labels l and
//! m is cut where the two scores are equal; a triangle with two labels is cut along a segment, one
//! with three labels along three segments to its centre:
//!
//! ```text
//! s = (s_l − s_m)(a) / ((s_l − s_m)(a) − (s_l − s_m)(b))      the share of the way from a to b
//! ```
//!
//! So the pieces tile the mesh: neighbours share the vertices of their border. A new vertex lies on
//! one border line only: borders are 1-manifolds without bow-ties, except for those of the mesh
//! itself.

use super::error::LabelError;
use super::origin::Origin;
use super::scores::LabelScores;
use super::votes::check_count;
use if_core::edges::Edges;
use if_core::math::{Point, Real, barycentric_point};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// Parameters of [`cut`](super::cut()).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CutParams {
    /// Least share of an edge on either side of a cut, from 0 to ½: avoids slivers, and moves the
    /// border by as much.
    pub least: Real,
}

impl Default for CutParams {
    /// 5 % of an edge: half a millimetre at the usual 8 to 10 mm.
    fn default() -> Self {
        Self { least: 0.05 }
    }
}

impl CutParams {
    /// Checks that all parameters are in range.
    ///
    /// # Errors
    ///
    /// `least` is not between 0 and 0.5.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let valid = (0.0..=0.5).contains(&self.least);
        ParameterError::check("least", self.least, valid, "from 0 to 0.5")
    }
}

/// The part of the mesh that has one label.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece {
    /// Its label.
    pub label: u8,
    /// Its surface: first vertices of the mesh, in their order, then new ones.
    pub mesh: TriMesh,
    /// Origin of each vertex.
    pub origins: Vec<Origin>,
    /// For each triangle the triangle of the mesh that it is a part of.
    pub sources: Vec<u32>,
}

/// Cuts `mesh` into the pieces of its labels, in ascending order; undecided surface is the piece of
/// label 0.
///
/// # Errors
///
/// [`LabelError`]: scores of another mesh, of no or more than 256 labels, or not finite; or a
/// parameter out of range.
///
/// # Examples
///
/// ```
/// use if_mesh::labels::{CutParams, LabelScores, cut};
/// // A triangle whose upper third is label 2.
/// let mesh = if_core::mesh::TriMesh::new(
///     vec![[0.0, 0.0, 0.0].into(), [1.0, 0.0, 0.0].into(), [0.0, 3.0, 0.0].into()],
///     vec![[0, 1, 2]],
/// )?;
/// let two = |y: f64| [0.0, 1.0 - y / 4.0, y / 4.0];
/// let scores = LabelScores { labels: 3, scores: [two(0.0), two(0.0), two(3.0)].concat() };
/// let pieces = cut(&mesh, &scores, &CutParams::default())?;
/// assert_eq!(pieces.iter().map(|p| (p.label, p.mesh.triangles().len())).collect::<Vec<_>>(), [(1, 2), (2, 1)]);
/// assert_eq!(pieces[1].mesh.aabb().min.y, 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cut(
    mesh: &TriMesh,
    scores: &LabelScores,
    params: &CutParams,
) -> Result<Vec<Piece>, LabelError> {
    check_count("scores", scores.labels, scores.scores.len(), mesh.vertices().len())?;
    if let Some(at) = scores.scores.iter().position(|s| !s.is_finite()) {
        return Err(LabelError::Value {
            values: "as the score",
            range: "scores must be finite",
            vertex: at / scores.labels,
            label: at % scores.labels,
            value: scores.scores[at],
        });
    }
    params.validate()?;
    let labels = scores.winners();
    let tiles = Tiles::new(mesh, scores, &labels, params);
    let mut present: Vec<u8> = tiles.labels.clone();
    present.sort_unstable();
    present.dedup();
    Ok(present.into_iter().map(|label| tiles.piece(mesh, label)).collect())
}

/// The mesh with its cut triangles replaced by parts of one label.
struct Tiles {
    /// Vertices of the mesh, then new ones.
    origins: Vec<Origin>,
    triangles: Vec<[u32; 3]>,
    labels: Vec<u8>,
    sources: Vec<u32>,
}

impl Tiles {
    fn new(mesh: &TriMesh, scores: &LabelScores, labels: &[u8], params: &CutParams) -> Self {
        let n = mesh.vertices().len();
        let edges = Edges::new(mesh);
        let mut this = Self {
            origins: (0..n as u32).map(Origin::vertex).collect(),
            triangles: Vec::with_capacity(mesh.triangles().len()),
            labels: Vec::with_capacity(mesh.triangles().len()),
            sources: Vec::with_capacity(mesh.triangles().len()),
        };
        // The new vertex of each cut edge.
        let mut crossing = vec![u32::MAX; edges.len()];
        for (e, &[a, b]) in edges.vertices.iter().enumerate() {
            let (l, m) = (labels[a as usize], labels[b as usize]);
            if l != m {
                let lead = |v: u32| {
                    scores.of(v as usize)[usize::from(l)] - scores.of(v as usize)[usize::from(m)]
                };
                let (from, to) = (lead(a), lead(b));
                let s = if from > to { from / (from - to) } else { 0.5 };
                let s = s.clamp(params.least, 1.0 - params.least);
                crossing[e] = this.origins.len() as u32;
                this.origins.push(Origin { vertices: [a, b, a], weights: [1.0 - s, s, 0.0] });
            }
        }
        for (t, tri) in mesh.triangles().iter().enumerate() {
            let of = tri.map(|v| labels[v as usize]);
            let cuts = edges.of_triangle[t].map(|e| crossing[e as usize]);
            match (0..3).find(|k| of[(k + 1) % 3] == of[(k + 2) % 3]) {
                Some(k) if of[k] == of[(k + 1) % 3] => this.push(*tri, of[0], t),
                Some(k) => {
                    // Corner k is cut off from b and c.
                    let [a, b, c] = [tri[k], tri[(k + 1) % 3], tri[(k + 2) % 3]];
                    let (ab, ca) = (cuts[k], cuts[(k + 2) % 3]);
                    this.push([a, ab, ca], of[k], t);
                    let rest = of[(k + 1) % 3];
                    let at = |v: u32| this.point(mesh, v);
                    // The rest is split at its shorter diagonal; of equal ones, that of the smaller
                    // corner.
                    let (to_b, to_c) =
                        ((at(ca) - at(b)).norm_squared(), (at(ab) - at(c)).norm_squared());
                    let halves = if to_b < to_c || (to_b == to_c && b < c) {
                        [[ab, b, ca], [b, c, ca]]
                    } else {
                        [[ab, b, c], [ab, c, ca]]
                    };
                    halves.into_iter().for_each(|half| this.push(half, rest, t));
                }
                None => {
                    let middle = this.middle(*tri, cuts);
                    for k in 0..3 {
                        this.push([tri[k], cuts[k], middle], of[k], t);
                        this.push([tri[k], middle, cuts[(k + 2) % 3]], of[k], t);
                    }
                }
            }
        }
        this
    }

    fn push(&mut self, triangle: [u32; 3], label: u8, source: usize) {
        self.triangles.push(triangle);
        self.labels.push(label);
        self.sources.push(source as u32);
    }

    /// Adds the mean of the three cuts of a triangle as a new vertex.
    fn middle(&mut self, tri: [u32; 3], cuts: [u32; 3]) -> u32 {
        let mut weights = [0.0; 3];
        for cut in cuts {
            let origin = self.origins[cut as usize];
            for k in 0..2 {
                let corner = tri
                    .iter()
                    .position(|v| *v == origin.vertices[k])
                    .expect("a cut lies on an edge of its triangle");
                weights[corner] += origin.weights[k] / 3.0;
            }
        }
        self.origins.push(Origin { vertices: tri, weights });
        self.origins.len() as u32 - 1
    }

    fn point(&self, mesh: &TriMesh, v: u32) -> Point {
        let origin = &self.origins[v as usize];
        match origin.source() {
            Some(v) => mesh.vertices()[v as usize],
            None => barycentric_point(
                origin.vertices.map(|v| &mesh.vertices()[v as usize]),
                origin.weights,
            ),
        }
    }

    fn piece(&self, mesh: &TriMesh, label: u8) -> Piece {
        let of: Vec<usize> =
            (0..self.triangles.len()).filter(|t| self.labels[*t] == label).collect();
        let mut used = vec![false; self.origins.len()];
        of.iter().for_each(|t| self.triangles[*t].iter().for_each(|v| used[*v as usize] = true));
        let kept: Vec<u32> = (0..used.len() as u32).filter(|v| used[*v as usize]).collect();
        let mut number = vec![u32::MAX; used.len()];
        kept.iter().enumerate().for_each(|(k, v)| number[*v as usize] = k as u32);
        let vertices = kept.iter().map(|v| self.point(mesh, *v)).collect();
        let triangles = of.iter().map(|t| self.triangles[*t].map(|v| number[v as usize])).collect();
        Piece {
            label,
            mesh: TriMesh::new(vertices, triangles)
                .expect("points between finite points are finite, corners differ"),
            origins: kept.iter().map(|v| self.origins[*v as usize]).collect(),
            sources: of.iter().map(|t| self.sources[*t]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::VertexTriangles;
    use if_core::shapes::meshes::{torus, tube};

    /// Scores of two labels whose difference is `g`.
    fn two(mesh: &TriMesh, g: impl Fn(&Point) -> Real) -> LabelScores {
        let scores = mesh.vertices().iter().flat_map(|p| [0.0, 0.5 - g(p), 0.5 + g(p)]).collect();
        LabelScores { labels: 3, scores }
    }

    /// Edges of two sides or one, and one fan of triangles round each vertex: no bow-tie.
    fn assert_manifold(mesh: &TriMesh, what: &str) {
        let edges = Edges::new(mesh);
        assert!(edges.valence.iter().all(|n| *n <= 2), "{what}");
        let round = VertexTriangles::new(mesh);
        for v in 0..mesh.vertices().len() {
            let ends: Vec<usize> = edges
                .vertices
                .iter()
                .enumerate()
                .filter(|(_, e)| e.contains(&(v as u32)))
                .map(|(e, _)| e)
                .collect();
            let open = ends.iter().filter(|e| edges.valence[**e] == 1).count();
            assert!(
                !round.of(v).is_empty() && (open == 0 || open == 2),
                "{what}: {open} border edges at vertex {v}"
            );
            // A closed fan and a second one would have as many edges as triangles too: walk it.
            let mut reached = vec![round.of(v)[0]];
            let mut k = 0;
            while k < reached.len() {
                for e in edges.of_triangle[reached[k] as usize] {
                    let next = edges.triangles[e as usize];
                    if edges.vertices[e as usize].contains(&(v as u32)) {
                        for t in next {
                            if t != if_core::edges::NONE && !reached.contains(&t) {
                                reached.push(t);
                            }
                        }
                    }
                }
                k += 1;
            }
            assert_eq!(reached.len(), round.of(v).len(), "{what}: two fans at vertex {v}");
        }
    }

    #[test]
    fn a_tube_cut_at_a_height_has_the_exact_area_and_a_level_border() {
        let mesh = tube(0.2, 1.0, 24, 10, false);
        let pieces = cut(&mesh, &two(&mesh, |p| p.y - 0.43), &CutParams::default()).unwrap();
        assert_eq!(pieces.iter().map(|p| p.label).collect::<Vec<_>>(), [1, 2]);
        let round = 24.0 * 2.0 * 0.2 * (std::f64::consts::PI / 24.0).sin();
        approx::assert_relative_eq!(pieces[0].mesh.area(), 0.43 * round, max_relative = 1e-12);
        approx::assert_relative_eq!(pieces[1].mesh.area(), 0.57 * round, max_relative = 1e-12);
        for piece in &pieces {
            assert_manifold(&piece.mesh, "tube");
            let loops = Edges::new(&piece.mesh).boundary_loops(&piece.mesh);
            assert_eq!(loops.len(), 2);
            let level = |l: &&Vec<u32>| {
                l.iter().all(|v| (piece.mesh.vertices()[*v as usize].y - 0.43).abs() < 1e-12)
            };
            assert_eq!(loops.iter().filter(level).count(), 1);
        }
    }

    #[test]
    fn a_slanted_line_is_a_plane_section_and_linear_attributes_stay_linear() {
        let mesh = tube(0.2, 1.0, 32, 16, false);
        let height = |p: &Point| p.y + 0.8 * p.x - 0.3 * p.z - 0.51;
        let pieces = cut(&mesh, &two(&mesh, height), &CutParams { least: 0.0 }).unwrap();
        for piece in &pieces {
            for (p, origin) in piece.mesh.vertices().iter().zip(&piece.origins) {
                let attribute = origin.value(|v| 3.0 * mesh.vertices()[v as usize].x - 2.0);
                approx::assert_relative_eq!(attribute, 3.0 * p.x - 2.0, epsilon = 1e-12);
                assert!(origin.parts().is_sorted_by(|a, b| a.1 >= b.1));
                let side = height(p) * if piece.label == 2 { 1.0 } else { -1.0 };
                assert!(side > -1e-12, "{side}");
                match (origin.source(), origin.edge()) {
                    (Some(v), None) => assert_eq!(*p, mesh.vertices()[v as usize]),
                    (None, Some(([a, b], s))) => {
                        let (a, b) = (mesh.vertices()[a as usize], mesh.vertices()[b as usize]);
                        approx::assert_relative_eq!(*p, a + (b - a) * s, epsilon = 1e-15);
                        assert!(height(p).abs() < 1e-12);
                    }
                    other => panic!("{other:?}"),
                }
            }
            for (t, source) in piece.sources.iter().enumerate() {
                let n = |m: &TriMesh, t: usize| m.face_normals()[t];
                if t % 37 == 0 {
                    approx::assert_relative_eq!(
                        n(&piece.mesh, t),
                        n(&mesh, *source as usize),
                        epsilon = 1e-9
                    );
                }
            }
        }
    }

    #[test]
    fn pieces_of_random_labels_tile_the_mesh_with_manifold_borders() {
        let mesh = torus(0.5, 0.2, 24, 12);
        let n = mesh.vertices().len();
        // Labels as wild as they can be: five of them, undecided among them, scores equal in
        // places.
        let hash = |v: usize, l: usize| ((v * 2_654_435_761 + l * 40_503) >> 7) % 8;
        let scores = (0..n).flat_map(|v| {
            (0..5).map(move |l| if l == 0 || v % 5 == 0 { 0.0 } else { hash(v, l) as Real / 7.0 })
        });
        let scores = LabelScores { labels: 5, scores: scores.collect() };
        for least in [0.0, 0.05, 0.5] {
            let pieces = cut(&mesh, &scores, &CutParams { least }).unwrap();
            assert_eq!(pieces.iter().map(|p| p.label).collect::<Vec<_>>(), [0, 1, 2, 3, 4]);
            let area: Real = pieces.iter().map(|p| p.mesh.area()).sum();
            approx::assert_relative_eq!(area, mesh.area(), max_relative = 1e-12);
            for piece in &pieces {
                assert_manifold(&piece.mesh, &format!("label {} at {least}", piece.label));
                // Each border edge is one of another piece, the other way round.
                let edges = Edges::new(&piece.mesh);
                let border = edges.valence.iter().filter(|n| **n == 1).count();
                assert!(border > 0 && piece.mesh.triangles().len() == piece.sources.len());
            }
        }
    }

    #[test]
    fn one_label_returns_the_mesh_and_errors_are_specific() {
        let mesh = torus(0.5, 0.2, 8, 6);
        let one = two(&mesh, |_| 0.1);
        let pieces = cut(&mesh, &one, &CutParams::default()).unwrap();
        assert_eq!((pieces.len(), pieces[0].label, &pieces[0].mesh), (1, 2, &mesh));
        assert!(
            cut(
                &TriMesh::default(),
                &LabelScores { labels: 3, scores: vec![] },
                &CutParams::default()
            )
            .unwrap()
            .is_empty()
        );
        let few = LabelScores { labels: 3, scores: vec![0.5; 6] };
        assert!(matches!(
            cut(&mesh, &few, &CutParams::default()),
            Err(LabelError::Vertices { got: 2, .. })
        ));
        let mut bad = one.clone();
        bad.scores[4] = Real::NAN;
        assert!(matches!(
            cut(&mesh, &bad, &CutParams::default()),
            Err(LabelError::Value { vertex: 1, label: 1, .. })
        ));
        for (labels, each) in [(0, 1), (300, 300)] {
            let scores = vec![Real::NAN; each * mesh.vertices().len()];
            let error = cut(&mesh, &LabelScores { labels, scores }, &CutParams::default());
            assert_eq!(error, Err(LabelError::Labels { values: "scores", labels }));
        }
        let mut long = one.clone();
        long.scores.extend([0.5; 2]);
        let error = cut(&mesh, &long, &CutParams::default()).unwrap_err();
        assert_eq!(
            error.to_string(),
            "there are 146 scores for 48 vertices and 3 labels; give one for each of both"
        );
        for least in [-0.1, 0.6, Real::NAN] {
            let error = cut(&mesh, &one, &CutParams { least }).unwrap_err();
            assert!(matches!(error, LabelError::Parameter(_)), "{least}");
        }
    }
}
