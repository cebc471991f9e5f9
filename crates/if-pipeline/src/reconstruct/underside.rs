//! What nobody saw of loose clothes: their underside.

use super::canonical::carried_to;
use super::surface::Surface;
use crate::capture::Capture;
use if_body::TemplateBody;
use if_core::edges::parts;
use if_core::math::{Real, area_vector};
use if_core::mesh::TriMesh;
use if_mesh::smooth_labels::LabelScores;
use if_mesh::votes::LabelVotes;

/// Distance from the template from which on a place is spanned by clothes, in metres: as far as
/// weights go over to those of space.
const SPANNED: Real = 0.03;
/// Fewer votes than this, and a vertex was not seen: one frame that sees it well.
const UNSEEN: Real = 1.0;
/// Area of a patch that nobody saw, in square metres, below which it is a fold of the clothes: a
/// square of 12 cm. The undersides of a dress and a skirt have 0.03 to 0.1.
const LEAST: Real = 0.015;
/// Votes against the garment of a place that was not seen: one frame.
const VOTE: Real = 1.0;

/// Places between a skirt's hem and the legs close the surface, but are no cloth: what no frame
/// sees of what loose clothes span does not belong to them.
#[derive(Clone, Debug, PartialEq)]
pub struct Underside {
    /// For each vertex of the canonical mesh whether it lies where clothes span what the template
    /// has apart.
    pub spanned: Vec<bool>,
    /// For each label of the capture whether it is that of a loose garment.
    pub loose: Vec<bool>,
}

impl Underside {
    /// Of a surface that was fitted in loose clothes, on its canonical `mesh`; `None` where it
    /// started from the template.
    pub fn of(
        surface: &Surface,
        template: &TemplateBody,
        capture: &Capture,
        mesh: &TriMesh,
    ) -> Option<Self> {
        let filled = surface.report.start.filled.as_ref()?;
        let near = carried_to(&template.mesh, &template.skin, mesh.vertices());
        Some(Self {
            spanned: near.iter().map(|(distance, _)| *distance > SPANNED).collect(),
            loose: capture.labels().iter().map(|name| filled.garments.contains(name)).collect(),
        })
    }

    /// Votes once more, with one vote for the best label that is not loose at each place of a
    /// spanned patch that nobody saw; `scores` are the smooth ones of `votes`.
    pub(super) fn voted(
        &self,
        mesh: &TriMesh,
        votes: &LabelVotes,
        scores: &LabelScores,
    ) -> LabelVotes {
        let mut out = votes.clone();
        let row = |v: usize| v * votes.labels..(v + 1) * votes.labels;
        let unseen =
            |v: usize| self.spanned[v] && votes.weights[row(v)].iter().sum::<Real>() < UNSEEN;
        for v in patches(mesh, unseen) {
            // Label 0 is what nothing is known about.
            let other = (1..votes.labels).filter(|l| !self.loose[*l]);
            if let Some(best) =
                other.max_by(|a, b| scores.of(v)[*a].total_cmp(&scores.of(v)[*b]).then(b.cmp(a)))
            {
                out.weights[row(v).start + best] += VOTE;
            }
        }
        out
    }
}

/// The vertices of which `wanted` is true, in patches of at least the least area; in ascending
/// order.
fn patches(mesh: &TriMesh, wanted: impl Fn(usize) -> bool) -> Vec<usize> {
    let n = mesh.vertices().len();
    let inside: Vec<bool> = (0..n).map(wanted).collect();
    let whole = mesh
        .triangles()
        .iter()
        .filter(|t| t.iter().all(|v| inside[*v as usize]))
        .copied()
        .collect();
    let kept =
        TriMesh::new(mesh.vertices().to_vec(), whole).expect("some triangles of a mesh are a mesh");
    let part = parts(&kept);
    let mut areas = vec![0.0; n];
    for t in 0..kept.triangles().len() {
        let [a, b, c] = kept.corners(t);
        areas[part[kept.triangles()[t][0] as usize] as usize] += 0.5 * area_vector(a, b, c).norm();
    }
    (0..n).filter(|v| inside[*v] && areas[part[*v] as usize] >= LEAST).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::shapes::meshes;

    #[test]
    fn only_a_large_patch_that_is_spanned_and_unseen_is_taken_from_loose_garments() {
        // A square metre of 11 × 11 vertices: two unseen strips are spanned, one of them only two
        // triangles wide.
        let sheet = meshes::cloth(1.0, 0.2, 10, 2);
        let n = sheet.vertices().len();
        let low = sheet.aabb().min;
        let axis = (0..3)
            .max_by(|a, b| sheet.aabb().size()[*a].total_cmp(&sheet.aabb().size()[*b]))
            .unwrap();
        let along: Vec<Real> = sheet.vertices().iter().map(|p| p[axis] - low[axis]).collect();
        let unseen = |v: usize| along[v] < 0.25 || along[v] > 0.95;
        let underside =
            Underside { spanned: vec![true; n], loose: vec![false, false, true, false] };
        let votes = LabelVotes {
            labels: 4,
            weights: (0..n)
                .flat_map(|v| if unseen(v) { [0.0, 0.0, 0.2, 0.0] } else { [0.0, 0.0, 5.0, 0.0] })
                .collect(),
        };
        let scores = LabelScores { labels: 4, scores: [0.0, 0.1, 0.7, 0.2].repeat(n) };
        let out = underside.voted(&sheet, &votes, &scores);
        for v in 0..n {
            // The best other one is 3. The last column alone has no area.
            assert_eq!(
                out.weights[4 * v + 3],
                if along[v] < 0.25 { 1.0 } else { 0.0 },
                "{}",
                along[v]
            );
        }
        let seen = Underside { spanned: vec![false; n], ..underside };
        assert_eq!(seen.voted(&sheet, &votes, &scores), votes);
    }
}
