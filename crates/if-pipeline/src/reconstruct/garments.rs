//! Garments, cut out of the canonical mesh along the labels that frames vote for.

use super::error::ReconstructError;
use super::frames::posed;
use super::hems;
use super::lids;
use super::mask_rim::MaskRims;
use super::motion::MeshMotion;
use super::progress;
use super::shown::{LabelShown, Shown};
use super::skipped::Skipped;
use super::struts;
use super::underside::Underside;
use crate::asset::LayerHint;
use crate::capture::{Capture, FIRST_GARMENT};
use if_body::{Skeleton, SkinWeights};
use if_core::field::SignedDistance;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use if_core::monitor::Monitor;
use if_core::parameter::ParameterError;
use if_mesh::attributes::{Source, VertexAttributes};
use if_mesh::baked::Baked;
use if_mesh::cleanup::{
    Around, CleanupError, CleanupParams, CleanupReport, Complement, Openings, cleanup,
};
use if_mesh::labels::{
    CutParams, Look, Origin, Piece, SmoothLabelParams, UNDECIDED, VoteParams, VoteReport, Voter,
    cut, smooth_labels,
};
use if_mesh::ply::PlyMesh;
use if_outfit::outfit::{OutfitError, check_garment};

/// Least area of a hand beyond its cuff, in square metres. Of a sweater of 1 m², adults' hands have
/// 0.03 to 0.04, a child's half of that, and the largest hole at an armpit 0.005.
const HAND: Real = 0.012;
/// Least length of an opening, in metres: a cuff of 4 cm across.
const CUFF: Real = 0.13;

/// How far openings may lie beyond the last joint of a limb, in metres: beyond the wrist of a skeleton
/// without hands.
const BEYOND: Real = 0.2;

/// Parameters of [`find_garments`].
#[derive(Clone, Debug, Default)]
pub struct GarmentParams {
    /// Votes of pixels.
    pub votes: VoteParams,
    /// Smoothing of labels on the surface.
    pub smoothness: SmoothLabelParams,
    /// Cutting of triangles.
    pub cut: CutParams,
    /// Clean-up of each piece. Its `openings` are ignored: which loops stay open depends on the
    /// garment's class and on the body.
    pub cleanup: CleanupParams,
}

impl GarmentParams {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// The first parameter that is out of range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.votes.validate().map_err(|e| e.within("votes"))?;
        self.smoothness.validate().map_err(|e| e.within("smoothness"))?;
        self.cut.validate().map_err(|e| e.within("cut"))?;
        self.cleanup.validate().map_err(|e| e.within("cleanup"))
    }
}

/// A separate garment.
#[derive(Clone, Debug)]
pub struct Garment {
    /// Its name in the capture.
    pub name: String,
    /// Its label in the capture.
    pub label: u8,
    /// Its surface in canonical space, in metres.
    pub mesh: TriMesh,
    /// Its skinning weights.
    pub skin: SkinWeights,
    /// The share of it, by vertices of the canonical mesh, that was seen in no frame: a guess, as what
    /// lies around it is.
    pub unseen: Real,
    /// φ of the clothed person round it, baked, if requested.
    pub phi: Option<Baked>,
    /// Report of the clean-up.
    pub cleanup: CleanupReport,
}

/// All garments, and the labels that separate them.
#[derive(Clone, Debug)]
pub struct Garments {
    /// The label of each vertex of the canonical mesh; 0 if unknown.
    pub labels: Vec<u8>,
    /// Report of the votes.
    pub votes: VoteReport,
    /// How the label images that were read show each label of the capture.
    pub shown: Vec<LabelShown>,
    /// How far masks reach beyond the label images that were read, the median, in metres at the person; negative
    /// where they fall short of them.
    pub masks_beyond: Real,
    /// The garments in the order of the capture, inner to outer, without the missing ones.
    pub garments: Vec<Garment>,
    /// Garments that no frame shows, or so little of them that it is no garment.
    pub missing: Vec<String>,
}

/// The clothed person in canonical space, as [`find_garments`] needs it.
#[derive(Clone, Copy)]
pub struct ClothedPerson<'a> {
    /// The skeleton that the capture's poses are of.
    pub skeleton: &'a Skeleton,
    /// The canonical mesh, in metres.
    pub mesh: &'a TriMesh,
    /// Its skinning weights.
    pub skin: &'a SkinWeights,
    /// Its signed distance: hole patches and hems are projected onto it.
    pub field: &'a dyn SignedDistance,
    /// The motion of single frames, if solved.
    pub motion: Option<&'a MeshMotion>,
    /// The undersides of loose clothes ([`Underside::of`]).
    pub underside: Option<&'a Underside>,
    /// Frames that the surface skipped: they have no vote.
    pub skipped: &'a [Skipped],
}

