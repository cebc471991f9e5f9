use super::*;
use crate::index::Bvh;
use if_core::shapes::meshes::icosphere;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

fn camera(width: usize, height: usize, eye: Point) -> Camera {
    Camera::looking_at((width, height), &eye, &Point::origin(), &Vector::y(), 0.6).unwrap()
}

/// A ray for each pixel, against all triangles through the tree: slow, and of other formulas.
fn by_rays(mesh: &TriMesh, camera: &Camera) -> Vec<Option<(u32, Real)>> {
    let bvh = Bvh::new(mesh);
    let ray = |at: usize| {
        let (from, direction) = camera.ray(&center(at % camera.width(), at / camera.width()));
        let hit = bvh.first_hit(&from, &(from + direction * FAR), |_| true)?;
        Some((hit.triangle, hit.parameter * FAR))
    };
    (0..camera.width() * camera.height()).map(ray).collect()
}
const FAR: Real = 100.0;

/// Compares with rays; returns how many pixels name another triangle.
fn differences(mesh: &TriMesh, camera: &Camera) -> usize {
    let seen = rasterise(mesh, camera, &RasterParams::default());
    let mut other = 0;
    for (at, ray) in by_rays(mesh, camera).iter().enumerate() {
        let (id, depth) = (seen.triangle[at], Real::from(seen.depth[at]));
        match ray {
            Some((t, z)) if *t == id => assert!(
                (z - depth).abs() < 1e-5 * z,
                "pixel {at}: {z} m by ray, {depth} m by raster"
            ),
            None if id == NOTHING => assert_eq!(seen.depth[at], f32::INFINITY),
            _ => other += 1,
        }
    }
    other
}

#[test]
fn a_ray_for_each_pixel_sees_the_same() {
    let mut sphere = icosphere(0.5, 4);
    // On a sphere of 5 px an edge, centres within 1/1024 px of an edge are one in a thousand.
    let n = differences(&sphere, &camera(97, 64, Point::new(0.4, 0.9, 2.0)));
    assert!(n <= 6, "{n} of 6208 pixels differ");
    // Fine: triangles smaller than a pixel.
    let n = differences(&sphere, &camera(40, 40, Point::new(0.0, -0.2, 6.0)));
    assert!(n <= 6, "{n} of 1600 pixels differ");
    // From inside: every pixel sees the back of a triangle.
    let n = differences(&sphere, &camera(64, 64, Point::new(0.05, 0.1, 0.2)));
    assert!(n <= 6, "{n} of 4096 pixels differ");
    // Corners in the camera's plane and behind it, and far beside the picture.
    let stretched =
        sphere.vertices().iter().map(|p| Point::new(40.0 * p.x, p.y, 40.0 * p.z)).collect();
    sphere = sphere.with_vertices(stretched).unwrap();
    let n = differences(&sphere, &camera(64, 64, Point::new(0.1, 0.3, 0.2)));
    assert!(n <= 6, "{n} of 4096 pixels differ");
}

#[test]
fn random_triangles_that_cross_each_other_are_seen_as_by_rays() {
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let point =
        |rng: &mut Pcg64Mcg| Point::from(Vector::from_fn(|_, _| rng.random_range(-1.0..1.0)));
    let vertices: Vec<Point> = (0..120).map(|_| point(&mut rng)).collect();
    let triangles = (0..40).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    let mesh = TriMesh::new(vertices, triangles).unwrap();
    let n = differences(&mesh, &camera(80, 60, Point::new(0.3, 0.2, 2.5)));
    assert!(n <= 12, "{n} of 4800 pixels differ");
    let n = differences(&mesh, &camera(80, 60, Point::new(0.3, 0.2, 0.5)));
    assert!(n <= 12, "{n} of 4800 pixels differ, from within");
}

