//! A body that turns before a camera is found again, from pictures of an ellipsoid that have
//! nothing to do with our rasteriser.

#![allow(clippy::unwrap_used)] // also in what the tests share

use if_body::SkinWeights;
use if_body::TemplateBody;
use if_body::{Joint, Pose, Skeleton};
use if_core::math::{Point, Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::monitor::{Progress, Silent};
use if_core::shapes::meshes::icosphere;
use if_mesh::baked::BakeParams;
use if_mesh::camera::Camera;
use if_mesh::ply;
use if_neural::field::NeuralField;
use if_neural::files::read_network;
use if_neural::network::NetworkConfig;
use if_pipeline::capture::{Capture, CaptureWriter, FramePictures, PoseSigma, Subject};
use if_pipeline::reconstruct::{
    MeshMotion, Motion, MotionParams, PhiParams, ReconstructError, ReconstructParams, Skipped,
    Surface, SurfaceParams, fit_motion, fit_surface, reconstruct, write_frames,
};
use nalgebra::{Point2, UnitQuaternion};
use std::ops::ControlFlow;
use std::path::Path;

/// Radii of the clothed body, in metres; the template's are 30 mm smaller.
const RADII: [Real; 3] = [0.25, 0.45, 0.20];
const CENTER: Point = Point::new(0.0, 0.5, 0.0);
const SIDE: usize = 96;
const FRAMES: usize = 12;

fn ellipsoid(radii: [Real; 3]) -> TriMesh {
    let ball = icosphere(1.0, 4);
    let points = ball
        .vertices()
        .iter()
        .map(|p| CENTER + p.coords.component_mul(&Vector::from(radii)))
        .collect();
    ball.with_vertices(points).unwrap()
}

fn template() -> TemplateBody {
    let mesh = ellipsoid(RADII.map(|r| r - 0.03));
    let n = mesh.vertices().len();
    let joint = Joint {
        name: "root".into(),
        parent: None,
        head: Point::new(0.0, 0.4, 0.0),
        tail: Point::new(0.0, 0.6, 0.0),
    };
    TemplateBody {
        mesh,
        skin: SkinWeights::new(vec![[0; 4]; n], vec![[1.0, 0.0, 0.0, 0.0]; n], 1).unwrap(),
        skeleton: Skeleton::new(vec![joint]).unwrap(),
    }
}

/// Two legs within the ellipsoid, 10 cm apart.
fn legs() -> TemplateBody {
    let mut template = template();
    let ball = icosphere(1.0, 4);
    let leg = |x: Real| -> Vec<Point> {
        let middle = CENTER + Vector::new(x, 0.0, 0.0);
        ball.vertices()
            .iter()
            .map(|p| middle + p.coords.component_mul(&Vector::new(0.08, 0.42, 0.10)))
            .collect()
    };
    let mut vertices = leg(-0.13);
    let n = vertices.len() as u32;
    vertices.extend(leg(0.13));
    let one = ball.triangles();
    let triangles = one.iter().copied().chain(one.iter().map(|t| t.map(|v| v + n))).collect();
    template.mesh = TriMesh::new(vertices, triangles).unwrap();
    let n = 2 * n as usize;
    template.skin = SkinWeights::new(vec![[0; 4]; n], vec![[1.0, 0.0, 0.0, 0.0]; n], 1).unwrap();
    template
}

/// Writes the pictures of the turning ellipsoid: `hide` leaves the pictures of that frame empty.
fn pictures(folder: &Path, hide: impl Fn(usize) -> bool) -> Capture {
    labelled(folder, hide, |point| if point.y > CENTER.y { 2 } else { 1 })
}

/// The same with labels of one's own.
fn labelled(folder: &Path, hide: impl Fn(usize) -> bool, label: impl Fn(&Point) -> u8) -> Capture {
    drawn(folder, |frame, from, along| if hide(frame) { None } else { meets(from, along) }, label)
}

/// A camera before the ellipsoid.
fn camera() -> Camera {
    Camera::looking_at((SIDE, SIDE), &Point::new(0.0, 0.6, 3.0), &CENTER, &Vector::y(), 0.36)
        .unwrap()
}

/// Writes pictures of what `hit` says that a ray of a frame meets first, and of which normal, in
/// canonical space.
fn drawn(
    folder: &Path,
    hit: impl Fn(usize, &Point, &Vector) -> Option<(Point, Vector)>,
    label: impl Fn(&Point) -> u8,
) -> Capture {
    let camera = camera();
    let subject = Subject {
        pose_sigma: Some(PoseSigma::EXACT),
        camera_sigma_degrees: Some(0.0),
        camera: camera.clone(),
        garments: vec!["top".into()],
        joints: vec!["root".into()],
        generator: "test".into(),
    };
    let mut writer = CaptureWriter::create(folder, &subject).unwrap();
    let skeleton = template().skeleton;
    for frame in 0..FRAMES {
        let turn = UnitQuaternion::from_axis_angle(
            &Vector::y_axis(),
            std::f64::consts::TAU * frame as Real / FRAMES as Real,
        );
        let pose = Pose {
            root_translation: Vector::new(0.02, 0.0, 0.01 * frame as Real),
            rotations: vec![turn],
        };
        let place = skeleton.transforms(&pose).unwrap()[0];
        let (mut mask, mut labels, mut normals) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..SIDE * SIDE {
            let (from, along) =
                camera.ray(&Point2::new((i % SIDE) as Real + 0.5, (i / SIDE) as Real + 0.5));
            let hit = hit(
                frame,
                &place.inverse_transform_point(&from),
                &place.inverse_transform_vector(&along),
            );
            mask.push(hit.is_some());
            labels.push(hit.map_or(0, |(point, _)| label(&point)));
            normals.push(hit.map_or([0.0; 3], |(_, normal)| {
                let n = camera.rotation() * (place * normal);
                [n.x as f32, n.y as f32, n.z as f32]
            }));
        }
        let pictures = FramePictures {
            mask: &mask,
            labels: &labels,
            normals: &normals,
            noisy_mask: None,
            noisy_labels: None,
        };
        writer.push(&pose, &pictures).unwrap();
    }
    writer.finish().unwrap();
    Capture::open(folder).unwrap()
}

/// Where a ray first meets the ellipsoid, and the normal there.
fn meets(from: &Point, along: &Vector) -> Option<(Point, Vector)> {
    let radii = Vector::from(RADII);
    let (o, d) = ((from - CENTER).component_div(&radii), along.component_div(&radii));
    let (a, b, c) = (d.norm_squared(), o.dot(&d), o.norm_squared() - 1.0);
    let root = b * b - a * c;
    let t = (-b - root.max(0.0).sqrt()) / a;
    let point = from + along * t;
    (root > 0.0).then(|| {
        (point, unit_or_zero(&(point - CENTER).component_div(&radii.component_mul(&radii))))
    })
}

/// How a wave runs over the ellipsoid: 15 mm and less.
const WAVE: Real = 0.05;

/// Of the ellipsoid with a wave: how far out a point is, as a share of its radii, and the slope of
/// that.
fn beyond_wave(frame: usize, p: &Point) -> (Real, Vector) {
    let radii = Vector::from(RADII);
    let q = (p - CENTER).component_div(&radii);
    let phase = 7.0 * q.y + std::f64::consts::TAU * frame as Real / FRAMES as Real;
    let slope = unit_or_zero(&q) - Vector::y() * (7.0 * WAVE * phase.cos());
    (q.norm() - 1.0 - WAVE * phase.sin(), slope.component_div(&radii))
}

/// Where a ray first meets the ellipsoid with a wave, by small steps and halving.
fn meets_wave(frame: usize, from: &Point, along: &Vector) -> Option<(Point, Vector)> {
    let at = |t: Real| from + along * t;
    let nearest = (CENTER - from).dot(along) / along.norm_squared();
    let (step, mut t) = (0.01 / along.norm(), nearest - 0.6 / along.norm());
    while beyond_wave(frame, &at(t)).0 > 0.0 {
        t += step;
        if t > nearest + 0.6 / along.norm() {
            return None;
        }
    }
    let (mut out, mut within) = (t - step, t);
    for _ in 0..20 {
        let middle = 0.5 * (out + within);
        if beyond_wave(frame, &at(middle)).0 > 0.0 { out = middle } else { within = middle }
    }
    Some((at(out), unit_or_zero(&beyond_wave(frame, &at(out)).1)))
}

/// The distance of a point from the ellipsoid, to first order.
fn off(p: &Point) -> Real {
    let radii = Vector::from(RADII);
    let q = (p - CENTER).component_div(&radii);
    (q.norm_squared() - 1.0) / (2.0 * q.component_div(&radii)).norm()
}

fn fit(
    capture: &Capture,
    checkpoint: Option<&Path>,
    stop_at: usize,
) -> Result<Surface, ReconstructError> {
    fit_surface(capture, &template(), &SurfaceParams::default(), checkpoint, &mut |p: &Progress| {
        let stop = p.measure("silhouette_mm").is_some() && p.done >= stop_at;
        if stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
}

#[test]
fn a_template_is_fitted_to_what_was_seen() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |_| false);
    let surface = fit(&capture, None, usize::MAX).unwrap();
    let errors: Vec<Real> = surface.mesh.vertices().iter().map(|p| off(p).abs()).collect();
    let mean = errors.iter().sum::<Real>() / errors.len() as Real;
    // A pixel is 11 mm wide; the template was off by 30 mm.
    assert!(mean < 0.003, "mean {mean}, most {}", errors.iter().copied().fold(0.0, Real::max));
    let report = &surface.report;
    assert_eq!(
        (report.frames, report.skipped.len(), report.rounds.len()),
        (FRAMES, 0, SurfaceParams::default().rounds)
    );
    let sum = report.pixels.no_normal
        + report.pixels.off_surface
        + report.pixels.contradicting
        + report.pixels.used;
    assert_eq!(sum, report.pixels.person);
    assert!(
        report.rounds[0].silhouette_mm > 10.0 * report.rounds[3].silhouette_mm,
        "{:?}",
        report.rounds
    );
}

#[test]
fn a_capture_that_is_too_large_for_memory_is_refused_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |_| false);
    let memory = 22 * (SIDE * SIDE * FRAMES) as u64 - 1;
    let params = SurfaceParams { memory, ..Default::default() };
    let refused = fit_surface(&capture, &template(), &params, None, &mut |_: &Progress| {
        panic!("nothing is read")
    });
    assert!(
        matches!(refused, Err(ReconstructError::Memory { frames: FRAMES, bytes, limit }) if bytes == limit + 1 && limit == memory)
    );
}

