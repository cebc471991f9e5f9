//! Pictures of outfits by software rasterisation.
