//! What is noticed of the files of an outfit that moves. None of it stops the work.

use if_body::LeftOut;
use if_core::math::Real;
use serde::Serialize;

/// Joints of the motion that are named.
const SHOWN_JOINTS: usize = 6;
/// Distance from the origin, in metres, from which on it is noted that the motion begins elsewhere in its file.
const ELSEWHERE: Real = 1.0;

/// What was noticed of the files of a [moving outfit](super::MovingOutfit).
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Noticed {
    /// Garments whose weights were taken from the body.
    pub weights_from_body: Vec<String>,
    /// Layers of whose weights some are left out.
    pub weights_left_out: Vec<WeightsLeftOut>,
    /// Joints of the skeleton that the motion lacks: they follow their parents.
    pub joints_not_in_motion: Vec<String>,
    /// Joints of the motion that no joint of the skeleton follows.
    pub joints_of_motion_left_over: Vec<String>,
    /// Large bones of limbs that the motion lacks while it has others of the limb, in words.
    pub limbs_not_moved: Vec<String>,
    /// Where the motion's file has the hips of the first frame, if they are moved to the origin from there: x and
    /// z, in metres.
    pub moved_to_origin: Option<[Real; 2]>,
    /// The frame that stands for the rest pose of the motion.
    pub rest_frame: Option<usize>,
    /// How far the skeleton lies from the body, in metres, if it may be another one's.
    pub skeleton_from_skin: Option<Real>,
}

/// A layer of whose weights some are left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WeightsLeftOut {
    /// Its name.
    pub layer: String,
    /// How many.
    #[serde(flatten)]
    pub of: LeftOut,
}

impl Noticed {
    /// What a person should know of it.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let names = |what, names: &[String]| {
            (!names.is_empty()).then(|| format!("{what}: {}", names.join(", ")))
        };
        notes.extend(names("Weights taken from the body", &self.weights_from_body));
        notes.extend(self.weights_left_out.iter().map(left_out_note));
        let lacking = "Joints that the motion lacks, which follow their parents";
        notes.extend(names(lacking, &self.joints_not_in_motion));
        // Where nothing lacks, what is left over of the motion is as it should be.
        if !self.joints_not_in_motion.is_empty() {
            notes.extend(left_over_note(&self.joints_of_motion_left_over));
        }
        notes.extend(self.limbs_not_moved.iter().map(|bone| still_note(bone)));
        notes.extend(self.rest_frame.map(|frame| {
            format!(
                "The rest pose of the motion is no upright person; frame {frame} stands for it."
            )
        }));
        let elsewhere = self.moved_to_origin.filter(|[x, z]| x.hypot(*z) > ELSEWHERE);
        notes.extend(elsewhere.map(|[x, z]| {
            format!("The motion begins over the origin; in its file at x = {x:.2} m, z = {z:.2} m.")
        }));
        notes.extend(self.skeleton_from_skin.map(|distance| {
            format!(
                "Is this the skeleton of this body? Its joints are {:.0} mm from the skin that they bend (median).",
                1e3 * distance
            )
        }));
        notes
    }
}

/// Joints of the motion that the skeleton may have by other names.
fn left_over_note(joints: &[String]) -> Option<String> {
    let shown = joints.iter().take(SHOWN_JOINTS).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = match joints.len().saturating_sub(SHOWN_JOINTS) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    (!joints.is_empty())
        .then(|| format!("Joints of the motion that nothing follows: {shown}{more}"))
}

/// What is said of a large bone of a limb, such as `left upper arm`.
fn still_note(bone: &str) -> String {
    format!(
        "The {bone} does not move: the motion has other joints of that limb, and none that is known to be this one. \
         Rename it there."
    )
}

/// What is said of a layer whose vertices follow more joints than are kept.
fn left_out_note(WeightsLeftOut { layer, of }: &WeightsLeftOut) -> String {
    format!(
        "Vertices of `{layer}` that follow more than four joints, of which those with the largest weights are kept: {}; \
         up to {:.1} % of the weight of one is left out.",
        of.vertices,
        1e2 * of.largest
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::SkinWeights;
    use if_mesh::gltf::Influences;

    fn lacking() -> Noticed {
        Noticed { joints_not_in_motion: vec!["thumb".to_owned()], ..Noticed::default() }
    }

    #[test]
    fn what_was_noticed_of_the_files_has_a_note_each() {
        assert!(Noticed::default().notes().is_empty());
        let (rest_frame, skeleton_from_skin) = (Some(12), Some(0.25));
        let notes = Noticed { rest_frame, skeleton_from_skin, ..lacking() }.notes();
        assert!(notes[0].ends_with("follow their parents: thumb"), "{notes:?}");
        assert!(notes[1].ends_with("no upright person; frame 12 stands for it."), "{notes:?}");
        assert!(notes[2].contains("250 mm from the skin") && notes.len() == 3, "{notes:?}");
        assert_eq!(lacking().notes().len(), 1);
    }

    #[test]
    fn a_motion_that_begins_far_from_the_origin_is_noted() {
        let begins = |at| Noticed { moved_to_origin: Some(at), ..Noticed::default() }.notes();
        assert!(begins([0.5, -0.5]).is_empty());
        assert!(begins([3.0, -0.25])[0].ends_with("in its file at x = 3.00 m, z = -0.25 m."));
    }

    #[test]
    fn joints_that_nothing_follows_are_noted_where_others_lack() {
        let joints_of_motion_left_over = (0..8).map(|k| format!("bone{k}")).collect();
        let limbs_not_moved = vec!["left upper arm".to_owned()];
        let noticed = Noticed { joints_of_motion_left_over, limbs_not_moved, ..lacking() };
        let notes = noticed.notes();
        let expected = "nothing follows: bone0, bone1, bone2, bone3, bone4, bone5 and 2 more";
        assert!(notes[1].ends_with(expected), "{notes:?}");
        assert!(notes[2].starts_with("The left upper arm does not move: "), "{notes:?}");
        let notes = Noticed { joints_not_in_motion: Vec::new(), ..noticed }.notes();
        assert!(notes.len() == 1 && notes[0].starts_with("The left"), "{notes:?}");
    }

    #[test]
    fn weights_that_are_left_out_are_noted_with_their_layer() {
        let skin = [[0, 1, 2, 3, 4], [0, 0, 1, 2, 3]].map(|of| of.map(|joint| (joint, 0.2)));
        let joints = ["a", "b", "c", "d", "e"];
        let influences = Influences {
            joints: joints.map(str::to_owned).to_vec(),
            of_vertex: skin.map(|of| of.to_vec()).to_vec(),
        };
        let weights = SkinWeights::from_gltf(&influences, joints.into_iter()).unwrap();
        let of = weights.left_out().unwrap();
        let weights_left_out = vec![WeightsLeftOut { layer: "coat".to_owned(), of }];
        let noticed = Noticed { weights_left_out, ..Noticed::default() };
        let [note] = &noticed.notes()[..] else { panic!("{noticed:?}") };
        assert!(note.starts_with("Vertices of `coat` that follow more than four joints"), "{note}");
        assert!(
            note.ends_with("are kept: 1; up to 20.0 % of the weight of one is left out."),
            "{note}"
        );
        let rows = serde_json::json!([{"layer": "coat", "vertices": 1, "largest": 0.2}]);
        assert_eq!(serde_json::to_value(&noticed.weights_left_out).unwrap(), rows);
    }
}