impl std::fmt::Debug for ClothedPerson<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (vertices, triangles) = (self.mesh.vertices().len(), self.mesh.triangles().len());
        f.debug_struct("ClothedPerson")
            .field("vertices", &vertices)
            .field("triangles", &triangles)
            .field("motion", &self.motion.is_some())
            .field("underside", &self.underside.is_some())
            .field("skipped", &self.skipped.len())
            .finish_non_exhaustive()
    }
}

/// Labels a canonical mesh by votes of all frames, cuts it along the borders of the labels, cleans the
/// pieces, and lays their hems straight. What closes a garment about a limb is not part of it, nor is what
/// lies beyond the edges of all pictures, nor are lattices that no frame sees.
///
/// Stages: `garments`, a step for each frame and garment, and those of [`smooth_labels`] and
/// [`cleanup`].
///
/// # Source
///
/// Supplement, Appendix B, for the clean-up; votes and cut are ours. The steps are
/// [`if_mesh::labels`] and [`mod@if_mesh::cleanup`].
///
/// # Errors
///
/// [`ReconstructError`].
///
/// # Panics
///
/// If the motion or underside is of another mesh or capture.
pub fn find_garments(
    capture: &Capture,
    person: &ClothedPerson,
    params: &GarmentParams,
    monitor: &mut dyn Monitor,
) -> Result<Garments, ReconstructError> {
    let ClothedPerson { skeleton, mesh, skin, motion, underside, skipped, .. } = *person;
    let steps = capture.len() + capture.garments().len();
    let report = |monitor: &mut dyn Monitor, step| {
        progress::report(monitor, "garments", (step, steps), None)
    };

    // Each frame that adds information votes with its label image.
    let mut voter = Voter::new(mesh, capture.labels().len(), &params.votes)?;
    let mut rims = MaskRims::default();
    let mut shown = Shown::nothing(mesh.vertices().len(), capture.labels().len(), capture.camera());
    let frames: Vec<usize> = Skipped::others(skipped, capture).collect();
    for &frame in &frames {
        report(monitor, frame)?;
        let offsets = motion.map(|m| m.offsets(frame)).unwrap_or_default();
        let at = posed(mesh, skin, skeleton, capture.pose(frame), &offsets)
            .map_err(|source| ReconstructError::Pose { frame, source })?;
        let vote = |source| ReconstructError::Vote { frame, source };
        shown.add(&at);
        if voter.look(&at, capture.camera()).map_err(vote)? == Look::Gains {
            let labels = capture.label_image(frame)?;
            voter.cast(&labels).map_err(vote)?;
            shown.add_labels(&labels);
            rims.add(capture.camera(), &at, (&capture.mask(frame)?, &labels));
        }
    }

    // Labels are smoothed, with votes against garments beyond the pictures and on undersides of loose ones,
    // and once more with votes against garments on their lids.
    let (mut votes, mut vote_report) = voter.finish();
    vote_report.contradictions.iter_mut().for_each(|c| c.frame = frames[c.frame]);
    let seen: Vec<bool> = (0..votes.vertices()).map(|v| votes.winner(v) != UNDECIDED).collect();
    votes = shown.voted(votes);
    if let Some(underside) = underside {
        votes = underside.voted(mesh, votes);
    }
    let mut scores = smooth_labels(mesh, &votes, &params.smoothness, monitor)?;
    if let Some(votes) = lids::outvoted(mesh, &votes, &scores) {
        scores = smooth_labels(mesh, &votes, &params.smoothness, monitor)?;
    }
    let labels = scores.winners();

    // The mesh is cut, and each garment cleaned.
    let pieces = cut(mesh, &scores, &params.cut)?;
    let attributes = VertexAttributes::new(mesh.vertices().len(), skin.to_properties())?;
    let (votes, shown) = (vote_report, shown.labels());
    let masks_beyond = rims.median();
    let (garments, missing) = (Vec::new(), Vec::new());
    let mut found = Garments { labels, votes, shown, masks_beyond, garments, missing };
    for (k, name) in capture.garments().iter().enumerate() {
        report(monitor, capture.len() + k)?;
        let label = FIRST_GARMENT + k as u8;
        let piece = pieces.iter().find(|p| p.label == label && !p.mesh.triangles().is_empty());
        let garment = match piece {
            Some(piece) => {
                let carried = attributes.derive(&sources(piece));
                let is_seen = |of: &Origin| of.vertices.iter().any(|v| seen[*v as usize]);
                let seen: Vec<bool> = piece.origins.iter().map(is_seen).collect();
                let without = struts::removed(&piece.mesh, &seen, &limbs(skeleton));
                let mesh = without.as_ref().unwrap_or(&piece.mesh);
                cleaned((name, label), person, (mesh, &carried), &params.cleanup, monitor)?
            }
            None => None,
        };
        match garment {
            Some(garment) => {
                let unseen = unseen(label, &found.labels, &seen);
                found.garments.push(Garment { unseen, ..garment });
            }
            None => found.missing.push(name.clone()),
        }
    }
    Ok(found)
}

