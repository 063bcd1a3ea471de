//! The order of everything that global illumination does in a frame, in one place.
//!
//! To add a pass, give it a variant in [`PassSystems`], one in [`PrepareSystems`] if it holds GPU
//! objects, and a plugin in [`GiPlugin`](super::GiPlugin).

use bevy::app::{App, PostUpdate, SubApp};
use bevy::camera::CameraUpdateSystems;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::prelude::*;
use bevy::pbr::deferred::deferred_lighting;
use bevy::pbr::main_transmissive_pass_3d;
use bevy::render::{Render, RenderApp, RenderSystems};

use crate::schedule::KnobSystems;

/// Where GI's passes lie in the `Core3d` schedule, for those who must order theirs.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub enum GiSystems {
    /// In a light's own view: its G-buffer becomes texels. After the prepass, before the main pass.
    Resolve,
    /// In a GI camera's view: VPLs are sampled and gathered. After the prepass, before the main
    /// pass.
    Gather,
    /// In a GI camera's view: indirect light is added to the image. After opaque meshes, before
    /// transmissive and transparent ones.
    Composite,
}

/// In the main world's `PostUpdate`.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum SceneSystems {
    /// Reflective shadow maps' cameras come, move and go.
    Maps,
    /// Texels of emissive surfaces are kept.
    Emissive,
    /// What stops rays is kept, and what reflects light again.
    Surfaces,
}

/// In the render world's `PrepareResources`, in this order.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum PrepareSystems {
    /// Sources of light reserve their ranges of texels.
    Reserve,
    /// The store of texels is allocated.
    Texels,
    /// Texels that the CPU makes are written.
    Emissive,
    /// Occluders.
    Trace,
    /// Skies.
    Sky,
    /// Asks for the gather's pipelines, of which a sky must know whether they are there.
    GatherPipelines,
    /// Patches.
    Bounces,
    /// What each view has to do in this frame.
    Views,
    /// Each view's buffers of VPLs.
    Vpl,
    /// Each view's irradiance.
    Gather,
    /// Each view's history.
    Denoise,
    /// Takes Bevy's own light of gathered skies out, before Bevy binds it.
    Environment,
}

/// The passes within [`GiSystems::Gather`], in this order.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum PassSystems {
    /// The sky's samples.
    Sky,
    /// Light of patches.
    Bounces,
    /// Virtual point lights.
    Vpl,
    /// Irradiance.
    Gather,
    /// Spatial filter and temporal accumulation.
    Denoise,
}

/// In the main world.
pub(super) fn configure_main_world(app: &mut App) {
    app.configure_sets(
        PostUpdate,
        (
            // Need to come before cameras are updated: sizes, projections and transforms that are
            // written to maps' cameras are picked up in the same frame.
            SceneSystems::Maps.after(KnobSystems::Apply).before(CameraUpdateSystems),
            SceneSystems::Emissive.after(KnobSystems::Apply),
            // Need to know whether there is light.
            SceneSystems::Surfaces
                .after(KnobSystems::Apply)
                .after(SceneSystems::Maps)
                .after(SceneSystems::Emissive),
        ),
    );
}

/// In the render world.
pub(super) fn configure_render_world(render_app: &mut SubApp) {
    render_app
        .configure_sets(
            Render,
            (
                PrepareSystems::Reserve,
                PrepareSystems::Texels,
                PrepareSystems::Emissive,
                PrepareSystems::Trace,
                PrepareSystems::Sky,
                PrepareSystems::GatherPipelines,
                PrepareSystems::Bounces,
                PrepareSystems::Views,
                PrepareSystems::Vpl,
                PrepareSystems::Gather,
                PrepareSystems::Denoise,
                PrepareSystems::Environment,
            )
                .chain()
                .in_set(RenderSystems::PrepareResources),
        )
        .configure_sets(
            Core3d,
            (
                (GiSystems::Resolve, GiSystems::Gather)
                    .chain()
                    .after(Core3dSystems::Prepass)
                    .before(Core3dSystems::MainPass),
                (
                    PassSystems::Sky,
                    PassSystems::Bounces,
                    PassSystems::Vpl,
                    PassSystems::Gather,
                    PassSystems::Denoise,
                )
                    .chain()
                    .in_set(GiSystems::Gather),
                // Need the opaque pass to be over: what is rendered forward in it covers what is
                // deferred.
                GiSystems::Composite
                    .in_set(Core3dSystems::MainPass)
                    .after(deferred_lighting)
                    .after(main_opaque_pass_3d)
                    .before(main_transmissive_pass_3d)
                    .before(main_transparent_pass_3d),
            ),
        );
}

/// In the render world: the device has what global illumination needs.
#[derive(Resource)]
pub(super) struct GiIsSupported;

/// The render world, where the device has what global illumination needs. For plugins that finish
/// after [`GiPlugin`](super::GiPlugin), as those that it adds do.
pub(super) fn supported_render_app(app: &mut App) -> Option<&mut SubApp> {
    app.get_sub_app_mut(RenderApp)
        .filter(|render_app| render_app.world().contains_resource::<GiIsSupported>())
}
