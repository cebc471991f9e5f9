//! Lines where layers meet the plane of a cut.

use crate::render::scene::{Line, Seen};

/// The pieces of line where triangles cross the plane `n · p = n[3]`.
pub(super) fn lines(layer: &Seen, plane: &[f32; 4]) -> Vec<Line> {
    let height: Vec<f32> = layer
        .points
        .iter()
        .map(|p| plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3])
        .collect();
    let mut out = Vec::new();
    for t in &layer.triangles {
        let mut ends = [[0.0; 3]; 3];
        let mut n = 0;
        for k in 0..3 {
            let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
            if (height[a] < 0.0) != (height[b] < 0.0) {
                let s = height[a] / (height[a] - height[b]);
                ends[n] = [0, 1, 2]
                    .map(|c| layer.points[a][c] + s * (layer.points[b][c] - layer.points[a][c]));
                n += 1;
            }
        }
        if n == 2 {
            out.push(Line { ends: [ends[0], ends[1]], color: layer.color.map(|c| 0.35 * c) });
        }
    }
    out
}
