//! Taubin smoothing: it removes noise and keeps the size.

use if_core::edges::Edges;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;
use if_core::rows::Rows;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Parameters of [`taubin`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TaubinParams {
    /// Rounds, each of a step that shrinks and a step that grows.
    pub rounds: usize,
    /// Part of the way to the middle of the neighbours, from 0 to 1.
    pub lambda: Real,
    /// Part of the way back: below −λ. 1/λ + 1/μ is the share of the highest frequency that passes
    /// unchanged.
    pub mu: Real,
    /// Treatment of borders.
    pub border: Border,
}

/// Treatment of borders.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Border {
    /// Borders stay.
    Fixed,
    /// Borders are smoothed as curves: each vertex by its neighbours on the border.
    Curve,
}

impl Default for TaubinParams {
    /// Ten rounds of λ = 0.5 and μ = −0.53: waves of ten edges and more stay, and borders are
    /// smoothed as curves.
    fn default() -> Self {
        Self { rounds: 10, lambda: 0.5, mu: -0.53, border: Border::Curve }
    }
}

impl TaubinParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let (lambda, mu) = (self.lambda, self.mu);
        ParameterError::check("lambda", lambda, (0.0..=1.0).contains(&lambda), "from 0 to 1")?;
        let range = "from −1.1 to 0, a little below −lambda";
        ParameterError::check("mu", mu, (-1.1..=0.0).contains(&mu), range)
    }
}

/// Smooths positions by alternating steps towards and away from the middle of the neighbours, which
/// remove noise and keep the size: a plain Laplacian shrinks a ball by 1 % a round, this by less
/// than 0.01 %.
///
/// ```text
/// p ← p + λ (mean of neighbours − p)      p ← p + μ (mean of neighbours − p)
/// ```
///
/// Vertices at edges of three or more triangles, and where borders meet, stay. A mesh whose
/// coordinates are so large that their differences overflow is returned as it is.
///
/// # Source
///
/// Taubin 1995, *A signal processing approach to fair surface design*.
///
/// # Errors
///
/// λ or μ out of range.
pub fn taubin(mesh: &TriMesh, params: &TaubinParams) -> Result<TriMesh, ParameterError> {
    params.validate()?;
    let neighbours = neighbours(mesh, params.border);
    let mut points = mesh.vertices().to_vec();
    for _ in 0..params.rounds {
        for factor in [params.lambda, params.mu] {
            points = (0..points.len())
                .into_par_iter()
                .map(|v| {
                    let round = neighbours.of(v);
                    if round.is_empty() {
                        return points[v];
                    }
                    let sum: Vector = round.iter().map(|w| points[*w as usize] - points[v]).sum();
                    points[v] + sum * (factor / round.len() as Real)
                })
                .collect();
        }
    }
    // A step stays near the neighbours' box unless numbers overflow.
    Ok(mesh.with_vertices(points).unwrap_or_else(|_| mesh.clone()))
}

