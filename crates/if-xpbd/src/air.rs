//! The air constraint between two layers: lines 11 to 15 of Algorithm 1, in four readings.

use crate::constraint::{Constraint, Counters, Residual, Stage};
use crate::inner_surface::InnerSurface;
use if_core::math::{Point, Real, Vector, area_vector, unit_or_zero};
use if_core::number_or_infinite;
use if_core::parameter::ParameterError;
use serde::{Deserialize, Serialize};

/// How line 13, `p ← p − (p̂ − q̂)`, is read. With n the outward unit normal of the inner layer at
/// the foot q, and s₀ = n·(p̂ − q̂) the signed gap of the pair at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub enum AirReading {
    /// As printed, on all pairs, with p̂ on the moving layer: the constant −(p̂ − q̂) is added
    /// whenever n·(p − q̂) < 0. Outwards only for pairs that start penetrating.
    Literal,
    /// F1. Line 13 is the exact projection of `C = n·(p − q̂)` at p = p̂: a half-space frozen at
    /// the start, for the pairs that start penetrating.
    FrozenHalfSpace,
    /// F2. The gap is preserved: `C = n·(p − q) − g`, g = clamp(s₀, δ, δ_max), for all pairs.
    #[default]
    GapPreserving,
    /// F3. An air element [Müller et al. 2015]: the tetrahedron of the vertex p over the inner
    /// triangle (a, b, c) that holds its foot keeps the volume of a prism of height δ,
    ///
    /// ```text
    /// C = (p − a)·((b − a) × (c − a)) / 6 − A δ / 3 ≥ 0       ∇ₚC = ((b − a) × (c − a)) / 6
    /// ```
    ///
    /// The inner layer is at rest, so only p moves. The plane of a triangle extends beyond the
    /// triangle: this reading needs its feet searched again.
    Element,
}

/// Parameters of [`Air`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirParams {
    /// How line 13 is read.
    pub reading: AirReading,
    /// Vertices farther than this from the inner layer at the start, in metres, get no pair.
    #[serde(with = "number_or_infinite")]
    pub max_distance: Real,
    /// δ: the smallest gap, in metres.
    pub min_gap: Real,
    /// δ_max: the largest gap that is preserved, in metres.
    pub max_gap: Real,
    /// The foot of a vertex is searched again once it slid this far along the inner layer, in
    /// lengths of the shortest edge of the triangle that holds the foot; infinity never. F2 and F3
    /// only.
    #[serde(with = "number_or_infinite")]
    pub search_slide: Real,
}

impl Default for AirParams {
    /// Gap preserving, 1 to 5 mm, within 30 mm; feet are searched again after half an edge of
    /// sliding.
    fn default() -> Self {
        Self {
            reading: AirReading::default(),
            max_distance: 0.03,
            min_gap: 1e-3,
            max_gap: 5e-3,
            search_slide: 0.5,
        }
    }
}

/// Why the input of an air group is invalid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AirError {
    /// Positions and mask weights differ in number.
    #[error("{positions} positions but {masks} mask weights; give one weight for each vertex")]
    Count {
        /// Positions given.
        positions: usize,
        /// Mask weights given.
        masks: usize,
    },
    /// A parameter or a weight of the mask is out of range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
}

impl AirParams {
    /// Checks every number.
    ///
    /// # Errors
    ///
    /// The first that is NaN or outside its range.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let check = ParameterError::check;
        check("max_distance", self.max_distance, self.max_distance > 0.0, "positive (metres)")?;
        check(
            "min_gap",
            self.min_gap,
            self.min_gap >= 0.0 && self.min_gap.is_finite(),
            "finite and at least 0 (metres)",
        )?;
        let ordered = self.max_gap >= self.min_gap && self.max_gap.is_finite();
        check("max_gap", self.max_gap, ordered, "finite and at least min_gap (metres)")?;
        check("search_slide", self.search_slide, self.search_slide > 0.0, "positive (edge lengths)")
    }

    /// Whether feet follow their vertices, so that a border can be passed.
    fn follows(&self) -> bool {
        matches!(self.reading, AirReading::GapPreserving | AirReading::Element)
    }
}

