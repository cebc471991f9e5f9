//! The state of a walker as bytes: a walk that goes on from it has the same bits as one that was
//! not interrupted.

use super::attempt::Met;
use super::clean::Clean;
use super::equilibrium::Multipliers;
use super::walk::Walker;
use if_core::math::{Point, Real, Vector};

/// First bytes of a snapshot.
const MAGIC: &[u8; 8] = b"ifwalk02";

/// A snapshot cannot be restored.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the snapshot is damaged, or of another outfit: {what}; leave it out, and walk from rest")]
pub struct SnapshotError {
    what: &'static str,
}

impl Walker {
    /// The current state as bytes, little-endian.
    pub fn snapshot(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        count(&mut out, self.target.len());
        for p in self.target.iter().chain(&self.clean.x) {
            p.iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        let (edges, contacts) = self.multipliers.parts();
        count(&mut out, edges.len());
        for (edge, multiplier) in &edges {
            out.extend(edge.to_le_bytes());
            multiplier.iter().for_each(|x| out.extend(x.to_le_bytes()));
        }
        count(&mut out, contacts.len());
        for (vertices, force) in &contacts {
            vertices.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend(force.to_le_bytes());
        }
        count(&mut out, self.met.len());
        for (pair, (times, left)) in &self.met {
            [pair[0], pair[1], *times, *left].iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        count(&mut out, self.triangles_let_go());
        for (t, _) in (0u32..).zip(&self.tolerated.let_go).filter(|(_, let_go)| **let_go) {
            out.extend(t.to_le_bytes());
        }
        out
    }

    /// Goes to the state of a snapshot of a walker of the same outfit and parameters.
    ///
    /// # Errors
    ///
    /// Bytes that are no snapshot of this outfit. The state stays as it was.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), SnapshotError> {
        let n = self.rest.len();
        let triangles = self.scene.mesh.triangles().len();
        let mut input = Input(bytes);
        if input.take::<8>()? != *MAGIC || input.count(48)? != n {
            return Err(SnapshotError { what: "it begins differently" });
        }
        let points = |input: &mut Input<'_>| {
            (0..n).map(|_| input.vector().map(Point::from)).collect::<Result<Vec<Point>, _>>()
        };
        let (target, x) = (points(&mut input)?, points(&mut input)?);
        let all = self.scene.edges.len();
        let mut edges = vec![Vector::zeros(); all];
        for _ in 0..input.count(28)? {
            let edge = input.index(all)?;
            edges[edge] = input.vector()?;
        }
        let mut contacts = Vec::new();
        for _ in 0..input.count(24)? {
            let mut vertices = [0; 4];
            for v in &mut vertices {
                *v = input.index(n)? as u32;
            }
            contacts.push((vertices, input.number()?));
        }
        let mut met = Met::new();
        for _ in 0..input.count(16)? {
            let pair = [input.index(triangles)? as u32, input.index(triangles)? as u32];
            met.insert(pair, (input.small()?, input.small()?));
        }
        let body = self.scene.triangle_starts[1];
        let mut let_go = Vec::new();
        for _ in 0..input.count(4)? {
            let_go.resize(body, false);
            let_go[input.index(body)?] = true;
        }
        if !input.0.is_empty() {
            return Err(SnapshotError { what: "it is too long" });
        }
        self.clean = Clean { tree: self.tree(&x), x, is_verified: false };
        self.target = target;
        self.multipliers = Multipliers::from_parts(edges, contacts);
        self.met = met;
        self.tolerated.let_go = let_go;
        Ok(())
    }
}

fn count(out: &mut Vec<u8>, n: usize) {
    out.extend((n as u64).to_le_bytes());
}

/// The bytes that are left.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], SnapshotError> {
        let (first, rest) =
            self.0.split_first_chunk().ok_or(SnapshotError { what: "it ends early" })?;
        self.0 = rest;
        Ok(*first)
    }

    /// A number of records of at least `size` bytes each, which must be there.
    fn count(&mut self, size: usize) -> Result<usize, SnapshotError> {
        let n = u64::from_le_bytes(self.take()?);
        let most = self.0.len() / size;
        if n > most as u64 { Err(SnapshotError { what: "it ends early" }) } else { Ok(n as usize) }
    }

    fn small(&mut self) -> Result<u32, SnapshotError> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn index(&mut self, end: usize) -> Result<usize, SnapshotError> {
        let index = self.small()? as usize;
        if index < end {
            Ok(index)
        } else {
            Err(SnapshotError { what: "an index is out of range" })
        }
    }

    fn number(&mut self) -> Result<Real, SnapshotError> {
        let x = Real::from_le_bytes(self.take()?);
        if x.is_finite() { Ok(x) } else { Err(SnapshotError { what: "a number is not finite" }) }
    }

    fn vector(&mut self) -> Result<Vector, SnapshotError> {
        Ok(Vector::new(self.number()?, self.number()?, self.number()?))
    }
}
