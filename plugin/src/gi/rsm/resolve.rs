//! The pass that turns a light's G-buffer into texels, and the store that keeps them.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::core_3d::{AlphaMask3d, Opaque3d, Transparent3d};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::pbr::Transmissive3d;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::extract_component::{ComponentUniforms, DynamicUniformIndex};
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases};
use bevy::render::render_resource::binding_types::{storage_buffer_sized, texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::view::{ExtractedView, ViewDepthTexture, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::utils::default;

use super::RsmView;
use super::lights::RsmLight;
use crate::gi::settings::FrugalGi;

/// Bytes of `rsm/texel.wgsl`'s `Texel`. A test holds it against the shader.
pub(in crate::gi) const TEXEL_BYTES: u64 = 48;

/// Texels of every map, one after another. Empty while no light bounces.
#[derive(Resource, Default)]
pub(in crate::gi) struct RsmStore {
    /// Present while there are maps.
    pub buffers: Option<RsmBuffers>,
}

/// The store's three buffers.
pub(in crate::gi) struct RsmBuffers {
    /// `Texel` each.
    pub texels: Buffer,
    /// Cumulative weights along each row.
    pub texel_cdf: Buffer,
    /// Sum of weights of each row.
    pub row_sums: Buffer,
}

impl RsmStore {
    /// Bytes held on the GPU.
    pub fn bytes(&self) -> u64 {
        self.buffers.as_ref().map_or(0, |b| b.texels.size() + b.texel_cdf.size() + b.row_sums.size())
    }
}

#[derive(Resource)]
pub(in crate::gi) struct RsmPipelines {
    layout: BindGroupLayoutDescriptor,
    resolve_parallel: CachedComputePipelineId,
    resolve_positioned: CachedComputePipelineId,
    accumulate_rows: CachedComputePipelineId,
}

impl FromWorld for RsmPipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/rsm/resolve",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    uniform_buffer::<RsmLight>(true),
                    storage_buffer_sized(false, None),
                    storage_buffer_sized(false, None),
                    storage_buffer_sized(false, None),
                ),
            ),
        );
        let shader = load_embedded_asset!(world, "resolve.wgsl");
        let cache = world.resource::<PipelineCache>();
        let queue = |entry_point: &'static str, shader_defs| {
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/rsm/{entry_point}").into()),
                layout: vec![layout.clone()],
                shader: shader.clone(),
                shader_defs,
                entry_point: Some(entry_point.into()),
                ..default()
            })
        };
        let resolve_parallel = queue("resolve", vec!["PARALLEL".into()]);
        let resolve_positioned = queue("resolve", vec![]);
        let accumulate_rows = queue("accumulate_rows", vec![]);
        Self { resolve_parallel, resolve_positioned, accumulate_rows, layout }
    }
}

/// Takes the maps' cameras out of the main pass before anything is specialised, compiled or queued for it.
pub(in crate::gi) fn drop_main_phases(
    views: Query<&ExtractedView, With<RsmView>>,
    mut opaque: ResMut<ViewBinnedRenderPhases<Opaque3d>>,
    mut alpha_mask: ResMut<ViewBinnedRenderPhases<AlphaMask3d>>,
    mut transmissive: ResMut<ViewSortedRenderPhases<Transmissive3d>>,
    mut transparent: ResMut<ViewSortedRenderPhases<Transparent3d>>,
) {
    for view in &views {
        let view = &view.retained_view_entity;
        opaque.remove(view);
        alpha_mask.remove(view);
        transmissive.remove(view);
        transparent.remove(view);
    }
}

/// Fits the store to the maps of this frame; lets it go where there are none.
pub(in crate::gi) fn prepare_store(
    mut store: ResMut<RsmStore>,
    device: Res<RenderDevice>,
    maps: Query<(&RsmLight, &bevy::render::camera::ExtractedCamera), With<RsmView>>,
    cameras: Query<(), With<FrugalGi>>,
) {
    let (mut texels, mut rows) = (0, 0);
    for (light, camera) in &maps {
        let Some(size) = camera.physical_target_size else { continue };
        texels = texels.max(u64::from(light.texel_offset) + u64::from(size.x) * u64::from(size.y));
        rows = rows.max(u64::from(light.row_offset) + u64::from(size.y));
    }
    if texels == 0 || cameras.is_empty() {
        store.buffers = None;
        return;
    }
    let buffer = |label, size| {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
    };
    let fits = |old: &RsmBuffers| old.texels.size() == texels * TEXEL_BYTES && old.row_sums.size() == rows * 4;
    if !store.buffers.as_ref().is_some_and(fits) {
        store.buffers = Some(RsmBuffers {
            texels: buffer("bevy_frugal_gi/rsm/texels", texels * TEXEL_BYTES),
            texel_cdf: buffer("bevy_frugal_gi/rsm/texel_cdf", texels * 4),
            row_sums: buffer("bevy_frugal_gi/rsm/row_sums", rows * 4),
        });
    }
}

/// In a map's own view: G-buffer to texels, then cumulative weights along the rows.
pub(in crate::gi) fn resolve(
    view: ViewQuery<(
        &RsmView,
        &DynamicUniformIndex<RsmLight>,
        &ExtractedView,
        &ViewPrepassTextures,
        &ViewDepthTexture,
        &ViewUniformOffset,
    )>,
    pipelines: Res<RsmPipelines>,
    store: Res<RsmStore>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    lights: Res<ComponentUniforms<RsmLight>>,
    mut context: RenderContext,
) {
    let (map, light_index, extracted, prepass, depth, view_offset) = view.into_inner();
    let parallel = map.camera.is_some();
    let resolve = if parallel { pipelines.resolve_parallel } else { pipelines.resolve_positioned };
    let (Some(buffers), Some(g_buffer), Some(views), Some(lights), Some(resolve), Some(accumulate_rows)) = (
        &store.buffers,
        prepass.deferred_view(),
        view_uniforms.uniforms.binding(),
        lights.uniforms().binding(),
        cache.get_compute_pipeline(resolve),
        cache.get_compute_pipeline(pipelines.accumulate_rows),
    ) else {
        return;
    };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/rsm/resolve",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth.view(),
            views,
            lights,
            buffers.texels.as_entire_binding(),
            buffers.texel_cdf.as_entire_binding(),
            buffers.row_sums.as_entire_binding(),
        )),
    );
    let (width, height) = (extracted.viewport.z, extracted.viewport.w);
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/rsm");
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/rsm/resolve"), timestamp_writes: None });
        pass.set_bind_group(0, &bind_group, &[view_offset.offset, light_index.index()]);
        pass.set_pipeline(resolve);
        pass.dispatch_workgroups(width.div_ceil(8), height.div_ceil(8), 1);
        pass.set_pipeline(accumulate_rows);
        pass.dispatch_workgroups(height.div_ceil(64), 1, 1);
    }
    span.end(context.command_encoder());
}
