//! The body and its garments.
