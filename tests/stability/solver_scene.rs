//! A random scene for the solver: everything drawn once, so that it can be run again, turned, or on
//! other threads.

use crate::cases::Random;
use crate::fields::Hostile;
use crate::meshes;
use if_core::closest::ClosestPoint;
use if_core::edges::Edges;
use if_core::math::{Point, Real, Vector};
use if_core::mesh::TriMesh;
use if_core::shapes::meshes::icosphere;
use if_mesh::index::Bvh;
use if_xpbd::air::{Air, AirParams, AirReading};
use if_xpbd::attach::Attachments;
use if_xpbd::collision::{Push, SdfCollision};
use if_xpbd::constraint::{Constraint, Residual, Stage};
use if_xpbd::edge_set::EdgeSet;
use if_xpbd::fixed_offsets::FixedOffsets;
use if_xpbd::half_space::HalfSpaces;
use if_xpbd::inner_surface::InnerSurface;
use if_xpbd::params::{ContactOrder, LambdaForm, Motion, SolverParams};
use if_xpbd::particles::Particles;
use if_xpbd::report::{StepError, StepReport};
use if_xpbd::separation::Separations;
use if_xpbd::solver::Solver;
use if_xpbd::strain_limit::StrainLimit;
use if_xpbd::stretch::Stretch;
use if_xpbd::tie::Ties;

/// All that a run needs. Lengths are in units of `scale` where they say nothing else.
#[derive(Clone, Debug)]
pub struct Scene {
    pub rest: TriMesh,
    pub scale: Real,
    pub start: Particles,
    pub params: SolverParams,
    pub stretch: bool,
    /// Compliance of the distances across edges.
    pub bending: Option<Real>,
    pub strain: Option<(Real, Real)>,
    pub attached: Vec<(u32, Point, Real)>,
    pub field: Option<(Hostile, Push, bool)>,
    pub planes: Vec<([u32; 3], [Real; 3], Vector, Point)>,
    /// How many of the planes are visited with the elastic groups, and give way to the others.
    pub pressing: usize,
    /// Pairs that keep their offset.
    pub offsets: Vec<[u32; 2]>,
    pub ties: Vec<(u32, [u32; 3], Real)>,
    pub parted: Vec<([u32; 3], [u32; 3])>,
    pub air: Option<AirReading>,
    /// Particles with the inverse mass 0 that jump by this much between steps.
    pub teleport: Vector,
    /// A shake of every particle by so many metres after each visit of a group, as coordinates of
    /// another size round, and which one: how rounding grows.
    pub rounding: Option<(Real, u32)>,
    pub steps: u32,
}

/// Moves all that can move by up to `size` in each coordinate, in every visit.
struct Rounding {
    size: Real,
    random: Random,
    stage: Stage,
}

impl Constraint for Rounding {
    fn begin_substep(&mut self, _: &[Point], _: &[Point], _: &[Real], _: Real) {}

    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _: Real) -> Residual {
        for (p, w) in positions.iter_mut().zip(inverse_masses) {
            let by = self.random.vector(self.size);
            if *w > 0.0 {
                *p += by;
            }
        }
        Residual::default()
    }

    fn stage(&self) -> Stage {
        self.stage
    }
}

/// What a run ended in.
#[derive(Clone, Debug, PartialEq)]
pub struct Ran {
    pub particles: Particles,
    pub reports: Vec<StepReport>,
    /// What the fastest particle covers in each step at the speed with which it begins it, in
    /// metres.
    pub flights: Vec<Real>,
    pub error: Option<StepError>,
}