#[test]
fn a_stopped_run_goes_on_to_the_same_bits_and_threads_do_not_matter() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |_| false);
    let whole = fit(&capture, None, usize::MAX).unwrap();
    let state = folder.path().join("state");
    let stopped = fit(&capture, Some(&state), 2);
    assert!(matches!(stopped, Err(ReconstructError::Cancelled(_))), "{stopped:?}");
    let resumed = fit(&capture, Some(&state), usize::MAX).unwrap();
    assert_eq!(resumed.mesh, whole.mesh);
    assert_eq!(resumed.report, whole.report);
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(
            pool.install(|| fit(&capture, None, usize::MAX)).unwrap().mesh,
            whole.mesh,
            "{threads} threads"
        );
    }
}

#[test]
fn what_a_skirt_spans_is_filled_and_what_no_garment_spans_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let fitted =
        |capture: &Capture, checkpoint: Option<&Path>, stop_at: usize, least_loose: Real| {
            let params =
                SurfaceParams { loose_cell: 0.02, least_loose, ..SurfaceParams::default() };
            fit_surface(capture, &legs(), &params, checkpoint, &mut |p: &Progress| {
                if p.measure("silhouette_mm").is_some() && p.done >= stop_at {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            })
        };
    let skirt = labelled(&folder.path().join("skirt"), |_| false, |_| 2);
    let usual = SurfaceParams::default();
    let surface = fitted(&skirt, None, usize::MAX, usual.least_loose).unwrap();
    let filled = surface.report.start.filled.as_ref().unwrap();
    assert_eq!(
        (&filled.garments[..], &filled.joints[..]),
        (&["top".to_owned()][..], &["root".to_owned()][..])
    );
    assert!(filled.certain_litres > 1.0 && filled.litres > filled.certain_litres, "{filled:?}");
    assert_eq!(
        (surface.report.rounds.len(), surface.skin.len()),
        (usual.loose_rounds, surface.mesh.vertices().len())
    );
    // One piece, and nowhere far from the ellipsoid, whose middle was between the legs.
    let parts = if_core::edges::parts(&surface.mesh);
    assert!(parts.iter().all(|p| *p == parts[0]));
    let errors: Vec<Real> = surface.mesh.vertices().iter().map(|p| off(p).abs()).collect();
    let (mean, most) = (
        errors.iter().sum::<Real>() / errors.len() as Real,
        errors.iter().copied().fold(0.0, Real::max),
    );
    assert!(mean < 0.004 && most < 0.03, "mean {mean}, most {most}");

    // Stopped, it goes on to the same bits; threads do not matter.
    let state = folder.path().join("state");
    assert!(matches!(
        fitted(&skirt, Some(&state), 2, usual.least_loose),
        Err(ReconstructError::Cancelled(_))
    ));
    let resumed = fitted(&skirt, Some(&state), usize::MAX, usual.least_loose).unwrap();
    assert_eq!((&resumed.mesh, &resumed.report), (&surface.mesh, &surface.report));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(
        pool.install(|| fitted(&skirt, None, usize::MAX, usual.least_loose)).unwrap().mesh,
        surface.mesh
    );

    // Skin spans nothing, and what is not looked for is not found.
    let skin = labelled(&folder.path().join("skin"), |_| false, |_| 1);
    for (capture, least) in [(&skin, usual.least_loose), (&skirt, 1.0)] {
        let surface = fitted(capture, None, usize::MAX, least).unwrap();
        assert!(
            surface.report.start.filled.is_none() && surface.report.start.beside > 0.03,
            "{:?}",
            surface.report.start
        );
        assert_eq!(
            (surface.mesh.triangles(), surface.report.rounds.len()),
            (legs().mesh.triangles(), usual.rounds)
        );
    }
}

