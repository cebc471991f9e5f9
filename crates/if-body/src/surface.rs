//! How a surface moves that is given as positions alone: the turn of each vertex, the way from one
//! state to another, and the motion of the whole.

use crate::skin_weights::SkinError;
use crate::skinning::Affine;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, area_vector, triangle_frame};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_sparse::{Cholesky, Entry, Mat};
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion};
use rayon::prelude::*;

/// Rounds of smoothing of turns: those of single triangles swing in creases, and cloth over them would.
const ROUNDS: usize = 5;
/// Weight of a vertex's place on the straight way beside that of its edges, so that the whole is
/// somewhere. With ten thousand times more, limbs are pulled off their arcs.
const HOLD: Real = 1e-8;

/// A surface whose states are lists of positions, with the connectivity of its rest state.
#[derive(Debug)]
pub struct BodySurface {
    rest: TriMesh,
    edges: Vec<[u32; 2]>,
    /// The neighbours of each vertex.
    neighbours: Rows<u32>,
    /// The Laplacian of the edges, held a little.
    factor: Cholesky,
}

impl BodySurface {
    /// With the rest state `rest`.
    ///
    /// # Errors
    ///
    /// No triangles.
    pub fn new(rest: TriMesh) -> Result<Self, SkinError> {
        let n = rest.vertices().len();
        if rest.triangles().is_empty() {
            return Err(SkinError::Empty { vertices: n, joints: 0 });
        }
        let edges = Edges::new(&rest).vertices;
        let neighbours = neighbours(n, &edges);
        let mut entries = Vec::new();
        for v in 0..n {
            entries.push(Entry::new(v, v, neighbours.of(v).len() as Real + HOLD));
        }
        let lower = |[a, b]: &[u32; 2]| Entry::new(*a.max(b) as usize, *a.min(b) as usize, -1.0);
        entries.extend(edges.iter().map(lower));
        let factor = Cholesky::new(n, &entries)?;
        Ok(Self { rest, edges, neighbours, factor })
    }

    /// The rest state.
    pub fn rest(&self) -> &TriMesh {
        &self.rest
    }

    /// How each vertex turns from the rest state to `positions`: the mean of its triangles, smoothed
    /// along the surface.
    ///
    /// # Panics
    ///
    /// If there is not one position for each vertex.
    pub fn turns(&self, positions: &[Point]) -> Vec<UnitQuaternion<Real>> {
        turns(&self.rest, &self.neighbours, positions)
    }

    /// For each vertex the rigid map from the rest state to `positions`, with its turn.
    ///
    /// # Panics
    ///
    /// If there is not one position or turn for each vertex.
    pub fn maps(&self, positions: &[Point], turns: &[UnitQuaternion<Real>]) -> Vec<Affine> {
        assert_eq!(positions.len(), self.rest.vertices().len(), "one position for each vertex");
        assert_eq!(positions.len(), turns.len(), "one turn for each position");
        let places = self.rest.vertices().iter().zip(positions);
        let map = |((rest, to), turn): ((&Point, &Point), &UnitQuaternion<Real>)| {
            Affine::through(turn.to_rotation_matrix().into_inner(), rest, to)
        };
        places.zip(turns).map(map).collect()
    }

    /// The state at `share` of the way between two states, each with its turns: edges turn at constant
    /// speed, so that limbs go in arcs. The ends are the states themselves.
    ///
    /// # Panics
    ///
    /// If there is not one position or turn for each vertex.
    pub fn between(
        &self,
        [from, to]: [(&[Point], &[UnitQuaternion<Real>]); 2],
        share: Real,
    ) -> Vec<Point> {
        if share <= 0.0 {
            return from.0.to_vec();
        }
        if share >= 1.0 {
            return to.0.to_vec();
        }
        let n = self.rest.vertices().len();
        let now: Vec<_> = (0..n)
            .into_par_iter()
            .with_min_len(1024)
            .map(|v| {
                let (a, b) = (from.1[v], to.1[v]);
                let turn = a.try_slerp(&b, share, Real::EPSILON).unwrap_or(a);
                [turn * a.inverse(), turn * b.inverse()].map(|q| q.to_rotation_matrix())
            })
            .collect();
        let straight: Vec<Vector> =
            (0..n).map(|v| from.0[v].coords.lerp(&to.0[v].coords, share)).collect();
        let mut right: Vec<Vector> = straight.iter().map(|p| p * HOLD).collect();
        for [a, b] in self.edges.iter().map(|e| e.map(|v| v as usize)) {
            let [then, later] = [from.0, to.0].map(|x| x[a] - x[b]);
            let of = |v: usize| (now[v][0] * then).lerp(&(now[v][1] * later), share);
            let edge = (of(a) + of(b)) * 0.5;
            right[a] += edge;
            right[b] -= edge;
        }
        let mut x = Mat::from_fn(n, 3, |row, k| right[row][k]);
        self.factor.solve_in_place(&mut x);
        (0..n).map(|v| Point::new(x[(v, 0)], x[(v, 1)], x[(v, 2)])).collect()
    }

