//! The composite: irradiance, upsampled along surfaces, times albedo, added to the image before
//! tone mapping.
//!
//! It is drawn between deferred lighting and everything that lies over it or reflects it:
//! screen-space reflections, forward-rendered meshes, the sky with its aerial perspective, fog
//! volumes, and transparent meshes. Distance fog is part of Bevy's shading of each surface, so the
//! composite dims its own light by it.

mod pipelines;

use bevy::asset::embedded_asset;
use bevy::core_pipeline::core_3d::{main_opaque_pass_3d, main_transparent_pass_3d};
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::ecs::query::QueryData;
use bevy::ecs::system::SystemParam;
use bevy::light::IrradianceVolume;
use bevy::pbr::{
    FogMeta, RenderViewLightProbes, ScreenSpaceAmbientOcclusionResources, ViewFogUniformOffset,
    main_transmissive_pass_3d,
};
use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::diagnostic::RecordDiagnostics;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewTarget, ViewUniformOffset, ViewUniforms};
use bevy::render::{GpuResourceAppExt, Render, RenderSystems};

use super::forward::{ForwardCamera, ForwardView};
use super::gather::GatherView;
use super::schedule::GiSystems;
use super::settings::{FrugalGi, GiOutput};
use super::sky::SkyCamera;
use super::view::{GiShare, GiView, SkySource};
use pipelines::{CompositePipeline, CompositePipelines};

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "composite.wgsl");
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<CompositePipelines>()
        .add_systems(
            Render,
            (
                leave_out_volumes
                    .after(RenderSystems::ExtractCommands)
                    .before(RenderSystems::PrepareAssets),
                pipelines::prepare.in_set(RenderSystems::Prepare),
            ),
        )
        .add_systems(
            Core3d,
            (
                composite.in_set(GiSystems::Composite),
                composite_alone
                    .in_set(Core3dSystems::MainPass)
                    .after(main_opaque_pass_3d)
                    .before(main_transmissive_pass_3d)
                    .before(main_transparent_pass_3d),
            ),
        );
}

/// A GI camera's view.
#[derive(QueryData)]
pub(super) struct CompositeView {
    gi: &'static FrugalGi,
    share: &'static GiShare,
    camera: &'static ExtractedCamera,
    target: &'static ViewTarget,
    prepass: &'static ViewPrepassTextures,
    offset: &'static ViewUniformOffset,
    fog: Option<&'static ViewFogUniformOffset>,
    occlusion: Option<&'static ScreenSpaceAmbientOcclusionResources>,
    pipeline: &'static CompositePipeline,
    gathered: Option<(&'static GiView, &'static GatherView)>,
}

/// What the composites of all views share.
#[derive(SystemParam)]
pub(super) struct CompositeInputs<'w> {
    cache: Res<'w, PipelineCache>,
    view_uniforms: Res<'w, ViewUniforms>,
    fogs: Res<'w, FogMeta>,
}

/// Adds indirect light to deferred surfaces.
pub(super) fn composite(
    view: ViewQuery<CompositeView>,
    inputs: CompositeInputs,
    context: RenderContext,
) {
    draw(false, view.into_inner(), &inputs, context);
}

/// Replaces the image by indirect light, after opaque meshes of every kind.
fn composite_alone(
    view: ViewQuery<CompositeView>,
    inputs: CompositeInputs,
    context: RenderContext,
) {
    draw(true, view.into_inner(), &inputs, context);
}

