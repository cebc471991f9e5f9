//! Halves cells where the blend is not accurate enough.

use super::accuracy::{self, SAFETY};
use super::blend::{BRICK, SIDE, blend, cells};
use super::bricks::Bricks;
use super::directory::{Place, SPLIT};
use super::error::BakeError;
use super::join::join;
use super::params::BakeParams;
use super::samples::{MAX_COORDINATE, Samples, fill, key, node_keys};
use if_core::aabb::Aabb;
use if_core::field::SignedDistance;
use if_core::math::{Point, Real, Vector};
use if_core::monitor::Monitor;
use if_core::random::SplitMix64;
use rayon::prelude::*;

/// Random points in a cell with so much curvature that its middle is not enough.
const EXTRA: usize = 4;
/// Cells with an error above this share of the accuracy are halved: a margin below 1 / [`SAFETY`]
/// for errors that no point has found.
const AIM: Real = 0.5;
/// Maximum rounds of halving where the last measurement finds errors: two or three are usual.
const ROUNDS: u64 = 6;

/// Halves cells of the filled grid `bricks` of level 0 until the blend is accurate enough in `core`,
/// and joins them. `known` are the samples at its nodes.
///
/// ```text
/// level by level: compare with the source in the middle of each cell near the surface, and at random places of those that bend most;
///                 halve the cells of each brick that has an error above half of the accuracy
/// join; measure at other random places; halve there too, and again
/// ```
///
/// Returns the errors of the result.
///
/// # Errors
///
/// A source that is not finite somewhere, or cancelled.
pub(super) fn refine(
    bricks: &mut Bricks,
    source: &dyn SignedDistance,
    (params, core): (&BakeParams, &Aabb),
    known: Samples,
    monitor: &mut dyn Monitor,
) -> Result<accuracy::Errors, BakeError> {
    let all: Vec<u32> = (0..bricks.places.len() as u32).collect();
    let longest = bricks.size[0].max(bricks.size[1]).max(bricks.size[2]) * SIDE;
    let levels =
        (0..params.levels).take_while(|l| longest << l < MAX_COORDINATE / 2).count() as u32;
    let mut work = Refinement {
        bricks,
        source,
        params,
        core,
        levels,
        frontiers: vec![Vec::new(); levels as usize + 1],
        monitor,
    };
    work.frontiers[0] = all;
    work.run(known)?;
    let mut round = 0;
    loop {
        let mut joined = work.bricks.clone();
        join(&mut joined);
        let mut errors = accuracy::Errors { reach: params.reach, ..Default::default() };
        let offenders = accuracy::measure(
            &mut errors,
            &joined,
            source,
            (params, core),
            (true, round, AIM * params.accuracy),
            work.monitor,
        )?;
        let offenders: Vec<u32> = offenders.into_iter().filter(|b| work.can_split(*b)).collect();
        let reached = errors.within(params.reach) <= params.accuracy / SAFETY;
        if reached || round == ROUNDS || offenders.is_empty() || !work.fits(offenders.len()) {
            accuracy::measure(
                &mut errors,
                &joined,
                source,
                (params, core),
                (false, round, Real::INFINITY),
                work.monitor,
            )?;
            *bricks = joined;
            return Ok(errors);
        }
        for brick in offenders {
            let level = work.bricks.places[brick as usize].level as usize;
            let halves = work.split(brick);
            work.frontiers[level + 1].extend(halves);
        }
        for level in 1..=levels {
            let frontier = std::mem::take(&mut work.frontiers[level as usize]);
            work.sample(level, &frontier, &Samples::default())?;
            work.frontiers[level as usize] = frontier;
        }
        work.run(Samples::default())?;
        round += 1;
    }
}

struct Refinement<'a> {
    bricks: &'a mut Bricks,
    source: &'a dyn SignedDistance,
    params: &'a BakeParams,
    /// Where errors count.
    core: &'a Aabb,
    levels: u32,
    /// By level, bricks that were not yet checked.
    frontiers: Vec<Vec<u32>>,
    monitor: &'a mut dyn Monitor,
}