/// A flat grid of n × n cells with corners that fall onto pixel centres: as many ties as there can
/// be.
fn grid(n: u32, pixel: Real) -> TriMesh {
    let at = |k: u32| (Real::from(k) - 0.5 * Real::from(n)) * pixel;
    let v = (0..=n).flat_map(|y| (0..=n).map(move |x| Point::new(at(x), at(y), 2.0))).collect();
    let mut t = Vec::new();
    for y in 0..n {
        for x in 0..n {
            let a = y * (n + 1) + x;
            // Diagonals in both directions.
            let (b, c, d) = (a + 1, a + n + 2, a + n + 1);
            t.extend(if (x + y) % 2 == 0 {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            });
        }
    }
    TriMesh::new(v, t).unwrap()
}

#[test]
fn a_tiling_covers_each_centre_once_even_where_edges_run_through_centres() {
    let k = nalgebra::Matrix3::new(64.0, 0.0, 16.5, 0.0, 64.0, 16.5, 0.0, 0.0, 1.0);
    let camera = Camera::new(33, 33, k, nalgebra::Matrix3::identity(), Vector::zeros()).unwrap();
    let mesh = grid(8, 2.0 / 64.0);
    let mut count = vec![0; 33 * 33];
    let mut alone = IdBuffer::default();
    for t in 0..mesh.triangles().len() {
        let one = TriMesh::new(mesh.vertices().to_vec(), vec![mesh.triangles()[t]]).unwrap();
        Rasteriser::default().rasterise(
            &one,
            one.vertices(),
            &camera,
            &RasterParams::default(),
            &mut alone,
        );
        alone.triangle.iter().zip(&mut count).for_each(|(id, n)| *n += u32::from(*id != NOTHING));
    }
    // Corners stand on centres 12 to 20: upper and left border belong to the grid, lower and right
    // do not.
    for (at, n) in count.iter().enumerate() {
        let inside = (12..20).contains(&(at % 33)) && (12..20).contains(&(at / 33));
        assert_eq!(*n, u32::from(inside), "column {} row {}", at % 33, at / 33);
    }
    assert_eq!(
        rasterise(&mesh, &camera, &RasterParams::default())
            .triangle
            .iter()
            .filter(|t| **t != NOTHING)
            .count(),
        64
    );
}

#[test]
fn the_near_plane_cuts_where_it_stands() {
    // A floor that runs under the camera, 1 m below it: pixel row v sees depth f / (v − cy).
    let floor = TriMesh::new(
        vec![
            Point::new(-90.0, 1.0, -50.0),
            Point::new(90.0, 1.0, -50.0),
            Point::new(0.0, 1.0, 500.0),
        ],
        vec![[0, 1, 2]],
    )
    .unwrap();
    let k = nalgebra::Matrix3::new(32.0, 0.0, 16.0, 0.0, 32.0, 16.0, 0.0, 0.0, 1.0);
    let camera = Camera::new(32, 32, k, nalgebra::Matrix3::identity(), Vector::zeros()).unwrap();
    let seen = rasterise(&floor, &camera, &RasterParams { near: 4.0, cull_back: false });
    for row in 0..32 {
        let depth = 32.0 / (row as f32 + 0.5 - 16.0);
        let at = row * 32 + 16;
        let visible = depth >= 4.0;
        assert_eq!(seen.triangle[at] == 0, visible, "row {row}, depth {depth}");
        if visible {
            approx::assert_relative_eq!(seen.depth[at], depth, max_relative = 1e-6);
        }
    }
}

