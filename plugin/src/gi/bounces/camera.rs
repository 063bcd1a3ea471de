//! A GI camera's buffers for bounces beyond the first.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;

use super::BounceKernels;
use super::choice::{PATCHES, Patch};
use super::patches::GiPatches;
use crate::cut::Jumps;
use crate::gi::compute::{bytes_of, empty_buffer, filled_buffer};
use crate::gi::settings::{FrugalGi, GiShading};
use crate::gi::sky::{SkyCamera, SkyInputs};
use crate::gi::texels::{TEXEL_BYTES, TexelRange, TexelRow, TexelStore};
use crate::gi::view::GiFrame;
use crate::gi::vpl::{IMPORTANCE_POINTS_BYTES, VPL_BYTES, VplPlan};

/// The bounce VPLs of the first round: every patch evaluates all of them.
pub(in crate::gi) const BOUNCE_VPLS: VplPlan =
    VplPlan { interleave: 1, sets: 1, per_set: 1024, sky_samples: 0, sequence: 0, cell: [1; 2] };

/// Bytes of a patch's light of one round.
const LIGHT_BYTES: u64 = 16;
/// Rounds where all bounces are asked for: `reflect.wgsl` compares the second's light with the first's.
const ROUNDS_OF_ALL: u32 = 2;
/// Bound on the ratio of a bounce's light to that of the bounce before, where all are asked for: a
/// white closed room's light is no more than ten times that of its last round.
const LARGEST_RATIO: f32 = 0.9;

/// What the light of patches depends on, apart from the scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct LightInputs {
    /// Rounds of reflection: one for two bounces.
    pub rounds: u32,
    /// Whether rounds that are not run count, too.
    extrapolates: bool,
    emissive: bool,
    exposure: f32,
    sky: Option<SkyInputs>,
    /// The buffer of texels.
    store: BufferId,
    /// Index of the first patch's texel in it.
    pub first_texel: u32,
    pub shading: GiShading,
}

/// The GPU objects of a camera's patches, for tests and debuggers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GiBouncesState {
    /// The bounce VPLs, which light its patches (`vpl/vpl.wgsl`): one set, of the first round.
    pub bounce_vpls: Buffer,
    /// Its patches' texels in the store.
    pub texels: Range<u32>,
}

/// A GI camera's buffers for bounces beyond the first. In the render world.
#[derive(Component)]
pub(crate) struct BounceCamera {
    /// The content of `patches`.
    held: Arc<Vec<Patch>>,
    pub(super) patches: Buffer,
    /// The bounce VPLs.
    pub(super) bounce_vpls: Buffer,
    pub(super) plan: Buffer,
    /// VPLs of the patches' own light, for further rounds.
    pub(super) emitters: Buffer,
    /// What patches reflected in the last round.
    pub(super) light: Buffer,
    /// `vpl/vpl.wgsl`'s `ImportancePoints`: patches that stand for all.
    pub(super) importance: Buffer,
    /// `bounces/reflect.wgsl`'s `PatchRange`.
    pub(super) range: Buffer,
    pub(super) inputs: LightInputs,
    /// Whether patches reflect in this frame, if the camera samples VPLs.
    pub(super) is_due: bool,
    /// Whether they have done so since they were due.
    pub(super) is_done: AtomicBool,
}

impl LightInputs {
    /// Whether the camera's sky lights patches.
    pub(super) fn has_sky(&self) -> bool {
        self.sky.is_some()
    }

    /// `bounces/reflect.wgsl`'s `PatchRange`, padded to the size of a uniform.
    fn range_bytes(&self) -> [u8; 16] {
        let largest_ratio = if self.extrapolates { LARGEST_RATIO } else { 0.0 };
        bytemuck::cast([self.first_texel, largest_ratio.to_bits(), 0, 0])
    }
}

impl BounceCamera {
    /// Buffers for patches that are due to reflect.
    fn new(device: &RenderDevice, patches: &Arc<Vec<Patch>>, inputs: LightInputs) -> Self {
        let (storage, uniform) = (BufferUsages::STORAGE, BufferUsages::UNIFORM);
        let filled = |label, contents: &[u8], usage| filled_buffer(device, label, contents, usage);
        let empty = |label, size, usage| empty_buffer(device, label, size, usage);
        let vpl_bytes = u64::from(BOUNCE_VPLS.count()) * VPL_BYTES;
        let vpl_usage = storage | uniform | BufferUsages::COPY_SRC;
        Self {
            held: Arc::clone(patches),
            patches: filled("frugal_gi/bounces/patches", bytemuck::cast_slice(patches), storage),
            bounce_vpls: empty("frugal_gi/bounces/bounce_vpls", vpl_bytes, vpl_usage),
            plan: filled("frugal_gi/bounces/plan", bytemuck::bytes_of(&BOUNCE_VPLS), storage),
            importance: empty("frugal_gi/bounces/importance", IMPORTANCE_POINTS_BYTES, storage),
            emitters: empty("frugal_gi/bounces/emitters", PATCHES as u64 * VPL_BYTES, storage),
            light: empty("frugal_gi/bounces/light", PATCHES as u64 * LIGHT_BYTES, storage),
            range: filled("frugal_gi/bounces/range", &inputs.range_bytes(), uniform),
            inputs,
            is_due: true,
            is_done: AtomicBool::new(false),
        }
    }

