//! What needs a scene of its own: bodies that move at up to 10 m/s or jump, pinned vertices driven
//! through them, cloth that begins 1 to 50 mm deep, grids too coarse for what they hold, vertices
//! in another order, and lists of contacts that grow.

use crate::cases::{Random, Tally, cases, check, finite, same_on_all_threads, share};
use crate::meshes;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::monitor::Silent;
use if_core::shapes::meshes::cloth;
use if_core::shapes::{Cuboid, Sphere, Translated};
use if_mesh::baked::{BakeParams, Baked};
use if_xpbd::collision::SdfCollision;
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::params::{Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::report::StepError;
use if_xpbd::separation::Separations;
use if_xpbd::solver::Solver;
use if_xpbd::stretch::Stretch;

/// Steps in which things are driven, and steps in which they come to rest.
const STEPS: [u32; 2] = [8, 30];

/// A body of about 0.4 lengths, a cloth over or in it, and what is done to both.
struct Drive {
    scale: Real,
    body: Box<dyn SignedDistance + Send + Sync>,
    exact: bool,
    mesh: TriMesh,
    start: Particles,
    params: SolverParams,
    friction: Real,
    beta: Real,
    /// Of the body and of the pinned vertices, in metres a second.
    speeds: [Vector; 2],
    /// Of the body, once.
    jump: (u32, Vector),
}

impl Drive {
    fn any(r: &mut Random) -> Self {
        let scale = r.pick(&[1e-3, 1.0, 1.0, 1e3]);
        let ball = Sphere { center: Point::origin(), radius: 0.2 * scale };
        let (exact, body): (bool, Box<dyn SignedDistance + Send + Sync>) = match r.below(4) {
            0 => (
                true,
                Box::new(Cuboid {
                    center: Point::origin(),
                    half: Vector::new(0.2, 0.2, 0.15) * scale,
                }),
            ),
            1 => {
                // Down to cells larger than the ball.
                let cell = r.pick(&[0.02, 0.1, 0.3, 1.0]) * scale;
                let params = BakeParams {
                    cell,
                    accuracy: r.pick(&[1e-3 * scale, Real::INFINITY]),
                    reach: 0.02 * scale,
                    levels: r.below(2) as u32,
                    band: 2.0 * cell,
                    ..BakeParams::default()
                };
                (false, Box::new(Baked::new(&ball, &params, &mut Silent).unwrap()))
            }
            _ => (true, Box::new(ball)),
        };
        let n = 3 + r.below(6) as u32;
        let flat = cloth(0.6 * scale, 0.6 * scale, n, n);
        // From 50 mm deep to 100 mm above.
        let depth = if r.chance(0.7) { r.power(-3.0, -1.3) } else { -r.between(0.0, 0.1) };
        let top = 0.2 - depth;
        let middle = Vector::new(0.3, 0.3, 0.0);
        let place =
            |p: &Point| Point::from((p.coords / scale - middle + Vector::z() * top) * scale);
        let mesh = flat.with_vertices(flat.vertices().iter().map(place).collect()).unwrap();
        let mesh = if r.chance(0.5) { meshes::renumbered(r, &mesh) } else { mesh };
        let mut start = Particles::from_area_density(&mesh, 0.2).unwrap();
        if r.chance(0.5) {
            let count = 1 + r.below(3);
            start = start.pinned((0..count).map(|_| r.below(mesh.vertices().len()) as u32));
        }
        let speed = |r: &mut Random| {
            let metres = r.pick(&[0.0, 1.0, 10.0]);
            if_core::math::unit_or_zero(&r.vector(1.0)) * metres * scale
        };
        let params = SolverParams {
            time_step: r.power(-3.0, -1.3),
            substeps: 1 + r.below(20) as u32,
            sweeps: 1 + r.below(5) as u32,
            motion: Motion::Dynamic { damping: r.pick(&[0.0, 0.5, 10.0]) },
            gravity: [0.0, 0.0, -9.81 * r.pick(&[0.0, scale])],
            max_push: r.pick(&[0.01 * scale, Real::INFINITY]),
            ..SolverParams::default()
        };
        Self {
            scale,
            body,
            exact,
            mesh,
            start,
            params,
            friction: r.pick(&[0.0, 0.3, 2.0]),
            beta: r.pick(&[0.0, 1e-8, 1e-4]),
            speeds: [speed(r), speed(r)],
            jump: (
                r.below(STEPS[0] as usize) as u32,
                if r.chance(0.3) { r.vector(0.5 * scale) } else { Vector::zeros() },
            ),
        }
    }

    fn told(&self) -> String {
        format!(
            "scale {}, {} vertices, {:?}, friction {}, beta {}, speeds {:?}, jump {:?}",
            self.scale,
            self.start.len(),
            self.params,
            self.friction,
            self.beta,
            self.speeds,
            self.jump
        )
    }

    /// Where it ends, where the body is then, and an error where there was one.
    fn run(&self) -> (Particles, Vector, Option<StepError>) {
        let n = self.start.len();
        let mut stretch = Stretch::new(EdgeSet::of_mesh(&self.mesh), self.beta).unwrap();
        let mut particles = self.start.clone();
        let mut by = Vector::zeros();
        let still = Motion::Dynamic { damping: 10.0 };
        for (count, driven) in [(STEPS[0], true), (STEPS[1], false)] {
            let params = if driven {
                self.params.clone()
            } else {
                SolverParams { motion: still, ..self.params.clone() }
            };
            let mut solver = Solver::new(params).unwrap();
            for step in 0..count {
                if driven {
                    by += self.speeds[0] * self.params.time_step;
                    if step == self.jump.0 {
                        by += self.jump.1;
                    }
                    for v in (0..n).filter(|v| self.start.inverse_masses[*v] == 0.0) {
                        particles.positions[v] += self.speeds[1] * self.params.time_step;
                    }
                }
                let field = Translated { field: &*self.body, by };
                let mut contact = SdfCollision::new(&field, &vec![1.0; n], &vec![0.0; n]).unwrap();
                (contact.friction, contact.max_push) = (self.friction, self.params.max_push);
                if let Err(error) = solver.step(&mut particles, &mut [&mut stretch, &mut contact]) {
                    return (particles, by, Some(error));
                }
            }
        }
        (particles, by, None)
    }
}

fn driven(count: u32) -> Tally {
    cases("driven bodies", count, |r| {
        let drive = Drive::any(r);
        let (end, by, error) = drive.run();
        check(
            finite(&end.positions)
                && end.velocities.iter().all(|v| v.iter().all(|c| c.is_finite())),
            || drive.told(),
        )?;
        let time = drive.params.time_step * Real::from(STEPS[0] + STEPS[1]);
        let travel =
            drive.speeds.iter().map(|v| v.norm()).sum::<Real>() * time + drive.jump.1.norm();
        let fall = time * time * Vector::from(drive.params.gravity).norm();
        let room = 100.0 * (drive.scale + travel + fall);
        let far = end.positions.iter().map(|p| p.coords.norm()).fold(0.0, Real::max);
        check(far <= room, || format!("a vertex is {far:e} m away: {}", drive.told()))?;
        match error {
            None => {}
            Some(
                StepError::EnergyJump { vertices, .. }
                | StepError::DisplacementJump { vertices, .. },
            ) if !vertices.is_empty() => {
                return Ok("guarded");
            }
            Some(other) => return Err(format!("{other}: {}", drive.told())),
        }
        // Contacts come last: once all is still, nothing that can move is inside. (Where one push
        // may be short, the cloth may pull as far as that in each substep.)
        if drive.exact && drive.params.max_push.is_infinite() {
            let field = Translated { field: &*drive.body, by };
            let free = (0..end.len()).filter(|v| end.inverse_masses[*v] > 0.0);
            let deepest =
                free.map(|v| field.distance(&end.positions[v])).fold(Real::INFINITY, Real::min);
            check(deepest >= -1e-9 * drive.scale, || {
                format!("{deepest:e} m deep: {}", drive.told())
            })?;
        }
        Ok("ok")
    })
}

#[test]
fn cloth_on_bodies_that_race_and_jump_ends_outside_of_them() {
    let tally = driven(300);
    assert!(share(&tally, "ok") > 0.8, "{tally:?}");
}

#[test]
#[ignore = "stress"]
fn cloth_on_many_bodies_that_race_and_jump_ends_outside_of_them() {
    driven(10_000);
}

#[test]
fn cloth_on_moving_bodies_has_the_same_bits_on_any_number_of_threads() {
    let tally = cases("driven bodies on threads", 10, |r| {
        let drive = Drive::any(r);
        let (.., error) = same_on_all_threads(|| drive.run())?;
        Ok(if error.is_none() { "ok" } else { "guarded" })
    });
    assert!(share(&tally, "ok") > 0.5, "{tally:?}");
}

#[test]
fn lists_of_contacts_grow_and_drop_none() {
    let mesh = cloth(1.0, 1.0, 20, 20);
    let n = mesh.vertices().len() as u32;
    let mut particles = Particles::from_area_density(&mesh, 0.2).unwrap();
    let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-6).unwrap();
    let (mut planes, mut pairs) = (HalfSpaces::new(), Separations::new());
    let params = SolverParams { gravity: [0.0, 0.0, -9.81], ..SolverParams::default() };
    let mut solver = Solver::new(params).unwrap();
    let mut random = Random::new("growing lists", 0);
    for count in [0usize, 1, 10, 1_000, 100_000] {
        while planes.len() < count {
            let v = random.below(n as usize) as u32;
            planes.push([v; 3], [1.0, 0.0, 0.0], Vector::z(), &Point::new(0.0, 0.0, -0.01), 0.0);
        }
        while pairs.len() < count {
            let (s, t) = (random.pick(mesh.triangles()), random.pick(mesh.triangles()));
            if s != t {
                pairs.push(s, t, 1e-6, mesh.vertices());
            }
        }
        let report =
            solver.step(&mut particles, &mut [&mut stretch, &mut planes, &mut pairs]).unwrap();
        assert_eq!(report.contact.count, planes.len() + pairs.len(), "contacts visited");
        let lowest = particles.positions.iter().map(|p| p.z).fold(0.0, Real::min);
        assert!(finite(&particles.positions) && lowest > -1.0, "{count} contacts: {lowest}");
    }
}
