//! Conformance suites for implementors of the traits.