    /// Patches that will reflect in this frame, if the camera samples VPLs; padding included.
    pub(in crate::gi) fn patches_due(&self) -> u64 {
        if self.is_due { PATCHES as u64 * u64::from(self.inputs.rounds) } else { 0 }
    }

    /// For tests and debuggers.
    pub(in crate::gi) fn state(&self) -> GiBouncesState {
        let first = self.inputs.first_texel;
        let texels = first..first + PATCHES as u32;
        GiBouncesState { bounce_vpls: self.bounce_vpls.clone(), texels }
    }

    /// Bytes held on the GPU for this camera's patches, without their texels.
    pub(crate) fn bytes(&self) -> u64 {
        let Self { patches, bounce_vpls, plan, emitters, importance, range, light, .. } = self;
        bytes_of([patches, bounce_vpls, plan, emitters, importance, range, light])
    }

    /// Adds the rows of this camera's patches to those of its maps and of emissive surfaces.
    pub(in crate::gi) fn add_rows(&self, rows: &mut Vec<TexelRow>) {
        TexelRow::add_scattered(rows, self.inputs.first_texel, PATCHES as u32);
    }
}

/// Gives every camera with patches its buffers, removes those of others, and decides whether its
/// patches are due to reflect again.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    mut kernels: ResMut<BounceKernels>,
    (device, queue, cache): (Res<RenderDevice>, Res<RenderQueue>, Res<PipelineCache>),
    (mut store, patches): (ResMut<TexelStore>, Res<GiPatches>),
    (frame, jumps): (Res<GiFrame>, Res<Jumps>),
    mut cameras: Query<
        (
            Entity,
            &MainEntity,
            Option<(&FrugalGi, &ExtractedCamera)>,
            Option<&SkyCamera>,
            Option<&mut BounceCamera>,
        ),
        Or<(With<FrugalGi>, With<BounceCamera>)>,
    >,
) {
    for (entity, main_entity, camera, sky, held) in &mut cameras {
        let found = camera.filter(|(gi, _)| gi.reflects()).and_then(|(gi, camera)| {
            Some((gi, camera, patches.of(main_entity.id())?, store.texels.clone()?))
        });
        let Some((gi, camera, (patches, before), texels)) = found else {
            if held.is_some() {
                commands.entity(entity).remove::<BounceCamera>();
            }
            continue;
        };
        let first_texel = store.first(TexelRange::Patches) + before;
        let sky = sky.and_then(SkyCamera::inputs);
        kernels.queue(&cache, sky.is_some(), gi.shading);
        let always = sky.as_ref().is_some_and(SkyInputs::is_generated);
        let extrapolates = gi.bounces >= FrugalGi::ALL_BOUNCES;
        let inputs = LightInputs {
            rounds: if extrapolates { ROUNDS_OF_ALL } else { gi.bounces.max(1) - 1 },
            extrapolates,
            emissive: gi.emissive,
            exposure: camera.exposure,
            sky,
            store: texels.id(),
            first_texel,
            shading: gi.shading,
        };
        // A new range holds other texels, which would be sampled if the patches cannot reflect in
        // this frame.
        let clear = || {
            let nothing = vec![0; PATCHES * TEXEL_BYTES as usize];
            queue.write_buffer(&texels, u64::from(first_texel) * TEXEL_BYTES, &nothing);
        };
        if let Some(mut held) = held {
            if !Arc::ptr_eq(&held.held, patches) {
                let bytes: &[u8] = bytemuck::cast_slice(patches);
                queue.write_buffer(&held.patches, 0, bytes);
                store.uploaded += bytes.len() as u64;
            }
            let place = |inputs: &LightInputs| (inputs.store, inputs.first_texel);
            if place(&held.inputs) != place(&inputs) {
                clear();
            }
            if held.inputs.range_bytes() != inputs.range_bytes() {
                queue.write_buffer(&held.range, 0, &inputs.range_bytes());
            }
            let is_same = Arc::ptr_eq(&held.held, patches) && held.inputs == inputs;
            let is_done = held.is_done.load(Ordering::Relaxed);
            // Other samples of the sky may have lit them: after a cut nothing may depend on those.
            let is_cut = jumps.cuts.contains(&main_entity.id());
            held.is_due = frame.relit || always || is_cut || !is_same || !is_done;
            held.is_done.store(!held.is_due, Ordering::Relaxed);
            (held.held, held.inputs) = (Arc::clone(patches), inputs);
            continue;
        }
        clear();
        let camera = BounceCamera::new(&device, patches, inputs);
        commands.entity(entity).insert(camera);
    }
}
