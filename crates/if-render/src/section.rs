//! Intersection lines of layers with the plane of a cut.

/// A line segment in the picture.
pub(crate) struct Line {
    /// Ends: samples to the right, samples down, metres away from the eye.
    pub(crate) ends: [[f32; 3]; 2],
    /// Linear red, green and blue.
    pub(crate) color: [f32; 3],
}

/// The segments in which triangles cross the plane `n · p = n[3]`, darker than `color`.
pub(crate) fn lines(
    points: &[[f32; 3]],
    triangles: &[[u32; 3]],
    color: [f32; 3],
    plane: &[f32; 4],
) -> Vec<Line> {
    let height: Vec<f32> = points
        .iter()
        .map(|p| plane[0] * p[0] + plane[1] * p[1] + plane[2] * p[2] - plane[3])
        .collect();
    let mut out = Vec::new();
    for t in triangles {
        let mut ends = [[0.0; 3]; 3];
        let mut n = 0;
        for k in 0..3 {
            let (a, b) = (t[k] as usize, t[(k + 1) % 3] as usize);
            if (height[a] < 0.0) != (height[b] < 0.0) {
                let s = height[a] / (height[a] - height[b]);
                ends[n] = [0, 1, 2].map(|c| points[a][c] + s * (points[b][c] - points[a][c]));
                n += 1;
            }
        }
        if n == 2 {
            out.push(Line { ends: [ends[0], ends[1]], color: color.map(|c| 0.35 * c) });
        }
    }
    out
}
