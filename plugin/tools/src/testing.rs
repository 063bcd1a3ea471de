//! What the tests of this crate share.

use frugal_core::frontier::FrontierMap;
pub(crate) use frugal_core::testing::{frontier, space};

/// `value` with a change. The plugin's structs that apps only read cannot be written out here.
pub(crate) fn changed<T>(mut value: T, change: impl FnOnce(&mut T)) -> T {
    change(&mut value);
    value
}

/// A map with the frontier of 6 W everywhere.
pub(crate) fn map() -> FrontierMap {
    let octree = frugal_core::testing::cube(vec![frontier(6.0)]);
    FrontierMap { octree, ..frugal_core::testing::map(0) }
}
