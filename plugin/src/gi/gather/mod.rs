//! The gather: irradiance from a camera's VPLs at a share of its pixels.

mod plan;

use bevy::asset::{Handle, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::{CachedTexture, TextureCache};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{Shader, ShaderDefVal};
use bevy::utils::default;

use super::filter;
use super::rsm::{RsmLight, RsmStore, RsmView};
use super::settings::{FrugalGi, GiPixelFraction, GiVisibility};
use super::visibility::OccluderBuffers;
use super::vpl::{DrawingBuffers, MapRow, VPL_BYTES};
pub(super) use plan::{GatherSettings, VplPlan};

/// What a GI camera holds in the render world, while it has VPLs to gather.
#[derive(Component)]
pub struct GiCamera {
    /// How its VPLs are shared out.
    pub(super) plan: VplPlan,
    pub(super) plan_buffer: Buffer,
    pub(super) vpls: Buffer,
    pub(super) drawing: DrawingBuffers,
    /// What each cell gathered.
    pub(super) irradiance: CachedTexture,
    /// The same after the filter, where there is one.
    pub(super) filtered: Option<CachedTexture>,
    pub(super) fraction: GiPixelFraction,
    pub(super) filter_window: u32,
    settings: Buffer,
    visibility: GiVisibility,
}

impl GiCamera {
    /// Bytes held on the GPU for this camera.
    pub(super) fn bytes(&self) -> u64 {
        let textures = [Some(&self.irradiance), self.filtered.as_ref()].into_iter().flatten();
        let texels = textures.map(|texture| u64::from(texture.texture.width()) * u64::from(texture.texture.height()) * 8).sum::<u64>();
        texels + self.drawing.bytes() + [&self.vpls, &self.plan_buffer, &self.settings].map(|buffer| buffer.size()).iter().sum::<u64>()
    }

    /// What the composite shows.
    pub(super) fn shown(&self) -> &CachedTexture {
        self.filtered.as_ref().unwrap_or(&self.irradiance)
    }

    /// The settings of the first set, to which a dynamic offset may be added.
    pub(super) fn first_settings(&self) -> BindingResource<'_> {
        first_of(&self.settings, size_of::<GatherSettings>() as u64)
    }

    /// Pairs of pixel and VPL that are evaluated in a frame.
    pub(super) fn pairs(&self) -> u64 {
        u64::from(self.irradiance.texture.width()) * u64::from(self.irradiance.texture.height()) * u64::from(self.plan.per_set)
    }

    /// Rays that are traced in a frame, at most.
    pub(super) fn rays(&self) -> u64 {
        let cells = u64::from(self.irradiance.texture.width()) * u64::from(self.irradiance.texture.height());
        cells * u64::from(self.visibility.rays().min(self.plan.per_set))
    }
}

fn first_of(buffer: &Buffer, size: u64) -> BindingResource<'_> {
    BindingResource::Buffer(BufferBinding { buffer, offset: 0, size: BufferSize::new(size) })
}

#[derive(Resource)]
pub(super) struct GatherPipelines {
    layout: BindGroupLayoutDescriptor,
    /// One for each way to see, in the order of [`GiVisibility::ALL`].
    pipelines: [CachedComputePipelineId; 3],
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
                    uniform_buffer_sized(true, BufferSize::new(u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES)),
                    uniform_buffer_sized(true, BufferSize::new(size_of::<GatherSettings>() as u64)),
                    storage_buffer_read_only_sized(false, None),
                    texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                ),
            ),
        );
        let occluders = world.resource::<OccluderBuffers>().layout().clone();
        let shader: Handle<Shader> = load_embedded_asset!(world, "gather.wgsl");
        let cache = world.resource::<PipelineCache>();
        let pipelines = GiVisibility::ALL.map(|visibility| {
            let rays = visibility.rays();
            cache.queue_compute_pipeline(ComputePipelineDescriptor {
                label: Some(format!("bevy_frugal_gi/gather/{visibility:?}").into()),
                layout: if rays == 0 { vec![layout.clone()] } else { vec![layout.clone(), occluders.clone()] },
                shader: shader.clone(),
                shader_defs: if rays == 0 { vec![] } else { vec![ShaderDefVal::UInt("RAYS".into(), rays)] },
                entry_point: Some("gather_vpls".into()),
                ..default()
            })
        });
        Self { layout, pipelines }
    }
}

