//! The gather: irradiance from a camera's VPLs and sky at low-resolution pixels.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, ViewQuery};
use bevy::render::texture::CachedTexture;
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{ShaderDefVal, load_shader_library};

use super::compute::{CameraInputs, Kernel, compute_pass, drop_with, read};
use super::schedule::PassSystems;
use super::settings::{FrugalGi, GiVisibility};
use super::sky::SkyCamera;
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::VplView;

/// Label of irradiance textures.
const IRRADIANCE: &str = "frugal_gi/gather/irradiance";

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "gather.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<GatherKernels>()
        .add_observer(drop_with::<GiView, GatherView>)
        .add_systems(Core3d, gather.in_set(PassSystems::Gather));
}

/// Pipelines without a sky are queued from the beginning, others once a camera needs them.
#[derive(Resource)]
pub(super) struct GatherKernels {
    without_rays: Kernel,
    /// Without a sky and with one.
    traced: [Kernel; 2],
}

/// Definitions of a gather that traces.
pub(super) fn ray_definitions(visibility: GiVisibility, has_sky: bool) -> Vec<ShaderDefVal> {
    let mut all = vec![ShaderDefVal::UInt("RAYS".into(), visibility.rays())];
    if has_sky {
        all.push(ShaderDefVal::UInt("SKY_RAYS".into(), visibility.sky_rays()));
    }
    all
}

impl FromWorld for GatherKernels {
    fn from_world(world: &mut World) -> Self {
        let without_sky = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer::<ViewUniform>(true),
                read(),
                read(),
                texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
            ),
        );
        let sky = BindGroupLayoutEntries::with_indices(ShaderStages::COMPUTE, ((7, read()),));
        let with_sky = [&*without_sky, &*sky].concat();
        let (label, entry_point) = ("frugal_gi/gather", "gather_vpls");
        let shader = load_embedded_asset!(world, "gather.wgsl");
        let kernel =
            |entries: &[BindGroupLayoutEntry]| Kernel::new(label, entry_point, &shader, entries);
        let [traced, traced_by_sky] = [&without_sky[..], &with_sky[..]]
            .map(|entries| kernel(entries).with_group(OccluderBuffers::layout()));
        let cache = world.resource::<PipelineCache>();
        let variants = [GiVisibility::Coarse, GiVisibility::Fine];
        let variants = variants.map(|visibility| ray_definitions(visibility, false));
        Self {
            without_rays: kernel(&without_sky).queued(cache, [vec![]]),
            traced: [traced.queued(cache, variants), traced_by_sky],
        }
    }
}

/// Queues the pipelines that cameras need for a sky, and keeps it inactive until they are compiled.
pub(super) fn prepare_pipelines(
    mut kernels: ResMut<GatherKernels>,
    cache: Res<PipelineCache>,
    mut cameras: Query<(&FrugalGi, &mut SkyCamera)>,
) {
    for (gi, mut sky) in cameras.iter_mut().filter(|(gi, _)| gi.traces()) {
        let definitions = ray_definitions(gi.visibility, true);
        kernels.traced[1].queue(&cache, definitions.clone());
        sky.is_active &= kernels.traced[1].get(&cache, &definitions).is_some();
    }
}