impl Scene {
    /// Anything. `None` where the masses of the mesh cannot be (areas so small that 1/m is
    /// infinite).
    pub fn any(r: &mut Random) -> Option<Self> {
        let scale = r.power(-6.0, 6.0);
        let aspect = if r.chance(0.5) { 1.0 } else { r.power(0.0, 6.0) };
        let offset = r.pick(&[0.0, 0.0, 0.0, 1.0, 1e4]) * scale * r.vector(1.0);
        let mesh = meshes::any(r);
        let rest = meshes::placed(&mesh, r, scale, aspect, offset);
        let n = rest.vertices().len();

        let noise = r.pick(&[0.0, 1e-6, 0.05, 0.5]) * scale;
        let positions = rest.vertices().iter().map(|p| p + r.vector(noise)).collect();
        let mut start = match r.below(5) {
            0 => Particles::from_area_density(&rest, r.power(-3.0, 1.0)).ok()?,
            1 => Particles::new(positions, (0..n).map(|_| r.pick(&[1.0, 1e6])).collect()).ok()?,
            2 => Particles::new(positions, (0..n).map(|_| r.power(-6.0, 6.0)).collect()).ok()?,
            3 => Particles::new(positions, (0..n).map(|_| r.pick(&[0.0, 1.0])).collect()).ok()?,
            _ => Particles::uniform(positions, r.pick(&[0.0, 1e-6, 1.0, 1e6])).ok()?,
        };
        let speed = r.pick(&[0.0, 0.0, 1.0, 10.0, 10.0 * scale]);
        start.velocities.iter_mut().for_each(|v| *v = r.vector(speed));
        if r.chance(0.3) && n > 0 {
            start = start.pinned([r.below(n) as u32]);
        }

        let params = params(r, scale);
        let beta = |r: &mut Random| if r.chance(0.2) { 0.0 } else { r.power(-12.0, 8.0) };
        let bending = r.chance(0.4).then(|| beta(r));
        let stretch = r.chance(0.9);
        let mut scene = Self {
            stretch,
            bending,
            strain: r
                .chance(0.2)
                .then(|| (r.between(0.0, 1.0), r.pick(&[1.0, 1.1, Real::INFINITY]))),
            attached: Vec::new(),
            field: r.chance(0.6).then(|| {
                let center = Point::from(offset) + r.vector(0.7 * scale);
                (
                    Hostile::any(r, center, scale),
                    if r.chance(0.85) { Push::Corrected } else { Push::Literal },
                    r.chance(0.5),
                )
            }),
            planes: Vec::new(),
            pressing: 0,
            offsets: Vec::new(),
            ties: Vec::new(),
            parted: Vec::new(),
            air: r.chance(0.2).then(|| {
                use AirReading::{Element, FrozenHalfSpace, GapPreserving, Literal};
                r.pick(&[Literal, FrozenHalfSpace, GapPreserving, Element])
            }),
            teleport: if r.chance(0.2) { r.vector(10.0 * scale) } else { Vector::zeros() },
            rounding: None,
            steps: 1 + r.below(3) as u32,
            rest,
            scale,
            start,
            params,
        };
        scene.draw_contacts(r, offset, beta);
        Some(scene)
    }

    fn draw_contacts(
        &mut self,
        r: &mut Random,
        offset: Vector,
        beta: impl Fn(&mut Random) -> Real,
    ) {
        let (n, scale) = (self.start.len(), self.scale);
        let vertex = |r: &mut Random| r.below(n) as u32;
        let place = |r: &mut Random| Point::from(offset) + r.vector(scale);
        if n > 0 && r.chance(0.3) {
            self.attached = (0..1 + r.below(4)).map(|_| (vertex(r), place(r), beta(r))).collect();
        }
        if n > 0 && r.chance(0.3) {
            let contact = |r: &mut Random| {
                let (v, b) = ([vertex(r), vertex(r), vertex(r)], [r.unit(), r.unit(), r.unit()]);
                let distinct = v[0] != v[1] && v[0] != v[2] && v[1] != v[2];
                let sum: Real = b.iter().sum();
                let normal = if_core::math::unit_or_zero(&r.vector(1.0));
                (v, if distinct { b.map(|x| x / sum) } else { [1.0, 0.0, 0.0] }, normal, place(r))
            };
            self.planes = (0..1 + r.below(8)).map(|_| contact(r)).collect();
            self.pressing = r.below(self.planes.len() + 1);
        }
        let triangles = self.rest.triangles().to_vec();
        if triangles.len() > 1 && r.chance(0.3) {
            let edges = Edges::new(&self.rest).vertices;
            for _ in 0..1 + r.below(8) {
                let (s, t) = (r.pick(&triangles), r.pick(&triangles));
                let v = vertex(r);
                match r.below(3) {
                    0 => self.offsets.push(r.pick(&edges)),
                    1 if !t.contains(&v) => self.ties.push((v, t, r.unit())),
                    2 if s != t => self.parted.push((s, t)),
                    _ => {}
                }
            }
        }
    }

    /// What matters of the scene, without its numbers of vertices.
    pub fn told(&self) -> String {
        let Self {
            scale, params: p, stretch, bending, strain, field, air, teleport, steps, ..
        } = self;
        let (n, t) = (self.start.len(), self.rest.triangles().len());
        let masses = || self.start.inverse_masses.iter().filter(|w| **w > 0.0);
        let ratio = masses().fold(0.0, |a: Real, b| a.max(*b))
            / masses().fold(Real::INFINITY, |a, b| a.min(*b));
        format!(
            "{n} vertices, {t} triangles, scale {scale:.1e}, mass ratio {ratio:.0e}, {steps} x {:.1e} s / {} x {} sweeps ({} + {} contact visits), beta {:.1e} {:?} {:?} {:?}, \
             stretch {stretch:?}, bending {bending:?}, strain {strain:?}, {} attached, field {:?}, {} planes ({} pressing), {} offsets, \
             {} ties, {} parted, air {air:?}, teleport {:.1e}, friction {}, max_push {:.1e}, clearance {:.1e}",
            p.time_step,
            p.substeps,
            p.sweeps,
            p.contact_visits,
            p.final_contact_visits,
            p.compliance,
            p.lambda_form,
            p.contact_order,
            p.motion,
            self.attached.len(),
            field.map(|(f, push, between)| (f.solid, f.fault, push, between)),
            self.planes.len(),
            self.pressing,
            self.offsets.len(),
            self.ties.len(),
            self.parted.len(),
            teleport.norm(),
            p.friction,
            p.max_push,
            p.clearance,
        )
    }

