//! Numbered random cases: seeds, panics caught, outcomes counted, failures told by number.

use if_core::math::{Point, Real, Vector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;

/// Most failures that are told.
const TOLD: usize = 8;

/// What the cases of a property ended in, and how often: `"ok"`, or the kind of a typed error.
pub type Tally = BTreeMap<&'static str, u32>;

/// `STABILITY_SEED`, by which all cases are drawn anew; 0 where it is not set.
fn seed() -> u64 {
    static SEED: OnceLock<u64> = OnceLock::new();
    *SEED.get_or_init(|| match std::env::var("STABILITY_SEED") {
        Ok(text) => text.parse().expect("STABILITY_SEED is a number"),
        Err(_) => 0,
    })
}

/// Random numbers of one case: the same for the same property, number and seed.
pub struct Random(Pcg64Mcg);

impl Random {
    pub fn new(name: &str, number: u32) -> Self {
        // FNV-1a, so that properties do not see the same numbers.
        let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325, |h: u64, b| {
            (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3)
        });
        let draw = u64::from(number).wrapping_mul(0x9e37_79b9_7f4a_7c15)
            ^ seed().wrapping_mul(0xd134_2543_de82_ef95);
        Self(Pcg64Mcg::seed_from_u64(hash ^ draw))
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> Real {
        self.0.random()
    }

    pub fn between(&mut self, low: Real, high: Real) -> Real {
        low + (high - low) * self.unit()
    }

    /// Ten to the power of a number between `low` and `high`.
    pub fn power(&mut self, low: Real, high: Real) -> Real {
        (10.0 as Real).powf(self.between(low, high))
    }

    /// 0 to n − 1.
    pub fn below(&mut self, n: usize) -> usize {
        self.0.random_range(0..n)
    }

    /// Puts `items` into another order.
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        (1..items.len()).rev().for_each(|k| items.swap(k, self.below(k + 1)));
    }

    pub fn chance(&mut self, p: Real) -> bool {
        self.unit() < p
    }

    pub fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())]
    }

    /// Each coordinate in [−size, size).
    pub fn vector(&mut self, size: Real) -> Vector {
        Vector::new(self.between(-size, size), self.between(-size, size), self.between(-size, size))
    }

    /// A vector of `size` times one of `factors`.
    pub fn offset(&mut self, size: Real, factors: &[Real]) -> Vector {
        let factor = self.pick(factors);
        self.vector(size * factor)
    }

    pub fn point(&mut self, size: Real) -> Point {
        Point::from(self.vector(size))
    }

    pub fn rotation(&mut self) -> nalgebra::Rotation3<Real> {
        nalgebra::Rotation3::from_euler_angles(
            self.between(-3.0, 3.0),
            self.between(-1.5, 1.5),
            self.between(-3.0, 3.0),
        )
    }
}

/// Runs `count` cases and counts what they ended in.
///
/// # Panics
///
/// If one of them panicked or broke a promise (`Err`), with its number and what it said.
pub fn cases(
    name: &str,
    count: u32,
    case: impl Fn(&mut Random) -> Result<&'static str, String> + Sync,
) -> Tally {
    let only = std::env::var("STABILITY_CASE").ok();
    let only = only.as_deref().and_then(|s| s.split_once('/')).filter(|(n, _)| *n == name);
    let numbers = match only.and_then(|(_, k)| k.parse().ok()) {
        Some(k) => k..k + 1,
        None => 0..count,
    };
    let ended: Vec<Result<&'static str, String>> = numbers
        .clone()
        .into_par_iter()
        .map(|k| {
            let run = AssertUnwindSafe(|| case(&mut Random::new(name, k)));
            catch_unwind(run).unwrap_or_else(|panic| {
                let text = panic
                    .downcast_ref::<String>()
                    .map(String::as_str)
                    .or(panic.downcast_ref::<&str>().copied());
                Err(format!("panicked: {}", text.unwrap_or("no message")))
            })
        })
        .collect();
    let mut tally = Tally::new();
    let mut failures = Vec::new();
    for (k, outcome) in numbers.zip(ended) {
        match outcome {
            Ok(kind) => *tally.entry(kind).or_default() += 1,
            Err(fault) => failures.push(format!("{name}/{k}: {fault}")),
        }
    }
    println!("{name}: {tally:?}");
    assert!(
        failures.is_empty(),
        "{} of {count} cases failed, seed {}:\n{}",
        failures.len(),
        seed(),
        failures[..failures.len().min(TOLD)].join("\n")
    );
    tally
}

/// The share of the cases that ended as `kind`; 1 where only one case was asked for.
pub fn share(tally: &Tally, kind: &str) -> Real {
    let all: u32 = tally.values().sum();
    if all <= 1 { 1.0 } else { Real::from(tally.get(kind).copied().unwrap_or(0)) / Real::from(all) }
}

/// The fault `told` where `holds` is false.
pub fn check(holds: bool, told: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(told()) }
}

pub fn finite(points: &[Point]) -> bool {
    points.iter().all(|p| p.iter().all(|c| c.is_finite()))
}

/// `work` in pools of 1, 2 and 7 threads.
///
/// # Errors
///
/// Where two of the results differ.
pub fn same_on_all_threads<T: PartialEq + Send>(work: impl Fn() -> T + Sync) -> Result<T, String> {
    let at = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| e.to_string())?;
        Ok::<T, String>(pool.install(&work))
    };
    let first = at(1)?;
    for threads in [2, 7] {
        check(at(threads)? == first, || format!("{threads} threads give other bits than one"))?;
    }
    Ok(first)
}

#[test]
fn a_panic_and_a_broken_promise_are_told_with_their_numbers() {
    let run = || {
        cases("self test", 100, |r| {
            let x = r.unit();
            assert!(x > 0.02, "{x} is small");
            check(x < 0.9, || format!("{x} is large"))?;
            Ok("ok")
        })
    };
    let panic = catch_unwind(run).unwrap_err();
    let text = panic.downcast_ref::<String>().unwrap();
    assert!(
        text.contains("cases failed") && text.contains("self test/") && text.contains("is large"),
        "{text}"
    );
    assert_eq!(
        cases("self test of counts", 50, |r| Ok(if r.chance(0.5) { "a" } else { "b" }))
            .values()
            .sum::<u32>(),
        50
    );
}
