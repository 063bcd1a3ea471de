//! The history of a camera's irradiance, and the pose it was accumulated from: averages the noise
//! of one frame's VPLs with that of the frames before.

use bevy::prelude::*;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::sync_world::MainEntity;
use bevy::render::texture::CachedTexture;
use bytemuck::{Pod, Zeroable};

use crate::cut::{Jumps, is_cut};
use crate::gi::compute::filled_buffer;
use crate::gi::gather::{
    GatherView, irradiance_texture, low_resolution_texture, texture_bytes, texture_size,
};
use crate::gi::view::{GatherCamera, GiView, HistoryAction};

/// Longest history, in frames.
const MAX_FRAMES: u32 = 64;
/// How much more the late frames of a rest count than its early ones: the n-th counts for n to this
/// power. Higher values: what was gathered in motion, lag and blur included, weighs less in the end,
/// and fewer frames share the mean.
const REST_POWER: f32 = 3.0;
/// Frames of a rest for which history before it counts, whatever its length, so that the image
/// hardly depends on it. Higher values: less noise right after a stop, and history lasts longer.
const REST_HISTORY: f32 = 8.0;
/// Longest history when settings are switched, in frames. Longer hides the switch better; shorter
/// converges sooner to the new settings.
const FRAMES_AT_SWITCH: u32 = 8;

const FILTERED: &str = "frugal_gi/denoise/filtered";
const LENGTHS: &str = "frugal_gi/denoise/lengths";
/// Format of the lengths of history: every device can write it.
pub(super) const LENGTH_FORMAT: TextureFormat = TextureFormat::R32Float;

/// `denoise/temporal.wgsl`'s `Reprojection`: the camera of the history.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Reprojection {
    clip_from_world: [f32; 16],
    world_from_clip: [f32; 16],
    eye: [f32; 3],
    present_weight: f32,
    exposure: f32,
    is_parallel: f32,
    size: [u32; 2],
    cell: [u32; 2],
    /// 1 at rest, else 0.
    is_at_rest: f32,
    /// Frames of rest.
    rested: f32,
}

impl Reprojection {
    /// There is no history.
    const NONE: Self = Self {
        clip_from_world: Mat4::IDENTITY.to_cols_array(),
        world_from_clip: Mat4::IDENTITY.to_cols_array(),
        eye: [0.0; 3],
        present_weight: 1.0,
        exposure: 1.0,
        is_parallel: 0.0,
        size: [1; 2],
        cell: [1; 2],
        is_at_rest: 0.0,
        rested: 0.0,
    };

    /// Reprojection of the history of `then` for `now`, `seconds` later, with weight
    /// `present_weight` of the present. [`NONE`](Self::NONE) across a cut, where either is not
    /// finite, and where one is of parallel projection and the other is not.
    fn new(then: &GatherCamera, now: &GatherCamera, seconds: f32, present_weight: f32) -> Self {
        let world_from_clip = then.clip_from_world.inverse();
        let exposure = now.exposure / then.exposure;
        let is_cut = is_cut((then.eye, then.forward), (now.eye, now.forward), seconds);
        let is_finite = world_from_clip.is_finite()
            && then.clip_from_world.is_finite()
            && exposure.is_finite()
            && exposure > 0.0;
        if is_cut || !is_finite || then.is_parallel != now.is_parallel {
            return Self::NONE;
        }
        Self {
            clip_from_world: then.clip_from_world.to_cols_array(),
            world_from_clip: world_from_clip.to_cols_array(),
            eye: then.eye.to_array(),
            present_weight,
            exposure,
            is_parallel: f32::from(u8::from(then.is_parallel)),
            size: then.size.to_array(),
            cell: then.cell.to_array(),
            ..Self::NONE
        }
    }
}

/// The history of a GI camera that filters. In the render world.
#[derive(Component)]
pub(in crate::gi) struct History {
    /// Output of the spatial filter for the last gather.
    pub(super) filtered: CachedTexture,
    /// Frames in the mean of each low-resolution pixel of [`GatherView::previous`].
    pub(super) lengths: CachedTexture,
    /// The same of this frame's accumulated irradiance.
    pub(super) new_lengths: CachedTexture,
    /// A [`Reprojection`].
    pub(super) reprojection: Buffer,
    /// Its camera.
    camera: Option<GatherCamera>,
    /// Most frames in the accumulated mean of any pixel. At rest it falls to 1: the last gather,
    /// without any history.
    length: u32,
    /// Whether the accumulated irradiance changes in this frame.
    pub(super) accumulates: bool,
}

impl History {
    fn new(device: &RenderDevice, view: &GiView) -> Self {
        let reprojection = filled_buffer(
            device,
            "frugal_gi/denoise/reprojection",
            bytemuck::bytes_of(&Reprojection::NONE),
            BufferUsages::UNIFORM,
        );
        let [lengths, new_lengths] = [LENGTHS; 2]
            .map(|label| low_resolution_texture(device, label, view.cells(), LENGTH_FORMAT));
        Self {
            filtered: irradiance_texture(device, FILTERED, view.cells()),
            lengths,
            new_lengths,
            reprojection,
            camera: None,
            length: 0,
            accumulates: false,
        }
    }

