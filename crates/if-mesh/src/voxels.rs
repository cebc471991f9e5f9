//! A block of voxels: surfaces are walls, and a flood finds the voxels connected to infinity.

mod flood;

use crate::grid::GridSize;
use flood::OpenRows;
use if_core::aabb::Aabb;
use if_core::math::{Point, Real, Vector, larger, smaller};
use if_core::mesh::TriMesh;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// State of a voxel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Voxel {
    /// No wall, and connected to infinity.
    Outside,
    /// No wall, and not connected to infinity.
    Inside,
    /// A wall passes through it: its points need an exact test.
    Wall,
    /// Marked inside by [`Voxels::fill`]: the flood stops there.
    Filled,
    /// Connected to the border of the block, but not to infinity: inside a body that crosses the
    /// border.
    Core,
}

/// Voxels of equal size over a box. Outside the box everything is [`Voxel::Outside`].
#[derive(Clone, Debug)]
pub struct Voxels {
    origin: Point,
    cell: Real,
    /// Voxels per metre.
    per_metre: Real,
    size: GridSize,
    states: Vec<Voxel>,
}

/// Maximum number of voxels: 64 MiB. Larger regions get larger cells.
const MAX_VOXELS: Real = 67_108_864.0;

impl Voxels {
    /// A block over `region` with a border of two voxels, everything inside and no walls yet.
    /// `cell` (metres) is enlarged if the block would not fit into 64 MiB, or if it is zero.
    pub fn new(region: &Aabb, cell: Real) -> Self {
        let size = region.size();
        // A region that is a point has a voxel of any size.
        let cell = if cell > 0.0 || size.max() > 0.0 { cell } else { 1.0 };
        let fits = |c: Real| (0..3).map(|k| size[k] / c + 5.0).product::<Real>() <= MAX_VOXELS;
        let mut cell = cell.max(size.max() * 1e-4);
        while !fits(cell) {
            cell *= 1.25;
        }
        let size = GridSize([0, 1, 2].map(|k| (size[k] / cell).ceil() as usize + 5));
        let origin = region.min - Vector::repeat(2.0 * cell);
        Self { origin, cell, per_metre: 1.0 / cell, size, states: vec![Voxel::Inside; size.len()] }
    }

    /// Side of a voxel, in metres.
    pub fn cell(&self) -> Real {
        self.cell
    }

    /// Makes every voxel that the triangle touches a wall, except filled ones. The test is
    /// conservative, so that no path between face neighbours leads through a triangle.
    pub fn add_wall(&mut self, corners: [&Point; 3]) {
        let mut found = Vec::new();
        self.touched(corners, |at| self.states[at] == Voxel::Inside, |at| found.push(at));
        found.into_iter().for_each(|at| self.states[at] = Voxel::Wall);
    }

    /// Makes all triangles of `mesh` walls, as [`Voxels::add_wall`] does.
    pub fn add_walls(&mut self, mesh: &TriMesh) {
        let triangles = (0..mesh.triangles().len()).into_par_iter();
        self.add_walls_of(triangles.map(|t| mesh.corners(t).map(|p| *p)));
    }

    /// Makes all `triangles` walls, as [`Voxels::add_wall`] does.
    pub fn add_walls_of(&mut self, triangles: impl ParallelIterator<Item = [Point; 3]>) {
        let marks = Marks::new(self.states.len());
        let is_open = |at: usize| self.states[at] == Voxel::Inside && !marks.has(at);
        triangles.for_each(|t| self.touched(t.each_ref(), is_open, |at| marks.set(at)));
        self.set_marked(&marks, Voxel::Wall);
    }

    /// Calls `visit` with the number of every voxel that the triangle touches and that `is_open`.
    fn touched(
        &self,
        corners: [&Point; 3],
        is_open: impl Fn(usize) -> bool,
        mut visit: impl FnMut(usize),
    ) {
        let rel = corners.map(|p| (p - self.origin) * self.per_metre);
        let [low, high] =
            [smaller, larger].map(|of| [0, 1, 2].map(|k| of(of(rel[0][k], rel[1][k]), rel[2][k])));
        if high.iter().any(|c| *c < 0.0) {
            return;
        }
        // Numbers below zero become zero, and for others truncation is the floor, without a call.
        let ([x0, y0, z0], high) = (low.map(|c| c as usize), high.map(|c| c as usize));
        let [x1, y1, z1] = [0, 1, 2].map(|k| high[k].min(self.size.0[k] - 1));
        if x1 < x0 || y1 < y0 || z1 < z0 {
            return;
        }
        let slab = SlabTest::new(&rel);
        for z in z0..=z1 {
            for y in y0..=y1 {
                for x in x0..=x1 {
                    let at = self.size.index([x, y, z]);
                    if is_open(at) && slab.touches([x as Real, y as Real, z as Real]) {
                        visit(at);
                    }
                }
            }
        }
    }

