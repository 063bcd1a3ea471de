//! `denoise/temporal.wgsl`: the average of current light and history, rejection of history, and values
//! that are not finite.

use bevy::math::{Vec2, Vec3};
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d,
    uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutEntries, ShaderStages, StorageTextureAccess, TextureFormat,
    TextureSampleType,
};
use frugal::stage::Stage;
use frugal_tests::kernel::{self, Kernel};
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::{gather, gpu};
use half::f16;

use super::{Random, stage};

tests!(
    history_counts_for_its_share_where_it_shows_the_same_surface,
    values_that_are_not_finite_are_gone_in_a_frame,
    history_is_rejected_where_light_is_switched,
    short_histories_count_for_their_frames
);

const SIZE: [u32; 2] = [13, 9];
const COUNT: usize = (SIZE[0] * SIZE[1]) as usize;
const PLANE: Plane =
    Plane { center: Vec3::ZERO, spacing: 0.1, eye: Vec3::new(0.2, 3.0, 0.1), exposure: 1.0 };

struct TemporalFilter(Kernel);

impl TemporalFilter {
    fn new(stage: &mut Stage, smooth: bool) -> Self {
        let light = || texture_2d(TextureSampleType::Float { filterable: false });
        let layout = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer_sized(false, None),
                storage_buffer_read_only_sized(false, None),
                light(),
                light(),
                uniform_buffer_sized(false, None),
                texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
                light(),
                texture_storage_2d(TextureFormat::R32Float, StorageTextureAccess::WriteOnly),
            ),
        );
        let defs = if smooth { vec!["SMOOTH".into()] } else { vec![] };
        Self(Kernel::new(stage, "gi/denoise/temporal.wgsl", "accumulate", defs, &layout))
    }

    /// Accumulates `current` and `history`, each by pixel as luminance and alpha channel. The
    /// history was rendered `shift` pixels to the right.
    fn run(
        &self,
        stage: &Stage,
        current: &[[u16; 2]],
        history: &[[u16; 2]],
        share: f32,
        exposure: f32,
        shift: f32,
    ) -> Vec<[f64; 4]> {
        self.run_with_lengths(stage, current, history, &[LONG; COUNT], share, exposure, shift)
    }

    /// The same with the number of frames in each pixel of the history.
    fn run_with_lengths(
        &self,
        stage: &Stage,
        current: &[[u16; 2]],
        history: &[[u16; 2]],
        lengths: &[f32],
        share: f32,
        exposure: f32,
        shift: f32,
    ) -> Vec<[f64; 4]> {
        let (up, _) = g_buffer_normal(Vec3::Y);
        let pixels = Pixels::new(stage, SIZE, &[up; COUNT]);
        let half = Vec2::new(SIZE[0] as f32, SIZE[1] as f32) * 0.5 * PLANE.spacing;
        let right = shift * PLANE.spacing / half.x;
        #[rustfmt::skip]
        let words = [
            1.0 / half.x, 0.0, 0.0, 0.0,  0.0, 0.0, 0.0, 0.0,  0.0, 1.0 / half.y, 0.0, 0.0,  right, 0.0, 0.0, 1.0,
            half.x, 0.0, 0.0, 0.0,  0.0, 0.0, half.y, 0.0,  0.0, 0.0, 0.0, 0.0,  -right * half.x, 0.0, 0.0, 1.0,
            PLANE.eye.x, PLANE.eye.y, PLANE.eye.z, share, exposure, 0.0,
            // Sizes of the image and of a low-resolution pixel, in pixels.
            f32::from_bits(SIZE[0]), f32::from_bits(SIZE[1]), f32::from_bits(1), f32::from_bits(1), 0.0, 0.0,
        ];
        let light = |of: &[[u16; 2]]| {
            of.iter().map(|[light, alpha]| [*light, *light, *light, *alpha]).collect::<Vec<_>>()
        };
        let (view, plan, history_uniform) = (
            pixels.view(stage, &PLANE),
            gather::plan(stage, 0),
            kernel::buffer(stage, &gpu::bytes(&words)),
        );
        let (filtered, history_texture, texture) = (
            pixels.input(stage, &light(current)),
            pixels.input(stage, &light(history)),
            pixels.output(stage),
        );
        let output = texture.create_view(&Default::default());
        let history_lengths = pixels.float_input(stage, lengths);
        let new_lengths = pixels.float_output(stage).create_view(&Default::default());
        let bindings = BindGroupEntries::sequential((
            &pixels.g_buffer,
            &pixels.depth,
            view.as_entire_binding(),
            plan.as_entire_binding(),
            &filtered,
            &history_texture,
            history_uniform.as_entire_binding(),
            &output,
            &history_lengths,
            &new_lengths,
        ));
        self.0.run(stage, &bindings, (SIZE[0].div_ceil(8), SIZE[1].div_ceil(8)));
        gpu::read_halves(stage.render_world(), &texture)
    }
}

