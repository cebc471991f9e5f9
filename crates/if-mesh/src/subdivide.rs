//! Subdivision of each triangle into four, with the attributes of the vertices.

use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::{MeshError, TriMesh};
use if_core::rows::Rows;
use std::f64::consts::TAU;

/// Positions of new vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scheme {
    /// In the middle of the edges: the surface stays as it is.
    Midpoint,
    /// By Loop's rules: the surface becomes smooth, and so do its borders.
    Loop,
}

/// A finer mesh, and the origin of its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Subdivided {
    /// The old vertices first, in their order, then one for each edge in the order of [`Edges`].
    pub mesh: TriMesh,
    /// New vertices as weighted means of old ones, for attributes.
    pub stencils: Stencils,
}

/// For each new vertex the old ones of which it is the weighted mean. Weights are not negative, and
/// their sum is 1.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Stencils {
    start: Vec<u32>,
    entries: Vec<(u32, Real)>,
}

impl Stencils {
    /// Number of new vertices.
    pub fn len(&self) -> usize {
        self.start.len().saturating_sub(1)
    }

    /// Whether there are no vertices.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The old vertices of new vertex `v`, with their weights.
    ///
    /// # Panics
    ///
    /// If `v` is out of range.
    pub fn of(&self, v: usize) -> &[(u32, Real)] {
        &self.entries[self.start[v] as usize..self.start[v + 1] as usize]
    }

    /// Attributes of `channels` numbers a vertex, such as skinning weights or colours, at the new
    /// vertices. Weights with a sum of 1 keep it.
    ///
    /// # Panics
    ///
    /// If the length of `values` is not `channels` times the number of old vertices.
    pub fn mean(&self, values: &[Real], channels: usize) -> Vec<Real> {
        let mut out = vec![0.0; self.len() * channels];
        for v in 0..self.len() {
            for (old, weight) in self.of(v) {
                for k in 0..channels {
                    out[v * channels + k] += weight * values[*old as usize * channels + k];
                }
            }
        }
        out
    }

    /// Attributes without a mean, such as labels: that of the old vertex with the largest weight,
    /// with the smallest index among equals.
    ///
    /// # Panics
    ///
    /// If the length of `values` is not the number of old vertices.
    pub fn pick<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let largest = |v: usize| {
            self.of(v).iter().fold(None, |best: Option<(u32, Real)>, e| match best {
                Some(b) if b.1 > e.1 || (b.1 == e.1 && b.0 < e.0) => best,
                _ => Some(*e),
            })
        };
        (0..self.len()).filter_map(largest).map(|e| values[e.0 as usize]).collect()
    }

    fn push(&mut self, entries: impl IntoIterator<Item = (u32, Real)>) {
        if self.start.is_empty() {
            self.start.push(0);
        }
        self.entries.extend(entries.into_iter().filter(|e| e.1 > 0.0));
        self.start.push(self.entries.len() as u32);
    }
}

/// Splits each triangle into four.
///
/// Borders, and edges of three or more triangles, follow the rules of curves; where borders meet,
/// vertices stay.
///
/// # Source
///
/// Loop 1987, *Smooth subdivision surfaces based on triangles*; borders by Hoppe et al. 1994.
///
/// # Errors
///
/// More vertices than 32-bit indices allow.
///
/// # Examples
///
/// ```
/// use if_core::shapes::meshes;
/// use if_mesh::subdivide::{Scheme, subdivide};
/// let cube = meshes::icosphere(1.0, 1);
/// let fine = subdivide(&cube, Scheme::Loop)?;
/// assert_eq!(fine.mesh.triangles().len(), 4 * cube.triangles().len());
/// # Ok::<(), if_core::mesh::MeshError>(())
/// ```
pub fn subdivide(mesh: &TriMesh, scheme: Scheme) -> Result<Subdivided, MeshError> {
    let edges = Edges::new(mesh);
    let n = mesh.vertices().len();
    let mut stencils = Stencils::default();
    match scheme {
        Scheme::Midpoint => (0..n as u32).for_each(|v| stencils.push([(v, 1.0)])),
        Scheme::Loop => loop_vertices(mesh, &edges, &mut stencils),
    }
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        let inner = scheme == Scheme::Loop && edges.valence[e] == 2;
        let opposite = edges.triangles[e].map(|t| {
            mesh.triangles().get(t as usize).and_then(|t| t.iter().find(|v| ![a, b].contains(v)))
        });
        match (inner, opposite) {
            (true, [Some(c), Some(d)]) => {
                stencils.push([(a, 0.375), (b, 0.375), (*c, 0.125), (*d, 0.125)])
            }
            _ => stencils.push([(a, 0.5), (b, 0.5)]),
        }
    }
    let at = |v: usize| {
        stencils
            .of(v)
            .iter()
            .map(|(old, w)| mesh.vertices()[*old as usize].coords * *w)
            .sum::<Vector>()
    };
    let vertices: Vec<Point> = (0..stencils.len()).map(|v| Point::from(at(v))).collect();
    let mut triangles = Vec::with_capacity(4 * mesh.triangles().len());
    for (t, &[a, b, c]) in mesh.triangles().iter().enumerate() {
        let [ab, bc, ca] = edges.of_triangle[t].map(|e| e + n as u32);
        triangles.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
    }
    Ok(Subdivided { mesh: TriMesh::new(vertices, triangles)?, stencils })
}

