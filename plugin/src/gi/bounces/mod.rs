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

use bevy::asset::{embedded_asset, load_embedded_asset};
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
pub(super) use camera::{BOUNCE_VPLS, prepare};
pub(super) use choice::{PATCHES, Patch};
pub use patches::GiPatches;

/// Patches of a workgroup of `reflect.wgsl`.
pub(in crate::gi) const PATCHES_PER_GROUP: usize = 8;
/// Threads of its largest workgroup, and of all of GI's, which sums up the rounds.
pub(in crate::gi) const SUM_LANES: u32 = 256;

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "reflect.wgsl");
    app.init_resource::<GiPatches>()
        .init_resource::<patches::Surfaces>()
        .add_plugins(ExtractResourcePlugin::<GiPatches>::default())
        .add_systems(
            PostUpdate,
            // Reads final transforms and visibility.
            patches::update
                .in_set(SceneSystems::Surfaces)
                .after(TransformSystems::Propagate)
                .after(VisibilitySystems::VisibilityPropagate),
        );
}

pub(super) fn finish(render_app: &mut SubApp) {
    render_app
        .init_gpu_resource::<BounceKernels>()
        .add_systems(Core3d, reflect.in_set(PassSystems::Bounces));
}

/// What lights the patches.
#[derive(Clone, Copy)]
enum Sources {
    /// In the first round: bounce VPLs.
    Vpls,
    /// The same, and the camera's sky.
    VplsAndSky,
    /// In further rounds: all patches.
    Patches,
}

/// Definitions of how patches reflect.
fn reflect_variant(sources: Sources, shading: GiShading) -> Vec<ShaderDefVal> {
    definitions([
        (matches!(sources, Sources::VplsAndSky), "SKY"),
        (matches!(sources, Sources::Patches), "FURTHER"),
        (shading == GiShading::Lambertian, "LAMBERTIAN"),
    ])
}

/// Pipelines are queued once a camera needs them.
#[derive(Resource)]
pub(super) struct BounceKernels {
    pick: Kernel,
    emit: Kernel,
    /// By [`Sources`].
    reflect: [Kernel; 3],
    sum: Kernel,
}

impl FromWorld for BounceKernels {
    fn from_world(world: &mut World) -> Self {
        let uniform = || uniform_buffer_sized(false, None);
        let compute = ShaderStages::COMPUTE;
        let picking = BindGroupLayoutEntries::sequential(compute, (read(), write()));
        let emitting = BindGroupLayoutEntries::with_indices(
            compute,
            ((1, write()), (2, read()), (3, write()), (6, uniform()), (7, write())),
        );
        let view = || uniform_buffer::<ViewUniform>(true);
        let by_vpls =
            BindGroupLayoutEntries::sequential(compute, (view(), uniform(), read(), write()));
        let by_patches =
            BindGroupLayoutEntries::sequential(compute, (view(), read(), read(), write()));
        let sky = BindGroupLayoutEntries::with_indices(compute, ((4, read()), (5, read())));
        let by_sky_too = [&*by_vpls, &*sky].concat();
        let summing = BindGroupLayoutEntries::with_indices(
            compute,
            ((2, read()), (3, write()), (6, uniform()), (7, write())),
        );
        let shader = load_embedded_asset!(world, "reflect.wgsl");
        let reflect = |entries: &[BindGroupLayoutEntry]| {
            Kernel::new("frugal_gi/bounces/reflect", "reflect_patches", &shader, entries)
                .with_group(OccluderBuffers::layout())
        };
        Self {
            pick: Kernel::new("frugal_gi/bounces/pick", "pick_patches", &shader, &picking),
            emit: Kernel::new("frugal_gi/bounces/emit", "emit_patches", &shader, &emitting),
            reflect: [reflect(&by_vpls), reflect(&by_sky_too), reflect(&by_patches)],
            sum: Kernel::new("frugal_gi/bounces/sum", "sum_rounds", &shader, &summing),
        }
    }
}

impl BounceKernels {
    /// Queues the pipelines of a camera, unless they were queued before.
    fn queue(&mut self, cache: &PipelineCache, has_sky: bool, shading: GiShading) {
        for kernel in [&mut self.pick, &mut self.emit, &mut self.sum] {
            kernel.queue(cache, vec![]);
        }
        let first = if has_sky { Sources::VplsAndSky } else { Sources::Vpls };
        for sources in [first, Sources::Patches] {
            self.reflect[sources as usize].queue(cache, reflect_variant(sources, shading));
        }
    }

