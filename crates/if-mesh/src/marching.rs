//! Surfaces of fields: marching cubes, evaluated only where a field can vanish, and the means to make
//! a good open mesh of the result: [`clip`], [`collapse`] and [`relax`].

mod bricks;
mod cases;
mod clip;
mod collapse;
mod crossings;
mod relax;

pub use clip::clip;
pub use collapse::collapse;
pub use relax::{RelaxParams, relax};

use bricks::{BRICK, Bricks, Lattice, MAX_BRICKS, NODES};
use crossings::Crossings;
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How [`march`] samples a field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MarchParams {
    /// Distance of neighbouring nodes, in metres: about the mean edge length that comes out.
    pub cell: Real,
    /// Where the lattice lies: node (0, 0, 0) is this many cells below the lower corner of the region.
    /// From 0 to 1. Layers that are extracted on one lattice touch in degenerate ways.
    pub phase: [Real; 3],
    /// Newton steps that carry the vertices onto the surface after one secant step.
    pub newton: usize,
}

impl Default for MarchParams {
    /// 1 cm, and one Newton step, after which vertices of a distance field are off by 1e-9 cells.
    fn default() -> Self {
        Self { cell: 0.01, phase: [0.5; 3], newton: 1 }
    }
}

/// Why there is no surface.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MarchError {
    /// The cell is not a length.
    #[error("the cell is {cell} m; it must be above zero and finite")]
    Cell {
        /// What was given.
        cell: Real,
    },
    /// The phase is not a part of a cell.
    #[error("phase {axis} is {phase}; it must lie between 0 and 1 cells")]
    Phase {
        /// 0, 1 or 2 for x, y or z.
        axis: usize,
        /// What was given.
        phase: Real,
    },
    /// The region is empty or endless.
    #[error("the region {region:?} is empty or not finite; give the box in which the surface lies")]
    Region {
        /// What was given.
        region: Aabb,
    },
    /// More cells than can be counted.
    #[error(
        "a region of {size} m in cells of {cell} m has too many cells along one side; at most about two million are possible"
    )]
    TooFine {
        /// Longest side of the region, in metres.
        size: Real,
        /// The cell, in metres.
        cell: Real,
    },
    /// The field has no value.
    #[error("the field is not a number at {point}")]
    NotANumber {
        /// Where.
        point: Point,
    },
}

/// A surface, and what it cost.
#[derive(Clone, Debug, PartialEq)]
pub struct Marched {
    /// The surface, counter-clockwise seen from outside. Closed unless it leaves the region.
    pub mesh: TriMesh,
    /// Points at which the field was evaluated.
    pub evaluations: usize,
    /// Whether the surface goes on beyond the lattice, so that the mesh has a border there.
    pub leaves_region: bool,
}

/// The surface `φ = 0` of a field within `region`, by marching cubes on a lattice that covers the region
/// and up to four cells more.
///
/// ```text
/// halve boxes down to bricks of 4³ cells, dropping those with |φ(centre)| > L · half diagonal
/// evaluate the nodes of the bricks that are left; inside is φ < 0
/// a vertex on each edge with one end inside: linear, one secant step, Newton steps along ∇φ
/// triangles of each cell by its case
/// ```
///
/// Every edge of the mesh has two triangles, every vertex one fan, whatever the values at the nodes are
/// (but for the border where the surface leaves the region). Vertices and triangles come in the order of
/// the lattice.
///
/// # Source
///
/// Lorensen and Cline 1987. The cases are made from one rule for the sides of a cube, by which opposite
/// inside corners stay apart, and no diagonal lies in a side.
///
/// # Accuracy
///
/// Vertices lie on the surface of a smooth field, to 1e-9 cells with one Newton step. Volume and triangle
/// centres have errors of the second order in the cell. Sheets and tubes thinner than a cell may be lost, and
/// where two sheets share a cell, triangles may intersect (one pair in a thousand triangles of white noise).
///
/// # Errors
///
/// A cell, phase or region that is no such thing, too many cells, or a field that is not a number.
///
/// # Examples
///
/// ```
/// use if_core::{field::SignedDistance, math::Point, shapes::Sphere};
/// use if_mesh::marching::{MarchParams, march};
/// let ball = Sphere { center: Point::origin(), radius: 0.1 };
/// let region = ball.bounds().expect("a ball has bounds").inflated(0.01);
/// let marched = march(&ball, &region, &MarchParams { cell: 0.01, ..MarchParams::default() })?;
/// assert!(!marched.leaves_region && marched.mesh.signed_volume() > 0.0041);
/// # Ok::<(), if_mesh::marching::MarchError>(())
/// ```
pub fn march<F: SignedDistance + ?Sized>(field: &F, region: &Aabb, params: &MarchParams) -> Result<Marched, MarchError> {
    let lattice = lattice(region, params)?;
    let bricks = Bricks::new(field, &lattice)?;
    let crossings = Crossings::new(&bricks);
    let mut evaluations = bricks.evaluations;
    let vertices = crossings.vertices(field, &lattice, &bricks, params.newton, &mut evaluations);
    let triangles = triangles(&bricks, &crossings);
    let mesh = TriMesh::new(vertices, triangles).expect("vertices stay within half a cell of their edge, and cases name them");
    Ok(Marched { mesh, evaluations, leaves_region: bricks.leaves })
}

