//! A camera's places: their buffers, and what happens to them in a frame.

use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bytemuck::{Pod, Zeroable};

use super::volume::{ForwardCamera, PLACES};
use crate::gi::compute::{bytes_of, empty_buffer, filled_buffer};
use crate::gi::view::{GiFrame, GiView};
use crate::gi::vpl::VplView;

/// Bytes of `forward/probe.wgsl`'s `Probe`. A test compares it with the shader.
pub(in crate::gi) const PROBE_BYTES: u64 = 96;
/// `forward/light.wgsl`'s constants: rays to VPLs, or to the sky, and neighbours that a place looks at.
pub(in crate::gi) const RAYS: u32 = 4;
pub(in crate::gi) const LOOKS: u32 = 2;
/// One place in so many is lit in a frame. Higher values: fewer rays, and light that comes later.
const STRIDE: u32 = 8;
/// Samples of a place until it has settled. Higher values: less noise, and rays for longer.
const SETTLED: u32 = 64;
/// Samples that a place keeps while something changes. Lower values: light lags less, with more noise.
const CHANGING: u32 = 8;
/// Steps at once after which all places are lit: a camera does not run that fast.
const JUMP: i32 = 4;

/// `forward/probe.wgsl`'s `Volume`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct VolumeSettings {
    base: [i32; 3],
    spacing: f32,
    exposure: f32,
    first: u32,
    stride: u32,
    most: u32,
    seed: u32,
    round: u32,
    padding: [u32; 2],
}

/// The places of a GI camera. In the render world.
#[derive(Component)]
pub(in crate::gi) struct ForwardView {
    pub(super) probes: Buffer,
    /// [`VolumeSettings`].
    pub settings_buffer: Buffer,
    settings: VolumeSettings,
    /// Frames in which places are still lit.
    remaining: u32,
    /// Whether it begins anew in this frame.
    pub(super) begins: bool,
}

impl ForwardView {
    fn new(device: &RenderDevice) -> Self {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let bytes = u64::from(PLACES.element_product()) * PROBE_BYTES;
        let settings = VolumeSettings::default();
        Self {
            probes: empty_buffer(device, "frugal_gi/forward/probes", bytes, usage),
            settings_buffer: filled_buffer(
                device,
                "frugal_gi/forward/settings",
                bytemuck::bytes_of(&settings),
                BufferUsages::UNIFORM,
            ),
            settings,
            remaining: 0,
            begins: true,
        }
    }

    fn advance(&mut self, view: &GiView, frame: &GiFrame, camera: &ForwardCamera, is_new: bool) {
        let old = self.settings;
        self.begins = is_new || view.is_new || old.spacing != camera.spacing;
        let steps = camera.base - IVec3::from(old.base);
        let is_changing = frame.gather || view.relit;
        if self.begins || is_changing || steps != IVec3::ZERO {
            self.remaining = SETTLED * STRIDE;
        } else {
            self.remaining = self.remaining.saturating_sub(1);
        }
        let jumps = self.begins || steps.abs().max_element() > JUMP;
        let seed = if self.begins { 0 } else { old.seed.wrapping_add(1) };
        self.settings = VolumeSettings {
            base: camera.base.to_array(),
            spacing: camera.spacing,
            exposure: view.camera.exposure,
            first: if jumps { 0 } else { seed % STRIDE },
            stride: if jumps { 1 } else { STRIDE },
            most: if is_changing { CHANGING } else { SETTLED },
            seed,
            round: seed / STRIDE,
            padding: [0; 2],
        };
    }

    /// Places that are lit in this frame.
    pub(crate) fn lit(&self) -> u32 {
        if self.remaining > 0 { PLACES.element_product() / self.settings.stride } else { 0 }
    }

    /// Rays traced from places in this frame, at most.
    pub(crate) fn rays(&self, view: &GiView) -> u64 {
        let samples = if view.sky_samples > 0 { 2 * RAYS } else { RAYS };
        u64::from(self.lit()) * u64::from(samples + 2 * LOOKS)
    }

    /// Bytes held on the GPU, the volume's image included.
    pub(crate) fn bytes(&self) -> u64 {
        let image = u64::from(PLACES.element_product()) * 6 * 8;
        bytes_of([&self.probes, &self.settings_buffer]) + image
    }
}

/// Gives every view whose camera has a volume its places, and takes them from the others.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    frame: Res<GiFrame>,
    mut views: Query<
        (Entity, &GiView, Option<&ForwardCamera>, Option<&mut ForwardView>),
        With<VplView>,
    >,
) {
    let upload = |held: &ForwardView| {
        queue.write_buffer(&held.settings_buffer, 0, bytemuck::bytes_of(&held.settings));
    };
    for (entity, view, camera, held) in &mut views {
        match (camera.filter(|_| view.gi.traces()), held) {
            (Some(camera), Some(mut held)) => {
                held.advance(view, &frame, camera, false);
                upload(&held);
            }
            (Some(camera), None) => {
                let mut new = ForwardView::new(&device);
                new.advance(view, &frame, camera, true);
                upload(&new);
                commands.entity(entity).insert(new);
            }
            (None, Some(_)) => {
                commands.entity(entity).remove::<ForwardView>();
            }
            (None, None) => {}
        }
    }
}
