use super::*;
use if_body::mannequin::{self, Garment, MannequinParams, rig};
use if_body::{Pose, SkinError, SkinWeights};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::{Cancelled, Progress, Silent};
use if_core::nalgebra::UnitQuaternion;
use if_outfit::motion::{WalkParams, Walker};
use if_outfit::{Layer, Outfit, Pinch};

/// The mannequin in trousers; weights of the body alone.
pub(super) fn outfit() -> SkinnedOutfit {
    let params = MannequinParams { resolution: 0.7, overlap: 0.0 };
    let body = mannequin::body(&params);
    let trousers = mannequin::garment(Garment::Trousers, &params);
    let skin = rig::skin_weights(body.vertices());
    let outfit =
        Outfit::new(Layer::new("body", body), vec![Layer::new("trousers", trousers)]).unwrap();
    SkinnedOutfit::new(outfit, rig::skeleton(), vec![Some(skin), None]).unwrap()
}

/// One knee is lifted, frame by frame.
pub(super) fn motion(frames: usize) -> Motion {
    let pose = |k: usize| {
        let mut pose = Pose::rest(rig::skeleton().len());
        let thigh = rig::skeleton().names().position(|n| n == "left_thigh").unwrap();
        let angle = -0.5 - 0.08 * k as f64;
        pose.rotations[thigh] = UnitQuaternion::from_axis_angle(&Vector::x_axis(), angle);
        pose.root_translation.z = 0.01 * k as f64;
        pose
    };
    Motion::new(30.0, (0..frames).map(pose).collect()).unwrap()
}

/// Cancels when so many frames of a stage are done.
struct After(&'static str, usize);

impl Monitor for After {
    fn report(&mut self, progress: &Progress<'_>) -> Result<(), Cancelled> {
        let stops = progress.stage == self.0 && progress.done >= self.1;
        if stops { Err(Cancelled) } else { Ok(()) }
    }
}

#[test]
fn a_run_that_was_stopped_goes_on_with_the_same_bits() {
    let (outfit, motion) = (outfit(), motion(4));
    let params = AnimateParams::default();
    let [whole, parts] = [0, 1].map(|_| tempfile::tempdir().unwrap());
    let all = animate(&outfit, &motion, &params, whole.path(), &mut Silent).unwrap();
    assert_eq!((all.report.clean, all.report.kept), (4, 0), "{:?}", all.report);
    let first = &all.report.frames[0];
    assert!(first.pairs_before > 0 && first.reached && first.moved.max > 0.0, "{first:?}");
    assert_eq!(first.jitter.max, 0.0);
    assert!(all.report.frames[1].jitter.max > 0.0 && all.report.jitter_max < 0.02);
    let displaced: Vec<Real> = all.report.frames.iter().map(|f| f.body.moved.max).collect();
    for (two, row) in displaced.windows(2).zip(&all.report.frames[1..]) {
        let (least, most) = ((two[1] - two[0]).abs(), two[0] + two[1]);
        assert!((least - 1e-6..=most + 1e-6).contains(&row.body.jitter), "{two:?} {row:?}");
    }
    let jitter = all.report.frames.iter().map(|f| f.body.jitter);
    assert_eq!(all.report.body_jitter, jitter.fold(0.0, Real::max));
    assert!(all.report.body_jitter > 0.0);

    let walked = |folder: &Path, frame| folder.join(format!("walked/{frame:06}.frame")).exists();
    // Each of two threads does at most one frame more.
    for stop in [After("walked", 1), After("frame", 1)] {
        let stage = stop.0;
        let stopped = animate(&outfit, &motion, &params, parts.path(), &mut { stop });
        assert!(matches!(stopped, Err(AnimateError::Cancelled(_))));
        assert!(walked(parts.path(), 0));
        assert_eq!(walked(parts.path(), 2), stage == "frame");
    }
    let rest = animate(&outfit, &motion, &params, parts.path(), &mut Silent).unwrap();
    assert!((1..4).contains(&rest.report.kept), "{}", rest.report.kept);
    for frame in 0..4 {
        let [a, b] = [&all, &rest].map(|a| a.frames.positions(frame).unwrap());
        assert!(a == b, "frame {frame}");
        assert!(!walked(parts.path(), frame), "no frame needs it any more");
        assert_eq!(rest.report.frames[frame].shake, all.report.frames[frame].shake);
    }
    // Layers are parts of all positions, and there is no fifth frame.
    let layers = all.frames.layers(2).unwrap();
    let counts: Vec<usize> = layers.iter().map(Vec::len).collect();
    assert_eq!(counts, outfit.outfit.layers().map(|l| l.mesh.vertices().len()).collect::<Vec<_>>());
    assert_eq!(layers.concat(), all.frames.positions(2).unwrap());
    assert!(matches!(all.frames.layers(4), Err(AnimateError::Frame { frame: 4, frames: 4 })));
    // The difference of two frames, in single precision, leads from one to the other.
    let [a, b] = [0, 2].map(|frame| all.frames.positions(frame).unwrap());
    for (a, b) in a.iter().zip(&b) {
        let [a, b] = [a, b].map(|p| p.map(|x| x as f32));
        assert_eq!(a + (b - a), b);
    }
    // A frame that was changed is computed again, and so is everything after another motion.
    let path = parts.path().join("000001.frame");
    let mut bytes = std::fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&path, bytes).unwrap();
    assert!(matches!(rest.frames.positions(1), Err(AnimateError::Changed { .. })));
    let again = animate(&outfit, &motion, &params, parts.path(), &mut Silent).unwrap();
    assert_eq!(again.report.kept, 3);
    assert!((0..4).all(|k| again.frames.positions(k).unwrap() == all.frames.positions(k).unwrap()));
    assert_eq!(again.report.frames[2].jitter, all.report.frames[2].jitter);
    let faster = Motion { frames_per_second: 60.0, ..motion.clone() };
    let frames = Frames::open(whole.path(), Movement::poses(&outfit, &faster), &params).unwrap();
    assert!(frames.stored(0).is_none());
}

