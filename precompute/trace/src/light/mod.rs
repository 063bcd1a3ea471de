//! Light sources.
//!
//! | module | job |
//! |---|---|
//! | `punctual` | directional, point and spot lights |
//! | `emitters` | emissive triangles |
//! | `sky` | the environment |

mod emitters;
mod punctual;
mod sky;

#[cfg(feature = "media")]
pub(crate) use emitters::EmitterPoint;
pub(crate) use emitters::Emitters;
pub use punctual::Light;
pub(crate) use punctual::{IncidentLight, PunctualLight};
pub use sky::{MappedSky, Sky};
