//! The undersides of loose clothes, which no frame sees.

use super::canonical::carried_to;
use super::error::ReconstructError;
use super::skipped::Skipped;
use super::surface::Surface;
use crate::capture::{Capture, SKIN};
use if_body::skinning::blends;
use if_body::{Skeleton, SkinWeights, TemplateBody};
use if_core::edges::parts;
use if_core::math::{Real, Vector, area_vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_mesh::labels::LabelVotes;
use rayon::prelude::*;

/// Distance from the template beyond which a vertex is spanned by clothes, in metres: the distance
/// over which weights blend to those of the grid.
const SPANNED: Real = 0.03;
/// Least votes for a vertex to count as seen: one frame that sees it well.
const UNSEEN: Real = 1.0;
/// The same as a share of few frames. A hand hides the side of a skirt from the frame that would see
/// it best.
const UNSEEN_SHARE: Real = 1.0 / 24.0;
/// Least area of an unseen patch, in square metres: a square of 12 cm. Smaller ones are folds; the
/// undersides of a dress and a skirt have 0.03 to 0.1.
const LEAST: Real = 0.015;
/// Least cosine between a normal and the vertical for a vertex that faces floor or ceiling.
const LYING: Real = 0.5;
/// Least votes that frames would give a vertex if nothing hid it, as a multiple of those below which it
/// counts as unseen. In a whole turn all have them that stand upright.
const LOOKED_AT: Real = 2.0;
/// Votes for skin at a vertex that is unseen, or beyond all pictures: one frame.
pub(super) const VOTE: Real = 1.0;

/// The parts of the surface between a skirt's hem and the legs close it, but are not cloth: spanned
/// vertices that frames look at, but do not see, belong to no garment, neither to the skirt nor to what is
/// worn below. The side that a person never turned to the camera is cloth all the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Underside {
    /// Whether each vertex of the canonical mesh lies where clothes span a gap of the template, and frames
    /// look at it, or it faces floor or ceiling.
    pub spanned: Vec<bool>,
    /// Votes below which a vertex counts as unseen.
    pub unseen: Real,
}

impl Underside {
    /// The undersides on the canonical `mesh` of a surface; `None` if no garment hangs loose. Frames
    /// that the surface skipped do not look at it.
    pub fn of(
        surface: &Surface,
        template: &TemplateBody,
        capture: &Capture,
        (mesh, skin): (&TriMesh, &SkinWeights),
    ) -> Result<Option<Self>, ReconstructError> {
        let Some(filled) = &surface.report.start.filled else { return Ok(None) };
        let near = carried_to(&template.mesh, &template.skin, mesh.vertices());
        let frames: Vec<usize> = Skipped::others(&surface.report.skipped, capture).collect();
        let unseen = UNSEEN.min(UNSEEN_SHARE * frames.len() as Real);
        let normals = mesh.vertex_normals();
        let looks = looks((capture, &frames), &template.skeleton, (mesh, &normals), skin)?;
        let is_looked_at = |v: usize| normals[v].y.abs() > LYING || looks[v] >= LOOKED_AT * unseen;
        let about = about(&template.skeleton, &filled.joints);
        let hangs = |v: usize| about[usize::from(strongest(skin, v))];
        let is_spanned =
            |(v, (d, _)): (usize, &(Real, _))| *d > SPANNED && hangs(v) && is_looked_at(v);
        let spanned = near.iter().enumerate().map(is_spanned);
        Ok(Some(Self { spanned: spanned.collect(), unseen }))
    }

    /// The votes, with one more for skin, which is no garment, at each vertex of an unseen spanned
    /// patch.
    pub(super) fn voted(&self, mesh: &TriMesh, mut votes: LabelVotes) -> LabelVotes {
        let unseen = |v: usize| self.spanned[v] && votes.of(v).iter().sum::<Real>() < self.unseen;
        for v in patches(mesh, unseen) {
            votes.weights[v * votes.labels + usize::from(SKIN)] += VOTE;
        }
        votes
    }
}