/// For each vertex the neighbours that it is averaged with; empty if it stays.
fn neighbours(mesh: &TriMesh, border: Border) -> Rows<u32> {
    let edges = Edges::new(mesh);
    let n = mesh.vertices().len();
    let mut rims = vec![0u32; n];
    let mut stays = vec![false; n];
    for (e, ends) in edges.vertices.iter().enumerate() {
        for v in ends.map(|v| v as usize) {
            rims[v] += u32::from(edges.valence[e] == 1);
            stays[v] |= edges.valence[e] > 2;
        }
    }
    for v in 0..n {
        stays[v] |= rims[v] > 0 && (border == Border::Fixed || rims[v] != 2);
    }
    // A border vertex follows its border only.
    let follows =
        |e: usize, v: u32| !stays[v as usize] && (rims[v as usize] == 0 || edges.valence[e] == 1);
    let mut pairs: Vec<(u32, u32)> = Vec::with_capacity(2 * edges.len());
    for (e, &[a, b]) in edges.vertices.iter().enumerate() {
        pairs.extend([(a, b), (b, a)].into_iter().filter(|p| follows(e, p.0)));
    }
    pairs.sort_unstable();
    Rows::new(n, pairs.iter().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Point;
    use if_core::shapes::meshes;

    /// A ball with noise of 1 % along its normals.
    fn rough() -> TriMesh {
        let ball = meshes::icosphere(1.0, 4);
        let mut random = crate::measure::SplitMix64(3);
        let noisy = ball
            .vertices()
            .iter()
            .map(|p| p * (1.0 + 0.01 * (2.0 * random.unit() - 1.0)))
            .collect();
        ball.with_vertices(noisy).unwrap()
    }

    fn roughness(mesh: &TriMesh) -> Real {
        let squares = mesh.vertices().iter().map(|p| (p.coords.norm() - 1.0).powi(2)).sum::<Real>();
        (squares / mesh.vertices().len() as Real).sqrt()
    }

    #[test]
    fn noise_goes_and_the_size_stays() {
        let before = rough();
        let after = taubin(&before, &TaubinParams::default()).unwrap();
        assert!(
            roughness(&after) < 0.5 * roughness(&before),
            "{} {}",
            roughness(&before),
            roughness(&after)
        );
        approx::assert_relative_eq!(
            after.signed_volume(),
            before.signed_volume(),
            max_relative = 5e-3
        );
        let shrunk = taubin(&before, &TaubinParams { mu: 0.0, ..TaubinParams::default() }).unwrap();
        assert!(shrunk.signed_volume() < 0.98 * before.signed_volume());
    }

    #[test]
    fn borders_stay_or_are_smoothed_as_curves() {
        let sheet = meshes::cloth(1.0, 1.0, 8, 8);
        let edges = Edges::new(&sheet);
        let rim = edges.boundary_vertices(sheet.vertices().len());
        let bumpy: Vec<Point> = sheet
            .vertices()
            .iter()
            .enumerate()
            .map(|(v, p)| p + Vector::z() * if v % 2 == 0 { 0.02 } else { -0.02 })
            .collect();
        let bumpy = sheet.with_vertices(bumpy).unwrap();
        let fixed =
            taubin(&bumpy, &TaubinParams { border: Border::Fixed, ..TaubinParams::default() })
                .unwrap();
        let curved = taubin(&bumpy, &TaubinParams::default()).unwrap();
        for v in (0..rim.len()).filter(|v| rim[*v]) {
            assert_eq!(fixed.vertices()[v], bumpy.vertices()[v]);
        }
        let height =
            |mesh: &TriMesh| mesh.vertices().iter().map(|p| p.z.abs()).fold(0.0, Real::max);
        assert!(
            height(&curved) < 0.3 * height(&bumpy) && height(&fixed) == height(&bumpy),
            "{}",
            height(&curved)
        );
    }

    #[test]
    fn degenerate_meshes_pass() {
        let point = TriMesh::new(vec![Point::origin(); 3], vec![[0, 1, 2]]).unwrap();
        let huge = TriMesh::new(
            vec![Point::origin(), Point::new(1e308, 0.0, 0.0), Point::new(-1e308, 1.0, 0.0)],
            vec![[0, 1, 2]],
        );
        for mesh in [TriMesh::default(), point, huge.unwrap()] {
            assert_eq!(
                taubin(&mesh, &TaubinParams::default()).unwrap().triangles(),
                mesh.triangles()
            );
        }
    }

    #[test]
    fn numbers_that_smooth_nothing_are_refused() {
        let ball = meshes::icosphere(1.0, 1);
        for bad in [Real::NAN, -0.1, 9.0, Real::INFINITY] {
            let error = taubin(&ball, &TaubinParams { lambda: bad, ..TaubinParams::default() })
                .unwrap_err();
            assert_eq!(error.name, "lambda", "{bad}");
        }
        for bad in [Real::NAN, 0.1, -1.2, Real::NEG_INFINITY] {
            let error =
                taubin(&ball, &TaubinParams { mu: bad, ..TaubinParams::default() }).unwrap_err();
            assert_eq!(error.name, "mu", "{bad}");
        }
    }
}