/// In a GI camera's view: gathers, all sets at once.
pub(super) fn gather(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &GatherView,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        Option<&SkyCamera>,
    )>,
    kernels: Res<GatherKernels>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, gather, prepass, view_offset, sky) = view.into_inner();
    if !view.work.gather || view.gi.caches() {
        return;
    }
    let sky = sky.filter(|_| view.sky_samples > 0);
    let is_traced = view.gi.visibility != GiVisibility::None;
    let (kernel, definitions) = if is_traced {
        let traced = &kernels.traced[usize::from(sky.is_some())];
        (traced, ray_definitions(view.gi.visibility, sky.is_some()))
    } else {
        (&kernels.without_rays, Vec::new())
    };
    let (Some(camera), Some(pipeline)) =
        (CameraInputs::new(prepass, &view_uniforms), kernel.get(&cache, &definitions))
    else {
        return;
    };
    let mut entries = DynamicBindGroupEntries::sequential((
        camera.g_buffer,
        camera.depth,
        camera.views,
        vpl.vpls.as_entire_binding(),
        vpl.plan_buffer.as_entire_binding(),
        &gather.irradiance.default_view,
    ));
    if let Some(sky) = sky {
        entries = entries.extend_with_indices(((7, sky.samples.as_entire_binding()),));
    }
    let bind_group = kernel.bind(&context, &cache, &entries);
    let size = gather.irradiance.texture.size();
    compute_pass(&mut context, "frugal_gi/gather", &[], |pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &bind_group, &[view_offset.offset]);
        if let Some(occluders) = occluders.bind_group().filter(|_| is_traced) {
            pass.set_bind_group(1, occluders, &[]);
        }
        let across = 8 * vpl.plan.interleave;
        let (width, height) = (size.width.div_ceil(across), size.height.div_ceil(across));
        pass.dispatch_workgroups(width, height, vpl.plan.sets);
    });
}

/// The irradiance of a GI camera. In the render world.
#[derive(Component)]
pub(super) struct GatherView {
    /// Irradiance of each low-resolution pixel: as gathered, then denoised where there is a filter.
    pub irradiance: CachedTexture,
    /// That of the frame before, of views that filter. It may have another resolution.
    pub previous: Option<CachedTexture>,
}

impl GatherView {
    /// Makes the irradiance [`previous`](Self::previous), and the other texture the one to gather
    /// into.
    pub(super) fn swap(&mut self, device: &RenderDevice, cells: UVec2) {
        let other = self.previous.take().filter(|texture| texture_size(texture) == cells);
        let other = other.unwrap_or_else(|| irradiance_texture(device, IRRADIANCE, cells));
        self.previous = Some(std::mem::replace(&mut self.irradiance, other));
    }

    /// Bytes held on the GPU.
    pub(super) fn bytes(&self) -> u64 {
        texture_bytes(&self.irradiance) + self.previous.as_ref().map_or(0, texture_bytes)
    }
}

/// A texture of irradiance at low resolution.
pub(super) fn irradiance_texture(
    device: &RenderDevice,
    label: &'static str,
    cells: UVec2,
) -> CachedTexture {
    low_resolution_texture(device, label, cells, TextureFormat::Rgba16Float)
}

/// A texture with a texel for each low-resolution pixel. Not from Bevy's cache, whose textures may
/// go to another camera in the next frame: what it holds must persist.
pub(super) fn low_resolution_texture(
    device: &RenderDevice,
    label: &'static str,
    cells: UVec2,
    format: TextureFormat,
) -> CachedTexture {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: cells.x, height: cells.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: TextureUsages::STORAGE_BINDING
            | TextureUsages::TEXTURE_BINDING
            | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let default_view = texture.create_view(&TextureViewDescriptor::default());
    CachedTexture { texture, default_view }
}

/// Pixels along both axes.
pub(super) fn texture_size(texture: &CachedTexture) -> UVec2 {
    UVec2::new(texture.texture.width(), texture.texture.height())
}

/// Bytes of a [`low_resolution_texture`].
pub(super) fn texture_bytes(texture: &CachedTexture) -> u64 {
    let size = texture_size(texture).as_u64vec2();
    let texel = texture.texture.format().block_copy_size(None).unwrap_or(0);
    size.x * size.y * u64::from(texel)
}

/// Gives every view its irradiance texture.
pub(super) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    mut views: Query<(Entity, &GiView, Option<&mut GatherView>), With<VplView>>,
) {
    for (entity, view, held) in &mut views {
        let Some(mut held) = held else {
            commands.entity(entity).insert(GatherView {
                irradiance: irradiance_texture(&device, IRRADIANCE, view.cells()),
                previous: None,
            });
            continue;
        };
        // Those that filter swap textures when their history advances.
        if !view.gi.filters() {
            held.previous = None;
            if texture_size(&held.irradiance) != view.cells() {
                held.irradiance = irradiance_texture(&device, IRRADIANCE, view.cells());
            }
        }
    }
}
