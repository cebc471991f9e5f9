//! One step of the surface towards the evidence: a linear least-squares problem.

use super::evidence::Evidence;
use super::fair;
use super::params::SurfaceParams;
use super::report::Round;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_sparse::{Cholesky, Entry, Mat};

/// Weight of observed normals at which a triangle counts as known: three pixels seen head-on.
const KNOWN: Real = 3.0;
/// Weight with which an unseen triangle keeps its normal, relative to a known one.
const UNSEEN: Real = 0.02;
/// Weight of silhouettes at which the position of a vertex counts as known: on the rim in three
/// frames.
const ON_RIM: Real = 3.0;
/// Weight of not moving, which makes the system regular where there is no evidence. A hundred times
/// more slows convergence, a hundred times less lets unseen regions drift.
pub(super) const STAY: Real = 1e-4;
/// Smoothing rounds of the directions along which vertices move, so that neighbours do not collide.
const DIRECTION_ROUNDS: usize = 3;

/// Moves each vertex along its smoothed normal by the s that minimises
///
/// ```text
/// a Σ wₜ (Nₜ · (xᵢ − xⱼ + d (sᵢ − sⱼ)))²    over the edges ij of each triangle t with the observed normal Nₜ
/// + b Σ wᵥ (sᵥ − δᵥ)²           δᵥ the mean offset of a rim vertex from the masks' borders
/// + c Σ (s − mean of its neighbours' s)² + 1e-4 Σ s²
/// ```
///
/// with weights w of at most 1 and the mean d of the directions at both ends, by sparse Cholesky factorisation. So a
/// normal turns an edge: with x′ᵢ − x′ⱼ instead it would shorten it, too, and noise in normals draw a curved surface inwards.
/// Then slides vertices along the surface towards the mean of their neighbours, and repairs unseen and folded regions after
/// the template `rest`. `None` if the system cannot be factorised, which finite input does not cause.
pub(super) fn step(
    rest: &TriMesh,
    mesh: &TriMesh,
    edges: &Edges,
    evidence: &Evidence,
    params: &SurfaceParams,
) -> Option<(Vec<Point>, Round)> {
    let (moved, neighbours, round) = solved(mesh, edges, evidence, &Weights::of(params))?;
    let moved = slid(mesh, moved, &neighbours, params.slide);
    Some((fair::repair(rest, moved, &neighbours, evidence), round))
}

/// Weights of the terms of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights {
    pub(super) normals: Real,
    pub(super) silhouettes: Real,
    pub(super) bending: Real,
    /// Largest step of a vertex, in metres.
    pub(super) longest_step: Real,
}

impl Weights {
    fn of(params: &SurfaceParams) -> Self {
        let SurfaceParams { normals, silhouettes, bending, longest_step, .. } = *params;
        Self { normals, silhouettes, bending, longest_step }
    }
}

/// The solution of the least-squares problem, and the neighbours of each vertex.
fn solved(
    mesh: &TriMesh,
    edges: &Edges,
    evidence: &Evidence,
    params: &Weights,
) -> Option<(Vec<Point>, Rows<u32>, Round)> {
    let x = mesh.vertices();
    let n = x.len();
    let neighbours = edges.neighbours(n);
    let directions = directions(mesh, &neighbours);
    let seen = observed(mesh, &directions, edges, evidence, params);
    let mut right = Mat::from_fn(n, 1, |v, _| seen.right[v]);
    let mut entries = seen.entries(edges, STAY);
    add_bending(&mut entries, &neighbours, params.bending);
    Cholesky::new(n, &entries).ok()?.solve_in_place(&mut right);

    let longest = params.longest_step;
    let steps: Vec<Real> = (0..n).map(|v| right[(v, 0)].clamp(-longest, longest)).collect();
    let mut round = seen.round;
    round.step_mm = (steps.iter().map(|s| s * s).sum::<Real>() / n.max(1) as Real).sqrt() * 1e3;
    let moved: Vec<Point> = (0..n).map(|v| x[v] + directions[v] * steps[v]).collect();
    if !moved.iter().flat_map(|p| p.iter()).all(|c| c.is_finite()) {
        return None;
    }
    Some((moved, neighbours, round))
}

