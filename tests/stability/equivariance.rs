//! What a change of units, of place or of pose must not change, and what no constraint between
//! particles may.

use crate::cases::{Random, Tally, cases, check, share};
use crate::fields::{Fault, Hostile, Solid};
use crate::solver_scene::{Ran, Scene};
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_xpbd::params::{LambdaForm, Motion, SolverParams};
use if_xpbd::particles::Particles;

fn mapped(mesh: &TriMesh, f: impl FnMut(&Point) -> Point) -> TriMesh {
    mesh.with_vertices(mesh.vertices().iter().map(f).collect()).unwrap()
}

fn map_particles(
    p: &Particles,
    place: impl Fn(&Point) -> Point,
    speed: impl Fn(&Vector) -> Vector,
    weight: Real,
) -> Particles {
    let mut q = p.clone();
    q.positions.iter_mut().for_each(|x| *x = place(x));
    q.previous.clone_from(&q.positions);
    q.velocities.iter_mut().for_each(|v| *v = speed(v));
    q.inverse_masses.iter_mut().for_each(|w| *w *= weight);
    q
}

/// The scene in units that are smaller by these factors: the same numbers of metres, seconds and
/// kilograms times them.
fn in_units(scene: &Scene, length: Real, time: Real, mass: Real) -> Scene {
    let place = |x: &Point| Point::from(x.coords * length);
    let compliance = time * time / mass;
    let mut s = scene.clone();
    s.rest = mapped(&s.rest, place);
    s.scale *= length;
    s.start = map_particles(&s.start, place, |v| v * (length / time), 1.0 / mass);
    s.params.time_step *= time;
    s.params.compliance *= compliance;
    s.params.gravity = s.params.gravity.map(|g| g * (length / (time * time)));
    s.params.clearance *= length;
    s.params.max_push *= length;
    if let Motion::Dynamic { damping } = &mut s.params.motion {
        *damping /= time;
    }
    s.bending = s.bending.map(|c| c * compliance);
    s.attached.iter_mut().for_each(|(_, t, c)| (*t, *c) = (place(t), *c * compliance));
    if let Some((field, ..)) = &mut s.field {
        (field.center, field.size) = (place(&field.center), field.size * length);
        if let Fault::Noise(height) = &mut field.fault {
            *height *= length;
        }
    }
    s.planes.iter_mut().for_each(|(.., q)| *q = place(q));
    s.teleport *= length;
    s
}

fn units(count: u32) -> Tally {
    cases("units", count, |r| {
        let Some(mut scene) = Scene::any(r) else { return Ok("no masses") };
        // Jumps are counted from 1 m and 1 m/s, and line 18 as printed adds metres to kilograms.
        scene.params.energy_jump = Real::INFINITY;
        scene.params.displacement_jump = Real::INFINITY;
        if scene.params.lambda_form == LambdaForm::Printed {
            scene.params.lambda_form = LambdaForm::Xpbd;
        }
        let two = |r: &mut Random| (2.0 as Real).powi(r.below(41) as i32 - 20);
        let (length, time, mass) = (two(r), two(r), two(r));
        let (here, there) = (scene.run(), in_units(&scene, length, time, mass).run());
        check(here.error.is_some() == there.error.is_some(), || {
            format!(
                "{:?} and {:?} with units of {length}, {time}, {mass}: {}",
                here.error,
                there.error,
                scene.told()
            )
        })?;
        if here.error.is_some() {
            return Ok("error in both");
        }
        let place = |x: &Point| Point::from(x.coords * length);
        let expected = map_particles(&here.particles, place, |v| v * (length / time), 1.0 / mass);
        let same = expected.positions == there.particles.positions
            && expected.velocities == there.particles.velocities;
        check(same, || {
            format!("other bits with units of {length}, {time}, {mass}: {}", scene.told())
        })?;
        Ok("same bits")
    })
}

#[test]
fn units_of_length_time_and_mass_change_no_bit() {
    assert!(share(&units(1_000), "same bits") > 0.9);
}

#[test]
#[ignore = "stress"]
fn units_of_length_time_and_mass_change_no_bit_in_many_scenes() {
    units(20_000);
}

