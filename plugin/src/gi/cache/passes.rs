//! The cache's passes.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{
    texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::ShaderDefVal;

use super::view::CacheView;
use crate::gi::compute::{CameraInputs, Kernel, compute_pass, definitions, read, write};
use crate::gi::gather::GatherView;
use crate::gi::settings::{FrugalGi, GiVisibility};
use crate::gi::sky::SkyCamera;
use crate::gi::trace::OccluderBuffers;
use crate::gi::view::GiView;
use crate::gi::vpl::VplView;

/// The cache's pipelines. They are queued once a camera has a cache.
#[derive(Resource)]
pub(in crate::gi) struct CacheKernels {
    age: Kernel,
    place: Kernel,
    /// Without a sky, and with one.
    light: [Kernel; 2],
    store: Kernel,
    resolve: Kernel,
}

/// Definitions of what traces.
fn traced(has_masks: bool) -> Vec<ShaderDefVal> {
    definitions([(has_masks, "MASKS")])
}

fn lit(has_sky: bool, has_masks: bool) -> Vec<ShaderDefVal> {
    let mut all = traced(has_masks);
    all.push(ShaderDefVal::UInt("RAYS".into(), GiVisibility::Cached.rays()));
    if has_sky {
        all.push(ShaderDefVal::UInt("SKY_RAYS".into(), GiVisibility::Cached.sky_rays()));
    }
    all
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
        let place = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, write(), write(), read(), target(TextureFormat::Rg32Uint)),
        );
        let light_target = target(TextureFormat::Rgba32Float);
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), records, read(), light_target),
        );
        let with_sky = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, read(), records, read(), light_target, read(), read()),
        );
        let store = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, write(), write(), read(), records, light),
        );
        let resolve = BindGroupLayoutEntries::sequential(
            compute,
            (g_buffer, depth, view, write(), write(), read(), target(TextureFormat::Rgba16Float)),
        );
        let shader = load_embedded_asset!(world, "light.wgsl");
        let light = |label, entries: &[BindGroupLayoutEntry]| {
            Kernel::new(label, "light_samples", &shader, entries)
                .with_group(OccluderBuffers::layout())
        };
        let light = [
            light("frugal_gi/cache/light", &without_sky),
            light("frugal_gi/cache/light/sky", &with_sky),
        ];
        let [ages, places, stores, resolves] = [
            load_embedded_asset!(world, "age.wgsl"),
            load_embedded_asset!(world, "place.wgsl"),
            load_embedded_asset!(world, "store.wgsl"),
            load_embedded_asset!(world, "resolve.wgsl"),
        ];
        Self {
            age: Kernel::new("frugal_gi/cache/age", "age_cells", &ages, &age),
            place: Kernel::new("frugal_gi/cache/place", "place_samples", &places, &place),
            light,
            store: Kernel::new("frugal_gi/cache/store", "store_samples", &stores, &store)
                .with_group(OccluderBuffers::layout()),
            resolve: Kernel::new("frugal_gi/cache/resolve", "resolve_cells", &resolves, &resolve)
                .with_group(OccluderBuffers::layout()),
        }
    }
}

/// The pipelines of a frame.
struct CachePipelines<'a> {
    age: &'a ComputePipeline,
    place: &'a ComputePipeline,
    light: &'a ComputePipeline,
    store: &'a ComputePipeline,
    resolve: &'a ComputePipeline,
}

impl CacheKernels {
    /// Queues the pipelines of a camera.
    fn queue(&mut self, cache: &PipelineCache, has_sky: bool, has_masks: bool) {
        self.age.queue(cache, Vec::new());
        self.place.queue(cache, Vec::new());
        self.light[usize::from(has_sky)].queue(cache, lit(has_sky, has_masks));
        self.store.queue(cache, traced(has_masks));
        self.resolve.queue(cache, traced(has_masks));
    }

    /// Whether the pipeline that lights samples by a sky is compiled.
    fn has_sky(&self, cache: &PipelineCache) -> bool {
        self.light[1].get(cache, &lit(true, false)).is_some()
    }

    /// The pipelines, if they are compiled: those that test masks, or until then those that treat all
    /// triangles as solid.
    fn get<'a>(
        &self,
        cache: &'a PipelineCache,
        has_sky: bool,
        has_masks: bool,
    ) -> Option<CachePipelines<'a>> {
        let of = |has_masks| {
            Some(CachePipelines {
                age: self.age.get(cache, &[])?,
                place: self.place.get(cache, &[])?,
                light: self.light[usize::from(has_sky)].get(cache, &lit(has_sky, has_masks))?,
                store: self.store.get(cache, &traced(has_masks))?,
                resolve: self.resolve.get(cache, &traced(has_masks))?,
            })
        };
        of(has_masks).or_else(|| of(false))
    }
}

/// Queues the pipelines of cameras that have a cache, and keeps their skies inactive until those that
/// gather them are compiled.
pub(super) fn prepare_pipelines(
    mut kernels: ResMut<CacheKernels>,
    cache: Res<PipelineCache>,
    occluders: Res<OccluderBuffers>,
    mut cameras: Query<(&FrugalGi, Option<&mut SkyCamera>)>,
) {
    for (_, sky) in cameras.iter_mut().filter(|(gi, _)| gi.caches()) {
        // A sky may be inactive.
        for has_sky in [false, sky.is_some()] {
            for has_masks in [false, occluders.are_masked()] {
                kernels.queue(&cache, has_sky, has_masks);
            }
        }
        if let Some(mut sky) = sky {
            sky.is_active &= kernels.has_sky(&cache);
        }
    }
}

/// In the view of a GI camera that has a cache: lights some of its cells, and makes the irradiance of
/// low-resolution pixels from them.
pub(in crate::gi) fn resolve(
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
    let (Some(camera), Some(ready), Some(traced)) = (
        CameraInputs::new(prepass, &view_uniforms),
        kernels.get(&pipelines, sky.is_some(), occluders.are_masked()),
        occluders.bind_group(),
    ) else {
        return;
    };
    let (keys, cells, settings) = (
        cache.keys.as_entire_binding(),
        cache.cells.as_entire_binding(),
        cache.settings_buffer.as_entire_binding(),
    );
    let aging = kernels.age.bind(
        &context,
        &pipelines,
        &BindGroupEntries::with_indices((
            (3, keys.clone()),
            (4, cells.clone()),
            (5, settings.clone()),
        )),
    );
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
    let lighting = DynamicBindGroupEntries::sequential((
        camera.g_buffer,
        camera.depth,
        camera.views.clone(),
        vpl.vpls.as_entire_binding(),
        &cache.records.default_view,
        vpl.plan_buffer.as_entire_binding(),
        &cache.light.default_view,
    ));
    let lighting = match sky {
        Some(sky) => lighting.extend_sequential((
            sky.samples.as_entire_binding(),
            sky.plan_buffer.as_entire_binding(),
        )),
        None => lighting,
    };
    let lighting = kernels.light[usize::from(sky.is_some())].bind(&context, &pipelines, &lighting);
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
            pass.set_pipeline(ready.age);
            pass.set_bind_group(0, &aging, &[]);
            pass.dispatch_workgroups(cache.slots().div_ceil(64), 1, 1);
        }
        pass.set_bind_group(1, traced, &[]);
        for (pipeline, bind_group, (width, height)) in [
            (ready.place, &placing, tiles),
            (ready.light, &lighting, tiles),
            (ready.store, &storing, tiles),
            (ready.resolve, &resolving, pixels),
        ] {
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &[view_offset.offset]);
            pass.dispatch_workgroups(width, height, 1);
        }
    });
}
