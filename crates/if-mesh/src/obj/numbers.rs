//! Numbers as most programs write them, faster than by the standard library and with the same bits.

use crate::float_of_c::float_of_c;

/// Powers of ten that `f64` represents exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Largest integer up to which `f64` represents all.
const MOST_EXACT: u64 = 1 << 53;

/// Digits that cannot exceed `u64`.
const DIGITS: usize = 19;

/// The number that `text` is, as [`str::parse`] returns it.
///
/// A decimal number of few digits is a quotient of two numbers that `f64` represents exactly, so one
/// division rounds it correctly. Others are left to the standard library.
#[inline]
pub(super) fn float(text: &[u8]) -> Option<f64> {
    few_digits(text).or_else(|| float_of_c(std::str::from_utf8(text).ok()?))
}

#[inline]
fn few_digits(text: &[u8]) -> Option<f64> {
    let (is_negative, digits) = sign(text);
    let (mut number, mut count, mut point) = (0u64, 0, None);
    if digits.len() > DIGITS + 1 {
        return None;
    }
    for b in digits {
        let digit = b.wrapping_sub(b'0');
        if digit < 10 {
            number = number.wrapping_mul(10).wrapping_add(digit.into());
            count += 1;
        } else if *b == b'.' && point.is_none() {
            point = Some(count);
        } else {
            return None;
        }
    }
    let power = count - point.unwrap_or(count);
    if count == 0 || count > DIGITS || number > MOST_EXACT {
        return None;
    }
    let value = number as f64 / POWERS[power]; // at most DIGITS
    Some(if is_negative { -value } else { value })
}

/// The integer that `text` is, as [`str::parse`] returns it.
#[inline]
pub(super) fn integer(text: &[u8]) -> Option<i64> {
    few_digits_of_integer(text).or_else(|| std::str::from_utf8(text).ok()?.parse().ok())
}

#[inline]
fn few_digits_of_integer(text: &[u8]) -> Option<i64> {
    let (is_negative, digits) = sign(text);
    if digits.is_empty() || digits.len() >= DIGITS {
        return None;
    }
    let mut value = 0i64;
    for b in digits {
        let digit = b.wrapping_sub(b'0');
        if digit >= 10 {
            return None;
        }
        value = 10 * value + i64::from(digit);
    }
    Some(if is_negative { -value } else { value })
}

/// Whether there is a minus sign, and what follows the sign.
#[inline]
fn sign(text: &[u8]) -> (bool, &[u8]) {
    match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        let mut texts: Vec<String> = [
            "",
            "-",
            "+",
            ".",
            "-.",
            "0",
            "-0",
            "+0",
            "-0.0",
            "1.",
            ".5",
            "-.5",
            "+.5e1",
            "1..2",
            "1.2.3",
            "--1",
            "1e5",
            "1E-5",
            "nan",
            "inf",
            "-inf",
            "infinity",
            "1_0",
            "0x1",
            "1/2",
            "9007199254740992",
            "9007199254740993",
            "900719925474099.3",
            "0.30000000000000004",
            "9999999999999999999",
            "99999999999999999999",
            "0.000000000000000001",
            "0.0000000000000000001",
            "00000000000000000001",
            "-9223372036854775808",
            "9223372036854775807",
            "9223372036854775808",
            "999999999999999999",
            "é",
            "1é",
        ]
        .map(str::to_owned)
        .to_vec();
        for k in 0..20_000u64 {
            let bits = k.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let x = (bits >> 20) as f64 / (1u64 << 40) as f64 - 8.0;
            texts.push(format!("{x:.*}", (k % 20) as usize));
            texts.push(format!("{x:?}"));
            texts.push(format!("{}", (bits >> (k % 64)) as i64));
        }
        for text in &texts {
            let bits = |x: f64| x.to_bits();
            assert_eq!(float(text.as_bytes()).map(bits), text.parse().ok().map(bits), "{text}");
            assert_eq!(integer(text.as_bytes()), text.parse().ok(), "{text}");
        }
        assert_eq!((float(b"\xff"), integer(b"\xff")), (None, None));
    }
}
