//! The pass that compares a part of a camera's image with the same part at the best settings.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::core_pipeline::upscaling::upscaling;
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{sampler, texture_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ViewTarget;
use bevy::render::{GpuResourceAppExt, RenderApp};

use super::ErrorProbe;
use crate::gi::compute::{Kernel, compute_pass, write};
use crate::resolution::ScaledView;

/// Pixels of a window of SSIM along a side: a part must be wider.
const WINDOW: u32 = 11;
/// Most windows along a side of a part; partial sums of more would not fit their buffer.
const MAX_SIDE: u32 = 4096;
/// Windows along a side of a workgroup of `compare.wgsl`.
const GROUP: u32 = 8;

/// A part of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Tile {
    /// Size of the whole image, pixels.
    pub full: UVec2,
    /// Upper left corner, pixels.
    pub offset: UVec2,
    /// Width and height, pixels; as long and as wide as the whole image's in proportion.
    pub size: UVec2,
}

impl Tile {
    /// The part number `count` of an image: at most `share` of its width and height, each time
    /// elsewhere. `None` where the image is too small for a window of SSIM, or too large.
    pub(super) fn new(full: UVec2, share: f32, count: u32) -> Option<Self> {
        let common = greatest_common_divisor(full.x, full.y);
        if common == 0 {
            return None;
        }
        // The projection of a part has the whole image's aspect ratio only where both are whole
        // multiples of this.
        let step = full / common;
        let share = if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) };
        let least = step.as_vec2().recip().max_element() * WINDOW as f32;
        let steps = ((share * common as f32) as u32).max(least.ceil() as u32).clamp(1, common);
        let size = step * steps;
        if size.min_element() < WINDOW || size.max_element() > MAX_SIDE {
            return None;
        }
        let place = (place(count) * (full - size + 1).as_vec2()).as_uvec2();
        Some(Self { full, offset: place.min(full - size), size })
    }
}

/// Points that fill the unit square evenly (Roberts 2018, the R2 sequence).
fn place(count: u32) -> Vec2 {
    let along = |step: f64| (0.5 + step * f64::from(count)).fract() as f32;
    Vec2::new(along(0.754_877_666_246_693), along(0.569_840_290_998_053))
}

fn greatest_common_divisor(mut a: u32, mut b: u32) -> u32 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

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
    kernel: Kernel,
    sampler: Sampler,
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
                write(),
            ),
        );
        let sampler = world.resource::<RenderDevice>().create_sampler(&SamplerDescriptor {
            label: Some("frugal_gi/error_meter"),
            min_filter: FilterMode::Linear,
            mag_filter: FilterMode::Linear,
            ..default()
        });
        let shader = load_embedded_asset!(world, "compare.wgsl");
        let kernel = Kernel::new("frugal_gi/error_meter", "compare", &shader, &entries);
        Self { kernel, sampler }
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
    let ComparePipeline { kernel, sampler } = &mut *pipeline;
    kernel.queue(&cache, Vec::new());
    let Some(pipeline) = kernel.get(&cache, &[]) else { return };
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
    let bindings = kernel.bind(&context, &cache, &entries);
    compute_pass(&mut context, "frugal_gi/error_meter", &[], |pass| {
        let groups = groups(tile);
        pass.set_bind_group(0, &bindings, &[]);
        pass.set_pipeline(pipeline);
        pass.dispatch_workgroups(groups.x, groups.y, 1);
    });
}

#[cfg(test)]
#[path = "compare_tests.rs"]
mod tests;
