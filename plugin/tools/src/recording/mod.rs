//! Records an app's camera paths to a file, so that settings can be trained on the views that
//! occur.
//!
//! [`CameraRecorderPlugin`] writes the file, and `frugal precompute --cameras FILE` reads it. The
//! plugin is not part of [`FrugalGiPlugins`](bevy_frugal_gi::FrugalGiPlugins): add it to the builds that are
//! used for recording.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_frugal_gi::prelude::*;
//! use bevy_frugal_gi_tools::{CameraRecorderPlugin, RecordCamera};
//!
//! App::new()
//!     .add_plugins((DefaultPlugins, FrugalGiPlugins, CameraRecorderPlugin::new("cameras.txt")))
//!     .add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Camera3d::default(), FrugalGi::default(), RecordCamera));
//!     })
//!     .run();
//! ```
//!
//! # The file
//!
//! Text, in lines that are only appended, so that a crash loses at most the last one. The first
//! line is the name and version of the format, the second the names of the columns, and each
//! further line a sample:
//!
//! ```text
//! frugal-cameras 1
//! time_s,camera,x_m,y_m,z_m,qx,qy,qz,qw,vertical_fov_rad,aspect
//! 0.25,0,0.0,1.7,6.0,0.0,0.0,0.0,1.0,1.0471976,1.7777778
//! ```
//!
//! | column | meaning | valid |
//! |---|---|---|
//! | `time_s` | seconds since the app started | finite, from 0 |
//! | `camera` | number of the camera | whole, 0 to 2³² − 1 |
//! | `x_m`, `y_m`, `z_m` | world position, metres | −10⁷ to 10⁷ |
//! | `qx`, `qy`, `qz`, `qw` | world rotation; the camera looks along its own −Z | length at least 10⁻⁶ |
//! | `vertical_fov_rad` | vertical field of view, radians | between 0 and π, both excluded |
//! | `aspect` | width ÷ height of the image | finite, above 0 |
//!
//! A later run of the app appends to the file. Its clock restarts at 0 and its cameras get new
//! numbers: lines with the same number are one camera in one run, in order of time. A static camera
//! adds no lines.
//!
//! [`parse`] and [`to_text`] depend on neither an app nor a renderer.
mod error;
mod file;
mod plugin;
mod sample;
#[cfg(test)]
pub(crate) mod testing;
mod writer;
pub use error::{CameraFileError, InvalidSample};
pub use file::{COLUMNS, VERSION, parse, to_text};
pub use plugin::{CameraRecorder, CameraRecorderPlugin, RecordCamera, RecordingSystems};
pub use sample::CameraSample;
