//! Bloom, by the size of its chain of textures.

use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::post_process::bloom::Bloom;

use crate::knobs::{Knob, KnobDriver, Level};
use crate::resolution::ResolutionScale;

/// Off, low, medium or high. The value is the largest share of the view's height that bloom's first texture may have.
///
/// Bevy makes that texture `max_mip_dimension` high whatever the view's size is, so the number follows the view: in a small view a fixed one
/// costs more than all the rest of the frame.
pub struct PostProcessing;

/// What the app had asked for, while bloom is off.
#[derive(Component)]
struct ParkedBloom(Bloom);

impl KnobDriver for PostProcessing {
    fn knob(&self) -> Knob {
        Knob::labelled("post_processing", [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let height = world.get::<Camera>(camera).and_then(Camera::physical_viewport_size).map_or(720, |size| size.y);
        let mut camera = world.entity_mut(camera);
        if level.value == 0.0 {
            if let Some(bloom) = camera.take::<Bloom>() {
                camera.insert(ParkedBloom(bloom));
            }
            return;
        }
        let scale = camera.get::<ResolutionScale>().copied().unwrap_or_default().0;
        let largest = (f64::from(height) * f64::from(scale) * level.value).clamp(8.0, 512.0);
        // Bloom halves it down to 2: powers of two leave nothing over.
        let max_mip_dimension = 1 << (largest as u32).ilog2();
        let bloom =
            camera.take::<ParkedBloom>().map(|parked| parked.0).or_else(|| camera.get::<Bloom>().cloned()).unwrap_or(Bloom::NATURAL);
        camera.insert(Bloom { max_mip_dimension, ..bloom });
    }
}
