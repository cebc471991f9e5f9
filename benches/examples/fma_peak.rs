//! The machine's peak of fused multiply-adds in f32: what the kernels' speed is measured against.
//!
//! `cargo run --release -p if-benches --example fma_peak [threads]`

use std::hint::black_box;
use std::time::Instant;

use pulp::{Simd, WithSimd};

/// Chains of multiply-adds that wait for nobody but themselves: 24 of them hide the latency.
struct Chains {
    rounds: usize,
    seed: f32,
}

impl WithSimd for Chains {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let mut sums = [simd.splat_f32s(self.seed); 24];
        let factor = simd.splat_f32s(1.0 - self.seed * 1e-7);
        let summand = simd.splat_f32s(self.seed * 1e-3);
        for _ in 0..self.rounds {
            for sum in &mut sums {
                *sum = simd.mul_add_f32s(*sum, factor, summand);
            }
        }
        let mut total = 0.0;
        for sum in sums {
            total += simd.reduce_sum_f32s(sum);
        }
        total
    }
}

struct Lanes;

impl WithSimd for Lanes {
    type Output = usize;

    fn with_simd<S: Simd>(self, _simd: S) -> usize {
        S::F32_LANES
    }
}

/// GFLOP/s of one thread: the best of twenty runs, short enough for one to go undisturbed.
fn peak() -> f64 {
    let arch = pulp::Arch::new();
    let lanes = arch.dispatch(Lanes);
    let rounds = 100_000;
    (0..20)
        .map(|k| {
            let start = Instant::now();
            black_box(arch.dispatch(Chains { rounds, seed: black_box(1.0 + k as f32) }));
            (rounds * 24 * lanes * 2) as f64 / start.elapsed().as_secs_f64() / 1e9
        })
        .fold(0.0, f64::max)
}

#[allow(clippy::print_stdout)]
fn main() {
    let threads =
        std::env::args().nth(1).and_then(|count| count.parse().ok()).unwrap_or(1_usize).max(1);
    let workers: Vec<_> = (0..threads).map(|_| std::thread::spawn(peak)).collect();
    let peaks: Vec<f64> = workers.into_iter().filter_map(|worker| worker.join().ok()).collect();
    println!("f32 multiply-add peak, GFLOP/s per thread: {peaks:.1?}");
}
