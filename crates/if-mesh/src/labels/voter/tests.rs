use super::super::smooth::{SmoothLabelParams, smooth_labels};
use super::*;
use if_core::math::Vector;
use if_core::monitor::Silent;
use if_core::shapes::meshes::tube;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;
use std::ops::Range;

const LABELS: usize = 3;
/// Where label 1 ends and label 2 begins on the tube.
const LINE: Real = 0.43;

fn cylinder() -> TriMesh {
    tube(0.2, 1.0, 48, 40, true)
}

/// The camera that sees the cylinder turned by a part of a full turn.
fn camera(turn: Real) -> Camera {
    let (s, c) = (TAU * turn).sin_cos();
    let eye = Point::new(3.0 * s, 0.7, 3.0 * c);
    Camera::looking_at((96, 96), &eye, &Point::new(0.0, 0.5, 0.0), &Vector::y(), 0.42).unwrap()
}

/// The expected label image: intersections of rays with the round cylinder, by formula.
fn labels(camera: &Camera) -> Vec<u8> {
    let one = |at: usize| {
        let pixel = nalgebra::Point2::new((at % 96) as Real + 0.5, (at / 96) as Real + 0.5);
        let (o, d) = camera.ray(&pixel);
        let (a, b, c) =
            (d.x * d.x + d.z * d.z, o.x * d.x + o.z * d.z, o.x * o.x + o.z * o.z - 0.04);
        let (top, disc) = ((1.0 - o.y) / d.y, b * b - a * c);
        let side = if disc > 0.0 { (-b - disc.sqrt()) / a } else { Real::INFINITY };
        let y = o.y + side * d.y;
        let lid = o + d * top;
        if (0.0..=1.0).contains(&y) {
            1 + u8::from(y > LINE)
        } else if top > 0.0 && lid.x.hypot(lid.z) < 0.2 {
            2
        } else {
            UNDECIDED
        }
    };
    (0..96 * 96).map(one).collect()
}

/// Votes of `frames` frames of a full turn with labels replaced at random with this probability.
fn turned(mesh: &TriMesh, frames: usize, noise: Real) -> (LabelVotes, VoteReport) {
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut voter = Voter::new(
        mesh,
        LABELS,
        &VoteParams { margin: if noise > 0.0 { 0 } else { 2 }, ..Default::default() },
    )
    .unwrap();
    for k in 0..frames {
        let camera = camera(k as Real / frames as Real);
        let mut image = labels(&camera);
        for label in image.iter_mut().filter(|l| **l != UNDECIDED) {
            if rng.random_bool(noise) {
                *label = rng.random_range(0..3);
            }
        }
        assert_eq!(voter.add(mesh.vertices(), &camera, &image).unwrap(), Look::Gains);
    }
    voter.finish()
}

/// Votes of so many frames, the first of which takes all of label 1 for label 2.
fn confused(mesh: &TriMesh, frames: usize) -> (LabelVotes, VoteReport) {
    let mut voter = Voter::new(mesh, LABELS, &VoteParams::default()).unwrap();
    for k in 0..frames {
        // All but the first look from one side.
        let camera = camera(if k == 0 { 0.2 } else { 0.0 });
        let mut image = labels(&camera);
        if k == 0 {
            image.iter_mut().filter(|l| **l == 1).for_each(|l| *l = 2);
        }
        voter.add(mesh.vertices(), &camera, &image).unwrap();
    }
    voter.finish()
}

#[test]
fn a_frame_that_takes_one_label_for_another_is_not_believed_where_it_looks_alone() {
    let mesh = cylinder();
    let (votes, report) = confused(&mesh, 3);
    assert_eq!(report.contradictions, [Contradiction { frame: 0, label: 2, others: 1 }]);
    let (false_labels, _) = wrong(&mesh, |v| votes.winner(v));
    assert!(false_labels <= 48, "{false_labels}");
    // Of two frames neither knows better.
    let (votes, report) = confused(&mesh, 2);
    assert_eq!(report.contradictions, []);
    let (more_false, _) = wrong(&mesh, |v| votes.winner(v));
    assert!(more_false > false_labels + 100, "{false_labels} {more_false}");
    // Right labels contradict none, nor do wrong ones in every third pixel.
    assert_eq!(turned(&mesh, 12, 0.0).1.contradictions, []);
    assert_eq!(turned(&mesh, 12, 0.5).1.contradictions, []);
}

#[test]
fn neighbours_that_are_wrong_alike_do_not_silence_the_frames_beside_them() {
    let mesh = cylinder();
    let mut voter = Voter::new(&mesh, LABELS, &VoteParams::default()).unwrap();
    for k in 0..12 {
        let camera = camera(f64::from(k) / 12.0);
        let mut image = labels(&camera);
        if [5, 6].contains(&k) {
            image.iter_mut().filter(|l| **l == 1).for_each(|l| *l = 2);
        }
        voter.add(mesh.vertices(), &camera, &image).unwrap();
    }
    let (votes, report) = voter.finish();
    let of = |frame| Contradiction { frame, label: 2, others: 1 };
    assert_eq!(report.contradictions, [5, 6].map(of));
    let (false_labels, none) = wrong(&mesh, |v| votes.winner(v));
    assert!(false_labels <= 48 && none < 100, "{false_labels} {none}");
}

