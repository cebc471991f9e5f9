//! Numbers in texts of other programs.

use std::str::FromStr;

/// The number that `text` is, also NaN as the C runtimes of Windows and Linux write it: `-nan(ind)`,
/// `1.#QNAN`, `nan(0x8000)`.
pub(crate) fn float_of_c<T: FromStr + From<f32>>(text: &str) -> Option<T> {
    let nan = || {
        let digits = text.strip_prefix(['-', '+']).unwrap_or(text).to_ascii_lowercase();
        let is_nan = ["nan(", "1.#ind", "1.#qnan", "1.#snan"].iter().any(|n| digits.starts_with(n));
        is_nan.then(|| T::from(f32::NAN))
    };
    text.parse().ok().or_else(nan)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn not_a_number_is_read_as_any_runtime_writes_it() {
        for text in ["nan", "-nan(ind)", "-1.#IND", "1.#QNAN", "nan(snan)", "NaN"] {
            assert!(float_of_c::<f64>(text).is_some_and(f64::is_nan), "{text}");
        }
        assert_eq!(float_of_c::<f32>("-1.5e3"), Some(-1500.0));
        for text in ["", "x", "nano", "1.#", "--1"] {
            assert_eq!(float_of_c::<f64>(text), None, "{text}");
        }
    }
}
