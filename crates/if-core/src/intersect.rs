//! Exact triangle–triangle intersection.
//!
//! All decisions are exact for all finite coordinates, degenerate triangles included: a
//! floating-point filter decides almost all, adaptive predicates the rest.

mod fan;
mod planar;
mod predicates;
mod wide;

use crate::math::{Point, Real};
#[cfg(test)]
use crate::random::SplitMix64;
pub use fan::{Fan, is_flat_fan};
use planar::Hull;
use predicates::Plane;
pub use predicates::side_of_plane;

/// What two triangles, as closed sets of points, have in common.
///
/// The relative interior of a triangle is the triangle without its edges; that of one that is
/// degenerate to a segment is the segment without its ends; that of a point is the point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Contact {
    /// No point.
    Disjoint,
    /// Points, but none of both relative interiors: an edge or a corner of one lies on the other.
    Touching,
    /// A point of both relative interiors, and the six corners do not lie in one plane.
    Crossing,
    /// A point of both relative interiors, and the six corners lie in one plane.
    Coplanar,
}

impl Contact {
    /// Whether there is any common point.
    #[inline]
    pub fn is_some(self) -> bool {
        self != Contact::Disjoint
    }
}

/// What the triangles `a` and `b` have in common, exactly, for all finite coordinates.
///
/// # Source
///
/// Guigue and Devillers 2003, *Fast and robust triangle-triangle overlap test using orientation
/// predicates*; where a corner lies in the other's plane, or a triangle is degenerate, a separating
/// line in that plane decides.
///
/// # Examples
///
/// ```
/// use if_core::{intersect::{Contact, triangles}, math::Point};
/// let p = |x, y, z| Point::new(x, y, z);
/// let floor = [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0)];
/// let wall = [p(0.2, 0.2, -1.0), p(0.2, 0.2, 1.0), p(2.0, 2.0, 0.0)];
/// assert_eq!(triangles(floor.each_ref(), wall.each_ref()), Contact::Crossing);
/// ```
#[inline]
pub fn triangles(a: [&Point; 3], b: [&Point; 3]) -> Contact {
    let plane_b = Plane::new(b);
    let sa = a.map(|p| plane_b.side(p));
    if on_one_side(sa) {
        return Contact::Disjoint;
    }
    let plane_a = Plane::new(a);
    let sb = b.map(|p| plane_a.side(p));
    if on_one_side(sb) {
        return Contact::Disjoint;
    }
    // Three signs straddle only a plane, so that then neither triangle is degenerate.
    if straddles(sa) && straddles(sb) {
        overlap_on_line(a, sa, b, sb)
    } else {
        grazing(a, sa, b, sb)
    }
}

/// What triangles `a` and `b` of one mesh have in common *beyond* the corners they share by index;
/// `ia` and `ib` name their corners. [`Contact::Disjoint`] for neighbours that only meet in their
/// common corner or edge.
///
/// No shared corner: [`triangles`]. Three: the same triangle twice, which is an error of connectivity
/// and not of position: [`Contact::Disjoint`].
///
/// # Source
///
/// Counts as libigl's `remesh_self_intersections` does (CGAL's exact kernel; the same number on 54
/// garments, scans, noisy and grid-rounded meshes), which shares corners by equal coordinates too
/// and leaves degenerate triangles out: give welded indices and skip [`is_degenerate`] triangles
/// for that.
pub fn triangles_sharing(a: [&Point; 3], ia: [u32; 3], b: [&Point; 3], ib: [u32; 3]) -> Contact {
    let mut shared = [(0, 0); 3];
    let mut n = 0;
    for (i, va) in ia.iter().enumerate() {
        if let Some(j) = ib.iter().position(|vb| vb == va) {
            shared[n] = (i, j);
            n += 1;
        }
    }
    match n {
        0 => triangles(a, b),
        1 => beyond_vertex(a, shared[0].0, b, shared[0].1),
        2 => beyond_edge(a, 3 - shared[0].0 - shared[1].0, b, 3 - shared[0].1 - shared[1].1),
        _ => Contact::Disjoint,
    }
}

/// Whether the corners lie on one line, exactly.
pub fn is_degenerate(t: [&Point; 3]) -> bool {
    Hull::new(&t).len() < 3
}

