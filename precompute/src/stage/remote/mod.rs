//! A stage in a child process.
//!
//! Software Vulkan drivers recompile a material's shader in every frame that draws several textured
//! materials, and never free the result: megabytes per frame, which not even closing the device
//! releases. So the command line's stage is a child process, which is replaced when it has grown
//! too large. Its meter also covers the renderer alone: search, comparison and report run in the
//! parent.
//!
//! Several children render side by side what does not depend on the order (`Measure::measure_all`).
//!
//! Messages are a length (u32, little endian) and that many bytes of JSON; a reply with an image is
//! followed by its pixels.

mod client;
mod process;
mod protocol;
mod server;

pub(crate) use client::RemoteStage;
pub(crate) use process::RemoteError;
pub(crate) use server::serve;
