//! Lids of garments: what closes a wide sleeve about the wrist, and is not cloth.

use super::refine::directions;
use crate::capture::{FIRST_GARMENT, SKIN};
use if_core::edges::Edges;
use if_core::geodesic::Neighbours;
use if_core::math::{Real, Vector};
use if_core::mesh::TriMesh;
use if_mesh::labels::{LabelScores, LabelVotes};

/// Distance from the boundary up to which a lid may reach, in metres.
const REACH: Real = 0.06;
/// Distance from the boundary beyond which the surface counts as cloth, in metres.
const CLOTH: Real = 0.045;
/// Boundary over which the cloth beside it is averaged to both sides, in metres.
const BESIDE: Real = 0.015;
/// Least number of vertices of that cloth, and least length of their mean normal: cloth that bends
/// less.
const LEAST: (usize, Real) = (3, 0.7);
/// Angle in degrees to the cloth's normal from which a vertex is part of a lid.
const TURNED: Real = 45.0;
/// The same for the boundary that the lid ends at.
const TURNED_AT_BOUNDARY: Real = 50.0;
/// Least depth of that boundary below the cloth's tangent plane, in metres. Less is a rim, which
/// [`hems`](super::hems) lays straight.
const DEEP: Real = 0.008;
/// Least votes for skin at a vertex of a lid: one frame.
const VOTE: Real = 3.0;

/// The votes, with those for the garment at each vertex of its lids given to skin, which is no
/// garment; `scores` are the smoothed ones of `votes`. `None` if no garment has a lid.
pub(super) fn outvoted(
    mesh: &TriMesh,
    votes: &LabelVotes,
    scores: &LabelScores,
) -> Option<LabelVotes> {
    let mut out = votes.clone();
    let winners = scores.winners();
    for label in FIRST_GARMENT..=winners.iter().copied().max().unwrap_or_default() {
        let own = |t: &&[u32; 3]| t.iter().all(|v| winners[*v as usize] == label);
        let triangles = mesh.triangles().iter().filter(own).copied().collect();
        let piece = TriMesh::new(mesh.vertices().to_vec(), triangles);
        let piece = piece.expect("some triangles of a mesh are a mesh");
        for v in of_piece(&piece) {
            let row = &mut out.weights[v * votes.labels..(v + 1) * votes.labels];
            let lost = std::mem::take(&mut row[usize::from(label)]);
            row[usize::from(SKIN)] += lost.max(VOTE);
        }
    }
    (out != *votes).then_some(out)
}

