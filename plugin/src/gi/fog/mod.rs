//! Indirect light in fog: what Bevy's fog volumes scatter of the light that bounces and of the sky.
//!
//! The light is that of the grid around the camera (`forward`), so it moves with lights and meshes
//! and is dark behind walls. `places.wgsl` makes a texture of it; `scatter.wgsl` marches through each
//! volume, after Bevy's fog, which scatters the direct light of `VolumetricLight`s. Without such
//! lights Bevy draws no fog; then this pass also hides what lies behind it.

use bevy::anti_alias::taa::temporal_anti_alias;
use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::FullscreenShader;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::light::{FogVolume, VolumetricFog, VolumetricLight};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{
    sampler, texture_3d, texture_depth_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::sync_world::RenderEntity;
use bevy::render::texture::GpuImage;
use bevy::render::view::{ExtractedView, ViewTarget, ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::render::{Extract, GpuResourceAppExt, Render, RenderSystems};

use super::compute::{Kernel, definitions, drop_with};
use super::forward::{ForwardView, PLACES, places_kernel, volume_uniform, write_places};
use super::view::{ActiveGi, GiShare, GiView};

/// Steps of the camera's own march for one of this: indirect light changes slowly.
const OWN_STEPS: u32 = 4;

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "places.wgsl");
    embedded_asset!(app, "scatter.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_resource::<Fogs>()
        .init_gpu_resource::<FogPipelines>()
        .add_observer(drop_with::<ForwardView, FogView>)
        .add_systems(ExtractSchedule, extract)
        .add_systems(
            Render,
            replace_ambient_light
                .after(RenderSystems::ExtractCommands)
                .before(RenderSystems::PrepareAssets),
        )
        // Bevy's own fog comes between the main pass and this.
        .add_systems(
            Core3d,
            scatter.in_set(Core3dSystems::EarlyPostProcess).before(temporal_anti_alias),
        );
}

/// `fog/scatter.wgsl`'s `Fog`.
#[derive(Clone, Debug, PartialEq, ShaderType)]
pub(super) struct FogUniform {
    local_from_world: Mat4,
    scattering: Vec3,
    extinction: f32,
    offset: Vec3,
    asymmetry: f32,
    steps: u32,
    hides: f32,
}

impl FogUniform {
    /// `None` for a volume without an inside, or without fog.
    fn new(fog: &FogVolume, place: &GlobalTransform, hides: bool) -> Option<Self> {
        let local_from_world = place.affine().inverse();
        let density = finite(fog.density_factor).max(0.0);
        let scattering = finite(fog.scattering).max(0.0) * density;
        let light = (fog.fog_color.to_linear().to_vec3() * fog.light_tint.to_linear().to_vec3())
            * finite(fog.light_intensity);
        let uniform = Self {
            local_from_world: local_from_world.into(),
            scattering: light.map(|channel| finite(channel * scattering).max(0.0)),
            extinction: finite(scattering + finite(fog.absorption).max(0.0) * density),
            offset: fog.density_texture_offset.map(finite),
            asymmetry: finite(fog.scattering_asymmetry).clamp(-1.0, 1.0),
            steps: 1,
            hides: f32::from(u8::from(hides)),
        };
        (local_from_world.is_finite() && uniform.extinction > 0.0).then_some(uniform)
    }
}

/// 0 for what is not finite.
fn finite(value: f32) -> f32 {
    if value.is_finite() { value } else { 0.0 }
}

/// The scene's fog volumes, with their density textures, and what is uploaded of them.
#[derive(Resource, Default)]
pub(super) struct Fogs {
    volumes: Vec<(FogUniform, Option<AssetId<Image>>)>,
    buffer: DynamicUniformBuffer<FogUniform>,
}

/// Steps of a GI camera's march. In the render world, on cameras that draw fog.
#[derive(Component)]
pub(super) struct FogCamera(u32);

fn extract(
    mut commands: Commands,
    mut fogs: ResMut<Fogs>,
    volumes: Extract<Query<(&FogVolume, &GlobalTransform)>>,
    lights: Extract<Query<(), With<VolumetricLight>>>,
    cameras: Extract<Query<(RenderEntity, &ActiveGi, Option<&VolumetricFog>)>>,
) {
    let hides = lights.is_empty();
    let found = volumes.iter().filter_map(|(fog, place)| {
        let uniform = FogUniform::new(fog, place, hides)?;
        Some((uniform, fog.density_texture.as_ref().map(Handle::id)))
    });
    fogs.volumes = found.collect();
    for (entity, gi, fog) in &cameras {
        let Ok(mut entity) = commands.get_entity(entity) else { continue };
        match fog.filter(|fog| fog.step_count > 0 && gi.fog && !fogs.volumes.is_empty()) {
            Some(fog) => entity.insert(FogCamera(fog.step_count.div_ceil(OWN_STEPS))),
            None => entity.remove::<(FogCamera, FogView)>(),
        };
    }
}

/// Fog is lit once: by what reaches it, not by Bevy's ambient light, which has no shadows. They fade into
/// each other.
fn replace_ambient_light(mut cameras: Query<(&mut VolumetricFog, &GiShare), With<FogView>>) {
    for (mut fog, share) in &mut cameras {
        fog.ambient_intensity *= 1.0 - share.0;
    }
}

/// Light at a camera's places, and its volumes in [`Fogs::buffer`]. In the render world.
#[derive(Component)]
pub(super) struct FogView {
    light: TextureView,
    offsets: Vec<u32>,
    pipelines: [CachedRenderPipelineId; 2],
}

impl FogView {
    /// Bytes held on the GPU, without those of [`ForwardView`].
    pub(super) const BYTES: u64 = 2 * 8 * (PLACES.x * PLACES.y * PLACES.z) as u64;
}

#[derive(Resource)]
pub(super) struct FogPipelines {
    places: Kernel,
    /// Without a density texture, and with one.
    layouts: [BindGroupLayoutDescriptor; 2],
    shader: Handle<Shader>,
    vertex: VertexState,
    sampler: Sampler,
}

impl FromWorld for FogPipelines {
    fn from_world(world: &mut World) -> Self {
        world.init_resource::<SpecializedRenderPipelines<Self>>();
        let places = load_embedded_asset!(world, "places.wgsl");
        Self {
            places: places_kernel("frugal_gi/fog", "fill", &places),
            layouts: [layout(false), layout(true)],
            shader: load_embedded_asset!(world, "scatter.wgsl"),
            vertex: world.resource::<FullscreenShader>().to_vertex_state(),
            sampler: world.resource::<RenderDevice>().create_sampler(&SamplerDescriptor {
                mag_filter: FilterMode::Linear,
                min_filter: FilterMode::Linear,
                ..default()
            }),
        }
    }
}

/// Format of the image, and whether the fog has a density texture.
type FogKey = (TextureFormat, bool);

fn layout(has_texture: bool) -> BindGroupLayoutDescriptor {
    let filterable = || texture_3d(TextureSampleType::Float { filterable: true });
    let mut entries = DynamicBindGroupLayoutEntries::sequential(
        ShaderStages::FRAGMENT,
        (
            texture_depth_2d(),
            uniform_buffer::<ViewUniform>(true),
            volume_uniform(),
            filterable(),
            sampler(SamplerBindingType::Filtering),
            uniform_buffer::<FogUniform>(true),
        ),
    );
    if has_texture {
        let sampler = sampler(SamplerBindingType::Filtering);
        entries = entries.extend_with_indices(((6, filterable()), (7, sampler)));
    }
    BindGroupLayoutDescriptor::new("frugal_gi/fog/scatter", &entries)
}

impl SpecializedRenderPipeline for FogPipelines {
    type Key = FogKey;

    fn specialize(&self, (format, has_texture): FogKey) -> RenderPipelineDescriptor {
        let blend = |src_factor, dst_factor| BlendComponent {
            src_factor,
            dst_factor,
            operation: BlendOperation::Add,
        };
        RenderPipelineDescriptor {
            label: Some("frugal_gi/fog/scatter".into()),
            layout: vec![self.layouts[usize::from(has_texture)].clone()],
            vertex: self.vertex.clone(),
            fragment: Some(FragmentState {
                shader: self.shader.clone(),
                shader_defs: definitions([(has_texture, "DENSITY_TEXTURE")]),
                entry_point: Some("scatter".into()),
                targets: vec![Some(ColorTargetState {
                    format,
                    blend: Some(BlendState {
                        color: blend(BlendFactor::One, BlendFactor::OneMinusSrcAlpha),
                        alpha: blend(BlendFactor::Zero, BlendFactor::One),
                    }),
                    write_mask: ColorWrites::ALL,
                })],
            }),
            ..default()
        }
    }
}

/// Makes and uploads what views with fog need.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    cache: Res<PipelineCache>,
    mut fogs: ResMut<Fogs>,
    mut pipelines: ResMut<FogPipelines>,
    mut specialized: ResMut<SpecializedRenderPipelines<FogPipelines>>,
    mut views: Query<
        (Entity, &FogCamera, &GiShare, &ExtractedView, Option<&mut FogView>),
        (With<GiView>, With<ForwardView>),
    >,
) {
    let Fogs { volumes, buffer } = &mut *fogs;
    let count = views.iter().len() * volumes.len();
    if count == 0 {
        return;
    }
    pipelines.places.queue(&cache, Vec::new());
    let Some(mut writer) = buffer.get_writer(count, &device, &queue) else { return };
    for (entity, camera, share, view, held) in &mut views {
        let written = volumes.iter().map(|(fog, _)| {
            let (scattering, hides) = (fog.scattering * share.0, fog.hides * share.0);
            writer.write(&FogUniform { scattering, hides, steps: camera.0, ..fog.clone() })
        });
        let offsets = written.collect();
        let pipelines = [false, true].map(|has_texture| {
            specialized.specialize(&cache, &pipelines, (view.target_format, has_texture))
        });
        match held {
            Some(mut held) => (held.offsets, held.pipelines) = (offsets, pipelines),
            None => {
                let light = light_texture(&device);
                commands.entity(entity).insert(FogView { light, offsets, pipelines });
            }
        }
    }
}