    /// Marks the voxels along each segment as filled, except walls.
    pub fn fill(&mut self, segments: impl ParallelIterator<Item = [Point; 2]>) {
        let [nx, ny, nz] = self.size.0;
        let marks = Marks::new(self.states.len());
        segments.for_each(|[a, b]| {
            let (a, b) = ((a - self.origin) * self.per_metre, (b - self.origin) * self.per_metre);
            let steps = (2.0 * (b - a).amax()).ceil().max(1.0) as usize;
            let step = (b - a) / steps as Real;
            // Rounding moves no point of a segment from well within the block out of it.
            let is_within = (0..3).all(|k| {
                let end = self.size.0[k] as Real - WELL_WITHIN;
                a[k].min(b[k]) >= WELL_WITHIN && a[k].max(b[k]) <= end
            });
            let mut last = usize::MAX;
            for k in 0..=steps {
                let p = a + step * k as Real;
                let is_inside = is_within
                    || (p.x >= 0.0
                        && p.y >= 0.0
                        && p.z >= 0.0
                        && p.x < nx as Real
                        && p.y < ny as Real
                        && p.z < nz as Real);
                if !is_inside {
                    continue;
                }
                // For numbers that are not negative, truncation is the floor, without a call.
                let [x, y, z] = [p.x as i32, p.y as i32, p.z as i32].map(|c| c as usize);
                let at = (z * ny + y) * nx + x;
                if at != last {
                    marks.set(at);
                    last = at;
                }
            }
        });
        self.set_marked(&marks, Voxel::Filled);
    }

    /// Sets the inside voxels among `marks` to `to`.
    fn set_marked(&mut self, marks: &Marks, to: Voxel) {
        /// Words of marks that a task visits: 64 kB of voxels.
        const WORDS: usize = 1024;
        let words = self.states.par_chunks_mut(64 * WORDS).zip(marks.0.par_chunks(WORDS));
        words.for_each(|(states, marks)| {
            for (states, word) in states.chunks_mut(64).zip(marks) {
                let mut word = word.load(Ordering::Relaxed);
                while word != 0 {
                    let state = &mut states[word.trailing_zeros() as usize];
                    if *state == Voxel::Inside {
                        *state = to;
                    }
                    word &= word - 1;
                }
            }
        });
    }

    /// Floods from the border, through faces, all voxels that no wall separates from it. A border
    /// voxel is a source if `is_source` returns true for its centre; those inside a body that
    /// crosses the border are not.
    pub fn flood(&mut self, mut is_source: impl FnMut(&Point) -> bool) {
        let [nx, ny, nz] = self.size.0;
        let mut seeds: Vec<u32> = Vec::new();
        let mut open = OpenRows::inside(&self.states, nx);
        for z in 0..nz {
            for y in 0..ny {
                let inner_row = z > 0 && z + 1 < nz && y > 0 && y + 1 < ny;
                let step = if inner_row { (nx - 1).max(1) } else { 1 };
                for x in (0..nx).step_by(step) {
                    let at = self.size.index([x, y, z]);
                    // A component that touches the border is classified once, by its first voxel.
                    if self.states[at] == Voxel::Inside {
                        let to = if is_source(&self.center([x, y, z])) {
                            Voxel::Outside
                        } else {
                            Voxel::Core
                        };
                        self.flood_from(at, to, &mut open, &mut seeds);
                    }
                }
            }
        }
    }