/// Whether clothes that hang about the joints with these `names` hang about each joint: about those and their
/// parents. The lower side of a sleeve is no underside of a coat that hangs about the legs.
fn about(skeleton: &Skeleton, names: &[String]) -> Vec<bool> {
    let joints = skeleton.joints();
    let mut about: Vec<bool> = joints.iter().map(|joint| names.contains(&joint.name)).collect();
    let parents =
        joints.iter().filter(|joint| names.contains(&joint.name)).filter_map(|j| j.parent);
    parents.for_each(|parent| about[parent] = true);
    about
}

/// The joint that moves a vertex most.
fn strongest(skin: &SkinWeights, v: usize) -> u16 {
    let (joints, weights) = (skin.joints()[v], skin.weights()[v]);
    let k = (0..4).fold(0, |best, k| if weights[k] > weights[best] { k } else { best });
    joints[k]
}

/// The votes that these frames would give each vertex if nothing hid it: squared cosines between its normal and
/// the line of sight.
fn looks(
    (capture, frames): (&Capture, &[usize]),
    skeleton: &Skeleton,
    (mesh, normals): (&TriMesh, &[Vector]),
    skin: &SkinWeights,
) -> Result<Vec<Real>, ReconstructError> {
    let x = mesh.vertices();
    let mut looks = vec![0.0; x.len()];
    let eye = capture.camera().center();
    for &frame in frames {
        let transforms = skeleton
            .transforms(capture.pose(frame))
            .map_err(|source| ReconstructError::Pose { frame, source })?;
        let maps = blends(skin, &transforms);
        looks.par_iter_mut().enumerate().for_each(|(v, looks)| {
            let sight = unit_or_zero(&(eye - maps[v].point(&x[v])));
            *looks += maps[v].normal(&normals[v]).dot(&sight).max(0.0).powi(2);
        });
    }
    Ok(looks)
}

/// The vertices for which `wanted` is true in patches of at least the least area, in ascending
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
    fn only_large_unseen_spanned_patches_are_removed_from_loose_garments() {
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
        let underside = Underside { spanned: vec![true; n], unseen: 1.0 };
        let votes = LabelVotes {
            labels: 4,
            weights: (0..n)
                .flat_map(|v| if unseen(v) { [0.0, 0.0, 0.2, 0.0] } else { [0.0, 0.0, 5.0, 0.0] })
                .collect(),
        };
        let out = underside.voted(&sheet, votes.clone());
        for v in 0..n {
            // The last column alone has no area.
            let expected = if along[v] < 0.25 { 1.0 } else { 0.0 };
            assert_eq!(out.of(v)[usize::from(SKIN)], expected, "{}", along[v]);
        }
        let seen = Underside { spanned: vec![false; n], ..underside };
        assert_eq!(seen.voted(&sheet, votes.clone()), votes);
        // Of few frames less is expected.
        let few = Underside { spanned: vec![true; n], unseen: 0.1 };
        assert_eq!(few.voted(&sheet, votes.clone()), votes);
    }

    #[test]
    fn what_hangs_about_the_legs_does_not_hang_about_the_arms() {
        let skeleton = if_body::mannequin::rig::skeleton();
        let names = ["left_thigh", "right_thigh"].map(String::from);
        let about = about(&skeleton, &names);
        let found: Vec<&str> =
            skeleton.names().zip(&about).filter(|(_, a)| **a).map(|n| n.0).collect();
        assert_eq!(found, ["hips", "left_thigh", "right_thigh"]);
        // A sleeve's vertex is moved most by the forearm, though a little by the trunk.
        let forearm = skeleton.names().position(|name| name == "left_forearm").unwrap() as u16;
        let skin =
            SkinWeights::new(vec![[0, forearm, 1, 0]], vec![[0.2, 0.7, 0.1, 0.0]], skeleton.len());
        assert_eq!(strongest(&skin.unwrap(), 0), forearm);
        assert!(!about[usize::from(forearm)]);
    }
}
