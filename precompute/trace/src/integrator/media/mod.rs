//! Light in fog.
//!
//! | module | job |
//! |---|---|
//! | `vertex` | a point of a path, on a surface or in fog, and the light that reaches it |
//! | `path` | radiance along one path |

mod path;
mod vertex;

pub(super) use path::trace;

#[cfg(test)]
mod tests;
