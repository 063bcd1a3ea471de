//! Bloom, by the size of its mip chain.

use bevy::app::{App, PostUpdate};
use bevy::camera::{Camera, CameraUpdateSystems};
use bevy::ecs::prelude::*;
use bevy::post_process::bloom::Bloom;

use crate::knobs::{Knob, KnobDriver, Level};
use crate::resolution::ResolutionScale;

/// Off, low, medium or high. The value is the maximum height of bloom's first texture as a fraction
/// of the view's height, 0 to 1. Higher levels render bloom at a finer resolution and cost more GPU
/// time.
pub(crate) struct PostProcessing;

/// Maximum height of bloom's first texture as a fraction of the view's height.
///
/// Bevy makes that texture `max_mip_dimension` high whatever the view's size. In a small view a
/// fixed height costs more than the rest of the frame, so it scales with the view.
#[derive(Component, Clone, Copy)]
struct BloomShare(f64);

/// The app's own bloom, kept while bloom is off.
#[derive(Component)]
struct ParkedBloom(Bloom);

impl KnobDriver for PostProcessing {
    fn knob(&self) -> Knob {
        Knob::labelled(
            "post_processing",
            [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")],
        )
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let mut camera = world.entity_mut(camera);
        if level.value == 0.0 {
            if let Some(bloom) = camera.take::<Bloom>() {
                camera.insert(ParkedBloom(bloom));
            }
            return;
        }
        let bloom = camera
            .take::<ParkedBloom>()
            .map(|parked| parked.0)
            .or_else(|| camera.get::<Bloom>().cloned())
            .unwrap_or(Bloom::NATURAL);
        camera.insert((bloom, BloomShare(level.value)));
    }
}

pub(super) fn build(app: &mut App) {
    // Needs this frame's viewport size and resolution scale.
    app.add_systems(PostUpdate, fit_bloom.after(CameraUpdateSystems));
}

/// Every frame, since the window and the resolution scale change independently of the knob.
fn fit_bloom(mut cameras: Query<(&Camera, &BloomShare, &mut Bloom, Option<&ResolutionScale>)>) {
    for (camera, share, mut bloom, scale) in &mut cameras {
        let height = camera.physical_viewport_size().map_or(720, |size| size.y);
        let scale = scale.copied().unwrap_or_default().0;
        let largest = (f64::from(height) * f64::from(scale) * share.0).clamp(8.0, 512.0);
        // Bloom halves it down to 2: powers of two leave no remainder.
        let max_mip_dimension = 1 << (largest as u32).ilog2();
        if bloom.max_mip_dimension != max_mip_dimension {
            bloom.max_mip_dimension = max_mip_dimension;
        }
    }
}
