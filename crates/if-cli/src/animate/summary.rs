//! The table of an animation.

use crate::table::{self, count, counted, new_table};
use comfy_table::Cell;
use if_body::LeftOut;
use if_pipeline::animate::{AnimationReport, FrameReport, IntervalReport, PinchReport};
use serde_json::{Value, json};
use std::cmp::Reverse;
use std::path::Path;

/// Rows shown of frames that are clean, evenly spaced; those that are not are all shown.
const SHOWN: usize = 24;
/// Joints of the motion that are named.
const SHOWN_JOINTS: usize = 6;
/// Distance from the origin, in metres, from which on it is noted that the motion begins elsewhere in its file.
const ELSEWHERE: f64 = 1.0;
/// Jumps of the motion that are named.
const SHOWN_CUTS: usize = 8;

/// The columns of the table.
pub(super) const HEADER: [&str; 12] = [
    "frame",
    "pairs",
    "inside",
    "own",
    "moved",
    "max mm",
    "body",
    "max mm",
    "jitter p99",
    "max mm",
    "strain %",
    "seconds",
];

/// What was noticed of the files.
pub(super) struct Notes<'a> {
    /// Garments whose weights were taken from the body.
    pub(super) without_weights: &'a [String],
    /// Layers of whose weights some are left out.
    pub(super) left_out: &'a [(String, LeftOut)],
    /// Joints that the motion lacks.
    pub(super) unmatched: &'a [String],
    /// Joints of the motion that no joint of the skeleton follows.
    pub(super) left_over: &'a [String],
    /// Large bones of limbs that do not move though others of the limb do.
    pub(super) still: &'a [String],
    /// Where the file of the motion has the first frame, in metres.
    pub(super) moved_to_origin: Option<[f64; 2]>,
    /// The frame that stands for the rest pose of the motion.
    pub(super) rest_frame: Option<usize>,
    /// How far the skeleton lies from the body, if it may be another one's, in metres.
    pub(super) misplaced: Option<f64>,
}

/// What is printed.
pub(super) fn text(
    (report, between): (&AnimationReport, Option<(&[IntervalReport], f64)>),
    notes: Notes<'_>,
    out: &Path,
    names: &[String],
) -> String {
    let frames = &report.frames;
    let mut rows = new_table(&HEADER, 0, table::coloured());
    let step = frames.len().div_ceil(SHOWN).max(1);
    let shown = |(k, row): &(usize, &FrameReport)| k.is_multiple_of(step) || !row.is_clean();
    for row in frames.iter().enumerate().filter(shown) {
        rows.add_row(cells(row).map(Cell::new));
    }
    let kept = match report.kept {
        0 => String::new(),
        n => format!(", {n} frames kept from an earlier run"),
    };
    let way = between.map_or(String::new(), |(_, s)| format!(", {s:.1} s for the ways between"));
    let between = between.map_or(String::new(), |(between, _)| between_text(between));
    let (pinches, let_go, noticed) = (pinches(frames), let_go(frames), noticed(&notes));
    let cuts = cuts(&report.cuts);
    let reach = match frames.iter().any(|frame| frame.body.reach.is_some()) {
        true => format!(", {:.0} mm from its overlaps", 1e3 * report.body_reach),
        false => String::new(),
    };
    format!(
        "{rows}\n\n{pinches}{let_go}{between}{cuts}{noticed}{}: {} clean, {} clean everywhere; body at most {:.1} mm{reach}, jitter p99 {:.2} mm, \
         at most {:.1} mm, shake p99 {:.2} mm; {:.2} s a frame, {:.1} s in all{way}{kept}\nWrote {}: {}\n",
        counted(frames.len(), "frame"),
        count(report.clean),
        count(report.clean_everywhere),
        1e3 * report.body_max,
        1e3 * report.jitter_p99,
        1e3 * report.jitter_max,
        1e3 * report.shake_p99,
        report.seconds_a_frame,
        report.seconds,
        out.display(),
        names.join(", ")
    )
}

