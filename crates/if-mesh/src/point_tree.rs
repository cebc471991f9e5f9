//! Nearest neighbours among points.

use if_core::math::{Point, Real};

/// Maximum points in a leaf: fewer need more steps down, more need longer scans. A search for 30
/// neighbours among the vertices of a template body took 2.4 µs with 8 to 32, 2.8 µs with 64 and
/// 3.9 µs with 4 (the quietest of three runs on a loaded machine).
const LEAF: usize = 16;

/// A balanced k-d tree over points.
///
/// # Examples
///
/// ```
/// use if_core::math::Point;
/// use if_mesh::point_tree::PointTree;
/// let tree = PointTree::new(&[Point::origin(), Point::new(1.0, 0.0, 0.0), Point::new(4.0, 0.0, 0.0)]);
/// let mut found = Vec::new();
/// tree.nearest(&Point::new(0.9, 0.0, 0.0), 2, &mut found);
/// assert_eq!(found.iter().map(|n| n.1).collect::<Vec<_>>(), [1, 0]);
/// ```
#[derive(Clone, Debug)]
pub struct PointTree {
    /// Points in the order of the leaves, with their indices.
    points: Vec<(Point, u32)>,
    /// Axis and position of the plane that splits a range of `points` in its middle, in the order of
    /// an implicit binary tree.
    planes: Vec<(u8, Real)>,
}

impl PointTree {
    /// Sorts `points` (finite) into a tree, in O(n log n).
    ///
    /// # Panics
    ///
    /// If there are more than 2³² points.
    pub fn new(points: &[Point]) -> Self {
        assert!(u32::try_from(points.len()).is_ok(), "points are counted in 32 bits");
        let mut points: Vec<(Point, u32)> =
            points.iter().enumerate().map(|(i, p)| (*p, i as u32)).collect();
        let mut planes = Vec::new();
        part(&mut points, 0, &mut planes);
        Self { points, planes }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Writes the `count` points nearest to `p` (or all, if there are fewer) into `found`, as squared
    /// distance and index, the nearest first, and of equally near ones the smaller index first.
    pub fn nearest(&self, p: &Point, count: usize, found: &mut Vec<(Real, u32)>) {
        found.clear();
        if count > 0 {
            self.search(p, count, 0, 0, self.points.len(), 0.0, [0.0; 3], found);
        }
    }

    /// `gap` is the squared distance of `p` from the box of this node, `away` its parts along the
    /// axes.
    fn search(
        &self,
        p: &Point,
        count: usize,
        node: usize,
        first: usize,
        end: usize,
        gap: Real,
        away: [Real; 3],
        found: &mut Vec<(Real, u32)>,
    ) {
        if found.len() == count && gap > found[count - 1].0 {
            return;
        }
        if end - first <= LEAF {
            for (q, index) in &self.points[first..end] {
                insert(((p - q).norm_squared(), *index), count, found);
            }
            return;
        }
        let (axis, place) = self.planes[node];
        let (axis, middle) = (usize::from(axis), first + (end - first) / 2);
        let side = p[axis] - place;
        let mut other = away;
        other[axis] = side;
        let far = gap - away[axis] * away[axis] + side * side;
        if side < 0.0 {
            self.search(p, count, 2 * node + 1, first, middle, gap, away, found);
            self.search(p, count, 2 * node + 2, middle, end, far, other, found);
        } else {
            self.search(p, count, 2 * node + 2, middle, end, gap, away, found);
            self.search(p, count, 2 * node + 1, first, middle, far, other, found);
        }
    }
}

fn part(points: &mut [(Point, u32)], node: usize, planes: &mut Vec<(u8, Real)>) {
    if points.len() <= LEAF {
        return;
    }
    if planes.len() <= node {
        planes.resize(node + 1, (0, 0.0));
    }
    let mut low = points[0].0;
    let mut high = low;
    for (p, _) in points.iter() {
        (low, high) = (low.inf(p), high.sup(p));
    }
    let axis = (high - low).imax();
    let middle = points.len() / 2;
    // Equal coordinates are ordered by index, so that the tree is deterministic.
    points
        .select_nth_unstable_by(middle, |a, b| a.0[axis].total_cmp(&b.0[axis]).then(a.1.cmp(&b.1)));
    planes[node] = (axis as u8, points[middle].0[axis]);
    let (left, right) = points.split_at_mut(middle);
    part(left, 2 * node + 1, planes);
    part(right, 2 * node + 2, planes);
}

fn insert(new: (Real, u32), count: usize, found: &mut Vec<(Real, u32)>) {
    let before = |a: &(Real, u32), b: &(Real, u32)| a.0 < b.0 || (a.0 == b.0 && a.1 < b.1);
    if found.len() == count {
        if !before(&new, &found[count - 1]) {
            return;
        }
        found.pop();
    }
    let mut at = found.len();
    while at > 0 && before(&new, &found[at - 1]) {
        at -= 1;
    }
    found.insert(at, new);
}

#[cfg(test)]
mod tests {
    use super::*;
    use if_core::random::SplitMix64;

    fn scattered(n: usize) -> Vec<Point> {
        let mut random = SplitMix64::new(7);
        let mut unit = || random.unit();
        // On a coarse lattice, so that many are equally near.
        (0..n).map(|_| Point::new((unit() * 9.0).floor(), (unit() * 5.0).floor(), unit())).collect()
    }

    #[test]
    fn the_tree_finds_what_a_scan_of_all_points_finds() {
        for n in [0, 1, 5, 16, 17, 33, 700] {
            let points = scattered(n);
            let tree = PointTree::new(&points);
            assert_eq!((tree.len(), tree.is_empty()), (n, n == 0));
            let mut found = Vec::new();
            for (k, q) in scattered(40).iter().enumerate() {
                let q = Point::new(q.x + 0.25 * (k % 3) as Real, q.y * 1.5 - 1.0, q.z);
                for count in [0, 1, 7, 30] {
                    tree.nearest(&q, count, &mut found);
                    let mut all: Vec<(Real, u32)> = points
                        .iter()
                        .enumerate()
                        .map(|(i, p)| ((q - p).norm_squared(), i as u32))
                        .collect();
                    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                    all.truncate(count);
                    assert_eq!(found, all, "{n} points, {count} nearest");
                }
            }
        }
    }

    #[test]
    fn a_thousand_equal_points_are_told_apart_by_index() {
        let tree = PointTree::new(&[Point::origin(); 1000]);
        let mut found = Vec::new();
        tree.nearest(&Point::origin(), 3, &mut found);
        assert_eq!(found, [(0.0, 0), (0.0, 1), (0.0, 2)]);
    }
}