#[test]
fn a_run_goes_on_from_its_own_state_alone() {
    let (outfit, motion) = (outfit(), motion(4));
    let params = AnimateParams { run: 2, ..AnimateParams::default() };
    let folder = tempfile::tempdir().unwrap();
    animate(&outfit, &motion, &params, folder.path(), &mut After("frame", 0)).unwrap_err();
    let faster = Motion { frames_per_second: 60.0, ..motion.clone() };
    let walks = |motion: &Motion| {
        let movement = Movement::poses(&outfit, motion);
        Work::open(movement, &params, folder.path()).unwrap().walks(&[0, 1, 2, 3])
    };
    assert_eq!(walks(&faster), [0..2, 2..4]);
    assert_eq!(walks(&motion), []);
    // What is missing of a run is walked to from the state after it, if that is of the frame before.
    let remove =
        |name: &str| std::fs::remove_file(folder.path().join("walked").join(name)).unwrap();
    remove("000003.frame");
    assert!(walks(&motion).iter().eq([&(2..4)]));
    remove("000000.state");
    assert_eq!(walks(&motion), [0..2, 2..4]);
}

#[test]
fn runs_and_parts_give_the_same_bits_on_any_number_of_threads() {
    let (outfit, motion) = (outfit(), motion(5));
    let movement = Movement::poses(&outfit, &motion);
    // Each frame depends on the two before and after.
    let params = AnimateParams { smoothing: 1.0 / 30.0, run: 2, ..AnimateParams::default() };
    let [one, three, parts] = [0, 1, 2].map(|_| tempfile::tempdir().unwrap());
    let on = |threads: usize, folder: &Path| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| follow(movement, &params, folder, &mut Silent)).unwrap()
    };
    let all = on(1, one.path());
    assert_eq!((all.report.clean, all.report.kept), (5, 0));
    let restarted: Vec<bool> = all.report.frames.iter().map(|f| f.restarted).collect();
    assert_eq!(restarted, [true, true, false, true, false], "runs of 1, 2 and 2 frames");
    for part in [3..5, 0..1, 1..3] {
        let new = follow_part(movement, &params, part.clone(), parts.path(), &mut Silent).unwrap();
        assert_eq!(new, part.len());
        assert_eq!(follow_part(movement, &params, part, parts.path(), &mut Silent).unwrap(), 0);
    }
    for (other, kept) in [(on(3, three.path()), 0), (on(2, parts.path()), 5)] {
        assert_eq!(other.report.kept, kept);
        for k in 0..5 {
            assert!(all.frames.positions(k).unwrap() == other.frames.positions(k).unwrap());
            let [a, b] =
                [&all, &other].map(|a| FrameReport { seconds: 0.0, ..a.report.frames[k].clone() });
            assert_eq!(a, b);
        }
    }
    // The first part alone walks to no more than it depends on.
    let alone = tempfile::tempdir().unwrap();
    follow_part(movement, &params, 0..1, alone.path(), &mut Silent).unwrap();
    let there = |k: &usize| alone.path().join(format!("walked/{k:06}.frame")).exists();
    assert_eq!((0..5).filter(there).collect::<Vec<_>>(), [0, 1, 2]);
}

