//! The pass that compares a part of a camera's image with the same part at the best settings.

use bevy::app::App;
use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::core_pipeline::upscaling::upscaling;
use bevy::ecs::prelude::*;
use bevy::math::{UVec2, Vec2};
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    sampler, storage_buffer_sized, texture_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ViewTarget;
use bevy::render::{GpuResourceAppExt, RenderApp};
use bevy::shader::Shader;
use bevy::utils::default;

use super::ErrorProbe;
use super::tile::{Tile, WINDOW};
use crate::resolution::ScaledView;

/// Windows along a side of a workgroup of `compare.wgsl`.
const GROUP: u32 = 8;

/// On a probe in the frame in which it is compared.
#[derive(Component, ExtractComponent, Clone, Debug)]
pub(super) struct Comparison {
    /// The camera whose image is measured.
    pub camera: Entity,
    pub tile: Tile,
    /// Receives the sums.
    pub sums: Handle<ShaderBuffer>,
}

/// Workgroups that compare a part.
fn groups(tile: &Tile) -> UVec2 {
    (tile.size - (WINDOW - 1)).map(|windows| windows.div_ceil(GROUP))
}

/// Bytes of the sums of a part.
pub(super) fn bytes(tile: &Tile) -> usize {
    groups(tile).element_product() as usize * size_of::<[f32; 2]>()
}

/// 1 − SSIM of a part from its sums; `None` where they are not those of a comparison.
pub(super) fn error(tile: &Tile, sums: &[u8]) -> Option<f64> {
    let values: Vec<[f32; 2]> = bytemuck::pod_collect_to_vec(sums);
    let add = |sum: [f64; 2], value: &[f32; 2]| {
        [sum[0] + f64::from(value[0]), sum[1] + f64::from(value[1])]
    };
    let [error, windows] = values.iter().fold([0.0, 0.0], add);
    let expected = (tile.size - (WINDOW - 1)).as_dvec2().element_product();
    // Rounding leaves equal images slightly off.
    (windows == expected && error.is_finite()).then(|| (error / windows).max(0.0))
}

/// Uniforms of `compare.wgsl`.
#[derive(Clone, Copy, Debug, ShaderType)]
struct ComparedPart {
    origin: Vec2,
    scale: Vec2,
    offset: Vec2,
    size: UVec2,
}

/// Its pipeline is queued with the first probe.
#[derive(Resource)]
struct ComparePipeline {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
    sampler: Sampler,
    pipeline: Option<CachedComputePipelineId>,
}

impl FromWorld for ComparePipeline {
    fn from_world(world: &mut World) -> Self {
        let image = || texture_2d(TextureSampleType::Float { filterable: true });
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                image(),
                sampler(SamplerBindingType::Filtering),
                image(),
                uniform_buffer::<ComparedPart>(false),
                storage_buffer_sized(false, None),
            ),
        );
        let sampler = world.resource::<RenderDevice>().create_sampler(&SamplerDescriptor {
            label: Some("frugal_gi/error_meter"),
            min_filter: FilterMode::Linear,
            mag_filter: FilterMode::Linear,
            ..default()
        });
        Self {
            layout: BindGroupLayoutDescriptor::new("frugal_gi/error_meter", &entries),
            shader: load_embedded_asset!(world, "compare.wgsl"),
            sampler,
            pipeline: None,
        }
    }
}

pub(super) fn finish(app: &mut App) {
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    if !render_app.world().contains_resource::<RenderDevice>() {
        return;
    }
    render_app
        .init_gpu_resource::<ComparePipeline>()
        .add_systems(Core3d, compare.after(Core3dSystems::PostProcess).before(upscaling));
}

/// A camera's image: where it is in its texture, and how large.
type ComparedView = (
    &'static MainEntity,
    &'static ViewTarget,
    &'static ExtractedCamera,
    Option<&'static ScaledView>,
);

/// In a camera's view, once it is drawn: compares it with its probe, if that is due. The next camera
/// of the same target may draw over it.
fn compare(
    view: ViewQuery<ComparedView>,
    rendering: Query<(), With<ErrorProbe>>,
    probes: Query<(&Comparison, &ViewTarget)>,
    mut pipeline: ResMut<ComparePipeline>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    cache: Res<PipelineCache>,
    queue: Res<RenderQueue>,
    mut context: RenderContext,
) {
    if rendering.is_empty() {
        return;
    }
    // Compiles while the first probe renders.
    let ComparePipeline { layout, shader, sampler, pipeline } = &mut *pipeline;
    let id = *pipeline.get_or_insert_with(|| {
        cache.queue_compute_pipeline(ComputePipelineDescriptor {
            label: Some("frugal_gi/error_meter".into()),
            layout: vec![layout.clone()],
            shader: shader.clone(),
            entry_point: Some("compare".into()),
            ..default()
        })
    });
    let Some(pipeline) = cache.get_compute_pipeline(id) else { return };
    let (main, shown, extracted, scaled) = view.into_inner();
    let Some((Comparison { tile, sums, .. }, best)) =
        probes.iter().find(|(comparison, _)| comparison.camera == main.id())
    else {
        return;
    };
    let (Some(buffer), Some(rendered)) = (buffers.get(sums), extracted.physical_viewport_size)
    else {
        return;
    };
    // A scaled camera fills a texture of its own; others a part of the target's size.
    let viewport = extracted.viewport.as_ref().filter(|_| scaled.is_none());
    let origin = viewport.map_or(UVec2::ZERO, |viewport| viewport.physical_position);
    let mut uniform = UniformBuffer::from(ComparedPart {
        origin: origin.as_vec2(),
        scale: rendered.as_vec2() / tile.full.as_vec2(),
        offset: tile.offset.as_vec2(),
        size: tile.size,
    });
    uniform.write_buffer(context.render_device(), &queue);
    let Some(uniform) = uniform.binding() else { return };
    let entries = BindGroupEntries::sequential((
        shown.main_texture_view(),
        &*sampler,
        best.main_texture_view(),
        uniform,
        buffer.buffer.as_entire_binding(),
    ));
    let bindings = context.render_device().create_bind_group(
        "frugal_gi/error_meter",
        &cache.get_bind_group_layout(layout),
        &entries,
    );
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "frugal_gi/error_meter");
    {
        let descriptor =
            ComputePassDescriptor { label: Some("frugal_gi/error_meter"), ..default() };
        let mut pass = context.command_encoder().begin_compute_pass(&descriptor);
        let groups = groups(tile);
        pass.set_bind_group(0, &bindings, &[]);
        pass.set_pipeline(pipeline);
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    }
    span.end(context.command_encoder());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_another_comparison_are_no_error() {
        let tile = Tile { full: UVec2::splat(40), offset: UVec2::ZERO, size: UVec2::new(20, 19) };
        assert_eq!((groups(&tile), bytes(&tile)), (UVec2::splat(2), 32));
        let sums = |values: [[f32; 2]; 4]| bytemuck::cast_slice(&values).to_vec();
        let right = sums([[0.9, 64.0], [0.0, 16.0], [0.0, 8.0], [0.0, 2.0]]);
        assert!((error(&tile, &right).unwrap() - 0.01).abs() < 1e-6);
        assert_eq!(error(&tile, &sums([[0.0; 2]; 4])), None, "nothing was written");
        assert_eq!(error(&tile, &sums([[f32::NAN, 90.0], [0.0; 2], [0.0; 2], [0.0; 2]])), None);
        assert_eq!(error(&tile, &[]), None);
        assert_eq!(error(&tile, &sums([[-1e-6, 90.0], [0.0; 2], [0.0; 2], [0.0; 2]])), Some(0.0));
    }
}
