//! Further bounces: light that surfaces reflect a second time and more.
//!
//! As in radiosity, points on all surfaces of the scene represent pieces of them: *patches*. When
//! the maps are rendered, the camera's sky lights each patch, and so do bounce VPLs, sampled by
//! flux and by importance to the patches. For each further bounce the patches light one another by
//! what they reflected in the round before. The sum over the rounds (the Neumann series of the
//! radiosity equation: Goral et al. 1984) becomes a texel behind those of the maps and of emissive
//! surfaces, and is treated like theirs. Where all bounces are asked for, the series is ended as a
//! geometric one.
//!
//! | file | world | job |
//! |---|---|---|
//! | `choice` | none | a patch as the GPU reads it; where patches are dense; selects points for them |
//! | `points` | main | points on all surfaces, more on those that matter |
//! | `chosen` | main | the points from which a camera's patches are chosen, kept while meshes move |
//! | `patches` | main | keeps every camera's patches: some of these points, denser near the camera |
//! | `camera` | render | a camera's buffers, and whether its patches are due to reflect again |
//! | `reflect.wgsl` | render | importance points of the patches; reflection by the patches |

mod camera;
mod choice;
mod chosen;
mod patches;
mod points;

use std::sync::atomic::Ordering;

use bevy::asset::{AssetEventSystems, embedded_asset, load_embedded_asset};
use bevy::camera::visibility::VisibilitySystems;
use bevy::core_pipeline::prepass::ViewPrepassTextures;
use bevy::core_pipeline::schedule::Core3d;
use bevy::prelude::*;
use bevy::render::GpuResourceAppExt;
use bevy::render::extract_resource::ExtractResourcePlugin;
use bevy::render::render_resource::binding_types::{uniform_buffer, uniform_buffer_sized};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, ViewQuery};
use bevy::render::view::{ViewUniform, ViewUniformOffset, ViewUniforms};
use bevy::shader::ShaderDefVal;

use super::compute::{CameraInputs, Kernel, compute_pass, definitions, read, write};
use super::schedule::{PassSystems, SceneSystems};
use super::settings::GiShading;
use super::sky::SkyCamera;
use super::texels::{TEXEL_BYTES, TexelRange, TexelStore};
use super::trace::OccluderBuffers;
use super::view::GiView;
use super::vpl::{SampleInputs, VplKernels, VplView};
pub(crate) use camera::BounceCamera;
pub use camera::GiBouncesState;
use camera::LightInputs;
pub(super) use camera::{BOUNCE_VPLS, PATCH_LIGHT_BYTES, prepare};
use choice::PATCHES;
pub(super) use choice::Patch;
pub use patches::GiPatches;

/// Patches of a workgroup of `reflect.wgsl`.
pub(in crate::gi) const PATCHES_PER_GROUP: usize = 8;

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "reflect.wgsl");
    app.init_resource::<GiPatches>()
        .init_resource::<patches::Surfaces>()
        .add_plugins(ExtractResourcePlugin::<GiPatches>::default())
        .add_systems(
            PostUpdate,
            // Reads final transforms, visibility and this frame's asset events.
            patches::update
                .in_set(SceneSystems::Surfaces)
                .after(AssetEventSystems)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate),
        );
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<BounceKernels>()
        .add_systems(Core3d, reflect.in_set(PassSystems::Bounces));
}

/// Definitions of how patches reflect. `has_sky`: the camera's sky lights them.
fn reflect_variant(has_sky: bool, shading: GiShading) -> Vec<ShaderDefVal> {
    definitions([(has_sky, "SKY"), (shading == GiShading::Lambertian, "LAMBERTIAN")])
}

/// Pipelines are queued once a camera needs them.
#[derive(Resource)]
pub(super) struct BounceKernels {
    pick: Kernel,
    /// Without a sky and with one.
    reflect: [Kernel; 2],
    sum: Kernel,
}

impl FromWorld for BounceKernels {
    fn from_world(world: &mut World) -> Self {
        let uniform = || uniform_buffer_sized(false, None);
        let compute = ShaderStages::COMPUTE;
        let picking = BindGroupLayoutEntries::sequential(compute, (read(), write()));
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (uniform_buffer::<ViewUniform>(true), uniform(), uniform(), read(), write(), write()),
        );
        let sky = BindGroupLayoutEntries::with_indices(compute, ((6, read()), (7, read())));
        let summing = BindGroupLayoutEntries::with_indices(
            compute,
            ((2, uniform()), (4, write()), (5, write())),
        );
        let with_sky = [&*without_sky, &*sky].concat();
        let shader = load_embedded_asset!(world, "reflect.wgsl");
        let reflect = |entries: &[BindGroupLayoutEntry]| {
            Kernel::new("frugal_gi/bounces/reflect", "reflect_patches", &shader, entries)
                .with_group(OccluderBuffers::layout())
        };
        Self {
            pick: Kernel::new("frugal_gi/bounces/pick", "pick_patches", &shader, &picking),
            reflect: [reflect(&without_sky), reflect(&with_sky)],
            sum: Kernel::new("frugal_gi/bounces/sum", "sum_rounds", &shader, &summing),
        }
    }
}