/// The half float of a value.
fn half(value: f64) -> u16 {
    f16::from_f64(value).to_bits()
}

/// Distance of a pixel's surface from the eye times a factor, as a half float.
fn distance(pixel: usize, factor: f64) -> u16 {
    half(
        PLANE
            .position(SIZE, pixel as u32 % SIZE[0], pixel as u32 / SIZE[0])
            .distance(PLANE.eye.as_dvec3())
            * factor,
    )
}

const NOISELESS: u16 = 0;
/// A history so long that the uniform's share decides.
const LONG: f32 = 60000.0;

fn noise(random: &mut Random) -> Vec<f64> {
    (0..COUNT).map(|_| f64::from(1.0 + random.next())).collect()
}

fn history_counts_for_its_share_where_it_shows_the_same_surface() {
    let mut stage = stage();
    let filter = TemporalFilter::new(&mut stage, false);
    let mut random = Random(17);
    let (now, before) = (noise(&mut random), noise(&mut random));
    let current: Vec<_> = now.iter().map(|light| [half(*light), NOISELESS]).collect();
    let history: Vec<_> = before
        .iter()
        .enumerate()
        .map(|(pixel, light)| [half(*light), distance(pixel, 1.0)])
        .collect();
    for (share, exposure) in [(1.0f32, 1.0), (0.0625, 1.0), (0.25, 0.5), (0.5, 1.5)] {
        for (pixel, found) in
            filter.run(&stage, &current, &history, share, exposure, 0.0).iter().enumerate()
        {
            let expected = f64::from(share) * now[pixel]
                + f64::from(1.0 - share) * f64::from(exposure) * before[pixel];
            assert!(
                (found[1] / expected - 1.0).abs() < 2e-3,
                "{share} {exposure}: {} at {pixel}, {expected} expected",
                found[1]
            );
            // The image is a parallel projection from above.
            let away = f64::from(PLANE.eye.y - PLANE.center.y);
            assert!((found[3] / away - 1.0).abs() < 2e-3, "the distance is kept: {}", found[3]);
        }
    }
    // The history shows a surface a tenth nearer, or no surface; or its position is outside the
    // image.
    let elsewhere: Vec<_> = before
        .iter()
        .enumerate()
        .map(|(pixel, light)| [half(*light), distance(pixel, 0.9)])
        .collect();
    let sky: Vec<_> = before.iter().map(|light| [half(*light), 0]).collect();
    for (label, history, shift) in
        [("elsewhere", &elsewhere, 0.0), ("the sky", &sky, 0.0), ("out of view", &history, 20.0)]
    {
        for (pixel, found) in
            filter.run(&stage, &current, history, 0.0625, 1.0, shift).iter().enumerate()
        {
            assert!(
                (found[1] / now[pixel] - 1.0).abs() < 2e-3,
                "{label}: {} at {pixel}, {} expected",
                found[1],
                now[pixel]
            );
        }
    }
}

