//! Global illumination: bounces from virtual point lights (VPLs) sampled in reflective shadow maps,
//! and light of emissive surfaces and of the sky.
//!
//! Reflective shadow maps (Dachsbacher and Stamminger 2005) find the surfaces that lights
//! illuminate; VPLs (Keller 1997, "Instant Radiosity") carry the reflected light on. Each folder
//! imports only those above it:
//!
//! | folder | world | job |
//! |---|---|---|
//! | `settings`, `schedule` | both | settings of a camera; the order of all systems and passes |
//! | `compute` | render | pipelines, buffers and encoding that all compute passes share |
//! | `texels` | render | one store of texels: position, normal, area, reflected or emitted flux |
//! | `view` | both | data of a GI camera and of the frame that all passes share |
//! | `surfaces` | both | reads geometry, textures and masks from mesh and material assets |
//! | `trace` | both | keeps a bounding volume hierarchy of the scene on the GPU, for shadow rays |
//! | `vpl` | render | samples each view's VPLs from texels, by their importance to the view |
//! | `rsm` | both | renders each light's reflective shadow map, and turns it into texels |
//! | `emissive` | both | adds texels of emissive surfaces |
//! | `sky` | render | samples each view's environment map by importance |
//! | `bounces` | both | further bounces: lights surface patches, whose reflected flux joins the texels |
//! | `camera` | render | decides the work of each GI camera in a frame |
//! | `gather` | render | sums the VPLs' irradiance at low-resolution pixels |
//! | `cache` | render | in place of `gather` and `denoise`: irradiance kept in cells of surface |
//! | `forward` | both | irradiance on a grid around the camera, for meshes that are not deferred |
//! | `denoise` | render | filters the irradiance spatially and temporally |
//! | `composite` | render | upsamples the irradiance (joint bilateral); adds it before tone mapping |
//! | `fog` | render | indirect light in fog volumes, from the grid of `forward` |
//! | `diagnostics`, `inspect` | both | counters; access to buffers, for tests |

mod bounces;
mod cache;
mod camera;
mod composite;
pub(crate) mod compute;
mod denoise;
mod diagnostics;
mod emissive;
mod fog;
mod forward;
mod gather;
#[cfg(feature = "inspect")]
pub mod inspect;
mod rsm;
mod schedule;
mod settings;
mod sky;
mod surfaces;
mod texels;
mod trace;
mod view;
mod vpl;

use std::sync::Arc;

use bevy::app::{App, Plugin, SubApp};
use bevy::camera::Camera3d;
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::log::{warn, warn_once};
use bevy::material::labels::DrawFunctionLabel;
use bevy::material::{OpaqueRendererMethod, RenderPhaseType};
use bevy::pbr::{DefaultOpaqueRendererMethod, MainPassAlphaMaskDrawFunction, PreparedMaterial};
use bevy::render::erased_render_asset::ErasedRenderAssets;
use bevy::render::renderer::RenderDevice;
use bevy::render::settings::WgpuLimits;
use bevy::render::view::Msaa;
use bevy::render::{Render, RenderApp, RenderSystems};

pub use diagnostics::GiCounts;
pub use rsm::RsmView;
pub use schedule::{GiSupport, GiSystems};
pub use settings::{
    FrugalGi, GiInterleave, GiLimits, GiOutput, GiPixelFraction, GiShading, GiVisibility,
};
pub use surfaces::GiTextureCopies;
pub use trace::GiOccluders;
pub use view::{CameraCut, GiRefresh};

/// Renders global illumination on cameras with [`FrugalGi`].
#[derive(Clone, Debug)]
pub struct GiPlugin {
    /// Whether deferred rendering is the app's default. Default: true. If false, materials that do
    /// not ask for deferred rendering receive coarser indirect light, see
    /// [`forward_spacing`](FrugalGi::forward_spacing).
    ///
    /// If true, every `Camera3d` gets two prepasses. Without a `DeferredPrepass`, Bevy draws no
    /// deferred mesh, or panics where the camera has another prepass. Without a `DepthPrepass`,
    /// point and spot lights leave deferred surfaces black.
    pub deferred_by_default: bool,
}

impl Default for GiPlugin {
    fn default() -> Self {
        Self { deferred_by_default: true }
    }
}

impl GiPlugin {
    /// The least limits of a device that supports global illumination; see [`GiSupport`].
    pub fn required_limits() -> WgpuLimits {
        WgpuLimits {
            max_compute_invocations_per_workgroup: bounces::SUM_LANES,
            max_compute_workgroup_size_x: bounces::SUM_LANES,
            max_storage_buffers_per_shader_stage: 8,
            max_storage_textures_per_shader_stage: 2,
            max_uniform_buffer_binding_size: u64::from(bounces::BOUNCE_VPLS.count())
                * vpl::VPL_BYTES,
            ..WgpuLimits::downlevel_webgl2_defaults()
        }
    }

    fn defer(app: &mut App) {
        app.insert_resource(DefaultOpaqueRendererMethod::deferred());
        // Required components also cover cameras that are spawned later. They must be registered
        // before the first camera.
        let deferred = app.try_register_required_components::<Camera3d, DeferredPrepass>();
        let depth = app.try_register_required_components::<Camera3d, DepthPrepass>();
        if deferred.is_err() || depth.is_err() {
            warn!(
                "a Camera3d was spawned before GiPlugin was added, or already requires a DeferredPrepass or DepthPrepass: give every Camera3d both"
            );
        }
    }
}

