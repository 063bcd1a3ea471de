//! The passes that light places and write the volume.

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    texture_storage_3d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::ShaderDefVal;

use super::view::{ForwardView, VolumeSettings};
use super::volume::{ForwardCamera, PLACES};
use crate::gi::compute::{Kernel, compute_pass, definitions, read, write};
use crate::gi::sky::SkyCamera;
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::GiView;
use crate::gi::vpl::VplView;

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
        let volume =
            || uniform_buffer_sized(false, BufferSize::new(size_of::<VolumeSettings>() as u64));
        let view = uniform_buffer::<ViewUniform>(true);
        let lit =
            BindGroupLayoutEntries::sequential(compute, (volume(), write(), read(), read(), view));
        let lit_by_sky =
            BindGroupLayoutEntries::sequential(compute, (volume(), write(), read(), read()));
        let voxels =
            texture_storage_3d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly);
        let filled = BindGroupLayoutEntries::sequential(compute, (volume(), read(), voxels));
        let light = load_embedded_asset!(world, "light.wgsl");
        let fill = load_embedded_asset!(world, "fill.wgsl");
        let traced = |label, entries: &[BindGroupLayoutEntry]| {
            Kernel::new(label, "light_probes", &light, entries)
                .with_group(OccluderBuffers::layout())
        };
        Self {
            light: traced("frugal_gi/forward/light", &lit),
            sky: traced("frugal_gi/forward/sky", &lit_by_sky),
            fill: Kernel::new("frugal_gi/forward/fill", "fill", &fill, &filled),
            blacken: Kernel::new("frugal_gi/forward/blacken", "blacken", &fill, &filled),
        }
    }
}

fn lit(has_masks: bool) -> Vec<ShaderDefVal> {
    definitions([(true, "FACING"), (has_masks, "MASKS")])
}

fn lit_by_sky(has_masks: bool) -> Vec<ShaderDefVal> {
    definitions([(true, "SKY"), (has_masks, "MASKS")])
}

/// Queues the pipelines of cameras that have a volume.
pub(super) fn prepare_pipelines(
    mut kernels: ResMut<ForwardKernels>,
    cache: Res<PipelineCache>,
    occluders: Res<OccluderBuffers>,
    cameras: Query<Has<SkyCamera>, With<ForwardCamera>>,
) {
    for has_sky in &cameras {
        kernels.fill.queue(&cache, Vec::new());
        kernels.blacken.queue(&cache, Vec::new());
        for has_masks in [false, occluders.are_masked()] {
            kernels.light.queue(&cache, lit(has_masks));
            if has_sky {
                kernels.sky.queue(&cache, lit_by_sky(has_masks));
            }
        }
    }
}

/// A kernel's pipeline, if it is compiled: that which tests masks, or until then the one that treats
/// all triangles as solid.
fn traced<'a>(
    kernel: &Kernel,
    cache: &'a PipelineCache,
    definitions: fn(bool) -> Vec<ShaderDefVal>,
    has_masks: bool,
) -> Option<&'a ComputePipeline> {
    kernel.get(cache, &definitions(has_masks)).or_else(|| kernel.get(cache, &definitions(false)))
}

/// In a GI camera's view: lights some places around it, and blackens its volume for deferred lighting.
pub(super) fn light(
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
    let has_masks = occluders.are_masked();
    let (Some(views), Some(light), Some(traced_group)) = (
        view_uniforms.uniforms.binding(),
        traced(&kernels.light, &cache, lit, has_masks),
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
        let pipeline = traced(&kernels.sky, &cache, lit_by_sky, has_masks)?;
        let samples = sky.samples.as_entire_binding();
        let plan = sky.plan_buffer.as_entire_binding();
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
pub(super) fn fill(
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
    let entries = BindGroupEntries::sequential((
        forward.settings_buffer.as_entire_binding(),
        forward.probes.as_entire_binding(),
        &image.texture_view,
    ));
    let bind_group = kernel.bind(context, cache, &entries);
    compute_pass(context, "frugal_gi/forward/volume", &[], |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        let groups = PLACES / 4;
        pass.dispatch_workgroups(groups.x, groups.y, groups.z);
    });
}