impl Refinement<'_> {
    /// Checks all frontiers. `known` are samples at nodes of level 0.
    fn run(&mut self, mut known: Samples) -> Result<(), BakeError> {
        for level in 0..self.levels {
            let frontier = std::mem::take(&mut self.frontiers[level as usize]);
            let (marked, middles) = self.inaccurate(level, &frontier)?;
            if marked.is_empty() || !self.fits(marked.len()) {
                known = Samples::default();
                continue;
            }
            let halves: Vec<u32> = marked.into_iter().flat_map(|brick| self.split(brick)).collect();
            known = known.doubled(&middles);
            known = self.sample(level + 1, &halves, &known)?;
            self.frontiers[level as usize + 1].extend(halves);
        }
        self.frontiers[self.levels as usize].clear();
        Ok(())
    }

    fn sample(&mut self, level: u32, some: &[u32], known: &Samples) -> Result<Samples, BakeError> {
        let samples = Samples::evaluate(
            self.source,
            self.bricks,
            level,
            node_keys(self.bricks, some),
            known,
            self.monitor,
        )?;
        fill(self.bricks, some, &samples);
        Ok(samples)
    }

    fn can_split(&self, brick: u32) -> bool {
        self.bricks.places[brick as usize].level < self.levels
    }

    /// Whether memory allows to split `more` bricks. Baking holds the grid twice, and samples.
    fn fits(&self, more: usize) -> bool {
        let bytes = self.bricks.bytes() + more * 8 * (BRICK * 16 + 16);
        3 * bytes <= self.params.memory
    }

    /// Replaces a brick by eight; their nodes are not yet filled.
    fn split(&mut self, brick: u32) -> [u32; 8] {
        let place = self.bricks.places[brick as usize];
        let Place { level, at } = place;
        let first = self.bricks.places.len() as u32;
        let halves = std::array::from_fn(|k| first + k as u32);
        for k in 0..8usize {
            self.bricks.places.push(place.half(k));
        }
        self.bricks.nodes.resize(self.bricks.places.len() * BRICK, [0.0; 4]);
        let number = self.bricks.splits.len() as u32;
        self.bricks.splits.push(halves);
        // The entry that leads to the brick.
        let root = self.bricks.root_index(at.map(|b| (b >> level) as usize));
        let mut entry = self.bricks.roots[root];
        if level == 0 {
            self.bricks.roots[root] = SPLIT + number;
            return halves;
        }
        for up in (0..level).rev() {
            let half = (0..3).fold(0, |h, k| h | ((at[k] >> up & 1) as usize) << k);
            let next = &mut self.bricks.splits[(entry - SPLIT) as usize][half];
            if up == 0 {
                debug_assert!(*next == brick);
                *next = SPLIT + number;
            }
            entry = *next;
        }
        halves
    }

    /// The bricks of `frontier` with an error above the tolerance; and the samples in the middles
    /// of their cells, with keys of the next level.
    fn inaccurate(
        &mut self,
        level: u32,
        frontier: &[u32],
    ) -> Result<(Vec<u32>, Samples), BakeError> {
        let (bricks, params, core) = (&*self.bricks, self.params, self.core);
        let tolerance = AIM * params.accuracy;
        if frontier.is_empty() || tolerance == Real::INFINITY {
            return Ok((Vec::new(), Samples::default()));
        }
        let cell = bricks.cell_of(level);
        let near: Vec<(u32, usize)> = frontier
            .par_iter()
            .flat_map_iter(|b| cells().map(move |c| (*b, c)))
            .filter(|(b, c)| {
                accuracy::matters(&bricks.nodes, *b as usize * BRICK + c, cell, params)
                    && core.contains(&bricks.at(level, bricks.node(*b as usize, *c)))
            })
            .collect();
        let middle =
            |brick: u32, index: usize| key(bricks.node(brick as usize, index).map(|n| 2 * n + 1));
        let keys = near.par_iter().map(|(b, c)| middle(*b, *c)).collect();
        let middles = Samples::evaluate(
            self.source,
            bricks,
            level + 1,
            keys,
            &Samples::default(),
            self.monitor,
        )?;
        let is_off = |value: Real, truth: Real| {
            (value - truth).abs() > tolerance && accuracy::counts(truth, 0.5 * cell, params)
        };
        let mut bad: Vec<u32> = near
            .par_iter()
            .filter(|(b, c)| {
                let value = blend(&bricks.nodes, *b as usize * BRICK + c, [0.5; 3], 1.0).0;
                middles.get(middle(*b, *c)).is_some_and(|s| is_off(value, s.distance))
            })
            .map(|(b, _)| *b)
            .collect();
        bad.dedup();
        // Bricks that passed get more points in the cells with the largest curvature.
        let bending: Vec<(u32, usize)> = near
            .into_iter()
            .filter(|(b, c)| {
                bad.binary_search(b).is_err()
                    && accuracy::bend(&bricks.nodes, *b as usize * BRICK + c) > tolerance
            })
            .collect();
        let places: Vec<(u32, usize, Vector)> = bending
            .iter()
            .flat_map(|(b, c)| {
                let mut random = SplitMix64::new(middle(*b, *c));
                (0..EXTRA).map(move |_| {
                    (*b, *c, Vector::new(random.unit(), random.unit(), random.unit()))
                })
            })
            .collect();
        let points: Vec<Point> = places
            .iter()
            .map(|(b, c, u)| bricks.at(level, bricks.node(*b as usize, *c)) + u * cell)
            .collect();
        let mut truth = vec![0.0; points.len()];
        self.source.distances(&points, &mut truth);
        for ((b, c, u), truth) in places.iter().zip(truth) {
            let value = blend(&bricks.nodes, *b as usize * BRICK + c, (*u).into(), 1.0).0;
            if is_off(value, truth) {
                bad.push(*b);
            }
        }
        bad.sort_unstable();
        bad.dedup();
        Ok((bad, middles))
    }
}