#[test]
fn empty_frames_are_left_out_and_named() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |frame| frame == 3 || frame == 7);
    let surface = fit(&capture, None, usize::MAX).unwrap();
    assert_eq!(surface.report.skipped, [3, 7].map(|frame| Skipped::NoPerson { frame, pixels: 0 }));
    let dark = pictures(&folder.path().join("dark"), |_| true);
    let error = fit(&dark, None, usize::MAX).unwrap_err();
    assert!(matches!(error, ReconstructError::NothingSeen { frames: FRAMES, .. }), "{error}");
}

#[test]
fn flipped_axes_of_normals_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let axes = |name: &str, way: Vector| {
        let hit = |_: usize, from: &Point, along: &Vector| {
            meets(from, along).map(|(p, n)| (p, n.component_mul(&way)))
        };
        let capture = drawn(&folder.path().join(name), hit, |_| 1);
        fit(&capture, None, usize::MAX).unwrap().report.normal_axes
    };
    let [x, y, z] = axes("right", Vector::new(1.0, 1.0, 1.0));
    assert!(x.min(y).min(z) > 0.9, "{x} {y} {z}");
    let flipped = axes("flipped", Vector::new(1.0, -1.0, 1.0));
    assert!(flipped[0] > 0.9 && flipped[1] < -0.9 && flipped[2] > 0.9, "{flipped:?}");
}