/// A scene without thresholds that rounding could tip: no separations, and only balls.
fn smooth(r: &mut Random) -> Option<Scene> {
    let mut scene = Scene::any(r)?;
    scene.parted.clear();
    scene.air = None;
    scene.steps = 1;
    scene.params.energy_jump = Real::INFINITY;
    let place = scene.rest.aabb().center() - Vector::new(0.0, 0.0, 0.4 * scene.scale);
    scene.field = scene.field.map(|(_, push, between)| {
        let ball =
            Hostile { solid: Solid::Ball, center: place, size: scene.scale, fault: Fault::None };
        (ball, push, between)
    });
    Some(scene)
}

fn moved(scene: &Scene, turn: &nalgebra::Rotation3<Real>, by: Vector) -> Scene {
    let place = |x: &Point| turn * x + by;
    let mut s = scene.clone();
    s.rest = mapped(&s.rest, place);
    s.start = map_particles(&s.start, place, |v| turn * v, 1.0);
    s.params.gravity = (turn * Vector::from(s.params.gravity)).into();
    s.attached.iter_mut().for_each(|(_, t, _)| *t = place(t));
    if let Some((field, ..)) = &mut s.field {
        field.center = place(&field.center);
    }
    s.planes.iter_mut().for_each(|(_, _, n, q)| (*n, *q) = (turn * *n, place(q)));
    s
}

/// The largest coordinate.
fn farthest(scene: &Scene) -> Real {
    scene.rest.vertices().iter().map(|p| p.coords.amax()).fold(0.0, Real::max)
}

/// How often a scene is run with its rounding shaken, to find how rounding grows in it.
const SHAKES: u32 = 8;
/// Share of a scene's size up to which rounding may grow in a scene that is compared.
const TAMED: Real = 1e-6;
/// How many times the farthest of the shakes a moved scene may differ.
const AMPLIFIED: Real = 30.0;

/// The scene with its start, its rest state and every visit shaken by up to `size` in each
/// coordinate.
fn shaken(scene: &Scene, size: Real, number: u32, r: &mut Random) -> Scene {
    let mut s = scene.clone();
    s.rest = mapped(&s.rest, |x| x + r.vector(size));
    s.start.positions.iter_mut().for_each(|x| *x += r.vector(size));
    s.attached.iter_mut().for_each(|(_, t, _)| *t += r.vector(size));
    s.planes.iter_mut().for_each(|(.., q)| *q += r.vector(size));
    if let Some((field, ..)) = &mut s.field {
        field.center += r.vector(size);
    }
    s.rounding = Some((size, number));
    s
}

fn motions(count: u32) -> Tally {
    cases("rigid motions", count, |r| {
        let Some(mut scene) = smooth(r) else { return Ok("no masses") };
        scene.ties.clear();
        scene.offsets.clear();
        let away = scene.scale * r.pick(&[0.0, 1.0, 1e3]);
        let (turn, by) = (r.rotation(), r.vector(away));
        let whole = scene.reach() + farthest(&scene) + by.norm();
        let (here, there) = (scene.run(), moved(&scene, &turn, by).run());
        let shaken: Vec<_> =
            (0..SHAKES).map(|k| shaken(&scene, 2e-16 * whole, k, r).run()).collect();
        if here.error.is_some() || there.error.is_some() || shaken.iter().any(|s| s.error.is_some())
        {
            return Ok("error");
        }
        let n = scene.start.len();
        let off =
            |f: &dyn Fn(usize) -> Vector| (0..n).map(|k| f(k).norm()).fold(0.0, Real::max) / whole;
        let apart = |ran: &Ran| off(&|k| ran.particles.positions[k] - here.particles.positions[k]);
        let grown = shaken.iter().map(apart).fold(0.0, Real::max);
        let differs =
            off(&|k| turn * here.particles.positions[k] + by - there.particles.positions[k]);
        if grown > TAMED {
            return Ok("rounding grows");
        }
        let allowed = AMPLIFIED * grown;
        check(differs <= allowed, || {
            format!("differs by {differs:e} of its size, shaken by {grown:e}: {}", scene.told())
        })?;
        Ok("same")
    })
}

#[test]
fn a_turned_and_moved_scene_moves_alike() {
    assert!(share(&motions(1_000), "same") > 0.9);
}

#[test]
#[ignore = "stress"]
fn many_turned_and_moved_scenes_move_alike() {
    motions(20_000);
}

