//! One picture a problem: error over time, both logarithmic, a colour for each method, a line along
//! the Pareto front.

use crate::row::{Row, front};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// Below the smallest error that is not zero by this factor stands zero: a logarithm needs
/// something.
const ZERO: f64 = 0.1;
/// The least that is drawn.
const LEAST: f64 = 1e-17;
const SIZE: (u32, u32) = (760, 480);
const COLORS: [RGBColor; 8] = [
    RGBColor(27, 118, 181),
    RGBColor(217, 95, 2),
    RGBColor(44, 160, 80),
    RGBColor(190, 50, 60),
    RGBColor(130, 90, 180),
    RGBColor(120, 80, 60),
    RGBColor(200, 110, 170),
    RGBColor(90, 90, 90),
];

pub(crate) fn draw(path: &Path, title: &str, rows: &[&Row]) -> Result<(), Box<dyn Error>> {
    let rows: Vec<&Row> = rows.iter().copied().filter(|r| r.error.is_finite()).collect();
    let Some(first) = rows.first() else { return Ok(()) };
    let unit = if first.unit.is_empty() { "relative" } else { first.unit };
    let smallest = rows.iter().map(|r| r.error).filter(|e| *e > 0.0).fold(1.0, f64::min);
    let least = (ZERO * smallest).max(LEAST);
    let at = |r: &Row| (r.milliseconds.max(1e-6), r.error.max(least));
    let range = |values: Vec<f64>| {
        let (low, high) =
            values.iter().fold((f64::INFINITY, 0.0f64), |(l, h), v| (l.min(*v), h.max(*v)));
        (low / 2.0)..(high * 2.0)
    };
    let root = SVGBackend::new(path, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&root)
        .caption(title, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(70)
        .build_cartesian_2d(
            range(rows.iter().map(|r| at(r).0).collect()).log_scale(),
            range(rows.iter().map(|r| at(r).1).collect()).log_scale(),
        )?;
    chart
        .configure_mesh()
        .x_desc("milliseconds")
        .y_desc(format!("error, {unit}"))
        .x_label_formatter(&|v| format!("{v:.0e}"))
        .y_label_formatter(&|v| format!("{v:.0e}"))
        .light_line_style(WHITE)
        .draw()?;
    chart.draw_series(LineSeries::new(
        front(&rows).into_iter().map(at),
        BLACK.mix(0.35).stroke_width(1),
    ))?;
    let mut methods: Vec<&str> = Vec::new();
    for row in &rows {
        if !methods.contains(&row.method.as_str()) {
            methods.push(&row.method);
        }
    }
    for (k, method) in methods.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        let of = |r: &&&Row| r.method == *method;
        chart
            .draw_series(rows.iter().filter(of).map(|r| Circle::new(at(r), 4, color.filled())))?
            .label(*method)
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, color.filled()));
        chart.draw_series(
            rows.iter().filter(of).filter(|r| r.default).map(|r| Circle::new(at(r), 8, color)),
        )?;
    }
    chart
        .configure_series_labels()
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    root.present()?;
    Ok(())
}
