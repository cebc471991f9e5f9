//! Skinning weights of garments from those of the body.

use crate::skin_weights::{SkinError, SkinWeights};
use if_core::closest::{Closest, ClosestPoint};
use if_core::edges::{Edges, parts_by_edges};
use if_core::math::{Real, Vector, unit_or_zero};
use if_core::mesh::TriMesh;
use if_core::rows::Rows;
use if_mesh::body_surface::turned_outwards;
use if_mesh::index::Bvh;
use if_sparse::{Cholesky, Entry, Mat};
use rayon::prelude::*;

/// Farthest distance at which a garment's vertex has the weights of the body, in metres. With 10 cm
/// the panels of a dress follow the leg that happens to be nearer.
const NEAR: Real = 0.05;
/// Least cosine between the normals there: the body's nearest point may be on the other leg.
const ALIKE: Real = 0.5;
/// Rounds of smoothing. Without them folds of the body's weights strain cloth that does not touch it;
/// with 30, sleeves and trousers lag behind limbs by twice as much.
const ROUNDS: usize = 10;
/// Shortest length of an edge, in metres: shorter ones would outweigh all others.
const SHORTEST: Real = 1e-5;

/// Weights for the vertices of `garment`, worn on `body` with the weights `skin` for a skeleton of
/// `joints` joints, in the rest pose of both.
///
/// Vertices within 5 cm of the body, and with a normal at most 60° from its own, have the weights of
/// the nearest point. The others have the harmonic extension of these along the garment. All are
/// smoothed along it for ten rounds. Parts that are nowhere near have the weights of the nearest point
/// as they are. The four largest at each vertex are kept. Vertices at one place, as along a seam, have
/// the same weights.
///
/// [`WeightGrid`](super::WeightGrid) has weights for all points of space, but mixes those of limbs that are near one
/// another.
///
/// # Errors
///
/// [`SkinError`]: no vertices, triangles or joints, or weights of another body or skeleton.
///
/// # Source
///
/// Matching by distance and normal, and extension along the garment: Abdrashitov et al. 2023, *Robust
/// Skin Weights Transfer via Weight Inpainting*; membranes instead of its thin plates.
pub fn transferred_weights(
    body: &TriMesh,
    skin: &SkinWeights,
    garment: &TriMesh,
    joints: usize,
) -> Result<SkinWeights, SkinError> {
    let vertices = body.vertices().len();
    if body.triangles().is_empty() || joints == 0 {
        return Err(SkinError::Empty { vertices, joints });
    }
    skin.check(vertices, joints)?;
    let binding = Binding::new(body, garment)?;
    let mut best = vec![[(0.0, 0_u16); 4]; garment.vertices().len()];
    for joint in 0..joints as u16 {
        let of = |v: usize| {
            let slots = skin.joints()[v].iter().zip(&skin.weights()[v]);
            slots.map(|(j, w)| if *j == joint { Real::from(*w) } else { 0.0 }).sum::<Real>()
        };
        let nearest = binding.nearest(of);
        if nearest.iter().all(|w| *w == 0.0) {
            continue;
        }
        for (best, w) in best.iter_mut().zip(binding.spread(nearest)) {
            // Rounding leaves numbers a little below zero.
            insert(best, (w.max(0.0), joint));
        }
    }
    let normalised = |best: &[(Real, u16); 4]| {
        let sum: Real = best.iter().map(|(w, _)| w).sum();
        (best.map(|(_, j)| j), best.map(|(w, _)| (w / sum) as f32))
    };
    let (joint, weight) = best.iter().map(normalised).unzip();
    SkinWeights::new(joint, weight, joints)
}

/// A garment bound to the surface of the body on which it is worn: numbers that vary over the body are
/// carried to it as [`transferred_weights`] carries weights.
#[derive(Debug)]
pub struct Binding {
    /// The corners of the triangle of the body that is nearest to each vertex, and their shares.
    places: Vec<([u32; 3], [Real; 3])>,
    net: Net,
    extension: Extension,
}

impl Binding {
    /// Binds `garment` to `body`, both in one pose.
    ///
    /// # Errors
    ///
    /// A body without triangles, or a garment whose parts are too far apart in size.
    pub fn new(body: &TriMesh, garment: &TriMesh) -> Result<Self, SkinError> {
        if body.triangles().is_empty() {
            return Err(SkinError::Empty { vertices: body.vertices().len(), joints: 0 });
        }
        // Its normals face the cloth, also of a body that is inside out.
        let turned = turned_outwards(body);
        let body = turned.as_ref().unwrap_or(body);
        let nearest = nearest_points(body, garment);
        let net = Net::new(garment);
        let extension = Extension::new(&net, &matched(body, garment, &net, &nearest))?;
        let place = |c: &Closest| (body.triangles()[c.triangle as usize], c.barycentric);
        Ok(Self { places: nearest.iter().map(place).collect(), net, extension })
    }

