use super::*;
use crate::grid::{GridConfig, GridField};
use crate::sampling::SamplingParams;
use crate::trainable::{PointLoss, Sample32};
use crate::training::Best;
use if_core::field::FieldSample;
use if_core::math::{Point, Vector};
use if_core::monitor::{Cancelled, Progress, Silent};
use if_core::shapes::Torus;
use std::ops::ControlFlow;

fn set() -> TrainingSet {
    let ring = Torus { center: Point::new(1.0, 2.0, 3.0), major: 0.5, minor: 0.2 };
    let params =
        SamplingParams { near: 8000, far: 1000, held_out: 1000, ..SamplingParams::default() };
    TrainingSet::of_field(&ring, &params).unwrap()
}

fn grid() -> GridField {
    GridField::new(GridConfig { coarsest: 8, finest: 24, levels: 3, ..GridConfig::default() })
        .unwrap()
}

fn params(steps: u64) -> FitParams {
    FitParams {
        batch: 512,
        steps: Some(steps),
        seconds: None,
        check_every: 10,
        ..FitParams::default()
    }
}

/// Cancels after `step` steps.
fn stop_at(step: usize) -> impl FnMut(&Progress<'_>) -> ControlFlow<()> {
    move |p| if p.done == step { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

fn bits(field: &GridField) -> Vec<u32> {
    field.parameters().iter().map(|p| p.to_bits()).collect()
}

#[test]
fn a_fit_learns_and_reports_it() {
    let (set, mut field) = (set(), grid());
    let mut fit = Fit::new(FitParams {
        schedule: Schedule { rate: 0.02, ..Schedule::default() },
        ..params(200)
    })
    .unwrap();
    let mut losses = Vec::new();
    let report = fit
        .run(&mut field, &set, &mut |p: &Progress<'_>| {
            losses.push(p.measure("loss").unwrap());
            ControlFlow::Continue(())
        })
        .unwrap();
    // Batches differ: means of ten.
    let mean = |of: &[Real]| of.iter().sum::<Real>() / of.len() as Real;
    let (first, last) = (mean(&losses[..10]), mean(&losses[190..]));
    assert!(last < 0.5 * first, "the loss went from {first} to {last}");
    assert_eq!((report.ended, report.steps, report.samples), (Ended::Steps, 200, 200 * 512));
    // The ring is 1.4 m wide and its tube, 0.2 m, four cells.
    assert!(report.error.mean < 2e-3 && report.error.eikonal < 0.06, "{report:?}");
    let again = evaluate(&field, &set, &set.held_out);
    assert_eq!(again, report.error);
}

#[test]
fn a_fit_that_was_interrupted_has_the_bits_of_one_that_was_not() {
    let set = set();
    let mut whole = grid();
    Fit::new(params(40)).unwrap().run(&mut whole, &set, &mut Silent).unwrap();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut field = grid();
            let mut fit = Fit::new(params(40)).unwrap();
            let stopped = fit.run(&mut field, &set, &mut stop_at(17));
            assert_eq!(stopped, Err(FitError::Cancelled(Cancelled)));
            let (mut later, mut other) = (fit.clone(), field.clone());
            later.run(&mut other, &set, &mut Silent).unwrap();
            bits(&other)
        })
    };
    assert!(run(1) == bits(&whole) && run(3) == bits(&whole));
}

#[test]
fn a_fit_goes_on_with_its_own_target_only() {
    let set = set();
    let thinner = Torus { center: Point::new(1.0, 2.0, 3.0), major: 0.5, minor: 0.19 };
    let params_of_set =
        SamplingParams { near: 8000, far: 1000, held_out: 1000, ..SamplingParams::default() };
    let other = TrainingSet {
        frame: set.frame,
        ..TrainingSet::of_field(&thinner, &params_of_set).unwrap()
    };
    let mut field = grid();
    let mut fit = Fit::new(params(40)).unwrap();
    assert!(fit.matches(&set) && fit.matches(&other), "it has not begun");
    fit.run(&mut field, &set, &mut stop_at(3)).unwrap_err();
    assert!(fit.matches(&set) && !fit.matches(&other));
    let before = fit.clone();
    assert_eq!(fit.run(&mut field, &other, &mut Silent), Err(FitError::Target));
    assert_eq!(fit, before, "nothing was lost");
}

