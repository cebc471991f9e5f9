//! The state that the solver moves.

use if_core::math::{Point, Real, Vector, area_vector};
use if_core::mesh::TriMesh;
use if_core::parameter::ParameterError;

/// Positions, velocities and inverse masses of particles, all finite at construction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Particles {
    /// p, in metres.
    pub positions: Vec<Point>,
    /// v, in m/s.
    pub velocities: Vec<Vector>,
    /// w = 1/m, in 1/kg; 0 pins a particle.
    pub inverse_masses: Vec<Real>,
    /// Positions at the start of the last substep, in metres.
    pub previous: Vec<Point>,
}

/// Why particles are invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ParticlesError {
    /// A coordinate is NaN or infinite.
    #[error("particle {particle} is at {position:?}; every coordinate must be finite")]
    Position {
        /// Index of the particle.
        particle: usize,
        /// Its position.
        position: [Real; 3],
    },
    /// An inverse mass or the area density is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// There is not one inverse mass for each position.
    #[error(
        "{positions} positions but {inverse_masses} inverse masses; give one for each particle"
    )]
    Count {
        /// Positions given.
        positions: usize,
        /// Inverse masses given.
        inverse_masses: usize,
    },
}

impl Particles {
    /// Particles at rest with the given inverse masses (1/kg).
    ///
    /// # Errors
    ///
    /// The first invalid number.
    pub fn new(positions: Vec<Point>, inverse_masses: Vec<Real>) -> Result<Self, ParticlesError> {
        if positions.len() != inverse_masses.len() {
            return Err(ParticlesError::Count {
                positions: positions.len(),
                inverse_masses: inverse_masses.len(),
            });
        }
        for (particle, p) in positions.iter().enumerate() {
            if !p.iter().all(|c| c.is_finite()) {
                return Err(ParticlesError::Position { particle, position: [p.x, p.y, p.z] });
            }
        }
        for (particle, &value) in inverse_masses.iter().enumerate() {
            let ok = value.is_finite() && value >= 0.0;
            let range = "finite and at least 0 (1/kg; 0 pins the particle)";
            ParameterError::check("inverse_mass", value, ok, range).map_err(|e| e.at(particle))?;
        }
        let n = positions.len();
        Ok(Self {
            previous: positions.clone(),
            positions,
            velocities: vec![Vector::zeros(); n],
            inverse_masses,
        })
    }

    /// Particles of one inverse mass (1/kg): unit masses for 1.
    ///
    /// # Errors
    ///
    /// As [`Particles::new`].
    pub fn uniform(positions: Vec<Point>, inverse_mass: Real) -> Result<Self, ParticlesError> {
        let n = positions.len();
        Self::new(positions, vec![inverse_mass; n])
    }

    /// The vertices of `mesh`, each with a third of the mass of its triangles at `density` kg/m². A
    /// vertex without any area gets the mean mass of the others, or 1 kg where no vertex has area.
    ///
    /// # Errors
    ///
    /// A density that is not positive and finite, or masses whose inverse is not finite.
    pub fn from_area_density(mesh: &TriMesh, density: Real) -> Result<Self, ParticlesError> {
        let ok = density > 0.0 && density.is_finite();
        let range = "positive and finite (kg/m²; cloth has about 0.2)";
        ParameterError::check("density", density, ok, range)?;
        let mut mass = vec![0.0; mesh.vertices().len()];
        for (t, corners) in mesh.triangles().iter().enumerate() {
            let [a, b, c] = mesh.corners(t);
            let share = density * area_vector(a, b, c).norm() / 6.0;
            for &v in corners {
                mass[v as usize] += share;
            }
        }
        let heavy = mass.iter().filter(|m| **m > 0.0).count();
        let mean = if heavy == 0 { 1.0 } else { mass.iter().sum::<Real>() / heavy as Real };
        let inverse = mass.iter().map(|m| 1.0 / if *m > 0.0 { *m } else { mean }).collect();
        Self::new(mesh.vertices().to_vec(), inverse)
    }