    /// A number for each vertex of the garment, from those of the body's vertices.
    pub fn carried(&self, of: impl Fn(usize) -> Real) -> Vec<Real> {
        self.spread(self.nearest(of))
    }

    /// The numbers at the nearest points.
    fn nearest(&self, of: impl Fn(usize) -> Real) -> Vec<Real> {
        let at = |(corners, shares): &([u32; 3], [Real; 3])| {
            (0..3).map(|k| shares[k] * of(corners[k] as usize)).sum::<Real>()
        };
        self.places.iter().map(at).collect()
    }

    /// Those of near cloth, extended along the garment and smoothed.
    fn spread(&self, mut column: Vec<Real>) -> Vec<Real> {
        self.extension.extend(&self.net, &mut column);
        (0..ROUNDS).for_each(|_| self.net.smooth(&mut column));
        self.net.node.iter().map(|v| column[*v as usize]).collect()
    }
}

/// The nearest points of the body.
fn nearest_points(body: &TriMesh, garment: &TriMesh) -> Vec<Closest> {
    let tree = Bvh::new(body);
    let closest = |p: &_| tree.closest(p, Real::INFINITY).expect("a body has triangles");
    garment.vertices().par_iter().with_min_len(256).map(closest).collect()
}

/// Whether a node keeps the weights of its nearest point: matches, and parts without any.
fn matched(body: &TriMesh, garment: &TriMesh, net: &Net, nearest: &[Closest]) -> Vec<bool> {
    let normals = body.vertex_normals();
    let matches = garment.vertex_normals().into_iter().zip(nearest).map(|(own, near)| {
        let corners = body.triangles()[near.triangle as usize];
        let normal: Vector =
            (0..3).map(|k| normals[corners[k] as usize] * near.barycentric[k]).sum();
        near.distance <= NEAR && own.dot(&unit_or_zero(&normal)) >= ALIKE
    });
    let mut fixed = vec![false; net.node.len()];
    for (v, matches) in net.node.iter().zip(matches) {
        fixed[*v as usize] |= matches;
    }
    let mut has = vec![false; fixed.len()];
    for (part, fixed) in net.parts.iter().zip(&fixed) {
        has[*part as usize] |= fixed;
    }
    fixed.iter().zip(&net.parts).map(|(fixed, part)| *fixed || !has[*part as usize]).collect()
}

/// The vertices of a garment, those at one place as one, with the weights of its edges.
#[derive(Debug)]
struct Net {
    /// The first vertex at the place of each.
    node: Vec<u32>,
    /// The neighbours of each node, and the inverse lengths of the edges to them.
    links: Rows<(u32, Real)>,
    /// The first node of the part that each belongs to.
    parts: Vec<u32>,
}

impl Net {
    fn new(garment: &TriMesh) -> Self {
        let points = garment.vertices();
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let key = |v: &u32| points[*v as usize].coords.data.0[0].map(|x| x + 0.0);
        let by_place = |a: &u32, b: &u32| {
            let [a, b] = [key(a), key(b)];
            (0..3)
                .map(|k| a[k].total_cmp(&b[k]))
                .find(|o| o.is_ne())
                .unwrap_or(std::cmp::Ordering::Equal)
        };
        order.sort_by(|a, b| by_place(a, b).then(a.cmp(b)));
        let mut node = vec![0; points.len()];
        for place in order.chunk_by(|a, b| by_place(a, b).is_eq()) {
            place.iter().for_each(|v| node[*v as usize] = place[0]);
        }
        let mut edges: Vec<[u32; 2]> = Edges::new(garment).vertices;
        edges.iter_mut().for_each(|e| *e = e.map(|v| node[v as usize]));
        edges.iter_mut().for_each(|e| e.sort_unstable());
        edges.retain(|[a, b]| a != b);
        edges.sort_unstable();
        edges.dedup();
        let length = |[a, b]: [u32; 2]| (points[a as usize] - points[b as usize]).norm();
        let weight = |e| 1.0 / length(e).max(SHORTEST);
        let both =
            edges.iter().flat_map(|e| [(e[0], (e[1], weight(*e))), (e[1], (e[0], weight(*e)))]);
        let links = Rows::new(points.len(), both);
        Self { links, parts: parts_by_edges(edges, points.len()), node }
    }

    /// Moves each number half of the way to the mean of its neighbours.
    fn smooth(&self, column: &mut Vec<Real>) {
        let mean = |v: usize| {
            let links = self.links.of(v);
            let (sum, whole) = links.iter().fold((0.0, 0.0), |(sum, whole), (n, w)| {
                (sum + w * column[*n as usize], whole + w)
            });
            if whole > 0.0 { 0.5 * (column[v] + sum / whole) } else { column[v] }
        };
        *column = (0..column.len()).into_par_iter().with_min_len(1024).map(mean).collect();
    }
}

