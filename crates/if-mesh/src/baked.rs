//! Narrow-band grid of a field.