#[test]
fn frames_that_are_not_used_have_no_vote_and_others_keep_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let hit = |frame: usize, from: &Point, along: &Vector| match frame {
        // In one frame the person is elsewhere, and all is garment.
        2 => meets(&(from + Vector::x() * 0.4), along).map(|(p, n)| (p + Vector::y(), n)),
        // Another one is right, and takes skin for garment.
        5 => meets(from, along).map(|(p, n)| (p + Vector::y(), n)),
        _ => meets(from, along),
    };
    let label = |p: &Point| if p.y > CENTER.y { 2 } else { 1 };
    let capture = drawn(&folder.path().join("capture"), hit, label);
    let params = ReconstructParams { cell: 0.02, ..Default::default() };
    let found = reconstruct(&capture, &template(), &params, None, &mut Silent).unwrap().report;
    let [Skipped::Elsewhere { frame: 2, .. }] = found.surface.skipped[..] else {
        panic!("{:?}", found.surface.skipped)
    };
    let labels = &found.labels;
    assert_eq!(labels.frames_cast + labels.frames_empty + labels.frames_covered, FRAMES - 1);
    let numbers: Vec<u32> = labels.contradictions.iter().map(|c| c.frame).collect();
    assert_eq!(numbers, [5], "{:?}", labels.contradictions);
    assert!(labels.shown["top"].frames > 1 && labels.shown["top"].at_edge == 0, "{labels:?}");
}

fn move_frames(capture: &Capture, surface: &Surface) -> Result<Motion, ReconstructError> {
    let (read, params) = (SurfaceParams::default(), MotionParams::default());
    fit_motion(capture, &template().skeleton, surface, &read, &params, &mut Silent)
}

