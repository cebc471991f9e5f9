//! What is wrong with a parameter of a fit.

/// A parameter of a fit, of its loss, its optimiser or its learning rate, is out of range.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: {needs}")]
pub struct ParameterError {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// What it has to be.
    pub needs: &'static str,
}

impl ParameterError {
    /// Refuses a `value` that is no finite number, or below zero.
    pub(crate) fn unless_at_least_zero(name: &'static str, value: f64) -> Result<(), Self> {
        let fine = value >= 0.0 && value.is_finite();
        if fine {
            Ok(())
        } else {
            Err(Self { name, value, needs: "a finite number, at least zero" })
        }
    }

    /// Refuses a `value` that is no finite number, or not above zero.
    pub(crate) fn unless_above_zero(name: &'static str, value: f64) -> Result<(), Self> {
        let fine = value > 0.0 && value.is_finite();
        if fine { Ok(()) } else { Err(Self { name, value, needs: "a finite number above zero" }) }
    }
}
