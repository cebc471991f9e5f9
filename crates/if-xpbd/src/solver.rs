//! The loop over steps and substeps: lines 1 to 3 and 23 to 26 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual, Stage};
use crate::params::{ContactOrder, Motion, SolverParams};
use crate::particles::Particles;
use crate::report::{RunError, RunReport, StepError, StepReport, Stop};
use if_core::aabb::Aabb;
use if_core::math::{Real, Vector};
use if_core::monitor::{Monitor, Progress};
use if_core::parameter::ParameterError;

/// Maximum number of vertices in an error.
const NAMED: usize = 16;

/// Moves particles under groups of constraints.
///
/// ```text
/// h ← Δt / numSubSteps                                     line 1
/// for each substep                                         2, 25
///   pᵢ ← p;  v ← v + h g (or h g: quasi-static);  p ← p + h v     3
///   every group: λ ← 0 (β̃ ← β / h² when projected)         4, 5
///   [contacts]                                             6 to 15, in the printed order
///   for each sweep: elastic groups; [contacts]             16 to 22, and the correction
///   [contacts alone];  final groups                        ours
///   v ← (p − pᵢ) / h;  contacts remove their push from v   23, 24
/// ```
///
/// A step fails if its final state is not finite, if its kinetic energy jumps, or if a vertex moves
/// many times the size of the scene. It is then rolled back and tried with h/2, at most
/// [`retries`](SolverParams::retries) times. A step runs on one thread in a fixed order (fields may
/// use several), so the bits do not depend on the number of threads.
///
/// # Examples
///
/// Two particles on a spring, one of them pinned, hang at rest:
///
/// ```
/// use if_core::Point;
/// use if_xpbd::{EdgeSet, Motion, Particles, Solver, SolverParams, Stretch};
///
/// let start = vec![Point::origin(), Point::new(0.0, -0.1, 0.0)];
/// let mut particles = Particles::uniform(start, 1.0)?.pinned([0]);
/// let mut spring = Stretch::new(EdgeSet::new(&[[0, 1]], &[0.1], 2)?, 1e-3)?;
/// let mut solver = Solver::new(SolverParams {
///     motion: Motion::Dynamic { damping: 20.0 },
///     gravity: [0.0, -9.81, 0.0],
///     ..SolverParams::default()
/// })?;
/// for _ in 0..200 {
///     solver.step(&mut particles, &mut [&mut spring])?;
/// }
/// assert!((particles.positions[1].y + 0.1 + 9.81e-3).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Solver {
    params: SolverParams,
    backup: Particles,
}

impl Solver {
    /// A solver with checked parameters.
    ///
    /// # Errors
    ///
    /// See [`SolverParams::validate`].
    pub fn new(params: SolverParams) -> Result<Self, ParameterError> {
        params.validate()?;
        Ok(Self { params, backup: Particles::default() })
    }

    /// Replaces the parameters; memory is kept.
    ///
    /// # Errors
    ///
    /// See [`SolverParams::validate`]. The old parameters are then kept.
    pub fn set_params(&mut self, params: SolverParams) -> Result<(), ParameterError> {
        params.validate()?;
        self.params = params;
        Ok(())
    }

    /// The parameters.
    pub fn params(&self) -> &SolverParams {
        &self.params
    }

    /// One time step Δt: all its substeps.
    ///
    /// # Errors
    ///
    /// A group with a number out of range; a state that is not finite, an energy jump or a
    /// displacement jump, if smaller substeps did not help.
    ///
    /// # Panics
    ///
    /// If a group names a particle that does not exist.
    pub fn step(
        &mut self,
        particles: &mut Particles,
        groups: &mut [&mut dyn Constraint],
    ) -> Result<StepReport, StepError> {
        let n = particles.positions.len();
        if particles.velocities.len() != n || particles.inverse_masses.len() != n {
            let (velocities, inverse_masses) =
                (particles.velocities.len(), particles.inverse_masses.len());
            return Err(StepError::Count { positions: n, velocities, inverse_masses });
        }
        let vertices = particles.non_finite(NAMED);
        if !vertices.is_empty() {
            return Err(StepError::Input { vertices });
        }
        for (group, constraint) in groups.iter().enumerate() {
            constraint.validate().map_err(|source| StepError::Group { group, source })?;
        }
        // The inverse masses are not written: groups receive them read-only.
        copy_state(particles, &mut self.backup);
        // Quasi-static motion has no speed: its pushes over h would grow as h shrinks.
        let allowed = if self.params.motion == Motion::QuasiStatic
            || self.params.energy_jump == Real::INFINITY
        {
            Real::INFINITY
        } else {
            self.params.energy_jump * particles.kinetic_energy().max(0.5 * movable_mass(particles))
        };
        let mut retries = 0;
        loop {
            let substeps = self.params.substeps.saturating_mul(1 << retries);
            let fault = match self.attempt(particles, groups, substeps, allowed) {
                Ok(mut report) => {
                    report.retries = retries;
                    return Ok(report);
                }
                Err(fault) => fault,
            };
            copy_state(&self.backup, particles);
            groups.iter_mut().for_each(|g| g.reset());
            if retries == self.params.retries {
                return Err(fault);
            }
            retries += 1;
            tracing::debug!(retries, %fault, "the step is rolled back and tried with half the substep");
        }
    }

