//! Further bounces: light that surfaces reflect a second time and more.
//!
//! Points on all surfaces of the scene represent pieces of them, as in radiosity: *patches*. When
//! the maps are rendered, bounce VPLs, sampled by flux and by importance to the patches, light each
//! patch, and so does the camera's sky. The reflected flux becomes a texel behind those of the maps
//! and of emissive surfaces, and is weighted, sampled, gathered, shadowed and denoised like theirs.
//! Each further bounce repeats this (Jacobi iteration of the radiosity equation: Goral et al.
//! 1984).
//!
//! | file | world | job |
//! |---|---|---|
//! | `patch` | none | a patch as the GPU reads it |
//! | `choice` | none | selects the points that become patches |
//! | `patches` | main | keeps every camera's patches: points of all surfaces, denser near the camera |
//! | `camera` | render | a camera's buffers, and whether its patches are due to reflect again |
//! | `pick.wgsl`, `reflect.wgsl` | render | importance points of the patches; reflection by the patches |
//!
//! Options: (1) this; (2) maps' texels that gather light from each other, which leaves all surfaces
//! dark that no light illuminates directly: a ceiling, or a room's shady half; (3) rays from
//! visible surfaces to their hits on others (Segovia et al. 2006, "Bidirectional Instant
//! Radiosity"), which concentrates on visible surfaces, but finds other points whenever the camera
//! moves, and would need materials in the tree of triangles. We use 1.

mod camera;
mod choice;
mod patch;
mod patches;

use std::sync::atomic::Ordering;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::{AssetEventSystems, Handle, embedded_asset, load_embedded_asset};
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::platform::collections::HashMap;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render};
use bevy::shader::{Shader, load_shader_library};
use bevy::transform::TransformSystems;
use bevy::utils::default;

use super::compute::{CameraInputs, bind_group, compute_pass};
use super::schedule::{PassSystems, PrepareSystems, SceneSystems, supported_render_app};
use super::sky::SkyCamera;
use super::texels::{TEXEL_BYTES, TexelRange, TexelStore};
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::{SampleInputs, VplPipelines, VplView};
pub(super) use camera::BOUNCE_VPLS;
pub(crate) use camera::BounceCamera;
pub use camera::GiBouncesState;
pub(super) use patch::Patch;
pub use patches::GiPatches;

/// Patches of a camera. Fewer: blotchier second bounces. More: proportionally more rays, eight per
/// patch.
pub(super) const PATCHES: usize = 2048;

pub(super) struct BouncePlugin;

impl Plugin for BouncePlugin {
    fn build(&self, app: &mut App) {
        load_shader_library!(app, "patch.wgsl");
        embedded_asset!(app, "pick.wgsl");
        embedded_asset!(app, "reflect.wgsl");
        app.init_resource::<GiPatches>()
            .init_resource::<patches::Surfaces>()
            .add_plugins(ExtractResourcePlugin::<GiPatches>::default())
            .add_systems(
                PostUpdate,
                // Reads final transforms, visibility and this frame's asset events.
                patches::update
                    .in_set(SceneSystems::Surfaces)
                    .after(AssetEventSystems)
                    .after(TransformSystems::Propagate)
                    .after(VisibilitySystems::VisibilityPropagate),
            );
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = supported_render_app(app) else { return };
        render_app
            .init_gpu_resource::<BouncePipelines>()
            .add_systems(
                Render,
                (
                    reserve.in_set(PrepareSystems::Reserve),
                    camera::prepare.in_set(PrepareSystems::Bounces),
                ),
            )
            .add_systems(Core3d, reflect.in_set(PassSystems::Bounces));
    }
}

fn reserve(mut store: ResMut<TexelStore>, patches: Res<GiPatches>) {
    store.reserve(TexelRange::Patches, patches.texel_count());
}

/// Key of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct ReflectKind {
    /// Whether the camera's sky lights patches.
    has_sky: bool,
    /// Whether rays test alpha masks.
    has_masks: bool,
    is_lambertian: bool,
}

/// Layouts of the passes, and pipelines, which are queued once a camera needs them.
#[derive(Resource)]
pub(super) struct BouncePipelines {
    pick_layout: BindGroupLayoutDescriptor,
    /// Without a sky and with one.
    reflect_layouts: [BindGroupLayoutDescriptor; 2],
    pick_shader: Handle<Shader>,
    reflect_shader: Handle<Shader>,
    pick: Option<CachedComputePipelineId>,
    reflect: HashMap<ReflectKind, CachedComputePipelineId>,
}

impl FromWorld for BouncePipelines {
    fn from_world(world: &mut World) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let write = || storage_buffer_sized(false, None);
        let uniform = || uniform_buffer_sized(false, None);
        let compute = ShaderStages::COMPUTE;
        let pick = BindGroupLayoutEntries::sequential(compute, (read(), write()));
        let view = uniform_buffer::<ViewUniform>(true);
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (view, uniform(), uniform(), read(), write()),
        );
        let with_sky = BindGroupLayoutEntries::sequential(
            compute,
            (view, uniform(), uniform(), read(), write(), read(), read()),
        );
        Self {
            pick_layout: BindGroupLayoutDescriptor::new("bevy_frugal_gi/bounces/pick", &pick),
            reflect_layouts: [
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/bounces/reflect", &without_sky),
                BindGroupLayoutDescriptor::new("bevy_frugal_gi/bounces/reflect/sky", &with_sky),
            ],
            pick_shader: load_embedded_asset!(world, "pick.wgsl"),
            reflect_shader: load_embedded_asset!(world, "reflect.wgsl"),
            pick: None,
            reflect: default(),
        }
    }
}

