//! Baked fields as bytes, to keep them beside a mesh.
//!
//! ```text
//! "ifg-baked" 0 version(u32)   then little-endian, in metres:
//! origin(3 f64) cell band depth unseen lipschitz(f64) surface(6 f64) reach(f64) errors(count u32, f64 each) redistanced(u8)
//! size(3 u32) tree(count u32, u8 each)      roots, x fastest: 0 outside, 1 inside, 2 a brick, 3 split and then its halves
//! nodes(4 f32 each, 125 for each brick)     bricks in the order of the tree
//! ```
//!
//! Version 1, with bricks of 8³ cells of one size, is refused: its fields are to be baked again.

use super::Baked;
use super::accuracy::Errors;
use super::bricks::{BRICK, Bricks, INSIDE, OUTSIDE, Place, SPLIT};
use super::params::MAX_LEVELS;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

const MAGIC: &[u8; 10] = b"ifg-baked\0";
const VERSION: u32 = 2;
/// Roots of a directory at most: a cube of 2 m with cells of 0.1 mm in bricks of 4 has 1.3e11 of them, one with 1 mm 1.3e8.
const MAX_PLACES: u64 = 1 << 28;

/// Why bytes are no baked field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BakedFileError {
    /// They begin otherwise.
    #[error("not a baked field; bake it again")]
    Magic,
    /// They are of another version.
    #[error("version {found} of a baked field, known is {VERSION}; bake it again")]
    Version {
        /// The version.
        found: u32,
    },
    /// They end too early, or go on.
    #[error("{found} bytes where the header promises {expected}; bake it again")]
    Length {
        /// Bytes there.
        found: u64,
        /// Bytes needed.
        expected: u64,
    },
    /// A value cannot be.
    #[error("byte {byte}: {what} cannot be; bake it again")]
    Value {
        /// Where it stands.
        byte: usize,
        /// What it is.
        what: &'static str,
    },
}

impl Baked {
    /// The field as bytes: the same field gives the same bytes, and the bytes give the same field.
    pub fn to_bytes(&self) -> Vec<u8> {
        let b = &self.bricks;
        let mut out = Vec::with_capacity(256 + b.roots.len() + 10 * b.splits.len() + 16 * b.nodes.len());
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        let reals = |out: &mut Vec<u8>, values: &[Real]| values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        let count = |out: &mut Vec<u8>, n: usize| out.extend_from_slice(&(n as u32).to_le_bytes());
        reals(&mut out, b.origin.coords.as_slice());
        reals(&mut out, &[b.cell, self.band, self.depth, self.unseen, self.lipschitz]);
        reals(&mut out, self.surface.min.coords.as_slice());
        reals(&mut out, self.surface.max.coords.as_slice());
        reals(&mut out, &[self.errors.reach]);
        count(&mut out, self.errors.largest.len());
        reals(&mut out, &self.errors.largest);
        out.push(u8::from(self.redistanced));
        b.size.iter().for_each(|n| count(&mut out, *n));
        let mut tree = Vec::with_capacity(b.roots.len() + 8 * b.splits.len());
        let mut stack: Vec<u32> = b.roots.iter().rev().copied().collect();
        while let Some(entry) = stack.pop() {
            tree.push(match entry {
                OUTSIDE => 0,
                INSIDE => 1,
                brick if brick < SPLIT => 2,
                _ => 3u8,
            });
            if (SPLIT..INSIDE).contains(&entry) {
                stack.extend(b.splits[(entry - SPLIT) as usize].iter().rev());
            }
        }
        count(&mut out, tree.len());
        out.extend_from_slice(&tree);
        b.nodes.iter().flatten().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        out
    }

