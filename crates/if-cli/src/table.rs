//! Reports as plain text, at most 100 columns wide.

use comfy_table::{Cell, CellAlignment, Color, Table, TableStyle};
use comfy_table::{ContentLineStyle, LineStyle};
use if_mesh::cleanup::{CleanupReport, Component, LoopShape, PatchShape};
use if_outfit::report::{
    KeptReason, LayerReport, LeastDistance, PairReport, ResolveReport, Verification,
};
use std::fmt::Write;
use std::io::IsTerminal;

/// Whether stdout shows colours: it is a terminal, and `NO_COLOR` does not forbid it.
pub(crate) fn coloured() -> bool {
    let forbidden = std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty());
    let dumb = std::env::var_os("TERM").is_some_and(|v| v == "dumb");
    std::io::stdout().is_terminal() && !forbidden && !dumb
}

/// What `fix` and `demo` print: each pair of layers before and after, then what was done to each.
pub(crate) fn resolved(report: &ResolveReport, colour: bool) -> String {
    let (before, after) = (&report.before, &report.after);
    let mut text = String::new();
    section(&mut text, "Before -> after", &pairs_before_after(before, after, colour));
    section(&mut text, "What was done", &layers(&report.layers, &before.own_pairs, colour));
    for layer in report.layers.iter().filter(|l| l.tucked[0] > 0) {
        let [before, after] = layer.tucked;
        let _ = writeln!(
            text,
            "{} was pressed in below the layers above: {} -> {} vertices stick out of them.",
            layer.name,
            count(before),
            count(after)
        );
    }
    for layer in &report.layers {
        text += &kept_own_pairs(layer);
    }
    report.layers.iter().filter_map(eased).for_each(|line| text += &line);
    for layer in report.layers.iter().filter(|l| l.split > 0) {
        let _ = writeln!(
            text,
            "{}: {} triangles of the input were split into smaller ones.",
            layer.name,
            count(layer.split)
        );
    }
    text + &least_distances(report)
}

/// The largest strain before and after easing, and of the result where later work changed it; `None`
/// if easing brought no percent.
fn eased(layer: &LayerReport) -> Option<String> {
    let whole = |strain: f64| (100.0 * strain).round();
    let ([before, after], now) = (layer.eased.map(whole), whole(layer.strain.max));
    let later = if now == after { String::new() } else { format!(" The result has {now} %.") };
    (after < before).then(|| {
        format!(
            "{} was eased where it was drawn: largest strain {before} -> {after} %.{later}\n",
            layer.name
        )
    })
}

/// The own pairs that a garment keeps, one line for each reason; empty if it keeps none. Of very many
/// the first are named.
fn kept_own_pairs(layer: &LayerReport) -> String {
    /// More pairs than these do not help a person.
    const SHOWN: usize = 4;
    let reasons = [
        (KeptReason::Coincident, "its sheets coincide"),
        (KeptReason::NonManifold, "more than two triangles meet at an edge"),
        (KeptReason::Contour, "the sheets do not come apart"),
        (KeptReason::Layers, "they came back between the layers"),
        (KeptReason::Strain, "the cloth would be torn out of shape"),
    ];
    let mut text = String::new();
    let (all, named) = (layer.own_pairs.after, layer.kept_own_pairs.len());
    let of = match named < all {
        true => format!(" (of the first {named} of {})", count(all)),
        false => String::new(),
    };
    for (reason, why) in reasons {
        let pairs: Vec<_> = layer.kept_own_pairs.iter().filter(|k| k.reason == reason).collect();
        let shown: Vec<String> =
            pairs.iter().take(SHOWN).map(|k| format!("{:?}", k.triangles)).collect();
        if !pairs.is_empty() {
            let more = if pairs.len() > SHOWN { " ..." } else { "" };
            let (n, shown) = (count(pairs.len()), shown.join(" "));
            let _ =
                writeln!(text, "{} keeps {n} own pairs{of}: {why}:\n  {shown}{more}", layer.name);
        }
    }
    text
}