/// Where a vertex has its foot, and the gap it keeps.
#[derive(Clone, Copy, Debug)]
struct Pair {
    vertex: u32,
    weight: Real,
    /// p̂ − q̂.
    vector: Vector,
    /// s₀.
    gap: Real,
    foot: Point,
    normal: Vector,
    triangle: u32,
    /// The vertex is beyond the border of the layer, where the plane of its last foot does not
    /// hold.
    beyond: bool,
}

/// The air constraints of a moving layer over a resting one.
///
/// # Source
///
/// Algorithm 1, lines 11 to 15: "p̂ and q̂ are the nearest points pair belonging to two adjacent
/// layers and computed at the beginning of the simulation". The main paper defines `C^air`, and we
/// do not have it: [`AirReading`] holds our readings.
#[derive(Clone, Debug)]
pub struct Air<'a> {
    inner: &'a InnerSurface<'a>,
    params: AirParams,
    pairs: Vec<Pair>,
    /// The vertices that were pushed in this substep, and along which unit vector.
    pushed: Vec<(u32, Vector)>,
    /// Whether positions have jumped, so that all feet must be searched again.
    jumped: bool,
    counters: Counters,
}

impl<'a> Air<'a> {
    /// Pairs each vertex of `positions` whose weight in `masks` is positive with its nearest point
    /// of `inner`. The first gaps are those of these positions: a run that is continued needs the same
    /// group.
    ///
    /// # Errors
    ///
    /// Parameters or weights out of range, or another number of weights than of positions.
    pub fn new(
        inner: &'a InnerSurface<'a>,
        positions: &[Point],
        masks: &[Real],
        params: AirParams,
    ) -> Result<Self, AirError> {
        params.validate()?;
        if masks.len() != positions.len() {
            return Err(AirError::Count { positions: positions.len(), masks: masks.len() });
        }
        for (vertex, &mask) in masks.iter().enumerate() {
            ParameterError::check("mask", mask, (0.0..=1.0).contains(&mask), "0 to 1")
                .map_err(|e| e.at(vertex))?;
        }
        let counters = Counters::default();
        let reaches = params.follows();
        let mut air =
            Self { inner, params, pairs: Vec::new(), pushed: Vec::new(), jumped: false, counters };
        for (v, (p, &weight)) in positions.iter().zip(masks).enumerate() {
            if weight <= 0.0 {
                air.counters.skipped_by_mask += 1;
                continue;
            }
            air.counters.queries += 1;
            let Some(at) = inner.closest(p, params.max_distance) else { continue };
            let normal = inner.normal(&at);
            if normal == Vector::zeros() {
                air.counters.degenerate += 1;
                continue;
            }
            let vector = p - at.point;
            air.pairs.push(Pair {
                vertex: v as u32,
                weight,
                vector,
                gap: normal.dot(&vector),
                foot: at.point,
                normal,
                triangle: at.triangle,
                beyond: reaches && inner.is_beyond_border(&at, p),
            });
        }
        Ok(air)
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    fn update_feet(&mut self, positions: &[Point]) {
        if !self.params.follows() {
            return;
        }
        let all = std::mem::take(&mut self.jumped);
        for pair in &mut self.pairs {
            let p = positions[pair.vertex as usize];
            let d = p - pair.foot;
            let slide2 = (d - pair.normal * pair.normal.dot(&d)).norm_squared();
            if !all && !pair.beyond {
                let [a, b, c] = self.inner.mesh().corners(pair.triangle as usize);
                let edge2 =
                    (b - a).norm_squared().min((c - b).norm_squared()).min((a - c).norm_squared());
                if slide2 <= self.params.search_slide * self.params.search_slide * edge2 {
                    self.counters.skipped_by_bound += 1;
                    continue;
                }
            }
            self.counters.queries += 1;
            let Some(at) = self.inner.closest(&p, self.params.max_distance) else {
                // Straight below its foot it is deep inside, and the plane brings it out.
                pair.beyond = slide2 > self.params.max_distance * self.params.max_distance;
                continue;
            };
            let normal = self.inner.normal(&at);
            if normal == Vector::zeros() {
                self.counters.degenerate += 1;
                pair.beyond = true;
                continue;
            }
            (pair.foot, pair.normal, pair.triangle) = (at.point, normal, at.triangle);
            pair.beyond = self.inner.is_beyond_border(&at, &p);
        }
    }

    /// The violation (≥ 0, metres) and the push of a vertex at `p`.
    fn push(&self, pair: &Pair, p: &Point) -> Option<(Real, Vector)> {
        if pair.beyond {
            return None;
        }
        let height = pair.normal.dot(&(p - pair.foot));
        let half_space = |gap: Real| (gap - height, pair.normal * (gap - height));
        Some(match self.params.reading {
            AirReading::Literal => (-height, -pair.vector),
            AirReading::FrozenHalfSpace => {
                if pair.gap >= 0.0 {
                    return None;
                }
                half_space(0.0)
            }
            AirReading::GapPreserving => {
                half_space(pair.gap.clamp(self.params.min_gap, self.params.max_gap))
            }
            AirReading::Element => {
                let [a, b, c] = self.inner.mesh().corners(pair.triangle as usize);
                let area = area_vector(a, b, c);
                let size = area.norm();
                if size <= 0.0 {
                    return None;
                }
                // −C ∇C / |∇C|² with volumes over sixths: the factors cancel.
                let lacks = self.params.min_gap - area.dot(&(p - a)) / size;
                (lacks, area * (lacks / size))
            }
        })
    }
}

impl Constraint for Air<'_> {
    fn begin_substep(
        &mut self,
        _previous: &[Point],
        positions: &[Point],
        _inverse_masses: &[Real],
        _h: Real,
    ) {
        self.pushed.clear();
        self.update_feet(positions);
    }

