//! Samples of a source at the nodes of a level, each evaluated once.

use super::blend::{BRICK, NODES, SIDE, local};
use super::bricks::Bricks;
use super::error::BakeError;
use if_core::field::{FieldSample, SignedDistance};
use if_core::math::{Point, Real, Vector};
use if_core::monitor::{Monitor, Progress};
use rayon::prelude::*;

/// Bits of a coordinate in a key.
const BITS: u32 = 21;
/// Coordinates stay below this, so that keys can be doubled.
pub(super) const MAX_COORDINATE: usize = 1 << (BITS - 1);
/// Points of one call of the source.
const BATCH: usize = 1 << 15;

/// The coordinates of a node of a level as one number.
pub(super) fn key(node: [u32; 3]) -> u64 {
    u64::from(node[0]) | u64::from(node[1]) << BITS | u64::from(node[2]) << (2 * BITS)
}

fn node(key: u64) -> [u32; 3] {
    const MASK: u64 = (1 << BITS) - 1;
    [0, 1, 2].map(|k| (key >> (k * BITS) & MASK) as u32)
}

/// Samples in ascending order of their keys.
#[derive(Default)]
pub(super) struct Samples {
    keys: Vec<u64>,
    pub(super) samples: Vec<FieldSample>,
}

impl Samples {
    /// Samples at the nodes `keys` of a level. Those in `known` are not evaluated again.
    ///
    /// # Errors
    ///
    /// A value or slope that is not finite, or cancelled.
    pub(super) fn evaluate(
        source: &dyn SignedDistance,
        bricks: &Bricks,
        level: u32,
        mut keys: Vec<u64>,
        known: &Samples,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        keys.par_sort_unstable();
        keys.dedup();
        let nothing = FieldSample { distance: 0.0, gradient: Vector::zeros() };
        let found: Vec<Option<usize>> = keys.par_iter().map(|k| known.find(*k)).collect();
        let missing: Vec<usize> = (0..keys.len()).filter(|i| found[*i].is_none()).collect();
        let mut samples: Vec<FieldSample> =
            found.iter().map(|f| f.map_or(nothing, |f| known.samples[f])).collect();
        let mut batch = vec![nothing; BATCH.min(missing.len())];
        let mut done = 0;
        for some in missing.chunks(BATCH) {
            let points: Vec<Point> =
                some.iter().map(|i| bricks.at(level, node(keys[*i]))).collect();
            let batch = &mut batch[..points.len()];
            source.samples(&points, batch);
            done += points.len();
            let total = Some(missing.len());
            monitor.report(&Progress { done, total, ..Progress::stage("sample") })?;
            for ((i, sample), point) in some.iter().zip(batch.iter()).zip(&points) {
                // Nodes are stored in single precision.
                let finite = |x: Real| (x as f32).is_finite();
                if !(finite(sample.distance)
                    && sample.gradient.iter().all(|g| finite(*g) && finite(g * bricks.cell)))
                {
                    return Err(BakeError::NotFinite { point: *point, sample: *sample });
                }
                samples[*i] = *sample;
            }
        }
        Ok(Self { keys, samples })
    }

    /// Samples at all nodes of a grid of level 0.
    pub(super) fn of_all(
        source: &dyn SignedDistance,
        bricks: &Bricks,
        monitor: &mut dyn Monitor,
    ) -> Result<Self, BakeError> {
        let all: Vec<u32> = (0..bricks.places.len() as u32).collect();
        Self::evaluate(source, bricks, 0, node_keys(bricks, &all), &Self::default(), monitor)
    }

    fn find(&self, key: u64) -> Option<usize> {
        self.keys.binary_search(&key).ok()
    }

    pub(super) fn get(&self, key: u64) -> Option<&FieldSample> {
        self.find(key).map(|i| &self.samples[i])
    }

    /// The nodes of one level and the middles of its cells, whose keys are those of the next level,
    /// as nodes of that.
    pub(super) fn doubled(&self, middles: &Samples) -> Self {
        let nodes = self.keys.iter().map(|k| k << 1).zip(&self.samples);
        let mut all: Vec<(u64, FieldSample)> = nodes
            .chain(middles.keys.iter().copied().zip(&middles.samples))
            .map(|(k, s)| (k, *s))
            .collect();
        all.par_sort_unstable_by_key(|(k, _)| *k);
        let (keys, samples) = all.into_iter().unzip();
        Self { keys, samples }
    }
}

/// Keys of all nodes of some bricks.
pub(super) fn node_keys(bricks: &Bricks, some: &[u32]) -> Vec<u64> {
    some.par_iter()
        .flat_map_iter(|b| (0..BRICK).map(|i| key(bricks.node(*b as usize, i))))
        .collect()
}

/// Values and bumps of some bricks, from samples at all of their nodes.
pub(super) fn fill(bricks: &mut Bricks, some: &[u32], samples: &Samples) {
    let nodes: Vec<[[f32; 4]; BRICK]> = some
        .par_iter()
        .map(|b| {
            let brick = *b as usize;
            let half = 0.5 * bricks.cell_of(bricks.places[brick].level);
            let at = |i: usize| {
                *samples.get(key(bricks.node(brick, i))).expect("all nodes were sampled")
            };
            let all: [FieldSample; BRICK] = std::array::from_fn(at);
            std::array::from_fn(|i| {
                let l = local(i);
                let bump = |k: usize, stride: usize| match l[k] {
                    SIDE => 0.0,
                    _ => (half * (all[i].gradient[k] - all[i + stride].gradient[k])) as f32,
                };
                [all[i].distance as f32, bump(0, 1), bump(1, NODES), bump(2, NODES * NODES)]
            })
        })
        .collect();
    for (brick, nodes) in some.iter().zip(nodes) {
        bricks.nodes[*brick as usize * BRICK..(*brick as usize + 1) * BRICK]
            .copy_from_slice(&nodes);
    }
}
