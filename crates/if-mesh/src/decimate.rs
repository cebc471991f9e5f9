//! Decimation by the library meshoptimizer (feature `decimate`: its build needs a C++ compiler, and
//! no network).

use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use meshopt::{SimplifyOptions, simplify_decoder};

/// Parameters of [`decimate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecimateParams {
    /// Target number of triangles.
    pub triangles: usize,
    /// Maximum distance from the surface by the library's estimate, in metres; infinity for no bound.
    pub error: Real,
    /// Keeps vertices on borders in place.
    pub lock_borders: bool,
}

impl Default for DecimateParams {
    /// As few as 1 mm allows, borders included.
    fn default() -> Self {
        Self { triangles: 0, error: 1e-3, lock_borders: false }
    }
}

impl DecimateParams {
    /// Checks the range of the error.
    ///
    /// # Errors
    ///
    /// An error out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let range = "at least 0 (m; infinity for no bound)";
        ParameterError::check("error", self.error, self.error >= 0.0, range)
    }
}

/// The result of [`decimate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Decimated {
    /// Some of the old vertices, unmoved, in their order.
    pub mesh: TriMesh,
    /// The old index of each vertex: carries attributes along.
    pub kept: Vec<u32>,
    /// The library's estimate of the distance from the old surface, in metres.
    pub error: Real,
}

/// Collapses edges in the order of the change to the surface, until the target number of triangles
/// or the error is reached. Topology is kept: openings stay openings.
///
/// # Source
///
/// meshoptimizer's `simplify`: Garland and Heckbert 1997, *Surface simplification using quadric
/// error metrics*. It works in single precision, here relative to the middle of the mesh; the
/// vertices that remain have their old coordinates to the bit.
///
/// # Errors
///
/// An error bound out of range.
pub fn decimate(mesh: &TriMesh, params: &DecimateParams) -> Result<Decimated, ParameterError> {
    params.validate()?;
    let middle = mesh.aabb().min + 0.5 * mesh.aabb().size();
    if mesh.triangles().is_empty() {
        return Ok(Decimated { mesh: TriMesh::default(), kept: Vec::new(), error: 0.0 });
    }
    let rounded: Vec<[f32; 3]> =
        mesh.vertices().iter().map(|p| (p - middle).map(|x| x as f32).into()).collect();
    let mut options = SimplifyOptions::ErrorAbsolute;
    if params.lock_borders {
        options |= SimplifyOptions::LockBorder;
    }
    let mut error = 0.0;
    let indices = mesh.triangles().as_flattened();
    let target = 3 * params.triangles.min(mesh.triangles().len());
    let left =
        simplify_decoder(indices, &rounded, target, params.error as f32, options, Some(&mut error));
    let mut number = vec![u32::MAX; mesh.vertices().len()];
    left.iter().for_each(|v| number[*v as usize] = 0);
    let kept: Vec<u32> = (0..number.len() as u32).filter(|v| number[*v as usize] == 0).collect();
    kept.iter().enumerate().for_each(|(k, v)| number[*v as usize] = k as u32);
    let vertices: Vec<Point> = kept.iter().map(|v| mesh.vertices()[*v as usize]).collect();
    let triangles = left.as_chunks::<3>().0.iter().map(|t| t.map(|v| number[v as usize])).collect();
    let mesh = TriMesh::new(vertices, triangles)
        .expect("triangles that are left have three corners among the old ones");
    Ok(Decimated { mesh, kept, error: Real::from(error) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::edges::Edges;
    use if_core::shapes::meshes;

    #[test]
    fn a_ball_keeps_its_shape_and_a_sheet_its_border() {
        let ball = meshes::icosphere(1.0, 4);
        let coarse =
            decimate(&ball, &DecimateParams { triangles: 500, error: 0.05, lock_borders: false })
                .unwrap();
        assert!(
            (400..=500).contains(&coarse.mesh.triangles().len()),
            "{}",
            coarse.mesh.triangles().len()
        );
        assert!(Edges::new(&coarse.mesh).valence.iter().all(|v| *v == 2) && coarse.error <= 0.05);
        approx::assert_relative_eq!(
            coarse.mesh.signed_volume(),
            ball.signed_volume(),
            max_relative = 0.03
        );
        for (p, old) in coarse.mesh.vertices().iter().zip(&coarse.kept) {
            assert_eq!(*p, ball.vertices()[*old as usize]);
        }
        let sheet = meshes::cloth(1.0, 1.0, 10, 10);
        let locked =
            decimate(&sheet, &DecimateParams { lock_borders: true, ..DecimateParams::default() })
                .unwrap()
                .mesh;
        let border = |m: &TriMesh| Edges::new(m).boundary_loops(m).concat().len();
        assert_eq!(border(&locked), 40);
        assert!(locked.triangles().len() < 80);
        let free = decimate(&sheet, &DecimateParams::default()).unwrap().mesh;
        assert!(free.triangles().len() < 10);
        approx::assert_relative_eq!(free.area(), 1.0, max_relative = 1e-6);
    }

    #[test]
    fn nothing_and_degenerate_triangles_pass() {
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        for mesh in [TriMesh::default(), point] {
            assert!(
                decimate(&mesh, &DecimateParams::default()).unwrap().mesh.triangles().len()
                    <= mesh.triangles().len()
            );
        }
    }

    #[test]
    fn an_error_out_of_range_is_refused_and_a_large_target_keeps_all_triangles() {
        let ball = meshes::icosphere(1.0, 1);
        for error in [Real::NAN, -1e-3, Real::NEG_INFINITY] {
            assert!(
                decimate(&ball, &DecimateParams { error, ..DecimateParams::default() }).is_err(),
                "{error}"
            );
        }
        let all = DecimateParams {
            triangles: usize::MAX,
            error: Real::INFINITY,
            ..DecimateParams::default()
        };
        assert_eq!(decimate(&ball, &all).unwrap().mesh.triangles().len(), ball.triangles().len());
    }
}