#[test]
fn smoothed_frames_tremble_less_and_are_as_clean() {
    let outfit = outfit();
    let mut motion = motion(5);
    // The knee goes up and down from frame to frame, and what is displaced with it.
    for (k, pose) in motion.poses.iter_mut().enumerate() {
        pose.root_translation.z = 0.0;
        let turn = UnitQuaternion::from_axis_angle(&Vector::x_axis(), 0.1 * (k % 2) as f64);
        let thigh = rig::skeleton().names().position(|n| n == "left_thigh").unwrap();
        pose.rotations[thigh] *= turn;
    }
    let run = |frames: f64| {
        let folder = tempfile::tempdir().unwrap();
        let smoothing = frames / motion.frames_per_second;
        let params = AnimateParams { smoothing, ..AnimateParams::default() };
        animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap().report
    };
    let [walked, smoothed] = [0.0, 2.0].map(run);
    assert_eq!((walked.clean, smoothed.clean), (5, 5));
    assert!(walked.frames.iter().all(|f| !f.smoothed));
    assert!(smoothed.frames.iter().all(|f| f.smoothed));
    let [a, b] =
        [&walked, &smoothed].map(|r| r.frames[2..].iter().map(|f| f.shake.mean).sum::<f64>());
    assert!(b < 0.7 * a, "{b} {a}");
    // Frames that lie far apart have nothing in common.
    let params = AnimateParams::default();
    assert_eq!(params.smoothed_frames(30.0), 12);
    assert_eq!(params.smoothed_frames(4.0), 0);
}

#[test]
fn the_body_is_displaced_by_no_more_than_it_may_be() {
    let (outfit, mut motion) = (outfit(), motion(1));
    // The thigh meets the belly.
    let thigh = rig::skeleton().names().position(|n| n == "left_thigh").unwrap();
    let lifted = UnitQuaternion::from_axis_angle(&Vector::x_axis(), -1.7);
    motion.poses[0].rotations[thigh] = lifted;
    let run = |params: AnimateParams| {
        let folder = tempfile::tempdir().unwrap();
        animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap().report
    };
    let free = run(AnimateParams::default());
    assert!(free.body_max > 1e-3 && free.frames.iter().all(|f| f.pinch.is_none()), "{free:?}");
    let bound = 0.5 * free.body_max;
    let bounded = run(AnimateParams { body_depth: bound, ..AnimateParams::default() });
    assert!(bounded.body_max < bound + 1e-6 && bounded.clean == 1, "{bounded:?}");
    assert!(bounded.frames.iter().any(|f| f.pinch.is_some()));
    let kept = run(AnimateParams { pinch: Pinch::Keep, ..AnimateParams::default() });
    assert!(kept.body_max < 1e-6 && kept.clean == 1, "{kept:?}");
    let mut idle = AnimateParams::default();
    idle.walk.sweeps = 0;
    assert!(idle.validate().is_err());
    let none = AnimateParams { body_depth: 0.0, ..AnimateParams::default() };
    assert!(none.validate().is_err());
}

