//! The pass that sums, for each pixel, the phasors of direct light and of the camera's VPLs.

use bevy::asset::RenderAssetUsages;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::math::DVec2;
use bevy::prelude::*;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d,
    uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, RenderApp};
use bevy_frugal_gi::gi::{GiSystems, inspect};
use frugal_trace::integrator::View;
use frugal_trace::time::{Capture, SPEED_OF_LIGHT, TimeError};

/// 32-bit floats of a pixel: `Phasors` of the shader.
const FLOATS: usize = 6;

/// The sensor of every camera with global illumination, of which there should be one.
#[derive(Resource, ExtractResource, Clone)]
pub(crate) struct Sensor {
    /// Modulation, hertz.
    pub(crate) frequency: f64,
    /// Luminous intensity of the light at the eye, candela.
    pub(crate) intensity: f32,
    /// What [`capture`] reads. Zeros until the pass has run.
    pub(crate) pixels: Handle<ShaderBuffer>,
}

impl Sensor {
    /// A sensor for an image of `size` pixels.
    pub(crate) fn new(
        frequency: f64,
        intensity: f32,
        size: UVec2,
        buffers: &mut Assets<ShaderBuffer>,
    ) -> Self {
        let zeros = vec![0; size.element_product() as usize * FLOATS * size_of::<f32>()];
        let buffer = ShaderBuffer::new(&zeros, RenderAssetUsages::RENDER_WORLD);
        Self { frequency, intensity, pixels: buffers.add(buffer) }
    }
}

/// What the bytes of a sensor's pixels say, in nits and metres.
///
/// # Errors
/// When the frequency is not above 0, or the bytes are not of `view`'s pixels.
pub(crate) fn capture(view: &View, frequency: f64, bytes: &[u8]) -> Result<Capture, TimeError> {
    let floats: Vec<f64> = bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|bytes| f64::from(f32::from_le_bytes(*bytes)))
        .collect();
    let pixels = floats.as_chunks::<FLOATS>().0;
    let direct: Vec<DVec2> = pixels.iter().map(|[x, y, ..]| DVec2::new(*x, *y)).collect();
    let all = pixels.iter().map(|[x, y, u, v, ..]| DVec2::new(x + u, y + v)).collect();
    let distances = pixels.iter().map(|pixel| Some(pixel[4]).filter(|metres| *metres > 0.0));
    Capture::new(view, frequency, [all, direct], distances.collect())
}

/// Runs the pass where there is a [`Sensor`]. Add it after `FrugalGiPlugins`.
pub(crate) struct PhasorPlugin;

impl Plugin for PhasorPlugin {
    fn build(&self, app: &mut App) {
        app.add_plugins(ExtractResourcePlugin::<Sensor>::default());
        let source = Shader::from_wgsl(include_str!("phasors.wgsl"), "phasors.wgsl");
        let shader = app.world_mut().resource_mut::<Assets<Shader>>().add(source);
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(PhasorShader(shader))
            .init_gpu_resource::<Kernel>()
            .add_systems(Core3d, sum.after(GiSystems::Gather).before(Core3dSystems::MainPass));
    }
}

#[derive(Resource)]
struct PhasorShader(Handle<Shader>);

#[derive(Resource)]
struct Kernel {
    /// Of its own bindings, and of the occluders.
    layouts: [BindGroupLayoutDescriptor; 2],
    pipeline: CachedComputePipelineId,
}

impl FromWorld for Kernel {
    fn from_world(world: &mut World) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let own = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer::<ViewUniform>(true),
                read(),
                read(),
                storage_buffer_sized(false, None),
            ),
        );
        let occluders = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (read(), read(), read(), read()),
        );
        let layouts = [&own[..], &occluders[..]]
            .map(|entries| BindGroupLayoutDescriptor::new("time_of_flight", entries));
        let pipeline =
            world.resource::<PipelineCache>().queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some("time_of_flight".into()),
                layout: layouts.to_vec(),
                shader: world.resource::<PhasorShader>().0.clone(),
                // Reflection of the pixel alone; that of the VPLs follows the camera's settings.
                shader_defs: vec!["LAMBERTIAN".into()],
                entry_point: Some("sum_phasors".into()),
                ..default()
            });
        Self { layouts, pipeline }
    }
}

/// In each view: nothing, unless it is the camera's.
fn sum(
    world: &World,
    view: ViewQuery<(&MainEntity, &ViewPrepassTextures, &ViewUniformOffset)>,
    mut context: RenderContext,
) {
    let (camera, prepass, offset) = view.into_inner();
    let Some(sensor) = world.get_resource::<Sensor>() else { return };
    let (kernel, cache) = (world.resource::<Kernel>(), world.resource::<PipelineCache>());
    let state = inspect::gpu_state(world);
    let gathering = state.cameras.iter().find(|own| own.camera == camera.id());
    let (Some(own), Some(occluders), Some(pixels), Some(pipeline)) = (
        gathering,
        &state.occluders,
        world.resource::<RenderAssets<GpuShaderBuffer>>().get(&sensor.pixels),
        cache.get_compute_pipeline(kernel.pipeline),
    ) else {
        return;
    };
    let (Some(g_buffer), Some(depth), Some(views)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        world.resource::<ViewUniforms>().uniforms.binding(),
    ) else {
        return;
    };
    let turns_per_metre = (sensor.frequency / SPEED_OF_LIGHT) as f32;
    let floats = [turns_per_metre, sensor.intensity].map(f32::to_bits);
    let words = [floats, [own.sets, own.per_set]].concat();
    let device = context.render_device().clone();
    let settings = device.create_buffer_with_data(&BufferInitDescriptor {
        label: Some("time_of_flight/sensor"),
        contents: &words.into_iter().flat_map(u32::to_le_bytes).collect::<Vec<u8>>(),
        usage: BufferUsages::STORAGE,
    });
    let entries = BindGroupEntries::sequential((
        g_buffer,
        depth,
        views,
        own.vpls.as_entire_binding(),
        settings.as_entire_binding(),
        pixels.buffer.as_entire_binding(),
    ));
    let [a, b, c, d] = occluders.each_ref().map(|buffer| buffer.as_entire_binding());
    let traced = BindGroupEntries::sequential((a, b, c, d));
    let bind = |index: usize, entries: &[BindGroupEntry]| {
        let layout = cache.get_bind_group_layout(&kernel.layouts[index]);
        device.create_bind_group("time_of_flight", &layout, entries)
    };
    let groups = [bind(0, &entries), bind(1, &traced)];
    let count = pixels.buffer.size() / (FLOATS * size_of::<f32>()) as u64;
    let descriptor =
        ComputePassDescriptor { label: Some("time_of_flight"), timestamp_writes: None };
    let mut pass = context.command_encoder().begin_compute_pass(&descriptor);
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, &groups[0], &[offset.offset]);
    pass.set_bind_group(1, &groups[1], &[]);
    pass.dispatch_workgroups(count.div_ceil(64) as u32, 1, 1);
}
