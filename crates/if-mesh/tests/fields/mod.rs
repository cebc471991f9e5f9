//! The fields on which extraction is measured, with what is known of them. Shared by tests and
//! examples.
#![allow(dead_code)] // each user takes what it needs

use if_core::aabb::Aabb;
use if_core::edges::{Edges, VertexTriangles};
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::{Cuboid, Gyroid, Plane, ScaledGradient, Sphere, Torus, Union};

/// Side of the region, in metres: a person with arms spread and some air.
pub(crate) const BOX: Real = 2.4;

/// A name, a field, and what to expect of its surface.
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) field: Box<dyn SignedDistance>,
    /// Features are thicker than two cells, and the surface has no creases: triangles come out
    /// well-shaped.
    pub(crate) resolved: bool,
    /// Where the lattice lies.
    pub(crate) phase: [Real; 3],
    /// How far values are from those of a smooth field.
    pub(crate) noise: Real,
}

/// What lies within `half` of a surface.
pub(crate) struct Shell<F> {
    pub(crate) field: F,
    pub(crate) half: Real,
}

impl<F: SignedDistance> SignedDistance for Shell<F> {
    fn distance(&self, p: &Point) -> Real {
        self.field.distance(p).abs() - self.half
    }
    fn sample(&self, p: &Point) -> FieldSample {
        let s = self.field.sample(p);
        let side = if s.distance < 0.0 { -1.0 } else { 1.0 };
        FieldSample { distance: s.distance.abs() - self.half, gradient: s.gradient * side }
    }
    fn bounds(&self) -> Option<Aabb> {
        self.field.bounds().map(|b| b.inflated(self.half))
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz()
    }
}

/// A field with noise that follows no slope: a value for each point, the same each time.
pub(crate) struct Noisy<F> {
    pub(crate) field: F,
    pub(crate) amplitude: Real,
}

impl<F: SignedDistance> SignedDistance for Noisy<F> {
    fn distance(&self, p: &Point) -> Real {
        let mut hash = 0x9e37_79b9_7f4a_7c15u64;
        for x in p.iter() {
            hash = (hash ^ x.to_bits()).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            hash ^= hash >> 29;
        }
        let unit = (hash >> 11) as Real / (1u64 << 53) as Real;
        self.field.distance(p) + self.amplitude * (2.0 * unit - 1.0)
    }
    fn sample(&self, p: &Point) -> FieldSample {
        FieldSample { distance: self.distance(p), ..self.field.sample(p) }
    }
    fn bounds(&self) -> Option<Aabb> {
        self.field.bounds()
    }
    fn lipschitz(&self) -> Real {
        self.field.lipschitz()
    }
}

/// One value everywhere.
pub(crate) struct Constant(pub(crate) Real);

impl SignedDistance for Constant {
    fn distance(&self, _: &Point) -> Real {
        self.0
    }
    fn sample(&self, _: &Point) -> FieldSample {
        FieldSample { distance: self.0, gradient: Vector::zeros() }
    }
    fn bounds(&self) -> Option<Aabb> {
        None
    }
    fn lipschitz(&self) -> Real {
        1.0
    }
}

/// The cube of side [`BOX`] round the origin.
pub(crate) fn region() -> Aabb {
    Aabb { min: Point::origin(), max: Point::origin() }.inflated(0.5 * BOX)
}

pub(crate) fn sphere() -> Sphere {
    Sphere { center: Point::new(0.011, -0.017, 0.023), radius: 0.9 }
}

pub(crate) fn torus() -> Torus {
    Torus { center: Point::new(0.011, -0.017, 0.023), major: 0.75, minor: 0.3 }
}

/// A ball and, `gap` above it, a layer 10 cm thick.
pub(crate) fn layers(gap: Real) -> Union<Sphere, Shell<Sphere>> {
    let ball = Sphere { radius: 0.85, ..sphere() };
    Union(ball, Shell { field: Sphere { radius: 0.85 + gap + 0.05, ..ball }, half: 0.05 })
}

/// A spherical shell of 8 mm.
pub(crate) fn shell() -> Shell<Sphere> {
    Shell { field: sphere(), half: 0.004 }
}

