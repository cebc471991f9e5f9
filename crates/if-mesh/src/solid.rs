//! The closed clothed-body field.