impl BounceKernels {
    /// Queues the pipelines of a camera, unless they were queued before: the sky lights the first round
    /// alone.
    fn queue(&mut self, cache: &PipelineCache, has_sky: bool, shading: GiShading) {
        self.pick.queue(cache, Vec::new());
        self.sum.queue(cache, Vec::new());
        self.reflect[0].queue(cache, reflect_variant(false, shading));
        if has_sky {
            self.reflect[1].queue(cache, reflect_variant(true, shading));
        }
    }
}

pub(super) fn reserve(mut store: ResMut<TexelStore>, patches: Res<GiPatches>) {
    store.reserve(TexelRange::Patches, patches.texel_count());
}

/// In a GI camera's view: lights its patches, once for each bounce beyond the first.
pub(super) fn reflect(
    view: ViewQuery<(
        &BounceCamera,
        &GiView,
        &VplView,
        Option<&SkyCamera>,
        &ViewPrepassTextures,
        &ViewUniformOffset,
    )>,
    kernels: Res<BounceKernels>,
    vpl_kernels: Res<VplKernels>,
    store: Res<TexelStore>,
    occluders: Res<OccluderBuffers>,
    cache: Res<PipelineCache>,
    view_uniforms: Res<ViewUniforms>,
    mut context: RenderContext,
) {
    let (camera, gi_view, vpl_view, sky, prepass, view_offset) = view.into_inner();
    // Resampling reuses last frame's weights.
    if !gi_view.work.sample || gi_view.work.samples_again() || !camera.is_due {
        return;
    }
    let LightInputs { shading, rounds, first_texel, .. } = camera.inputs;
    let sky = sky.filter(|_| camera.inputs.has_sky());
    let has_sky = sky.is_some();
    let [further, by_sky] = &kernels.reflect;
    let first = if has_sky { by_sky } else { further };
    let (Some(pick), Some(reflect_first), Some(reflect_further), Some(sum)) = (
        kernels.pick.get(&cache, &[]),
        first.get(&cache, &reflect_variant(has_sky, shading)),
        further.get(&cache, &reflect_variant(false, shading)),
        kernels.sum.get(&cache, &[]),
    ) else {
        return;
    };
    let (Some(texels), Some(traced), Some(buffers)) =
        (&store.texels, occluders.bind_group(), &vpl_view.sampling)
    else {
        return;
    };
    // The layout of the weights has the G-buffer and depth; they are not read here. Tile visibility
    // for patches would take as many rays as for the image, without a measurable gain.
    let passes = |buffers| {
        let inputs = SampleInputs {
            camera: CameraInputs::new(prepass, &view_uniforms)?,
            view_offset: view_offset.offset,
            texels,
            buffers,
            importance: &camera.importance,
            vpls: &camera.bounce_vpls,
            plan: (&camera.plan, BOUNCE_VPLS.count()),
        };
        vpl_kernels.passes(&context, &cache, false, inputs)
    };
    let (Some(from_all), Some(from_patches)) = (passes(buffers), passes(&camera.sampling)) else {
        return;
    };
    let Some(views) = view_uniforms.uniforms.binding() else { return };
    let picking = kernels.pick.bind(
        &context,
        &cache,
        &BindGroupEntries::sequential((
            camera.patches.as_entire_binding(),
            camera.importance.as_entire_binding(),
        )),
    );
    let entries = DynamicBindGroupEntries::sequential((
        views,
        camera.bounce_vpls.as_entire_binding(),
        camera.range.as_entire_binding(),
        camera.patches.as_entire_binding(),
        texels.as_entire_binding(),
        camera.light.as_entire_binding(),
    ));
    let reflecting_further = further.bind(&context, &cache, &entries);
    let sky = sky.map(|sky| {
        let sky = (sky.samples.as_entire_binding(), sky.plan_buffer.as_entire_binding());
        first.bind(&context, &cache, &entries.extend_sequential(sky))
    });
    let reflecting_first = sky.as_ref().unwrap_or(&reflecting_further);
    let summing = kernels.sum.bind(
        &context,
        &cache,
        &BindGroupEntries::with_indices((
            (2, camera.range.as_entire_binding()),
            (4, texels.as_entire_binding()),
            (5, camera.light.as_entire_binding()),
        )),
    );
    // In the first round patches emit nothing yet.
    let first_byte = u64::from(first_texel) * TEXEL_BYTES;
    let clears =
        [(texels, first_byte, Some(PATCHES as u64 * TEXEL_BYTES)), (&camera.light, 0, None)];
    compute_pass(&mut context, "frugal_gi/bounces", &clears, |pass| {
        pass.set_bind_group(0, &picking, &[]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        for round in 0..rounds {
            let (passes, reflect, reflecting) = if round == 0 {
                (&from_all, reflect_first, reflecting_first)
            } else {
                (&from_patches, reflect_further, &reflecting_further)
            };
            passes.weigh(pass);
            passes.sample(pass);
            pass.set_bind_group(0, reflecting, &[view_offset.offset]);
            pass.set_bind_group(1, traced, &[]);
            pass.set_pipeline(reflect);
            pass.dispatch_workgroups(1, PATCHES.div_ceil(PATCHES_PER_GROUP) as u32, 1);
        }
        if rounds > 1 {
            pass.set_bind_group(0, &summing, &[]);
            pass.set_pipeline(sum);
            pass.dispatch_workgroups(1, 1, 1);
        }
    });
    camera.is_done.store(true, Ordering::Relaxed);
}
