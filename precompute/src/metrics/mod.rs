//! Pictures and how different two of them are.
mod picture;
pub mod ssim;
pub use picture::{Picture, PictureError};
pub use ssim::{CompareError, Reference};