    /// The field that such bytes are of.
    ///
    /// # Errors
    ///
    /// [`BakedFileError`]: other bytes, another version, a wrong length or a value that cannot be, such as NaN.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakedFileError> {
        let mut r = Reader { bytes, at: 0 };
        if r.take(MAGIC.len()).map_err(|_| BakedFileError::Magic)? != MAGIC {
            return Err(BakedFileError::Magic);
        }
        let version = r.u32()?;
        if version != VERSION {
            return Err(BakedFileError::Version { found: version });
        }
        let origin = Point::new(r.finite()?, r.finite()?, r.finite()?);
        let (cell, band, depth) = (r.positive(false)?, r.positive(false)?, r.positive(true)?);
        let (unseen, lipschitz) = (r.finite()?, r.finite()?);
        // An empty field has the empty box, whose corners are infinite.
        let surface = Aabb {
            min: Point::new(r.number()?, r.number()?, r.number()?),
            max: Point::new(r.number()?, r.number()?, r.number()?),
        };
        let mut errors = Errors { reach: r.positive(true)?, ..Errors::default() };
        if r.u32()? as usize != errors.largest.len() {
            return Err(r.fault("the number of errors"));
        }
        for e in &mut errors.largest {
            *e = r.finite()?;
        }
        let redistanced = match r.take(1)? {
            [0] => false,
            [1] => true,
            _ => return Err(r.fault("a flag")),
        };
        let size = [r.u32()? as usize, r.u32()? as usize, r.u32()? as usize];
        let all = size.iter().try_fold(1u64, |n, s| n.checked_mul(*s as u64)).filter(|n| *n <= MAX_PLACES);
        let all = all.ok_or_else(|| r.fault("the size of the grid"))? as usize;
        let tree = Tree { size, roots: Vec::new(), splits: Vec::new(), places: Vec::new() }.read(&mut r, all)?;
        let needed = tree.places.len() as u64 * BRICK as u64 * 16;
        if (bytes.len() - r.at) as u64 != needed {
            return Err(BakedFileError::Length { found: bytes.len() as u64, expected: r.at as u64 + needed });
        }
        let nodes = vec![[0.0; 4]; tree.places.len() * BRICK];
        let mut bricks = Bricks::from_parts(origin, cell, size, tree.roots, tree.splits, tree.places, nodes);
        for node in bricks.nodes.iter_mut().flatten() {
            let [a, b, c, d] = *r.take(4)? else { return Err(r.fault("a node")) };
            *node = f32::from_le_bytes([a, b, c, d]);
            if !node.is_finite() {
                return Err(r.fault("a node"));
            }
        }
        let bricks = bricks.indexed();
        Ok(Self { bricks, band, depth, surface, errors, unseen, lipschitz, redistanced })
    }
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], BakedFileError> {
        let end = self.at.saturating_add(n);
        let found = self.bytes.get(self.at..end);
        let found = found.ok_or(BakedFileError::Length { found: self.bytes.len() as u64, expected: end as u64 })?;
        self.at = end;
        Ok(found)
    }

    fn u32(&mut self) -> Result<u32, BakedFileError> {
        let bytes = self.take(4)?;
        Ok(bytes.iter().rev().fold(0, |n, b| n << 8 | u32::from(*b)))
    }

    /// Anything but NaN.
    fn number(&mut self) -> Result<Real, BakedFileError> {
        let bytes = self.take(8)?;
        let value = Real::from_bits(bytes.iter().rev().fold(0, |n, b| n << 8 | u64::from(*b)));
        if value.is_nan() { Err(self.fault("a number")) } else { Ok(value) }
    }

    fn finite(&mut self) -> Result<Real, BakedFileError> {
        let value = self.number()?;
        if value.is_finite() { Ok(value) } else { Err(self.fault("an infinite number")) }
    }

    fn positive(&mut self, may_be_infinite: bool) -> Result<Real, BakedFileError> {
        let value = self.number()?;
        let fits = value > 0.0 && (may_be_infinite || value.is_finite());
        if fits { Ok(value) } else { Err(self.fault("a length")) }
    }

    /// About the value that was read last.
    fn fault(&self, what: &'static str) -> BakedFileError {
        BakedFileError::Value { byte: self.at, what }
    }
}