/// Loop's rules for the old vertices.
fn loop_vertices(mesh: &TriMesh, edges: &Edges, stencils: &mut Stencils) {
    let n = mesh.vertices().len();
    let round = edges.neighbours(n);
    let creased = edges.vertices.iter().zip(&edges.valence).filter(|(_, valence)| **valence != 2);
    let creases = Rows::new(n, creased.flat_map(|(&[a, b], _)| [(a, b), (b, a)]));
    for v in 0..n {
        let own = v as u32;
        match (creases.of(v), round.of(v).len()) {
            ([], k @ 3..) => {
                let middle = 0.375 + 0.25 * (TAU / k as Real).cos();
                let share = (0.625 - middle * middle) / k as Real;
                let rest = round.of(v).iter().map(|w| (*w, share));
                stencils.push(std::iter::once((own, 1.0 - share * k as Real)).chain(rest));
            }
            ([a, b], _) => stencils.push([(own, 0.75), (*a, 0.125), (*b, 0.125)]),
            _ => stencils.push([(own, 1.0)]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn midpoints_keep_the_surface_and_loop_makes_it_smooth() {
        let coarse = meshes::icosphere(1.0, 0);
        let flat = subdivide(&coarse, Scheme::Midpoint).unwrap().mesh;
        assert_eq!(flat.triangles().len(), 80);
        approx::assert_relative_eq!(flat.area(), coarse.area(), max_relative = 1e-12);
        approx::assert_relative_eq!(
            flat.signed_volume(),
            coarse.signed_volume(),
            max_relative = 1e-12
        );
        let mut smooth = coarse;
        for _ in 0..3 {
            smooth = subdivide(&smooth, Scheme::Loop).unwrap().mesh;
        }
        let radii: Vec<Real> = smooth.vertices().iter().map(|p| p.coords.norm()).collect();
        let (least, most) = (
            radii.iter().copied().fold(1.0, Real::min),
            radii.iter().copied().fold(0.0, Real::max),
        );
        assert!(most < 1.03 * least, "an icosahedron becomes nearly a ball: {least} {most}");
    }

    #[test]
    fn linear_functions_and_sums_of_weights_are_kept() {
        let sheet = meshes::cloth(1.0, 1.0, 4, 3);
        for scheme in [Scheme::Midpoint, Scheme::Loop] {
            let fine = subdivide(&sheet, scheme).unwrap();
            let linear = |p: &Point| 2.0 * p.x - 3.0 * p.y + 0.5 * p.z + 1.0;
            let values: Vec<Real> =
                sheet.vertices().iter().flat_map(|p| [linear(p), 1.0]).collect();
            for (v, two) in fine.stencils.mean(&values, 2).chunks_exact(2).enumerate() {
                approx::assert_relative_eq!(
                    two[0],
                    linear(&fine.mesh.vertices()[v]),
                    epsilon = 1e-12
                );
                approx::assert_relative_eq!(two[1], 1.0, epsilon = 1e-12);
            }
            let labels: Vec<u8> = (0..sheet.vertices().len()).map(|v| v as u8).collect();
            let picked = fine.stencils.pick(&labels);
            assert_eq!(picked[..labels.len()], labels, "old vertices keep their labels");
            let edges = Edges::new(&sheet);
            assert_eq!(
                u32::from(picked[labels.len()]),
                edges.vertices[0][0].min(edges.vertices[0][1])
            );
            assert_eq!(Edges::new(&fine.mesh).boundary_loops(&fine.mesh).len(), 1);
        }
    }

    #[test]
    fn degenerate_meshes_pass() {
        assert_eq!(subdivide(&TriMesh::default(), Scheme::Loop).unwrap().mesh, TriMesh::default());
        let fin =
            TriMesh::new(vec![Point::origin(); 5], vec![[0, 1, 2], [0, 1, 3], [1, 0, 4]]).unwrap();
        let stray = TriMesh::new(vec![Point::origin(); 4], vec![[0, 1, 2]]).unwrap();
        for mesh in [fin, stray] {
            let fine = subdivide(&mesh, Scheme::Loop).unwrap();
            assert_eq!(fine.mesh.triangles().len(), 4 * mesh.triangles().len());
        }
    }
}