/// What `clean` prints: the steps, then the loops.
pub(crate) fn cleaned(report: &CleanupReport, colour: bool) -> String {
    let mut steps = new_table(&["step", "what was done"], 2, colour);
    let m = &report.manifold;
    let d = &m.degenerate;
    let told = |parts: &[(usize, &str)]| {
        let parts: Vec<String> = parts
            .iter()
            .filter(|p| p.0 > 0)
            .map(|(n, what)| format!("{} {what}", count(*n)))
            .collect();
        if parts.is_empty() { "nothing to do".to_owned() } else { parts.join(", ") }
    };
    let manifold = told(&[
        (report.seam_edges, "edges of seams closed meanwhile"),
        (d.duplicates, "doubled triangles dropped"),
        (d.collapsed + d.flipped, "flat triangles mended"),
        (d.dropped + m.dropped, "triangles dropped"),
        (m.reoriented, "turned over"),
        (m.non_manifold_edges, "non-manifold edges cut"),
        (m.non_orientable_edges, "one-sided edges cut"),
        (m.split_vertices, "vertices split off bow-ties"),
        (m.unused_vertices, "unused vertices dropped"),
    ]);
    steps.add_row([Cell::new("manifold"), Cell::new(manifold)]);
    let c = &report.components;
    let area = |parts: &[Component]| parts.iter().map(|p| p.area).sum::<f64>() * 1e4;
    let parts = match c.dropped.len() {
        0 => format!("nothing to do, {} kept", count(c.kept.len())),
        n => {
            format!(
                "{} dropped ({:.2} cm2), {} kept ({:.0} cm2)",
                count(n),
                area(&c.dropped),
                count(c.kept.len()),
                area(&c.kept)
            )
        }
    };
    steps.add_row([Cell::new("isolated elements"), Cell::new(parts)]);
    let h = &report.holes;
    let added: usize = h.filled.iter().map(|f| f.triangles).sum();
    let parted = match h.parted.len() {
        0 => String::new(),
        n => format!(", {} sides of parted seams", count(n)),
    };
    let filled = format!(
        "{} filled ({} triangles, {:.2} cm2), {} left, {} openings kept{parted}",
        count(h.filled.len()),
        count(added),
        h.filled.iter().fold(0.0, |sum, f| sum + f.area) * 1e4, // the sum of none is -0
        count(h.left.len()),
        count(h.openings.len())
    );
    steps.add_row([Cell::new("holes"), Cell::new(filled)]);
    let s = &report.smoothing;
    let smoothed = told(&[
        (s.loops.iter().filter(|l| l.passes > 0).count(), "loops smoothed"),
        (s.ears_flipped + s.ears_removed, "teeth mended"),
        (s.notches_filled, "notches filled"),
        (s.moved, "vertices moved"),
        (s.held_back, "held back"),
    ]);
    steps.add_row([
        Cell::new("boundary"),
        Cell::new(format!("{smoothed}; at most {} mm", millimetres(s.farthest))),
    ]);
    let size = format!(
        "{} -> {} triangles",
        count(report.before.triangles),
        count(report.after.triangles)
    );
    steps.add_row([Cell::new("in all"), Cell::new(size)]);

    let mut loops =
        new_table(&["loop", "edges", "length cm", "after", "at x, y, z m", "result"], 1, colour);
    let at = |c: [f64; 3]| format!("{:.2}, {:.2}, {:.2}", c[0], c[1], c[2]);
    for (k, l) in s.loops.iter().enumerate() {
        let (before, after) =
            (format!("{:.1}", l.length_before * 1e2), format!("{:.1}", l.boundary.length * 1e2));
        let name = format!("opening {}", k + 1);
        loops.add_row(vec![
            name,
            count(l.boundary.edges),
            before,
            after,
            at(l.boundary.center),
            "kept open".into(),
        ]);
    }
    if s.loops.is_empty() {
        for (k, l) in h.openings.iter().enumerate() {
            let name = format!("opening {}", k + 1);
            loops.add_row(vec![
                name,
                count(l.edges),
                format!("{:.1}", l.length * 1e2),
                String::new(),
                at(l.center),
                "kept open".into(),
            ]);
        }
    }
    let mut holes: Vec<(&LoopShape, &str)> =
        h.filled.iter().map(|f| (&f.boundary, shape(f.shape))).collect();
    holes.extend(h.left.iter().map(|l| (l, "left: no patch fits")));
    holes.sort_by(|a, b| b.0.length.total_cmp(&a.0.length));
    for (k, (l, what)) in holes.iter().take(LOOPS).enumerate() {
        let name = format!("hole {}", k + 1);
        loops.add_row(vec![
            name,
            count(l.edges),
            format!("{:.1}", l.length * 1e2),
            String::new(),
            at(l.center),
            (*what).into(),
        ]);
    }
    let mut text = String::new();
    section(&mut text, "What was done", &steps);
    section(&mut text, "Loops", &loops);
    if holes.len() > LOOPS {
        let _ = writeln!(text, "and {} smaller holes\n", holes.len() - LOOPS);
    }
    text
}

