//! The contacts and edges that the sweeps of a solve visit.

use super::contact::Contact;
use super::scene::Scene;
use if_core::math::{Point, Real, Vector, larger};

/// Distance beyond its gap, in metres, at which a contact is visited, until the next selection.
const AWAKE: Real = 5e-4;
/// Residual of an edge, in metres, below which it is not visited. With ten times more the
/// displacement of frames differs by what counts as jitter.
const RESIDUAL: Real = 1e-5;
/// Violation of a contact, as a share of its gap, at which a solve ends. Verification decides; ten
/// times less takes a third more sweeps and changes nothing.
const TOLERANCE: Real = 0.1;
/// Least violation that counts, in metres.
const NEGLIGIBLE: Real = 5e-6;
/// What rounding may do to the value of a contact, in metres, with plenty to spare.
const ROUNDING: Real = 1e-9;

/// How vertices have moved in a solve, from one selection to the next.
#[derive(Debug, Default)]
pub(super) struct Moves {
    last: Vec<Point>,
    /// Whether each vertex has moved since the last selection.
    has_moved: Vec<bool>,
    /// How far any contact's value may have changed since the first selection, in metres.
    travelled: Real,
}

impl Moves {
    /// Takes the positions of a selection.
    pub(super) fn update(&mut self, x: &[Point]) {
        if self.last.is_empty() {
            self.last = x.to_vec();
            self.has_moved = vec![true; x.len()];
            return;
        }
        let mut largest = 0.0;
        for ((last, x), has_moved) in self.last.iter_mut().zip(x).zip(&mut self.has_moved) {
            *has_moved = *last != *x;
            largest = larger((x - *last).norm_squared(), largest);
            *last = *x;
        }
        // Of the four coefficients of a contact those of either side sum to one.
        self.travelled += 2.0 * largest.sqrt();
    }
}

/// A contact with all that a sweep reads of it, in two lines of the cache.
#[derive(Clone, Copy, Debug)]
struct Active {
    contact: Contact,
    /// Coefficients by inverse masses.
    mobilities: [Real; 4],
    /// Sum of squared coefficients by inverse masses.
    weight: Real,
    force: Real,
}

impl Active {
    fn push(&self, x: &mut [Point], force: Real) {
        push(x, (&self.contact, &self.mobilities), force);
    }
}

/// Moves the vertices of a contact of these mobilities as a force pushes them.
fn push(x: &mut [Point], (contact, mobilities): (&Contact, &[Real; 4]), force: Real) {
    if force != 0.0 {
        for (v, mobility) in contact.vertices.iter().zip(mobilities) {
            x[*v as usize] += contact.normal * (mobility * force);
        }
    }
}

/// The contacts of a solve, and their multipliers.
#[derive(Debug)]
pub(super) struct Contacts<'a> {
    all: &'a [Contact],
    inverse_mass: &'a [Real],
    /// Multipliers as of the last selection.
    forces: Vec<Real>,
    /// How far vertices travel before each contact is to be looked at again.
    asleep_until: Vec<Real>,
    active: Vec<Active>,
    /// Of which contacts these are.
    places: Vec<u32>,
}

impl<'a> Contacts<'a> {
    /// Contacts between vertices of these inverse masses, each with a multiplier to start from, by which
    /// vertices are pushed.
    pub(super) fn new(
        all: &'a [Contact],
        inverse_mass: &'a [Real],
        forces: Vec<Real>,
        x: &mut [Point],
    ) -> Self {
        let contacts = Self {
            all,
            inverse_mass,
            forces,
            asleep_until: vec![0.0; all.len()],
            active: Vec::new(),
            places: Vec::new(),
        };
        for (contact, force) in all.iter().zip(&contacts.forces) {
            if *force != 0.0 {
                push(x, (contact, &contacts.mobilities(contact)), *force);
            }
        }
        contacts
    }

    fn mobilities(&self, contact: &Contact) -> [Real; 4] {
        let w = contact.vertices.map(|v| self.inverse_mass[v as usize]);
        [0, 1, 2, 3].map(|k: usize| contact.coefficients[k] * w[k])
    }

    /// Selects the contacts that the next sweeps visit, those that push or are met by less than
    /// half a millimetre, and returns the largest violation of one that can move, and whether all are
    /// negligible.
    ///
    /// The value of a contact that is met by more is not read again until vertices have moved as far.
    pub(super) fn select(&mut self, moves: &Moves, x: &[Point]) -> (Real, bool) {
        self.store_forces();
        self.active.clear();
        self.places.clear();
        let (mut largest, mut is_met) = (0.0, true);
        for (k, contact) in self.all.iter().enumerate() {
            let force = self.forces[k];
            if force <= 0.0 && moves.travelled < self.asleep_until[k] {
                continue;
            }
            let value = contact.value(x);
            let beyond = value - contact.gap - AWAKE;
            if force <= 0.0 && beyond >= 0.0 {
                self.asleep_until[k] = moves.travelled + beyond - ROUNDING;
                continue;
            }
            let mobility = |k: usize| self.inverse_mass[contact.vertices[k] as usize];
            let weight = (0..4).map(|k| contact.coefficients[k].powi(2) * mobility(k)).sum();
            if weight > 0.0 {
                let short = contact.gap - value;
                largest = short.max(largest);
                is_met &= short <= (TOLERANCE * contact.gap).max(NEGLIGIBLE);
                let mobilities = self.mobilities(contact);
                self.active.push(Active { contact: *contact, mobilities, weight, force });
                self.places.push(k as u32);
            }
        }
        (largest, is_met)
    }