/// Where a segment passes through a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Place along the segment, 0 at `p` and 1 at `q`.
    pub parameter: Real,
    /// Barycentric coordinates in the triangle: three numbers ≥ 0 with sum 1.
    pub barycentric: [Real; 3],
    /// +1 where the segment leaves on the side that sees the triangle counter-clockwise, −1 else.
    pub direction: i8,
}

/// Where the closed segment from `p` to `q` meets the closed triangle `t`; `None` if they do
/// not meet, and if both lie in one plane or the triangle is degenerate: then the common points are
/// not a single place.
///
/// # Accuracy
///
/// Whether they meet is decided exactly. The numbers are quotients of rounded volumes, always in
/// their ranges; where the volumes themselves overflow or vanish (lengths beyond 1e100 or below
/// 1e-100) they are the middle.
pub fn segment_triangle(p: &Point, q: &Point, t: [&Point; 3]) -> Option<Passage> {
    let plane = Plane::new(t);
    let (sp, sq) = (plane.side(p), plane.side(q));
    if sp == sq || !line_meets(p, q, t) {
        return None;
    }
    let height =
        |x: &Point, sign: i8| if sign == 0 { 0.0 } else { plane.normal.dot(&(x - t[0])).abs() };
    let (hp, hq) = (height(p, sp), height(q, sq));
    let parameter = match hp / (hp + hq) {
        quotient if quotient.is_finite() => quotient,
        // Both heights are lost to underflow or overflow.
        _ => Real::from(sp.abs()) / Real::from(sp.abs() + sq.abs()),
    };
    let along = q - p;
    let volumes = [0, 1, 2].map(|k| {
        let (u, v) = (t[(k + 1) % 3] - p, t[(k + 2) % 3] - p);
        along.dot(&u.cross(&v)).abs()
    });
    let sum: Real = volumes.iter().sum();
    let barycentric =
        volumes.map(|v| if sum > 0.0 && sum.is_finite() { v / sum } else { 1.0 / 3.0 });
    Some(Passage { parameter, barycentric, direction: if sq > sp { 1 } else { -1 } })
}

#[inline]
fn on_one_side(s: [i8; 3]) -> bool {
    s[0] != 0 && s[0] == s[1] && s[0] == s[2]
}

#[inline]
fn straddles(s: [i8; 3]) -> bool {
    let (low, high) = (s[0].min(s[1]).min(s[2]), s[0].max(s[1]).max(s[2]));
    low < 0 && high > 0
}

/// The corner that is alone on its side of the other plane.
#[inline]
fn apex(s: [i8; 3]) -> usize {
    (0..3)
        .find(|&k| s[k] != 0 && s[(k + 1) % 3] != s[k] && s[(k + 2) % 3] != s[k])
        .expect("a straddling triangle has one")
}

/// Both triangles cross the line in which their planes meet, each in an interval: do these overlap?
fn overlap_on_line(a: [&Point; 3], sa: [i8; 3], b: [&Point; 3], sb: [i8; 3]) -> Contact {
    let (i, j) = (apex(sa), apex(sb));
    let (p1, mut q1, mut r1) = (a[i], a[(i + 1) % 3], a[(i + 2) % 3]);
    let (p2, mut q2, mut r2) = (b[j], b[(j + 1) % 3], b[(j + 2) % 3]);
    // Turn each triangle so that the other's apex lies on its positive side.
    if sa[i] < 0 {
        std::mem::swap(&mut q2, &mut r2);
    }
    if sb[j] < 0 {
        std::mem::swap(&mut q1, &mut r1);
    }
    // The intervals are [q1, r1] and [r2, q2]: compare q1 with q2, and r2 with r1.
    let first = side_of_plane(p1, q1, p2, q2);
    if first > 0 {
        return Contact::Disjoint;
    }
    match (first, side_of_plane(p1, r1, r2, p2)) {
        (_, 1) => Contact::Disjoint,
        (-1, -1) => Contact::Crossing,
        _ => Contact::Touching,
    }
}

