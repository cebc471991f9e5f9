//! Meshes, closed or open, as targets of neural fits. Here, because `if-neural` does not depend on
//! `if-mesh`.

use if_core::aabb::Aabb;
use if_core::math::{Point, Vector};
use if_core::mesh::TriMesh;
use if_mesh::sdf::{MeshSdf, SdfError};
use if_neural::TargetError;
use if_neural::cloud::OrientedPoints;
use if_neural::target::Target;

/// How a mesh becomes a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Take {
    /// The field if the mesh is closed, else its vertices.
    #[default]
    Either,
    /// The signed distance: exact, for closed meshes only.
    Field,
    /// The vertices with their normals: averages noise and closes holes.
    Points,
}

/// A mesh as a target; [`MeshTarget::target`] borrows it.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // one per program
pub enum MeshTarget {
    /// The signed distance of a closed mesh.
    Field(MeshSdf),
    /// The vertices of a mesh, with their normals.
    Points(OrientedPoints),
}

/// A mesh cannot be a target.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshTargetError {
    /// The mesh has no signed distance.
    #[error(
        "the mesh has no signed distance; close it, or fit its vertices as points, which fills holes"
    )]
    Field(#[source] SdfError),
    /// The mesh is wound inwards or inconsistently, so neither field nor normals have a sign.
    #[error(
        "the mesh has no outside; turn its triangles so that all are counter-clockwise seen from outside"
    )]
    Sides(#[source] SdfError),
    /// A point cloud, or an empty file.
    #[error(
        "the mesh has no triangles, and normals come from them: those in the file are not read; make a surface of its points first"
    )]
    NoTriangles,
    /// The vertices cannot be fitted.
    #[error("the vertices of the mesh cannot be fitted")]
    Points(#[from] TargetError),
}

impl MeshTarget {
    /// The target of a mesh in metres. Points exclude vertices without a normal (without triangles, or
    /// of degenerate ones only).
    ///
    /// # Errors
    ///
    /// [`MeshTargetError`], with advice.
    pub fn new(mesh: &TriMesh, take: Take) -> Result<Self, MeshTargetError> {
        if mesh.triangles().is_empty() {
            return Err(MeshTargetError::NoTriangles);
        }
        if take != Take::Points {
            match MeshSdf::sewn(mesh) {
                Ok(field) => return Ok(Self::Field(field)),
                Err(
                    e @ (SdfError::InsideOut { .. }
                    | SdfError::PartInsideOut { .. }
                    | SdfError::Winding { .. }),
                ) => {
                    return Err(MeshTargetError::Sides(e));
                }
                Err(e) if take == Take::Field => {
                    return Err(MeshTargetError::Field(e));
                }
                Err(_) => {}
            }
        }
        let normals = mesh.vertex_normals();
        let oriented = mesh.vertices().iter().zip(normals).filter(|(_, n)| *n != Vector::zeros());
        let (points, normals): (Vec<Point>, Vec<Vector>) = oriented.unzip();
        Ok(Self::Points(OrientedPoints::new(points, normals)?))
    }