impl BouncePipelines {
    /// The pipeline of a kind, if it is compiled; until then, the one that treats all triangles as
    /// solid.
    fn get<'a>(&self, cache: &'a PipelineCache, kind: ReflectKind) -> Option<&'a ComputePipeline> {
        let compiled = |kind| cache.get_compute_pipeline(*self.reflect.get(&kind)?);
        compiled(kind).or_else(|| compiled(ReflectKind { has_masks: false, ..kind }))
    }

    /// Queues the pipelines of a kind, unless they were queued before.
    fn queue(&mut self, cache: &PipelineCache, kind: ReflectKind) {
        let Self { pick_layout, reflect_layouts, pick_shader, reflect_shader, pick, reflect } =
            self;
        pick.get_or_insert_with(|| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some("bevy_frugal_gi/bounces/pick".into()),
                layout: vec![pick_layout.clone()],
                shader: pick_shader.clone(),
                entry_point: Some("pick_patches".into()),
                ..default()
            })
        });
        reflect.entry(kind).or_insert_with(|| {
            let ReflectKind { has_sky, has_masks, is_lambertian } = kind;
            let definitions =
                [(has_sky, "SKY"), (has_masks, "MASKS"), (is_lambertian, "LAMBERTIAN")];
            let shader_defs = definitions
                .into_iter()
                .filter(|(is_so, _)| *is_so)
                .map(|(_, name)| name.into())
                .collect();
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/bounces/reflect/{kind:?}").into()),
                layout: vec![
                    reflect_layouts[usize::from(has_sky)].clone(),
                    OccluderBuffers::layout(),
                ],
                shader: reflect_shader.clone(),
                shader_defs,
                entry_point: Some("reflect_patches".into()),
                ..default()
            })
        });
    }
}

/// In a GI camera's view: lights its patches, once for each bounce beyond the first.
pub(super) fn reflect(
    view: ViewQuery<(
        &BounceCamera,
        &GiView,
        &VplView,
        Option<&SkyCamera>,
        &ViewPrepassTextures,
        &ViewUniformOffset,
    )>,
    pipelines: Res<BouncePipelines>,
    vpl_pipelines: Res<VplPipelines>,
    store: Res<TexelStore>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, gi_view, vpl_view, sky, prepass, view_offset) = view.into_inner();
    // What samples again has the weights of its texels as they were.
    if !gi_view.work.sample || gi_view.work.samples_again() || !camera.is_due {
        return;
    }
    let ready = |id: Option<&CachedComputePipelineId>| cache.get_compute_pipeline(*id?);
    let (Some(pick), Some(reflect)) =
        (ready(pipelines.pick.as_ref()), pipelines.get(&cache, camera.kind))
    else {
        return;
    };
    let (Some(texels), Some(traced), Some(buffers)) =
        (&store.texels, occluders.bind_group(), &vpl_view.sampling)
    else {
        return;
    };
    // The layout of the weights has the G-buffer and depth; they are not read here.
    let Some(inputs) = CameraInputs::new(prepass, &view_uniforms) else { return };
    let views = inputs.views.clone();
    let inputs = SampleInputs {
        camera: inputs,
        view_offset: view_offset.offset,
        texels,
        buffers,
        importance: &camera.importance,
        vpls: &camera.bounce_vpls,
        plan: (&camera.plan, BOUNCE_VPLS.slots()),
    };
    // Tile visibility for patches would take as many rays as for the image, without a measurable
    // gain.
    let Some(steps) = vpl_pipelines.steps(&context, &cache, false, inputs) else {
        return;
    };
    let sky = sky.filter(|_| camera.kind.has_sky);
    let picking = bind_group(
        &context,
        &cache,
        &pipelines.pick_layout,
        &BindGroupEntries::sequential((
            camera.patches.as_entire_binding(),
            camera.importance.as_entire_binding(),
        )),
    );
    let entries = DynamicBindGroupEntries::sequential((
        views,
        camera.bounce_vpls.as_entire_binding(),
        camera.range.as_entire_binding(),
        camera.patches.as_entire_binding(),
        texels.as_entire_binding(),
    ));
    let entries = match sky {
        Some(sky) => entries.extend_sequential((
            sky.samples.as_entire_binding(),
            sky.plan_buffer.as_entire_binding(),
        )),
        None => entries,
    };
    let layout = &pipelines.reflect_layouts[usize::from(sky.is_some())];
    let reflecting = bind_group(&context, &cache, layout, &entries);
    // In the first round patches emit nothing yet.
    let first_byte = u64::from(camera.first_texel()) * TEXEL_BYTES;
    let clear = (texels, first_byte, Some(PATCHES as u64 * TEXEL_BYTES));
    compute_pass(&mut context, "bevy_frugal_gi/bounces", &[clear], |pass| {
        pass.set_bind_group(0, &picking, &[]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        for _ in 0..camera.rounds() {
            steps.weigh(pass);
            steps.sample(pass);
            pass.set_bind_group(0, &reflecting, &[view_offset.offset]);
            pass.set_bind_group(1, traced, &[]);
            pass.set_pipeline(reflect);
            pass.dispatch_workgroups(PATCHES.div_ceil(64) as u32, 1, 1);
        }
    });
    camera.is_done.store(true, Ordering::Relaxed);
}