#[test]
fn invalid_outfits_and_motions_are_typed_errors() {
    let good = outfit();
    let bare = SkinnedOutfit::new(good.outfit.clone(), rig::skeleton(), vec![None, None]);
    let error = bare.unwrap_err();
    assert!(error.layer == "body" && error.source == SkinError::NoWeights);
    let few = rig::skin_weights(&good.positions()[..5]);
    let error = SkinnedOutfit::new(good.outfit.clone(), rig::skeleton(), vec![Some(few), None]);
    assert!(matches!(error.unwrap_err().source, SkinError::Count { .. }));
    assert_eq!(good.without_weights, ["trousers"]);

    let params = AnimateParams::default();
    let mut wrong = motion(2);
    wrong.poses[1] = Pose::rest(4);
    let error = Animator::new(Movement::poses(&good, &wrong), params).unwrap_err();
    assert!(matches!(error, AnimateError::Pose { frame: 1, .. }), "{error}");
    let motion = motion(1);
    let movement = Movement::poses(&good, &motion);
    let error = Animator::new(movement, AnimateParams { turn: f64::NAN, ..params });
    assert!(matches!(error, Err(AnimateError::Parameter(_))));
}

#[test]
fn what_makes_a_frame_unclean_is_named_with_its_place() {
    let (outfit, motion) = (outfit(), motion(1));
    let walker = Walker::new(&outfit.outfit, WalkParams::default()).unwrap();
    let mut positions = outfit.positions();
    let body = outfit.outfit.body.mesh.vertices().len();
    for p in &mut positions[body..] {
        (p.x, p.z) = (0.6 * p.x, 0.6 * p.z);
    }
    let measurer = measure::Measurer::new(Movement::poses(&outfit, &motion));
    let row = measurer.verify(&walker, &positions).unwrap();
    assert!(row.pairs > 8 && row.inside > 8, "{row:?}");
    assert_eq!((row.first_pairs.len(), row.first_inside.len()), (8, 8));
    assert!(row.first_pairs.iter().all(|pair| pair.layers == ["body", "trousers"]));
    for found in &row.first_inside {
        assert_eq!((&found.layer[..], &found.below[..]), ("trousers", "body"));
        assert_eq!(Point::from(found.place), positions[body + found.vertex as usize]);
    }
    let clean = measurer.verify(&walker, &outfit.positions()).unwrap();
    assert!(clean.first_pairs.is_empty() && clean.first_inside.is_empty());
}

#[test]
fn the_skeleton_of_another_body_is_noticed() {
    let mut outfit = outfit();
    assert_eq!(outfit.misplaced_skeleton(), None);
    let own = outfit.skeleton.clone();
    let mut scaled = |by: f64| {
        let joint = |joint: &if_body::Joint| if_body::Joint {
            head: Point::from(joint.head.coords * by),
            ..joint.clone()
        };
        outfit.skeleton = if_body::Skeleton::new(own.joints().iter().map(joint).collect()).unwrap();
        outfit.misplaced_skeleton()
    };
    assert_eq!(scaled(1.01), None);
    for by in [0.9, 1.1] {
        let median = scaled(by);
        assert!(median.is_some_and(|median| (0.05..0.15).contains(&median)), "{by} {median:?}");
    }
}