    /// Makes the accumulated irradiance of the last frame this frame's history.
    ///
    /// While something moves, the result is the mean of all frames since the history began, and
    /// then an exponential moving average (Yang et al. 2009, "Amortized Supersampling"). At rest it
    /// converges to the mean of [`rest_frames`](crate::gi::FrugalGi::rest_frames) sets of samples;
    /// without them the history's weight falls from frame to frame to 0. Either way a still image
    /// hardly depends on history.
    fn advance(
        &mut self,
        gather: &mut GatherView,
        view: &GiView,
        seconds: f32,
        device: &RenderDevice,
        queue: &RenderQueue,
    ) {
        let frames = view.gi.history_frames.clamp(1, MAX_FRAMES);
        let length = match view.history {
            HistoryAction::Begins => 1,
            HistoryAction::Moves => frames.min(self.length + 1),
            HistoryAction::Switches => frames.min(self.length.min(FRAMES_AT_SWITCH) + 1),
            HistoryAction::Averages => self.length.max(1),
            HistoryAction::Rests if view.gi.rest_frames == 0 => self.length.saturating_sub(1),
            HistoryAction::Rests => {
                self.accumulates = false;
                return;
            }
        };
        let averages = view.history == HistoryAction::Averages;
        let rested = if averages { view.work.rested } else { 0 };
        self.accumulates = length > 0;
        if !self.accumulates {
            return;
        }
        // History is read at its own resolution; only textures that are written need this frame's.
        gather.swap(device, view.cells());
        std::mem::swap(&mut self.lengths, &mut self.new_lengths);
        if texture_size(&self.new_lengths) != view.cells() {
            self.new_lengths = low_resolution_texture(device, LENGTHS, view.cells(), LENGTH_FORMAT);
        }
        if texture_size(&self.filtered) != view.cells() {
            self.filtered = irradiance_texture(device, FILTERED, view.cells());
        }
        let then = self.camera.filter(|_| length > 1 || averages);
        let weight = if averages { rest_weight(rested) } else { (length as f32).recip() };
        let reprojection = then.map_or(Reprojection::NONE, |then| {
            Reprojection::new(&then, &view.camera, seconds, weight)
        });
        let is_at_rest = f32::from(u8::from(averages));
        let reprojection = Reprojection { is_at_rest, rested: rested as f32, ..reprojection };
        queue.write_buffer(&self.reprojection, 0, bytemuck::bytes_of(&reprojection));
        // The weight of 1 is that of no history.
        self.length = if reprojection.present_weight < 1.0 { length } else { 1 };
        self.camera = Some(view.camera);
    }

    /// Whether the image still changes although nothing moves.
    pub(crate) fn is_converging(&self) -> bool {
        self.accumulates && self.length > 1
    }

    /// Bytes held on the GPU, without [`GatherView`]'s.
    pub(crate) fn bytes(&self) -> u64 {
        let Self { filtered, lengths, new_lengths, .. } = self;
        let textures = [filtered, lengths, new_lengths].map(texture_bytes);
        self.reprojection.size() + textures.iter().sum::<u64>()
    }
}

/// Weight of the present in the `rested`-th frame of a rest. The product of all (1 − weight) is the
/// history's own: (8 ÷ (8 + rested))^4, nearly.
fn rest_weight(rested: u32) -> f32 {
    (REST_POWER + 1.0) / (rested as f32 + REST_HISTORY + REST_POWER)
}

