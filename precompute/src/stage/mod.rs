//! The stage of scene files, and the tool's side of every stage.
//!
//! | folder or file | job |
//! |---|---|
//! | `app` | the app of a scene file, in this process or in one of its own |
//! | `world`, `environment`, `prefilter` | a scene's geometry, lights and sky in an app |
//! | `useful` | the knobs that affect a scene |
//! | `frame_renderer` | renders frames: a stage, or formulas in tests |
//! | `remote` | stages in processes of their own |
//! | `side_by_side` | jobs for several renderers |
//!
//! The stage itself is the plugin's: `bevy_frugal_gi::stage`.

mod app;
mod environment;
mod frame_renderer;
mod prefilter;
mod remote;
mod side_by_side;
mod useful;
mod world;

pub use bevy_frugal_gi::stage::{
    Component, Output, Stage, StageError, StageOptions, adapter, software_adapter,
};
pub use frugal_trace::metrics::Radiance;

pub(crate) use app::serve;
pub use app::{open, open_with};
pub(crate) use frame_renderer::{FrameRenderer, RenderedFrame};
pub(crate) use remote::{Program, RemoteError, RemoteStage, Shot, StagedScene, guard};
pub(crate) use side_by_side::side_by_side;
pub use useful::every_knob;
#[cfg(test)]
pub(crate) use useful::knobs;
pub(crate) use useful::useful_knobs;
pub use world::populate;
