//! The gather: irradiance from all of a camera's VPLs at a share of its pixels.

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::{CachedTexture, TextureCache};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

use super::rsm::{RsmLight, RsmStore, RsmView};
use super::settings::{FrugalGi, GiPixelFraction};
use super::vpl::{MapRow, VPL_BYTES};

/// What a GI camera holds in the render world, while it has VPLs to gather.
#[derive(Component)]
pub struct GiCamera {
    /// How many VPLs its buffer holds.
    pub(super) vpl_count: u32,
    pub(super) vpls: Buffer,
    pub(super) rows: Buffer,
    pub(super) row_cdf: Buffer,
    pub(super) irradiance: CachedTexture,
    pub(super) fraction: GiPixelFraction,
    settings: Buffer,
    pipeline: CachedComputePipelineId,
    map_rows: Vec<MapRow>,
    largest_geometry_term: f32,
}

impl GiCamera {
    /// Bytes held on the GPU for this camera.
    pub(super) fn bytes(&self) -> u64 {
        let size = self.irradiance.texture.size();
        self.vpls.size() + self.rows.size() + self.row_cdf.size() + u64::from(size.width) * u64::from(size.height) * 8
    }
}

#[derive(Resource)]
pub(super) struct GatherPipelines {
    layout: BindGroupLayoutDescriptor,
    shader: Handle<Shader>,
}

impl FromWorld for GatherPipelines {
    fn from_world(world: &mut World) -> Self {
        let layout = BindGroupLayoutDescriptor::new(
            "bevy_frugal_gi/gather",
            &BindGroupLayoutEntries::sequential(
                ShaderStages::COMPUTE,
                (
                    texture_2d(TextureSampleType::Uint),
                    texture_depth_2d(),
                    uniform_buffer::<ViewUniform>(true),
                    uniform_buffer_sized(false, None),
                    uniform_buffer_sized(false, None),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        world.init_resource::<SpecializedComputePipelines<GatherPipelines>>();
        Self { layout, shader: load_embedded_asset!(world, "gather.wgsl") }
    }
}

/// What a gather pipeline is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct GatherKey {
    vpl_count: u32,
    fraction: GiPixelFraction,
}

/// Shader definitions of the cell that shares one gather.
pub(super) fn cell_definitions(fraction: GiPixelFraction) -> Vec<ShaderDefVal> {
    let (width, height) = fraction.cell();
    vec![ShaderDefVal::UInt("CELL_WIDTH".into(), width), ShaderDefVal::UInt("CELL_HEIGHT".into(), height)]
}

impl SpecializedComputePipeline for GatherPipelines {
    type Key = GatherKey;

    fn specialize(&self, key: GatherKey) -> ComputePipelineDescriptor {
        let mut shader_defs = cell_definitions(key.fraction);
        shader_defs.push(ShaderDefVal::UInt("VPL_COUNT".into(), key.vpl_count));
        ComputePipelineDescriptor {
            label: Some("bevy_frugal_gi/gather".into()),
            layout: vec![self.layout.clone()],
            shader: self.shader.clone(),
            shader_defs,
            entry_point: Some("gather_vpls".into()),
            ..default()
        }
    }
}

/// 1/m² for a clamping distance in metres; as good as unbounded for 0, and for what is no distance.
fn largest_geometry_term(clamp_distance: f32) -> f32 {
    let term = (clamp_distance * clamp_distance).recip();
    if term.is_finite() && clamp_distance > 0.0 { term.max(1e-30) } else { 1e30 }
}

/// Gives every GI camera that has maps its VPL buffers, its irradiance texture and its pipeline, and takes them from the others.
pub(super) fn prepare_cameras(
    mut commands: Commands,
    mut textures: ResMut<TextureCache>,
    mut specialized: ResMut<SpecializedComputePipelines<GatherPipelines>>,
    pipelines: Res<GatherPipelines>,
    cache: Res<PipelineCache>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    store: Res<RsmStore>,
    maps: Query<(&RsmView, &RsmLight, &ExtractedCamera)>,
    cameras: Query<(Entity, &MainEntity, &FrugalGi, &ExtractedCamera)>,
    mut held: Query<&mut GiCamera>,
    stale: Query<Entity, (With<GiCamera>, Or<(Without<FrugalGi>, Without<ExtractedCamera>)>)>,
) {
    for entity in &stale {
        commands.entity(entity).remove::<GiCamera>();
    }
    for (entity, main_entity, gi, camera) in &cameras {
        let vpl_count = gi.vpl_count.min(FrugalGi::MAX_VPL_COUNT);
        let map_rows = rows_of(main_entity.id(), &maps);
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else { continue };
        if vpl_count == 0 || map_rows.is_empty() || store.buffers.is_none() {
            if held.contains(entity) {
                commands.entity(entity).remove::<GiCamera>();
            }
            continue;
        }
        let (width, height) = gi.pixel_fraction.cell();
        let irradiance = textures.get(
            &device,
            TextureDescriptor {
                label: Some("bevy_frugal_gi/irradiance"),
                size: Extent3d { width: size.x.div_ceil(width), height: size.y.div_ceil(height), depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format: TextureFormat::Rgba16Float,
                usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
                view_formats: &[],
            },
        );
        let key = GatherKey { vpl_count, fraction: gi.pixel_fraction };
        let pipeline = specialized.specialize(&cache, &pipelines, key);
        let largest = largest_geometry_term(gi.clamp_distance);
        if let Ok(mut held) = held.get_mut(entity)
            && held.vpl_count == vpl_count
            && held.map_rows == map_rows
        {
            held.irradiance = irradiance;
            held.fraction = gi.pixel_fraction;
            held.pipeline = pipeline;
            if held.largest_geometry_term != largest {
                held.largest_geometry_term = largest;
                queue.write_buffer(&held.settings, 0, bytemuck::bytes_of(&[largest, 0.0, 0.0, 0.0]));
            }
            continue;
        }
        let vpl_usage = BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC;
        let vpls = device.create_buffer(&BufferDescriptor {
            label: Some("bevy_frugal_gi/vpls"),
            size: u64::from(vpl_count) * VPL_BYTES,
            usage: vpl_usage,
            mapped_at_creation: false,
        });
        let row_cdf = device.create_buffer(&BufferDescriptor {
            label: Some("bevy_frugal_gi/row_cdf"),
            size: map_rows.len() as u64 * 4,
            usage: BufferUsages::STORAGE,
            mapped_at_creation: false,
        });
        let rows = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bevy_frugal_gi/rows"),
            contents: bytemuck::cast_slice(&map_rows),
            usage: BufferUsages::STORAGE,
        });
        let settings = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bevy_frugal_gi/gather_settings"),
            contents: bytemuck::bytes_of(&[largest, 0.0, 0.0, 0.0]),
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        });
        commands.entity(entity).insert(GiCamera {
            vpl_count,
            vpls,
            rows,
            row_cdf,
            irradiance,
            fraction: gi.pixel_fraction,
            settings,
            pipeline,
            map_rows,
            largest_geometry_term: largest,
        });
    }
}