/// The matrix of fields for cells of `BOX / cells`.
pub(crate) fn cases(cells: u32) -> Vec<Case> {
    let h = BOX / Real::from(cells);
    let case = |name: &str, field: Box<dyn SignedDistance>, resolved| Case {
        name: name.to_owned(),
        field,
        resolved,
        phase: [0.0; 3],
        noise: 0.0,
    };
    let gyroid = Gyroid { period: 0.8 };
    let mut all = vec![
        case("sphere", Box::new(sphere()), true),
        case("torus", Box::new(torus()), true),
        case("gyroid", Box::new(gyroid), true),
        case("shell 8 mm", Box::new(shell()), 0.008 > 2.0 * h),
        case("sphere, slope 0.5", Box::new(ScaledGradient { field: sphere(), factor: 0.5 }), true),
        case("sphere, slope 2", Box::new(ScaledGradient { field: sphere(), factor: 2.0 }), true),
        case("gyroid, slope 0.5", Box::new(ScaledGradient { field: gyroid, factor: 0.5 }), true),
        case("gyroid, slope 2", Box::new(ScaledGradient { field: gyroid, factor: 2.0 }), true),
        Case {
            noise: 1e-6,
            ..case("sphere, noise 1e-6", Box::new(Noisy { field: sphere(), amplitude: 1e-6 }), true)
        },
        // Nodes lie on the surface: at the poles, and on all of the cuboid's sides.
        case(
            "zeros, sphere",
            Box::new(Sphere { center: Point::origin(), radius: 0.25 * BOX }),
            true,
        ),
        case(
            "zeros, cuboid",
            Box::new(Cuboid { center: Point::origin(), half: Vector::repeat(0.25 * BOX) }),
            false,
        ),
        case("zeros, plane", Box::new(Plane { point: Point::origin(), normal: Vector::y() }), true),
        case("empty", Box::new(Constant(1.0)), true),
        case("full", Box::new(Constant(-1.0)), true),
        case(
            "through the box",
            Box::new(Sphere { center: Point::new(0.9, 0.1, 0.2), radius: 0.9 }),
            true,
        ),
        Case { phase: [0.31, 0.55, 0.77], ..case("sphere, phase", Box::new(sphere()), true) },
    ];
    for times in [0.5, 1.0, 2.0, 4.0] {
        all.push(case(&format!("layers, gap {times} h"), Box::new(layers(times * h)), times > 2.0));
    }
    all
}

/// What is wrong with a mesh as a manifold: edges of three or more triangles, vertices of two or
/// more fans, and border edges of which no end lies in the border of `region`.
pub(crate) fn flaws(mesh: &TriMesh, region: &Aabb, cell: Real) -> [usize; 3] {
    let edges = Edges::new(mesh);
    let fins = edges.valence.iter().filter(|v| **v > 2).count();
    let at_border =
        |p: &Point| (0..3).any(|k| (p[k] - region.min[k]).min(region.max[k] - p[k]) < cell);
    let holes = (0..edges.len())
        .filter(|e| {
            edges.valence[*e] == 1
                && !edges.vertices[*e].iter().any(|v| at_border(&mesh.vertices()[*v as usize]))
        })
        .count();
    let fans = VertexTriangles::new(mesh);
    let bow_ties = (0..mesh.vertices().len())
        .filter(|v| fans_at(mesh, &edges, fans.of(*v), *v as u32) > 1)
        .count();
    [fins, bow_ties, holes]
}

/// How many groups of triangles that share edges meet in a vertex.
fn fans_at(mesh: &TriMesh, edges: &Edges, triangles: &[u32], v: u32) -> usize {
    let edge_of = |t: u32| {
        (0..3)
            .map(move |k| edges.of_triangle[t as usize][k])
            .filter(|e| edges.vertices[*e as usize].contains(&v))
    };
    let mut left: Vec<u32> = triangles.to_vec();
    let mut fans = 0;
    while let Some(first) = left.pop() {
        fans += 1;
        let mut front = vec![first];
        while let Some(t) = front.pop() {
            let mut k = 0;
            while k < left.len() {
                if edge_of(t).any(|e| edge_of(left[k]).any(|f| f == e)) {
                    front.push(left.swap_remove(k));
                } else {
                    k += 1;
                }
            }
        }
    }
    debug_assert!(triangles.is_empty() || mesh.triangles()[triangles[0] as usize].contains(&v));
    fans
}