/// Gives every filtered view its history, and removes that of others.
pub(in crate::gi) fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    jumps: Res<Jumps>,
    mut views: Query<(Entity, &MainEntity, &GiView, &mut GatherView, Option<&mut History>)>,
) {
    for (entity, main_entity, view, mut gather, held) in &mut views {
        let mut camera = commands.entity(entity);
        let mut advance = |history: &mut History| {
            history.advance(&mut gather, view, jumps.seconds, &device, &queue);
        };
        match held {
            Some(_) if !view.gi.filters() => {
                camera.remove::<History>();
            }
            Some(mut history) => {
                if let Some(by) = jumps.shifts.get(&main_entity.id()) {
                    history.camera = history.camera.map(|camera| camera.shifted(*by));
                }
                advance(&mut history);
            }
            None if view.gi.filters() => {
                let mut history = History::new(&device, view);
                advance(&mut history);
                camera.insert(history);
            }
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::{Quat, UVec2, Vec3};

    use super::*;

    /// Seconds.
    const FRAME: f32 = 1.0 / 60.0;

    fn camera(eye: Vec3, forward: Vec3) -> GatherCamera {
        let clip_from_view = Mat4::perspective_infinite_reverse_rh(1.0, 1.5, 0.1);
        let clip_from_world = clip_from_view * Mat4::look_to_rh(eye, forward, Vec3::Y);
        let (size, cell) = (UVec2::new(160, 90), UVec2::splat(4));
        GatherCamera {
            clip_from_world,
            eye,
            forward,
            exposure: 0.01,
            is_parallel: false,
            size,
            cell,
        }
    }

    #[test]
    fn a_step_has_a_history_and_a_cut_has_none() {
        let here = camera(Vec3::ZERO, Vec3::NEG_Z);
        let step = camera(Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.1, 0.0, -1.0).normalize());
        assert_eq!(Reprojection::new(&here, &step, FRAME, 0.25).present_weight, 0.25);
        for cut in [camera(Vec3::new(6.0, 0.0, 0.0), Vec3::NEG_Z), camera(Vec3::ZERO, Vec3::X)] {
            assert_eq!(Reprojection::new(&here, &cut, FRAME, 0.25), Reprojection::NONE);
        }
    }

    #[test]
    fn a_cut_is_told_by_speed_not_by_the_frame_rate() {
        let here = camera(Vec3::ZERO, Vec3::NEG_Z);
        let has_history = |distance: f32, degrees: f32, seconds: f32| {
            let turned = Quat::from_rotation_y(degrees.to_radians()) * Vec3::NEG_Z;
            let now = camera(Vec3::new(distance, 0.0, 0.0), turned);
            Reprojection::new(&here, &now, seconds, 0.25) != Reprojection::NONE
        };
        for rate in [20.0, 30.0, 60.0, 144.0] {
            // A car, a jet; a teleport across a street.
            assert!(has_history(60.0 / rate, 0.0, 1.0 / rate), "{rate} frames a second");
            assert!(has_history(250.0 / rate, 0.0, 1.0 / rate), "{rate} frames a second");
            assert!(!has_history(20.0, 0.0, 1.0 / rate), "{rate} frames a second");
            assert!(has_history(0.0, 500.0 / rate, 1.0 / rate), "{rate} frames a second");
            assert!(!has_history(0.0, 91.0, 1.0 / rate), "{rate} frames a second");
        }
        // Time that stands still or is broken, and a stall.
        for seconds in [0.0, -1.0, f32::NAN] {
            assert!(has_history(0.9, 29.0, seconds) && !has_history(1.1, 0.0, seconds));
        }
        assert!(!has_history(31.0, 0.0, f32::INFINITY) && !has_history(0.0, 91.0, 1e9));
    }

    #[test]
    fn another_resolution_keeps_the_history() {
        let then = camera(Vec3::ZERO, Vec3::NEG_Z);
        let now = GatherCamera { size: UVec2::new(320, 180), cell: UVec2::new(2, 1), ..then };
        let reprojection = Reprojection::new(&then, &now, FRAME, 0.5);
        assert_eq!((reprojection.size, reprojection.cell), ([160, 90], [4, 4]));
        assert_eq!((then.cells(), now.cells()), (UVec2::new(40, 23), UVec2::new(160, 180)));
    }

    #[test]
    fn history_and_the_first_frames_of_a_rest_count_for_little() {
        let mut shares: Vec<f32> = vec![1.0];
        for rested in 1..=64 {
            let weight = rest_weight(rested);
            assert!((0.0..1.0).contains(&weight));
            shares.iter_mut().for_each(|share| *share *= 1.0 - weight);
            shares.push(weight);
        }
        assert!(shares[0] < 3e-4, "history counts for {}", shares[0]);
        let (first, last) = shares[1..].split_at(16);
        assert!(first.iter().sum::<f32>() < 0.02, "{first:?}");
        assert!(last.windows(2).all(|pair| pair[0] < pair[1] && pair[1] < 0.06), "{last:?}");
        let squares: f32 = shares.iter().map(|share| share * share).sum();
        assert!((30.0..34.0).contains(&squares.recip()), "of 64 frames' noise {squares}");
        assert!(rest_weight(u32::MAX) > 0.0);
    }

    #[test]
    fn non_finite_views_have_no_history() {
        let here = camera(Vec3::ZERO, Vec3::NEG_Z);
        let none = |then: &GatherCamera, now: &GatherCamera| {
            assert_eq!(Reprojection::new(then, now, FRAME, 0.5), Reprojection::NONE);
        };
        none(
            &GatherCamera { clip_from_world: Mat4::from_cols_array(&[f32::NAN; 16]), ..here },
            &here,
        );
        none(&GatherCamera { exposure: 0.0, ..here }, &here);
        none(&here, &GatherCamera { exposure: f32::NAN, ..here });
        none(&GatherCamera { is_parallel: true, ..here }, &here);
        let parallel = GatherCamera { is_parallel: true, ..here };
        assert_eq!(Reprojection::new(&parallel, &parallel, FRAME, 0.5).is_parallel, 1.0);
        let darker = GatherCamera { exposure: 0.02, ..here };
        assert_eq!(Reprojection::new(&here, &darker, FRAME, 0.5).exposure, 2.0);
    }
}
