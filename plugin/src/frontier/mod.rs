//! Frontier maps in an app: the asset, its loader, and a Bevy camera's view of them.

mod asset;
#[cfg(test)]
#[path = "../../core/src/frontier/testing.rs"]
#[allow(dead_code, unreachable_pub, unused_qualifications)]
pub(crate) mod testing;
mod view;

pub use frugal_core::frontier::*;

pub use asset::{FrontierMapLoadError, FrontierMapLoader, FrontierMapPlugin};
pub use view::camera_view;
