//! Stages in processes of their own.
//!
//! Software Vulkan drivers recompile a material's shader in every frame that draws several textured
//! materials, and never free the result, even when the device closes. So the command line runs
//! every stage in a process of its own, and replaces one that has grown too large. Its meter then
//! covers the renderer alone, without search, comparison and report.
//!
//! | file | job |
//! |---|---|
//! | `client` | several processes that render jobs of any order side by side |
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
