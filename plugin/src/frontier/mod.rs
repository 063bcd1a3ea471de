//! Frontier maps in an app: the asset, its loader, and a Bevy camera's view of them.

mod asset;
mod view;

pub use frugal_core::frontier::*;

pub use asset::{FrontierMapLoadError, FrontierMapLoader, FrontierMapPlugin};
pub use view::camera_view;