/// The terms of the evidence: quadratic in the steps s of the vertices along their directions, with
/// entries for vertices and for edges alone.
pub(super) struct Observed {
    /// For each vertex.
    pub(super) diagonal: Vec<Real>,
    /// For each edge.
    pub(super) across: Vec<Real>,
    /// For each vertex the right side.
    pub(super) right: Vec<Real>,
    /// Counts and residuals.
    pub(super) round: Round,
}

impl Observed {
    /// The entries of the matrix's lower triangle, with `stay` added on the diagonal.
    pub(super) fn entries(&self, edges: &Edges, stay: Real) -> Vec<Entry> {
        let mut entries: Vec<Entry> = Vec::with_capacity(60 * self.diagonal.len());
        let diagonal = self.diagonal.iter().enumerate();
        entries.extend(diagonal.map(|(v, w)| Entry::new(v, v, w + stay)));
        let across = edges.vertices.iter().zip(&self.across);
        entries.extend(across.map(|([a, b], w)| Entry::new(*b as usize, *a as usize, *w)));
        entries
    }
}

/// The terms of normals and silhouettes for a `mesh` whose vertices move along `directions`.
pub(super) fn observed(
    mesh: &TriMesh,
    directions: &[Vector],
    edges: &Edges,
    evidence: &Evidence,
    params: &Weights,
) -> Observed {
    let x = mesh.vertices();
    let n = x.len();
    let (mut diagonal, mut right) = (vec![0.0; n], vec![0.0; n]);
    let mut across = vec![0.0; edges.vertices.len()];
    let mut round = Round::default();

    let areas: Vec<Real> = (0..mesh.triangles().len())
        .map(|t| {
            let [a, b, c] = mesh.corners(t);
            if_core::math::area_vector(a, b, c).norm()
        })
        .collect();
    let mean_area = areas.iter().sum::<Real>() / areas.len().max(1) as Real;
    let faces = mesh.face_normals();
    let (mut angle, mut seen_area) = (0.0, 0.0);
    for (t, tri) in mesh.triangles().iter().enumerate() {
        let (sum, weight) = evidence.normals[t];
        let mut target = unit_or_zero(&sum);
        let mut confidence = (weight / KNOWN).min(1.0);
        if target == Vector::zeros() || confidence < UNSEEN {
            (target, confidence) = (faces[t], UNSEEN);
        } else {
            round.seen_triangles += 1;
            angle += areas[t] * target.dot(&faces[t]).clamp(-1.0, 1.0).acos();
            seen_area += areas[t];
        }
        if mean_area == 0.0 {
            continue;
        }
        let w = params.normals * confidence * areas[t] / mean_area;
        for k in 0..3 {
            let (i, j) = (tri[k] as usize, tri[(k + 1) % 3] as usize);
            let (at_i, at_j) = (target.dot(&directions[i]), target.dot(&directions[j]));
            let (at_i, at_j) = (-0.5 * (at_i + at_j), 0.5 * (at_i + at_j));
            let gap = -target.dot(&(x[j] - x[i]));
            diagonal[i] += w * at_i * at_i;
            diagonal[j] += w * at_j * at_j;
            across[edges.of_triangle[t][k] as usize] += w * at_i * at_j;
            right[i] += w * at_i * gap;
            right[j] += w * at_j * gap;
        }
    }
    round.normal_degrees = if seen_area > 0.0 { (angle / seen_area).to_degrees() } else { 0.0 };

    let (mut squares, mut rim_weight) = (0.0, 0.0);
    for v in 0..n {
        let (way, weight) = evidence.rim[v];
        if weight > 0.0 {
            let delta = way / weight;
            let w = params.silhouettes * (weight / ON_RIM).min(1.0);
            diagonal[v] += w;
            right[v] += w * delta;
            squares += weight * delta * delta;
            rim_weight += weight;
            round.rim_vertices += 1;
        }
    }
    round.silhouette_mm = if rim_weight > 0.0 { (squares / rim_weight).sqrt() * 1e3 } else { 0.0 };
    Observed { diagonal, across, right, round }
}