/// The share of the vertices with a label that is not `seen`.
fn unseen(label: u8, labels: &[u8], seen: &[bool]) -> Real {
    let of_label = labels.iter().zip(seen).filter(|(other, _)| **other == label);
    let all = of_label.clone().count();
    of_label.filter(|(_, seen)| !**seen).count() as Real / all.max(1) as Real
}

/// Cleans the piece of a garment, and lays its hems straight; `None` if nothing or a scrap remains.
fn cleaned(
    (name, label): (&str, u8),
    person: &ClothedPerson,
    (piece, carried): (&TriMesh, &VertexAttributes),
    params: &CleanupParams,
    monitor: &mut dyn Monitor,
) -> Result<Option<Garment>, ReconstructError> {
    let openings = openings_of(name, person.mesh, person.skeleton, piece.area());
    let params = CleanupParams { openings, ..params.clone() };
    let clean = cleanup(piece, carried, Some(person.field), &params, monitor).map_err(
        |source| match source {
            CleanupError::Cancelled(cancelled) => ReconstructError::Cancelled(cancelled),
            source => ReconstructError::Cleanup { name: name.into(), source },
        },
    )?;
    if clean.mesh.triangles().is_empty() {
        return Ok(None);
    }
    let mesh = hems::straightened(&clean.mesh);
    if is_scrap(&mesh, &clean.report, person.mesh) {
        return Ok(None);
    }
    let ply =
        PlyMesh { vertex_properties: clean.attributes.into_properties(), ..PlyMesh::new(mesh) };
    let skin = SkinWeights::from_ply(&ply, person.skeleton.len())
        .map_err(|source| ReconstructError::GarmentSkin { name: name.into(), source })?;
    let (name, mesh, cleanup) = (name.to_owned(), ply.mesh, clean.report);
    Ok(Some(Garment { name, label, mesh, skin, unseen: 0.0, phi: None, cleanup }))
}

/// Whether too little of a garment of `body` was seen to be one: smaller than a hand and with holes alone,
/// or too small for any outfit.
fn is_scrap(mesh: &TriMesh, cleanup: &CleanupReport, body: &TriMesh) -> bool {
    let holes = &cleanup.holes;
    let is_shut = holes.openings.is_empty() && holes.filled.len() + holes.left.len() > 0;
    let place = check_garment(&body.aabb(), "", mesh);
    is_shut && mesh.area() < HAND || matches!(place, Err(OutfitError::TooSmall { .. }))
}

/// The policy that decides which boundary loops of the garment `name` of this area, cut out of `body`,
/// are openings and stay open: those that
///
/// - bound a large part of the rest of the body ([`Complement`]): islands of other labels within a
///   garment are holes, and so are unseen patches. A hand is large, however large the coat;
/// - are as long as a cuff: where two garments meet, the extracted surface may have a tunnel of a few
///   cells, whose section bounds the other garment like a hem. How open a loop is does not tell: where
///   a wide sleeve is closed about the wrist, the wrist's loop lies in that lid;
/// - have a limb, the head or the trunk lead through, as a cuff that is narrower than a tear, or are among
///   the most open others, as many as garments of this class have ([`GarmentClass::most_openings`]).
///
/// [`GarmentClass::most_openings`]: crate::asset::GarmentClass::most_openings
fn openings_of(name: &str, body: &TriMesh, skeleton: &Skeleton, area: Real) -> Openings {
    let rest = Complement::new(body.clone());
    let rest = Complement { least_share: rest.least_share.min(HAND / area), ..rest };
    let mut policies = vec![Openings::Complement(Box::new(rest)), Openings::Longer(CUFF)];
    let around = |count| Openings::Around(Around { lines: limbs(skeleton), count });
    policies.extend(LayerHint::of_name(name).class.most_openings().map(around));
    Openings::Sequence(policies)
}