/// Gives every GI camera that has maps its VPL buffers and its textures, and takes them from the others.
pub(super) fn prepare_cameras(
    mut commands: Commands,
    mut textures: ResMut<TextureCache>,
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
        let map_rows = rows_of(main_entity.id(), &maps);
        let Some(size) = camera.physical_viewport_size.filter(|size| size.min_element() > 0) else { continue };
        if gi.vpl_count == 0 || map_rows.is_empty() || store.texels.is_none() {
            if held.contains(entity) {
                commands.entity(entity).remove::<GiCamera>();
            }
            continue;
        }
        let plan = VplPlan::new(gi.vpl_count, gi.interleave);
        let (width, height) = gi.pixel_fraction.cell();
        let mut texture = |label| {
            textures.get(
                &device,
                TextureDescriptor {
                    label: Some(label),
                    size: Extent3d { width: size.x.div_ceil(width), height: size.y.div_ceil(height), depth_or_array_layers: 1 },
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: TextureDimension::D2,
                    format: TextureFormat::Rgba16Float,
                    usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_SRC,
                    view_formats: &[],
                },
            )
        };
        let irradiance = texture("bevy_frugal_gi/irradiance");
        let filter_window = filter::window(gi);
        let filtered = (filter_window > 1).then(|| texture("bevy_frugal_gi/filtered"));
        if let Ok(mut held) = held.get_mut(entity)
            && held.plan == plan
            && held.drawing.rows == map_rows
        {
            if held.fraction != gi.pixel_fraction {
                queue.write_buffer(&held.settings, 0, &plan::settings_bytes(&plan, gi.pixel_fraction));
            }
            (held.irradiance, held.filtered, held.filter_window) = (irradiance, filtered, filter_window);
            (held.fraction, held.visibility) = (gi.pixel_fraction, gi.visibility);
            continue;
        }
        let empty =
            |label, size, usage| device.create_buffer(&BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
        let filled =
            |label, contents: &[u8], usage| device.create_buffer_with_data(&BufferInitDescriptor { label: Some(label), contents, usage });
        let vpl_usage = BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC;
        commands.entity(entity).insert(GiCamera {
            plan,
            plan_buffer: filled("bevy_frugal_gi/vpl_plan", bytemuck::bytes_of(&plan), BufferUsages::STORAGE),
            vpls: empty("bevy_frugal_gi/vpls", plan.buffer_bytes(), vpl_usage),
            drawing: DrawingBuffers::new(&device, map_rows),
            irradiance,
            filtered,
            filter_window,
            fraction: gi.pixel_fraction,
            settings: filled(
                "bevy_frugal_gi/gather_settings",
                &plan::settings_bytes(&plan, gi.pixel_fraction),
                BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            ),
            visibility: gi.visibility,
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
    serving.sort_by_key(|(light, _)| light.texel_offset);
    let mut first_weight = 0;
    let mut rows = Vec::new();
    for (light, size) in serving {
        for row in 0..size.y {
            rows.push(MapRow { first_texel: light.texel_offset + row * size.x, first_weight, length: size.x });
            first_weight += size.x;
        }
    }
    rows
}

/// In a GI camera's view: gathers, set by set.
pub(super) fn gather(
    view: ViewQuery<(&GiCamera, &ViewPrepassTextures, &ViewUniformOffset)>,
    pipelines: Res<GatherPipelines>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, prepass, view_offset) = view.into_inner();
    let kind = GiVisibility::ALL.iter().position(|kind| *kind == camera.visibility).unwrap_or(0);
    let (Some(g_buffer), Some(depth), Some(views), Some(pipeline)) = (
        prepass.deferred_view(),
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        cache.get_compute_pipeline(pipelines.pipelines[kind]),
    ) else {
        return;
    };
    let traced = if camera.visibility == GiVisibility::None { None } else { occluders.bind_group() };
    let bind_group = context.render_device().create_bind_group(
        "bevy_frugal_gi/gather",
        &cache.get_bind_group_layout(&pipelines.layout),
        &BindGroupEntries::sequential((
            g_buffer,
            depth,
            views,
            first_of(&camera.vpls, u64::from(FrugalGi::MAX_VPLS_PER_PIXEL) * VPL_BYTES),
            camera.first_settings(),
            camera.plan_buffer.as_entire_binding(),
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
        if let Some(traced) = traced {
            pass.set_bind_group(1, traced, &[]);
        }
        let across = 8 * camera.plan.interleave;
        for set in 0..camera.plan.sets {
            let settings = set * plan::SETTINGS_STRIDE as u32;
            pass.set_bind_group(0, &bind_group, &[view_offset.offset, camera.plan.offset(set), settings]);
            pass.dispatch_workgroups(size.width.div_ceil(across), size.height.div_ceil(across), 1);
        }
    }
    span.end(context.command_encoder());
}