/// Mean distance from what `truth` says of a frame of the vertices that face its camera, without
/// motion and with it.
fn seen_errors(
    capture: &Capture,
    surface: &Surface,
    motion: &Motion,
    truth: impl Fn(usize, &Point) -> Real,
) -> [Real; 2] {
    let (mut sums, mut count) = ([0.0; 2], 0);
    let eye = camera().center();
    for frame in 0..FRAMES {
        let place = template().skeleton.transforms(capture.pose(frame)).unwrap()[0];
        let eye = place.inverse_transform_point(&eye);
        for (v, n) in surface.mesh.vertex_normals().iter().enumerate() {
            let p = surface.mesh.vertices()[v];
            if n.dot(&(eye - p).normalize()) > 0.3 {
                sums[0] += truth(frame, &p).abs();
                sums[1] += truth(frame, &(p + motion.offsets[frame][v])).abs();
                count += 1;
            }
        }
    }
    sums.map(|s| s / Real::from(count))
}

#[test]
fn a_wave_that_runs_over_the_body_is_followed_in_each_frame() {
    let folder = tempfile::tempdir().unwrap();
    let capture = drawn(&folder.path().join("wave"), meets_wave, |_| 2);
    let surface = fit(&capture, None, usize::MAX).unwrap();
    let motion = move_frames(&capture, &surface).unwrap();
    let truth = |frame: usize, p: &Point| {
        let (beyond, slope) = beyond_wave(frame, p);
        beyond / slope.norm()
    };
    let [without, with] = seen_errors(&capture, &surface, &motion, truth);
    // The wave is 5 mm high on average, half a pixel. What is left of it is 28 %.
    assert!(without > 0.004 && with < 0.31 * without, "{without} {with}");
    let report = &motion.report;
    assert_eq!((report.solved, report.rounds.len(), report.frames.len()), (FRAMES, 3, FRAMES));
    assert!(report.mean_mm > 1.0 && report.max_mm < 40.0, "{report:?}");
    // Threads do not matter.
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        assert_eq!(
            pool.install(|| move_frames(&capture, &surface)).unwrap().offsets,
            motion.offsets,
            "{threads} threads"
        );
    }
    // Frames are written with their motion.
    let carried = MeshMotion::new(motion.clone(), &surface.mesh, surface.mesh.vertices());
    let out = folder.path().join("frames");
    let skeleton = &template().skeleton;
    write_frames(&out, &surface.mesh, &surface.skin, skeleton, &capture, Some(&carried)).unwrap();
    let written = ply::read_path(&out.join("frame_0005.ply")).unwrap().mesh;
    let place = skeleton.transforms(capture.pose(5)).unwrap()[0];
    for (v, p) in written.vertices().iter().enumerate() {
        let expected = place * (surface.mesh.vertices()[v] + motion.offsets[5][v]);
        approx::assert_relative_eq!(*p, expected, epsilon = 1e-6); // written in single precision
    }
}

#[test]
fn a_body_that_does_not_move_is_hardly_moved() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |frame| frame == 3 || frame == 7);
    let surface = fit(&capture, None, usize::MAX).unwrap();
    let motion = move_frames(&capture, &surface).unwrap();
    let [without, with] = seen_errors(&capture, &surface, &motion, |_, p| off(p));
    assert!(with < without + 0.0005, "{without} {with}");
    // Frames that show nothing follow from their neighbours.
    assert_eq!(motion.report.skipped, [3, 7]);
    let frames = &motion.offsets;
    for (v, d) in frames[3].iter().enumerate() {
        let between = (frames[2][v] + frames[4][v]) * 0.5;
        assert!((d - between).norm() < 0.001, "vertex {v}: {d} {between}");
    }
}