/// Harmonic functions with given values at some nodes.
#[derive(Debug)]
struct Extension {
    /// Nodes without given values.
    free: Vec<u32>,
    /// The Laplacian of these.
    factor: Option<Cholesky>,
}

impl Extension {
    fn new(net: &Net, fixed: &[bool]) -> Result<Self, SkinError> {
        let is_free = |v: &u32| !fixed[*v as usize] && net.node[*v as usize] == *v;
        let free: Vec<u32> = (0..fixed.len() as u32).filter(is_free).collect();
        let mut row = vec![None; fixed.len()];
        free.iter().enumerate().for_each(|(i, v)| row[*v as usize] = Some(i));
        let mut entries = Vec::new();
        for (i, v) in free.iter().enumerate() {
            let links = net.links.of(*v as usize);
            entries.push(Entry::new(i, i, links.iter().map(|(_, w)| w).sum()));
            let below = links.iter().filter_map(|(n, w)| Some((row[*n as usize]?, w)));
            entries.extend(below.filter(|(j, _)| *j < i).map(|(j, w)| Entry::new(i, j, -w)));
        }
        let factor =
            if free.is_empty() { None } else { Some(Cholesky::new(free.len(), &entries)?) };
        Ok(Self { free, factor })
    }

    /// Replaces the numbers at free nodes.
    fn extend(&self, net: &Net, column: &mut [Real]) {
        let Some(factor) = &self.factor else { return };
        self.free.iter().for_each(|v| column[*v as usize] = 0.0);
        let mut x = Mat::from_fn(self.free.len(), 1, |i, _| {
            net.links.of(self.free[i] as usize).iter().map(|(n, w)| w * column[*n as usize]).sum()
        });
        factor.solve_in_place(&mut x);
        self.free.iter().enumerate().for_each(|(i, v)| column[*v as usize] = x[(i, 0)]);
    }
}

/// Keeps the four largest, in descending order; of equal ones the earlier.
fn insert(best: &mut [(Real, u16); 4], new: (Real, u16)) {
    if let Some(at) = best.iter().position(|(w, _)| new.0 > *w) {
        best[at..].rotate_right(1);
        best[at] = new;
    }
}

#[cfg(test)]
mod tests {
    use super::super::{WeightGrid, WeightGridParams};
    use super::*;
    use crate::mannequin::{self, Garment, MannequinParams, rig};
    use if_core::math::Point;

    fn scene() -> (TriMesh, SkinWeights, TriMesh, usize) {
        let params = MannequinParams { resolution: 0.7, overlap: 0.0 };
        let body = mannequin::body(&params);
        let skin = rig::skin_weights(body.vertices());
        (body, skin, mannequin::garment(Garment::Trousers, &params), rig::skeleton().len())
    }

    /// Mean and largest weight of the joints of one leg in the cloth of the other.
    fn mixed(garment: &TriMesh, skin: &SkinWeights) -> (Real, Real) {
        let names: Vec<String> = rig::skeleton().names().map(str::to_owned).collect();
        let legs = garment.vertices().iter().enumerate().filter(|(_, p)| p.y < 0.6 && p.x < 0.0);
        let left = legs.map(|(v, _)| {
            let slots = skin.joints()[v].iter().zip(&skin.weights()[v]);
            let left = slots.filter(|(j, _)| names[usize::from(**j)].starts_with("left"));
            left.map(|(_, w)| Real::from(*w)).sum::<Real>()
        });
        let left: Vec<Real> = left.collect();
        (left.iter().sum::<Real>() / left.len() as Real, left.iter().copied().fold(0.0, Real::max))
    }

    #[test]
    fn a_leg_has_no_weights_of_the_other_one() {
        let (body, skin, trousers, joints) = scene();
        let found = transferred_weights(&body, &skin, &trousers, joints).unwrap();
        let grid = WeightGrid::new(body.vertices(), &skin, joints, &WeightGridParams::default());
        let (of_grid, ours) =
            (mixed(&trousers, &grid.unwrap().skin(trousers.vertices())), mixed(&trousers, &found));
        assert!(ours.0 < 0.01 && ours.1 < 0.1 && of_grid.0 > 0.05, "{ours:?} {of_grid:?}");
        // Cloth near the skin has about its weights: those that the mannequin would give it.
        let own = rig::skin_weights(trousers.vertices());
        let mut differ = 0.0;
        for v in 0..trousers.vertices().len() {
            for j in 0..joints as u16 {
                let of = |skin: &SkinWeights| {
                    let slots = skin.joints()[v].iter().zip(&skin.weights()[v]);
                    slots.filter(|(k, _)| **k == j).map(|(_, w)| *w).sum::<f32>()
                };
                differ += Real::from((of(&found) - of(&own)).abs());
            }
        }
        differ /= trousers.vertices().len() as Real;
        assert!(differ < 0.15, "{differ}");
    }

