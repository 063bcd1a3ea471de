//! Data of a GI camera and of the frame that all passes share.
//!
//! | file | world | job |
//! |---|---|---|
//! | `fade` | both | how much of its indirect light a camera shows |
//! | `frame` | both | the work of a frame, from the changes of the scene |
//! | `work` | render | the work of a camera in a frame |
//! | `shown` | both | what lights GI cameras, and which meshes they show |
//! | `noise.wgsl` | | noise of low-resolution pixels, luminance |
//! | `surface.wgsl` | | the surface in a pixel of Bevy's deferred G-buffer |

mod fade;
mod frame;
mod shown;
mod work;

use std::sync::Arc;

use bevy::app::{App, PostUpdate, SubApp};
use bevy::ecs::prelude::*;
use bevy::math::{DMat4, DVec3, Mat4, UVec2, Vec3};
use bevy::render::ExtractSchedule;
use bevy::render::camera::ExtractedCamera;
use bevy::render::extract_component::ExtractComponentPlugin;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::render::view::ExtractedView;
use bevy::shader::load_shader_library;

use super::compute::drop_with;
use super::schedule::SceneSystems;
use super::settings::{FrugalGi, GiPixelFraction};
use super::texels::{TexelRow, same_layout};
pub use crate::cut::CameraCut;
use crate::cut::Jumps;
pub(super) use fade::{ActiveGi, ForwardVolume, GiShare};
pub use frame::GiRefresh;
pub(super) use frame::{GiFrame, MapChanges};
pub(super) use shown::{
    GiCameras, LightPresence, MeshVisibility, SkySource, VisibilityFilter, level_position,
};
pub(super) use work::{HistoryAction, Work};

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "noise.wgsl");
    load_shader_library!(app, "surface.wgsl");
    app.init_resource::<LightPresence>()
        .init_resource::<GiRefresh>()
        .register_type::<GiRefresh>()
        .init_resource::<GiFrame>()
        .add_plugins((
            ExtractResourcePlugin::<Jumps>::default(),
            ExtractResourcePlugin::<GiRefresh>::default(),
            ExtractResourcePlugin::<GiFrame>::default(),
            ExtractComponentPlugin::<ActiveGi>::default(),
        ))
        .add_systems(PostUpdate, fade::advance.in_set(SceneSystems::Settings))
        .add_observer(drop_with::<FrugalGi, ActiveGi>)
        .register_required_components::<FrugalGi, ActiveGi>();
    crate::cut::build(app);
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app.add_systems(ExtractSchedule, shown::extract_environments);
}

/// A GI camera that has light to gather, and its work in this frame. In the render world.
#[derive(Component, Clone, Debug)]
pub(super) struct GiView {
    pub gi: FrugalGi,
    /// Pose, projection and pixels of the gather.
    pub camera: GatherCamera,
    /// The texels from which its VPLs are sampled. Shared with the buffers that hold them.
    pub rows: Arc<Vec<TexelRow>>,
    /// Samples of the sky that each low-resolution pixel evaluates.
    pub sky_samples: u32,
    pub work: Work,
    /// Which samples of VPLs and of the sky are taken.
    pub sequence: u32,
    /// Whether what was gathered before is no longer valid.
    pub is_new: bool,
    /// Whether its sky, or settings that say what lights it, changed.
    pub relit: bool,
    /// What its history does in this frame.
    pub history: HistoryAction,
}

impl GiView {
    /// Low-resolution pixels along both axes.
    pub(crate) fn cells(&self) -> UVec2 {
        self.camera.cells()
    }

    /// How far this view's buffers serve `next`.
    pub(crate) fn reuse(&self, next: &Self) -> BufferReuse {
        let sampled = |view: &Self| (view.gi.vpl_count, view.gi.interleave, view.rows.is_empty());
        if sampled(self) != sampled(next) || !same_layout(&self.rows, &next.rows) {
            BufferReuse::Empty
        } else if self.rows != next.rows || self.cells() != next.cells() {
            BufferReuse::LaidOut
        } else {
            BufferReuse::Same
        }
    }
}

/// How far a view's buffers are still valid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BufferReuse {
    /// Entirely.
    Same,
    /// Their layout is; VPLs are resampled and gathered again, as the period allows.
    LaidOut,
    /// Not at all: no VPLs were sampled into them.
    Empty,
}

/// The whole projection of a view.
pub(super) fn clip_from_world(view: &ExtractedView) -> Mat4 {
    view.clip_from_world
        .unwrap_or_else(|| view.clip_from_view * view.world_from_view.to_matrix().inverse())
}

/// Pose, projection and pixels of a gather.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GatherCamera {
    pub clip_from_world: Mat4,
    pub eye: Vec3,
    pub forward: Vec3,
    pub exposure: f32,
    pub is_parallel: bool,
    /// Size of the image and of a low-resolution pixel, in pixels.
    pub size: UVec2,
    pub cell: UVec2,
}

impl GatherCamera {
    pub(crate) fn new(
        camera: &ExtractedCamera,
        view: &ExtractedView,
        size: UVec2,
        fraction: GiPixelFraction,
    ) -> Self {
        Self {
            clip_from_world: clip_from_world(view),
            eye: view.world_from_view.translation(),
            forward: view.world_from_view.forward().into(),
            exposure: camera.exposure,
            is_parallel: view.clip_from_view.w_axis.w == 1.0,
            size,
            cell: fraction.cell().into(),
        }
    }

    /// The same in a world that was shifted, in metres.
    pub(crate) fn shifted(&self, by: Vec3) -> Self {
        // Kilometres from the origin, 32 bits would lose millimetres.
        let back = DMat4::from_translation(-DVec3::from(by));
        let clip_from_world = (self.clip_from_world.as_dmat4() * back).as_mat4();
        Self { clip_from_world, eye: self.eye + by, ..*self }
    }

    /// Low-resolution pixels along both axes.
    pub(crate) fn cells(&self) -> UVec2 {
        UVec2::new(self.size.x.div_ceil(self.cell.x), self.size.y.div_ceil(self.cell.y))
    }
}
