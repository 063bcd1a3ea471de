//! The order of the systems and passes of global illumination in a frame.
//!
//! To add a pass, give it a variant in [`PassSystems`], and a place in [`GiPlugin`](super::GiPlugin).

use bevy::app::{App, PostUpdate, SubApp};
use bevy::camera::CameraUpdateSystems;
use bevy::camera::visibility::{VisibilitySystems, check_visibility_cpu_culling};
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::prelude::*;
use bevy::light::SimulationLightSystems;
use bevy::pbr::deferred::deferred_lighting;
use bevy::pbr::screen_space_reflections;
use bevy::transform::TransformSystems;

use crate::schedule::KnobSystems;

/// System sets of GI's passes in the `Core3d` schedule, to order other passes by.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum GiSystems {
    /// In a light's own view: its G-buffer becomes texels. After the prepass, before the main pass.
    Resolve,
    /// In a GI camera's view: VPLs are sampled and gathered. After the prepass, before the main
    /// pass.
    Gather,
    /// In a GI camera's view: indirect light is added to the image. After deferred lighting; before
    /// screen-space reflections, forward-rendered meshes, the sky, and transmissive and transparent
    /// meshes.
    Composite,
}

/// In the main world's `PostUpdate`.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum SceneSystems {
    /// What each camera gathers by is decided.
    Settings,
    /// Changes of meshes are noted, for the sets below.
    Changes,
    /// Cameras of reflective shadow maps are spawned, moved and despawned.
    Maps,
    /// What is rendered in this frame is decided: from here on, cameras of maps that are due are
    /// active.
    Refresh,
    /// What those maps draw is listed.
    Drawn,
    /// Texels of emissive surfaces are updated.
    Emissive,
    /// Occluders and patches are updated.
    Surfaces,
}

/// The passes within [`GiSystems::Gather`], in this order.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum PassSystems {
    /// The sky's samples.
    Sky,
    /// Reflection by patches.
    Bounces,
    /// Virtual point lights.
    Vpl,
    /// Irradiance.
    Gather,
    /// The same of cameras that keep it in the world.
    Cache,
    /// Irradiance around cameras, for meshes that are not deferred.
    Forward,
    /// Spatial filter and temporal accumulation.
    Denoise,
}

/// In the main world.
pub(super) fn configure_main_world(app: &mut App) {
    app.configure_sets(
        PostUpdate,
        (
            SceneSystems::Settings.after(KnobSystems::Apply),
            SceneSystems::Changes,
            // Cameras, lights and meshes are where this frame shows them, whoever propagates their
            // transforms; nothing was made yet for the maps' cameras.
            SceneSystems::Maps
                .after(SceneSystems::Settings)
                .after(CameraUpdateSystems)
                .after(TransformSystems::Propagate)
                .after(SceneSystems::Changes)
                .before(VisibilitySystems::UpdateFrusta)
                .before(SimulationLightSystems::UpdateDirectionalLightCascades),
            // Bevy leaves out the cameras of maps, which are not active yet: they keep lists of
            // their own.
            SceneSystems::Refresh.after(SceneSystems::Maps).after(check_visibility_cpu_culling),
            SceneSystems::Drawn.after(SceneSystems::Refresh),
            SceneSystems::Emissive.after(SceneSystems::Refresh),
            // Read whether there is light.
            SceneSystems::Surfaces.after(SceneSystems::Emissive),
        )
            .distributive_run_if(is_not_off),
    );
}

/// In the render world.
pub(super) fn configure_render_world(render_app: &mut SubApp) {
    render_app.configure_sets(
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
                PassSystems::Cache,
                PassSystems::Forward,
                PassSystems::Denoise,
            )
                .chain()
                .in_set(GiSystems::Gather),
            // Reflections see it, forward-rendered meshes cover it, and the sky's aerial
            // perspective, which follows opaque meshes, dims it.
            GiSystems::Composite
                .in_set(Core3dSystems::MainPass)
                .after(deferred_lighting)
                .before(screen_space_reflections)
                .before(main_opaque_pass_3d),
        ),
    );
}

/// Whether the device supports global illumination. A resource of both worlds, decided in
/// `Plugin::finish`.
#[derive(Resource, Clone, Debug, Default, PartialEq, Eq)]
pub enum GiSupport {
    /// There is no renderer.
    #[default]
    NoRenderer,
    /// The device supports it.
    Full,
    /// The device does not: it falls short of these
    /// [required limits](super::GiPlugin::required_limits). Global illumination stays off, and the
    /// app keeps Bevy's own light.
    Lacking(Vec<&'static str>),
}

/// Whether the device, if any, supports global illumination: else nothing is kept up for it.
pub(super) fn is_not_off(support: Res<GiSupport>) -> bool {
    !matches!(*support, GiSupport::Lacking(_))
}