/// Adds the bending term: `weight` · Σ (s − mean of its neighbours' s)².
pub(super) fn add_bending(entries: &mut Vec<Entry>, neighbours: &Rows<u32>, weight: Real) {
    for v in 0..neighbours.len() {
        if neighbours.of(v).is_empty() {
            continue;
        }
        let share = -1.0 / neighbours.of(v).len() as Real;
        let row: Vec<(usize, Real)> = std::iter::once((v, 1.0))
            .chain(neighbours.of(v).iter().map(|u| (*u as usize, share)))
            .collect();
        for &(i, a) in &row {
            let lower = row.iter().filter(|(j, _)| *j <= i);
            entries.extend(lower.map(|&(j, b)| Entry::new(i, j, weight * a * b)));
        }
    }
}

/// The directions along which vertices move: normals, smoothed.
pub(super) fn directions(mesh: &TriMesh, neighbours: &Rows<u32>) -> Vec<Vector> {
    smoothed(&mesh.vertex_normals(), neighbours)
}

fn smoothed(normals: &[Vector], neighbours: &Rows<u32>) -> Vec<Vector> {
    let mut out = normals.to_vec();
    for _ in 0..DIRECTION_ROUNDS {
        out = (0..out.len())
            .map(|v| {
                let mean =
                    neighbours.of(v).iter().fold(Vector::zeros(), |sum, u| sum + out[*u as usize]);
                unit_or_zero(&(out[v] + mean / neighbours.of(v).len().max(1) as Real))
            })
            .collect();
    }
    out
}

