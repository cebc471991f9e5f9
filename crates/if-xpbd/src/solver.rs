//! The loop over steps and substeps: lines 1 to 3 and 23 to 26 of Algorithm 1.

use crate::constraint::{Constraint, Counters, Residual, Stage};
use crate::params::{ContactOrder, Motion, ParamsError, SolverParams};
use crate::particles::Particles;
use crate::report::{RunReport, StepError, StepReport, Stop};
use if_core::aabb::Aabb;
use if_core::math::{Real, Vector};
use std::ops::ControlFlow;

/// Most vertices that an error names.
const NAMED: usize = 16;

/// Moves particles under groups of constraints.
///
/// ```text
/// h ← Δt / numSubSteps                                     line 1
/// for each substep                                         2, 25
///   pᵢ ← p;  v ← v + h g (or h g: quasi-static);  p ← p + h v     3
///   every group: λ ← 0, β̃ ← β / h²                         4, 5
///   [contacts]                                             6 to 15, where they stand as printed
///   for each sweep: elastic groups; [contacts]             16 to 22, and the correction
///   [contacts alone];  final groups                        ours
///   v ← (p − pᵢ) / h;  contacts take back their push       23, 24
/// ```
///
/// A step that ends in a state which is not finite, whose kinetic energy jumps, or in which a
/// vertex moves absurdly far, is taken back and tried with h/2, at most
/// [`retries`](SolverParams::retries) times. The whole state is taken back, islands that went well
/// included: what they then repeat is what they did. A step reads and writes on one thread in a
/// fixed order (fields may answer on several): the bits do not depend on threads.
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
    pub fn new(params: SolverParams) -> Result<Self, ParamsError> {
        params.validate()?;
        Ok(Self { params, backup: Particles::default() })
    }

    /// Replaces the parameters; memory is kept.
    ///
    /// # Errors
    ///
    /// See [`SolverParams::validate`]. The old parameters are then kept.
    pub fn set_params(&mut self, params: SolverParams) -> Result<(), ParamsError> {
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
    /// A state that is not finite, a group that [cannot be solved](Constraint::check), an energy
    /// jump or a displacement jump, which smaller substeps did not cure.
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
        groups.iter().try_for_each(|group| group.check())?;
        // The inverse masses are not written: groups receive them read-only.
        copy_state(particles, &mut self.backup);
        // A quasi-static motion has no speed: its pushes over h would grow as h shrinks.
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
            tracing::debug!(retries, %fault, "the step is taken back and tried with half the substep");
        }
    }

    /// Steps until nothing moves any more, the steps are used up, or `on_step` (called with the
    /// number of steps made) breaks.
    ///
    /// # Errors
    ///
    /// As [`Solver::step`].
    ///
    /// # Panics
    ///
    /// As [`Solver::step`].
    pub fn run(
        &mut self,
        particles: &mut Particles,
        groups: &mut [&mut dyn Constraint],
        mut on_step: impl FnMut(u32, &StepReport) -> ControlFlow<()>,
    ) -> Result<RunReport, StepError> {
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
            let converged = report.moved < self.params.stop_below;
            let cancelled = on_step(run.steps, &report).is_break();
            run.last = Some(report);
            if converged || cancelled {
                run.stop = if converged { Stop::Converged } else { Stop::Cancelled };
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
            // What crosses the scene in a step is looked at only where the energy before would not
            // do.
            if energy > allowed && energy > self.crossing(movable_mass(particles)) {
                let allowed = allowed.max(self.crossing(movable_mass(particles)));
                let speed = |k: usize| particles.velocities[k].norm_squared();
                return Err(StepError::EnergyJump {
                    vertices: most(particles.len(), speed),
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
        // The size of the scene is looked at only where 1 m would not do.
        if report.moved > self.params.displacement_jump {
            let allowed = self.params.displacement_jump * self.size().max(1.0);
            if report.moved > allowed {
                let far =
                    |k: usize| (particles.positions[k] - self.backup.positions[k]).norm_squared();
                return Err(StepError::DisplacementJump {
                    vertices: most(particles.len(), far),
                    moved: report.moved,
                    allowed,
                    h,
                });
            }
        }
        Ok(report)
    }

    /// The kinetic energy of all that can move at the speed that crosses the scene in Δt, in
    /// joules: a constraint that is far from held carries its vertices across the scene at once,
    /// however large that is, and what it did is a speed from then on.
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

/// The particles with most of something, most first.
fn most(count: usize, of: impl Fn(usize) -> Real) -> Vec<u32> {
    let mut all: Vec<u32> = (0..count as u32).collect();
    all.sort_by(|&a, &b| of(b as usize).total_cmp(&of(a as usize)).then(a.cmp(&b)));
    all.truncate(NAMED);
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attach::Attachments;
    use crate::bending::{Bending, BendingModel};
    use crate::direct::DirectStretch;
    use crate::edge_set::EdgeSet;
    use crate::stretch::Stretch;
    use if_core::math::Point;

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
    fn a_step_that_goes_wrong_is_taken_back_and_made_with_smaller_substeps() {
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
    fn trouble_that_stays_is_an_error_that_names_the_vertex_and_leaves_the_state() {
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
    fn a_compliance_that_is_none_is_an_error_that_says_whose_and_leaves_the_state() {
        let edges = || EdgeSet::new(&[[0, 1], [1, 2]], &[1.0, 1.0], 3).unwrap();
        let hinge = [[0, 1, 2, 3]];
        let bent = [
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(0.5, 1.0, 0.3),
            Point::new(0.5, -1.0, 0.0),
        ];
        for value in [-1e-9, Real::NAN, Real::NEG_INFINITY] {
            let mut attached = Attachments::new();
            attached.push(0, Point::origin(), 0.0);
            attached.push(1, Point::origin(), value);
            let groups: [(Box<dyn Constraint>, &str); 4] = [
                (Box::new(Stretch::new(edges(), value)), "the stretch constraints"),
                (Box::new(DirectStretch::new(edges(), value)), "the stretch constraints"),
                (
                    Box::new(Bending::of_hinges(&hinge, &bent, BendingModel::Dihedral, value)),
                    "the bending constraints",
                ),
                (Box::new(attached), "attachment constraint 1"),
            ];
            for (mut group, says) in groups {
                let mut p = three();
                let error =
                    Solver::new(dynamic()).unwrap().step(&mut p, &mut [&mut *group]).unwrap_err();
                assert!(
                    error.to_string().contains(says)
                        && error.to_string().contains(&value.to_string()),
                    "{error}"
                );
                assert_eq!(p, three());
            }
        }
        for value in [0.0, 1e-300, Real::INFINITY] {
            Stretch::new(edges(), value).check().unwrap();
        }
    }

    #[test]
    fn a_speed_that_crosses_the_scene_in_a_step_is_no_jump_however_large_the_scene() {
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
    fn a_vertex_that_moves_absurdly_far_is_taken_back_in_a_quasi_static_run_too() {
        // Three particles over 2 m: 2e4 m are allowed. The default is quasi-static, where no energy
        // is looked at.
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
    fn a_run_stops_when_nothing_moves_or_when_it_is_told_to() {
        let mut attach = Attachments::new();
        attach.push(0, Point::new(0.0, 0.1, 0.0), 1e-6);
        let mut solver = Solver::new(SolverParams::default()).unwrap();
        let mut p = three();
        let run = solver
            .run(&mut p, &mut [&mut attach, &mut Attachments::new()], |_, _| {
                ControlFlow::Continue(())
            })
            .unwrap();
        assert_eq!(run.stop, Stop::Converged);
        assert!(run.steps < 20 && run.substeps == 10 * u64::from(run.steps));
        assert_eq!(run.last.unwrap().idle_groups, 1);
        assert!((p.positions[0].y - 0.1).abs() < 1e-6);
        let run = solver.run(&mut three(), &mut [&mut attach], |steps, _| {
            if steps == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        let run = run.unwrap();
        assert_eq!((run.steps, run.stop), (2, Stop::Cancelled));
        let mut none = Solver::new(SolverParams { steps: 0, ..Default::default() }).unwrap();
        let run = none.run(&mut three(), &mut [], |_, _| ControlFlow::Continue(())).unwrap();
        assert_eq!((run.stop, run.last), (Stop::Exhausted, None));
    }

    #[test]
    fn no_sweeps_move_nothing_and_no_particles_are_fine() {
        let mut attach = Attachments::new();
        attach.push(0, Point::new(0.0, 0.1, 0.0), 0.0);
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