/// A thin limb that turns about a joint 10 m behind it, and a sheet of cloth beside it that does not
/// follow.
fn limb_and_cloth() -> SkinnedOutfit {
    let limb = if_core::shapes::meshes::tube(0.004, 0.3, 8, 8, true);
    let joint = |name: &str, parent| if_body::Joint {
        name: name.into(),
        parent,
        head: Point::new(0.0, 0.0, -10.0),
        tail: Point::origin(),
    };
    let skeleton = if_body::Skeleton::new(vec![joint("root", None), joint("limb", Some(0))]);
    let n = 12;
    let vertices = (0..n * n).map(|k| {
        let at = |i: u32| 0.2 * (f64::from(i) / f64::from(n - 1) - 0.5);
        Point::new(0.12, at(k % n), at(k / n))
    });
    let corners = (0..(n - 1) * (n - 1)).map(|k| k / (n - 1) * n + k % (n - 1));
    let cells = corners.flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]);
    let cloth = TriMesh::new(vertices.collect(), cells.collect()).unwrap();
    let skin = |mesh: &TriMesh, joint: u16| {
        let n = mesh.vertices().len();
        SkinWeights::new(vec![[joint, 0, 0, 0]; n], vec![[1.0, 0.0, 0.0, 0.0]; n], 2).unwrap()
    };
    let skins = vec![Some(skin(&limb, 1)), Some(skin(&cloth, 0))];
    let outfit = Outfit::new(Layer::new("limb", limb), vec![Layer::new("cloth", cloth)]).unwrap();
    SkinnedOutfit::new(outfit, skeleton.unwrap(), skins).unwrap()
}

#[test]
fn cloth_makes_way_before_a_limb_comes() {
    let outfit = limb_and_cloth();
    // The limb, 4 mm thick, comes 6 mm beyond the cloth from one frame to the next.
    let pose = |frame: usize| {
        let mut pose = Pose::rest(2);
        let shift = if frame < 6 { 0.1125 } else { 0.122 };
        pose.rotations[1] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 0.1 * shift);
        pose
    };
    let motion = Motion::new(30.0, (0..12).map(pose).collect()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let params = AnimateParams { smoothing: 4.0 / 30.0, ..AnimateParams::default() };
    let done = animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap().report;
    assert_eq!(done.clean_everywhere, 12);
    let pushed = done.frames[6].moved.max;
    assert!(pushed > 0.006 && done.frames[0].moved.max < 0.001, "{pushed}");
    // The mean of nine frames alone, with weights 1 to 5, leaves three fifths of it to one frame.
    assert!(done.jitter_max < 0.4 * pushed, "{} {pushed}", done.jitter_max);
}

#[test]
fn a_limb_that_jumps_through_cloth_between_clean_frames_is_found() {
    let outfit = limb_and_cloth();
    // The limb is at these distances, in metres.
    let between = |shifts: &[f64]| {
        let pose = |shift: &f64| {
            let mut pose = Pose::rest(2);
            pose.rotations[1] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), 0.1 * shift);
            pose
        };
        let poses = shifts.iter().map(pose).collect();
        let motion = Motion::new(30.0, poses).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let params = AnimateParams { smoothing: 0.0, ..AnimateParams::default() };
        let done = animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap();
        assert_eq!(done.report.clean_everywhere, shifts.len());
        between_frames(&outfit.outfit, &done.frames, &mut Silent).unwrap()
    };
    let jump = between(&[0.0, 0.24, 0.25]);
    assert_eq!((jump.len(), jump[1].is_clean()), (2, true), "{jump:?}");
    let first = &jump[0].first[0];
    assert!(jump[0].crossings > 10 && first.layers == ["limb", "cloth"], "{first:?}");
    assert!((first.share - 0.116 / 0.24).abs() < 0.01, "{first:?}");
    // Up to the cloth and back.
    assert!(between(&[0.0, 0.05, 0.1, 0.05]).iter().all(IntervalReport::is_clean));
}

#[test]
fn a_body_that_turns_round_between_frames_is_not_examined_to_the_end() {
    let outfit = outfit();
    let turned = |angle: f64| {
        let mut pose = Pose::rest(rig::skeleton().len());
        pose.rotations[0] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), angle);
        pose
    };
    let motion = Motion::new(30.0, vec![turned(0.0), turned(std::f64::consts::PI)]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let done =
        animate(&outfit, &motion, &AnimateParams::default(), folder.path(), &mut Silent).unwrap();
    assert_eq!((done.report.clean, &done.report.cuts[..]), (2, &[1][..]));
    let found = between_frames(&outfit.outfit, &done.frames, &mut Silent).unwrap();
    let [one] = &found[..] else { panic!("{found:?}") };
    assert!(one.more_than == Some(10_000) && !one.is_clean() && one.first.is_empty(), "{one:?}");
    let stop = &mut After("between frames", 0);
    let stopped = between_frames(&outfit.outfit, &done.frames, stop);
    assert!(matches!(stopped, Err(AnimateError::Cancelled(_))), "{stopped:?}");
}