/// Mean light, and its first moment above it along the height.
fn light_texture(device: &RenderDevice) -> TextureView {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some("frugal_gi/fog/light"),
        size: Extent3d { width: PLACES.x, height: 2 * PLACES.y, depth_or_array_layers: PLACES.z },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D3,
        format: TextureFormat::Rgba16Float,
        usage: TextureUsages::STORAGE_BINDING | TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&TextureViewDescriptor::default())
}

/// In a GI camera's view, after Bevy's fog.
fn scatter(
    view: ViewQuery<(
        &ViewTarget,
        &ExtractedCamera,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        &ForwardView,
        &FogView,
    )>,
    pipelines: Res<FogPipelines>,
    fogs: Res<Fogs>,
    cache: Res<PipelineCache>,
    images: Res<RenderAssets<GpuImage>>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (target, camera, prepass, offset, forward, fog) = view.into_inner();
    let (Some(depth), Some(views), Some(uniforms), Some(places)) = (
        prepass.depth_view(),
        view_uniforms.uniforms.binding(),
        fogs.buffer.binding(),
        pipelines.places.get(&cache, &[]),
    ) else {
        return;
    };
    let settings = forward.settings_buffer.as_entire_binding();
    let (name, kernel) = ("frugal_gi/fog/places", (&pipelines.places, places));
    write_places(&mut context, name, kernel, &cache, forward, &fog.light);
    let volumes = fogs.volumes.iter().zip(&fog.offsets).filter_map(|((_, texture), own)| {
        let image = texture.and_then(|texture| images.get(texture));
        let variant = usize::from(image.is_some());
        let pipeline = cache.get_render_pipeline(fog.pipelines[variant])?;
        let mut entries = DynamicBindGroupEntries::sequential((
            depth,
            views.clone(),
            settings.clone(),
            &fog.light,
            &pipelines.sampler,
            uniforms.clone(),
        ));
        if let Some(image) = image {
            entries = entries.extend_with_indices(((6, &image.texture_view), (7, &image.sampler)));
        }
        let layout = cache.get_bind_group_layout(&pipelines.layouts[variant]);
        let group =
            context.render_device().create_bind_group("frugal_gi/fog/scatter", &layout, &entries);
        Some((pipeline, group, *own))
    });
    let volumes: Vec<_> = volumes.collect();
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "frugal_gi/fog");
    {
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("frugal_gi/fog"),
            color_attachments: &[Some(target.get_color_attachment())],
            ..default()
        });
        if let Some(viewport) = &camera.viewport {
            pass.set_camera_viewport(viewport);
        }
        for (pipeline, group, own) in &volumes {
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, group, &[offset.offset, *own]);
            pass.draw(0..3, 0..1);
        }
    }
    span.end(context.command_encoder());
}