    /// The target for a fit.
    pub fn target(&self) -> Target<'_> {
        match self {
            Self::Field(field) => Target::Field(field),
            Self::Points(cloud) => Target::Points(cloud),
        }
    }

    /// Its bounding box.
    pub fn aabb(&self) -> Aabb {
        match self {
            Self::Field(field) => field.surface().aabb(),
            Self::Points(cloud) => cloud.aabb(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::monitor::Silent;
    use if_core::shapes::meshes;
    use if_neural::field::NeuralField;
    use if_neural::fit::{Fit, FitParams};
    use if_neural::network::NetworkConfig;
    use if_neural::sampling::SamplingParams;

    fn with(triangles: Vec<[u32; 3]>) -> TriMesh {
        TriMesh::new(meshes::icosphere(0.5, 4).vertices().to_vec(), triangles).unwrap()
    }

    #[test]
    fn closed_meshes_use_their_field_and_open_ones_their_vertices() {
        let ball = meshes::icosphere(0.5, 4);
        assert!(matches!(MeshTarget::new(&ball, Take::Either), Ok(MeshTarget::Field(_))));
        assert!(matches!(MeshTarget::new(&ball, Take::Points), Ok(MeshTarget::Points(_))));
        // As exporters write it, each triangle with vertices of its own.
        let corners = ball.triangles().as_flattened().iter();
        let corners: Vec<Point> = corners.map(|v| ball.vertices()[*v as usize]).collect();
        let own =
            (0..ball.triangles().len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let soup = TriMesh::new(corners, own).unwrap();
        assert!(matches!(MeshTarget::new(&soup, Take::Either), Ok(MeshTarget::Field(_))));
        let open = with(ball.triangles()[20..].to_vec());
        assert!(matches!(MeshTarget::new(&open, Take::Either), Ok(MeshTarget::Points(_))));
        assert!(matches!(
            MeshTarget::new(&open, Take::Field),
            Err(MeshTargetError::Field(SdfError::NotClosed { .. }))
        ));
        let turned = with(ball.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect());
        assert!(matches!(
            MeshTarget::new(&turned, Take::Either),
            Err(MeshTargetError::Sides(SdfError::InsideOut { .. }))
        ));
        assert!(matches!(
            MeshTarget::new(&turned, Take::Points),
            Err(MeshTargetError::Points(TargetError::InwardNormals { .. }))
        ));
        for take in [Take::Either, Take::Field, Take::Points] {
            let cloud = MeshTarget::new(&with(Vec::new()), take).unwrap_err();
            assert_eq!(cloud, MeshTargetError::NoTriangles);
        }
    }

    /// A ball with a hole and noise comes out rounder than it went in, and closed.
    #[test]
    fn an_open_noisy_ball_is_fitted_closed_and_no_farther_off_than_its_points() {
        use if_core::field::SignedDistance;
        let ball = meshes::icosphere(0.5, 4);
        let noise = |i: usize| 0.004 * (i as f64 * 12.9898).sin();
        let vertices: Vec<Point> = ball
            .vertices()
            .iter()
            .enumerate()
            .map(|(i, p)| p + p.coords * (2.0 * noise(i)))
            .collect();
        let hole: Vec<[u32; 3]> = ball
            .triangles()
            .iter()
            .filter(|t| t.iter().any(|v| vertices[*v as usize].y < 0.45))
            .copied()
            .collect();
        let mesh = TriMesh::new(vertices.clone(), hole).unwrap();
        let taken = MeshTarget::new(&mesh, Take::Either).unwrap();
        let mut config = NetworkConfig::grid();
        if let NetworkConfig::Grid(grid) = &mut config {
            (grid.finest, grid.levels) = (32, 2);
        }
        let sampling = SamplingParams { near: 20_000, far: 2000, ..SamplingParams::default() };
        let (set, mut network) = taken.target().begin(&config, &sampling).unwrap();
        let params = FitParams {
            steps: Some(60),
            seconds: None,
            batch: 2048,
            loss: taken.target().loss(),
            ..config.fit_params()
        };
        Fit::new(params).unwrap().run(&mut network, &set, &mut Silent).unwrap();
        let field = NeuralField::new(network, set.frame).unwrap();
        let mean = |points: &[Point], f: &dyn Fn(&Point) -> f64| {
            points.iter().map(f).sum::<f64>() / points.len() as f64
        };
        let raw = mean(&vertices, &|p| (p.coords.norm() - 0.5).abs());
        let on: Vec<Point> = ball.vertices().iter().copied().filter(|p| p.y < 0.4).collect();
        let fitted = mean(&on, &|p| field.distance(p).abs());
        // Noise of 2.5 mm on points 35 mm apart: the fit adds no error to the scan's.
        assert!(fitted < raw, "{fitted} {raw}");
        // The cap over the hole bulges to the plane of its rim at least, and not far beyond the
        // ball.
        assert!(
            field.distance(&Point::new(0.0, 0.42, 0.0)) < 0.0
                && field.distance(&Point::new(0.0, 0.58, 0.0)) > 0.0
        );
    }
}