/// What intersects a body that is kept in its pinches; empty if it yields.
pub(super) fn pinches(frames: &[FrameReport]) -> String {
    let found = || frames.iter().filter_map(|f| Some((f.frame, f.pinch.as_ref()?)));
    let Some((frame, worst)) = found().max_by_key(|(frame, p)| (p.pairs, Reverse(*frame))) else {
        return String::new();
    };
    let in_it = found().filter(|(_, p)| p.pairs + p.inside > 0).count();
    let sum = |of: fn(&PinchReport) -> usize| found().map(|(_, p)| of(p)).sum::<usize>();
    let named = worst.garments.iter().map(|g| format!("`{}` {} faces", g.name, g.faces.len()));
    let most = match named.collect::<Vec<_>>().join(", ") {
        garments if garments.is_empty() => String::new(),
        garments => format!("; most in frame {frame}: {} pairs, {garments}", count(worst.pairs)),
    };
    format!(
        "Pinches, where the body leaves no room: {} pairs and {} vertices on a wrong side in {} of {} frames, counted here \
         alone and named in report.json{most}.\n\n",
        count(sum(|p| p.pairs)),
        count(sum(|p| p.inside)),
        count(in_it),
        count(frames.len()),
    )
}

/// Where the body may meet itself, as nothing separates it there; empty if it is held everywhere.
fn let_go(frames: &[FrameReport]) -> String {
    let found = || frames.iter().filter(|f| f.let_go > 0);
    let Some(worst) = found().max_by_key(|f| (f.body_own_pairs, Reverse(f.frame))) else {
        return String::new();
    };
    let left = match worst.body_own_pairs {
        0 => "; no pair is left".to_owned(),
        pairs => format!("; most in frame {}: {} pairs", worst.frame, count(pairs)),
    };
    format!(
        "The body was let go in {} of {} frames: nothing keeps it from meeting itself there, as fingers do in a fist{left}. \
         `--strict` refuses such pairs.\n\n",
        count(found().count()),
        count(frames.len()),
    )
}

/// Where the motion jumps; empty if it does not.
fn cuts(cuts: &[usize]) -> String {
    if cuts.is_empty() {
        return String::new();
    }
    let shown = cuts.iter().take(SHOWN_CUTS).map(usize::to_string).collect::<Vec<_>>().join(", ");
    let more = if cuts.len() > SHOWN_CUTS { " and others" } else { "" };
    format!(
        "The motion jumps before frame {shown}{more}: it begins anew from the rest pose there, and nothing is smoothed across.\n"
    )
}

/// The columns of the table of intervals.
pub(super) const BETWEEN: [&str; 4] = ["after frame", "layers", "own", "first"];

/// Intervals in which something passes through something.
pub(super) fn crossed(between: &[IntervalReport]) -> impl Iterator<Item = &IntervalReport> {
    between.iter().filter(|i| !i.is_clean())
}

/// What all intervals have in common.
pub(super) fn between_line(between: &[IntervalReport]) -> String {
    let ended = || between.iter().filter_map(|i| i.more_than);
    let more = ended().next().map_or(String::new(), |most| {
        format!(
            " In {} more than {} pairs meet, as where a body turns round or jumps; they are not counted.",
            counted(ended().count(), "interval"),
            count(most)
        )
    });
    let layers = between.iter().filter(|i| i.crossings > 0).count();
    let own = between.iter().filter(|i| i.own_crossings > 0).count();
    format!(
        "Between frames, in straight lines: layers pass through one another in {} of {} intervals, a \
         layer through itself in {}.{more}",
        count(layers),
        count(between.len()),
        count(own)
    )
}

/// A line for each of what was noticed.
fn noticed(notes: &Notes<'_>) -> String {
    let line = |what, names: &[String]| match names {
        [] => String::new(),
        names => format!("{what}: {}\n", names.join(", ")),
    };
    let from_body = line("Weights taken from the body", notes.without_weights);
    let left_out: String = notes.left_out.iter().map(left_out_line).collect();
    let unmatched =
        line("Joints that the motion lacks, which follow their parents", notes.unmatched);
    let left_over = match notes.unmatched {
        [] => String::new(),
        _ => left_over_line(notes.left_over),
    };
    let still: String = notes.still.iter().map(|bone| still_line(bone)).collect();
    let rest = notes.rest_frame.map_or(String::new(), |frame| {
        format!("The rest pose of the motion is no upright person; frame {frame} stands for it.\n")
    });
    let elsewhere = notes.moved_to_origin.filter(|[x, z]| x.hypot(*z) > ELSEWHERE);
    let elsewhere = elsewhere.map_or(String::new(), |[x, z]| {
        format!("The motion begins over the origin; in its file at x = {x:.2} m, z = {z:.2} m.\n")
    });
    let misplaced = notes.misplaced.map_or(String::new(), |distance| {
        format!(
            "Is this the skeleton of this body? Its joints are {:.0} mm from the skin that they bend (median).\n",
            1e3 * distance
        )
    });
    format!("{from_body}{left_out}{unmatched}{left_over}{still}{rest}{elsewhere}{misplaced}")
}