    /// The largest length in sight, in metres: of cloth, targets, fields, jumps and what a free
    /// fall covers in a step.
    pub fn reach(&self) -> Real {
        let mut whole = self.rest.aabb();
        for p in self
            .start
            .positions
            .iter()
            .chain(self.attached.iter().map(|(_, t, _)| t))
            .chain(self.planes.iter().map(|x| &x.3))
        {
            whole = whole.grown_to(p);
        }
        let speed = self.start.velocities.iter().map(Vector::norm).fold(0.0, Real::max);
        let t = self.params.time_step * Real::from(self.steps);
        let fall = t * (speed + t * Vector::from(self.params.gravity).norm());
        whole.diagonal() + 2.0 * self.scale + self.teleport.norm() * Real::from(self.steps) + fall
    }

    /// The steps, from `particles` on, with groups made anew; stops at the first error.
    pub fn run_from(&self, mut particles: Particles, steps: std::ops::Range<u32>) -> Ran {
        let inner = icosphere(0.5 * self.scale, 1);
        let tree = Bvh::new(&inner);
        let surface = InnerSurface::new(&inner, &tree as &dyn ClosestPoint);
        let mut groups = self.groups(&surface);
        let mut groups: Vec<&mut dyn Constraint> =
            groups.iter_mut().map(|g| g.as_mut() as &mut dyn Constraint).collect();
        let mut solver = Solver::new(self.params.clone()).unwrap();
        let (mut reports, mut flights) = (Vec::new(), Vec::new());
        for step in steps {
            if step > 0 && self.teleport != Vector::zeros() {
                for k in 0..particles.len() {
                    if particles.inverse_masses[k] == 0.0 {
                        particles.positions[k] += self.teleport;
                    }
                }
                groups.iter_mut().for_each(|g| g.reset());
            }
            let before = particles.clone();
            flights.push(
                self.params.time_step
                    * particles.velocities.iter().map(Vector::norm).fold(0.0, Real::max),
            );
            match solver.step(&mut particles, &mut groups) {
                Ok(report) => reports.push(report),
                Err(error) => {
                    assert_eq!(particles, before, "a failed step leaves the state as it was");
                    return Ran { particles, reports, flights, error: Some(error) };
                }
            }
        }
        Ran { particles, reports, flights, error: None }
    }

    pub fn run(&self) -> Ran {
        self.run_from(self.start.clone(), 0..self.steps)
    }

    fn groups<'a>(&'a self, surface: &'a InnerSurface<'a>) -> Vec<Box<dyn Constraint + 'a>> {
        let mut groups: Vec<Box<dyn Constraint>> = Vec::new();
        let (n, scale, beta) = (self.start.len(), self.scale, self.params.compliance);
        let gap = 1e-3 * scale;
        let edges = || EdgeSet::of_mesh(&self.rest);
        let sprung = |set: EdgeSet, beta: Real| -> Box<dyn Constraint> {
            let mut group = Stretch::new(set, beta).unwrap();
            group.form = self.params.lambda_form;
            Box::new(group)
        };
        if self.stretch {
            groups.push(sprung(edges(), beta));
        }
        if let Some(beta) = self.bending {
            groups.push(sprung(across_edges(&self.rest), beta));
        }
        if let Some((min, max)) = self.strain {
            groups.push(Box::new(StrainLimit::new(edges(), min, max).unwrap()));
        }
        let mut attached = Attachments::new();
        attached.form = self.params.lambda_form;
        self.attached.iter().for_each(|(v, t, b)| attached.push(*v, *t, *b).unwrap());
        groups.push(Box::new(attached));
        let mut ties = Ties::new();
        self.ties.iter().for_each(|(v, t, share)| {
            ties.push(*v, *t, [0.2, 0.3, 0.5], *share, self.rest.vertices()).unwrap()
        });
        groups.push(Box::new(ties));
        if let Some((field, push, between)) = &self.field {
            let (masks, clearances) = (vec![1.0; n], vec![self.params.clearance; n]);
            let mut collision = SdfCollision::new(field, &masks, &clearances).unwrap();
            if *between {
                // No length of an edge of the meshes drawn: rounding would choose.
                collision.add_between(&self.rest, 0.217 * scale, &masks, &clearances).unwrap();
            }
            (collision.push, collision.friction, collision.max_push) =
                (*push, self.params.friction, self.params.max_push);
            groups.push(Box::new(collision));
        }
        let (pressing, others) = self.planes.split_at(self.pressing.min(self.planes.len()));
        for (planes, stage) in [(pressing, Stage::Elastic), (others, Stage::Contact)] {
            let mut group = HalfSpaces::new();
            (group.friction, group.max_push, group.max_lever) =
                (self.params.friction, self.params.max_push, 4.0);
            group.stage = stage;
            planes.iter().for_each(|(v, b, normal, q)| group.push(*v, *b, *normal, q, gap));
            groups.push(Box::new(group));
        }
        let mut parted = Separations::new();
        for (s, t) in &self.parted {
            parted.push(*s, *t, gap, self.rest.vertices());
        }
        groups.push(Box::new(parted));
        groups.push(Box::new(FixedOffsets::new(self.offsets.clone(), self.rest.vertices())));
        if let Some(reading) = self.air {
            let params = AirParams {
                reading,
                max_distance: scale,
                min_gap: gap,
                max_gap: 5.0 * gap,
                ..AirParams::default()
            };
            groups.push(Box::new(
                Air::new(surface, &self.start.positions, &vec![1.0; n], params).unwrap(),
            ));
        }
        match self.rounding {
            Some((size, number)) => rounded(groups, size, number),
            None => groups,
        }
    }
}