#[test]
fn it_stops_at_an_accuracy_and_at_a_time() {
    let set = set();
    let mut field = grid();
    let mut fit = Fit::new(FitParams {
        accuracy: Some(0.01),
        schedule: Schedule { rate: 0.02, ..Schedule::default() },
        ..params(2000)
    })
    .unwrap();
    let report = fit.run(&mut field, &set, &mut Silent).unwrap();
    assert_eq!(report.ended, Ended::Accuracy);
    assert!(report.steps < 2000 && report.error.mean <= 0.01, "{report:?}");
    let mut fit = Fit::new(FitParams { steps: None, seconds: Some(0.05), ..params(0) }).unwrap();
    assert_eq!(fit.run(&mut grid(), &set, &mut Silent).unwrap().ended, Ended::Time);
}

/// The training set of [`set`] with 4,000 held-out points, of which a check sees every second; the
/// target of the others is `off` farther.
fn unlike_its_checks(off: Real) -> TrainingSet {
    let ring = Torus { center: Point::new(1.0, 2.0, 3.0), major: 0.5, minor: 0.2 };
    let params =
        SamplingParams { near: 8000, far: 1000, held_out: 4000, ..SamplingParams::default() };
    let mut set = TrainingSet::of_field(&ring, &params).unwrap();
    let mut distances = set.held_out.beside().1.to_vec();
    distances.iter_mut().skip(1).step_by(2).for_each(|d| *d += off);
    let points = set.held_out.beside().0.to_vec();
    let samples: Vec<FieldSample> =
        distances.iter().map(|d| FieldSample { distance: *d, gradient: Vector::x() }).collect();
    set.held_out = HeldOut::new(&points, &samples, &points[..100], &samples[..100]);
    set
}

/// A grid that counts its evaluations at all held-out points.
struct Counting {
    inner: GridField,
    whole: std::sync::atomic::AtomicU64,
}

impl TrainableField for Counting {
    fn parameters(&self) -> &[f32] {
        self.inner.parameters()
    }
    fn parameters_mut(&mut self) -> &mut [f32] {
        self.inner.parameters_mut()
    }
    fn refresh(&mut self) {}
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        self.whole.fetch_add(u64::from(points.len() == 4000), std::sync::atomic::Ordering::Relaxed);
        self.inner.samples32(points, out);
    }
    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        self.inner.loss_gradient(points, loss, gradient)
    }
}

#[test]
fn an_accuracy_that_the_checks_see_and_the_rest_does_not_is_not_reached() {
    let schedule = Schedule { rate: 0.02, ..Schedule::default() };
    // Half of the points are 5 cm off: a mean of 1 cm is out of reach, and evaluated once in four
    // checks.
    let asked = FitParams { accuracy: Some(0.01), schedule, ..params(200) };
    let mut field = Counting { inner: grid(), whole: 0.into() };
    let mut fit = Fit::new(asked).unwrap();
    let mut below = 0;
    let report = fit
        .run(&mut field, &unlike_its_checks(0.05), &mut |p: &Progress<'_>| {
            below += u32::from(p.done.is_multiple_of(10) && p.measure("error").unwrap() <= 0.01);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!(report.ended, Ended::Steps);
    assert!(report.error.mean > 0.02 && below > 8, "{report:?}, {below}");
    let looks = field.whole.into_inner() - 1;
    assert!((2..=5).contains(&looks), "{looks} evaluations beside that of the report");
    // 1.6 cm off they are in reach, a while after the checks: with a stop on the way as without.
    let asked = FitParams { accuracy: Some(0.012), ..asked };
    let set = unlike_its_checks(0.016);
    let mut field = grid();
    let mut first = None;
    let whole = Fit::new(asked)
        .unwrap()
        .run(&mut field, &set, &mut |p: &Progress<'_>| {
            first = first.or((p.measure("error").unwrap() <= 0.012).then_some(p.done));
            ControlFlow::Continue(())
        })
        .unwrap();
    assert_eq!((whole.ended, whole.kept), (Ended::Accuracy, whole.steps));
    assert!(
        whole.error.mean <= 0.012 && first.is_some_and(|f| (f as u64) < whole.steps),
        "{whole:?} {first:?}"
    );
    let (mut fit, mut part) = (Fit::new(asked).unwrap(), grid());
    let stopped = fit.run(&mut part, &set, &mut stop_at(first.unwrap() + 7));
    assert_eq!(stopped, Err(FitError::Cancelled(Cancelled)));
    assert_eq!(fit.run(&mut part, &set, &mut Silent).unwrap().steps, whole.steps);
    assert!(bits(&part) == bits(&field));
}

