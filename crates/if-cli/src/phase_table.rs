//! Phases as a table.

use crate::phases::Phase;
use crate::table::{new_table, section};
use comfy_table::Table;

/// The tree of phases, indented, with seconds on the wall and of processors, and how many cores that
/// is on average; then the peak memory, in bytes.
pub(crate) fn phases(total: &Phase, peak_memory: Option<u64>, colour: bool) -> String {
    let header = ["phase", "times", "wall, s", "processor, s", "cores"];
    let mut table = new_table(&header, 1, colour);
    add(&mut table, total, 0);
    let mut text = String::new();
    section(&mut text, "Where the time went", &table);
    if let Some(bytes) = peak_memory {
        text += &format!("Peak memory: {:.0} MiB\n\n", bytes as f64 / 1024.0 / 1024.0);
    }
    text
}

fn add(table: &mut Table, phase: &Phase, depth: usize) {
    let Phase { name, count, wall, processor, phases } = phase;
    let processors = |p: &f64| [format!("{p:.3}"), format!("{:.2}", p / wall.max(1e-9))];
    let [processor, cores] = processor.as_ref().map_or([const { String::new() }; 2], processors);
    let name = format!("{}{name}", "  ".repeat(depth));
    table.add_row([name, count.to_string(), format!("{wall:.3}"), processor, cores]);
    phases.iter().for_each(|phase| add(table, phase, depth + 1));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_are_indented_and_cores_are_their_quotient() {
        let inner = Phase { name: "sweeps", count: 7, wall: 0.5, processor: None, phases: vec![] };
        let phases = vec![inner];
        let total = Phase { name: "total", count: 1, wall: 2.0, processor: Some(3.0), phases };
        let text = super::phases(&total, Some(3 << 20), false);
        let rows: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert!(rows.contains(&vec!["total", "1", "2.000", "3.000", "1.50"]), "{text}");
        assert!(rows.contains(&vec!["sweeps", "7", "0.500"]), "{text}");
        assert!(text.contains("\n   sweeps") && text.ends_with("Peak memory: 3 MiB\n\n"), "{text}");
    }
}