fn values_that_are_not_finite_are_gone_in_a_frame() {
    let mut stage = stage();
    let (one, middle) = (half(1.0), COUNT / 2);
    for smooth in [false, true] {
        let filter = TemporalFilter::new(&mut stage, smooth);
        let current = vec![[one, NOISELESS]; COUNT];
        // NaN, both infinities and a negative value, as light and as distance; also with a shift of
        // half a pixel.
        for broken in [0x7e00, 0x7c00, 0xfc00, 0xbc00] {
            for component in 0..2 {
                for shift in [0.0, 0.5] {
                    let mut history: Vec<_> =
                        (0..COUNT).map(|pixel| [one, distance(pixel, 1.0)]).collect();
                    history[middle][component] = broken;
                    let found = filter.run(&stage, &current, &history, 0.0625, 1.0, shift);
                    let is_one = |texel: &[f64; 4]| {
                        texel[..3].iter().all(|light| (light - 1.0).abs() < 2e-3)
                    };
                    assert!(
                        found.iter().all(is_one),
                        "{broken:x} at {component}, {shift}: {:?}",
                        found.iter().find(|texel| !is_one(texel))
                    );
                }
            }
        }
    }
    // The largest half float, also with an exposure that exceeds it.
    let filter = TemporalFilter::new(&mut stage, true);
    let history: Vec<_> = (0..COUNT).map(|pixel| [0x7bff, distance(pixel, 1.0)]).collect();
    for exposure in [1.0, 1e20, 1e-20] {
        let found =
            filter.run(&stage, &vec![[one, NOISELESS]; COUNT], &history, 0.0625, exposure, 0.0);
        assert!(
            found.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
            "{exposure}: {:?}",
            found[middle]
        );
    }
}

fn history_is_rejected_where_light_is_switched() {
    let mut stage = stage();
    let filter = TemporalFilter::new(&mut stage, false);
    let history =
        |light: u16| (0..COUNT).map(|pixel| [light, distance(pixel, 1.0)]).collect::<Vec<_>>();
    for (was, is) in [(half(1.0), half(0.001)), (half(0.001), half(1.0)), (0, half(1.0))] {
        let found =
            filter.run(&stage, &vec![[is, NOISELESS]; COUNT], &history(was), 0.0625, 1.0, 0.0);
        assert!(
            found.iter().all(|texel| (texel[1] / gpu::half(is) - 1.0).abs() < 2e-3),
            "from {was:x} to {is:x}: {:?}",
            found[0]
        );
    }
}

fn short_histories_count_for_their_frames() {
    let mut stage = stage();
    let filter = TemporalFilter::new(&mut stage, false);
    let current = [[half(2.0), NOISELESS]; COUNT];
    let history: Vec<_> = (0..COUNT).map(|pixel| [half(1.0), distance(pixel, 1.0)]).collect();
    // The mean of all frames, until the uniform's share is larger; what is no length is one frame.
    for (length, share, expected) in [
        (1.0, 0.03125, 0.5),
        (3.0, 0.03125, 0.25),
        (15.0, 0.03125, 0.0625),
        (1000.0, 0.03125, 0.03125),
        (15.0, 0.25, 0.25),
        (0.0, 0.03125, 0.5),
        (-5.0, 0.03125, 0.5),
        (f32::NAN, 0.03125, 0.5),
        (f32::INFINITY, 0.03125, 0.5),
    ] {
        let lengths = [length; COUNT];
        let found = filter.run_with_lengths(&stage, &current, &history, &lengths, share, 1.0, 0.0);
        assert!(
            found.iter().all(|texel| (texel[0] - 1.0 - expected).abs() < 2e-3),
            "{length} {share}: {:?}, {} expected",
            found[0],
            1.0 + expected
        );
    }
    // Halfway between a pixel of one frame and one of three: a mean of two.
    let lengths: Vec<f32> =
        (0..COUNT).map(|pixel| (1 + 2 * (pixel % SIZE[0] as usize % 2)) as f32).collect();
    let found = filter.run_with_lengths(&stage, &current, &history, &lengths, 0.03125, 1.0, 0.5);
    let middle = &found[COUNT / 2];
    assert!((middle[0] - 1.0 - 1.0 / 3.0).abs() < 2e-3, "{middle:?}");
}