    /// Sets the component of inside voxels at voxel `at` to `to`, a run of a row at a time.
    fn flood_from(&mut self, at: usize, to: Voxel, open: &mut OpenRows, seeds: &mut Vec<u32>) {
        let [nx, ny, nz] = self.size.0;
        seeds.push(at as u32);
        while let Some(seed) = seeds.pop() {
            let [x, y, z] = self.size.coordinates(seed as usize);
            let row = z * ny + y;
            let run = open.run(row, x);
            if run.is_empty() {
                continue;
            }
            open.close(row, run.clone());
            self.states[row * nx..][run.clone()].fill(to);
            let beside = [
                (y > 0).then(|| row.wrapping_sub(1)),
                (y + 1 < ny).then(|| row + 1),
                (z > 0).then(|| row.wrapping_sub(ny)),
                (z + 1 < nz).then(|| row + ny),
            ];
            for other in beside.into_iter().flatten() {
                open.starts(other, run.clone(), |x| seeds.push((other * nx + x) as u32));
            }
        }
    }

    /// The voxel that holds `p`.
    #[inline]
    pub fn at(&self, p: &Point) -> Voxel {
        let mut index = 0;
        let mut stride = 1;
        for k in 0..3 {
            // For numbers that are not negative, truncation is the floor, without a call.
            let c = (p[k] - self.origin[k]) * self.per_metre;
            if !(c >= 0.0 && c < self.size.0[k] as Real) {
                return Voxel::Outside;
            }
            index += c as i32 as usize * stride;
            stride *= self.size.0[k];
        }
        self.states[index]
    }

    /// The voxels of the points `start + k step` along x, for all k below `n` with points inside the
    /// block.
    pub fn row(&self, start: &Point, step: Real, n: usize) -> impl Iterator<Item = (usize, Voxel)> {
        let place = |x: Real, axis: usize| (x - self.origin[axis]) * self.per_metre;
        let held = |c: Real, axis: usize| c >= 0.0 && c < self.size.0[axis] as Real;
        let (y, z) = (place(start.y, 1), place(start.z, 2));
        let first =
            if held(y, 1) && held(z, 2) { self.size.index([0, y as usize, z as usize]) } else { 0 };
        (0..if held(y, 1) && held(z, 2) { n } else { 0 }).filter_map(move |k| {
            let x = place(start.x + k as Real * step, 0);
            held(x, 0).then(|| (k, self.states[first + x as usize]))
        })
    }

    /// A distance within which all voxels around `p` are outside, in metres: the side of a voxel, or 0
    /// where one of the 26 neighbours of the voxel at `p` is not outside.
    pub fn outside_radius(&self, p: &Point) -> Real {
        let [nx, ny, nz] = self.size.0.map(|n| n as isize);
        // Far from the block the numbers saturate.
        let [x, y, z] =
            [0, 1, 2].map(|k| ((p[k] - self.origin[k]) * self.per_metre).floor() as isize);
        let beside = |c: isize, n: isize| c.saturating_sub(1).max(0)..c.saturating_add(2).min(n);
        let columns = beside(x, nx);
        let is_free = columns.is_empty()
            || beside(z, nz).all(|z| {
                beside(y, ny).all(|y| {
                    let row = ((z * ny + y) * nx) as usize;
                    self.states[row + columns.start as usize..row + columns.end as usize]
                        .iter()
                        .all(|s| *s == Voxel::Outside)
                })
            });
        // Less by more than rounding.
        if is_free { 0.999 * self.cell } else { 0.0 }
    }

    /// The side of the 26 neighbours of the voxel at `p`: [`Voxel::Outside`] if one is outside, else
    /// [`Voxel::Inside`] if one is inside or filled, else [`Voxel::Wall`].
    pub fn around(&self, p: &Point) -> Voxel {
        let mut found = Voxel::Wall;
        for k in 0..27 {
            let step = Vector::new(
                (k % 3) as Real - 1.0,
                (k / 3 % 3) as Real - 1.0,
                (k / 9) as Real - 1.0,
            );
            match self.at(&(p + step * self.cell)) {
                Voxel::Outside => return Voxel::Outside,
                Voxel::Inside | Voxel::Filled => found = Voxel::Inside,
                Voxel::Wall | Voxel::Core => {}
            }
        }
        found
    }

    /// Numbers of voxels that are [outside, inside, walls, filled, core].
    pub fn counts(&self) -> [usize; 5] {
        let mut counts = [0; 5];
        for s in &self.states {
            counts[*s as usize] += 1;
        }
        counts
    }

    fn center(&self, c: [usize; 3]) -> Point {
        self.origin
            + Vector::new(c[0] as Real + 0.5, c[1] as Real + 0.5, c[2] as Real + 0.5) * self.cell
    }
}

