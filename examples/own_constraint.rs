//! A constraint of your own in the cloth solver: a ceiling that no particle may pass.
//!
//! ```text
//! cargo run --release --example own_constraint
//! ```

use if_garments::Silent;
use if_garments::core::shapes::meshes::cloth;
use if_garments::core::{Point, Real};
use if_garments::xpbd::{
    Constraint, EdgeSet, Particles, Residual, Solver, SolverParams, Stage, Stretch,
};

/// C(p) = height − y ≥ 0 for every particle.
struct Ceiling {
    height: Real,
}

impl Constraint for Ceiling {
    fn begin_substep(&mut self, _previous: &[Point], _positions: &[Point], _w: &[Real], _h: Real) {}

    // One visit of every constraint, in a fixed order. It returns the violations before it.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual::default();
        for (p, w) in positions.iter_mut().zip(inverse_masses) {
            residual.add((p.y - self.height).max(0.0));
            if *w > 0.0 && p.y > self.height {
                p.y = self.height;
            }
        }
        residual
    }

    // Contacts come after the elastic groups, and are satisfied last.
    fn stage(&self) -> Stage {
        Stage::Contact
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A square of cloth of 10 cm in the xy plane; its upper rows are above the ceiling.
    let mesh = cloth(0.1, 0.1, 10, 10);
    let mut particles = Particles::uniform(mesh.vertices().to_vec(), 1.0)?;
    let mut stretch = Stretch::new(EdgeSet::of_mesh(&mesh), 1e-5)?;
    let mut ceiling = Ceiling { height: 0.08 };
    let above = |particles: &Particles| particles.positions.iter().filter(|p| p.y > 0.08).count();
    assert!(above(&particles) > 0);

    let mut solver = Solver::new(SolverParams::default())?;
    let groups: &mut [&mut dyn Constraint] = &mut [&mut stretch, &mut ceiling];
    solver.run(&mut particles, groups, &mut Silent)?;
    assert_eq!(above(&particles), 0);
    Ok(())
}