/// Holes that the table lists, the longest first.
const LOOPS: usize = 12;

fn shape(shape: PatchShape) -> &'static str {
    match shape {
        PatchShape::Projected => "filled, on the body",
        PatchShape::Fair => "filled, fair",
        PatchShape::Refined => "filled, refined",
        PatchShape::Plain => "filled, plain",
    }
}

/// What `check` prints.
pub(crate) fn checked(found: &Verification, garments: &[String], colour: bool) -> String {
    let mut table = new_table(
        &[
            "outer",
            "inner",
            "pairs",
            "touching",
            "coplanar",
            "inside",
            "of",
            "deepest mm",
            "least mm",
        ],
        2,
        colour,
    );
    for pair in &found.pairs {
        let bad = |value: usize| judged(count(value), value == 0);
        table.add_row(vec![
            Cell::new(&pair.outer),
            Cell::new(&pair.inner),
            bad(pair.pairs.total()),
            Cell::new(count(pair.pairs.touching)),
            Cell::new(count(pair.pairs.coplanar)),
            bad(pair.vertices_inside),
            Cell::new(count(pair.vertices)),
            Cell::new(millimetres(pair.deepest)),
            Cell::new(distance(pair.least_distance)),
        ]);
    }
    let header = ["layer", "own pairs", "least mm", "of primitives mm"];
    let mut own = new_table(&header, 1, colour);
    own.add_row(vec!["body".into(), count(found.body_own_pairs), String::new(), String::new()]);
    let primitives = found.own_primitive_distances.iter().map(|least| least.map(|d| d.distance));
    let primitives = primitives.map(|d| d.map_or(String::new(), fine_millimetres));
    let garments = garments.iter().zip(&found.own_pairs).zip(&found.own_least_distances);
    for (((name, pairs), least), primitives) in
        garments.zip(primitives.chain(std::iter::repeat(String::new())))
    {
        own.add_row(vec![name.clone(), count(*pairs), distance(*least), primitives]);
    }
    let mut text = String::new();
    section(&mut text, "Layers against those below them", &table);
    section(&mut text, "Layers against themselves (judged with --strict)", &own);
    text
}

/// A least distance in millimetres with two significant digits or more; empty if there is none.
fn distance(least: Option<LeastDistance>) -> String {
    least.map_or(String::new(), |least| fine_millimetres(least.distance))
}

/// A length in millimetres: `0.2871`, and `2.4e-4` if it is below a micrometre.
fn fine_millimetres(length: f64) -> String {
    let mm = length * 1e3;
    if mm >= 1e-3 || mm == 0.0 { format!("{mm:.4}") } else { format!("{mm:.1e}") }
}