struct Tree {
    size: [usize; 3],
    roots: Vec<u32>,
    splits: Vec<[u32; 8]>,
    places: Vec<Place>,
}

impl Tree {
    fn read(mut self, r: &mut Reader<'_>, roots: usize) -> Result<Self, BakedFileError> {
        let count = r.u32()? as usize;
        let mut codes = r.take(count)?.iter();
        for root in 0..roots {
            let at = [root % self.size[0], root / self.size[0] % self.size[1], root / self.size[0] / self.size[1]];
            let entry = self.entry(&mut codes, Place { level: 0, at: at.map(|b| b as u32) });
            self.roots.push(entry.ok_or_else(|| r.fault("the tree"))?);
        }
        if codes.next().is_some() { Err(r.fault("the tree")) } else { Ok(self) }
    }

    fn entry(&mut self, codes: &mut std::slice::Iter<'_, u8>, place: Place) -> Option<u32> {
        match codes.next()? {
            0 => Some(OUTSIDE),
            1 => Some(INSIDE),
            2 => {
                self.places.push(place);
                Some(self.places.len() as u32 - 1)
            }
            3 if place.level < MAX_LEVELS => {
                let number = self.splits.len();
                self.splits.push([OUTSIDE; 8]);
                for k in 0..8usize {
                    let at = [0, 1, 2].map(|a| 2 * place.at[a] + (k >> a & 1) as u32);
                    self.splits[number][k] = self.entry(codes, Place { level: place.level + 1, at })?;
                }
                Some(SPLIT + number as u32)
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::baked::BakeParams;
    use if_core::field::SignedDistance;
    use if_core::shapes::{Capsule, Sphere, Union};

    fn field(depth: Real) -> Baked {
        let ball = Sphere { center: Point::new(0.01, 0.02, -0.03), radius: 0.2 };
        let limb = Capsule { from: Point::new(-0.1, -0.2, 0.0), to: Point::new(0.15, 0.1, 0.05), radius: 0.06 };
        Baked::new(&Union(ball, limb), &BakeParams { cell: 0.01, depth, ..BakeParams::default() }).unwrap()
    }

    #[test]
    fn bytes_give_the_same_field_and_the_field_the_same_bytes() {
        for depth in [0.03, Real::INFINITY] {
            let baked = field(depth);
            let bytes = baked.to_bytes();
            let read = Baked::from_bytes(&bytes).unwrap();
            assert!(read.to_bytes() == bytes);
            assert_eq!(read.error_bound(), baked.error_bound());
            for k in 0..2000 {
                let s = |m: Real| (Real::from(k) * m).fract() - 0.5;
                let p = Point::new(0.7 * s(0.618), 0.7 * s(0.414), 0.7 * s(0.732));
                assert_eq!(read.sample(&p), baked.sample(&p), "{p}");
            }
        }
    }

    #[test]
    fn damaged_bytes_are_refused() {
        let bytes = field(0.02).to_bytes();
        assert_eq!(Baked::from_bytes(b"ply").unwrap_err(), BakedFileError::Magic);
        assert_eq!(Baked::from_bytes(&[]).unwrap_err(), BakedFileError::Magic);
        for cut in (0..bytes.len()).step_by(997) {
            assert!(Baked::from_bytes(&bytes[..cut]).is_err(), "{cut}");
        }
        let mut other = bytes.clone();
        other[10] = 9;
        assert_eq!(Baked::from_bytes(&other).unwrap_err(), BakedFileError::Version { found: 9 });
        // NaN for every value of the header in turn: none is taken for a field with a NaN.
        for at in 14..bytes.len().min(700) {
            let mut other = bytes.clone();
            let end = (at + 8).min(other.len());
            other[at..end].fill(0xff);
            if let Ok(read) = Baked::from_bytes(&other) {
                assert!(!read.error_bound().is_nan() && !read.distance(&Point::new(0.1, 0.1, 0.1)).is_nan(), "{at}");
            }
        }
    }
}