    #[test]
    fn a_body_that_is_inside_out_gives_the_same_weights() {
        let (body, skin, trousers, joints) = scene();
        let turned = body.triangles().iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let turned = TriMesh::new(body.vertices().to_vec(), turned).unwrap();
        let [a, b] = [&body, &turned]
            .map(|body| transferred_weights(body, &skin, &trousers, joints).unwrap());
        let (a, b) = (mixed(&trousers, &a), mixed(&trousers, &b));
        assert!((a.0 - b.0).abs() < 1e-3 && (a.1 - b.1).abs() < 0.02, "{a:?} {b:?}");
    }

    #[test]
    fn far_cloth_has_weights_between_those_of_its_near_parts() {
        // A flat body of two joints, and a sheet that hangs over its edge, half a metre far.
        let grid = |n: usize, m: usize, at: &dyn Fn(Real, Real) -> Point| {
            let place =
                |k: usize| at((k % n) as Real / (n - 1) as Real, (k / n) as Real / (m - 1) as Real);
            let corner = |k: usize| (k / (n - 1) * n + k % (n - 1)) as u32;
            let cells = (0..(n - 1) * (m - 1)).map(corner);
            let n = n as u32;
            let triangles = cells.flat_map(|a| [[a, a + 1, a + n], [a + 1, a + n + 1, a + n]]);
            TriMesh::new((0..n as usize * m).map(place).collect(), triangles.collect()).unwrap()
        };
        let body = grid(11, 11, &|x, y| Point::new(x, y, 0.0));
        let left = |p: &Point| if p.x < 0.5 { 0 } else { 1 };
        let joints = body.vertices().iter().map(|p| [left(p), 0, 0, 0]).collect();
        let skin = SkinWeights::new(joints, vec![[1.0, 0.0, 0.0, 0.0]; 121], 2).unwrap();
        let sheet = grid(11, 21, &|x, y| Point::new(x, 1.5 * y, 0.01));
        let found = transferred_weights(&body, &skin, &sheet, 2).unwrap();
        let right = |v: usize| {
            let slots = found.joints()[v].iter().zip(&found.weights()[v]);
            slots.filter(|(j, _)| **j == 1).map(|(_, w)| Real::from(*w)).sum::<Real>()
        };
        // At the free end a step in the weights has become a slope, level across the ends.
        let end: Vec<Real> = (0..11).map(|x| right(20 * 11 + x)).collect();
        assert!(end.windows(2).all(|w| w[0] <= w[1]), "{end:?}");
        assert!(end[0] > 0.2 && end[10] > end[0] + 0.2 && end[10] < 0.9, "{end:?}");
        assert!(right(5 * 11) < 0.02 && right(5 * 11 + 10) > 0.98);
        // A part that is nowhere near has the weights of the nearest point; vertices at one place are one.
        let far = sheet
            .with_vertices(sheet.vertices().iter().map(|p| p + Vector::z()).collect())
            .unwrap();
        let found = transferred_weights(&body, &skin, &far, 2).unwrap();
        assert_eq!(found.joints()[0][0], 0);
        let halves = grid(11, 11, &|x, y| Point::new(x, y, 0.01));
        let twice: Vec<Point> =
            halves.vertices().iter().chain(halves.vertices()).copied().collect();
        let n = halves.vertices().len() as u32;
        let triangles = halves.triangles().iter().enumerate();
        let split =
            triangles.map(|(k, t)| if k % 2 == 0 { *t } else { t.map(|v| v + n) }).collect();
        let split =
            transferred_weights(&body, &skin, &TriMesh::new(twice, split).unwrap(), 2).unwrap();
        let whole = transferred_weights(&body, &skin, &halves, 2).unwrap();
        for v in 0..n as usize {
            assert_eq!(split.joints()[v], split.joints()[v + n as usize]);
            assert_eq!(split.weights()[v], split.weights()[v + n as usize]);
            let differ = split.weights()[v][0] - whole.weights()[v][0];
            assert!(differ.abs() < 0.35, "{v} {differ}");
        }
    }

    #[test]
    fn invalid_input_is_an_error() {
        let (body, skin, trousers, joints) = scene();
        let few = TriMesh::new(body.vertices().to_vec(), Vec::new()).unwrap();
        let new = |body: &TriMesh, joints| transferred_weights(body, &skin, &trousers, joints);
        assert!(matches!(new(&few, joints), Err(SkinError::Empty { .. })));
        assert!(matches!(new(&body, 0), Err(SkinError::Empty { joints: 0, .. })));
        assert!(matches!(new(&body, 2), Err(SkinError::Joint { .. })));
        assert!(matches!(new(&trousers, joints), Err(SkinError::Count { .. })));
    }
}
