//! Baked fields as bytes, to store them beside a mesh.
//!
//! ```text
//! "ifg-baked" 0 version(u32)   then little-endian, in metres:
//! origin(3 f64) cell band depth unseen lipschitz(f64) surface(6 f64) reach(f64) errors(count u32, f64 each) redistanced(u8)
//! size(3 u32) tree(count u32, u8 each)      roots, x fastest: 0 outside, 1 inside, 2 a brick, 3 split and then its halves
//! nodes(4 f32 each, 125 for each brick)     bricks in the order of the tree
//! ```
//!
//! Version 1, with bricks of 8³ cells of one size, is rejected: its fields must be baked again.

use super::accuracy::{Errors, steepest};
use super::blend::{BRICK, SIDE};
use super::bricks::Bricks;
use super::directory::{INSIDE, OUTSIDE, Place, SPLIT};
use super::field::Baked;
use super::index::BRICKS;
use super::params::MAX_LEVELS;
use super::samples::MAX_COORDINATE;
use crate::grid::GridSize;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real};

const MAGIC: &[u8; 10] = b"ifg-baked\0";
const VERSION: u32 = 2;
/// Maximum number of roots: a cube of 2 m with cells of 0.1 mm in bricks of 4 has 1.3e11 of
/// them, one with 1 mm 1.3e8.
const MAX_PLACES: u64 = 1 << 28;
/// Relative tolerance for rounding in another order of sums (1e-16 each): a slope or a box that is
/// off by a thousand times more would change a bound by a millionth.
const ROUNDING: Real = 1e-9;

/// Why bytes are not a valid baked field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum BakedFileError {
    /// The first bytes are those of another format.
    #[error("not a baked field; bake it again")]
    Magic,
    /// Another version of the format.
    #[error("version {found} of a baked field, supported is {VERSION}; bake it again")]
    Version {
        /// The version.
        found: u32,
    },
    /// The number of bytes is wrong.
    #[error("{found} bytes where the header promises {expected}; bake it again")]
    Length {
        /// Number of bytes.
        found: u64,
        /// Bytes needed.
        expected: u64,
    },
    /// A value is invalid.
    #[error("byte {byte}: {what} is invalid; bake it again")]
    Value {
        /// Its offset.
        byte: usize,
        /// What it is.
        what: &'static str,
    },
}

impl Baked {
    /// The field as bytes: the same field gives the same bytes, and the bytes give the same field.
    pub fn to_bytes(&self) -> Vec<u8> {
        let b = &self.bricks;
        let mut out =
            Vec::with_capacity(256 + b.roots.len() + 10 * b.splits.len() + 16 * b.nodes.len());
        out.extend_from_slice(MAGIC);
        out.extend_from_slice(&VERSION.to_le_bytes());
        let reals = |out: &mut Vec<u8>, values: &[Real]| {
            values.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()))
        };
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

    /// Reads a field from bytes. Its memory is at most about eight times their number.
    ///
    /// # Errors
    ///
    /// [`BakedFileError`]: another format or version, a wrong length or an invalid value: NaN, a
    /// negative error, a slope or a box of the surface that the nodes exceed, an invalid tree.
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
        let cell = r.positive(false)?;
        // Slopes are divided by the smallest cells.
        if !(Real::from(1u32 << MAX_LEVELS) / cell).is_finite() {
            return Err(r.fault("a cell so small"));
        }
        let (band, depth) = (r.positive(false)?, r.positive(true)?);
        let unseen = r.error()?;
        let lipschitz = r.positive(false)?;
        let lipschitz_at = r.at;
        let surface = r.surface()?;
        let surface_at = r.at;
        let errors = r.errors()?;
        let redistanced = r.flag()?;
        let grid = r.grid(&origin, cell)?;
        let bricks = r.bricks(origin, cell, grid)?;
        // Beyond the band the field is a distance: as steep as 1.
        if lipschitz * (1.0 + ROUNDING) < steepest(&bricks).max(1.0) {
            return Err(BakedFileError::Value {
                byte: lipschitz_at,
                what: "a bound on the slope below that of the nodes",
            });
        }
        if !holds(&surface, &bricks.surface_box(), ROUNDING * cell) {
            return Err(BakedFileError::Value {
                byte: surface_at,
                what: "a box of the surface that does not hold it",
            });
        }
        Ok(Self { bricks, band, depth, surface, errors, unseen, lipschitz, redistanced })
    }
}