    /// The motion of the whole from the rest state to `positions`: the rigid one that fits best.
    ///
    /// # Panics
    ///
    /// If there is not one position for each vertex.
    pub fn whole(&self, positions: &[Point]) -> Isometry3<Real> {
        let rest = self.rest.vertices();
        assert_eq!(positions.len(), rest.len(), "one position for each vertex");
        let middle =
            |x: &[Point]| x.iter().map(|p| p.coords).sum::<Vector>() / x.len().max(1) as Real;
        let [a, b] = [rest, positions].map(middle);
        let spread = rest.iter().zip(positions);
        let covariance: Matrix3<Real> =
            spread.map(|(p, q)| (q.coords - b) * (p.coords - a).transpose()).sum();
        let turn = nearest_turn(&covariance);
        Isometry3::from_parts(Translation3::from(b - turn * a), turn)
    }
}

/// The neighbours of each vertex along the edges.
pub(crate) fn neighbours(vertices: usize, edges: &[[u32; 2]]) -> Rows<u32> {
    Rows::new(vertices, edges.iter().flat_map(|[a, b]| [(*a, *b), (*b, *a)]))
}

/// [`BodySurface::turns`] of a surface with these neighbours.
pub(crate) fn turns(
    surface: &TriMesh,
    neighbours: &Rows<u32>,
    positions: &[Point],
) -> Vec<UnitQuaternion<Real>> {
    let rest = surface.vertices();
    assert_eq!(positions.len(), rest.len(), "one position for each vertex");
    let mut sums = vec![Matrix3::zeros(); rest.len()];
    for t in surface.triangles() {
        let [then, now] = [rest, positions].map(|x| t.map(|v| x[v as usize]));
        if let (Some(from), Some(to)) =
            (triangle_frame(then.each_ref()), triangle_frame(now.each_ref()))
        {
            let turn = to * from.transpose() * area_vector(&then[0], &then[1], &then[2]).norm();
            t.iter().for_each(|v| sums[*v as usize] += turn);
        }
    }
    for _ in 0..ROUNDS {
        let mean = |v: usize| {
            let near = neighbours.of(v);
            let sum: Matrix3<Real> = near.iter().map(|n| sums[*n as usize]).sum();
            sums[v] + sum / near.len().max(1) as Real
        };
        sums = (0..sums.len()).into_par_iter().with_min_len(1024).map(mean).collect();
    }
    sums.par_iter().with_min_len(256).map(nearest_turn).collect()
}