/// For each joint at an end, the way there along the bones, and [`BEYOND`] it.
fn limbs(skeleton: &Skeleton) -> Vec<Vec<Point>> {
    let joints = skeleton.joints();
    let mut is_end = vec![true; joints.len()];
    joints.iter().filter_map(|joint| joint.parent).for_each(|parent| is_end[parent] = false);
    let way = |end: usize| {
        let path = std::iter::successors(Some(end), |j| joints[*j].parent);
        let mut way: Vec<Point> = path.map(|j| joints[j].head).collect();
        way.reverse();
        way.push(joints[end].tail);
        way.dedup();
        if let [.., before, last] = way[..] {
            way.push(last + (last - before).normalize() * BEYOND);
        }
        way
    };
    (0..joints.len()).filter(|j| is_end[*j]).map(way).collect()
}

/// The vertices of the canonical mesh from which the vertices of a piece are interpolated.
fn sources(piece: &Piece) -> Vec<Source> {
    let of = |origin: &Origin| match origin.source() {
        Some(v) => Source::Vertex(v),
        None => {
            let mut parts: Vec<(u32, f64)> = origin
                .vertices
                .iter()
                .copied()
                .zip(origin.weights)
                .filter(|(_, w)| *w > 0.0)
                .collect();
            parts.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
            Source::Blend(parts)
        }
    };
    piece.origins.iter().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::Joint;
    use if_core::monitor::Silent;
    use std::f64::consts::TAU;

    fn joint(parent: Option<usize>, head: [Real; 3], tail: [Real; 3]) -> Joint {
        let name = format!("{head:?}");
        Joint { name, parent, head: head.into(), tail: tail.into() }
    }

    /// A bone far from all.
    fn axis() -> Skeleton {
        Skeleton::new(vec![joint(None, [9.0; 3], [9.0, 9.1, 9.0])]).unwrap()
    }

    /// A closed drum with a tunnel along its axis, of this radius above and 3 cm below, and its upper
    /// half: mantle and lid.
    fn drum_with_a_tunnel(above: Real) -> (TriMesh, TriMesh) {
        const AROUND: u32 = 48;
        const STEPS: u32 = 20;
        // The profile from the lower end of the mantle up, inwards over the lid, and down the
        // tunnel, which widens.
        let corners = [[0.2, 0.0], [0.2, 1.0], [above, 1.0], [0.03, 0.0]];
        let side = |k: usize| (0..STEPS).map(move |i| (k, Real::from(i) / Real::from(STEPS)));
        let profile: Vec<[Real; 2]> = (0..4)
            .flat_map(side)
            .map(|(k, s)| {
                [0, 1].map(|axis| corners[k][axis] * (1.0 - s) + corners[(k + 1) % 4][axis] * s)
            })
            .collect();
        let rows = profile.len() as u32;
        let at = |[r, y]: [Real; 2], k: u32| {
            let (sin, cos) = (TAU * Real::from(k) / Real::from(AROUND)).sin_cos();
            Point::new(r * cos, y, r * sin)
        };
        let vertices: Vec<Point> =
            profile.iter().flat_map(|p| (0..AROUND).map(move |k| at(*p, k))).collect();
        let quad = |j: u32, k: u32| {
            let (j1, k1) = ((j + 1) % rows, (k + 1) % AROUND);
            let [a, b, c, d] = [j * AROUND + k, j * AROUND + k1, j1 * AROUND + k1, j1 * AROUND + k];
            [[a, c, b], [a, d, c]]
        };
        let part = |rows: std::ops::Range<u32>| {
            let triangles = rows.flat_map(|j| (0..AROUND).flat_map(move |k| quad(j, k))).collect();
            TriMesh::new(vertices.clone(), triangles).unwrap()
        };
        (part(0..rows), part(STEPS / 2..2 * STEPS))
    }

    /// Numbers of openings and of filled holes.
    fn loops(piece: &TriMesh, openings: Openings) -> (usize, usize) {
        let params = CleanupParams { openings, smooth: None, ..CleanupParams::default() };
        let none = VertexAttributes::none(piece.vertices().len());
        let report = cleanup(piece, &none, None, &params, &mut Silent).unwrap().report;
        (report.holes.openings.len(), report.holes.filled.len())
    }

    #[test]
    fn what_no_frame_sees_counts_for_its_own_label() {
        let (labels, seen) = ([2, 2, 1, 2, 2], [true, false, false, true, true]);
        assert_eq!([1, 2, 3].map(|label| unseen(label, &labels, &seen)), [1.0, 0.25, 0.0]);
    }

    #[test]
    fn limbs_lead_from_the_root_beyond_each_end() {
        let joints = vec![
            joint(None, [0.0; 3], [0.0, 0.5, 0.0]),
            joint(Some(0), [0.0, 0.5, 0.0], [0.0, 0.8, 0.0]),
            joint(Some(0), [0.1, 0.0, 0.0], [0.1, -0.8, 0.0]),
            joint(Some(2), [0.1, -0.8, 0.0], [0.1, -0.8, 0.0]),
        ];
        let ways = limbs(&Skeleton::new(joints).unwrap());
        let heights: Vec<Vec<Real>> =
            ways.iter().map(|way| way.iter().map(|p| p.y).collect()).collect();
        // The last joint has no length: the way goes on as before it.
        assert_eq!(
            heights,
            [vec![0.0, 0.5, 0.8, 0.8 + BEYOND], vec![0.0, 0.0, -0.8, -0.8 - BEYOND]]
        );
        assert_eq!(limbs(&axis())[0].len(), 3);
        let (body, piece) = drum_with_a_tunnel(0.02);
        let Openings::Sequence(policies) = openings_of("coat", &body, &axis(), piece.area()) else {
            panic!()
        };
        let Some(Openings::Around(around)) = policies.last() else { panic!() };
        assert_eq!((around.count, &around.lines), (4, &limbs(&axis())));
    }

    #[test]
    fn a_tunnel_to_another_garment_is_not_an_opening() {
        let (body, piece) = drum_with_a_tunnel(0.02);
        // The tunnel, too, bounds the other half of the body: the complement alone does not
        // distinguish them.
        let rest = Openings::Complement(Box::new(Complement::new(body.clone())));
        assert_eq!(loops(&piece, rest), (2, 0));
        for name in ["sweater", "thing"] {
            assert_eq!(
                loops(&piece, openings_of(name, &body, &axis(), piece.area())),
                (1, 1),
                "{name}"
            );
        }
    }

    #[test]
    fn a_wrist_is_an_opening_of_the_lid_about_it() {
        // The same drum, but the tunnel is as wide as a wrist. Its loop lies in a flat lid.
        let (body, piece) = drum_with_a_tunnel(0.025);
        assert_eq!(loops(&piece, Openings::default()), (1, 1));
        assert_eq!(loops(&piece, openings_of("coat", &body, &axis(), piece.area())), (2, 0));
    }

    #[test]
    fn a_scrap_is_no_garment() {
        let body = if_core::shapes::meshes::icosphere(0.3, 5);
        let cap = |height: Real| {
            let is_above = |t: &[u32; 3]| t.iter().all(|v| body.vertices()[*v as usize].y > height);
            let above = body.triangles().iter().copied().filter(is_above).collect();
            TriMesh::new(body.vertices().to_vec(), above).unwrap()
        };
        let judged = |piece: &TriMesh, openings: Openings| {
            let params = CleanupParams { openings, smooth: None, ..CleanupParams::default() };
            let none = VertexAttributes::none(piece.vertices().len());
            let clean = cleanup(piece, &none, None, &params, &mut Silent).unwrap();
            is_scrap(piece, &clean.report, &body)
        };
        let (small, large) = (cap(0.295), cap(0.28));
        assert!(small.area() < HAND && large.area() > HAND, "{} {}", small.area(), large.area());
        assert!(judged(&small, Openings::Longer(10.0)));
        assert!(!judged(&small, Openings::Longer(0.1)), "open somewhere");
        assert!(!judged(&large, Openings::Longer(10.0)), "as large as a hand");
        let speck = small.with_vertices(small.vertices().iter().map(|p| p * 0.01).collect());
        assert!(judged(&speck.unwrap(), Openings::Longer(0.0)), "too small for any outfit");
    }

    #[test]
    fn a_hand_is_open_however_large_the_coat() {
        let (body, piece) = drum_with_a_tunnel(0.025);
        // The rest of the body has 0.7 m², less than 1.5 % of 50 m².
        let area = 50.0;
        assert_eq!(loops(&piece, openings_of("coat", &body, &axis(), area)).0, 2);
        let Openings::Sequence(policies) = openings_of("coat", &body, &axis(), area) else {
            panic!()
        };
        assert!(matches!(&policies[0], Openings::Complement(c) if c.least_share * area == HAND));
    }
}