/// Share of the momentum that may be lost in any case.
const KEPT: Real = 1e-10;
/// How many times the random walk of all roundings may be lost where that is more.
const WALKS: Real = 8.0;

/// How often a substep writes the position of a particle: once to predict it, and once in every
/// visit.
fn writes(scene: &Scene) -> Real {
    let n = scene.start.len();
    let edges = if_core::edges::Edges::new(&scene.rest).len();
    let stretch = if scene.stretch { 2 * edges } else { 0 };
    let strain = if scene.strain.is_some() { 2 * edges } else { 0 };
    let hinges = if scene.bending.is_some() { 2 * edges } else { 0 };
    let contacts = 18 * scene.parted.len();
    let visits = (sweeps(scene) + 1) * scene.params.contact_visits as usize
        + scene.params.final_contact_visits as usize;
    let others = 4 * scene.ties.len();
    let elastic = sweeps(scene) * (stretch + strain + hinges + others);
    (n + elastic + visits * contacts + 2 * scene.offsets.len()) as Real
}

fn sweeps(scene: &Scene) -> usize {
    scene.params.sweeps as usize
}

/// Momentum of free scenes over 3,600 substeps, with every constraint that acts between particles
/// and every solver.
fn momentum(count: u32) -> Tally {
    cases("momentum", count, |r| {
        let Some(mut scene) = Scene::any(r) else { return Ok("no masses") };
        let n = scene.start.len();
        // Velocities are differences of positions: far from the origin they have fewer digits.
        if n > 0 {
            scene =
                moved(&scene, &nalgebra::Rotation3::identity(), -scene.rest.aabb().center().coords);
        }
        (scene.field, scene.air, scene.teleport) = (None, None, Vector::zeros());
        scene.attached.clear();
        scene.planes.clear();
        scene.start.inverse_masses.iter_mut().for_each(|w| *w = 0.5 + (*w % 1.5));
        let speed = scene.scale;
        scene.start.velocities = (0..n).map(|_| r.vector(speed)).collect();
        scene.params = SolverParams {
            time_step: 0.01,
            substeps: 10,
            gravity: [0.0; 3],
            motion: Motion::Dynamic { damping: 0.0 },
            energy_jump: Real::INFINITY,
            ..scene.params
        };
        scene.steps = 360;
        let ran = scene.run();
        if n == 0 || ran.error.is_some() {
            return Ok(if n == 0 { "nothing" } else { "error" });
        }
        let sum = |p: &Particles| -> Vector {
            (0..n).map(|k| p.velocities[k] / p.inverse_masses[k]).sum()
        };
        // Relative to what could be lost: all that moves at the end or moved at the start.
        let all = |p: &Particles| -> Real {
            (0..n).map(|k| p.velocities[k].norm() / p.inverse_masses[k]).sum()
        };
        let lost = (sum(&ran.particles) - sum(&scene.start)).norm()
            / all(&scene.start).max(all(&ran.particles));
        if lost <= KEPT {
            return Ok("kept");
        }
        // Each write rounds three coordinates by up to half a digit of the farthest, and each
        // rounding is a speed over h.
        let size = |p: &Particles| p.positions.iter().map(|x| x.coords.amax()).fold(0.0, Real::max);
        let digit = Real::EPSILON * size(&scene.start).max(size(&ran.particles));
        let heaviest = scene.start.inverse_masses.iter().map(|w| 1.0 / w).fold(0.0, Real::max);
        let substeps = Real::from(scene.steps * scene.params.substeps);
        let walk = heaviest * digit / scene.params.substep() * (substeps * writes(&scene)).sqrt();
        let walk = walk / all(&scene.start).max(all(&ran.particles));
        check(lost <= WALKS * walk, || {
            format!("{lost:e} of the momentum is lost, rounding walks {walk:e}: {}", scene.told())
        })?;
        Ok("kept but for rounding")
    })
}

#[test]
fn momentum_is_kept_to_1e_10_over_3600_substeps() {
    assert!(share(&momentum(40), "kept") > 0.8);
}

#[test]
#[ignore = "stress"]
fn momentum_is_kept_in_many_scenes() {
    assert!(share(&momentum(2_000), "kept") > 0.9);
}