/// Joints of the motion that the skeleton may have by other names; empty if there are none.
fn left_over_line(joints: &[String]) -> String {
    if joints.is_empty() {
        return String::new();
    }
    let shown = joints.iter().take(SHOWN_JOINTS).map(String::as_str).collect::<Vec<_>>().join(", ");
    let more = match joints.len().saturating_sub(SHOWN_JOINTS) {
        0 => String::new(),
        more => format!(" and {} more", count(more)),
    };
    format!("Joints of the motion that nothing follows: {shown}{more}\n")
}

/// What is said of a large bone of a limb, such as `left upper arm`.
fn still_line(bone: &str) -> String {
    format!(
        "The {bone} does not move: the motion has other joints of that limb, and none that is known to be this one. Rename it there.\n"
    )
}

/// What is said of a layer whose vertices follow more joints than are kept.
fn left_out_line((layer, of): &(String, LeftOut)) -> String {
    format!(
        "Vertices of `{layer}` that follow more than four joints, of which those with the largest weights are kept: {}; \
         up to {:.1} % of the weight of one is left out.\n",
        count(of.vertices),
        1e2 * of.largest
    )
}

/// The rows of layers of whose weights some are left out.
pub(super) fn left_out(layers: &[(String, LeftOut)]) -> Value {
    let row = |(layer, of): &(String, LeftOut)| json!({"layer": layer, "vertices": of.vertices, "largest": of.largest});
    layers.iter().map(row).collect()
}

fn between_text(between: &[IntervalReport]) -> String {
    let mut rows = new_table(&BETWEEN, 0, table::coloured());
    for row in crossed(between).take(SHOWN) {
        rows.add_row(between_cells(row).map(Cell::new));
    }
    let line = between_line(between);
    if between.iter().all(IntervalReport::is_clean) {
        format!("{line}\n\n")
    } else {
        format!("{rows}\n\n{line}\n\n")
    }
}

/// An interval's row.
pub(super) fn between_cells(row: &IntervalReport) -> [String; 4] {
    let first = row.first.first().map_or(String::new(), |c| {
        let [a, b] = &c.layers;
        let [i, j] = c.triangles;
        format!("{a} {i}, {b} {j} at {:.2}", c.share)
    });
    let [layers, own] = match row.more_than {
        Some(most) => [format!("more than {} in all", count(most)), String::new()],
        None => [row.crossings, row.own_crossings].map(count),
    };
    [row.frame.to_string(), layers, own, first]
}

