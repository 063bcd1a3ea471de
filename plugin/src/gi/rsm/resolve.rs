//! The pass that resolves a light's G-buffer into texels.

use bevy::asset::load_embedded_asset;
use bevy::core_pipeline::core_3d::{AlphaMask3d, Opaque3d, Transparent3d};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::ecs::prelude::*;
use bevy::pbr::Transmissive3d;
use bevy::render::extract_component::{ComponentUniforms, DynamicUniformIndex};
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases};
use bevy::render::render_resource::binding_types::{texture_2d, texture_depth_2d, uniform_buffer};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{
    ExtractedView, ViewDepthTexture, ViewUniform, ViewUniformOffset, ViewUniforms,
};
use bevy::shader::ShaderDefVal;

use super::lights::RsmLight;
use super::map::{LightMap, RsmView};
use crate::gi::compute::{Kernel, compute_pass, definitions, write};
use crate::gi::settings::GiShading;
use crate::gi::texels::{TexelRange, TexelStore};

#[derive(Resource)]
pub(in crate::gi) struct RsmKernel(Kernel);

fn variant(is_parallel: bool, shading: GiShading) -> Vec<ShaderDefVal> {
    definitions([(is_parallel, "PARALLEL"), (shading == GiShading::Lambertian, "LAMBERTIAN")])
}

impl FromWorld for RsmKernel {
    fn from_world(world: &mut World) -> Self {
        let shader = load_embedded_asset!(world, "resolve.wgsl");
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer::<ViewUniform>(true),
                uniform_buffer::<RsmLight>(true),
                write(),
            ),
        );
        let mut kernel = Kernel::new("frugal_gi/rsm/resolve", "resolve", &shader, &entries);
        for is_parallel in [false, true] {
            for shading in [GiShading::Standard, GiShading::Lambertian] {
                kernel.queue(world.resource(), variant(is_parallel, shading));
            }
        }
        Self(kernel)
    }
}

/// Removes the maps' cameras from the main pass before anything is specialised, compiled or queued
/// for it.
pub(super) fn drop_main_phases(
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

/// Reserves the texels of all maps.
pub(in crate::gi) fn reserve(mut store: ResMut<TexelStore>, maps: Query<&RsmLight, With<RsmView>>) {
    let ends = maps.iter().map(|light| light.texel_offset + light.resolution.pow(2));
    store.reserve(TexelRange::Maps, ends.max().unwrap_or(0) as usize);
}

/// In a map's view: resolves its G-buffer into texels.
pub(in crate::gi) fn resolve(
    view: ViewQuery<(
        &RsmView,
        &LightMap,
        &DynamicUniformIndex<RsmLight>,
        &ExtractedView,
        &ViewPrepassTextures,
        &ViewDepthTexture,
        &ViewUniformOffset,
    )>,
    kernel: Res<RsmKernel>,
    store: Res<TexelStore>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    lights: Res<ComponentUniforms<RsmLight>>,
    mut context: RenderContext,
) {
    let (rsm, map, light_index, extracted, prepass, depth, view_offset) = view.into_inner();
    let (Some(texels), Some(g_buffer), Some(views), Some(lights), Some(resolve)) = (
        &store.texels,
        prepass.deferred_view(),
        view_uniforms.uniforms.binding(),
        lights.uniforms().binding(),
        kernel.0.get(&cache, &variant(rsm.camera.is_some(), map.shading)),
    ) else {
        return;
    };
    let bind_group = kernel.0.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            g_buffer,
            depth.view(),
            views,
            lights,
            texels.as_entire_binding(),
        )),
    );
    let (width, height) = (extracted.viewport.z, extracted.viewport.w);
    compute_pass(&mut context, "frugal_gi/rsm", &[], |pass| {
        pass.set_bind_group(0, &bind_group, &[view_offset.offset, light_index.index()]);
        pass.set_pipeline(resolve);
        pass.dispatch_workgroups(width.div_ceil(8), height.div_ceil(8), 1);
    });
}