/// Rows of every map that serves `camera`, in the order of the store.
fn rows_of(camera: Entity, maps: &Query<(&RsmView, &RsmLight, &ExtractedCamera)>) -> Vec<MapRow> {
    let mut serving: Vec<_> = maps
        .iter()
        .filter(|(map, ..)| map.camera.is_none_or(|owner| owner == camera))
        .filter_map(|(_, light, camera)| Some((light, camera.physical_target_size?)))
        .collect();
    serving.sort_by_key(|(light, _)| light.row_offset);
    let rows = serving.iter().flat_map(|(light, size)| {
        (0..size.y).map(|y| MapRow { row: light.row_offset + y, first_texel: light.texel_offset + y * size.x, length: size.x })
    });
    rows.collect()
}

/// In a GI camera's view: gathers.
pub(super) fn gather(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<GatherPipelines>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) =
        (prepass.deferred_view(), prepass.depth_view(), view_uniforms.uniforms.binding(), cache.get_compute_pipeline(camera.pipeline))
    else {
        return;
    };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/gather",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views,
            camera.vpls.as_entire_binding(),
            camera.settings.as_entire_binding(),
            &camera.irradiance.default_view,
        )),
    );
    let size = camera.irradiance.texture.size();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "bevy_frugal_gi/gather");
    {
        let mut pass = context
            .command_encoder()
            .begin_compute_pass(&ComputePassDescriptor { label: Some("bevy_frugal_gi/gather"), timestamp_writes: None });
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[view_offset.offset]);
        pass.dispatch_workgroups(size.width.div_ceil(8), size.height.div_ceil(8), 1);
    }
    span.end(context.command_encoder());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_clamping_distance_gives_a_finite_positive_bound() {
        for distance in [0.0, -1.0, 1e-30, 1e-20, 0.25, 1e20, f32::NAN, f32::INFINITY] {
            let term = largest_geometry_term(distance);
            assert!(term.is_finite() && term > 0.0, "{distance}: {term}");
        }
        assert_eq!(largest_geometry_term(0.5), 4.0);
    }
}
