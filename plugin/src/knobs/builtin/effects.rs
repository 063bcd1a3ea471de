//! Knobs of screen-space and post-processing effects, on cameras to which the app gave them.

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::{Smaa, SmaaPreset};
use bevy::camera::CameraUpdateSystems;
use bevy::light::VolumetricFog;
use bevy::pbr::{
    ContactShadows, ScreenSpaceAmbientOcclusion, ScreenSpaceAmbientOcclusionQualityLevel,
    ScreenSpaceReflections,
};
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;

use crate::knobs::overrides::{Field, Override};
use crate::knobs::{FieldKnob, Knob, KnobDriver, KnobField, Level};
use crate::resolution::ResolutionScale;

/// Off, 4, 8, 16 or 32 samples per pixel of [`ScreenSpaceAmbientOcclusion`]. Higher levels reduce
/// noise and cost more GPU time. Switching between off and on changes the deferred lighting
/// pipeline: Bevy skips that pass until the pipeline is compiled. Bevy's normal prepass stays while
/// it is off, so that no mesh's pipeline changes.
pub(super) fn ambient_occlusion() -> FieldKnob {
    let levels = [(0.0, "off"), (4.0, "4"), (8.0, "8"), (16.0, "16"), (32.0, "32")];
    FieldKnob::new(
        Knob::labelled("ambient_occlusion", levels),
        KnobField::new(
            |occlusion: &mut ScreenSpaceAmbientOcclusion| &mut occlusion.quality_level,
            |level, _| ScreenSpaceAmbientOcclusionQualityLevel::Custom {
                // Each slice takes two samples on each side.
                slice_count: level.value as u32 / 4,
                samples_per_slice_side: 2,
            },
        )
        .removed_at_zero(),
    )
}

