//! The built-in scene: a person in layered clothes, made of formulas alone.
//!
//! Lengths are in metres, y points up, the person faces +z and stands on y = 0.

mod cloth;
mod figure;
pub mod rig;
mod shape;

use if_core::math::Real;
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::parameter::ParameterError;
use if_mesh::extract::{ExtractParams, Resolution, extract};
use if_mesh::marching::{RelaxParams, clip, collapse, relax};
use serde::{Deserialize, Serialize};

/// Parameters of the mannequin: how fine its meshes are, and how deep layers intersect.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MannequinParams {
    /// Divides the edge length: 2 gives four times as many triangles. From 0.7 to 8.
    pub resolution: Real,
    /// Depth of intersections: with 0 layers are free of intersections, with 1 each dips 1 to 2 cm
    /// into those below. From 0 to 1.
    pub overlap: Real,
}

impl Default for MannequinParams {
    /// Edges of 10 to 25 mm, and deep intersections.
    fn default() -> Self {
        Self { resolution: 1.0, overlap: 1.0 }
    }
}

impl MannequinParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range or NaN.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let Self { resolution, overlap } = *self;
        let check = ParameterError::check;
        check("resolution", resolution, (0.7..=8.0).contains(&resolution), "from 0.7 to 8")?;
        check("overlap", overlap, (0.0..=1.0).contains(&overlap), "from 0 to 1")
    }
}

/// The garments of the mannequin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Garment {
    /// Long trousers. Worn below the T-shirt.
    Trousers,
    /// With short sleeves.
    Tshirt,
    /// Flared, to above the knees. Worn over the T-shirt.
    Skirt,
    /// Long sleeves, open in front.
    Jacket,
    /// Long sleeves, open in front, to the knees.
    Coat,
}

impl Garment {
    /// All garments, inner to outer.
    pub const ALL: [Garment; 5] =
        [Garment::Trousers, Garment::Tshirt, Garment::Skirt, Garment::Jacket, Garment::Coat];

    /// A short name in lower case.
    pub fn name(self) -> &'static str {
        match self {
            Garment::Trousers => "trousers",
            Garment::Tshirt => "tshirt",
            Garment::Skirt => "skirt",
            Garment::Jacket => "jacket",
            Garment::Coat => "coat",
        }
    }
}

/// The body: 1.70 m high, arms 42° from the trunk; closed, connected, without intersections.
///
/// # Panics
///
/// If `params` do not [validate](MannequinParams::validate).
pub fn body(params: &MannequinParams) -> TriMesh {
    let figure = figure::figure();
    let cell = 0.0120 / checked(params).resolution;
    surface(&figure, cell, [0.31, 0.55, 0.77], &[])
}

/// One garment: open, connected, wound outwards.
///
/// # Panics
///
/// If `params` do not [validate](MannequinParams::validate).
pub fn garment(kind: Garment, params: &MannequinParams) -> TriMesh {
    let pattern = cloth::pattern(kind, checked(params).overlap);
    surface(&pattern.shape, pattern.cell / params.resolution, pattern.phase, &pattern.cuts)
}

/// The body, T-shirt, skirt, jacket and coat, with their names.
///
/// # Panics
///
/// If `params` do not [validate](MannequinParams::validate).
pub fn layered(params: &MannequinParams) -> Vec<(String, TriMesh)> {
    dressed(&[Garment::Tshirt, Garment::Skirt, Garment::Jacket, Garment::Coat], params)
}

/// The body, trousers, T-shirt, jacket and coat, with their names.
///
/// # Panics
///
/// If `params` do not [validate](MannequinParams::validate).
pub fn layered_with_trousers(params: &MannequinParams) -> Vec<(String, TriMesh)> {
    dressed(&[Garment::Trousers, Garment::Tshirt, Garment::Jacket, Garment::Coat], params)
}

fn dressed(garments: &[Garment], params: &MannequinParams) -> Vec<(String, TriMesh)> {
    std::iter::once(("body".to_owned(), body(params)))
        .chain(garments.iter().map(|kind| (kind.name().to_owned(), garment(*kind, params))))
        .collect()
}