fn draw(
    alone: bool,
    view: CompositeViewItem,
    CompositeInputs { cache, view_uniforms, fogs }: &CompositeInputs,
    mut context: RenderContext,
) {
    if alone != (view.gi.output == GiOutput::IndirectOnly) {
        return;
    }
    let CompositePipeline { id, key } = view.pipeline;
    let mut offsets = vec![view.offset.offset];
    let bind_group = (|| {
        let (_, gather) = view.gathered?;
        let mut entries = DynamicBindGroupEntries::sequential((
            view.prepass.deferred_view()?,
            view.prepass.depth_view()?,
            view_uniforms.uniforms.binding()?,
            &gather.irradiance.default_view,
        ));
        if key.fog {
            offsets.push(view.fog?.offset);
            entries = entries.extend_with_indices(((4, fogs.gpu_fogs.binding()?),));
        }
        if key.occlusion {
            let occlusion = &view.occlusion?.screen_space_ambient_occlusion_texture;
            entries = entries.extend_with_indices(((5, &occlusion.default_view),));
        }
        let layout = cache.get_bind_group_layout(&key.layout());
        Some(context.render_device().create_bind_group("frugal_gi/composite", &layout, &entries))
    })();
    let drawn = bind_group.zip(cache.get_render_pipeline(*id));
    if drawn.is_none() && !alone {
        return;
    }
    // The fraction may have changed while its pipeline compiles: low-resolution pixels of another
    // size would be misread.
    let drawn = drawn.filter(|_| {
        view.gathered
            .is_some_and(|(gathered, _)| gathered.gi.pixel_fraction == view.gi.pixel_fraction)
    });

    let mut attachment = view.target.get_color_attachment();
    // A viewport's neighbours stay.
    if alone && (view.camera.viewport.is_none() || drawn.is_none()) {
        attachment.ops.load = LoadOp::Clear(default());
    }
    let diagnostics = context.diagnostic_recorder();
    let diagnostics = diagnostics.as_deref();
    let span = diagnostics.time_span(context.command_encoder(), "frugal_gi/composite");
    {
        let mut pass = context.begin_tracked_render_pass(RenderPassDescriptor {
            label: Some("frugal_gi/composite"),
            color_attachments: &[Some(attachment)],
            ..default()
        });
        if let Some((bind_group, pipeline)) = &drawn {
            if let Some(viewport) = &view.camera.viewport {
                pass.set_camera_viewport(viewport);
            }
            pass.set_blend_constant(LinearRgba::gray(view.share.0));
            pass.set_render_pipeline(pipeline);
            pass.set_bind_group(0, bind_group, &offsets);
            pass.draw(0..3, 0..1);
        }
    }
    span.end(context.command_encoder());
}

/// Keeps baked light from being counted twice.
///
/// An irradiance volume holds the diffuse light that reaches its voxels: that of bounces, which a GI
/// camera gathers, and of the sky. While a camera gathers, Bevy does not get its volumes; where GI is
/// off, by its settings or for want of light, it does. So a level of a knob that switches GI off falls
/// back to what was baked.
///
/// A volume of ours stays while it is filled. Where it is bound, Bevy leaves out the diffuse light of
/// an environment map, so the sky has to be gathered, if there is one.
///
/// Runs before Bevy notes, for the keys of pipelines, whether a view has volumes: pipelines that read
/// volumes which are not bound end rendering. A view is known to gather from its second frame on.
fn leave_out_volumes(
    mut commands: Commands,
    views: Query<
        (Entity, &FrugalGi, Has<GiView>, Has<ForwardCamera>, Has<ForwardView>, ViewSky),
        With<RenderViewLightProbes<IrradianceVolume>>,
    >,
) {
    for (view, gi, gathers, has_own, is_filled, (source, sky)) in &views {
        let sky_is_gathered = source.is_none() || sky.is_some_and(|sky| sky.is_active);
        let keeps_own = is_filled && gi.traces() && sky_is_gathered;
        let keeps =
            if has_own && gi.traces() { keeps_own } else { !gathers || gi.irradiance_volumes };
        if !keeps {
            commands.entity(view).remove::<RenderViewLightProbes<IrradianceVolume>>();
        }
    }
}

/// A camera's environment map, and what is gathered of it.
type ViewSky = (Option<&'static SkySource>, Option<&'static SkyCamera>);
