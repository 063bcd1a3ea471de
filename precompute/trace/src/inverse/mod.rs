//! Light transport run backwards: tests of renderer and tracer that a picture cannot give.
//!
//! | module | job |
//! |---|---|
//! | `transport` | light from each pixel of a projector to each pixel of a camera |
//! | `haar` | wavelets |
//! | `patterns` | random patterns that a transform multiplies with |
//! | `dual` | the projector's view from few images of the camera; relighting it |
//! | `source` | a small source from the light that it leaves on a plane |

mod dual;
mod haar;
mod patterns;
mod source;
mod transport;

pub use dual::{Capture, Recovery};
pub use patterns::Patterns;
pub use source::{Irradiance, Source};
pub use transport::{InverseError, Tracing, Transport};

#[cfg(test)]
mod tests;