/// Distance from the border of a block, in voxels, that rounding does not bridge: coordinates up to
/// 10⁷ voxels are rounded by less. A thousand times more checks more segments point by point.
const WELL_WITHIN: Real = 1e-6;

/// A set of voxels to which several threads add. Nothing is removed, so the order does not matter.
struct Marks(Vec<AtomicU64>);

impl Marks {
    fn new(voxels: usize) -> Self {
        Self((0..voxels.div_ceil(64)).map(|_| AtomicU64::new(0)).collect())
    }

    fn has(&self, at: usize) -> bool {
        self.0[at / 64].load(Ordering::Relaxed) & (1 << (at % 64)) != 0
    }

    fn set(&self, at: usize) {
        // Reading first is faster where most voxels are marked many times.
        if !self.has(at) {
            self.0[at / 64].fetch_or(1 << (at % 64), Ordering::Relaxed);
        }
    }
}

/// Separating axes of a triangle and unit boxes: the triangle's plane and the nine edge products.
/// (The caller's range covers the three box axes.)
///
/// # Source
///
/// Akenine-Möller 2001, with the half sizes enlarged so that rounding cannot miss a contact.
struct SlabTest {
    axes: [(Vector, Real, Real); 10],
}

/// Enlargement of the half voxel. Rounding is about 1e-13 of a voxel index of 1,000; ten times less
/// would suffice, and ten times more adds hardly any walls.
const SLACK: Real = 0.5 + 1e-9;

impl SlabTest {
    fn new(t: &[Vector; 3]) -> Self {
        let edges = [t[1] - t[0], t[2] - t[1], t[0] - t[2]];
        let mut axes = [(Vector::zeros(), 0.0, 0.0); 10];
        axes[0].0 = edges[0].cross(&edges[1]);
        for (i, e) in edges.iter().enumerate() {
            for (k, unit) in [Vector::x(), Vector::y(), Vector::z()].iter().enumerate() {
                axes[1 + 3 * i + k].0 = unit.cross(e);
            }
        }
        for (axis, low, high) in &mut axes {
            let radius = SLACK * (axis.x.abs() + axis.y.abs() + axis.z.abs());
            let d = [axis.dot(&t[0]), axis.dot(&t[1]), axis.dot(&t[2])];
            *low = smaller(smaller(d[0], d[1]), d[2]) - radius;
            *high = larger(larger(d[0], d[1]), d[2]) + radius;
        }
        Self { axes }
    }