/// For each inner edge the distance of the two corners across it, as the product's cloth has them.
pub fn across_edges(mesh: &TriMesh) -> EdgeSet {
    let edges = Edges::new(mesh);
    let mut across: Vec<[u32; 2]> = Vec::new();
    for (e, ends) in edges.vertices.iter().enumerate().filter(|(e, _)| edges.valence[*e] == 2) {
        let opposite = edges.triangles[e]
            .map(|t| mesh.triangles()[t as usize].into_iter().find(|v| !ends.contains(v)));
        if let [Some(a), Some(b)] = opposite
            && a != b
        {
            across.push([a, b]);
        }
    }
    let x = mesh.vertices();
    let rests: Vec<Real> =
        across.iter().map(|[a, b]| (x[*a as usize] - x[*b as usize]).norm()).collect();
    EdgeSet::new(&across, &rests, x.len()).unwrap()
}

/// The groups with a shake before the first of a stage and after each.
fn rounded<'a>(
    groups: Vec<Box<dyn Constraint + 'a>>,
    size: Real,
    number: u32,
) -> Vec<Box<dyn Constraint + 'a>> {
    let shake = |stage, k: usize| -> Box<dyn Constraint + 'a> {
        let random = Random::new("rounding", number.wrapping_mul(100) + k as u32);
        Box::new(Rounding { size, random, stage })
    };
    let mut all = vec![shake(Stage::Elastic, 0), shake(Stage::Contact, 1)];
    for (k, group) in groups.into_iter().enumerate() {
        let after = shake(group.stage(), k + 2);
        all.extend([group, after]);
    }
    all
}

fn params(r: &mut Random, scale: Real) -> SolverParams {
    let motion = if r.chance(0.5) {
        Motion::QuasiStatic
    } else {
        Motion::Dynamic { damping: r.pick(&[0.0, 0.5, 10.0]) }
    };
    let gravity = if_core::math::unit_or_zero(&r.vector(1.0)) * r.pick(&[0.0, 9.81]);
    SolverParams {
        time_step: r.power(-5.0, 0.0),
        substeps: 1 + r.below(8) as u32,
        sweeps: r.below(6) as u32,
        compliance: if r.chance(0.2) { 0.0 } else { r.power(-12.0, 8.0) },
        contact_visits: r.pick(&[1, 1, 2]),
        final_contact_visits: r.pick(&[0, 0, 3]),
        lambda_form: match r.below(20) {
            0..3 => LambdaForm::Printed,
            3..9 => LambdaForm::Pbd,
            _ => LambdaForm::Xpbd,
        },
        contact_order: r.pick(&[
            ContactOrder::BeforeStretch,
            ContactOrder::AfterStretch,
            ContactOrder::Both,
        ]),
        motion,
        gravity: gravity.into(),
        friction: r.pick(&[0.0, 0.3, 10.0]),
        clearance: r.pick(&[0.0, 1e-3, 0.1]) * scale,
        max_push: r.pick(&[0.01 * scale, Real::INFINITY]),
        remove_depenetration_velocity: r.chance(0.7),
        energy_jump: r.pick(&[1e4, Real::INFINITY]),
        ..SolverParams::default()
    }
}