/// The vertices of a piece's lids.
///
/// The canonical mesh is closed. A sleeve that is wider than the wrist ends there in a lid, which has
/// the label of the sleeve's inside, as far as that is seen. Such a piece of a garment turns in
/// sharply from the cloth some centimetres from its boundary:
///
/// ```text
/// of each vertex on the boundary  N, c ← mean normal and place of the cloth 4.5 to 6 cm inwards
/// it ends a lid                   if its normal is more than 50° off N, and it lies deeper than 8 mm below c
/// a lid                           the vertices nearest to such ends whose normals are more than 45° off N
/// ```
///
/// along edges, with smoothed normals.
fn of_piece(piece: &TriMesh) -> Vec<usize> {
    let (x, edges) = (piece.vertices(), Edges::new(piece));
    let on_boundary = edges.boundary_vertices(x.len());
    let boundary: Vec<usize> = (0..x.len()).filter(|v| on_boundary[*v]).collect();
    let normals = directions(piece, &edges.neighbours(x.len()));
    let nearest = Neighbours::new(&edges, x).nearest(boundary.iter().map(|v| *v as u32), REACH);

    // The cloth beyond each boundary vertex: count, and sums of normals and places.
    let mut cloth = vec![(0usize, Vector::zeros(), Vector::zeros()); x.len()];
    for (v, (far, source)) in nearest.iter().enumerate() {
        if *far > CLOTH && far.is_finite() {
            let sum = &mut cloth[*source as usize];
            *sum = (sum.0 + 1, sum.1 + normals[v], sum.2 + x[v].coords);
        }
    }
    // The cloth's normal at the boundary vertices that end a lid.
    let mut ends: Vec<Option<Vector>> = vec![None; x.len()];
    for &b in &boundary {
        let (mut count, mut normal, mut place) = (0, Vector::zeros(), Vector::zeros());
        for &other in boundary.iter().filter(|o| (x[**o] - x[b]).norm() <= BESIDE) {
            let (n, normals, places) = &cloth[other];
            (count, normal, place) = (count + n, normal + normals, place + places);
        }
        let length = normal.norm();
        if count < LEAST.0 || length < LEAST.1 * count as Real {
            continue;
        }
        let (normal, place) = (normal / length, place / count as Real);
        let turned = normals[b].dot(&normal) < TURNED_AT_BOUNDARY.to_radians().cos();
        if turned && (x[b].coords - place).dot(&normal) < -DEEP {
            ends[b] = Some(normal);
        }
    }
    let in_lid = |v: &usize| {
        let (far, source) = nearest[*v];
        far.is_finite()
            && ends[source as usize]
                .is_some_and(|n| normals[*v].dot(&n) < TURNED.to_radians().cos())
    };
    (0..x.len()).filter(in_lid).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    /// A surface of revolution of a profile that goes down, with outward normals.
    fn turned(profile: &[(Real, Real)]) -> TriMesh {
        meshes::revolved(&profile.iter().rev().copied().collect::<Vec<_>>(), 60)
    }

    fn steps(count: u32, of: impl Fn(Real) -> (Real, Real)) -> Vec<(Real, Real)> {
        (0..count).map(|k| of(Real::from(k))).collect()
    }

    /// A sleeve of 6 cm radius, closed about a wrist of 3 cm, which goes on for 10 cm.
    fn sleeve_and_wrist() -> TriMesh {
        let mut profile = steps(40, |k| (0.06, -0.005 * k));
        profile.extend(steps(6, |k| (0.055 - 0.005 * k, -0.195)));
        profile.extend(steps(20, |k| (0.03, -0.2 - 0.005 * k)));
        turned(&profile)
    }

    #[test]
    fn a_sleeve_loses_its_lid() {
        let mesh = sleeve_and_wrist();
        // All up to the wrist is seen as the sleeve.
        let labels: Vec<u8> =
            mesh.vertices().iter().map(|p| if p.y < -0.197 { 1 } else { FIRST_GARMENT }).collect();
        let votes = LabelVotes::from_labels(&labels, 3);
        let scores = LabelScores { labels: 3, scores: votes.weights.clone() };
        let out = outvoted(&mesh, &votes, &scores).unwrap();
        for (v, p) in mesh.vertices().iter().enumerate() {
            let (r, row) = (p.x.hypot(p.z), &out.weights[3 * v..3 * v + 3]);
            let in_lid = row == [0.0, VOTE, 0.0];
            assert!(in_lid || row == &votes.weights[3 * v..3 * v + 3], "{row:?}");
            assert!(in_lid || p.y < -0.197 || r > 0.049, "{p}");
            assert!(!in_lid || p.y < -0.19, "{p}");
        }
        assert_eq!(
            outvoted(&mesh, &out, &LabelScores { labels: 3, scores: out.weights.clone() }),
            None
        );
    }

    #[test]
    fn cloth_without_a_lid_stays() {
        let tube = turned(&steps(40, |k| (0.06, -0.005 * k)));
        // A collar that rises from shoulders turns the other way, and a cap bends less.
        let mut collar = steps(12, |k| (0.06, 0.2 - 0.005 * k));
        collar.extend(steps(20, |k| (0.06 + 0.005 * k, 0.14)));
        let cap = turned(&steps(30, |k| {
            let (sin, cos) = (0.02 + 0.05 * k).sin_cos();
            (0.1 * sin, 0.1 * cos)
        }));
        let ball = meshes::icosphere(0.1, 3);
        for mesh in [tube, turned(&collar), cap, ball] {
            assert!(of_piece(&mesh).is_empty());
        }
    }
}