    /// A round's kernel and pipeline, once it is compiled.
    fn reflect<'a>(
        &self,
        cache: &'a PipelineCache,
        sources: Sources,
        shading: GiShading,
    ) -> Option<(&Kernel, &'a ComputePipeline)> {
        let kernel = &self.reflect[sources as usize];
        Some((kernel, kernel.get(cache, &reflect_variant(sources, shading))?))
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
    let first = if sky.is_some() { Sources::VplsAndSky } else { Sources::Vpls };
    let (Some(pick), Some(emit), Some(first), Some(further), Some(sum)) = (
        kernels.pick.get(&cache, &[]),
        kernels.emit.get(&cache, &[]),
        kernels.reflect(&cache, first, shading),
        kernels.reflect(&cache, Sources::Patches, shading),
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
    let inputs = CameraInputs::new(prepass, &view_uniforms).map(|inputs| SampleInputs {
        camera: inputs,
        view_offset: view_offset.offset,
        texels,
        buffers,
        importance: &camera.importance,
        vpls: &camera.bounce_vpls,
        plan: (&camera.plan, BOUNCE_VPLS.count()),
    });
    let sampling = inputs.and_then(|inputs| vpl_kernels.passes(&context, &cache, false, inputs));
    let (Some(sampling), Some(views)) = (sampling, view_uniforms.uniforms.binding()) else {
        return;
    };
    let [patches, light, emitters] =
        [&camera.patches, &camera.light, &camera.emitters].map(|buffer| buffer.as_entire_binding());
    let picking =
        BindGroupEntries::sequential((patches.clone(), camera.importance.as_entire_binding()));
    let picking = kernels.pick.bind(&context, &cache, &picking);
    let emitting = BindGroupEntries::with_indices((
        (1, emitters.clone()),
        (2, patches.clone()),
        (3, light.clone()),
        (6, camera.range.as_entire_binding()),
        (7, texels.as_entire_binding()),
    ));
    let emitting = kernels.emit.bind(&context, &cache, &emitting);
    let entries = DynamicBindGroupEntries::sequential((
        views.clone(),
        camera.bounce_vpls.as_entire_binding(),
        patches.clone(),
        light.clone(),
    ));
    let entries = match sky {
        Some(sky) => entries.extend_sequential((
            sky.samples.as_entire_binding(),
            vpl_view.plan_buffer.as_entire_binding(),
        )),
        None => entries,
    };
    let first_group = first.0.bind(&context, &cache, &entries);
    let entries = BindGroupEntries::sequential((views, emitters, patches.clone(), light.clone()));
    let further_group = further.0.bind(&context, &cache, &entries);
    let summing = BindGroupEntries::with_indices((
        (2, patches),
        (3, light),
        (6, camera.range.as_entire_binding()),
        (7, texels.as_entire_binding()),
    ));
    let summing = kernels.sum.bind(&context, &cache, &summing);
    // In the first round patches emit nothing yet.
    let first_byte = u64::from(first_texel) * TEXEL_BYTES;
    let clears = [(texels, first_byte, Some(PATCHES as u64 * TEXEL_BYTES))];
    compute_pass(&mut context, "frugal_gi/bounces", &clears, |pass| {
        pass.set_bind_group(0, &picking, &[]);
        pass.set_pipeline(pick);
        pass.dispatch_workgroups(1, 1, 1);
        sampling.weigh(pass);
        sampling.sample(pass);
        for round in 0..rounds {
            let (group, (_, reflect)) = match round {
                0 => (&first_group, first),
                _ => {
                    pass.set_bind_group(0, &emitting, &[]);
                    pass.set_pipeline(emit);
                    pass.dispatch_workgroups(PATCHES.div_ceil(64) as u32, 1, 1);
                    (&further_group, further)
                }
            };
            pass.set_bind_group(0, group, &[view_offset.offset]);
            pass.set_bind_group(1, traced, &[]);
            pass.set_pipeline(reflect);
            pass.dispatch_workgroups(1, PATCHES.div_ceil(PATCHES_PER_GROUP) as u32, 1);
        }
        pass.set_bind_group(0, &summing, &[]);
        pass.set_pipeline(sum);
        pass.dispatch_workgroups(1, 1, 1);
    });
    camera.is_done.store(true, Ordering::Relaxed);
}
