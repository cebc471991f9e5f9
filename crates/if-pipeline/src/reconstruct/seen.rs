//! Which triangle of a posed mesh each pixel sees.

use if_core::math::{Point, Real};
use if_mesh::camera::Camera;

/// No triangle.
pub(super) const NOTHING: u32 = u32::MAX;

/// The nearest triangle at the centre of each pixel, of triangles whose corners (in the camera's frame) all lie before it.
/// Of equally near ones the first.
pub(super) fn nearest_triangles(camera: &Camera, points: &[Point], triangles: &[[u32; 3]]) -> Vec<u32> {
    let (width, height) = (camera.width(), camera.height());
    let mut seen = vec![NOTHING; width * height];
    let mut nearness = vec![0.0; width * height]; // 1/z is linear in the picture
    let projected: Vec<[Real; 3]> = points
        .iter()
        .map(|p| {
            let pixel = camera.to_pixel(p);
            [pixel.x, pixel.y, 1.0 / p.z]
        })
        .collect();
    for (t, tri) in triangles.iter().enumerate() {
        let [a, b, c] = tri.map(|v| projected[v as usize]);
        if !(a[2] > 0.0 && b[2] > 0.0 && c[2] > 0.0) {
            continue;
        }
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            continue;
        }
        let range = |k: usize, size: usize| {
            let (low, high) = (a[k].min(b[k]).min(c[k]), a[k].max(b[k]).max(c[k]));
            let first = (low - 0.5).ceil().max(0.0);
            let last = (high - 0.5).floor().min(size as Real - 1.0);
            if last < first { 0..0 } else { first as usize..last as usize + 1 }
        };
        for y in range(1, height) {
            for x in range(0, width) {
                let (u, v) = (x as Real + 0.5, y as Real + 0.5);
                let wa = ((b[0] - u) * (c[1] - v) - (b[1] - v) * (c[0] - u)) / area;
                let wb = ((c[0] - u) * (a[1] - v) - (c[1] - v) * (a[0] - u)) / area;
                let wc = 1.0 - wa - wb;
                if wa < 0.0 || wb < 0.0 || wc < 0.0 {
                    continue;
                }
                let near = wa * a[2] + wb * b[2] + wc * c[2];
                let at = y * width + x;
                if near > nearness[at] {
                    (nearness[at], seen[at]) = (near, t as u32);
                }
            }
        }
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::math::Vector;
    use if_core::shapes::meshes;

    #[test]
    fn a_ball_before_a_camera_shows_its_near_side_as_a_disc() {
        let ball = meshes::icosphere(0.5, 4);
        let camera =
            Camera::looking_at((64, 64), &Point::new(0.0, 0.0, 3.0), &Point::origin(), &Vector::y(), 0.5).unwrap();
        let points: Vec<Point> = ball.vertices().iter().map(|p| camera.to_camera(p)).collect();
        let seen = nearest_triangles(&camera, &points, ball.triangles());
        let normals = ball.face_normals();
        let mut pixels = 0.0;
        for t in seen.iter().filter(|t| **t != NOTHING) {
            pixels += 1.0;
            assert!(normals[*t as usize].z > 0.0);
        }
        // The tangent cone: tan of its half angle is r/√(d² − r²).
        let radius = 0.5 / (9.0f64 - 0.25).sqrt() * camera.intrinsics()[(0, 0)];
        let disc = std::f64::consts::PI * radius * radius;
        assert!((pixels / disc - 1.0).abs() < 0.02, "{pixels} {disc}");
        assert_eq!(nearest_triangles(&camera, &[Point::origin(); 3], &[[0, 1, 2]]), vec![NOTHING; 64 * 64]);
    }
}