    fn touches(&self, corner: [Real; 3]) -> bool {
        let c = Vector::new(corner[0] + 0.5, corner[1] + 0.5, corner[2] + 0.5);
        self.axes.iter().all(|(axis, low, high)| {
            let d = axis.dot(&c);
            *low <= d && d <= *high
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::random::SplitMix64;

    fn box_walls(v: &mut Voxels, leave_out: usize) {
        let p = |k: usize| Point::new((k & 1) as f64, (k >> 1 & 1) as f64, (k >> 2 & 1) as f64);
        let quads =
            [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
        for (i, q) in quads.iter().enumerate() {
            if i != leave_out {
                let [a, b, c, d] = q.map(p);
                v.add_wall([&a, &b, &c]);
                v.add_wall([&a, &c, &d]);
            }
        }
    }

    fn unit() -> Aabb {
        Aabb { min: Point::origin(), max: Point::new(1.0, 1.0, 1.0) }
    }

    #[test]
    fn a_closed_box_is_inside_and_an_open_one_is_not() {
        for (leave_out, expected) in [(9, Voxel::Inside), (3, Voxel::Outside)] {
            let mut v = Voxels::new(&unit(), 0.037);
            box_walls(&mut v, leave_out);
            v.flood(|_| true);
            assert_eq!(v.at(&Point::new(0.5, 0.5, 0.5)), expected);
            assert_eq!(v.at(&Point::new(-0.06, 0.5, 0.5)), Voxel::Outside);
            assert_eq!(v.at(&Point::new(0.0, 0.5, 0.5)), Voxel::Wall);
            assert_eq!(v.at(&Point::new(70.0, 0.5, 0.5)), Voxel::Outside);
        }
    }

    #[test]
    fn a_filled_gap_holds_the_flood_back() {
        let mut v = Voxels::new(&unit(), 0.05);
        box_walls(&mut v, 0); // open at z = 0
        let place = |k: u32| (f64::from(k % 61) / 60.0, f64::from(k / 61) / 60.0);
        let segments: Vec<[Point; 2]> = (0..61 * 61)
            .map(place)
            .map(|(x, y)| [Point::new(x, y, 0.1), Point::new(x, y, 0.12)])
            .collect();
        v.fill(segments.into_par_iter());
        v.flood(|_| true);
        assert_eq!(v.at(&Point::new(0.5, 0.5, 0.5)), Voxel::Inside);
        assert_eq!(v.at(&Point::new(0.5, 0.5, 0.11)), Voxel::Filled);
    }

    #[test]
    fn segments_fill_the_voxels_of_their_places_also_across_the_border() {
        let mut random = SplitMix64::new(3);
        let mut next = || random.unit();
        let mut v = Voxels::new(&unit(), 0.05);
        let mut point = || Point::new(next(), next(), next()) * 1.6 - Vector::repeat(0.3);
        let mut segments: Vec<[Point; 2]> = (0..200).map(|_| [point(), point()]).collect();
        // Along the faces of voxels, and a point.
        let corner = v.origin + Vector::new(5.0, 7.0, 3.0) * v.cell;
        segments.extend([
            [corner, corner + Vector::x() * (9.0 * v.cell)],
            [corner, corner - Vector::new(2.0, 4.0, 1.0) * v.cell],
            [corner, corner],
        ]);
        let mut expected = vec![Voxel::Inside; v.states.len()];
        for [a, b] in &segments {
            let (a, b) = ((a - v.origin) * v.per_metre, (b - v.origin) * v.per_metre);
            let steps = (2.0 * (b - a).amax()).ceil().max(1.0);
            for k in 0..=steps as usize {
                let p = a + (b - a) / steps * k as Real;
                let c = [p.x, p.y, p.z].map(Real::floor);
                if (0..3).all(|k| c[k] >= 0.0 && c[k] < v.size.0[k] as Real) {
                    expected[v.size.index(c.map(|c| c as usize))] = Voxel::Filled;
                }
            }
        }
        v.fill(segments.into_par_iter());
        assert!(v.states == expected && v.counts()[Voxel::Filled as usize] > 1000);
    }

    #[test]
    fn the_flood_of_an_empty_region_terminates() {
        let point = Point::new(3.0, -1.0, 2.0);
        for region in [Aabb { min: point, max: point }, Aabb::EMPTY] {
            let mut v = Voxels::new(&region, 0.0);
            v.flood(|_| true);
            assert!(v.cell() > 0.0 && v.counts().iter().sum::<usize>() == 125);
        }
    }

    #[test]
    fn within_the_outside_radius_all_is_outside() {
        let mut v = Voxels::new(&unit(), 0.037);
        box_walls(&mut v, 9);
        v.flood(|_| true);
        let place = |k: u32, m: u32| f64::from(k * m % 499) / 499.0 * 1.6 - 0.3;
        let (mut free, mut not_free) = (0, 0);
        for k in 0..1500 {
            let p = Point::new(place(k, 17), place(k, 101), place(k, 257));
            let radius = v.outside_radius(&p);
            assert!(radius == 0.0 || v.at(&p) == Voxel::Outside);
            for axis in 0..3 {
                for step in [-1.0, 1.0] {
                    let mut q = p;
                    q[axis] += step * radius;
                    assert!(radius == 0.0 || v.at(&q) == Voxel::Outside, "{p} {q}");
                }
            }
            if radius > 0.0 { free += 1 } else { not_free += 1 }
        }
        assert!(free > 300 && not_free > 300, "{free} {not_free}");
        assert!(v.outside_radius(&Point::new(1e300, -1e300, 0.0)) > 0.0);
    }

    #[test]
    fn a_border_without_a_source_is_core() {
        let mut v = Voxels::new(&unit(), 0.1);
        v.flood(|_| false);
        let [outside, inside, walls, _, core] = v.counts();
        assert!(outside == 0 && walls == 0 && inside == 0 && core > 1000);
    }

    #[test]
    fn a_huge_region_gets_larger_cells_rather_than_huge_memory() {
        let mut region = unit();
        region.max *= 1e6;
        let v = Voxels::new(&region, 1e-3);
        assert!(v.counts().iter().sum::<usize>() as Real <= MAX_VOXELS && v.cell() > 1.0);
    }
}
