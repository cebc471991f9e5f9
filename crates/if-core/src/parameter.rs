//! One error for parameters out of range, in all crates.

use crate::math::Real;
use std::borrow::Cow;

/// A parameter is out of range.
///
/// # Examples
///
/// ```
/// use if_core::parameter::ParameterError;
///
/// struct Params { clearance: f64 }
/// fn validate(params: &Params) -> Result<(), ParameterError> {
///     let c = params.clearance;
///     ParameterError::check("clearance", c, c > 0.0 && c < 0.1, "above 0 and below 0.1 m")
/// }
/// let error = validate(&Params { clearance: -1.0 }).unwrap_err();
/// assert_eq!(error.to_string(), "parameter `clearance` is -1; it must be above 0 and below 0.1 m");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("parameter `{name}` is {value}; it must be {range}")]
#[non_exhaustive]
pub struct ParameterError {
    /// The parameter, with its group before it where it has one: `cloth.stretch_compliance`.
    pub name: Cow<'static, str>,
    /// Its value.
    pub value: Real,
    /// What it must be, with the unit, to follow "it must be".
    pub range: &'static str,
}

impl ParameterError {
    /// `Ok` if `ok`.
    ///
    /// # Errors
    ///
    /// Otherwise the error for the parameter `name`, with its `value` and the `range` it must be in.
    pub fn check(
        name: &'static str,
        value: Real,
        ok: bool,
        range: &'static str,
    ) -> Result<(), Self> {
        if ok { Ok(()) } else { Err(Self { name: name.into(), value, range }) }
    }

    /// `Ok` if `value` is finite and above zero.
    ///
    /// # Errors
    ///
    /// The error for the parameter `name` if it is not.
    pub fn check_positive(name: &'static str, value: Real) -> Result<(), Self> {
        Self::check(name, value, value > 0.0 && value.is_finite(), "finite and above zero")
    }

    /// `Ok` if `value` is finite, and zero or above.
    ///
    /// # Errors
    ///
    /// The error for the parameter `name` if it is not.
    pub fn check_not_negative(name: &'static str, value: Real) -> Result<(), Self> {
        Self::check(name, value, value >= 0.0 && value.is_finite(), "finite, and zero or above")
    }

    /// `Ok` if `value` is from 0 to 1.
    ///
    /// # Errors
    ///
    /// The error for the parameter `name` if it is not.
    pub fn check_share(name: &'static str, value: Real) -> Result<(), Self> {
        Self::check(name, value, (0.0..=1.0).contains(&value), "from 0 to 1")
    }

    /// The same error for the parameters of a group: `within("cloth")` turns `sweeps` into
    /// `cloth.sweeps`.
    #[must_use]
    pub fn within(mut self, group: &str) -> Self {
        self.name = format!("{group}.{}", self.name).into();
        self
    }

    /// The same error for entry `index` of a list of parameters.
    #[must_use]
    pub fn at(mut self, index: usize) -> Self {
        self.name = format!("{}[{index}]", self.name).into();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finite_ranges_exclude_nan_and_infinity() {
        for bad in [Real::NAN, Real::INFINITY, -1e-9] {
            assert!(ParameterError::check_positive("x", bad).is_err(), "{bad}");
            assert!(ParameterError::check_not_negative("x", bad).is_err(), "{bad}");
            assert!(ParameterError::check_share("x", bad).is_err(), "{bad}");
        }
        assert!(ParameterError::check_positive("x", 0.0).is_err());
        assert!(ParameterError::check_not_negative("x", 0.0).is_ok());
        assert!(ParameterError::check_share("x", 1.0).is_ok());
    }

    #[test]
    fn group_and_index_are_part_of_the_name() {
        let error = ParameterError::check("radius", Real::NAN, false, "positive (m)")
            .unwrap_err()
            .at(3)
            .within("air");
        assert_eq!(error.to_string(), "parameter `air.radius[3]` is NaN; it must be positive (m)");
        assert!(ParameterError::check("radius", 1.0, true, "positive (m)").is_ok());
    }
}
