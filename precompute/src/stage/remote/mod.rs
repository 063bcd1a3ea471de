//! A stage in a process of its own.
//!
//! Software Vulkan drivers compile a material's shader anew in every frame that draws several
//! textured ones, and never free what they compiled: megabytes a frame, which not even closing the
//! device gives back. So the command line's stage is a child process, which is replaced by a fresh
//! one when it has grown too large. It also meters exactly the renderer: the search, the comparison
//! of runs and the report are the parent's.
//!
//! Messages are a length (u32, little endian) and that many bytes of JSON; a reply with an image is
//! followed by its pixels.

mod client;
mod protocol;
mod server;

pub use client::{RemoteError, RemoteStage};
pub use protocol::StageRequest;
pub use server::serve;
