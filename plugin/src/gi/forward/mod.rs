//! Indirect light on meshes that are not deferred: forward-rendered, transparent and transmissive ones.
//!
//! A grid of places around the camera, fixed in the world, keeps the irradiance of six directions
//! (an ambient cube: Mitchell, `McTaggart` and Green 2006, "Shading in Valve's Source Engine"). Each
//! frame lights some of the places by the camera's VPLs and its sky, with rays. Bevy shades forward
//! meshes from them as from a baked irradiance volume, so that every material that Bevy lights
//! takes part. Deferred lighting would read the volume, too: it stays black until the composite is
//! done.
//!
//! A place inside a solid sees the back of a triangle before a front. It shows the mean of its
//! neighbours outside.
//!
//! | file | world | job |
//! |---|---|---|
//! | `volume` | main | keeps a volume around each camera that draws such meshes |
//! | `view` | render | a camera's buffers, and its work in a frame |
//! | `light.wgsl` | | lights places |
//! | `probe.wgsl` | | what is kept of a place; writes the volume, and blackens it |
//!
//! Places that have converged trace no rays while nothing changes.

mod view;
mod volume;

use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::prelude::*;
use bevy::render::extract_component::ExtractComponentPlugin;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    texture_storage_3d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy::shader::{ShaderDefVal, load_shader_library};

use super::compute::{Kernel, compute_pass, definitions, drop_with, read, write};
use super::schedule::{GiSystems, PassSystems, SceneSystems, is_not_off};
use super::settings::FrugalGi;
use super::sky::SkyCamera;
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::VplView;
pub(super) use view::{ForwardView, LOOKS, PROBE_BYTES, RAYS, VolumeSettings, prepare};
pub(super) use volume::{ForwardCamera, PLACES};

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "probe.wgsl");
    embedded_asset!(app, "light.wgsl");
    app.init_resource::<volume::ForwardDrawn>()
        .add_plugins(ExtractComponentPlugin::<ForwardCamera>::default())
        .add_observer(drop_with::<FrugalGi, ForwardCamera>)
        .add_observer(volume::despawn)
        .add_systems(
            PostUpdate,
            (
                volume::place.in_set(SceneSystems::Maps),
                volume::show_to_its_camera
                    .after(VisibilitySystems::CheckVisibility)
                    .run_if(is_not_off),
            ),
        );
}

pub(super) fn finish(app: &mut App) {
    let drawn = app.world().resource::<volume::ForwardDrawn>().clone();
    app.sub_app_mut(RenderApp)
        .insert_resource(drawn)
        .init_gpu_resource::<ForwardKernels>()
        .add_observer(drop_with::<GiView, ForwardView>)
        .add_systems(Render, volume::note_drawn.in_set(RenderSystems::PhaseSort))
        .add_systems(
            Core3d,
            (
                light.in_set(PassSystems::Forward),
                fill.in_set(Core3dSystems::MainPass)
                    .after(GiSystems::Composite)
                    .before(main_opaque_pass_3d),
            ),
        );
}

/// The pipelines. They are queued once a camera has a volume.
#[derive(Resource)]
pub(super) struct ForwardKernels {
    light: Kernel,
    sky: Kernel,
    fill: Kernel,
    blacken: Kernel,
}

impl FromWorld for ForwardKernels {
    fn from_world(world: &mut World) -> Self {
        let compute = ShaderStages::COMPUTE;
        let volume = volume_uniform;
        let view = uniform_buffer::<ViewUniform>(true);
        let lit =
            BindGroupLayoutEntries::sequential(compute, (volume(), write(), read(), read(), view));
        let lit_by_sky =
            BindGroupLayoutEntries::sequential(compute, (volume(), write(), read(), read()));
        let (light, fill) =
            (load_embedded_asset!(world, "light.wgsl"), load_embedded_asset!(world, "probe.wgsl"));
        let traced = |label, entries: &[BindGroupLayoutEntry]| {
            let kernel = Kernel::new(label, "light_probes", &light, entries);
            kernel.with_group(OccluderBuffers::layout())
        };
        Self {
            light: traced("frugal_gi/forward/light", &lit),
            sky: traced("frugal_gi/forward/sky", &lit_by_sky),
            fill: places_kernel("frugal_gi/forward/fill", "fill", &fill),
            blacken: places_kernel("frugal_gi/forward/blacken", "blacken", &fill),
        }
    }
}

/// Definitions of what lights places.
fn light_variant(by_sky: bool) -> Vec<ShaderDefVal> {
    definitions([(by_sky, "SKY"), (!by_sky, "FACING")])
}

/// A camera's [`VolumeSettings`] in a layout.
pub(super) fn volume_uniform() -> BindGroupLayoutEntryBuilder {
    uniform_buffer_sized(false, BufferSize::new(size_of::<VolumeSettings>() as u64))
}

