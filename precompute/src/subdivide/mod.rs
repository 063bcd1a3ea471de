//! subdivide
