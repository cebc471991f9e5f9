//! Normals of a file, which follow vertices that moved.

use crate::attributes::Column;
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;

/// Treatment of the normals of a file whose vertices have moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Normals {
    /// Each turns with the surface at its vertex, by the smallest rotation from the old
    /// angle-weighted vertex normal to the new one. A normal without motion around it keeps its
    /// bits, and one that differs from the geometric normal keeps that difference.
    #[default]
    Follow,
    /// All stay unchanged.
    Keep,
}

/// For each vertex the surface normal before and after.
pub(crate) struct Turns {
    before: Vec<Vector>,
    after: Vec<Vector>,
}

impl Turns {
    /// `None` if the positions have the same bits, or do not belong to this mesh.
    pub(crate) fn new(mesh: &TriMesh, positions: &[Point]) -> Option<Self> {
        if mesh.vertices() == positions {
            return None;
        }
        let moved = mesh.with_vertices(positions.to_vec()).ok()?;
        Some(Self { before: mesh.vertex_normals(), after: moved.vertex_normals() })
    }

    /// Between the surface normals of the same vertices.
    pub(crate) fn between(before: Vec<Vector>, after: Vec<Vector>) -> Self {
        Self { before, after }
    }

    /// Those of some vertices, in the order of their numbers.
    pub(crate) fn picked(&self, vertices: &[u32]) -> Self {
        let of = |normals: &[Vector]| vertices.iter().map(|v| normals[*v as usize]).collect();
        Self { before: of(&self.before), after: of(&self.after) }
    }

    /// Turns the normals in three columns, of x, y and z, with the surface. Unsigned numbers stay: they are
    /// offsets from a middle that the file does not name.
    pub(crate) fn turn(&self, mut columns: [&mut Column; 3]) {
        for v in 0..self.before.len() {
            let n = columns.each_ref().map(|c| c.get(v));
            let Some(n) = self.turned(v, &n.into()) else { continue };
            for (axis, column) in columns.iter_mut().enumerate() {
                if column.scalar_type().is_signed() {
                    column.set(v, n[axis]);
                }
            }
        }
    }

    /// The normal `n` of vertex `v` turned with the surface; `None` if it stays.
    pub(crate) fn turned(&self, v: usize, n: &Vector) -> Option<Vector> {
        let (a, b) = (&self.before[v], &self.after[v]);
        let sum = a + b;
        if a == b
            || *a == Vector::zeros()
            || *b == Vector::zeros()
            || n.iter().any(|x| !x.is_finite())
        {
            return None;
        }
        let s2 = sum.norm_squared();
        // The rotation is two reflections: across the plane normal to a, then to a + b. Opposite
        // normals have no smallest rotation; one reflection is used instead.
        let first = n - a * (2.0 * n.dot(a));
        Some(if s2 > OPPOSITE { first - sum * (2.0 * first.dot(&sum) / s2) } else { first })
    }
}

/// Squared length of a + b, for unit vectors, below which they count as opposite. Rounding leaves
/// 1e-32 there; ten times more or less changes nothing for surfaces that are not folded onto
/// themselves.
const OPPOSITE: f64 = 1e-24;

#[cfg(test)]
mod tests {
    use super::*;

    fn flat() -> TriMesh {
        let v = vec![
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
            Point::new(9.0, 9.0, 9.0),
        ];
        TriMesh::new(v, vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn a_normal_turns_with_its_triangle() {
        let mesh = flat();
        // Turned by 90° about x: z becomes −y, y becomes z.
        let moved: Vec<Point> =
            mesh.vertices().iter().map(|p| Point::new(p.x, -p.z, p.y)).collect();
        let turns = Turns::new(&mesh, &moved).unwrap();
        approx::assert_relative_eq!(
            turns.turned(0, &Vector::z()).unwrap(),
            -Vector::y(),
            epsilon = 1e-15
        );
        let slanted = Vector::new(0.6, 0.0, 0.8);
        approx::assert_relative_eq!(
            turns.turned(1, &slanted).unwrap(),
            Vector::new(0.6, -0.8, 0.0),
            epsilon = 1e-15
        );
        assert!(
            turns.turned(3, &Vector::z()).is_none(),
            "a vertex without triangles has no normal to follow"
        );
    }

    #[test]
    fn a_flipped_triangle_flips_its_normals_and_a_still_one_keeps_them() {
        let mesh = flat();
        assert!(Turns::new(&mesh, mesh.vertices()).is_none());
        let mut moved = mesh.vertices().to_vec();
        moved.swap(1, 2);
        let turns = Turns::new(&mesh, &moved).unwrap();
        assert_eq!(turns.turned(0, &Vector::z()), Some(-Vector::z()));
        assert_eq!(turns.turned(0, &Vector::new(f64::NAN, 0.0, 1.0)), None);
    }
}
