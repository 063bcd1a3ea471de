//! Global illumination: bounces from virtual point lights sampled in reflective shadow maps, and
//! light of glowing surfaces and of the sky.
//!
//! Dachsbacher and Stamminger 2005 ("Reflective Shadow Maps") for where light arrives, Keller 1997
//! ("Instant Radiosity") for how it goes on. Data flows one way:
//!
//! | folder | world | job |
//! |---|---|---|
//! | [`rsm`](self) | main | keeps a hidden camera per light (and per cube face, and per GI camera for directional lights) |
//! | `rsm` | render | turns each such camera's G-buffer into texels of position, normal and reflected flux |
//! | `surfaces` | main | reads what meshes and materials say of surfaces that no picture shows |
//! | `refresh` | main | decides which of this a frame has to do again |
//! | `sources` | both | adds texels of glowing surfaces, and draws samples of the sky |
//! | `bounces` | both | lights patches of the scene's surfaces, whose reflected light joins the texels |
//! | `vpl` | render | draws every GI camera's virtual point lights from all texels |
//! | `visibility` | both | keeps the scene's triangles in a tree on the GPU, for rays between surfaces and VPLs |
//! | `gather` | render | sums the VPLs at a share of the camera's pixels |
//! | `filter` | render | joins what neighbouring pixels found with different VPLs and rays |
//! | `composite` | render | interpolates along surfaces and adds the reflected light before tone mapping |

mod bounces;
mod composite;
mod cut;
mod diagnostics;
mod filter;
mod gather;
pub mod inspect;
mod masks;
mod presence;
mod refresh;
mod rsm;
mod settings;
mod sources;
mod surfaces;
mod visibility;
mod vpl;

use bevy::app::{App, Plugin};
use bevy::asset::embedded_asset;
use bevy::camera::Camera3d;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::prepass::DeferredPrepass;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::prelude::*;
use bevy::log::warn;
use bevy::pbr::deferred::deferred_lighting;
use bevy::pbr::{DefaultOpaqueRendererMethod, main_transmissive_pass_3d};
use bevy::render::extract_component::{ExtractComponentPlugin, UniformComponentPlugin};
use bevy::render::renderer::RenderDevice;
use bevy::render::view::Msaa;
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy::shader::load_shader_library;

pub use bounces::GiPatches;
pub use cut::CameraCut;
pub use diagnostics::{GI_DIAGNOSTICS, GiCounts};
pub use refresh::GiRefresh;
pub use rsm::RsmView;
pub use settings::{
    FrugalGi, GiInterleave, GiLimits, GiOutput, GiPixelFraction, GiShading, GiVisibility,
};
pub use sources::GiEmitters;
pub use visibility::GiOccluders;

/// Where GI's passes lie in the `Core3d` schedule, for those who must order theirs.
#[derive(SystemSet, Clone, Debug, PartialEq, Eq, Hash)]
pub enum GiSystems {
    /// In a light's own view: its G-buffer becomes texels. After the prepass, before the main pass.
    Resolve,
    /// In a GI camera's view: VPLs are drawn and gathered. After the prepass, before the main pass.
    Gather,
    /// In a GI camera's view: indirect light is added to the picture. After opaque meshes, before
    /// transmissive and transparent ones.
    Composite,
}

/// Adds [`FrugalGi`] to an app, and makes deferred rendering its default.
///
/// Every `Camera3d` then gets a `DeferredPrepass`: without one, Bevy draws no deferred mesh to a
/// camera that has no prepass, and panics at one that has another prepass.
#[derive(Clone, Debug, Default)]
pub struct GiPlugin;