fn lattice(region: &Aabb, params: &MarchParams) -> Result<Lattice, MarchError> {
    let cell = params.cell;
    if !(cell > 0.0 && cell.is_finite()) {
        return Err(MarchError::Cell { cell });
    }
    if let Some(axis) = (0..3).find(|k| !(0.0..=1.0).contains(&params.phase[*k])) {
        return Err(MarchError::Phase { axis, phase: params.phase[axis] });
    }
    let size = region.size();
    if region.is_empty() || !(0..3).all(|k| region.min[k].is_finite() && size[k].is_finite()) {
        return Err(MarchError::Region { region: *region });
    }
    let phase = Vector::from(params.phase);
    let bricks = [0, 1, 2].map(|k| ((size[k] / cell + phase[k]).ceil() / Real::from(BRICK)).ceil().max(1.0));
    if bricks.iter().any(|b| *b > MAX_BRICKS) {
        return Err(MarchError::TooFine { size: size.max(), cell });
    }
    Ok(Lattice { min: region.min - phase * cell, cell, bricks: bricks.map(|b| b as u32) })
}

fn triangles(bricks: &Bricks, crossings: &Crossings) -> Vec<[u32; 3]> {
    let cases = &*cases::CASES;
    bricks
        .bricks
        .par_iter()
        .flat_map_iter(|brick| {
            let nodes = bricks.nodes_of(*brick);
            let mut out = Vec::new();
            for cell in 0..BRICK.pow(3) {
                let base: usize = (0..3).map(|k| (cell / BRICK.pow(k) % BRICK) as usize * NODES.pow(k)).sum();
                let corner = |c: u8| {
                    nodes[base + usize::from(c & 1) + usize::from(c >> 1 & 1) * NODES + usize::from(c >> 2) * NODES * NODES]
                };
                let case = (0..8).fold(0, |case, c| case | usize::from(bricks.values[corner(c) as usize] < 0.0) << c);
                out.extend(cases[case].iter().map(|t| t.map(|edge| crossings.vertex(corner(edge / 3), edge % 3))));
            }
            out
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::index::Bvh;
    use if_core::edges::{Edges, VertexTriangles};
    use if_core::field::FieldSample;
    use if_core::shapes::{Gyroid, Plane, Sphere, Torus, Union};

    /// Edges of other than two triangles, and Euler's characteristic.
    fn topology(mesh: &TriMesh) -> (usize, i64) {
        let edges = Edges::new(mesh);
        let odd = edges.valence.iter().filter(|v| **v != 2).count();
        (odd, mesh.vertices().len() as i64 + mesh.triangles().len() as i64 - edges.len() as i64)
    }

    fn ball(cell: Real) -> Marched {
        let field = Sphere { center: Point::new(0.013, -0.007, 0.021), radius: 0.5 };
        march(&field, &field.bounds().unwrap(), &MarchParams { cell, ..MarchParams::default() }).unwrap()
    }

    #[test]
    fn a_ball_is_closed_of_euler_characteristic_two_and_its_volume_of_second_order() {
        let exact = std::f64::consts::PI / 6.0;
        let errors = [0.08, 0.04, 0.02].map(|cell| {
            let marched = ball(cell);
            assert_eq!(topology(&marched.mesh), (0, 2));
            assert!(!marched.leaves_region);
            let center = Point::new(0.013, -0.007, 0.021);
            assert!(marched.mesh.vertices().iter().all(|p| ((p - center).norm() - 0.5).abs() < 1e-12), "exact after Newton");
            exact - marched.mesh.signed_volume()
        });
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.9..2.1).contains(&order), "{errors:?}");
        }
    }

    #[test]
    fn shapes_keep_their_genus_and_the_work_follows_the_surface() {
        let ring = Torus { center: Point::origin(), major: 0.4, minor: 0.15 };
        let coarse = march(&ring, &ring.bounds().unwrap(), &MarchParams { cell: 0.04, ..MarchParams::default() }).unwrap();
        let fine = march(&ring, &ring.bounds().unwrap(), &MarchParams { cell: 0.01, ..MarchParams::default() }).unwrap();
        assert_eq!((topology(&coarse.mesh), topology(&fine.mesh)), ((0, 0), (0, 0)));
        // 16 times the surface; 64 times would be the volume.
        assert!(fine.evaluations < 25 * coarse.evaluations, "{} {}", fine.evaluations, coarse.evaluations);
        let one = Sphere { center: Point::new(-0.3, 0.0, 0.0), radius: 0.2 };
        let two = Union(one, Sphere { center: Point::new(0.3, 0.0, 0.0), ..one });
        let both = march(&two, &two.bounds().unwrap(), &MarchParams { cell: 0.03, ..MarchParams::default() }).unwrap();
        assert_eq!(topology(&both.mesh), (0, 4));
    }

    /// A field given at the nodes of a lattice and nowhere else, positive on the border.
    struct Nodes(Vec<Real>);

    impl Nodes {
        const N: usize = 9;

        fn random(seed: u64) -> Self {
            let mut state = seed;
            let values = (0..Self::N.pow(3)).map(|n| {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let border = (0..3).any(|k| [0, Self::N - 1].contains(&(n / Self::N.pow(k) % Self::N)));
                let value = f64::from((state >> 33) as u32) / f64::from(u32::MAX) - 0.25;
                if border { 1.0 } else { value }
            });
            Self(values.collect())
        }
    }

    impl SignedDistance for Nodes {
        /// Trilinear.
        fn distance(&self, p: &Point) -> Real {
            let base = [0, 1, 2].map(|k| (p[k].floor() as usize).min(Self::N - 2));
            (0..8)
                .map(|c| {
                    let at = [0, 1, 2].map(|k| base[k] + (c >> k & 1));
                    let w: Real = (0..3).map(|k| 1.0 - (p[k] - at[k] as Real).abs()).product();
                    w * self.0[at[0] + Self::N * (at[1] + Self::N * at[2])]
                })
                .sum()
        }
        fn sample(&self, p: &Point) -> FieldSample {
            FieldSample { distance: self.distance(p), gradient: Vector::zeros() }
        }
        fn bounds(&self) -> Option<Aabb> {
            None
        }
        fn lipschitz(&self) -> Real {
            Real::INFINITY
        }
    }

    #[test]
    fn any_values_at_the_nodes_give_a_manifold_almost_without_intersections() {
        let region = Aabb { min: Point::origin(), max: Point::new(8.0, 8.0, 8.0) };
        for seed in 0..12 {
            let field = Nodes::random(seed);
            let params = MarchParams { cell: 1.0, phase: [0.0; 3], newton: 0 };
            let mesh = march(&field, &region, &params).unwrap().mesh;
            let edges = Edges::new(&mesh);
            assert!(mesh.triangles().len() > 500 && edges.valence.iter().all(|v| *v == 2), "seed {seed}");
            // One fan a vertex: its triangles are as many as its edges, and all are reached.
            let fans = VertexTriangles::new(&mesh);
            for v in 0..mesh.vertices().len() {
                let fan: Vec<[u32; 3]> = fans.of(v).iter().map(|t| mesh.triangles()[*t as usize]).collect();
                let next = |w: u32| {
                    let t = fan.iter().find(|t| (0..3).any(|k| t[k] == v as u32 && t[(k + 1) % 3] == w))?;
                    t.iter().copied().find(|u| *u != v as u32 && *u != w)
                };
                let start = *fan[0].iter().find(|u| **u != v as u32 && next(**u).is_some()).unwrap();
                let (mut at, mut steps) = (next(start).unwrap(), 1);
                while at != start {
                    (at, steps) = (next(at).unwrap(), steps + 1);
                }
                assert_eq!(steps, fan.len(), "seed {seed}, vertex {v}");
            }
            // Noise winds two sheets round one another in a cell now and then.
            let crossing = own_intersections(&mesh);
            assert!(crossing * 500 <= mesh.triangles().len(), "seed {seed}: {crossing} of {}", mesh.triangles().len());
        }
    }

    /// Triangle pairs without common corners that meet.
    fn own_intersections(mesh: &TriMesh) -> usize {
        let bvh = Bvh::new(mesh);
        let mut pairs = 0;
        for t in 0..mesh.triangles().len() {
            bvh.overlapping(&Aabb::from_points(mesh.corners(t)), |u| {
                let apart = mesh.triangles()[t].iter().all(|v| !mesh.triangles()[u as usize].contains(v));
                if (u as usize) > t && apart {
                    let meet = if_core::intersect::triangles(mesh.corners(t), mesh.corners(u as usize));
                    pairs += usize::from(meet != if_core::intersect::Contact::Disjoint);
                }
            });
        }
        pairs
    }

    #[test]
    fn zeros_on_the_nodes_make_no_holes() {
        // The surface passes exactly through nodes, edges and sides of the lattice.
        let flat = Plane { point: Point::new(0.0, 0.5, 0.0), normal: Vector::y() };
        let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        let params = MarchParams { cell: 0.125, phase: [0.0; 3], newton: 1 };
        let marched = march(&flat, &region, &params).unwrap();
        assert!(marched.leaves_region);
        assert_eq!(marched.mesh.triangles().len(), 128);
        approx::assert_relative_eq!(marched.mesh.area(), 1.0, max_relative = 1e-12);
        let ball = Sphere { center: Point::new(0.5, 0.5, 0.5), radius: 0.375 };
        let mesh = march(&ball, &region, &params).unwrap().mesh;
        assert_eq!(topology(&mesh), (0, 2));
        assert!((0..mesh.triangles().len()).all(|t| mesh.corners(t)[0] != mesh.corners(t)[1]));
    }

    #[test]
    fn a_field_without_a_surface_gives_an_empty_mesh_and_a_labyrinth_an_open_one() {
        let region = Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) };
        let far = Sphere { center: Point::new(9.0, 0.0, 0.0), radius: 1.0 };
        let params = MarchParams { cell: 0.05, ..MarchParams::default() };
        assert_eq!(march(&far, &region, &params).unwrap().mesh, TriMesh::default());
        let labyrinth = march(&Gyroid { period: 0.5 }, &region, &params).unwrap();
        assert!(labyrinth.leaves_region && Edges::new(&labyrinth.mesh).valence.iter().all(|v| *v <= 2));
    }

    #[test]
    fn wrong_input_is_named() {
        let field = Sphere { center: Point::origin(), radius: 1.0 };
        let region = field.bounds().unwrap();
        let of = |region: Aabb, cell, phase| march(&field, &region, &MarchParams { cell, phase, newton: 0 }).unwrap_err();
        for cell in [0.0, -1.0, Real::NAN, Real::INFINITY] {
            assert!(matches!(of(region, cell, [0.0; 3]), MarchError::Cell { .. }));
        }
        assert!(matches!(of(region, 0.1, [0.0, 2.0, 0.0]), MarchError::Phase { axis: 1, .. }));
        assert!(matches!(of(Aabb::EMPTY, 0.1, [0.0; 3]), MarchError::Region { .. }));
        let endless = Aabb { max: Point::new(1.0, Real::INFINITY, 1.0), ..region };
        assert!(matches!(of(endless, 0.1, [0.0; 3]), MarchError::Region { .. }));
        assert!(matches!(of(region, 1e-9, [0.0; 3]), MarchError::TooFine { .. }));
        let hole = Nodes(vec![Real::NAN; Nodes::N.pow(3)]);
        let region = Aabb { min: Point::origin(), max: Point::new(8.0, 8.0, 8.0) };
        let error = march(&hole, &region, &MarchParams { cell: 1.0, ..MarchParams::default() }).unwrap_err();
        assert!(matches!(error, MarchError::NotANumber { .. }));
    }

    #[test]
    fn one_thread_gives_the_bits_of_many() {
        let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| ball(0.03));
        let many = rayon::ThreadPoolBuilder::new().num_threads(5).build().unwrap().install(|| ball(0.03));
        assert_eq!(one, many);
    }
}
