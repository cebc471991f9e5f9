//! Edges in label images.

use crate::raster::IdBuffer;
use if_core::math::Real;
use rayon::prelude::*;

/// For each pixel, whether it is nearer than `margin` pixels to an edge: of labels, of the mesh, or
/// of a difference in depth above `step`.
pub(super) fn image_edges(seen: &IdBuffer, labels: &[u8], margin: usize, step: Real) -> Vec<bool> {
    let (width, height) = (seen.width, seen.height);
    let mut found = vec![false; width * height];
    if margin == 0 {
        return found;
    }
    let step = step as f32;
    let differ = |a: usize, b: usize| {
        let (za, zb) = (seen.depth[a], seen.depth[b]);
        labels[a] != labels[b] || za.is_finite() != zb.is_finite() || (za - zb).abs() > step
    };
    found.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (column, out) in out.iter_mut().enumerate() {
            let at = row * width + column;
            *out = (column > 0 && differ(at, at - 1))
                || (column + 1 < width && differ(at, at + 1))
                || (row > 0 && differ(at, at - width))
                || (row + 1 < height && differ(at, at + width));
        }
    });
    let reach = margin - 1;
    if reach == 0 {
        return found;
    }
    // Dilation by a square of pixels: along rows, then along columns.
    let mut wide = vec![false; width * height];
    wide.par_chunks_mut(width).zip(found.par_chunks(width)).for_each(|(out, row)| {
        for (column, out) in out.iter_mut().enumerate() {
            *out =
                row[column.saturating_sub(reach)..(column + reach + 1).min(width)].contains(&true);
        }
    });
    found.par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(height);
        for (column, out) in out.iter_mut().enumerate() {
            *out = rows.clone().any(|r| wide[r * width + column]);
        }
    });
    found
}
