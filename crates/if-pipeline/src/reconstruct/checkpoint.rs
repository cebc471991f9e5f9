//! Checkpoints of the surface: the state after a round, in a file.

use super::error::ReconstructError;
use super::observe::Observation;
use super::params::SurfaceParams;
use super::report::Round;
use super::sealed::{self, Key, Magic};
use super::start::Start;
use crate::build::BUILD;
use crate::capture::Capture;
use if_body::SkinWeights;
use if_core::math::{Point, Real};
use if_core::mesh::TriMesh;
use sha2::{Digest, Sha256};
use std::path::Path;

/// The first bytes of the file.
const MAGIC: &Magic = b"ifg surface v1\n\0";
/// Numbers of a round in the file.
const ROUND: usize = 5;

/// The state between two rounds.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Checkpoint {
    pub(super) vertices: Vec<Point>,
    pub(super) rounds: Vec<Round>,
}

/// A hash of everything that the state depends on.
pub(super) fn key(
    capture: &Capture,
    start: &Start,
    params: &SurfaceParams,
    frames: &[Observation],
) -> Key {
    // A rebuilt program begins anew.
    let mut hash = Sha256::new_with_prefix(BUILD);
    // All parameters but the number of rounds and what bits do not depend on: a longer run may continue a
    // shorter one.
    let SurfaceParams { loose_rounds, memory, .. } = SurfaceParams::default();
    let params = SurfaceParams { rounds: 0, loose_rounds, memory, ..params.clone() };
    hash.update(format!("{params:?}"));
    let mut number = |x: Real| hash.update(x.to_le_bytes());
    visit_input(capture, (&start.mesh, &start.skin), frames, &mut number);
    hash.finalize().into()
}

/// Calls `number` with all numbers of a fit's input: camera, mesh, weights, and what the frames
/// show.
pub(super) fn visit_input(
    capture: &Capture,
    (mesh, skin): (&TriMesh, &SkinWeights),
    frames: &[Observation],
    number: &mut dyn FnMut(Real),
) {
    let camera = capture.camera();
    for m in [camera.intrinsics(), camera.rotation()] {
        m.iter().for_each(|x| number(*x));
    }
    camera.translation().iter().for_each(|x| number(*x));
    visit_mesh(mesh, number);
    skin.joints().iter().flatten().for_each(|j| number(Real::from(*j)));
    skin.weights().iter().flatten().for_each(|w| number(Real::from(*w)));
    for frame in frames {
        number(frame.frame as Real);
        for t in &frame.transforms {
            t.translation.vector.iter().chain(t.rotation.coords.iter()).for_each(|x| number(*x));
        }
        let pixels = camera.width() * camera.height();
        (0..pixels).for_each(|i| number(f64::from(frame.outside.pixel(i))));
        frame.normals.iter().flatten().for_each(|n| number(f64::from(*n)));
    }
}

/// Calls `number` with positions and triangles.
pub(super) fn visit_mesh(mesh: &TriMesh, number: &mut dyn FnMut(Real)) {
    mesh.vertices().iter().flat_map(|p| p.iter()).for_each(|x| number(*x));
    mesh.triangles().iter().flatten().for_each(|i| number(Real::from(*i)));
}

impl Checkpoint {
    /// Writes the file atomically.
    pub(super) fn write(&self, path: &Path, key: &Key) -> Result<(), ReconstructError> {
        let mut bytes =
            Vec::with_capacity(16 + 8 * ROUND * self.rounds.len() + 24 * self.vertices.len());
        bytes.extend_from_slice(&(self.rounds.len() as u64).to_le_bytes());
        bytes.extend_from_slice(&(self.vertices.len() as u64).to_le_bytes());
        for r in &self.rounds {
            let row: [Real; ROUND] = [
                r.silhouette_mm,
                r.normal_degrees,
                r.step_mm,
                r.rim_vertices as Real,
                r.seen_triangles as Real,
            ];
            row.iter().for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        }
        self.vertices
            .iter()
            .flat_map(|p| p.iter())
            .for_each(|x| bytes.extend_from_slice(&x.to_le_bytes()));
        sealed::write(path, (MAGIC, key), &bytes)
    }

    /// Reads the file; `None` if it is missing, of other input, or of more rounds than `most`.
    pub(super) fn read(
        path: &Path,
        key: &Key,
        most: usize,
    ) -> Result<Option<Self>, ReconstructError> {
        let state = sealed::read(path, (MAGIC, key), Self::parse)?;
        Ok(state.filter(|state| state.rounds.len() <= most))
    }

    fn parse(body: &[u8]) -> Option<Self> {
        let (counts, rest) = body.split_at_checked(16)?;
        let count = |k: usize| {
            usize::try_from(u64::from_le_bytes(counts[8 * k..8 * k + 8].try_into().ok()?)).ok()
        };
        let (rounds, vertices) = (count(0)?, count(1)?);
        let numbers: Vec<Real> = rest
            .chunks_exact(8)
            .map(|c| Real::from_le_bytes(c.try_into().expect("eight bytes")))
            .collect();
        if rest.len() % 8 != 0
            || numbers.len() != rounds.checked_mul(ROUND)?.checked_add(vertices.checked_mul(3)?)?
        {
            return None;
        }
        let (rows, points) = numbers.split_at(rounds * ROUND);
        let round = |r: &[Real]| Round {
            silhouette_mm: r[0],
            normal_degrees: r[1],
            step_mm: r[2],
            rim_vertices: r[3] as usize,
            seen_triangles: r[4] as usize,
        };
        Some(Self {
            vertices: points.chunks_exact(3).map(|p| Point::new(p[0], p[1], p[2])).collect(),
            rounds: rows.chunks_exact(ROUND).map(round).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkpoint_is_read_bit_for_bit_and_a_broken_one_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("state");
        let round = Round {
            silhouette_mm: 0.1 + 0.2,
            normal_degrees: 1e-300,
            step_mm: 3.0,
            rim_vertices: 7,
            seen_triangles: 9,
        };
        let state =
            Checkpoint { vertices: vec![Point::new(0.1, -0.0, 1.0 / 3.0)], rounds: vec![round; 2] };
        assert_eq!(Checkpoint::read(&path, &[1; 32], 9).unwrap(), None);
        state.write(&path, &[1; 32]).unwrap();
        let read = Checkpoint::read(&path, &[1; 32], 2).unwrap().unwrap();
        assert_eq!(read, state);
        assert!(read.vertices[0].y.is_sign_negative());
        assert_eq!(Checkpoint::read(&path, &[2; 32], 9).unwrap(), None); // other input
        assert_eq!(Checkpoint::read(&path, &[1; 32], 1).unwrap(), None); // too far
        let whole = std::fs::read(&path).unwrap();
        for bad in [&whole[..whole.len() - 1], &whole[..20], &[][..]] {
            std::fs::write(&path, bad).unwrap();
            assert!(matches!(
                Checkpoint::read(&path, &[1; 32], 9),
                Err(ReconstructError::BrokenCheckpoint { .. })
            ));
        }
        let mut flipped = whole;
        flipped[80] ^= 1;
        std::fs::write(&path, flipped).unwrap();
        assert!(matches!(
            Checkpoint::read(&path, &[1; 32], 9),
            Err(ReconstructError::BrokenCheckpoint { .. })
        ));
    }
}