    fn store_forces(&mut self) {
        for (k, active) in self.places.iter().zip(&self.active) {
            self.forces[*k as usize] = active.force;
        }
    }

    /// One sweep over those that are selected, with multipliers that stay non-negative.
    pub(super) fn sweep(&mut self, relaxation: Real, x: &mut [Point]) {
        for active in &mut self.active {
            let short = active.contact.gap - active.contact.value(x);
            if short <= 0.0 && active.force == 0.0 {
                continue;
            }
            let to = (active.force + relaxation * short / active.weight).max(0.0);
            active.push(x, to - active.force);
            active.force = to;
        }
    }

    /// Those that push, with their multipliers.
    pub(super) fn forces(mut self) -> impl Iterator<Item = ([u32; 4], Real)> {
        self.store_forces();
        let all = self.all.iter().map(|contact| contact.vertices).zip(self.forces);
        all.filter(|(_, force)| *force > 0.0)
    }
}

/// Selects the edges that the next sweeps visit: those with a residual. That of an edge neither of
/// whose ends has moved is what it was.
pub(super) fn select_edges(
    scene: &Scene,
    (x, target): (&[Point], &[Point]),
    multipliers: &[Vector],
    moves: &Moves,
    moving: &mut Vec<u32>,
) {
    let before = std::mem::take(moving);
    let mut before = before.into_iter().peekable();
    let edges = scene.edges.iter().zip(&scene.compliance).zip(multipliers);
    for (k, ((edge, compliance), multiplier)) in (0u32..).zip(edges) {
        let was_moving = before.next_if_eq(&k).is_some();
        let [i, j] = edge.map(|v| v as usize);
        if !(was_moving || moves.has_moved[i] || moves.has_moved[j]) {
            continue;
        }
        let residual = (x[i] - target[i]) - (x[j] - target[j]) + *multiplier * *compliance;
        if residual.norm_squared() > RESIDUAL * RESIDUAL {
            moving.push(k);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::WalkParams;
    use super::super::tests::arm;
    use super::*;
    use if_core::random::SplitMix64;

    /// Some contacts between random vertices, of which every third is held.
    fn contacts(random: &mut SplitMix64, vertices: usize, count: usize) -> Vec<Contact> {
        let mut contact = |_| {
            let share = random.unit();
            Contact {
                vertices: [0; 4].map(|_| random.below(vertices) as u32),
                coefficients: [1.0, -share, share - 1.0, 0.0],
                normal: Vector::new(random.unit() - 0.5, random.unit() - 0.5, 0.2).normalize(),
                gap: 1e-3 * random.unit(),
            }
        };
        (0..count).map(&mut contact).collect()
    }

    #[test]
    fn contacts_that_sleep_are_those_that_need_no_visit() {
        let mut random = SplitMix64::new(1);
        let all = contacts(&mut random, 300, 400);
        let mass: Vec<Real> = (0..300).map(|v| if v % 3 == 0 { 0.0 } else { 1.5 }).collect();
        let mut point = |size: Real| Point::from([0; 3].map(|_| size * (random.unit() - 0.5)));
        let mut x: Vec<Point> = (0..300).map(|_| point(0.05)).collect();
        let mut contacts = Contacts::new(&all, &mass, vec![0.0; all.len()], &mut x);
        let (mut moves, mut asleep) = (Moves::default(), 0);
        for _ in 0..60 {
            moves.update(&x);
            asleep += contacts.asleep_until.iter().filter(|s| moves.travelled < **s).count();
            let (largest, is_met) = contacts.select(&moves, &x);
            let movable = |c: &Contact| (0..3).any(|k| mass[c.vertices[k] as usize] > 0.0);
            let short = |c: &Contact| c.gap - c.value(&x);
            let expected: Vec<u32> = (0u32..)
                .zip(&all)
                .filter(|(k, c)| contacts.forces[*k as usize] > 0.0 || short(c) > -AWAKE)
                .filter(|(_, c)| movable(c))
                .map(|(k, _)| k)
                .collect();
            assert_eq!(contacts.places, expected);
            let violations = || all.iter().filter(|c| movable(c)).map(short);
            assert_eq!(largest, violations().fold(0.0, Real::max));
            let limit = |c: &Contact| (TOLERANCE * c.gap).max(NEGLIGIBLE);
            assert_eq!(is_met, all.iter().filter(|c| movable(c)).all(|c| short(c) <= limit(c)));
            (0..5).for_each(|_| contacts.sweep(1.6, &mut x));
            // Something else moves a vertex as well.
            x[7] += point(1e-3).coords;
        }
        assert!(asleep > 60 * 50, "{asleep}");
        assert!(contacts.forces().count() > 50);
    }

    #[test]
    fn edges_whose_ends_rest_are_selected_as_they_were() {
        let scene = Scene::new(&arm(), &WalkParams::default());
        let target = scene.mesh.vertices();
        let multipliers = vec![Vector::zeros(); scene.edges.len()];
        let (mut x, mut moves, mut moving) = (target.to_vec(), Moves::default(), Vec::new());
        for v in [3, 3, 40, 40, 7] {
            x[v].y += 1e-3;
            moves.update(&x);
            select_edges(&scene, (&x, target), &multipliers, &moves, &mut moving);
            let u = |v: u32| x[v as usize] - target[v as usize];
            let expected: Vec<u32> = (0u32..)
                .zip(&scene.edges)
                .filter(|(_, [i, j])| (u(*i) - u(*j)).norm() > RESIDUAL)
                .map(|(k, _)| k)
                .collect();
            assert_eq!(moving, expected);
            assert!(!moving.is_empty());
        }
    }
}
