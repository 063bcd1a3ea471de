//! What was shown of a camera's light, and from where: so that light is not drawn anew from frame
//! to frame.

use bevy::math::{Mat4, UVec2, Vec3};
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::CachedTexture;
use bevy::render::view::ExtractedView;
use bytemuck::{Pod, Zeroable};

use crate::gi::settings::{FrugalGi, GiPixelFraction};

/// Most frames that are averaged.
const MOST_FRAMES: u32 = 64;
/// Frames that history counts for at most when settings are switched. More hide the switch better;
/// fewer sooner show what the new settings find.
const FRAMES_AT_SWITCH: u32 = 8;
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
    padding: f32,
    size: [u32; 2],
    cell: [u32; 2],
    padding_at_end: [u32; 2],
}

/// From where light was gathered, and at which pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct PastView {
    clip_from_world: Mat4,
    eye: Vec3,
    forward: Vec3,
    exposure: f32,
    is_parallel: bool,
    /// Pixels of the picture, and of the cells that share a gather.
    size: UVec2,
    cell: UVec2,
}

impl PastView {
    pub fn new(
        camera: &ExtractedCamera,
        view: &ExtractedView,
        size: UVec2,
        fraction: GiPixelFraction,
    ) -> Self {
        let world_from_view = view.world_from_view.to_matrix();
        Self {
            clip_from_world: view
                .clip_from_world
                .unwrap_or_else(|| view.clip_from_view * world_from_view.inverse()),
            eye: view.world_from_view.translation(),
            forward: view.world_from_view.forward().into(),
            exposure: camera.exposure,
            is_parallel: view.clip_from_view.w_axis.w == 1.0,
            size,
            cell: fraction.cell().into(),
        }
    }

    /// Cells along both axes.
    fn cells(&self) -> UVec2 {
        UVec2::new(self.size.x.div_ceil(self.cell.x), self.size.y.div_ceil(self.cell.y))
    }