/// `Least distance of two layers: 0.2871 mm, 95.7 % of the clearance; of a garment to itself:
/// 0.5312 mm.`, and how layers were moved apart; empty if there is none.
fn least_distances(report: &ResolveReport) -> String {
    let (Some(least), Some(share)) = (report.after.least_distance(), report.clearance_reached)
    else {
        return String::new();
    };
    let own = report.after.own_least_distances.iter().flatten().map(|least| least.distance);
    let own = own.reduce(f64::min);
    let primitives = report.after.own_primitive_distances.iter().flatten();
    let thinnest = primitives.map(|least| least.distance).reduce(f64::min);
    let thinnest =
        thinnest.map(fine_millimetres).filter(|mm| own.map(fine_millimetres).as_ref() != Some(mm));
    let thinnest = thinnest.map_or(String::new(), |least| {
        format!("Of primitives of a garment that share no vertex: {least} mm.\n")
    });
    let own = own.map_or(String::new(), |own| {
        format!("; of a garment to itself: {} mm", fine_millimetres(own))
    });
    let (least, share) = (fine_millimetres(least), 100.0 * share);
    let moved = report.moved_apart.map_or(String::new(), |apart| {
        let [goal, reached, moved] = [apart.goal, apart.reached, apart.moved].map(fine_millimetres);
        format!("Layers were moved apart by at most {moved} mm: to {reached} mm of {goal} mm.\n")
    });
    format!(
        "{moved}Least distance of two layers: {least} mm, {share:.1} % of the clearance{own}.\n\
         {thinnest}"
    )
}

/// A titled table of a name and two columns; a header without words is left out.
pub(crate) fn columns(title: &str, header: [&str; 3], rows: &[(&str, String, String)]) -> String {
    let header = if header.iter().all(|h| h.is_empty()) { &[][..] } else { &header };
    let mut table = new_table(header, 1, false);
    for (name, a, b) in rows {
        table.add_row(vec![Cell::new(name), Cell::new(a), Cell::new(b)]);
    }
    align(&mut table, 1);
    let mut text = String::new();
    section(&mut text, title, &table);
    text
}

/// `711 -> 0 intersecting pairs, 318 -> 0 vertices inside`.
pub(crate) fn totals(before: &Verification, after: &Verification) -> String {
    format!(
        "{} -> {} intersecting pairs, {} -> {} vertices inside",
        count(before.total_pairs()),
        count(after.total_pairs()),
        count(before.total_inside()),
        count(after.total_inside())
    )
}

/// The pairs of layers before and after.
pub(crate) fn pairs_before_after(
    before: &Verification,
    after: &Verification,
    colour: bool,
) -> Table {
    let mut table =
        new_table(&["outer", "inner", "pairs", "vertices inside", "deepest mm"], 2, colour);
    // The two reports list the same ordered pairs of layers.
    let rows: Vec<(&PairReport, &PairReport)> = before.pairs.iter().zip(&after.pairs).collect();
    let pairs = arrows(rows.iter().map(|(b, a)| (count(b.pairs.total()), count(a.pairs.total()))));
    let inside =
        arrows(rows.iter().map(|(b, a)| (count(b.vertices_inside), count(a.vertices_inside))));
    let deepest =
        arrows(rows.iter().map(|(b, a)| (millimetres(b.deepest), millimetres(a.deepest))));
    for (k, (_, a)) in rows.iter().enumerate() {
        table.add_row(vec![
            Cell::new(&a.outer),
            Cell::new(&a.inner),
            judged(pairs[k].clone(), a.pairs.total() == 0),
            judged(inside[k].clone(), a.vertices_inside == 0),
            Cell::new(&deepest[k]),
        ]);
    }
    table
}

fn layers(layers: &[LayerReport], own_before: &[usize], colour: bool) -> Table {
    let header = [
        "layer",
        "moved\nmean",
        "mm\np95",
        "\nmax",
        "strain\nrms",
        "%\np99",
        "\nmax",
        "own\npairs",
        "rounds\n(repairs)",
        "vertices\nskipped",
        "\nseconds",
    ];
    let mut table = new_table(&header, 1, colour);
    let own = arrows(layers.iter().map(|l| (count(l.own_pairs.before), count(l.own_pairs.after))));
    debug_assert!(own_before.is_empty() || own_before.len() == layers.len());
    for (k, layer) in layers.iter().enumerate() {
        table.add_row(vec![
            Cell::new(&layer.name),
            Cell::new(millimetres(layer.moved.mean)),
            Cell::new(millimetres(layer.moved.p95)),
            Cell::new(millimetres(layer.moved.max)),
            Cell::new(percent(layer.strain.rms)),
            Cell::new(percent(layer.strain.p99)),
            Cell::new(percent(layer.strain.max)),
            judged(own[k].clone(), layer.own_pairs.new == 0),
            Cell::new(format!("{} ({})", layer.rounds, layer.repairs)),
            Cell::new(count(layer.skipped.vertices)),
            Cell::new(format!("{:.2}", layer.seconds)),
        ]);
    }
    table
}