    /// Steps until no vertex moves farther than [`stop_below`](SolverParams::stop_below), or all
    /// steps are made.
    ///
    /// The monitor receives the stage `"step"` after each step, with the measures `moved`,
    /// `elastic` and `contact` (the largest violations, in metres).
    ///
    /// # Errors
    ///
    /// As [`Solver::step`], and if the monitor cancels.
    ///
    /// # Panics
    ///
    /// As [`Solver::step`].
    pub fn run(
        &mut self,
        particles: &mut Particles,
        groups: &mut [&mut dyn Constraint],
        monitor: &mut dyn Monitor,
    ) -> Result<RunReport, RunError> {
        let mut run = RunReport {
            steps: 0,
            substeps: 0,
            retries: 0,
            stop: Stop::Exhausted,
            last: None,
            counters: Counters::default(),
        };
        while run.steps < self.params.steps {
            let report = self.step(particles, groups)?;
            run.steps += 1;
            run.substeps += u64::from(report.substeps);
            run.retries += report.retries;
            monitor.report(&Progress {
                done: run.steps as usize,
                total: Some(self.params.steps as usize),
                measures: &[
                    ("moved", report.moved),
                    ("elastic", report.elastic.max),
                    ("contact", report.contact.max),
                ],
                ..Progress::stage("step")
            })?;
            let converged =
                self.params.motion == Motion::QuasiStatic && report.moved < self.params.stop_below;
            run.last = Some(report);
            if converged {
                run.stop = Stop::Converged;
                break;
            }
        }
        run.counters = groups.iter().fold(Counters::default(), |c, g| c.merged(g.counters()));
        Ok(run)
    }

    fn attempt(
        &self,
        particles: &mut Particles,
        groups: &mut [&mut dyn Constraint],
        substeps: u32,
        allowed: Real,
    ) -> Result<StepReport, StepError> {
        let h = self.params.time_step / Real::from(substeps);
        let mut report = StepReport { substeps, ..StepReport::default() };
        for _ in 0..substeps {
            self.substep(particles, groups, h, &mut report);
            let energy = particles.kinetic_energy();
            if !energy.is_finite() {
                let vertices = particles.non_finite(NAMED);
                if !vertices.is_empty() {
                    return Err(StepError::NonFinite { vertices, substeps, h });
                }
            }
            // The energy of crossing the scene costs a pass over all particles: only if needed.
            if energy > allowed && energy > self.crossing(movable_mass(particles)) {
                let allowed = allowed.max(self.crossing(movable_mass(particles)));
                let speed = |k: usize| particles.velocities[k].norm_squared();
                return Err(StepError::EnergyJump {
                    vertices: largest(particles.len(), speed),
                    energy,
                    allowed,
                    h,
                });
            }
            report.kinetic_energy = energy;
        }
        let vertices = particles.non_finite(NAMED);
        if !vertices.is_empty() {
            return Err(StepError::NonFinite { vertices, substeps, h });
        }
        if self.params.motion == Motion::QuasiStatic {
            particles.velocities.fill(Vector::zeros());
        }
        report.idle_groups = groups.iter().filter(|g| g.is_idle()).count();
        let moved = particles
            .positions
            .iter()
            .zip(&self.backup.positions)
            .map(|(p, q)| (p - q).norm_squared());
        report.moved = moved.fold(0.0, Real::max).sqrt();
        // The size of the scene costs a pass over all particles: only if 1 m does not suffice.
        if report.moved > self.params.displacement_jump {
            let allowed = self.params.displacement_jump * self.size().max(1.0);
            if report.moved > allowed {
                let far =
                    |k: usize| (particles.positions[k] - self.backup.positions[k]).norm_squared();
                return Err(StepError::DisplacementJump {
                    vertices: largest(particles.len(), far),
                    moved: report.moved,
                    allowed,
                    h,
                });
            }
        }
        Ok(report)
    }