    /// Gives the named particles the inverse mass 0. Indices out of range are ignored.
    #[must_use]
    pub fn pinned(mut self, vertices: impl IntoIterator<Item = u32>) -> Self {
        for v in vertices {
            if let Some(w) = self.inverse_masses.get_mut(v as usize) {
                *w = 0.0;
            }
        }
        self
    }

    /// Number of particles.
    pub fn len(&self) -> usize {
        self.positions.len()
    }

    /// Whether there are no particles.
    pub fn is_empty(&self) -> bool {
        self.positions.is_empty()
    }

    /// ½ Σ m v², in joules, over the particles that can move.
    pub fn kinetic_energy(&self) -> Real {
        self.velocities
            .iter()
            .zip(&self.inverse_masses)
            .filter(|(_, w)| **w > 0.0)
            .map(|(v, w)| 0.5 * v.norm_squared() / w)
            .sum()
    }

    /// Indices of the particles whose position or velocity is not finite, at most `most` of them.
    pub(crate) fn non_finite(&self, most: usize) -> Vec<u32> {
        let bad = |k: &usize| {
            let (p, v) = (&self.positions[*k], &self.velocities[*k]);
            !(p.iter().all(|c| c.is_finite()) && v.iter().all(|c| c.is_finite()))
        };
        (0..self.len()).filter(bad).take(most).map(|k| k as u32).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn errors_name_the_particle_and_the_number() {
        let p = vec![Point::origin(), Point::new(1.0, Real::NAN, 0.0)];
        assert!(matches!(
            Particles::uniform(p, 1.0),
            Err(ParticlesError::Position { particle: 1, .. })
        ));
        let p = vec![Point::origin(); 2];
        for bad in [-1.0, Real::NAN, Real::INFINITY] {
            let result = Particles::new(p.clone(), vec![1.0, bad]);
            assert!(
                matches!(result, Err(ParticlesError::Parameter(e)) if e.name == "inverse_mass[1]")
            );
        }
        assert!(matches!(
            Particles::new(p, vec![]),
            Err(ParticlesError::Count { positions: 2, inverse_masses: 0 })
        ));
        for bad in [0.0, -1.0, Real::NAN, Real::INFINITY] {
            assert!(matches!(
                Particles::from_area_density(&TriMesh::default(), bad),
                Err(ParticlesError::Parameter(e)) if e.name == "density"
            ));
        }
    }

    #[test]
    fn the_masses_of_a_mesh_add_up_to_density_times_area() {
        let v = vec![
            Point::origin(),
            Point::new(1.0, 0.0, 0.0),
            Point::new(1.0, 1.0, 0.0),
            Point::new(0.0, 1.0, 0.0),
            Point::origin(),
        ];
        let mesh = TriMesh::new(v, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let particles = Particles::from_area_density(&mesh, 0.2).unwrap();
        let total: Real = particles.inverse_masses[..4].iter().map(|w| 1.0 / w).sum();
        assert_relative_eq!(total, 0.2, max_relative = 1e-15);
        assert_relative_eq!(1.0 / particles.inverse_masses[4], 0.05, max_relative = 1e-15);
        let point = TriMesh::new(vec![Point::origin()], vec![]).unwrap();
        assert_eq!(Particles::from_area_density(&point, 0.2).unwrap().inverse_masses, vec![1.0]);
    }

    #[test]
    fn pins_have_no_inverse_mass_and_no_energy() {
        let mut p = Particles::uniform(vec![Point::origin(); 3], 2.0).unwrap().pinned([1, 9]);
        p.velocities = vec![Vector::new(2.0, 0.0, 0.0); 3];
        assert_eq!(p.inverse_masses, vec![2.0, 0.0, 2.0]);
        assert_eq!(p.kinetic_energy(), 2.0);
        p.velocities[2].y = Real::NAN;
        assert_eq!(p.non_finite(5), vec![2]);
    }
}
