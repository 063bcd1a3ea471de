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

pub(crate) use emitters::{EmitterPoint, Emitters};
pub use punctual::Light;
pub(crate) use punctual::{IncidentLight, PunctualLight};
pub use sky::{MappedSky, Sky};
