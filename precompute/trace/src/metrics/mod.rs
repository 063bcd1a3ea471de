//! Images, and metrics of the difference of two images.
mod difference;
mod picture;
mod radiance;
pub mod ssim;
pub mod tone;
pub use difference::{Difference, DifferenceError};
pub use picture::{Picture, PictureError};
pub use radiance::{Radiance, RadianceError};
pub use ssim::{Reference, SsimError};
