//! Meters of handhelds and laptops: files that the Linux kernel provides under a root folder.
//!
//! | file | job |
//! |---|---|
//! | `files` | one reader for meters that are numbers in files |
//! | `rapl`, `gpu`, `jetson` | which files these are, and of which device |
//! | `cards` | graphics cards, and the choice of the one that renders |
//! | `battery` | batteries and chargers, whose files mean something only together |

#[cfg_attr(any(windows, target_os = "macos"), allow(dead_code))]
pub(crate) mod battery;
pub(crate) mod cards;
#[cfg(test)]
pub(crate) mod fake;
mod files;
pub(crate) mod gpu;
pub(crate) mod jetson;
pub(crate) mod rapl;
#[cfg(test)]
mod tests;