#[test]
fn a_cut_parts_a_motion() {
    let outfit = outfit();
    // The knee, then a step to the side with the knee high.
    let mut whole = motion(6);
    for pose in &mut whole.poses[3..] {
        pose.root_translation.x += 0.6;
        let thigh = rig::skeleton().names().position(|n| n == "left_thigh").unwrap();
        pose.rotations[thigh] *= UnitQuaternion::from_axis_angle(&Vector::x_axis(), -0.5);
    }
    let run = |motion: &Motion| {
        let folder = tempfile::tempdir().unwrap();
        let params = AnimateParams::default();
        let done = animate(&outfit, motion, &params, folder.path(), &mut Silent).unwrap();
        let frames: Vec<_> =
            (0..done.frames.len()).map(|k| done.frames.positions(k).unwrap()).collect();
        (done.report, frames)
    };
    let (report, frames) = run(&whole);
    assert_eq!((report.clean, &report.cuts[..]), (6, &[3][..]));
    let restarted: Vec<bool> = report.frames.iter().map(|f| f.restarted).collect();
    assert_eq!(restarted, [true, false, false, true, false, false]);
    assert!(report.frames[2].jitter.max > 0.0 && report.frames[3].jitter.max == 0.0);
    // Each part is as it is alone, but for rounding.
    let [first, second] =
        [0..3, 3..6].map(|part| run(&Motion::new(30.0, whole.poses[part].to_vec()).unwrap()));
    assert!(first.0.cuts.is_empty() && second.0.cuts.is_empty());
    for (k, (a, b)) in frames.iter().zip(first.1.iter().chain(&second.1)).enumerate() {
        let far = a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(far < 1e-4, "frame {k}: {far}");
    }
}

#[test]
fn a_folder_in_which_another_keeps_frames_is_busy() {
    let (outfit, motion) = (outfit(), motion(2));
    let folder = tempfile::tempdir().unwrap();
    let params = AnimateParams::default();
    let other = if_mesh::atomic::FolderWriter::open(folder.path()).unwrap().unwrap();
    let found = animate(&outfit, &motion, &params, folder.path(), &mut Silent);
    assert!(matches!(found, Err(AnimateError::Busy { path }) if path == folder.path()));
    drop(other);
    animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap();
    let left = std::fs::read_dir(folder.path()).unwrap().map(|f| f.unwrap().file_name());
    assert!(left.into_iter().all(|name| !name.to_string_lossy().starts_with('.')));
}

#[test]
fn motions_made_by_hand_are_checked_as_files_are() {
    let (outfit, good) = (outfit(), motion(3));
    let folder = tempfile::tempdir().unwrap();
    let fault = |motion: &Motion| {
        let params = AnimateParams::default();
        animate(&outfit, motion, &params, folder.path(), &mut Silent).unwrap_err()
    };
    for rate in [0.0, -30.0, f64::NAN, f64::INFINITY, 1e-300, 1e300] {
        let motion = Motion { frames_per_second: rate, ..good.clone() };
        let found = fault(&motion);
        assert!(matches!(found, AnimateError::Rate(r) if r.to_bits() == rate.to_bits()), "{found}");
    }
    let mut motion = good.clone();
    motion.poses[1].root_translation.x = f64::NAN;
    assert!(
        fault(&motion).to_string().starts_with("frame 1 of the motion: the pose moves the root")
    );
    motion = good.clone();
    motion.poses[2].rotations.pop();
    assert!(fault(&motion).to_string().starts_with("frame 2 of the motion: the pose has"));
    // In millimetres, or of a whole country.
    motion = good;
    motion.poses[2].root_translation.z = 900.0;
    let found = fault(&motion);
    assert!(
        matches!(found, AnimateError::Far { frame: 2, distance } if distance > 899.0),
        "{found}"
    );
}

