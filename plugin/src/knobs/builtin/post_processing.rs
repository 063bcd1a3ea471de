//! Bloom, by the size of its mip chain.

use bevy::app::{App, PostUpdate};
use bevy::camera::{Camera, CameraUpdateSystems};
use bevy::ecs::prelude::*;
use bevy::post_process::bloom::Bloom;

use super::held::{self, Authored, Held};
use crate::knobs::{Knob, KnobDriver, Level};
use crate::resolution::ResolutionScale;

/// Off, low, medium or high, on a camera to which the app gave [`Bloom`]. The value is the maximum height of bloom's first texture as a fraction
/// of the view's height, 0 to 1. Higher levels render bloom at a finer resolution and cost more GPU
/// time.
pub(crate) struct PostProcessing;

/// Maximum height of bloom's first texture as a fraction of the view's height.
///
/// Bevy makes that texture `max_mip_dimension` high whatever the view's size. In a small view a
/// fixed height costs more than the rest of the frame, so it scales with the view.
#[derive(Component, Clone, Copy)]
struct BloomShare(f64);

impl KnobDriver for PostProcessing {
    fn knob(&self) -> Knob {
        Knob::labelled(
            "post_processing",
            [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")],
        )
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let is_on = level.value > 0.0;
        held::hold(world, camera, |authored: Option<&Bloom>| authored.filter(|_| is_on).cloned());
        let Ok(mut camera) = world.get_entity_mut(camera) else { return };
        if camera.contains::<Bloom>() {
            camera.insert(BloomShare(level.value));
        } else {
            camera.remove::<BloomShare>();
        }
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<Bloom>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<Bloom>(world, camera);
        if let Ok(mut camera) = world.get_entity_mut(camera) {
            camera.remove::<BloomShare>();
        }
    }
}

impl Authored for Bloom {
    fn is_same(&self, other: &Self) -> bool {
        let numbers = |bloom: &Self| {
            [
                bloom.intensity,
                bloom.low_frequency_boost,
                bloom.low_frequency_boost_curvature,
                bloom.high_pass_frequency,
                bloom.prefilter.threshold,
                bloom.prefilter.threshold_softness,
                bloom.scale.x,
                bloom.scale.y,
            ]
            .map(f32::to_bits)
        };
        numbers(self) == numbers(other)
            && self.composite_mode == other.composite_mode
            && self.max_mip_dimension == other.max_mip_dimension
    }

    fn take_back(&mut self, written: &Self, authored: &Self) {
        if self.max_mip_dimension == written.max_mip_dimension {
            self.max_mip_dimension = authored.max_mip_dimension;
        }
    }
}

pub(super) fn build(app: &mut App) {
    // Needs this frame's viewport size and resolution scale.
    app.add_systems(
        PostUpdate,
        fit_bloom.after(CameraUpdateSystems).run_if(any_with_component::<BloomShare>),
    );
}

/// Every frame, since the window and the resolution scale change independently of the knob.
fn fit_bloom(
    mut cameras: Query<(
        &Camera,
        &BloomShare,
        &mut Bloom,
        &mut Held<Bloom>,
        Option<&ResolutionScale>,
    )>,
) {
    for (camera, share, mut bloom, mut held, scale) in &mut cameras {
        let height = camera.physical_viewport_size().map_or(720, |size| size.y);
        let scale = scale.copied().unwrap_or_default().0;
        let largest = (f64::from(height) * f64::from(scale) * share.0).clamp(8.0, 512.0);
        // Bloom halves it down to 2: powers of two leave no remainder.
        let max_mip_dimension = 1 << (largest as u32).ilog2();
        if bloom.max_mip_dimension != max_mip_dimension {
            held.rewrite(&mut bloom, |bloom| bloom.max_mip_dimension = max_mip_dimension);
        }
    }
}