/// A field whose derivatives turn into NaN at step 20, and whose error explodes from step 10 on.
struct Faulty {
    inner: GridField,
    calls: std::sync::atomic::AtomicUsize,
    explodes: bool,
}

impl TrainableField for Faulty {
    fn parameters(&self) -> &[f32] {
        self.inner.parameters()
    }
    fn parameters_mut(&mut self) -> &mut [f32] {
        self.inner.parameters_mut()
    }
    fn refresh(&mut self) {}
    fn samples32(&self, points: &[[f32; 3]], out: &mut [Sample32]) {
        self.inner.samples32(points, out);
    }
    fn loss_gradient(
        &self,
        points: &[[f32; 3]],
        loss: &(dyn Fn(usize, Sample32) -> PointLoss + Sync),
        gradient: &mut [f32],
    ) -> f64 {
        let call = self.calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let total = self.inner.loss_gradient(points, loss, gradient);
        if self.explodes && call >= 10 {
            // Adam's steps keep their length: reversed, they run away.
            gradient.iter_mut().for_each(|g| *g = -1.0);
        }
        if !self.explodes && call == 20 {
            gradient[5] = f32::NAN;
        }
        total
    }
}

#[test]
fn a_fit_that_diverges_ends_with_the_last_good_state() {
    let set = set();
    for explodes in [false, true] {
        let mut field = Faulty { inner: grid(), calls: 0.into(), explodes };
        let params =
            FitParams { schedule: Schedule { rate: 0.05, ..Schedule::default() }, ..params(400) };
        let report = Fit::new(params).unwrap().run(&mut field, &set, &mut Silent).unwrap();
        assert_eq!(report.ended, Ended::Diverged);
        assert!(report.kept <= 20 && report.steps >= 10, "{report:?}");
        assert!(report.error.is_finite() && report.error.mean < 0.2, "{report:?}");
    }
    // All of it, and a node in a corner that no held-out point is near.
    for count in [usize::MAX, 1] {
        let mut field = grid();
        field.parameters_mut().iter_mut().take(count).for_each(|p| *p = f32::NAN);
        assert_eq!(evaluate(&field, &set, &set.held_out).is_finite(), count == 1);
        let error = Fit::new(params(5)).unwrap().run(&mut field, &set, &mut Silent);
        assert_eq!(error.unwrap_err(), FitError::NotANumber);
    }
}

#[test]
fn the_noise_of_steps_beside_fine_first_values_is_no_divergence() {
    let judged = |best: Real, error: Real| {
        let best = Some(Best { step: 0, mean: best, theta: vec![0.0] });
        Training { best, ..Training::default() }.judge(&[1.0], error, NOISE)
    };
    // A thousand times worse than splines through a smooth surface, and yet a tenth of a
    // millimetre.
    assert!(judged(1e-6, 1e-3));
    assert!(!judged(1e-6, 1e-2));
    assert!(judged(1e-3, 4e-2) && !judged(1e-3, 6e-2));
}

#[test]
fn parameters_out_of_range_are_refused() {
    let base = params(5);
    for (bad, name) in [
        (FitParams { batch: 0, ..base }, "batch"),
        (FitParams { far: f64::NAN, ..base }, "far"),
        (FitParams { check_every: 0, ..base }, "check_every"),
        (FitParams { seconds: Some(-1.0), ..base }, "seconds"),
        (FitParams { accuracy: Some(0.0), ..base }, "accuracy"),
        (FitParams { adam: AdamParams { beta2: 1.0, ..base.adam }, ..base }, "adam.beta2"),
        (
            FitParams { schedule: Schedule { rate: 1e300, ..base.schedule }, ..base },
            "schedule.rate",
        ),
        (
            FitParams { loss: LossParams { normal: f64::INFINITY, ..base.loss }, ..base },
            "loss.normal",
        ),
    ] {
        assert!(Fit::new(bad).is_err_and(|e| e.name == name), "{name}");
    }
    let endless = Fit::new(FitParams { steps: None, ..base }).unwrap_err();
    assert!(endless.name == "steps" && endless.range.contains("`seconds`"), "{endless}");
    let mut fit = Fit::new(base).unwrap();
    fit.run(&mut grid(), &set(), &mut stop_at(1)).unwrap_err();
    let mut other = GridField::new(GridConfig { finest: 32, ..*grid().config() }).unwrap();
    let error = fit.run(&mut other, &set(), &mut Silent).unwrap_err();
    assert!(matches!(error, FitError::Length { .. }));
}