    /// # Panics
    ///
    /// If there are fewer positions than there were when the pairs were made.
    fn project(&mut self, positions: &mut [Point], inverse_masses: &[Real], _h: Real) -> Residual {
        let mut residual = Residual { count: self.len(), ..Residual::default() };
        for k in 0..self.pairs.len() {
            let pair = &self.pairs[k];
            let v = pair.vertex as usize;
            let Some((violation, push)) = self.push(pair, &positions[v]) else { continue };
            if violation <= 0.0 {
                continue;
            }
            residual.active += 1;
            residual.max = residual.max.max(violation);
            residual.sum_squares += violation * violation;
            if inverse_masses[v] > 0.0 {
                positions[v] += push * pair.weight;
                self.pushed.push((pair.vertex, unit_or_zero(&push)));
            }
        }
        residual
    }

    fn stage(&self) -> Stage {
        Stage::Contact
    }

    fn correct_velocities(&self, velocities: &mut [Vector]) {
        for (vertex, direction) in &self.pushed {
            let velocity = &mut velocities[*vertex as usize];
            let outwards = velocity.dot(direction);
            if outwards > 0.0 {
                *velocity -= direction * outwards;
            }
        }
    }

    fn reset(&mut self) {
        self.pushed.clear();
        self.jumped = true;
    }