/// The rotation nearest to a matrix; that of zero is none.
pub(crate) fn nearest_turn(m: &Matrix3<Real>) -> UnitQuaternion<Real> {
    let svd = m.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return UnitQuaternion::identity() };
    let mut flip = Matrix3::identity();
    flip[(2, 2)] = if (u * v).determinant() < 0.0 { -1.0 } else { 1.0 };
    if svd.singular_values[0] <= 0.0 {
        return UnitQuaternion::identity();
    }
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * flip * v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mannequin::{self, MannequinParams, rig};
    use crate::skinning::{blends, pose_points};
    use std::f64::consts::FRAC_PI_2;

    #[test]
    #[should_panic(expected = "one position for each vertex")]
    fn maps_of_a_part_of_the_body_are_refused() {
        let body = BodySurface::new(if_core::shapes::meshes::icosphere(1.0, 1)).unwrap();
        body.maps(&[Point::origin(); 5], &[UnitQuaternion::identity(); 5]);
    }

    #[test]
    fn limbs_go_in_arcs_and_the_whole_is_found() {
        let rest = mannequin::body(&MannequinParams { resolution: 0.7, overlap: 0.0 });
        let skeleton = rig::skeleton();
        let mut pose = crate::Pose::rest(skeleton.len());
        let named = |name: &str| skeleton.names().position(|n| n == name).unwrap();
        pose.rotations[named("left_thigh")] =
            UnitQuaternion::from_axis_angle(&Vector::x_axis(), -FRAC_PI_2);
        let whole = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 2.0);
        pose.rotations[0] = whole;
        pose.root_translation = Vector::new(0.3, 0.1, -0.2);
        let skin = rig::skin_weights(rest.vertices());
        let posed = |pose| {
            let maps = blends(&skin, &skeleton.transforms(pose).unwrap());
            pose_points(rest.vertices(), &maps)
        };
        let to = posed(&pose);
        let surface = BodySurface::new(rest.clone()).unwrap();
        let [still, turns] = [rest.vertices(), &to].map(|x| surface.turns(x));
        assert!(still.iter().all(|q| q.angle() < 1e-9));
        let foot = (0..rest.vertices().len())
            .filter(|v| rest.vertices()[*v].x > 0.05)
            .min_by(|a, b| rest.vertices()[*a].y.total_cmp(&rest.vertices()[*b].y))
            .unwrap();
        let expected = whole * pose.rotations[named("left_thigh")];
        assert!(turns[foot].angle_to(&expected) < 0.02, "{}", turns[foot].angle_to(&expected));
        // The maps lead where the vertices are.
        let there = pose_points(rest.vertices(), &surface.maps(&to, &turns));
        assert!(there.iter().zip(&to).all(|(a, b)| (a - b).norm() < 1e-12));
        // Half of the way is the half pose, and not the middle of the straight line.
        let ends = [(rest.vertices(), &still[..]), (&to, &turns[..])];
        let half = surface.between(ends, 0.5);
        let true_half = posed(&crate::Pose::rest(skeleton.len()).toward(&pose, 0.5));
        let far = |a: &[Point], b: &[Point]| {
            let (a0, b0) = (a[foot], b[foot]);
            let hips = rest.vertices().iter().position(|p| p.y > 1.0).unwrap();
            ((a0 - a[hips]) - (b0 - b[hips])).norm()
        };
        let straight: Vec<Point> =
            rest.vertices().iter().zip(&to).map(|(a, b)| nalgebra::center(a, b)).collect();
        let (ours, others) = (far(&half, &true_half), far(&straight, &true_half));
        // Hips and thigh turned at once are not quite both turned half.
        assert!(ours < 0.5 * others && others > 0.3, "{ours} {others}");
        assert_eq!(surface.between(ends, 0.0), rest.vertices());
        assert_eq!(surface.between(ends, 1.0), to);
        // Edges keep their lengths, where the straight way shrinks them.
        let edges = &Edges::new(&rest).vertices;
        let shortest = |x: &[Point]| {
            let share = |e: &[u32; 2]| {
                let length = |x: &[Point]| (x[e[0] as usize] - x[e[1] as usize]).norm();
                length(x) / length(rest.vertices())
            };
            edges.iter().map(share).sum::<Real>() / edges.len() as Real
        };
        assert!((shortest(&half) - 1.0).abs() < 0.02, "{}", shortest(&half));
        assert!(shortest(&straight) < 0.8, "{}", shortest(&straight));
        // The motion of the whole, and a little of the thigh's.
        let found = surface.whole(&to);
        assert!(found.rotation.angle_to(&whole) < 0.6, "{}", found.rotation.angle_to(&whole));
        let moved: Vec<Point> = rest.vertices().iter().map(|p| found * p).collect();
        assert!(surface.whole(&moved).rotation.angle_to(&found.rotation) < 1e-9);
        assert!(BodySurface::new(TriMesh::new(to, Vec::new()).unwrap()).is_err());
    }
}