/// Whether the box of a surface is finite and holds what `held` does, up to `hair` metres.
fn holds(surface: &Aabb, held: &Aabb, hair: Real) -> bool {
    if held.is_empty() {
        return *surface == Aabb::EMPTY;
    }
    let within = surface.inflated(hair);
    within.contains(&held.min)
        && within.contains(&held.max)
        && surface.size().iter().all(|s| s.is_finite())
}

/// The grid of places of bricks.
struct Grid {
    size: [usize; 3],
    /// All places.
    count: usize,
    /// Maximum number of halvings: as often as baking halves cells of a grid so large.
    levels: u32,
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    fn take(&mut self, n: usize) -> Result<&'a [u8], BakedFileError> {
        let end = self.at.saturating_add(n);
        let found = self.bytes.get(self.at..end);
        let found = found.ok_or(BakedFileError::Length {
            found: self.bytes.len() as u64,
            expected: end as u64,
        })?;
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

    /// A length that may be zero.
    fn error(&mut self) -> Result<Real, BakedFileError> {
        let value = self.finite()?;
        if value >= 0.0 { Ok(value) } else { Err(self.fault("an error below zero")) }
    }

    /// Bytes, after their number.
    fn counted(&mut self) -> Result<&'a [u8], BakedFileError> {
        let count = self.u32()? as usize;
        self.take(count)
    }

    fn positive(&mut self, may_be_infinite: bool) -> Result<Real, BakedFileError> {
        let value = self.number()?;
        let fits = value > 0.0 && (may_be_infinite || value.is_finite());
        if fits { Ok(value) } else { Err(self.fault("a length")) }
    }

    /// An empty field has the empty box, whose corners are infinite.
    fn surface(&mut self) -> Result<Aabb, BakedFileError> {
        let mut corner = || -> Result<Point, BakedFileError> {
            Ok(Point::new(self.number()?, self.number()?, self.number()?))
        };
        Ok(Aabb { min: corner()?, max: corner()? })
    }

    fn errors(&mut self) -> Result<Errors, BakedFileError> {
        let mut errors = Errors { reach: self.positive(true)?, ..Errors::default() };
        if self.u32()? as usize != errors.largest.len() {
            return Err(self.fault("the number of errors"));
        }
        for e in &mut errors.largest {
            *e = self.error()?;
        }
        Ok(errors)
    }

    fn flag(&mut self) -> Result<bool, BakedFileError> {
        match self.take(1)? {
            [0] => Ok(false),
            [1] => Ok(true),
            _ => Err(self.fault("a flag")),
        }
    }

    fn grid(&mut self, origin: &Point, cell: Real) -> Result<Grid, BakedFileError> {
        let size = [self.u32()? as usize, self.u32()? as usize, self.u32()? as usize];
        let count = size
            .iter()
            .try_fold(1u64, |n, s| n.checked_mul(*s as u64))
            .filter(|n| *n <= MAX_PLACES);
        let longest = size.into_iter().max().unwrap_or(0).saturating_mul(SIDE);
        let count = count
            .filter(|_| longest < MAX_COORDINATE)
            .ok_or_else(|| self.fault("the size of the grid"))? as usize;
        let end = origin.coords.map(|x| x.abs() + longest as Real * cell);
        if !end.iter().all(|x| x.is_finite()) {
            return Err(self.fault("a grid without end"));
        }
        let levels =
            (0..MAX_LEVELS).take_while(|l| longest << l < MAX_COORDINATE / 2).count() as u32;
        Ok(Grid { size, count, levels })
    }

    /// The tree and its nodes, to the last byte.
    fn bricks(
        &mut self,
        origin: Point,
        cell: Real,
        Grid { size, count, levels }: Grid,
    ) -> Result<Bricks, BakedFileError> {
        let codes = self.counted()?;
        let faulty = BakedFileError::Value { byte: self.at, what: "the tree" };
        // Nothing is allocated before the number of nodes is checked.
        let leaves = codes.iter().filter(|code| **code == 2).count();
        let needed = leaves as u64 * BRICK as u64 * 16;
        if (self.bytes.len() - self.at) as u64 != needed {
            return Err(BakedFileError::Length {
                found: self.bytes.len() as u64,
                expected: self.at as u64 + needed,
            });
        }
        if count > codes.len() || leaves > BRICKS {
            return Err(faulty);
        }
        let tree = Tree {
            size,
            levels,
            roots: Vec::with_capacity(count),
            splits: Vec::new(),
            places: Vec::with_capacity(leaves),
        };
        let tree = tree.read(codes, count).ok_or_else(|| faulty.clone())?;
        let nodes = vec![[0.0; 4]; leaves * BRICK];
        let mut bricks =
            Bricks::from_parts(origin, cell, size, tree.roots, tree.splits, tree.places, nodes);
        for node in bricks.nodes.iter_mut().flatten() {
            let [a, b, c, d] = *self.take(4)? else { return Err(self.fault("a node")) };
            *node = f32::from_le_bytes([a, b, c, d]);
            if !node.is_finite() {
                return Err(self.fault("a node"));
            }
        }
        // A chain of eight splits above each brick would make three tables of 512 entries for its
        // 2000 bytes: no field has more entries than bytes. Splits without bricks could.
        bricks.indexed(self.bytes.len()).ok_or(faulty)
    }

    /// The error for the value that was read last.
    fn fault(&self, what: &'static str) -> BakedFileError {
        BakedFileError::Value { byte: self.at, what }
    }
}