    fn is_idle(&self) -> bool {
        self.is_empty()
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inner_surface::tests::All;
    use approx::assert_relative_eq;
    use if_core::shapes::meshes::cloth;

    /// A flat inner layer in z = 0, outwards +z.
    fn floor() -> All {
        All(cloth(0.2, 0.2, 4, 4))
    }

    fn visited(reading: AirReading, start: Point, to: Point) -> Point {
        let all = floor();
        let inner = InnerSurface::new(&all.0, &all);
        let params = AirParams { reading, ..Default::default() };
        let mut air = Air::new(&inner, &[start], &[1.0], params).unwrap();
        let mut p = vec![to];
        air.begin_substep(&p.clone(), &p.clone(), &[1.0], 1e-3);
        air.project(&mut p, &[1.0], 1e-3);
        p[0]
    }

    #[test]
    fn line_13_pushes_deeper_what_started_apart() {
        // The push is along −(p̂ − q̂). With p̂ on the moving layer, as the group has it, that is
        // outwards where the pair started inside, and inwards where it started apart; with the
        // names swapped it is the other way round. So a pair that started apart and is inside now
        // is pushed deeper by the printed form, which says so with a negative height.
        let at = |z: Real| Point::new(0.11, 0.12, z);
        assert_relative_eq!(
            visited(AirReading::Literal, at(-0.004), at(-0.004)).z,
            0.0,
            epsilon = 1e-17
        );
        assert_relative_eq!(
            visited(AirReading::Literal, at(0.004), at(-0.001)).z,
            -0.005,
            epsilon = 1e-17
        );
    }

    #[test]
    fn each_reading_keeps_its_gap() {
        let at = |z: Real| Point::new(0.11, 0.12, z);
        // Reading, height at the start, height now, height after a visit.
        for (reading, start, now, after) in [
            (AirReading::FrozenHalfSpace, -0.004, -0.002, 0.0),
            (AirReading::FrozenHalfSpace, -0.004, 0.002, 0.002),
            (AirReading::FrozenHalfSpace, 0.004, -0.002, -0.002),
            (AirReading::GapPreserving, 0.003, 0.001, 0.003),
            (AirReading::GapPreserving, 0.020, 0.001, 0.005),
            (AirReading::GapPreserving, -0.004, -0.004, 0.001),
            (AirReading::Element, 0.020, 0.0005, 0.001),
            (AirReading::Element, -0.004, -0.004, 0.001),
            (AirReading::Element, 0.004, 0.002, 0.002),
        ] {
            let p = visited(reading, at(start), at(now));
            assert_relative_eq!(p, at(after), epsilon = 1e-15);
        }
    }

    #[test]
    fn a_push_is_weighted_by_the_mask() {
        let all = floor();
        let inner = InnerSurface::new(&all.0, &all);
        let start = vec![Point::new(0.11, 0.12, -0.004); 2];
        let mut air = Air::new(&inner, &start, &[0.25, 1.0], AirParams::default()).unwrap();
        let mut p = start.clone();
        air.begin_substep(&p.clone(), &p.clone(), &[1.0; 2], 1e-3);
        air.project(&mut p, &[1.0; 2], 1e-3);
        // To the least gap of 1 mm are 5 mm: a quarter of the way, and all of it.
        let heights = [0, 1].map(|v: usize| p[v].z);
        assert_relative_eq!(heights[0], -0.004 + 0.25 * 0.005, epsilon = 1e-15);
        assert_relative_eq!(heights[1], 0.001, epsilon = 1e-15);
    }

    #[test]
    fn the_foot_of_a_vertex_that_slides_is_searched_again() {
        // A floor that bends down at x = 0.1: its old plane would hold the vertex up.
        let flat = cloth(0.2, 0.2, 4, 4);
        let bent =
            flat.vertices().iter().map(|p| Point::new(p.x, p.y, -(p.x - 0.1).max(0.0))).collect();
        let all = All(flat.with_vertices(bent).unwrap());
        let inner = InnerSurface::new(&all.0, &all);
        for reading in [AirReading::GapPreserving, AirReading::Element] {
            for (slide, expected) in [(0.5, true), (Real::INFINITY, false)] {
                let params = AirParams { reading, search_slide: slide, ..Default::default() };
                let mut air =
                    Air::new(&inner, &[Point::new(0.03, 0.1, 0.001)], &[1.0], params).unwrap();
                let slid = Point::new(0.16, 0.1, -0.04);
                let mut p = vec![slid];
                air.begin_substep(&p.clone(), &p.clone(), &[1.0], 1e-3);
                air.project(&mut p, &[1.0], 1e-3);
                assert_eq!(p[0] == slid, expected, "{reading:?} {slide}: {}", p[0]);
                // A jump (teleport, roll-back) discards the foot in any case.
                air.reset();
                p[0] = slid;
                air.begin_substep(&p.clone(), &p.clone(), &[1.0], 1e-3);
                air.project(&mut p, &[1.0], 1e-3);
                assert_eq!(p[0], slid, "{reading:?} {slide} after a jump");
            }
        }
    }

    #[test]
    fn a_vertex_beyond_the_layers_border_is_not_held_and_one_deep_below_the_layer_is() {
        let all = floor();
        let inner = InnerSurface::new(&all.0, &all);
        let at = |x: Real, z: Real| Point::new(x, 0.1, z);
        for reading in [AirReading::GapPreserving, AirReading::Element] {
            let params = AirParams { reading, ..Default::default() };
            // Also one that starts there, and has not slid.
            let beyond = at(0.21, -0.005);
            let mut air = Air::new(&inner, &[beyond], &[1.0], params).unwrap();
            let mut p = vec![beyond];
            air.begin_substep(&[beyond], &[beyond], &[1.0], 1e-3);
            air.project(&mut p, &[1.0], 1e-3);
            assert_eq!(p, [beyond], "{reading:?}");
            let start = at(0.1, 0.001);
            let mut air = Air::new(&inner, &[start], &[1.0], params).unwrap();
            // The floor ends at x = 0.2. Far beyond, back again, 40 mm deep, just beyond, and on the
            // border: x, z and z after a visit.
            for (x, z, after) in [
                (0.4, -0.01, -0.01),
                (0.1, -0.01, 0.001),
                (0.11, -0.04, 0.001),
                (0.21, -0.005, -0.005),
                (0.2, -0.005, 0.001),
            ] {
                let mut p = vec![at(x, z)];
                air.begin_substep(&[start], &p.clone(), &[1.0], 1e-3);
                air.project(&mut p, &[1.0], 1e-3);
                assert_relative_eq!(p[0], at(x, after), epsilon = 1e-15);
            }
        }
    }

    #[test]
    fn a_push_leaves_no_speed_and_the_slide_beside_it_stays() {
        let all = floor();
        let inner = InnerSurface::new(&all.0, &all);
        let at = |z: Real| Point::new(0.11, 0.12, z);
        for (reading, start) in [
            (AirReading::FrozenHalfSpace, -0.004),
            (AirReading::GapPreserving, 0.004),
            (AirReading::Element, 0.004),
        ] {
            let mut air = Air::new(
                &inner,
                &[at(start), at(0.01)],
                &[1.0, 1.0],
                AirParams { reading, ..Default::default() },
            )
            .unwrap();
            let mut p = vec![at(-0.004), at(0.01)];
            air.begin_substep(&p.clone(), &p.clone(), &[1.0; 2], 1e-3);
            air.project(&mut p, &[1.0; 2], 1e-3);
            let mut v = vec![Vector::new(1.0, 2.0, 5.0); 2];
            air.correct_velocities(&mut v);
            assert_relative_eq!(v[0], Vector::new(1.0, 2.0, 0.0), epsilon = 1e-12);
            // The second keeps its gap, and its speed.
            assert_eq!(v[1].z, 5.0, "{reading:?}");
            // Inwards it may move on.
            v[0].z = -3.0;
            air.correct_velocities(&mut v);
            assert_relative_eq!(v[0].z, -3.0, epsilon = 1e-12);
            air.begin_substep(&p.clone(), &p.clone(), &[1.0; 2], 1e-3);
            v[0].z = 5.0;
            air.correct_velocities(&mut v);
            assert_eq!(v[0].z, 5.0, "a push of the substep before has no effect");
        }
    }

    #[test]
    fn only_vertices_in_the_mask_and_near_have_pairs() {
        let all = floor();
        let inner = InnerSurface::new(&all.0, &all);
        let p =
            [Point::new(0.1, 0.1, 0.01), Point::new(0.1, 0.1, 0.04), Point::new(0.1, 0.1, -0.01)];
        let air = Air::new(&inner, &p, &[1.0, 1.0, 0.0], AirParams::default()).unwrap();
        assert_eq!((air.len(), air.counters().skipped_by_mask), (1, 1));
        assert!(Air::new(&inner, &[], &[], AirParams::default()).unwrap().is_idle());
        let error = |masks: &[Real]| Air::new(&inner, &p, masks, AirParams::default()).unwrap_err();
        assert_eq!(error(&[1.0, 1.0]), AirError::Count { positions: 3, masks: 2 });
        for bad in [-0.1, 1.1, Real::NAN, Real::INFINITY] {
            let error = error(&[1.0, bad, 1.0]);
            assert!(matches!(error, AirError::Parameter(e) if e.name == "mask[1]"), "{bad}");
        }
        for bad in [
            AirParams { max_distance: Real::NAN, ..Default::default() },
            AirParams { min_gap: 0.01, ..Default::default() },
            AirParams { min_gap: -1.0, ..Default::default() },
            AirParams { search_slide: 0.0, ..Default::default() },
        ] {
            assert!(bad.validate().is_err());
        }
    }
}
