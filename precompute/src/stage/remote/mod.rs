//! Stages in processes of their own.
//!
//! Software Vulkan drivers recompile a material's shader in every frame that draws several textured
//! materials, and never free the result: megabytes per frame, which not even closing the device
//! releases. So a stage of the command line is always another process, which is replaced when it has
//! grown too large. Its meter also covers the renderer alone: search, comparison and report run here.
//!
//! | file | job |
//! |---|---|
//! | `client` | several processes that render side by side what does not depend on the order |
//! | `process` | one process, started when it is needed, replaced when it has grown or died |
//! | `program` | a program, its process, and what it said last |
//! | `connection` | a started program at the other end of a socket |
//! | `staged` | what is rendered: a scene file, or a level of an app |
//! | `listener` | the socket |
//! | `guard` | ends an app's program, with all that it has started, when this process is gone |

mod client;
mod connection;
mod guard;
mod listener;
mod process;
mod program;
mod staged;

pub(crate) use client::RemoteStage;
pub(crate) use guard::guard;
pub(crate) use process::Shot;
pub(crate) use program::{Program, RemoteError};
pub(crate) use staged::StagedScene;