#[test]
fn a_vertex_of_no_triangle_that_frames_cannot_store_is_named() {
    let mut outfit = outfit();
    let garment = &mut outfit.outfit.garments[0];
    let far = [garment.mesh.vertices(), &[Point::new(0.0, 1e39, 0.0)]].concat();
    let vertex = far.len() - 1;
    garment.mesh = TriMesh::new(far, garment.mesh.triangles().to_vec()).unwrap();
    let name = garment.name.clone();
    let skin = rig::skin_weights(outfit.outfit.body.mesh.vertices());
    let weights = vec![Some(skin), None];
    let outfit = SkinnedOutfit::new(outfit.outfit, outfit.skeleton, weights).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let params = AnimateParams::default();
    let found = animate(&outfit, &motion(2), &params, folder.path(), &mut Silent).unwrap_err();
    assert!(
        matches!(&found, AnimateError::Vertex { layer, vertex: v, .. } if *layer == name && *v == vertex),
        "{found}"
    );
}

#[test]
fn a_limb_that_goes_into_the_body_far_from_cloth_does_not_hold_the_cloth_back() {
    let SkinnedOutfit { outfit, skeleton, .. } = limb_and_cloth();
    // A ball of the body, into which the limb goes as it leaves the cloth.
    let ball = if_core::shapes::meshes::icosphere(0.01, 2);
    let limb = &outfit.body.mesh;
    let count = limb.vertices().len();
    let beside = ball.vertices().iter().map(|p| p - Vector::x() * 0.03);
    let vertices = limb.vertices().iter().copied().chain(beside).collect();
    let triangles = ball.triangles().iter().map(|t| t.map(|v| v + count as u32));
    let triangles = limb.triangles().iter().copied().chain(triangles).collect();
    let body = TriMesh::new(vertices, triangles).unwrap();
    let joints = (0..body.vertices().len()).map(|v| [u16::from(v < count), 0, 0, 0]).collect();
    let weights = vec![[1.0, 0.0, 0.0, 0.0]; body.vertices().len()];
    let skin = SkinWeights::new(joints, weights, 2).unwrap();
    let cloth = outfit.garments[0].clone();
    let still = vec![[0, 0, 0, 0]; cloth.mesh.vertices().len()];
    let weights = vec![[1.0, 0.0, 0.0, 0.0]; still.len()];
    let skins = vec![Some(skin), Some(SkinWeights::new(still, weights, 2).unwrap())];
    let outfit = Outfit::new(Layer::new("body", body), vec![cloth]).unwrap();
    let outfit = SkinnedOutfit::new(outfit, skeleton, skins).unwrap();
    let pose = |frame: usize| {
        let mut pose = Pose::rest(2);
        let angle = -1e-3 * frame as f64;
        pose.rotations[1] = UnitQuaternion::from_axis_angle(&Vector::y_axis(), angle);
        pose
    };
    let poses: Vec<Pose> = (0..5).map(pose).collect();
    let motion = Motion::new(30.0, poses).unwrap();
    // One solve of one sweep separates nothing.
    let weak = WalkParams { solves: 1, sweeps: 1, halvings: 0, ..WalkParams::default() };
    let params = AnimateParams { walk: weak, ..AnimateParams::default() };
    let folder = tempfile::tempdir().unwrap();
    let done = animate(&outfit, &motion, &params, folder.path(), &mut Silent).unwrap().report;
    assert!(done.frames.iter().all(|f| f.reached), "{:?}", done.frames);
    assert_eq!((done.clean, done.clean_everywhere), (5, 2), "{:?}", done.frames);
    let let_go: Vec<bool> = done.frames.iter().map(|f| f.let_go > 0).collect();
    let meets: Vec<bool> = done.frames.iter().map(|f| f.body_own_pairs > 0).collect();
    assert_eq!(
        [let_go, meets],
        [vec![false, false, true, true, true], vec![false, false, true, true, true]]
    );
}