impl Plugin for GiPlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "luminance.wgsl");
        load_shader_library!(app, "surface.wgsl");
        load_shader_library!(app, "rsm/texel.wgsl");
        load_shader_library!(app, "bounces/patch.wgsl");
        load_shader_library!(app, "vpl/vpl.wgsl");
        load_shader_library!(app, "vpl/hand.wgsl");
        load_shader_library!(app, "vpl/plan.wgsl");
        load_shader_library!(app, "vpl/rows.wgsl");
        load_shader_library!(app, "vpl/receivers.wgsl");
        load_shader_library!(app, "gather/settings.wgsl");
        load_shader_library!(app, "visibility/trace.wgsl");
        load_shader_library!(app, "sources/sky.wgsl");
        embedded_asset!(app, "rsm/resolve.wgsl");
        embedded_asset!(app, "vpl/see.wgsl");
        embedded_asset!(app, "vpl/weigh.wgsl");
        embedded_asset!(app, "vpl/sample.wgsl");
        embedded_asset!(app, "sources/sky_fill.wgsl");
        embedded_asset!(app, "sources/sky_weigh.wgsl");
        embedded_asset!(app, "sources/sky_draw.wgsl");
        embedded_asset!(app, "bounces/pick.wgsl");
        embedded_asset!(app, "bounces/reflect.wgsl");
        embedded_asset!(app, "gather/gather.wgsl");
        embedded_asset!(app, "filter/filter.wgsl");
        embedded_asset!(app, "filter/settle.wgsl");
        embedded_asset!(app, "composite/composite.wgsl");

        app.insert_resource(DefaultOpaqueRendererMethod::deferred())
            .init_resource::<GiLimits>()
            .register_type::<FrugalGi>()
            .register_type::<GiLimits>()
            .register_type::<RsmView>();
        // Required components cover cameras that are spawned later, too; it must be said before the
        // first camera.
        if app.try_register_required_components::<Camera3d, DeferredPrepass>().is_err() {
            warn!(
                "a Camera3d was spawned before GiPlugin was added, or already requires a DeferredPrepass: give every Camera3d one"
            );
        }
        app.add_plugins((
            ExtractComponentPlugin::<FrugalGi>::default(),
            ExtractComponentPlugin::<RsmView>::default(),
            ExtractComponentPlugin::<rsm::RsmLight>::default(),
            ExtractComponentPlugin::<rsm::RsmCut>::default(),
            ExtractComponentPlugin::<GiShading>::default(),
            UniformComponentPlugin::<rsm::RsmLight>::default(),
        ));
        // A camera that comes with multisampling keeps it in spite of the requirement: Bevy would
        // switch it off with a warning in each frame.
        app.add_observer(|added: On<Add, FrugalGi>, mut commands: Commands| {
            commands.entity(added.entity).insert(Msaa::Off);
        });
        cut::build(app);
        rsm::build(app);
        refresh::build(app);
        visibility::build(app);
        sources::build(app);
        bounces::build(app);
    }

    fn finish(&self, app: &mut App) {
        crate::pipelines::finish(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        // With or without light that bounces, since cameras are deferred.
        render_app.add_systems(Render, masks::draw_once.in_set(RenderSystems::Specialize));
        let Some(device) = render_app.world().get_resource::<RenderDevice>() else { return };
        let lacking = lacking_limits(&device.limits());
        if !lacking.is_empty() {
            warn!("global illumination stays off: this GPU lacks {}", lacking.join(", "));
            return;
        }
        let counts = diagnostics::build(app);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(counts)
            .init_resource::<diagnostics::GiCounts>()
            .init_gpu_resource::<rsm::RsmPipelines>()
            .init_gpu_resource::<rsm::RsmStore>()
            .init_gpu_resource::<vpl::VplPipelines>()
            .init_gpu_resource::<visibility::OccluderBuffers>()
            .init_gpu_resource::<sources::SkyPipelines>()
            .init_gpu_resource::<sources::BlackCubes>()
            .init_gpu_resource::<bounces::BouncePipelines>()
            .init_gpu_resource::<gather::GatherPipelines>()
            .init_gpu_resource::<filter::FilterPipelines>()
            .init_gpu_resource::<composite::CompositePipelines>()
            .configure_sets(
                Core3d,
                (
                    (GiSystems::Resolve, GiSystems::Gather)
                        .chain()
                        .after(Core3dSystems::Prepass)
                        .before(Core3dSystems::MainPass),
                    // Need the opaque pass to be over: what is rendered forward in it covers what
                    // is deferred.
                    GiSystems::Composite
                        .in_set(Core3dSystems::MainPass)
                        .after(deferred_lighting)
                        .after(main_opaque_pass_3d)
                        .before(main_transmissive_pass_3d)
                        .before(main_transparent_pass_3d),
                ),
            )
            .add_systems(ExtractSchedule, sources::extract_sources)
            .add_systems(
                Render,
                (
                    rsm::drop_main_phases.in_set(RenderSystems::CreateViews),
                    (
                        rsm::prepare_store,
                        sources::upload_emitters,
                        visibility::prepare_buffers,
                        sources::prepare_skies,
                        bounces::prepare_bounces,
                        gather::prepare_cameras,
                        gather::prepare_pipelines,
                        // Need to know whose sky is gathered in this frame, before Bevy binds the
                        // maps.
                        sources::take_out_diffuse,
                    )
                        .chain()
                        .in_set(RenderSystems::PrepareResources),
                    composite::prepare_pipelines.in_set(RenderSystems::Prepare),
                    diagnostics::count
                        .in_set(RenderSystems::PrepareBindGroups)
                        .after(gather::prepare_cameras),
                ),
            )
            .add_systems(
                Core3d,
                (
                    rsm::resolve.in_set(GiSystems::Resolve),
                    (
                        sources::sample_sky,
                        bounces::reflect,
                        vpl::sample,
                        gather::gather,
                        filter::filter,
                    )
                        .chain()
                        .in_set(GiSystems::Gather),
                    composite::composite.in_set(GiSystems::Composite),
                ),
            );
    }
}

/// Names of the limits that GI needs and the device is short of.
fn lacking_limits(limits: &bevy::render::settings::WgpuLimits) -> Vec<&'static str> {
    let vpl_bytes = u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * vpl::VPL_BYTES;
    [
        (limits.max_compute_invocations_per_workgroup < 64, "compute workgroups of 64"),
        (limits.max_storage_buffers_per_shader_stage < 8, "8 storage buffers per stage"),
        (limits.max_storage_textures_per_shader_stage < 1, "storage textures"),
        (limits.max_uniform_buffer_binding_size < vpl_bytes, "uniform buffers of 48 KiB"),
    ]
    .into_iter()
    .filter_map(|(lacks, name)| lacks.then_some(name))
    .collect()
}
