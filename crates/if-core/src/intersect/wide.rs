//! Signs of determinants in integers of any length: the last resort of the predicates, for
//! coordinates whose products leave the range of `f64`. Slow (microseconds to a millisecond).

use crate::math::{Point, Real};

/// An integer: sign and magnitude, least significant limb first, without leading zeros.
#[derive(Clone, Debug, PartialEq)]
struct Wide {
    negative: bool,
    limbs: Vec<u32>,
}

/// Sign of `((b − a) × (c − a)) · (p − a)`.
pub(super) fn side_of_plane(a: &Point, b: &Point, c: &Point, p: &Point) -> i8 {
    let shift = common_shift([a, b, c, p].iter().flat_map(|q| q.iter()));
    let d = |q: &Point, k: usize| Wide::new(q[k], shift).minus(&Wide::new(a[k], shift));
    let row = |q: &Point| [d(q, 0), d(q, 1), d(q, 2)];
    let (u, v, w) = (row(b), row(c), row(p));
    let minor = |i: usize, j: usize| u[i].times(&v[j]).minus(&u[j].times(&v[i]));
    let sum =
        minor(1, 2).times(&w[0]).plus(&minor(2, 0).times(&w[1])).plus(&minor(0, 1).times(&w[2]));
    sum.sign()
}

/// Sign of `(b − a) × (p − a)`.
pub(super) fn side_of_line(a: [Real; 2], b: [Real; 2], p: [Real; 2]) -> i8 {
    let shift = common_shift([a, b, p].iter().flatten());
    let d = |q: [Real; 2], k: usize| Wide::new(q[k], shift).minus(&Wide::new(a[k], shift));
    d(b, 0).times(&d(p, 1)).minus(&d(b, 1).times(&d(p, 0))).sign()
}

/// The smallest exponent of a last digit: all values are multiples of 2 to it.
fn common_shift<'a>(values: impl Iterator<Item = &'a Real>) -> i32 {
    values.filter(|x| **x != 0.0).map(|x| split(*x).1).min().unwrap_or(0)
}

/// `|x| = m · 2ᵉ` with an odd integer m, where x is not zero.
fn split(x: Real) -> (u64, i32) {
    let bits = x.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32;
    let fraction = bits & ((1 << 52) - 1);
    let (m, e) =
        if exponent == 0 { (fraction, -1074) } else { (fraction | (1 << 52), exponent - 1075) };
    let zeros = m.trailing_zeros();
    (m >> zeros, e + zeros as i32)
}

impl Wide {
    /// `x / 2^shift`, where that is an integer.
    fn new(x: Real, shift: i32) -> Self {
        if x == 0.0 {
            return Self { negative: false, limbs: Vec::new() };
        }
        let (m, e) = split(x);
        let up = (e - shift) as usize;
        let mut limbs = vec![0; up / 32];
        let wide = u128::from(m) << (up % 32);
        limbs.extend((0..3).map(|k| (wide >> (32 * k)) as u32));
        Self { negative: x < 0.0, limbs }.trimmed()
    }

    fn trimmed(mut self) -> Self {
        while self.limbs.last() == Some(&0) {
            self.limbs.pop();
        }
        self
    }

    fn sign(&self) -> i8 {
        match (self.limbs.is_empty(), self.negative) {
            (true, _) => 0,
            (false, true) => -1,
            (false, false) => 1,
        }
    }

    fn times(&self, other: &Self) -> Self {
        let mut limbs = vec![0u32; self.limbs.len() + other.limbs.len() + 1];
        for (i, x) in self.limbs.iter().enumerate() {
            let mut carry = 0u64;
            for (j, y) in other.limbs.iter().enumerate() {
                let t = u64::from(*x) * u64::from(*y) + u64::from(limbs[i + j]) + carry;
                limbs[i + j] = t as u32;
                carry = t >> 32;
            }
            limbs[i + other.limbs.len()] = carry as u32;
        }
        Self { negative: self.negative != other.negative, limbs }.trimmed()
    }

    fn plus(&self, other: &Self) -> Self {
        if self.negative == other.negative {
            let mut carry = 0u64;
            let n = self.limbs.len().max(other.limbs.len()) + 1;
            let at = |w: &Self, k: usize| u64::from(w.limbs.get(k).copied().unwrap_or(0));
            let limbs = (0..n)
                .map(|k| {
                    let t = at(self, k) + at(other, k) + carry;
                    carry = t >> 32;
                    t as u32
                })
                .collect();
            return Self { negative: self.negative, limbs }.trimmed();
        }
        let order = self
            .limbs
            .len()
            .cmp(&other.limbs.len())
            .then_with(|| self.limbs.iter().rev().cmp(other.limbs.iter().rev()));
        let (large, small) = if order.is_lt() { (other, self) } else { (self, other) };
        let mut borrow = 0i64;
        let limbs = (0..large.limbs.len())
            .map(|k| {
                let t = i64::from(large.limbs[k])
                    - i64::from(small.limbs.get(k).copied().unwrap_or(0))
                    - borrow;
                borrow = i64::from(t < 0);
                t as u32
            })
            .collect();
        Self { negative: large.negative, limbs }.trimmed()
    }

    fn minus(&self, other: &Self) -> Self {
        self.plus(&Self { negative: !other.negative, limbs: other.limbs.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    #[test]
    fn arithmetic_agrees_with_128_bits() {
        let mut random = SplitMix64::new(1);
        let mut next = || {
            (random.below(1 << 31) as f64 - f64::from(1 << 30))
                * [1.0, 2.0, 1024.0, 65536.0][random.below(4)]
        };
        let back = |w: &Wide| {
            let m = w.limbs.iter().rev().fold(0i128, |s, l| (s << 32) + i128::from(*l));
            if w.negative { -m } else { m }
        };
        for _ in 0..2000 {
            let (x, y) = (next(), next());
            let (a, b) = (Wide::new(x, 0), Wide::new(y, 0));
            assert_eq!(back(&a), x as i128);
            assert_eq!(back(&a.plus(&b)), x as i128 + y as i128);
            assert_eq!(back(&a.minus(&b)), x as i128 - y as i128);
            assert_eq!(back(&a.times(&b)), x as i128 * y as i128);
            assert_eq!(a.minus(&a).sign(), 0);
        }
    }
}
