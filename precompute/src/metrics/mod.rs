//! Pictures and how different two of them are.
mod picture;
pub use picture::Picture;