/// A kernel that [`write_places`] runs.
pub(super) fn places_kernel(
    label: &'static str,
    entry_point: &'static str,
    shader: &Handle<Shader>,
) -> Kernel {
    let texels = texture_storage_3d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
    let entries = (volume_uniform(), read(), texels);
    let entries = BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, entries);
    Kernel::new(label, entry_point, shader, &entries)
}

/// Writes a texture of a camera's places: one thread for each.
pub(super) fn write_places(
    context: &mut RenderContext,
    name: &'static str,
    (kernel, pipeline): (&Kernel, &ComputePipeline),
    cache: &PipelineCache,
    forward: &ForwardView,
    texture: &TextureView,
) {
    let entries = BindGroupEntries::sequential((
        forward.settings_buffer.as_entire_binding(),
        forward.probes.as_entire_binding(),
        texture,
    ));
    let bind_group = kernel.bind(context, cache, &entries);
    compute_pass(context, name, &[], |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        let groups = PLACES / 4;
        pass.dispatch_workgroups(groups.x, groups.y, groups.z);
    });
}

/// Queues the pipelines of cameras that have a volume.
pub(super) fn prepare_pipelines(
    mut kernels: ResMut<ForwardKernels>,
    cache: Res<PipelineCache>,
    cameras: Query<Has<SkyCamera>, With<ForwardCamera>>,
) {
    for has_sky in &cameras {
        kernels.fill.queue(&cache, Vec::new());
        kernels.blacken.queue(&cache, Vec::new());
        kernels.light.queue(&cache, light_variant(false));
        if has_sky {
            kernels.sky.queue(&cache, light_variant(true));
        }
    }
}

/// In a GI camera's view: lights some places around it, and blackens its volume for deferred lighting.
fn light(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &ForwardView,
        &ForwardCamera,
        &ViewUniformOffset,
        Option<&SkyCamera>,
    )>,
    kernels: Res<ForwardKernels>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, forward, camera, view_offset, sky) = view.into_inner();
    write_volume(&kernels.blacken, &cache, &images, forward, camera, &mut context);
    let (Some(views), Some(light), Some(traced_group)) = (
        view_uniforms.uniforms.binding(),
        kernels.light.get(&cache, &light_variant(false)),
        occluders.bind_group(),
    ) else {
        return;
    };
    if forward.lit() == 0 {
        return;
    }
    let (settings, probes) =
        (forward.settings_buffer.as_entire_binding(), forward.probes.as_entire_binding());
    let lighting = kernels.light.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            settings.clone(),
            probes.clone(),
            vpl.vpls.as_entire_binding(),
            vpl.plan_buffer.as_entire_binding(),
            views,
        )),
    );
    let by_sky = sky.filter(|_| view.sky_samples > 0).and_then(|sky| {
        let pipeline = kernels.sky.get(&cache, &light_variant(true))?;
        let samples = sky.samples.as_entire_binding();
        let plan = vpl.plan_buffer.as_entire_binding();
        let entries = BindGroupEntries::sequential((settings, probes, samples, plan));
        Some((pipeline, kernels.sky.bind(&context, &cache, &entries)))
    });
    let clears = [(&forward.probes, 0, None)];
    let clears = if forward.begins { &clears[..] } else { &[] };
    compute_pass(&mut context, "frugal_gi/forward", clears, |pass| {
        let groups = forward.lit().div_ceil(64);
        pass.set_bind_group(1, traced_group, &[]);
        pass.set_pipeline(light);
        pass.set_bind_group(0, &lighting, &[view_offset.offset]);
        pass.dispatch_workgroups(groups, 1, 1);
        if let Some((pipeline, bind_group)) = &by_sky {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[]);
            pass.dispatch_workgroups(groups, 1, 1);
        }
    });
}

/// In a GI camera's view, after deferred lighting and before other meshes: fills its volume.
fn fill(
    view: ViewQuery<(&ForwardView, &ForwardCamera)>,
    kernels: Res<ForwardKernels>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    mut context: RenderContext,
) {
    let (forward, camera) = view.into_inner();
    // What is not blackened in the next frame would light deferred meshes, too.
    if kernels.blacken.get(&cache, &[]).is_some() {
        write_volume(&kernels.fill, &cache, &images, forward, camera, &mut context);
    }
}

fn write_volume(
    kernel: &Kernel,
    cache: &PipelineCache,
    images: &RenderAssets<GpuImage>,
    forward: &ForwardView,
    camera: &ForwardCamera,
    context: &mut RenderContext,
) {
    let (Some(pipeline), Some(image)) = (kernel.get(cache, &[]), images.get(camera.image)) else {
        return;
    };
    let (name, texture) = ("frugal_gi/forward/volume", &image.texture_view);
    write_places(context, name, (kernel, pipeline), cache, forward, texture);
}
