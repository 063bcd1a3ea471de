//! The cheap alternative to the gather and its filters: keeps indirect light on surfaces, in the
//! world, from frame to frame.
//!
//! A hash table holds square cells of surface; the farther away a cell is first seen, the larger it
//! is. Each frame samples light at one pixel of each tile of the image, and adds it to that pixel's
//! cell and to coarser cells around it. A pixel shows the interpolated mean of its cells; coarser
//! ones complete cells of few samples. Cells with enough samples take no more. Outdated light
//! fades.
//!
//! | file | job |
//! |---|---|
//! | `grid.wgsl` | finds the cells of a point of a surface; the format of what is sampled in a tile |
//! | `table.wgsl` | the table: keys and cells |
//! | `place.wgsl` | fades outdated light; chooses pixels and decides what is sampled there |
//! | `light.wgsl` | lights the chosen pixels, adds their light to cells, and shows it |
//! | `view` | a camera's buffers |
//!
//! The order of the GPU's threads does not matter: light is added as integers, and decisions read
//! the state of the frame before.

mod view;

use bevy::asset::{embedded_asset, load_embedded_asset};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::{ShaderDefVal, load_shader_library};

use super::compute::{CameraInputs, Kernel, compute_pass, drop_with, read, write};
use super::gather::{GatherView, ray_definitions};
use super::schedule::PassSystems;
use super::settings::{FrugalGi, GiVisibility};
use super::sky::SkyCamera;
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::VplView;
pub(super) use view::{CELL_BYTES, CacheSettings, CacheView, prepare, samples};

pub(super) fn build(app: &mut App) {
    load_shader_library!(app, "grid.wgsl");
    load_shader_library!(app, "table.wgsl");
    embedded_asset!(app, "place.wgsl");
    embedded_asset!(app, "light.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<CacheKernels>()
        .add_observer(drop_with::<GiView, CacheView>)
        .add_systems(Core3d, resolve.in_set(PassSystems::Cache));
}

/// The cache's pipelines. They are queued once a camera has a cache.
#[derive(Resource)]
pub(super) struct CacheKernels {
    age: Kernel,
    place: Kernel,
    /// Without a sky, and with one.
    light: [Kernel; 2],
    store: Kernel,
    resolve: Kernel,
}

impl FromWorld for CacheKernels {
    fn from_world(world: &mut World) -> Self {
        let compute = ShaderStages::COMPUTE;
        let (g_buffer, depth, view) = (
            texture_2d(TextureSampleType::Uint),
            texture_depth_2d(),
            uniform_buffer::<ViewUniform>(true),
        );
        let target = |format| texture_storage_2d(format, StorageTextureAccess::WriteOnly);
        let (records, light) = (
            texture_2d(TextureSampleType::Uint),
            texture_2d(TextureSampleType::Float { filterable: false }),
        );
        let age = BindGroupLayoutEntries::with_indices(
            compute,
            ((3, write()), (4, write()), (5, read())),
        );
        let with_table = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, write(), write(), read()),
        );
        let and_target = |format| {
            let target = BindGroupLayoutEntries::with_indices(compute, ((6, target(format)),));
            [&*with_table, &*target].concat()
        };
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), read(), records, target(TextureFormat::Rgba32Float)),
        );
        let sky = BindGroupLayoutEntries::with_indices(compute, ((7, read()),));
        let with_sky = [&*without_sky, &*sky].concat();
        let sampled = BindGroupLayoutEntries::with_indices(compute, ((6, records), (7, light)));
        let place = and_target(TextureFormat::Rg32Uint);
        let resolve = and_target(TextureFormat::Rgba16Float);
        let store = [&*with_table, &*sampled].concat();
        let places = load_embedded_asset!(world, "place.wgsl");
        let lights = load_embedded_asset!(world, "light.wgsl");
        let traced = |label, entry_point, entries: &[BindGroupLayoutEntry]| {
            let kernel = Kernel::new(label, entry_point, &lights, entries);
            kernel.with_group(OccluderBuffers::layout())
        };
        Self {
            age: Kernel::new("frugal_gi/cache/age", "age_cells", &places, &age),
            place: Kernel::new("frugal_gi/cache/place", "place_samples", &places, &place),
            light: [
                traced("frugal_gi/cache/light", "light_samples", &without_sky),
                traced("frugal_gi/cache/light/sky", "light_samples", &with_sky),
            ],
            store: traced("frugal_gi/cache/store", "store_samples", &store),
            resolve: traced("frugal_gi/cache/resolve", "resolve_cells", &resolve),
        }
    }
}

/// Definitions of what lights samples.
fn light_variant(has_sky: bool) -> Vec<ShaderDefVal> {
    ray_definitions(GiVisibility::Cached, has_sky)
}