/// A corner lies in the other's plane, or a triangle is degenerate.
#[cold]
#[inline(never)]
fn grazing(a: [&Point; 3], sa: [i8; 3], b: [&Point; 3], sb: [i8; 3]) -> Contact {
    for (t, s, other) in [(a, sa, b), (b, sb, a)] {
        if s != [0; 3] && !straddles(s) {
            // `t` touches the other's plane from one side: what lies in the plane is a corner or an
            // edge.
            let mut inside = [t[0]; 3];
            let mut n = 0;
            for k in 0..3 {
                if s[k] == 0 {
                    inside[n] = t[k];
                    n += 1;
                }
            }
            let contact = planar::contact(&Hull::new(&inside[..n]), &Hull::new(&other));
            return contact.min(Contact::Touching);
        }
    }
    match (straddles(sa), straddles(sb)) {
        (true, _) => pierced(&Hull::new(&a), b),
        (_, true) => pierced(&Hull::new(&b), a),
        _ => planar::contact(&Hull::new(&a), &Hull::new(&b)),
    }
}

/// `needle` is degenerate to a segment whose ends lie on different sides of `t`.
fn pierced(needle: &Hull<'_>, t: [&Point; 3]) -> Contact {
    let (p, q) = needle.ends();
    let sides = sides_of_line(p, q, t);
    match (sides.contains(&-1), sides.contains(&1), sides.contains(&0)) {
        (true, true, _) => Contact::Disjoint,
        (_, _, true) => Contact::Touching,
        _ => Contact::Crossing,
    }
}

/// On which side of each edge of `t` the line from `p` to `q` passes.
#[inline]
fn sides_of_line(p: &Point, q: &Point, t: [&Point; 3]) -> [i8; 3] {
    [0, 1, 2].map(|k| side_of_plane(p, q, t[k], t[(k + 1) % 3]))
}

/// Whether the line from `p` to `q`, which is not in the plane of `t`, meets the closed `t`.
#[inline]
fn line_meets(p: &Point, q: &Point, t: [&Point; 3]) -> bool {
    let first = side_of_plane(p, q, t[0], t[1]);
    let second = side_of_plane(p, q, t[1], t[2]);
    if first * second < 0 {
        return false;
    }
    let third = side_of_plane(p, q, t[2], t[0]);
    first * third >= 0 && second * third >= 0
}

/// `a[i]` and `b[j]` are one vertex. A ray from it through another common point leaves the first
/// of the triangles through the edge opposite to the vertex, still in the other triangle.
fn beyond_vertex(a: [&Point; 3], i: usize, b: [&Point; 3], j: usize) -> Contact {
    let opposite = |t: [&Point; 3], k: usize, other: [&Point; 3]| {
        let plane = Plane::new(other);
        [1, 2].map(|d| plane.side(t[(k + d) % 3]))
    };
    let sa = opposite(a, i, b);
    if sa[0] == sa[1] && sa[0] != 0 {
        return Contact::Disjoint;
    }
    let sb = opposite(b, j, a);
    if sb[0] == sb[1] && sb[0] != 0 {
        return Contact::Disjoint;
    }
    let meets = |t: [&Point; 3], k: usize, s: [i8; 2], other: [&Point; 3]| {
        let (p, q) = (t[(k + 1) % 3], t[(k + 2) % 3]);
        if s[0] != s[1] && !line_meets(p, q, other) {
            return false;
        }
        if is_degenerate(t) {
            // Two segments from the vertex, which end in the other corners.
            let hull = Hull::new(&other);
            return [p, q].iter().zip(s).any(|(x, s)| {
                s == 0 && *x != t[k] && planar::contact(&Hull::new(&[x]), &hull).is_some()
            });
        }
        s[0] != s[1] || triangles([p, q, q], other).is_some()
    };
    if meets(a, i, sa, b) || meets(b, j, sb, a) { triangles(a, b) } else { Contact::Disjoint }
}

/// `a` and `b` share the edges opposite to `a[i]` and `b[j]`: they meet beyond it only where they
/// lie in one plane, and on the same side of the edge.
fn beyond_edge(a: [&Point; 3], i: usize, b: [&Point; 3], j: usize) -> Contact {
    let (e0, e1) = (a[(i + 1) % 3], a[(i + 2) % 3]);
    if side_of_plane(e0, e1, a[i], b[j]) != 0 {
        return Contact::Disjoint;
    }
    planar::beyond_edge(e0, e1, a[i], b[j])
}

#[cfg(test)]
mod rational;
#[cfg(test)]
mod tests;