/// What was not needed, in one line; nothing where all was.
pub(crate) fn skipped(layers: &[LayerReport]) -> Option<String> {
    let sum = |f: fn(&LayerReport) -> usize| layers.iter().map(f).sum::<usize>();
    let parts = [
        (sum(|l| l.skipped.layers), "pairs of layers that do not meet"),
        (sum(|l| l.skipped.queries), "nearest-point queries"),
        (sum(|l| l.skipped.sweeps), "sweeps"),
    ];
    let parts: Vec<String> = parts
        .iter()
        .filter(|(n, _)| *n > 0)
        .map(|(n, what)| format!("{} {what}", count(*n)))
        .collect();
    (!parts.is_empty()).then(|| format!("Skipped: {}.", parts.join(", ")))
}

/// A table without lines but one under the header. The first `left` columns hold names.
pub(crate) fn new_table(header: &[&str], left: usize, colour: bool) -> Table {
    let mut table = Table::new();
    let style = TableStyle::new()
        .header_lines(ContentLineStyle::none())
        .header_separator(LineStyle::none().fill('-'));
    table.load_style(style.content_lines(ContentLineStyle::none())).force_no_tty();
    if colour {
        table.enforce_styling();
    }
    if !header.is_empty() {
        table.set_header(header.iter().map(Cell::new));
    }
    align(&mut table, left);
    table
}