#[test]
fn backs_are_left_out_where_asked_and_hits_say_which_side_is_seen() {
    let sphere = icosphere(0.5, 2);
    let camera = camera(32, 32, Point::new(0.0, 0.0, 2.5));
    let both = rasterise(&sphere, &camera, &RasterParams::default());
    let front =
        rasterise(&sphere, &camera, &RasterParams { cull_back: true, ..RasterParams::default() });
    assert_eq!(both, front, "a closed mesh hides its backs");
    let mut rasteriser = Rasteriser::default();
    let mut out = IdBuffer::default();
    rasteriser.rasterise(&sphere, sphere.vertices(), &camera, &RasterParams::default(), &mut out);
    for (at, &id) in out.triangle.iter().enumerate().filter(|(_, id)| **id != NOTHING) {
        let (column, row) = (at % 32, at / 32);
        let (bary, cos) = rasteriser.hit(&sphere, &camera, id, column, row).unwrap();
        assert!(cos > 0.0);
        // The point projects onto the pixel's centre, but for what the clamp of a centre on an edge
        // moves it.
        let p = if_core::math::barycentric_point(sphere.corners(id as usize), bary);
        let pixel = camera.project(&p).unwrap();
        assert!((pixel - center(column, row)).norm() < 2e-3, "{pixel}");
        approx::assert_relative_eq!(
            camera.to_camera(&p).z,
            Real::from(out.depth[at]),
            max_relative = 1e-4
        );
    }
    let turned = sphere.triangles().iter().map(|t| [t[0], t[2], t[1]]).collect();
    let inside_out = TriMesh::new(sphere.vertices().to_vec(), turned).unwrap();
    let back = rasterise(
        &inside_out,
        &camera,
        &RasterParams { cull_back: true, ..RasterParams::default() },
    );
    assert!(
        back.triangle != both.triangle
            && back.depth.iter().filter(|z| z.is_finite()).all(|z| *z > 2.4)
    );
}

#[test]
fn degenerate_scenes_are_seen_as_nothing() {
    let camera = camera(16, 16, Point::new(0.0, 0.0, 3.0));
    let flat = |v: [Point; 3]| TriMesh::new(v.to_vec(), vec![[0, 1, 2]]).unwrap();
    let o = Point::origin();
    let scenes = [
        TriMesh::default(),
        flat([o; 3]),
        flat([o, Point::new(1.0, 0.0, 0.0), Point::new(0.5, 0.0, 0.0)]),
        flat([Point::new(0.0, 0.0, 3.0), Point::new(1.0, 0.0, 3.0), Point::new(0.0, 1.0, 3.0)]), // in the camera's plane
        flat([Point::new(0.0, 0.0, 9.0), Point::new(1.0, 0.0, 9.0), Point::new(0.0, 1.0, 9.0)]), // behind it
        flat([o, Point::new(0.0, 1.0, 1.0), Point::new(0.0, -1.0, 1.0)]), // from its edge
        flat([
            Point::new(900.0, 0.0, 0.0),
            Point::new(901.0, 0.0, 0.0),
            Point::new(900.0, 1.0, 0.0),
        ]),
    ];
    for (k, mesh) in scenes.iter().enumerate() {
        let seen = rasterise(mesh, &camera, &RasterParams::default());
        assert!(seen.triangle.iter().all(|t| *t == NOTHING), "scene {k}");
    }
}

#[test]
fn threads_and_repetition_change_nothing() {
    let mut sphere = icosphere(0.5, 5);
    // Twice the same surface: ties everywhere.
    let n = sphere.vertices().len() as u32;
    let double = sphere
        .triangles()
        .iter()
        .copied()
        .chain(sphere.triangles().iter().map(|t| t.map(|v| v + n)))
        .collect();
    sphere = TriMesh::new([sphere.vertices(), sphere.vertices()].concat(), double).unwrap();
    let camera = camera(120, 100, Point::new(0.3, 0.4, 1.4));
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let all: Vec<IdBuffer> = [1, 2, 5]
        .map(|n| pool(n).install(|| rasterise(&sphere, &camera, &RasterParams::default())))
        .into();
    assert!(all[0] == all[1] && all[1] == all[2]);
    assert!(
        all[0].triangle.iter().all(|t| *t == NOTHING || *t < sphere.triangles().len() as u32 / 2)
    );
    // Room that was used for another picture before.
    let mut rasteriser = Rasteriser::default();
    let mut out = IdBuffer::default();
    let moved: Vec<Point> = sphere.vertices().iter().map(|p| p * 1.3).collect();
    rasteriser.rasterise(&sphere, &moved, &camera, &RasterParams::default(), &mut out);
    rasteriser.rasterise(&sphere, sphere.vertices(), &camera, &RasterParams::default(), &mut out);
    assert_eq!(out, all[0]);
}