    /// The kinetic energy of the movable mass at the speed that crosses the scene in Δt, in joules.
    /// A constraint that is far from satisfied moves its vertices across a scene of any size in one
    /// step, which is a speed from then on.
    fn crossing(&self, movable_mass: Real) -> Real {
        let speed = self.size() / self.params.time_step;
        0.5 * movable_mass * speed * speed
    }

    /// The diagonal of the box of the particles before the step, and what free flight covers in Δt.
    fn size(&self) -> Real {
        let fastest =
            self.backup.velocities.iter().map(Vector::norm_squared).fold(0.0, Real::max).sqrt();
        let flight = self.params.time_step
            * (fastest + self.params.time_step * Vector::from(self.params.gravity).norm());
        Aabb::from_points(&self.backup.positions).diagonal() + flight
    }

    fn substep(
        &self,
        particles: &mut Particles,
        groups: &mut [&mut dyn Constraint],
        h: Real,
        report: &mut StepReport,
    ) {
        let params = &self.params;
        let kick = Vector::from(params.gravity) * h;
        let Particles { positions, velocities, inverse_masses, previous } = particles;
        previous.clone_from(positions);
        let quasi_static = params.motion == Motion::QuasiStatic;
        // Line 3. A pinned particle stays, whatever speed it was given.
        if !(quasi_static && kick == Vector::zeros()) {
            for k in 0..positions.len() {
                if inverse_masses[k] > 0.0 {
                    let v = if quasi_static { kick } else { velocities[k] + kick };
                    positions[k] += v * h;
                }
            }
        }
        for group in groups.iter_mut().filter(|g| !g.is_idle()) {
            group.begin_substep(previous, positions, inverse_masses, h);
        }
        let mut visit = |stage: Stage| {
            let mut residual = Residual::default();
            for group in groups.iter_mut().filter(|g| g.stage() == stage && !g.is_idle()) {
                residual = residual.merged(group.project(positions, inverse_masses, h));
            }
            residual
        };
        let first = params.contact_order != ContactOrder::AfterStretch || params.sweeps == 0;
        let later = params.contact_order != ContactOrder::BeforeStretch;
        for _ in 0..if first { params.contact_visits } else { 0 } {
            report.contact = visit(Stage::Contact);
        }
        for _ in 0..params.sweeps {
            report.elastic = visit(Stage::Elastic);
            for _ in 0..if later { params.contact_visits } else { 0 } {
                report.contact = visit(Stage::Contact);
            }
        }
        for _ in 0..params.final_contact_visits {
            report.contact = visit(Stage::Contact);
        }
        report.last = visit(Stage::Final);
        // Line 24.
        let keep = match params.motion {
            Motion::Dynamic { damping } => (-damping * h).exp(),
            Motion::QuasiStatic => 1.0,
        };
        for k in 0..positions.len() {
            velocities[k] = if inverse_masses[k] > 0.0 {
                (positions[k] - previous[k]) * (keep / h)
            } else {
                Vector::zeros()
            };
        }
        if params.remove_depenetration_velocity && !quasi_static {
            groups.iter().filter(|g| !g.is_idle()).for_each(|g| g.correct_velocities(velocities));
        }
    }
}

/// Copies what a step changes, into memory that is reused.
fn copy_state(from: &Particles, to: &mut Particles) {
    to.positions.clone_from(&from.positions);
    to.velocities.clone_from(&from.velocities);
    to.previous.clone_from(&from.previous);
}

fn movable_mass(particles: &Particles) -> Real {
    particles.inverse_masses.iter().filter(|w| **w > 0.0).map(|w| 1.0 / w).sum()
}

