//! The pipelines of patches.

use bevy::asset::load_embedded_asset;
use bevy::ecs::prelude::*;
use bevy::render::render_resource::binding_types::{uniform_buffer, uniform_buffer_sized};
use bevy::render::render_resource::*;
use bevy::render::view::ViewUniform;
use bevy::shader::ShaderDefVal;

use crate::gi::compute::{Kernel, definitions, read, write};
use crate::gi::trace::OccluderBuffers;

/// How patches reflect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) struct ReflectKind {
    /// Whether the camera's sky lights patches.
    pub has_sky: bool,
    /// Whether rays test alpha masks.
    pub has_masks: bool,
    pub is_lambertian: bool,
}

impl ReflectKind {
    fn definitions(self) -> Vec<ShaderDefVal> {
        let Self { has_sky, has_masks, is_lambertian } = self;
        definitions([(has_sky, "SKY"), (has_masks, "MASKS"), (is_lambertian, "LAMBERTIAN")])
    }
}

/// Pipelines are queued once a camera needs them.
#[derive(Resource)]
pub(in crate::gi) struct BounceKernels {
    pub(super) pick: Kernel,
    /// Without a sky and with one.
    pub(super) reflect: [Kernel; 2],
}

impl FromWorld for BounceKernels {
    fn from_world(world: &mut World) -> Self {
        let uniform = || uniform_buffer_sized(false, None);
        let compute = ShaderStages::COMPUTE;
        let picking = BindGroupLayoutEntries::sequential(compute, (read(), write()));
        let view = uniform_buffer::<ViewUniform>(true);
        let without_sky = BindGroupLayoutEntries::sequential(
            compute,
            (view, uniform(), uniform(), read(), write()),
        );
        let with_sky = BindGroupLayoutEntries::sequential(
            compute,
            (view, uniform(), uniform(), read(), write(), read(), read()),
        );
        let (pick, reflect) =
            (load_embedded_asset!(world, "pick.wgsl"), load_embedded_asset!(world, "reflect.wgsl"));
        let reflect = |label, entries: &[BindGroupLayoutEntry]| {
            Kernel::new(label, "reflect_patches", &reflect, entries)
                .with_group(OccluderBuffers::layout())
        };
        Self {
            pick: Kernel::new("frugal_gi/bounces/pick", "pick_patches", &pick, &picking),
            reflect: [
                reflect("frugal_gi/bounces/reflect", &without_sky),
                reflect("frugal_gi/bounces/reflect/sky", &with_sky),
            ],
        }
    }
}

impl BounceKernels {
    /// The pipeline of a kind, if it is compiled; until then, the one that treats all triangles as
    /// solid.
    pub(super) fn get<'a>(
        &self,
        cache: &'a PipelineCache,
        kind: ReflectKind,
    ) -> Option<&'a ComputePipeline> {
        let reflect = &self.reflect[usize::from(kind.has_sky)];
        let compiled = |kind: ReflectKind| reflect.get(cache, &kind.definitions());
        compiled(kind).or_else(|| compiled(ReflectKind { has_masks: false, ..kind }))
    }

    /// Queues the pipelines of a kind, unless they were queued before.
    pub(super) fn queue(&mut self, cache: &PipelineCache, kind: ReflectKind) {
        self.pick.queue(cache, Vec::new());
        self.reflect[usize::from(kind.has_sky)].queue(cache, kind.definitions());
    }
}