/// Tangential smoothing: vertices move by `share` of the offset to the mean of their neighbours,
/// projected onto the surface.
fn slid(mesh: &TriMesh, moved: Vec<Point>, neighbours: &Rows<u32>, share: Real) -> Vec<Point> {
    let Ok(mesh) = mesh.with_vertices(moved) else { return mesh.vertices().to_vec() };
    let x = mesh.vertices();
    let slide = |(v, n): (usize, &Vector)| {
        if neighbours.of(v).is_empty() {
            return x[v];
        }
        let sum =
            neighbours.of(v).iter().fold(Vector::zeros(), |sum, u| sum + x[*u as usize].coords);
        let way = sum / neighbours.of(v).len() as Real - x[v].coords;
        x[v] + (way - n * n.dot(&way)) * share
    };
    mesh.vertex_normals().iter().enumerate().map(slide).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    fn usual() -> Weights {
        Weights::of(&SurfaceParams::default())
    }

    fn nothing(mesh: &TriMesh) -> Evidence {
        Evidence {
            normals: vec![(Vector::zeros(), 0.0); mesh.triangles().len()],
            rim: vec![(0.0, 0.0); mesh.vertices().len()],
            pixels: Default::default(),
            overlap: Vec::new(),
            axes: Default::default(),
        }
    }

    #[test]
    fn without_evidence_the_surface_stays() {
        let ball = meshes::icosphere(0.3, 3);
        let (moved, _, round) =
            solved(&ball, &Edges::new(&ball), &nothing(&ball), &usual()).unwrap();
        for (p, q) in moved.iter().zip(ball.vertices()) {
            approx::assert_relative_eq!(p, q, epsilon = 1e-12);
        }
        assert_eq!((round.rim_vertices, round.seen_triangles), (0, 0));
    }

    #[test]
    fn silhouettes_move_the_surface_and_normals_carry_their_shape() {
        // A ball, of which a rim is seen 2 cm farther out everywhere, and normals of the ball
        // itself: it grows as a ball.
        let ball = meshes::icosphere(0.3, 3);
        let mut evidence = nothing(&ball);
        for (v, p) in ball.vertices().iter().enumerate() {
            if p.z.abs() < 0.05 {
                evidence.rim[v] = (0.02 * 3.0, 3.0);
            }
        }
        for (t, n) in ball.face_normals().iter().enumerate() {
            evidence.normals[t] = (n * 3.0, 3.0);
        }
        let mut mesh = ball.clone();
        let edges = Edges::new(&ball);
        for k in 0..4 {
            let (moved, round) =
                step(&ball, &mesh, &edges, &evidence, &SurfaceParams::default()).unwrap();
            mesh = mesh.with_vertices(moved).unwrap();
            if k == 0 {
                assert!((round.silhouette_mm - 20.0).abs() < 1e-9);
                evidence.rim.iter_mut().filter(|r| r.1 > 0.0).for_each(|r| r.0 = 0.0);
            }
        }
        for p in mesh.vertices() {
            // The poles are carried outwards by the normals alone.
            assert!((p.coords.norm() - 0.32).abs() < 0.006, "{p}: {}", p.coords.norm());
        }
    }

    #[test]
    fn noise_in_normals_moves_nothing_as_a_whole() {
        let ball = meshes::icosphere(0.3, 3);
        let edges = Edges::new(&ball);
        let mut evidence = nothing(&ball);
        for (t, n) in ball.face_normals().iter().enumerate() {
            // Some ten degrees, in all directions.
            let noise = |k: usize| ((t * 37 + k * 61) % 101) as Real / 101.0 - 0.5;
            let noise = Vector::new(noise(0), noise(1), noise(2)) * 0.4;
            evidence.normals[t] = (unit_or_zero(&(n + noise)) * 3.0, 3.0);
        }
        let (moved, ..) = solved(&ball, &edges, &evidence, &usual()).unwrap();
        let radius = moved.iter().map(|p| p.coords.norm()).sum::<Real>() / moved.len() as Real;
        // By normals that shorten edges, too, 0.298.
        assert!((radius - 0.3).abs() < 2e-4, "{radius}");
    }

    #[test]
    fn the_gradient_of_the_energy_vanishes_at_the_step() {
        // The energy, written out term by term.
        let mesh = meshes::icosphere(0.2, 2);
        let edges = Edges::new(&mesh);
        let mut evidence = nothing(&mesh);
        for (t, n) in mesh.face_normals().iter().enumerate() {
            let w = 1.0 + (t % 5) as Real;
            evidence.normals[t] =
                (unit_or_zero(&(n + Vector::new(0.1, -0.05 * (t % 3) as Real, 0.02))) * w, w);
        }
        for v in (0..mesh.vertices().len()).step_by(4) {
            evidence.rim[v] = (0.001 * (v % 7) as Real, 0.5 + (v % 4) as Real);
        }
        let (moved, neighbours, _) = solved(&mesh, &edges, &evidence, &usual()).unwrap();
        let directions = smoothed(&mesh.vertex_normals(), &neighbours);
        let s: Vec<Real> =
            (0..moved.len()).map(|v| (moved[v] - mesh.vertices()[v]).dot(&directions[v])).collect();
        let area = |t: usize| {
            let [a, b, c] = mesh.corners(t);
            0.5 * if_core::math::area_vector(a, b, c).norm()
        };
        let mean_area = mesh.area() / mesh.triangles().len() as Real;
        let energy = |s: &[Real]| {
            let at = |v: u32| mesh.vertices()[v as usize];
            let way = |i: u32, j: u32| {
                let [i, j] = [i, j].map(|v| v as usize);
                (directions[i] + directions[j]) * (0.5 * (s[j] - s[i]))
            };
            let mut sum = 0.0;
            for (t, tri) in mesh.triangles().iter().enumerate() {
                let (n, w) =
                    (unit_or_zero(&evidence.normals[t].0), (evidence.normals[t].1 / 3.0).min(1.0));
                for k in 0..3 {
                    let (i, j) = (tri[k], tri[(k + 1) % 3]);
                    sum += w * area(t) / mean_area * n.dot(&(at(j) - at(i) + way(i, j))).powi(2);
                }
            }
            for v in 0..s.len() {
                let (way, w) = evidence.rim[v];
                if w > 0.0 {
                    sum += (w / 3.0).min(1.0) * (s[v] - way / w).powi(2);
                }
                let mean: Real = neighbours.of(v).iter().map(|u| s[*u as usize]).sum::<Real>()
                    / neighbours.of(v).len() as Real;
                sum += 0.5 * (s[v] - mean).powi(2) + STAY * s[v] * s[v];
            }
            sum
        };
        let h = 1e-5;
        for v in (0..s.len()).step_by(9) {
            let (mut up, mut down) = (s.clone(), s.clone());
            up[v] += h;
            down[v] -= h;
            let slope = (energy(&up) - energy(&down)) / (2.0 * h);
            // Against the slope at rest, which is of the order of 1e-2.
            assert!(slope.abs() < 1e-8, "vertex {v}: {slope}");
        }
    }
}