/// Off, low, medium or high for [`ScreenSpaceReflections`], [`ContactShadows`] and
/// [`VolumetricFog`]. The value is the share of the app's own steps along a ray, 0 to 1. Higher
/// levels find thinner objects, have less banding, and cost more GPU time in proportion to the
/// steps. Off removes all three.
pub(super) fn effects() -> FieldKnob {
    let levels = [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")];
    FieldKnob::new(
        Knob::labelled("effects", levels),
        KnobField::new(
            |reflections: &mut ScreenSpaceReflections| &mut reflections.linear_steps,
            share_of,
        )
        .removed_at_zero(),
    )
    .and(
        KnobField::new(
            |reflections: &mut ScreenSpaceReflections| &mut reflections.bisection_steps,
            share_of,
        )
        .removed_at_zero(),
    )
    .and(
        KnobField::new(|shadows: &mut ContactShadows| &mut shadows.linear_steps, share_of)
            .removed_at_zero(),
    )
    .and(KnobField::new(|fog: &mut VolumetricFog| &mut fog.step_count, share_of).removed_at_zero())
}

/// A level's share of the app's `steps`; at least one, which Bevy's shaders need.
fn share_of(level: &Level, steps: u32) -> u32 {
    ((f64::from(steps) * level.value).round() as u32).max(steps.min(1))
}

/// Off, FXAA, or SMAA with 4 to 32 search steps, on a camera to which the app gave either. Levels
/// are in order of quality, not cost: on some devices FXAA costs more than SMAA, which processes
/// edges only. A search then finds FXAA dominated and never selects it.
pub(super) struct Antialiasing;

const FXAA_VALUE: f64 = 1.0;

const SMAA: Field<Smaa, SmaaPreset> = Field(|smaa| &mut smaa.preset);
/// The knob adds and removes it, and leaves the field as it is.
const FXAA: Field<Fxaa, bool> = Field(|fxaa| &mut fxaa.enabled);

impl KnobDriver for Antialiasing {
    fn knob(&self) -> Knob {
        let levels = [
            (0.0, "off"),
            (FXAA_VALUE, "FXAA"),
            (4.0, "SMAA 4"),
            (8.0, "SMAA 8"),
            (16.0, "SMAA 16"),
            (32.0, "SMAA 32"),
        ];
        Knob::labelled("antialiasing", levels)
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let preset = match level.value as u32 {
            0 | 1 => None,
            4 => Some(SmaaPreset::Low),
            8 => Some(SmaaPreset::Medium),
            16 => Some(SmaaPreset::High),
            _ => Some(SmaaPreset::Ultra),
        };
        let is_authored =
            FXAA.authored(world, camera).is_some() || SMAA.authored(world, camera).is_some();
        let smaa = preset.filter(|_| is_authored).map(|preset| Smaa { preset });
        SMAA.set(world, camera, |_| smaa);
        let is_fxaa = is_authored && level.value == FXAA_VALUE;
        FXAA.set(world, camera, |authored| is_fxaa.then(|| authored.unwrap_or_default()));
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        SMAA.is_set(world, camera) && FXAA.is_set(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        SMAA.release(world, camera);
        FXAA.release(world, camera);
    }
}

/// Off, low, medium or high [`Bloom`]. The value is the maximum height of bloom's first texture as
/// a fraction of the view's height, 0 to 1. Higher levels render bloom at a finer resolution and
/// cost more GPU time.
pub(super) fn post_processing() -> FieldKnob {
    let levels = [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")];
    FieldKnob::new(
        Knob::labelled("post_processing", levels),
        KnobField::new(
            |bloom: &mut Bloom| &mut bloom.max_mip_dimension,
            // `fit_bloom` reduces it.
            |_, authored| authored,
        )
        .removed_at_zero(),
    )
    .and(KnobField::new(|share: &mut BloomShare| &mut share.0, |level, _| level.value).added())
}

/// Maximum height of bloom's first texture as a fraction of the view's height.
///
/// Bevy makes that texture `max_mip_dimension` high whatever the view's size. In a small view a
/// fixed height costs more than the rest of the frame, so it scales with the view.
#[derive(Component, Clone, Copy, Default)]
struct BloomShare(f64);

pub(super) fn build(app: &mut App) {
    // Needs this frame's viewport size and resolution scale.
    app.add_systems(
        PostUpdate,
        fit_bloom.after(CameraUpdateSystems).run_if(any_with_component::<BloomShare>),
    );
}

/// Runs every frame, since the window and the resolution scale change independently of the knob.
fn fit_bloom(
    mut cameras: Query<(
        &Camera,
        &BloomShare,
        &mut Bloom,
        &mut Override<Bloom>,
        Option<&ResolutionScale>,
    )>,
) {
    for (camera, share, mut bloom, mut record, scale) in &mut cameras {
        let size = camera.physical_viewport_size().unwrap_or(UVec2::new(1280, 720));
        let height = scale.copied().unwrap_or_default().apply(size).y;
        let largest = (f64::from(height) * share.0).clamp(8.0, 512.0);
        // Bloom halves it down to 2: powers of two leave no remainder.
        let max_mip_dimension = 1 << (largest as u32).ilog2();
        if bloom.max_mip_dimension != max_mip_dimension {
            bloom.max_mip_dimension = max_mip_dimension;
            if let Some(written) = &mut record.written {
                written.max_mip_dimension = max_mip_dimension;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_fall_with_the_level_and_never_reach_zero_while_on() {
        let (mut world, knob) = (World::new(), effects());
        let levels = knob.knob().levels;
        let camera = world
            .spawn((
                ScreenSpaceReflections { linear_steps: 10, ..Default::default() },
                ContactShadows { linear_steps: 2, ..Default::default() },
                VolumetricFog { step_count: 64, ..Default::default() },
            ))
            .id();
        let counts = |world: &World| {
            [
                world.get::<ScreenSpaceReflections>(camera).map(|it| it.linear_steps),
                world.get::<ContactShadows>(camera).map(|it| it.linear_steps),
                world.get::<VolumetricFog>(camera).map(|it| it.step_count),
            ]
        };
        let expected = [
            [None; 3],
            [Some(3), Some(1), Some(16)],
            [Some(5), Some(1), Some(32)],
            [Some(10), Some(2), Some(64)],
        ];
        for (level, expected) in levels.iter().zip(expected) {
            knob.apply(&mut world, camera, level);
            assert_eq!(counts(&world), expected, "{}", level.label);
            assert!(knob.is_applied(&world, camera, level));
        }
        // The app's own changes of other fields stay; of the steps, those that it wrote.
        knob.apply(&mut world, camera, &levels[1]);
        world.get_mut::<VolumetricFog>(camera).expect("fog").jitter = 0.5;
        world.get_mut::<ContactShadows>(camera).expect("shadows").linear_steps = 40;
        assert!(!knob.is_applied(&world, camera, &levels[1]));
        knob.apply(&mut world, camera, &levels[1]);
        assert_eq!(counts(&world), [Some(3), Some(10), Some(16)]);
        knob.release(&mut world, camera);
        assert_eq!(counts(&world), [Some(10), Some(40), Some(64)]);
        assert_eq!(world.get::<VolumetricFog>(camera).map(|fog| fog.jitter), Some(0.5));
    }

    #[test]
    fn bloom_fits_images_of_any_scale() {
        let (mut world, knob) = (World::new(), post_processing());
        let camera = world.spawn((Camera::default(), Bloom::NATURAL)).id();
        let highest = knob.knob().levels.len() - 1;
        knob.apply(&mut world, camera, &knob.knob().levels[highest]);
        for (scale, height) in [(1.0, 512), (0.5, 256), (f32::NAN, 512), (-1.0, 64), (1e9, 512)] {
            world.entity_mut(camera).insert(ResolutionScale(scale));
            world.run_system_cached(fit_bloom).expect("a system");
            let bloom = world.get::<Bloom>(camera).expect("bloom");
            assert_eq!(bloom.max_mip_dimension, height, "{scale}");
        }
    }

    #[test]
    fn nothing_is_added_that_the_app_did_not_author() {
        let (mut world, knob) = (World::new(), effects());
        let camera = world.spawn_empty().id();
        for level in &knob.knob().levels {
            knob.apply(&mut world, camera, level);
            assert!(!world.entity(camera).contains::<ScreenSpaceReflections>());
            assert!(!world.entity(camera).contains::<ContactShadows>());
            assert!(!world.entity(camera).contains::<VolumetricFog>());
        }
    }
}
