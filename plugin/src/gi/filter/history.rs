//! What was shown of a camera's light, and from where: so that light is not drawn anew from frame to frame.

use bevy::math::{Mat4, Vec3};
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::CachedTexture;
use bevy::render::view::ExtractedView;
use bytemuck::{Pod, Zeroable};

use crate::gi::settings::FrugalGi;

/// Most frames that are averaged.
const MOST_FRAMES: u32 = 64;
/// What counts as a cut: metres, and the cosine of an angle, from one frame to the next.
const CUT_DISTANCE: f32 = 1.0;
const CUT_COSINE: f32 = 0.866;

/// `filter/settle.wgsl`'s `Past`.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(in crate::gi) struct Past {
    clip_from_world: [f32; 16],
    world_from_clip: [f32; 16],
    eye: [f32; 3],
    share_of_present: f32,
    exposure: f32,
    padding: [f32; 3],
}

/// From where light was gathered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct PastView {
    clip_from_world: Mat4,
    eye: Vec3,
    forward: Vec3,
    exposure: f32,
    is_parallel: bool,
}

impl PastView {
    pub fn new(camera: &ExtractedCamera, view: &ExtractedView) -> Self {
        let world_from_view = view.world_from_view.to_matrix();
        Self {
            clip_from_world: view.clip_from_world.unwrap_or_else(|| view.clip_from_view * world_from_view.inverse()),
            eye: view.world_from_view.translation(),
            forward: view.world_from_view.forward().into(),
            exposure: camera.exposure,
            is_parallel: view.clip_from_view.w_axis.w == 1.0,
        }
    }

    /// What the shader is told of this view as the past of `now`, of which the present counts for `share`.
    fn before(&self, now: &Self, share: f32) -> Past {
        let world_from_clip = self.clip_from_world.inverse();
        let exposure = now.exposure / self.exposure;
        let is_cut = self.eye.distance_squared(now.eye) > CUT_DISTANCE * CUT_DISTANCE || self.forward.dot(now.forward) < CUT_COSINE;
        let is_sound = world_from_clip.is_finite() && self.clip_from_world.is_finite() && exposure.is_finite() && exposure > 0.0;
        if is_cut || !is_sound || self.is_parallel || now.is_parallel {
            return Past::NONE;
        }
        Past {
            clip_from_world: self.clip_from_world.to_cols_array(),
            world_from_clip: world_from_clip.to_cols_array(),
            eye: self.eye.to_array(),
            share_of_present: share,
            exposure,
            padding: [0.0; 3],
        }
    }
}

impl Past {
    /// Nothing was shown.
    const NONE: Self = Self {
        clip_from_world: Mat4::IDENTITY.to_cols_array(),
        world_from_clip: Mat4::IDENTITY.to_cols_array(),
        eye: [0.0; 3],
        share_of_present: 1.0,
        exposure: 1.0,
        padding: [0.0; 3],
    };
}

/// What a camera that filters keeps of its past.
pub(in crate::gi) struct History {
    /// What the filter made of what was gathered last.
    pub filtered: CachedTexture,
    /// What was shown; swapped with what is gathered into.
    pub texture: CachedTexture,
    /// From where, for the shader.
    pub past: Buffer,
    view: Option<PastView>,
    /// Frames until what is shown is what was gathered last, and the past is forgotten.
    left: u32,
    /// Whether what is shown changes in this frame.
    pub settles: bool,
}

/// What a frame means to what was shown before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) enum Step {
    /// Nothing is gathered.
    Rests,
    /// Light is gathered where nothing was shown before, or of other settings; or where nothing moves.
    Begins,
    /// Something moves.
    Moves,
}

impl History {
    pub fn new(device: &RenderDevice, filtered: CachedTexture, texture: CachedTexture) -> Self {
        let past = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bevy_frugal_gi/past"),
            contents: bytemuck::bytes_of(&Past::NONE),
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        });
        Self { filtered, texture, past, view: None, left: 0, settles: false }
    }

    /// Makes what is shown the past of this frame. While something moves it counts for all but one of the frames that are averaged; then less from
    /// frame to frame, until in a still picture nothing of it is left.
    pub fn advance(&mut self, shown: &mut CachedTexture, now: PastView, step: Step, gi: &FrugalGi, queue: &RenderQueue) {
        let frames = gi.history_frames.clamp(1, MOST_FRAMES);
        let share = match step {
            Step::Begins => 1,
            Step::Moves => frames,
            Step::Rests => self.left,
        };
        self.settles = share > 0;
        if !self.settles {
            return;
        }
        std::mem::swap(shown, &mut self.texture);
        let view = self.view.filter(|_| share > 1);
        let past = view.map_or(Past::NONE, |view| view.before(&now, (share as f32).recip()));
        queue.write_buffer(&self.past, 0, bytemuck::bytes_of(&past));
        // Without a past there is nothing to get rid of.
        self.left = if past == Past::NONE { 0 } else { share - 1 };
        self.view = Some(now);
    }

    /// Whether what is shown will change although nothing moves.
    pub fn is_settling(&self) -> bool {
        self.left > 0
    }

    /// Bytes held on the GPU beside the textures.
    pub fn bytes(&self) -> u64 {
        self.past.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(eye: Vec3, forward: Vec3) -> PastView {
        let clip_from_view = Mat4::perspective_infinite_reverse_rh(1.0, 1.5, 0.1);
        let clip_from_world = clip_from_view * Mat4::look_to_rh(eye, forward, Vec3::Y);
        PastView { clip_from_world, eye, forward, exposure: 0.01, is_parallel: false }
    }

    #[test]
    fn a_step_has_a_past_and_a_cut_has_none() {
        let here = view(Vec3::ZERO, Vec3::NEG_Z);
        let step = view(Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, -1.0).normalize());
        assert_eq!(here.before(&step, 0.25).share_of_present, 0.25);
        for cut in [view(Vec3::new(2.0, 0.0, 0.0), Vec3::NEG_Z), view(Vec3::ZERO, Vec3::X)] {
            assert_eq!(here.before(&cut, 0.25), Past::NONE);
        }
    }

    #[test]
    fn what_is_no_number_has_no_past() {
        let here = view(Vec3::ZERO, Vec3::NEG_Z);
        let broken = PastView { clip_from_world: Mat4::from_cols_array(&[f32::NAN; 16]), ..here };
        let dark = PastView { exposure: 0.0, ..here };
        assert_eq!(broken.before(&here, 0.5), Past::NONE);
        assert_eq!(dark.before(&here, 0.5), Past::NONE);
        assert_eq!(here.before(&PastView { exposure: f32::NAN, ..here }, 0.5), Past::NONE);
        assert_eq!(PastView { is_parallel: true, ..here }.before(&here, 0.5), Past::NONE);
        assert_eq!(here.before(&PastView { exposure: 0.02, ..here }, 0.5).exposure, 2.0);
    }
}
