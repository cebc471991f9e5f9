//! Exact triangle–triangle intersection.