/// Queues the pipelines of cameras that have a cache, and keeps their skies inactive until those that
/// gather them are compiled.
pub(super) fn prepare_pipelines(
    mut kernels: ResMut<CacheKernels>,
    cache: Res<PipelineCache>,
    mut cameras: Query<(&FrugalGi, Option<&mut SkyCamera>)>,
) {
    let CacheKernels { age, place, light: [light, light_by_sky], store, resolve } = &mut *kernels;
    for (_, sky) in cameras.iter_mut().filter(|(gi, _)| gi.caches()) {
        for kernel in [&mut *age, &mut *place, &mut *store, &mut *resolve] {
            kernel.queue(&cache, Vec::new());
        }
        // A sky may be inactive.
        light.queue(&cache, light_variant(false));
        if let Some(mut sky) = sky {
            light_by_sky.queue(&cache, light_variant(true));
            sky.is_active &= light_by_sky.get(&cache, &light_variant(true)).is_some();
        }
    }
}

/// In the view of a GI camera that has a cache: lights some of its cells, and makes the irradiance of
/// low-resolution pixels from them.
pub(super) fn resolve(
    view: ViewQuery<(
        &GiView,
        &VplView,
        &GatherView,
        &CacheView,
        &ViewPrepassTextures,
        &ViewUniformOffset,
        Option<&SkyCamera>,
    )>,
    kernels: Res<CacheKernels>,
    occluders: Res<OccluderBuffers>,
    pipelines: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (view, vpl, gather, cache, prepass, view_offset, sky) = view.into_inner();
    if !view.work.gather {
        return;
    }
    let sky = sky.filter(|_| view.sky_samples > 0);
    let light = &kernels.light[usize::from(sky.is_some())];
    let others = [&kernels.age, &kernels.place, &kernels.store, &kernels.resolve];
    let (
        Some(camera),
        Some(occluded),
        Some(lights),
        [Some(age), Some(place), Some(store), Some(resolve)],
    ) = (
        CameraInputs::new(prepass, &view_uniforms),
        occluders.bind_group(),
        light.get(&pipelines, &light_variant(sky.is_some())),
        others.map(|kernel| kernel.get(&pipelines, &[])),
    )
    else {
        return;
    };
    let (keys, cells, settings) = (
        cache.keys.as_entire_binding(),
        cache.cells.as_entire_binding(),
        cache.settings_buffer.as_entire_binding(),
    );
    let table = ((3, keys.clone()), (4, cells.clone()), (5, settings.clone()));
    let aging = kernels.age.bind(&context, &pipelines, &BindGroupEntries::with_indices(table));
    let with_table = || {
        DynamicBindGroupEntries::sequential((
            camera.g_buffer,
            camera.depth,
            camera.views.clone(),
            keys.clone(),
            cells.clone(),
            settings.clone(),
        ))
    };
    let placing = with_table().extend_with_indices(((6, &cache.records.default_view),));
    let placing = kernels.place.bind(&context, &pipelines, &placing);
    let mut lighting = DynamicBindGroupEntries::sequential((
        camera.g_buffer,
        camera.depth,
        camera.views.clone(),
        vpl.vpls.as_entire_binding(),
        vpl.plan_buffer.as_entire_binding(),
        &cache.records.default_view,
        &cache.light.default_view,
    ));
    if let Some(sky) = sky {
        lighting = lighting.extend_with_indices(((7, sky.samples.as_entire_binding()),));
    }
    let lighting = light.bind(&context, &pipelines, &lighting);
    let storing =
        with_table().extend_sequential((&cache.records.default_view, &cache.light.default_view));
    let storing = kernels.store.bind(&context, &pipelines, &storing);
    let resolving = with_table().extend_with_indices(((6, &gather.irradiance.default_view),));
    let resolving = kernels.resolve.bind(&context, &pipelines, &resolving);
    let clears = [(&cache.keys, 0, None), (&cache.cells, 0, None)];
    let clears = if cache.begins { &clears[..] } else { &[] };
    let groups = |texture: &Texture| (texture.width().div_ceil(8), texture.height().div_ceil(8));
    let tiles = groups(&cache.records.texture);
    let pixels = groups(&gather.irradiance.texture);
    compute_pass(&mut context, "frugal_gi/cache", clears, |pass| {
        if cache.ages {
            pass.set_pipeline(age);
            pass.set_bind_group(0, &aging, &[]);
            pass.dispatch_workgroups(view::SLOTS.div_ceil(64), 1, 1);
        }
        pass.set_bind_group(1, occluded, &[]);
        for (pipeline, bind_group, (width, height)) in [
            (place, &placing, tiles),
            (lights, &lighting, tiles),
            (store, &storing, tiles),
            (resolve, &resolving, pixels),
        ] {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
    });
}
