//! Errors of the libraries as the exceptions of `ifgarments.errors`.

use if_outfit::motion::WalkError;
use if_outfit::{NamedParameterError, OutfitError, ResolveError};
use if_pipeline::animate::AnimateError;
use if_pipeline::wardrobe::WardrobeError;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyType;

pub(crate) use if_cli::chain;

/// An error of a library that has a Python exception.
pub(crate) trait Exception: std::fmt::Display {
    /// Its class in `ifgarments.errors`.
    fn class(&self) -> &'static str;

    /// The exception.
    fn raised(&self, py: Python<'_>) -> PyErr {
        exception(py, self.class(), self.to_string())
    }
}

impl Exception for OutfitError {
    fn class(&self) -> &'static str {
        "OutfitError"
    }
}

impl Exception for NamedParameterError {
    fn class(&self) -> &'static str {
        "ParameterError"
    }
}

impl Exception for if_core::parameter::ParameterError {
    fn class(&self) -> &'static str {
        "ParameterError"
    }
}

impl Exception for WardrobeError {
    fn class(&self) -> &'static str {
        match self {
            Self::Parameter(_) => "ParameterError",
            Self::Busy { .. } => "BusyError",
            _ => "WardrobeError",
        }
    }

    fn raised(&self, py: Python<'_>) -> PyErr {
        exception(py, self.class(), chain(self))
    }
}

impl Exception for ResolveError {
    fn class(&self) -> &'static str {
        match self {
            Self::Outfit(_) => "OutfitError",
            Self::Parameter(_) => "ParameterError",
            Self::Unresolved { .. } => "IntersectionsRemain",
            Self::Cancelled(_) => "Cancelled",
            _ => "SolverError",
        }
    }
}

impl Exception for AnimateError {
    fn class(&self) -> &'static str {
        match self {
            Self::Walk(WalkError::Outfit(_)) => "OutfitError",
            Self::Parameter(_) => "ParameterError",
            Self::Cancelled(_) => "Cancelled",
            _ => "AnimateError",
        }
    }
}

/// The exception `ifgarments.errors.{class}` with a message.
pub(crate) fn exception(py: Python<'_>, class: &str, message: String) -> PyErr {
    let found = py.import("ifgarments.errors").and_then(|module| module.getattr(class));
    match found.map(|class| class.cast_into::<PyType>().map_err(PyErr::from)) {
        Ok(Ok(class)) => PyErr::from_type(class, message),
        Ok(Err(error)) | Err(error) => error,
    }
}

/// A report that cannot be written as JSON.
pub(crate) fn no_json(error: serde_json::Error) -> PyErr {
    PyRuntimeError::new_err(format!("the report cannot be written as JSON: {error}"))
}