/// Votes of 24 frames of a full turn; in those of `run` the second label of each of `names` takes the place of the
/// first.
fn run(mesh: &TriMesh, run: Range<usize>, names: &[[u8; 2]]) -> (LabelVotes, VoteReport) {
    let mut voter = Voter::new(mesh, LABELS, &VoteParams::default()).unwrap();
    for k in 0..24 {
        let camera = camera(k as Real / 24.0);
        let mut image = labels(&camera);
        for label in image.iter_mut().filter(|_| run.contains(&k)) {
            *label = names.iter().find(|[from, _]| from == label).map_or(*label, |[_, to]| *to);
        }
        voter.add(mesh.vertices(), &camera, &image).unwrap();
    }
    voter.finish()
}

#[test]
fn a_run_of_frames_that_are_wrong_alike_decides_nothing_though_it_looks_alone() {
    let mesh = cylinder();
    let (right, _) = run(&mesh, 0..0, &[]);
    for (names, length) in
        [(&[[1, 2]][..], 9), (&[[2, 1]], 9), (&[[1, 2], [2, 1]], 9), (&[[1, 2]], 11)]
    {
        let frames = 8..8 + length;
        let (votes, report) = run(&mesh, frames.clone(), names);
        let of = |[others, label]: [u8; 2]| {
            frames.clone().map(move |frame| Contradiction { frame, label, others })
        };
        let mut expected: Vec<_> = names.iter().copied().flat_map(of).collect();
        expected.sort_by_key(|c| c.frame);
        assert_eq!(report.contradictions, expected);
        let scores =
            smooth_labels(&mesh, &votes, &SmoothLabelParams::default(), &mut Silent).unwrap();
        let winners = scores.winners();
        let (false_labels, none) = wrong(&mesh, |v| winners[v]);
        assert!(false_labels <= 100 && none == 0, "{names:?}: {false_labels} {none}");
        let sum = |votes: &LabelVotes| votes.weights.iter().sum::<Real>();
        approx::assert_relative_eq!(sum(&votes), sum(&right), max_relative = 0.01);
    }
}

/// Vertices with a wrong label, and those without one.
fn wrong(mesh: &TriMesh, of: impl Fn(usize) -> u8) -> (usize, usize) {
    let mut counts = (0, 0);
    for (v, p) in mesh.vertices().iter().enumerate() {
        let label = of(v);
        counts.0 += usize::from(label != UNDECIDED && label != 1 + u8::from(p.y > LINE));
        counts.1 += usize::from(label == UNDECIDED);
    }
    counts
}

#[test]
fn votes_recover_the_border_of_a_cylinder_and_smoothing_labels_its_unseen_bottom() {
    let mesh = cylinder();
    let (votes, report) = turned(&mesh, 12, 0.0);
    assert_eq!((report.cast, report.empty, report.covered), (12, 0, 0));
    assert!(report.near_edge > 0 && report.near_edge < report.pixels / 2, "{report:?}");
    let (false_labels, undecided) = wrong(&mesh, |v| votes.winner(v));
    // One ring of 48 lies 5 mm below the line, where a pixel is 14 mm: it may go either way.
    assert!(false_labels <= 48, "{false_labels}");
    // The middle of the bottom, its rim, and the ring or two next to the line.
    let bottom = mesh.vertices().iter().position(|p| p.y == 0.0 && p.x.hypot(p.z) < 1e-9).unwrap();
    assert!(votes.winner(bottom) == UNDECIDED && undecided <= 1 + 48 + 96, "{undecided}");
    let scores = smooth_labels(&mesh, &votes, &SmoothLabelParams::default(), &mut Silent).unwrap();
    assert_eq!(scores.winners()[bottom], 1);
    let winners = scores.winners();
    let (false_labels, undecided) = wrong(&mesh, |v| winners[v]);
    assert!(false_labels <= 48 && undecided == 0, "{false_labels} {undecided}");
}

#[test]
fn many_frames_correct_labels_that_are_wrong_in_every_third_pixel() {
    let mesh = cylinder();
    let two = turned(&mesh, 2, 0.5).0;
    let few = wrong(&mesh, |v| two.winner(v)).0;
    let (votes, _) = turned(&mesh, 24, 0.5);
    let before = wrong(&mesh, |v| votes.winner(v));
    let params = SmoothLabelParams { length: 0.06, ..Default::default() };
    let scores = smooth_labels(&mesh, &votes, &params, &mut Silent).unwrap();
    let winners = scores.winners();
    let after = wrong(&mesh, |v| winners[v]);
    assert!(
        few > 100 && before.0 < few && after.0 <= before.0 && after.0 <= 60 && after.1 == 0,
        "{few} {before:?} {after:?}"
    );
}