struct Tree {
    size: [usize; 3],
    /// Maximum number of halvings.
    levels: u32,
    roots: Vec<u32>,
    splits: Vec<[u32; 8]>,
    places: Vec<Place>,
}

impl Tree {
    /// `None` if the codes are not a valid tree.
    fn read(mut self, codes: &[u8], roots: usize) -> Option<Self> {
        let mut codes = codes.iter();
        for root in 0..roots {
            let at = GridSize(self.size).coordinates(root);
            let entry = self.entry(&mut codes, Place { level: 0, at: at.map(|b| b as u32) });
            self.roots.push(entry?);
        }
        codes.next().is_none().then_some(self)
    }

    fn entry(&mut self, codes: &mut std::slice::Iter<'_, u8>, place: Place) -> Option<u32> {
        match codes.next()? {
            0 => Some(OUTSIDE),
            1 => Some(INSIDE),
            2 => {
                self.places.push(place);
                Some(self.places.len() as u32 - 1)
            }
            3 if place.level < self.levels => {
                let number = self.splits.len();
                self.splits.push([OUTSIDE; 8]);
                for k in 0..8usize {
                    self.splits[number][k] = self.entry(codes, place.half(k))?;
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
    use if_core::monitor::Silent;
    use if_core::shapes::{Capsule, Sphere, Union};

    fn field(depth: Real) -> Baked {
        let ball = Sphere { center: Point::new(0.01, 0.02, -0.03), radius: 0.2 };
        let limb = Capsule {
            from: Point::new(-0.1, -0.2, 0.0),
            to: Point::new(0.15, 0.1, 0.05),
            radius: 0.06,
        };
        Baked::new(
            &Union(ball, limb),
            &BakeParams { cell: 0.01, depth, ..BakeParams::default() },
            &mut Silent,
        )
        .unwrap()
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

    /// Byte at which a number of the header begins, and the bytes before the size of the grid.
    const NUMBER: fn(usize) -> usize = |k| 14 + 8 * k;
    const HEADER: usize = 14 + 15 * 8 + 4 + 8 * 8 + 1;

    fn with_numbers(bytes: &[u8], numbers: &[(usize, Real)]) -> Result<Baked, BakedFileError> {
        let mut other = bytes.to_vec();
        for (k, value) in numbers {
            other[NUMBER(*k)..NUMBER(k + 1)].copy_from_slice(&value.to_le_bytes());
        }
        Baked::from_bytes(&other)
    }

    #[test]
    fn numbers_that_the_nodes_contradict_are_refused() {
        let bytes = field(0.03).to_bytes();
        let lipschitz = Baked::from_bytes(&bytes).unwrap().lipschitz();
        let refused = |numbers: &[(usize, Real)], about: &str| {
            let error = with_numbers(&bytes, numbers).unwrap_err().to_string();
            assert!(error.contains(about), "{numbers:?}: {error}");
        };
        // Numbers 6 and 7 are what measuring does not see, and the slope.
        refused(&[(6, -5.0)], "an error below zero");
        refused(&[(6, Real::INFINITY)], "an infinite number");
        for slope in [-5.0, 0.0, 0.5, 0.999 * lipschitz] {
            refused(&[(7, slope)], if slope > 0.0 { "slope" } else { "a length" });
        }
        assert_eq!(
            with_numbers(&bytes, &[(7, 2.0 * lipschitz)]).unwrap().lipschitz(),
            2.0 * lipschitz,
            "a looser bound is one"
        );
        // The first measured error.
        let mut other = bytes.clone();
        other[138..146].copy_from_slice(&(-1e-9f64).to_le_bytes());
        assert!(Baked::from_bytes(&other).unwrap_err().to_string().contains("an error below zero"));
        // The box of the surface: numbers 8 to 13. Too small on each side, turned round, without
        // end, none.
        for k in 8..14 {
            refused(&[(k, 0.0)], "a box of the surface");
            refused(
                &[(k, if k < 11 { Real::NEG_INFINITY } else { Real::INFINITY })],
                "a box of the surface",
            );
        }
        let none: Vec<(usize, Real)> = (8..14)
            .map(|k| (k, if k < 11 { Real::INFINITY } else { Real::NEG_INFINITY }))
            .collect();
        refused(&none, "a box of the surface");
        // Cells whose inverse is infinite, and a grid that ends there.
        refused(&[(3, 1e-308)], "a cell so small");
        refused(&[(3, 1e308)], "a grid without end");
    }

    #[test]
    fn a_tree_of_splits_without_bricks_takes_no_memory() {
        let bytes = field(0.03).to_bytes();
        // One root: three halvings above nothing, which make a table of 512 entries of its 25
        // bytes.
        let mut one = vec![3u8, 3, 3];
        one.extend([0; 22]);
        let file = |size: [u32; 3], tree: &[u8]| {
            let mut file = bytes[..HEADER].to_vec();
            size.iter().for_each(|n| file.extend(n.to_le_bytes()));
            file.extend((tree.len() as u32).to_le_bytes());
            file.extend_from_slice(tree);
            file
        };
        let refused = |size, tree: &[u8]| match Baked::from_bytes(&file(size, tree)).unwrap_err() {
            BakedFileError::Value { what, .. } => what,
            other => panic!("{other}"),
        };
        assert_eq!(refused([10_000, 1, 1], &one.repeat(10_000)), "the tree");
        // Of all it could be, the size is checked before anything is made: more roots than codes,
        // coordinates beyond 32 bits.
        assert_eq!(refused([1 << 9; 3], &[0]), "the tree");
        assert_eq!(refused([1 << 28, 1, 1], &[0]), "the size of the grid");
        assert_eq!(refused([u32::MAX; 3], &[0]), "the size of the grid");
        // Nine halvings, and so many on so long a grid that coordinates would be lost.
        let deep = |levels: usize| [vec![3u8; levels], vec![0; 7 * levels + 1]].concat();
        assert_eq!(refused([1, 1, 1], &deep(9)), "the tree");
        let long = [deep(4), vec![0u8; (1 << 16) - 1]].concat();
        assert_eq!(refused([1 << 16, 1, 1], &long), "the tree");
        // Bricks without nodes.
        let error = Baked::from_bytes(&file([8, 1, 1], &[2; 8])).unwrap_err();
        assert!(matches!(error, BakedFileError::Length { .. }), "{error}");
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
                assert!(
                    !read.error_bound().is_nan()
                        && !read.distance(&Point::new(0.1, 0.1, 0.1)).is_nan(),
                    "{at}"
                );
            }
        }
    }
}