/// The row of the `k`-th frame. The first one begins from rest in any case.
pub(super) fn cells((k, row): (usize, &FrameReport)) -> [String; 12] {
    let mm = |x: f64| format!("{:.2}", 1e3 * x);
    let mark = match (row.reached, row.restarted && k > 0) {
        (false, _) => " not reached",
        (true, true) => " from rest",
        _ => "",
    };
    [
        format!("{}{mark}", row.frame),
        format!("{} -> {}", count(row.pairs_before), count(row.pairs)),
        count(row.inside),
        format!("{} + {}", row.own_pairs, row.body_own_pairs),
        mm(row.moved.mean),
        mm(row.moved.max),
        mm(row.body.moved.mean),
        mm(row.body.moved.max),
        mm(row.jitter.p99),
        mm(row.jitter.max),
        format!("{:.2} -> {:.2}", 1e2 * row.strain_p99_skinned, 1e2 * row.strain_p99),
        format!("{:.2}", row.seconds),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_body::SkinWeights;
    use if_mesh::gltf::Influences;

    #[test]
    fn what_was_noticed_of_the_files_has_a_line_each() {
        let names = ["thumb".to_owned()];
        let notes = |rest_frame, misplaced| Notes {
            without_weights: &[],
            left_out: &[],
            unmatched: &names,
            left_over: &[],
            still: &[],
            moved_to_origin: None,
            rest_frame,
            misplaced,
        };
        let text = noticed(&notes(Some(12), Some(0.25)));
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].ends_with("follow their parents: thumb"), "{text}");
        assert!(lines[1].ends_with("no upright person; frame 12 stands for it."), "{text}");
        assert!(lines[2].contains("250 mm from the skin") && lines.len() == 3, "{text}");
        assert_eq!(noticed(&notes(None, None)).lines().count(), 1);
        let begins = |at| noticed(&Notes { moved_to_origin: Some(at), ..notes(None, None) });
        assert_eq!(begins([0.5, -0.5]).lines().count(), 1);
        assert!(begins([3.0, -0.25]).ends_with("in its file at x = 3.00 m, z = -0.25 m.\n"));
        let joints: Vec<String> = (0..8).map(|k| format!("bone{k}")).collect();
        let still = ["left upper arm".to_owned()];
        let notes_of = |joints| Notes { left_over: joints, still: &still, ..notes(None, None) };
        let text = noticed(&notes_of(&joints));
        let lines: Vec<&str> = text.lines().collect();
        let expected = "nothing follows: bone0, bone1, bone2, bone3, bone4, bone5 and 2 more";
        assert!(lines[1].ends_with(expected), "{text}");
        assert!(lines[2].starts_with("The left upper arm does not move: "), "{text}");
        // Where nothing lacks, what is left over of the motion is as it should be.
        let text = noticed(&Notes { unmatched: &[], ..notes_of(&joints) });
        assert!(text.lines().count() == 1 && text.starts_with("The left"), "{text}");
        let skin = [[0, 1, 2, 3, 4], [0, 0, 1, 2, 3]].map(|of| of.map(|joint| (joint, 0.2)));
        let joints = ["a", "b", "c", "d", "e"];
        let influences = Influences {
            joints: joints.map(str::to_owned).to_vec(),
            of_vertex: skin.map(|of| of.to_vec()).to_vec(),
        };
        let weights = SkinWeights::from_gltf(&influences, joints.into_iter()).unwrap();
        let layers = [("coat".to_owned(), weights.left_out().unwrap())];
        let text = noticed(&Notes { left_out: &layers, ..notes(None, None) });
        let line = text.lines().next().unwrap();
        assert!(line.starts_with("Vertices of `coat` that follow more than four joints"), "{line}");
        assert!(
            line.ends_with("are kept: 1; up to 20.0 % of the weight of one is left out."),
            "{line}"
        );
        let rows = json!([{"layer": "coat", "vertices": 1, "largest": 0.2}]);
        assert_eq!(left_out(&layers), rows);
    }

    #[test]
    fn jumps_and_searches_that_ended_are_named() {
        assert_eq!(cuts(&[]), "");
        let text = cuts(&[6, 40]);
        assert!(text.starts_with("The motion jumps before frame 6, 40: ") && text.ends_with(".\n"));
        assert!(cuts(&[1; 9]).contains("1, 1 and others: "), "{}", cuts(&[1; 9]));
        let mut row = IntervalReport::default();
        row.more_than = Some(10_000);
        assert_eq!(between_cells(&row), ["0", "more than 10,000 in all", "", ""]);
        let line = between_line(&[IntervalReport::default(), row]);
        assert!(
            line.contains("in 0 of 2 intervals") && line.contains("In 1 interval more than 10,000")
        );
    }

    #[test]
    fn frames_in_which_the_body_is_let_go_are_counted_and_the_worst_is_named() {
        let frame = |frame, let_go, body_own_pairs| {
            let mut row = FrameReport::default();
            (row.frame, row.let_go, row.body_own_pairs) = (frame, let_go, body_own_pairs);
            row
        };
        assert_eq!(let_go(&[frame(0, 0, 7)]), "");
        let text = let_go(&[frame(0, 0, 90), frame(1, 50, 3), frame(2, 60, 8)]);
        assert!(text.contains("2 of 3 frames") && text.contains("frame 2: 8 pairs"), "{text}");
        let text = let_go(&[frame(4, 50, 0)]);
        assert!(text.contains("1 of 1 frames") && text.contains("no pair is left"), "{text}");
    }
}