fn checked(params: &MannequinParams) -> &MannequinParams {
    if let Err(error) = params.validate() {
        panic!("{error}");
    }
    params
}

/// Extracts a shape, cuts it open, and evens out its triangles.
fn surface(shape: &shape::Shape, cell: Real, phase: [Real; 3], cuts: &[shape::Formula]) -> TriMesh {
    let params = ExtractParams {
        resolution: Resolution::Cell(cell),
        phase,
        check: 0,
        ..ExtractParams::default()
    };
    let mut mesh = extract(shape, &params, &mut Silent)
        .expect("every shape here has bounds, and formulas are finite in finite boxes")
        .mesh;
    for cut in cuts {
        let values: Vec<Real> = mesh.vertices().iter().map(cut).collect();
        mesh = clip(&mesh, &values);
    }
    for _ in 0..2 {
        mesh = collapse(&mesh, 0.6 * cell);
        let rounds = RelaxParams { rounds: 2, ..RelaxParams::default() };
        mesh = relax(&mesh, shape, &rounds).expect("the step is the default one");
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::aabb::Aabb;
    use if_core::edges::{Edges, part_count};
    use if_core::field::SignedDistance;
    use if_core::intersect::{triangles, triangles_sharing};
    use if_mesh::index::Bvh;

    /// Coarse enough for tests: half the triangles.
    fn coarse(overlap: Real) -> MannequinParams {
        MannequinParams { resolution: 0.7, overlap }
    }

    fn pairs(a: &TriMesh, b: &TriMesh) -> usize {
        let bvh = Bvh::new(a);
        let mut n = 0;
        for t in 0..b.triangles().len() {
            bvh.overlapping(&Aabb::from_points(b.corners(t)), |u| {
                n += usize::from(triangles(a.corners(u as usize), b.corners(t)).is_some())
            });
        }
        n
    }

    fn own_pairs(mesh: &TriMesh) -> usize {
        let bvh = Bvh::new(mesh);
        let mut n = 0;
        for t in 0..mesh.triangles().len() {
            bvh.overlapping(&Aabb::from_points(mesh.corners(t)), |u| {
                let u = u as usize;
                let contact = || {
                    triangles_sharing(
                        mesh.corners(t),
                        mesh.triangles()[t],
                        mesh.corners(u),
                        mesh.triangles()[u],
                    )
                };
                n += usize::from(u > t && contact().is_some());
            });
        }
        n
    }

    /// Shortest and longest edge, mean, share between 10 and 25 mm.
    fn edge_lengths(mesh: &TriMesh) -> [Real; 4] {
        let l: Vec<Real> = Edges::new(mesh)
            .vertices
            .iter()
            .map(|e| (mesh.vertices()[e[0] as usize] - mesh.vertices()[e[1] as usize]).norm())
            .collect();
        let n = l.len() as Real;
        let share = l.iter().filter(|l| (0.010..=0.025).contains(*l)).count() as Real / n;
        [
            l.iter().copied().fold(1.0, Real::min),
            l.iter().copied().fold(0.0, Real::max),
            l.iter().sum::<Real>() / n,
            share,
        ]
    }

    /// Share of the vertices that lie in a shape, and the deepest of them in metres.
    fn inside(mesh: &TriMesh, shape: &shape::Shape) -> (Real, Real) {
        let depths: Vec<Real> =
            mesh.vertices().iter().map(|p| -shape.distance(p)).filter(|d| *d > 0.0).collect();
        (
            depths.len() as Real / mesh.vertices().len() as Real,
            depths.iter().copied().fold(0.0, Real::max),
        )
    }

    fn assert_sound(name: &str, mesh: &TriMesh, borders: usize, euler: i64) {
        let edges = Edges::new(mesh);
        assert!(edges.valence.iter().all(|v| *v <= 2), "{name}");
        assert_eq!(edges.boundary_loops(mesh).len(), borders, "{name}");
        assert_eq!(
            mesh.vertices().len() as i64 + mesh.triangles().len() as i64 - edges.len() as i64,
            euler,
            "{name}"
        );
        assert_eq!((part_count(mesh), own_pairs(mesh)), (1, 0), "{name}");
    }

    #[test]
    fn the_body_is_closed_connected_and_1_7_m_high() {
        let body = body(&coarse(1.0));
        assert_sound("body", &body, 0, 2);
        let aabb = body.aabb();
        assert!(aabb.min.y.abs() < 0.004 && (1.69..1.73).contains(&aabb.max.y), "{aabb:?}");
        assert!((0.045..0.075).contains(&body.signed_volume()), "{} m³", body.signed_volume());
    }

    #[test]
    fn garments_are_connected_and_have_their_openings() {
        // A tube with n borders has Euler characteristic 2 − n; what is open in front has one
        // border less.
        let openings = [
            (Garment::Trousers, 3),
            (Garment::Tshirt, 4),
            (Garment::Skirt, 2),
            (Garment::Jacket, 3),
            (Garment::Coat, 3),
        ];
        for (kind, borders) in openings {
            assert_sound(kind.name(), &garment(kind, &coarse(1.0)), borders, 2 - borders as i64);
        }
    }

    #[test]
    fn without_overlap_no_layers_intersect() {
        let params = coarse(0.0);
        let kinds = Garment::ALL;
        let layers: Vec<TriMesh> = std::iter::once(body(&params))
            .chain(kinds.iter().map(|k| garment(*k, &params)))
            .collect();
        for i in 0..layers.len() {
            for j in i + 1..layers.len() {
                // Skirts are not worn over trousers.
                if (i, j) != (1, 3) {
                    assert_eq!(pairs(&layers[i], &layers[j]), 0, "{i} {j}");
                }
            }
        }
    }

    #[test]
    fn with_overlap_each_layer_dips_into_those_below() {
        let params = coarse(1.0);
        let mesh = |kind| garment(kind, &params);
        let shape = |kind| cloth::pattern(kind, 1.0).shape;
        let (tshirt, skirt, jacket, coat) = (
            mesh(Garment::Tshirt),
            mesh(Garment::Skirt),
            mesh(Garment::Jacket),
            mesh(Garment::Coat),
        );
        let cases = [
            ("tshirt, body", inside(&tshirt, &figure::figure()), 0.10..0.20, 0.005..0.010),
            ("skirt, tshirt", inside(&skirt, &shape(Garment::Tshirt)), 0.01..0.20, 0.005..0.015),
            ("jacket, tshirt", inside(&jacket, &shape(Garment::Tshirt)), 0.04..0.30, 0.008..0.016),
            ("jacket, skirt", inside(&jacket, &shape(Garment::Skirt)), 0.02..0.30, 0.008..0.020),
            ("coat, jacket", inside(&coat, &shape(Garment::Jacket)), 0.10..0.40, 0.014..0.024),
        ];
        for (name, (share, depth), shares, depths) in cases {
            assert!(
                shares.contains(&share) && depths.contains(&depth),
                "{name}: {share} of the vertices, {depth} m deep"
            );
        }
    }

    #[test]
    fn triangles_are_even() {
        for kind in Garment::ALL {
            let [shortest, longest, mean, share] =
                edge_lengths(&garment(kind, &MannequinParams::default()));
            assert!(
                shortest > 0.003 && longest < 0.040 && (0.014..0.020).contains(&mean),
                "{kind:?} {shortest} {longest} {mean}"
            );
            assert!(share > 0.9, "{kind:?} {share}");
        }
    }

    #[test]
    fn parameters_out_of_range_are_errors() {
        assert!(MannequinParams::default().validate().is_ok());
        for resolution in [0.0, -1.0, 100.0, Real::NAN] {
            let error = MannequinParams { resolution, ..MannequinParams::default() }
                .validate()
                .unwrap_err();
            assert!(error.to_string().contains("resolution"), "{error}");
        }
        assert!(MannequinParams { overlap: 1.5, ..MannequinParams::default() }.validate().is_err());
    }
}