/// All but the first `left` columns are numbers.
fn align(table: &mut Table, left: usize) {
    for column in table.column_iter_mut().skip(left) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

pub(crate) fn section(text: &mut String, title: &str, table: &Table) {
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{title}\n{}\n", table.trim_fmt());
}

fn judged(text: String, good: bool) -> Cell {
    Cell::new(text).fg(if good { Color::Green } else { Color::Red })
}

/// `before -> after`, with the arrows of all rows in one column.
fn arrows(rows: impl Iterator<Item = (String, String)>) -> Vec<String> {
    let rows: Vec<_> = rows.collect();
    let width = rows.iter().map(|(_, after)| after.len()).max().unwrap_or(0);
    rows.iter().map(|(before, after)| format!("{before} -> {after:>width$}")).collect()
}

/// Digits in groups of three.
pub(crate) fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// How many of a thing there are, such as `1 frame` or `84 frames`.
pub(crate) fn counted(value: usize, thing: &str) -> String {
    format!("{} {thing}{}", count(value), if value == 1 { "" } else { "s" })
}

fn millimetres(metres: f64) -> String {
    format!("{:.2}", metres * 1e3)
}

fn percent(fraction: f64) -> String {
    format!("{:.2}", fraction * 1e2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_mesh::measure::{Displacement, Strain};
    use if_outfit::report::{KeptOwnPair, OwnPairs, PairCount};

    fn pair(outer: &str, inner: &str, crossing: usize) -> PairReport {
        let mut pair = PairReport::default();
        (pair.inner, pair.outer) = (inner.into(), outer.into());
        pair.pairs = PairCount { crossing, ..Default::default() };
        (pair.vertices_inside, pair.vertices, pair.deepest) =
            (crossing / 2, 7703, crossing as f64 * 1e-5);
        pair
    }

    fn report() -> ResolveReport {
        let state = |n: usize| {
            let mut state = Verification::default();
            state.pairs = vec![
                pair("suit_trousers", "body_clean", 29_859 * n),
                pair("suit_jacket", "suit_trousers", 7 * n),
            ];
            state.own_pairs = vec![0, 21];
            state
        };
        let layer = |name: &str| {
            let mut layer = LayerReport::default();
            layer.name = name.into();
            layer.moved = Displacement { mean: 0.001234, p95: 0.0123, max: 0.1234, vertices: 5 };
            layer.strain = Strain { rms: 0.0123, p99: 0.0456, max: 0.4 };
            layer.own_pairs = OwnPairs::new(21, 5, 0);
            (layer.rounds, layer.repairs, layer.sweeps, layer.queries) = (40, 12, 1000, 100_000);
            (layer.tucked, layer.eased) = ([120, 3], [4.0, 0.75]);
            let reason = KeptReason::Layers;
            layer.kept_own_pairs = vec![KeptOwnPair { triangles: [11_111, 12_222], reason }; 5];
            (layer.skipped.layers, layer.skipped.vertices, layer.skipped.queries) = (1, 12_345, 9);
            layer.seconds = 12.345;
            layer
        };
        let mut report = ResolveReport::default();
        (report.before, report.after) = (state(1), state(0));
        let least = |distance| Some(LeastDistance { distance, error: 1e-16, triangles: [0, 1] });
        report.after.pairs[0].least_distance = least(2.4e-7);
        report.after.pairs[1].least_distance = least(0.3e-3);
        report.after.own_least_distances = vec![None, least(0.5312e-3)];
        report.clearance_reached = Some(0.0008);
        report.layers = vec![layer("suit_trousers"), layer("suit_jacket")];
        report.seconds = 1.0;
        report
    }

    #[test]
    fn tables_fit_100_columns_and_are_plain() {
        let report = report();
        let text =
            resolved(&report, false) + &checked(&report.before, &["a".into(), "b".into()], false);
        println!("{text}");
        for line in text.lines() {
            assert!(
                line.chars().count() <= 100 && line.is_ascii() && !line.contains('\x1b'),
                "{line}"
            );
        }
        assert!(text.contains("29,859 -> 0") && text.contains("123.40"), "{text}");
        assert!(
            text.contains(
                "suit_jacket was pressed in below the layers above: 120 -> 3 vertices stick out"
            ),
            "{text}"
        );
        assert!(
            text.contains(
                "suit_jacket keeps 5 own pairs: they came back between the layers:\n  [11111, 12222] "
            ),
            "{text}"
        );
        assert!(
            text.contains(
                "Least distance of two layers: 2.4e-4 mm, 0.1 % of the clearance; of a garment to \
                 itself: 0.5312 mm."
            ),
            "{text}"
        );
        assert!(
            text.contains("suit_jacket was eased where it was drawn: largest strain 400 -> 75 %."),
            "{text}"
        );
        assert_eq!(
            skipped(&report.layers).as_deref(),
            Some("Skipped: 2 pairs of layers that do not meet, 18 nearest-point queries.")
        );
    }

    #[test]
    fn easing_is_printed_where_it_brought_something_with_what_the_result_has() {
        let line = |before, after, now| {
            let strain = Strain { max: now, ..Strain::default() };
            let mut layer = LayerReport::default();
            (layer.name, layer.strain, layer.eased) = ("hood".into(), strain, [before, after]);
            eased(&layer)
        };
        assert_eq!(line(5.204, 5.203, 5.2), None);
        assert_eq!(line(5.2, 5.3, 5.3), None);
        assert_eq!(line(0.0, 0.0, 5.2), None);
        let text = line(5.2, 0.5, 0.5).unwrap();
        assert!(text.ends_with("largest strain 520 -> 50 %.\n"), "{text}");
        let text = line(5.2, 0.5, 0.75).unwrap();
        assert!(text.ends_with("largest strain 520 -> 50 %. The result has 75 %.\n"), "{text}");
    }

    #[test]
    fn digits_stand_in_groups_of_three() {
        for (value, text) in [(0, "0"), (999, "999"), (1000, "1,000"), (1_234_567, "1,234,567")] {
            assert_eq!(count(value), text);
        }
    }
}