impl Plugin for GiPlugin {
    fn build(&self, app: &mut App) {
        if self.deferred_by_default {
            Self::defer(app);
        }
        app.init_resource::<GiLimits>()
            .init_resource::<GiSupport>()
            .register_type::<FrugalGi>()
            .register_type::<GiLimits>();
        // The requirement does not replace the `Msaa` of a camera that has one; Bevy would switch
        // it off with a warning in each frame.
        app.add_observer(|added: On<Add, FrugalGi>, mut commands: Commands| {
            commands.entity(added.entity).insert(Msaa::Off);
        });
        schedule::configure_main_world(app);
        view::build(app);
        texels::build(app);
        surfaces::build(app);
        trace::build(app);
        rsm::build(app);
        emissive::build(app);
        sky::build(app);
        bounces::build(app);
        vpl::build(app);
        gather::build(app);
        cache::build(app);
        forward::build(app);
        denoise::build(app);
        composite::build(app);
        fog::build(app);
        app.register_type::<GiCounts>();
    }

    fn finish(&self, app: &mut App) {
        crate::schedule::watch_pipelines(app);
        crate::atmosphere::share_atmosphere(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        // With or without global illumination, since every camera is deferred.
        render_app.add_systems(Render, draw_masked_once.in_set(RenderSystems::Specialize));
        let Some(device) = render_app.world().get_resource::<RenderDevice>() else { return };
        let lacking = lacking_limits(&device.limits());
        if !lacking.is_empty() {
            warn!("global illumination stays off: this GPU does not reach {}", lacking.join(", "));
            app.insert_resource(GiSupport::Lacking(lacking));
            return;
        }
        render_app.insert_resource(GiSupport::Full);
        schedule::configure_render_world(render_app);
        view::finish(render_app);
        texels::finish(render_app);
        trace::finish(render_app);
        rsm::finish(render_app);
        sky::finish(render_app);
        bounces::finish(render_app);
        vpl::finish(render_app);
        gather::finish(render_app);
        cache::finish(render_app);
        denoise::finish(render_app);
        composite::finish(render_app);
        fog::finish(render_app);
        add_preparation(render_app);
        app.insert_resource(GiSupport::Full);
        surfaces::finish(app);
        forward::finish(app);
        diagnostics::finish(app);
    }
}

/// Every folder uploads what changed, in this order.
fn add_preparation(render_app: &mut SubApp) {
    render_app.add_systems(
        Render,
        (
            (rsm::reserve, emissive::reserve, bounces::reserve),
            texels::allocate,
            emissive::upload,
            trace::prepare,
            sky::prepare,
            // A sky is active only once the pipelines that gather it are compiled.
            (gather::prepare_pipelines, cache::prepare_pipelines, forward::prepare_pipelines),
            bounces::prepare,
            camera::prepare,
            vpl::prepare,
            gather::prepare,
            cache::prepare,
            forward::prepare,
            fog::prepare,
            denoise::prepare,
            // Before Bevy binds it.
            sky::take_out_diffuse,
        )
            .chain()
            .in_set(RenderSystems::PrepareResources),
    );
}

/// Names of the limits that GI needs and that the device does not reach.
fn lacking_limits(limits: &WgpuLimits) -> Vec<&'static str> {
    let mut lacking = Vec::new();
    GiPlugin::required_limits()
        .check_limits_with_fail_fn(limits, false, |name, _, _| lacking.push(name));
    lacking
}

/// Keeps Bevy 0.19.1 from drawing deferred alpha-masked meshes twice.
///
/// They are drawn into the G-buffer and lit by the deferred pass. The forward alpha-mask pass then
/// draws them again over that, without direct light. Bevy leaves opaque deferred materials out of the
/// forward pass; this does the same for masked ones. It matters here because [`GiPlugin`] makes
/// deferred rendering the default and gives every camera a deferred prepass.
///
/// Takes the forward pass's draw function away from deferred alpha-masked materials, before meshes
/// are queued for drawing.
fn draw_masked_once(mut materials: ResMut<ErasedRenderAssets<PreparedMaterial>>) {
    if !materials.is_changed() {
        return;
    }
    let forward = MainPassAlphaMaskDrawFunction.intern();
    // This change must not trigger change detection in the next frame.
    for (_, material) in materials.bypass_change_detection().iter_mut() {
        let properties = &material.properties;
        let is_masked = matches!(properties.render_phase_type, RenderPhaseType::AlphaMask);
        if !is_masked
            || properties.render_method != OpaqueRendererMethod::Deferred
            || properties.get_draw_function(forward).is_none()
        {
            continue;
        }
        match Arc::get_mut(&mut material.properties) {
            Some(properties) => properties.draw_functions.retain(|(label, _)| *label != forward),
            None => warn_once!(
                "a deferred alpha-masked material is shared and stays drawn twice: it may lack direct light"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lacking_limits_are_named() {
        let needed = GiPlugin::required_limits();
        assert!(lacking_limits(&needed).is_empty());
        let less = WgpuLimits {
            max_storage_buffers_per_shader_stage: needed.max_storage_buffers_per_shader_stage - 1,
            max_uniform_buffer_binding_size: needed.max_uniform_buffer_binding_size - 1,
            ..needed
        };
        assert_eq!(
            lacking_limits(&less),
            ["max_storage_buffers_per_shader_stage", "max_uniform_buffer_binding_size"]
        );
    }
}