/// The particles with the largest values of `of`, in descending order.
fn largest(count: usize, of: impl Fn(usize) -> Real) -> Vec<u32> {
    let mut all: Vec<u32> = (0..count as u32).collect();
    all.sort_by(|&a, &b| of(b as usize).total_cmp(&of(a as usize)).then(a.cmp(&b)));
    all.truncate(NAMED);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attach::Attachments;
    use if_core::math::Point;
    use if_core::monitor::{Cancelled, Silent};
    use std::ops::ControlFlow;

    /// Breaks particle 1 while h is above `fine_from`: to NaN, or to a speed of 1e9 m/s.
    struct Trouble {
        fine_from: Real,
        speed: Real,
        resets: u32,
    }

    impl Constraint for Trouble {
        fn begin_substep(&mut self, _: &[Point], _: &[Point], _: &[Real], _: Real) {}
        fn project(&mut self, positions: &mut [Point], _: &[Real], h: Real) -> Residual {
            if h > self.fine_from {
                positions[1].x += self.speed * h;
            }
            Residual::default()
        }
        fn reset(&mut self) {
            self.resets += 1;
        }
    }

    fn three() -> Particles {
        Particles::uniform(
            vec![Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(2.0, 0.0, 0.0)],
            1.0,
        )
        .unwrap()
    }

    fn dynamic() -> SolverParams {
        SolverParams { motion: Motion::Dynamic { damping: 0.0 }, ..Default::default() }
    }

    #[test]
    fn a_failed_step_is_rolled_back_and_made_with_smaller_substeps() {
        for speed in [Real::NAN, 1e9] {
            let mut trouble = Trouble { fine_from: 3e-4, speed, resets: 0 };
            let mut solver = Solver::new(dynamic()).unwrap();
            let mut p = three();
            let report = solver.step(&mut p, &mut [&mut trouble]).unwrap();
            assert_eq!((report.retries, report.substeps, trouble.resets), (2, 40, 2));
            assert_eq!(p.positions, three().positions);
        }
    }

    #[test]
    fn a_persistent_fault_is_an_error_that_names_the_vertex_and_keeps_the_state() {
        for speed in [Real::NAN, 1e9] {
            let mut trouble = Trouble { fine_from: 0.0, speed, resets: 0 };
            let mut p = three();
            let error =
                Solver::new(dynamic()).unwrap().step(&mut p, &mut [&mut trouble]).unwrap_err();
            match &error {
                StepError::NonFinite { vertices, substeps, .. } => {
                    assert_eq!((vertices.as_slice(), *substeps), (&[1][..], 80))
                }
                StepError::EnergyJump { vertices, .. } => assert_eq!(vertices[0], 1),
                other => panic!("{other}"),
            }
            assert_eq!(p, three());
        }
        let mut p = three();
        p.positions[2].y = Real::INFINITY;
        let error =
            Solver::new(SolverParams::default()).unwrap().step(&mut p, &mut []).unwrap_err();
        assert_eq!(error, StepError::Input { vertices: vec![2] });
        p.velocities.pop();
        assert!(matches!(
            Solver::new(SolverParams::default()).unwrap().step(&mut p, &mut []),
            Err(StepError::Count { .. })
        ));
    }

    #[test]
    fn a_speed_that_crosses_the_scene_in_a_step_is_not_a_jump_in_scenes_of_any_size() {
        // Three particles over two lengths, one of which is carried a tenth of a length in the
        // step; then a hundred times as far.
        for length in [1e-3, 1.0, 1e6] {
            for (share, fine) in [(0.1, true), (10.0, length < 1.0)] {
                let at = |x: Real| Point::new(x * length, 0.0, 0.0);
                let mut p = Particles::uniform(vec![at(0.0), at(1.0), at(2.0)], 1.0).unwrap();
                let speed = share * length / 0.01;
                let mut trouble = Trouble { fine_from: 0.0, speed, resets: 0 };
                let ended = Solver::new(dynamic()).unwrap().step(&mut p, &mut [&mut trouble]);
                assert_eq!(ended.is_ok(), fine, "{length} m, {share}: {ended:?}");
            }
        }
    }

    #[test]
    fn a_displacement_jump_is_rolled_back_in_a_quasi_static_run_too() {
        // Three particles over 2 m: 2e4 m are allowed. The default is quasi-static, without an
        // energy guard.
        let mut trouble = Trouble { fine_from: 3e-4, speed: 1e8, resets: 0 };
        let mut p = three();
        let report = Solver::new(SolverParams::default())
            .unwrap()
            .step(&mut p, &mut [&mut trouble])
            .unwrap();
        assert_eq!((report.retries, report.substeps, p.positions), (2, 40, three().positions));
        let mut trouble = Trouble { fine_from: 0.0, speed: 1e8, resets: 0 };
        let mut p = three();
        let error = Solver::new(SolverParams::default())
            .unwrap()
            .step(&mut p, &mut [&mut trouble])
            .unwrap_err();
        match &error {
            StepError::DisplacementJump { vertices, moved, allowed, .. } => {
                assert_eq!((vertices[0], *allowed), (1, 2e4));
                assert!((moved / 1e6 - 1.0).abs() < 1e-9);
            }
            other => panic!("{other}"),
        }
        assert_eq!(p, three());
        let params = SolverParams { displacement_jump: Real::INFINITY, ..Default::default() };
        assert!(Solver::new(params).unwrap().step(&mut p, &mut [&mut trouble]).is_ok());
    }

    #[test]
    fn a_run_stops_when_nothing_moves_or_when_it_is_cancelled() {
        let mut attach = Attachments::new();
        attach.push(0, Point::new(0.0, 0.1, 0.0), 1e-6).unwrap();
        let mut solver = Solver::new(SolverParams::default()).unwrap();
        let mut p = three();
        let groups: &mut [&mut dyn Constraint] = &mut [&mut attach, &mut Attachments::new()];
        let run = solver.run(&mut p, groups, &mut Silent).unwrap();
        assert_eq!(run.stop, Stop::Converged);
        assert!(run.steps < 20 && run.substeps == 10 * u64::from(run.steps));
        assert_eq!(run.last.unwrap().idle_groups, 1);
        assert!((p.positions[0].y - 0.1).abs() < 1e-6);
        let (mut p, mut seen) = (three(), Vec::new());
        let mut stop_at_2 = |progress: &Progress| {
            seen.push((progress.done, progress.measure("moved").unwrap()));
            if progress.done == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let cancelled = solver.run(&mut p, groups, &mut stop_at_2);
        assert_eq!(cancelled, Err(RunError::Cancelled(Cancelled)));
        assert!(seen.len() == 2 && seen[0].1 > 0.0 && p.positions != three().positions);
        let mut none = Solver::new(SolverParams { steps: 0, ..Default::default() }).unwrap();
        let run = none.run(&mut three(), &mut [], &mut Silent).unwrap();
        assert_eq!((run.stop, run.last), (Stop::Exhausted, None));
    }

    /// Appends its letter to a list at each visit.
    struct Logged<'a> {
        letter: char,
        stage: Stage,
        log: &'a std::cell::RefCell<String>,
    }

    impl Constraint for Logged<'_> {
        fn begin_substep(&mut self, _: &[Point], _: &[Point], _: &[Real], _: Real) {}
        fn project(&mut self, _: &mut [Point], _: &[Real], _: Real) -> Residual {
            self.log.borrow_mut().push(self.letter);
            Residual::default()
        }
        fn stage(&self) -> Stage {
            self.stage
        }
    }

    #[test]
    fn groups_are_visited_stage_by_stage_in_the_order_given() {
        use ContactOrder::{AfterStretch, BeforeStretch, Both};
        // Contact order, sweeps, contact visits, final contact visits.
        for (contact_order, sweeps, contact_visits, final_contact_visits, expected) in [
            (AfterStretch, 2, 1, 0, "abCDabCDz"),
            (BeforeStretch, 2, 1, 0, "CDababz"),
            (Both, 2, 1, 0, "CDabCDabCDz"),
            (AfterStretch, 1, 2, 3, "abCDCDCDCDCDz"),
            (AfterStretch, 0, 3, 0, "CDCDCDz"),
            (BeforeStretch, 1, 1, 1, "CDabCDz"),
        ] {
            let log = std::cell::RefCell::new(String::new());
            let of = |letter, stage| Logged { letter, stage, log: &log };
            let (mut last, mut first) = (of('z', Stage::Final), of('a', Stage::Elastic));
            let (mut c, mut d) = (of('C', Stage::Contact), of('D', Stage::Contact));
            let mut second = of('b', Stage::Elastic);
            let params = SolverParams {
                substeps: 1,
                contact_order,
                sweeps,
                contact_visits,
                final_contact_visits,
                ..Default::default()
            };
            let groups: &mut [&mut dyn Constraint] =
                &mut [&mut last, &mut c, &mut first, &mut d, &mut second];
            Solver::new(params).unwrap().step(&mut three(), groups).unwrap();
            assert_eq!(log.take(), expected);
        }
    }

    #[test]
    fn no_sweeps_move_nothing_and_no_particles_are_fine() {
        let mut attach = Attachments::new();
        attach.push(0, Point::new(0.0, 0.1, 0.0), 0.0).unwrap();
        let mut solver = Solver::new(SolverParams { sweeps: 0, ..Default::default() }).unwrap();
        let mut p = three();
        solver.step(&mut p, &mut [&mut attach]).unwrap();
        assert_eq!(p.positions, three().positions);
        assert_eq!(solver.step(&mut Particles::default(), &mut []).unwrap().moved, 0.0);
    }

    #[test]
    fn a_pinned_particle_never_moves() {
        let mut p = three().pinned([1]);
        p.velocities[1] = Vector::new(5.0, 0.0, 0.0);
        let params = SolverParams { gravity: [0.0, -9.81, 0.0], ..dynamic() };
        Solver::new(params).unwrap().step(&mut p, &mut []).unwrap();
        assert_eq!(p.positions[1], Point::new(1.0, 0.0, 0.0));
        assert!(p.positions[0].y < 0.0);
    }
}