#[test]
fn motion_can_be_cancelled_and_invalid_parameters_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let capture = drawn(&folder.path().join("wave"), meets_wave, |_| 2);
    let surface = fit(&capture, None, usize::MAX).unwrap();
    let run = |params: MotionParams, stop_at: usize| {
        let mut heard = 0;
        fit_motion(
            &capture,
            &template().skeleton,
            &surface,
            &SurfaceParams::default(),
            &params,
            &mut |p: &Progress| {
                heard += usize::from(p.stage == "motion");
                if heard > stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        )
    };
    let twice = MotionParams { rounds: 2, ..Default::default() };
    assert!(matches!(run(twice.clone(), 0), Err(ReconstructError::Cancelled(_))));
    let whole = run(twice, usize::MAX).unwrap();
    assert_eq!(whole.report.rounds.len(), 2);
    assert!(
        whole.report.rounds[1].step_mm < whole.report.rounds[0].step_mm,
        "{:?}",
        whole.report.rounds
    );
    let bad = run(MotionParams { bending: 0.0, ..Default::default() }, usize::MAX).unwrap_err();
    assert!(bad.to_string().contains("bending"), "{bad}");
}

#[test]
fn the_upper_half_is_cut_out_as_a_garment_with_one_opening() {
    let folder = tempfile::tempdir().unwrap();
    let capture = pictures(&folder.path().join("capture"), |_| false);
    let mut phi = PhiParams { steps: 5, ..Default::default() };
    if let NetworkConfig::Grid(grid) = &mut phi.network {
        (grid.finest, grid.levels) = (64, 3);
    }
    (phi.sampling.near, phi.sampling.far, phi.sampling.held_out) = (20_000, 2_000, 2_000);
    let motion = Some(MotionParams::default());
    let params = ReconstructParams {
        cell: 0.02,
        phi: Some(phi),
        bake: Some(BakeParams::default()),
        motion,
        ..Default::default()
    };
    let mut stages = std::collections::BTreeSet::new();
    let mut monitor = |p: &Progress| {
        stages.insert(p.stage);
        ControlFlow::Continue(())
    };
    let found = reconstruct(&capture, &template(), &params, None, &mut monitor).unwrap();
    let right = found
        .mesh
        .vertices()
        .iter()
        .zip(&found.labels)
        .filter(|(p, l)| (p.y > CENTER.y) == (**l == 2))
        .count();
    assert!(right as Real > 0.97 * found.labels.len() as Real, "{right} of {}", found.labels.len());
    let [top] = &found.garments[..] else { panic!("{} garments", found.garments.len()) };
    assert_eq!((top.name.as_str(), top.skin.len()), ("top", top.mesh.vertices().len()));
    assert_eq!((found.report.garments[0].openings, found.report.garments[0].holes_left), (1, 0));
    let hem = if_core::edges::Edges::new(&top.mesh).boundary_loops(&top.mesh);
    assert_eq!(hem.len(), 1);
    for v in &hem[0] {
        assert!(
            (top.mesh.vertices()[*v as usize].y - CENTER.y).abs() < 0.02,
            "{}",
            top.mesh.vertices()[*v as usize]
        );
    }
    // The baked field is that of the mesh.
    use if_core::field::SignedDistance;
    let baked = top.phi.as_ref().unwrap();
    let worst = top.mesh.vertices().iter().map(|p| baked.distance(p).abs()).fold(0.0, Real::max);
    assert!(baked.to_bytes().len() < 4_000_000, "{} bytes", baked.to_bytes().len());
    assert!(worst < 0.003, "{worst}");
    // So is the network, from its file.
    let network = found.phi.unwrap();
    let (read, frame) = read_network(&network.to_bytes().unwrap()[..]).unwrap();
    let field = NeuralField::new(read, frame).unwrap();
    let worst = top.mesh.vertices().iter().map(|p| field.distance(p).abs()).fold(0.0, Real::max);
    assert!(
        worst < 0.01 && network.report.mean_mm < 1.0 && network.report.steps == 5,
        "{worst} {:?}",
        network.report
    );
    assert_eq!(found.report.phi, Some(network.report));
    let motion = found.motion.unwrap();
    assert_eq!(motion.offsets(0).len(), found.mesh.vertices().len());
    assert_eq!(found.report.motion.as_ref(), Some(&motion.motion().report));
    assert!(found.report.missing.is_empty() && found.report.labels.frames_cast > 0);
    // All stages report, and cancelling in one of the last stops it.
    for stage in ["read", "surface", "extract", "motion", "phi", "garments", "smooth", "holes"] {
        assert!(stages.contains(stage), "{stage}: {stages:?}");
    }
    let params = ReconstructParams { motion: None, phi: None, bake: None, ..params };
    let stopped = reconstruct(&capture, &template(), &params, None, &mut |p: &Progress| {
        if p.stage == "holes" { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(ReconstructError::Cancelled(_))));
}
