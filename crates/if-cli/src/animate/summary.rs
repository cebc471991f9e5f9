//! The table of an animation.

use crate::table::{self, count, counted, new_table};
use comfy_table::Cell;
use if_pipeline::animate::{AnimationReport, FrameReport, IntervalReport, Noticed, PinchReport};
use std::cmp::Reverse;
use std::path::Path;

/// Rows shown of frames that are clean, evenly spaced; those that are not are all shown.
const SHOWN: usize = 24;
/// Frames in which something jumps that are named.
const SHOWN_FRAMES: usize = 8;
/// Jitter of the body that is noted, in metres.
const LEAP: f64 = 0.01;

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

/// What is printed.
pub(super) fn text(
    (report, between): (&AnimationReport, Option<(&[IntervalReport], f64)>),
    noticed: &Noticed,
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
    let (pinches, let_go) = (pinches(frames), let_go(frames));
    let noticed: String = noticed.notes().iter().map(|note| format!("{note}\n")).collect();
    let (cuts, trembles) = (cuts(&report.cuts), trembles(frames));
    let reach = match frames.iter().any(|frame| frame.body.reach.is_some()) {
        true => format!(", {:.0} mm from its overlaps", 1e3 * report.body_reach),
        false => String::new(),
    };
    format!(
        "{rows}\n\n{pinches}{let_go}{between}{cuts}{trembles}{noticed}{}: {} clean, {} clean everywhere; body at most {:.1} mm{reach}, its jitter {:.1} mm; \
         garments: jitter p99 {:.2} mm, at most {:.1} mm, shake p99 {:.2} mm; {:.2} s a frame, {:.1} s in all{way}{kept}\nWrote {}: {}\n",
        counted(frames.len(), "frame"),
        count(report.clean),
        count(report.clean_everywhere),
        1e3 * report.body_max,
        1e3 * report.body_jitter,
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
    format!(
        "The motion jumps before frame {}: it begins anew from the rest pose there, and nothing is smoothed across.\n",
        some(cuts)
    )
}

/// Where parts of the body leap, as a hand over cloth that it touches; empty if none does.
fn trembles(frames: &[FrameReport]) -> String {
    let found: Vec<usize> =
        frames.iter().filter(|f| f.body.jitter > LEAP).map(|f| f.frame).collect();
    if found.is_empty() {
        return String::new();
    }
    format!(
        "Parts of the body, such as hands that touch cloth, yield otherwise than in the frame before, by more than \
         {:.0} mm, in frame {}.\n",
        1e3 * LEAP,
        some(&found)
    )
}

/// The first of some frames, by their numbers.
fn some(frames: &[usize]) -> String {
    let shown = frames.iter().take(SHOWN_FRAMES).map(usize::to_string).collect::<Vec<_>>();
    let more = if frames.len() > SHOWN_FRAMES { " and others" } else { "" };
    format!("{}{more}", shown.join(", "))
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

    #[test]
    fn jumps_and_searches_that_ended_are_named() {
        assert_eq!(cuts(&[]), "");
        let text = cuts(&[6, 40]);
        assert!(text.starts_with("The motion jumps before frame 6, 40: ") && text.ends_with(".\n"));
        assert!(cuts(&[1; 9]).contains("1, 1 and others: "), "{}", cuts(&[1; 9]));
        let mut frames = vec![FrameReport::default(); 3];
        frames.iter_mut().enumerate().for_each(|(k, row)| row.frame = 10 + k);
        frames[1].body.jitter = 9.9e-3;
        assert_eq!(trembles(&frames), "");
        frames[2].body.jitter = 0.04;
        assert!(trembles(&frames).ends_with("by more than 10 mm, in frame 12.\n"));
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