#[test]
fn frames_that_add_nothing_are_skipped_and_counted() {
    let mesh = cylinder();
    let front = camera(0.0);
    let image = labels(&front);
    // Vertices seen at a slant or near edges are never saturated; all others are after some frames.
    let params = VoteParams { enough: 2.0, least_gain: 0.5, ..Default::default() };
    let mut eager = Voter::new(&mesh, LABELS, &params).unwrap();
    let looks: Vec<Look> =
        (0..12).map(|_| eager.add(mesh.vertices(), &front, &image).unwrap()).collect();
    let first =
        looks.iter().position(|l| *l == Look::Covered).expect("half has enough at some time");
    assert!(first >= 2 && looks[first..].iter().all(|l| *l == Look::Covered), "{first}");
    assert_eq!(eager.report().covered, 12 - first);
    let away: Vec<Point> =
        mesh.vertices().iter().map(|p| p + Vector::new(50.0, 0.0, 0.0)).collect();
    assert_eq!(eager.add(&away, &front, &image).unwrap(), Look::Empty);
    assert_eq!(
        eager.add(mesh.vertices(), &camera(0.5), &labels(&camera(0.5))).unwrap(),
        Look::Gains
    );
    assert_eq!((eager.report().empty, eager.report().cast), (1, first + 1));
}

#[test]
fn the_number_of_votes_does_not_depend_on_the_resolution() {
    let camera = camera(0.0);
    let image = labels(&camera);
    let most = |around, along| {
        let mesh = tube(0.2, 1.0, around, along, true);
        let mut voter = Voter::new(&mesh, LABELS, &VoteParams::default()).unwrap();
        voter.add(mesh.vertices(), &camera, &image).unwrap();
        voter.finish().0.weights.iter().copied().fold(0.0, Real::max)
    };
    let (coarse, fine) = (most(24, 10), most(96, 80));
    assert!((0.85..=1.0).contains(&coarse) && (0.6..=1.0).contains(&fine), "{coarse} {fine}");
}

/// On edges of 3 mm seen in pixels of 14 mm, six of seven vertices are no corner of a triangle at
/// the centre of a pixel.
#[test]
fn vertices_between_the_centres_of_pixels_get_votes() {
    let mesh = tube(0.2, 1.0, 400, 320, true);
    let front = camera(0.0);
    let mut voter = Voter::new(&mesh, LABELS, &VoteParams::default()).unwrap();
    voter.add(mesh.vertices(), &front, &labels(&front)).unwrap();
    let (votes, report) = voter.finish();
    // Within 60 degrees of the camera, two pixels from the border.
    let is_seen = |p: &Point| {
        p.z > 0.1 && (0.05..0.95).contains(&p.y) && (p.y - LINE).abs() > 0.03 && p.x.abs() < 0.17
    };
    let seen = (0..mesh.vertices().len()).filter(|v| is_seen(&mesh.vertices()[*v]));
    let with_votes = seen.clone().filter(|v| votes.of(*v).iter().sum::<Real>() > 0.1).count();
    let share = with_votes as Real / seen.count() as Real;
    assert!(share > 0.9, "{share}");
    assert!(wrong(&mesh, |v| votes.winner(v)).0 == 0, "labels");
    // The picture of the cylinder, in pixels of the camera.
    assert!((1500..3000).contains(&report.pixels), "{report:?}");
}

#[test]
fn results_do_not_depend_on_threads() {
    let mesh = cylinder();
    let pool = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap();
    let all = [1, 3].map(|n| pool(n).install(|| turned(&mesh, 4, 0.2)));
    assert!(all[0] == all[1]);
}

#[test]
fn errors_are_specific_and_add_no_vote() {
    let mesh = cylinder();
    let mut voter = Voter::new(&mesh, LABELS, &VoteParams::default()).unwrap();
    let front = camera(0.0);
    let image = labels(&front);
    let got = voter.add(&mesh.vertices()[1..], &front, &image);
    assert!(matches!(got, Err(LabelError::Positions { .. })));
    assert!(matches!(
        voter.add(mesh.vertices(), &front, &image[1..]),
        Err(LabelError::Pixels { .. })
    ));
    let mut bad = image.clone();
    bad[3 * 96 + 5] = 3;
    let error = voter.add(mesh.vertices(), &front, &bad).unwrap_err();
    assert_eq!(error, LabelError::Label { column: 5, row: 3, label: 3, labels: 3 });
    assert_eq!(voter.report().cast, 0);
    assert!(voter.finish().0.weights.iter().all(|w| *w == 0.0));
    for params in [
        VoteParams { step: 0.0, ..Default::default() },
        VoteParams { least_gain: Real::NAN, ..Default::default() },
    ] {
        assert!(Voter::new(&mesh, LABELS, &params).is_err());
    }
    let error = Voter::new(&mesh, 1, &VoteParams::default()).unwrap_err();
    assert_eq!(error.name, "labels");
}