    /// What the shader is told of this view as the past of `now`, of which the present counts for
    /// `share`.
    fn before(&self, now: &Self, share: f32) -> Past {
        let world_from_clip = self.clip_from_world.inverse();
        let exposure = now.exposure / self.exposure;
        let is_cut = self.eye.distance_squared(now.eye) > CUT_DISTANCE * CUT_DISTANCE
            || self.forward.dot(now.forward) < CUT_COSINE;
        let is_sound = world_from_clip.is_finite()
            && self.clip_from_world.is_finite()
            && exposure.is_finite()
            && exposure > 0.0;
        if is_cut || !is_sound || self.is_parallel || now.is_parallel {
            return Past::NONE;
        }
        Past {
            clip_from_world: self.clip_from_world.to_cols_array(),
            world_from_clip: world_from_clip.to_cols_array(),
            eye: self.eye.to_array(),
            share_of_present: share,
            exposure,
            size: self.size.to_array(),
            cell: self.cell.to_array(),
            ..Past::NONE
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
        padding: 0.0,
        size: [1; 2],
        cell: [1; 2],
        padding_at_end: [0; 2],
    };
}

const IRRADIANCE: &str = "bevy_frugal_gi/irradiance";
const FILTERED: &str = "bevy_frugal_gi/filtered";
const HISTORY: &str = "bevy_frugal_gi/history";

/// A texture of irradiance by cell, for a camera that does not filter, too. It is the camera's own:
/// those of Bevy's cache may be another's in the next frame, and what was gathered must stay.
pub(in crate::gi) fn gathered_texture(device: &RenderDevice, cells: UVec2) -> CachedTexture {
    irradiance_texture(device, IRRADIANCE, cells)
}

fn irradiance_texture(device: &RenderDevice, label: &'static str, cells: UVec2) -> CachedTexture {
    let texture = device.create_texture(&TextureDescriptor {
        label: Some(label),
        size: Extent3d { width: cells.x, height: cells.y, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format: TextureFormat::Rgba16Float,
        usage: TextureUsages::STORAGE_BINDING
            | TextureUsages::TEXTURE_BINDING
            | TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let default_view = texture.create_view(&TextureViewDescriptor::default());
    CachedTexture { texture, default_view }
}

/// Cells along both axes.
pub(in crate::gi) fn size_of_texture(texture: &CachedTexture) -> UVec2 {
    UVec2::new(texture.texture.width(), texture.texture.height())
}

/// Bytes of half floats.
pub(in crate::gi) fn bytes_of_texture(texture: &CachedTexture) -> u64 {
    let size = size_of_texture(texture).as_u64vec2();
    size.x * size.y * 8
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
    /// Frames that what is shown is a mean of.
    length: u32,
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
    /// Light is gathered after a cut, or where nothing moves.
    Begins,
    /// Something moves.
    Moves,
    /// The settings or the sky are others. What was shown is carried over, to other cells, too.
    Switches,
}

impl History {
    pub fn new(device: &RenderDevice, cells: UVec2) -> Self {
        let past = device.create_buffer_with_data(&BufferInitDescriptor {
            label: Some("bevy_frugal_gi/past"),
            contents: bytemuck::bytes_of(&Past::NONE),
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
        });
        let [filtered, texture] =
            [FILTERED, HISTORY].map(|label| irradiance_texture(device, label, cells));
        Self { filtered, texture, past, view: None, length: 0, left: 0, settles: false }
    }

    /// Makes what is shown the past of this frame. While something moves it counts for all but one
    /// of the frames that are averaged; then less from Makes what is shown the history of this
    /// frame. While something moves, what is shown is the mean of the frames since the history
    /// began, and then a moving one; at rest the history counts for less from frame to frame, until
    /// in a still picture nothing of it is left.
    pub fn advance(
        &mut self,
        shown: &mut CachedTexture,
        now: PastView,
        step: Step,
        gi: &FrugalGi,
        (device, queue): (&RenderDevice, &RenderQueue),
    ) {
        let frames = gi.history_frames.clamp(1, MOST_FRAMES);
        // A mean of all frames since the history began, and of the last ones once there are enough.
        let share = match step {
            Step::Begins => 1,
            Step::Moves => frames.min(self.length + 1),
            Step::Switches => frames.min(self.length.min(FRAMES_AT_SWITCH) + 1),
            Step::Rests => self.left,
        };
        self.settles = share > 0;
        if !self.settles {
            return;
        }
        std::mem::swap(shown, &mut self.texture);
        // Other cells need other textures. What was shown is read at its own.
        for (texture, label) in [(shown, IRRADIANCE), (&mut self.filtered, FILTERED)] {
            if size_of_texture(texture) != now.cells() {
                *texture = irradiance_texture(device, label, now.cells());
            }
        }
        let view = self.view.filter(|_| share > 1);
        let past = view.map_or(Past::NONE, |view| view.before(&now, (share as f32).recip()));
        queue.write_buffer(&self.past, 0, bytemuck::bytes_of(&past));
        self.length = if past == Past::NONE { 1 } else { share };
        // Without a past there is nothing to get rid of.
        self.left = self.length - 1;
        self.view = Some(now);
    }

    /// Whether what is shown will change although nothing moves.
    pub fn is_settling(&self) -> bool {
        self.left > 0
    }

    /// Bytes held on the GPU, without those of what is shown.
    pub fn bytes(&self) -> u64 {
        self.past.size() + [&self.filtered, &self.texture].map(bytes_of_texture).iter().sum::<u64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view(eye: Vec3, forward: Vec3) -> PastView {
        let clip_from_view = Mat4::perspective_infinite_reverse_rh(1.0, 1.5, 0.1);
        let clip_from_world = clip_from_view * Mat4::look_to_rh(eye, forward, Vec3::Y);
        let (size, cell) = (UVec2::new(160, 90), UVec2::splat(4));
        PastView { clip_from_world, eye, forward, exposure: 0.01, is_parallel: false, size, cell }
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
    fn other_cells_keep_their_past() {
        let before = view(Vec3::ZERO, Vec3::NEG_Z);
        let now = PastView { size: UVec2::new(320, 180), cell: UVec2::new(2, 1), ..before };
        let past = before.before(&now, 0.5);
        assert_eq!((past.size, past.cell), ([160, 90], [4, 4]));
        assert_eq!((before.cells(), now.cells()), (UVec2::new(40, 23), UVec2::new(160, 180)));
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
