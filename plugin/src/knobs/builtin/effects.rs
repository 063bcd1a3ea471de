//! Screen-space reflections, contact shadows and volumetric fog, by their ray-marching steps.

use bevy::ecs::prelude::*;
use bevy::light::VolumetricFog;
use bevy::pbr::{ContactShadows, ScreenSpaceReflections};

use super::held::{self, Authored};
use crate::knobs::{Knob, KnobDriver, Level};

/// Off, low, medium or high, on a camera to which the app gave [`ScreenSpaceReflections`],
/// [`ContactShadows`] or [`VolumetricFog`]. The value is the share of the app's own steps along a
/// ray, 0 to 1. Higher levels find thinner objects, have less banding, and cost more GPU time in
/// proportion to the steps. Off removes all three.
pub(crate) struct Effects;

/// `share` of the app's `steps`; at least one, which Bevy's shaders need.
fn steps(steps: u32, share: f64) -> u32 {
    ((f64::from(steps) * share).round() as u32).max(steps.min(1))
}

impl KnobDriver for Effects {
    fn knob(&self) -> Knob {
        Knob::labelled("effects", [(0.0, "off"), (0.25, "low"), (0.5, "medium"), (1.0, "high")])
    }

    fn apply(&self, world: &mut World, camera: Entity, level: &Level) {
        let share = level.value;
        let is_on = share > 0.0;
        held::hold(world, camera, |authored: Option<&ScreenSpaceReflections>| {
            let authored = authored.filter(|_| is_on)?;
            Some(ScreenSpaceReflections {
                linear_steps: steps(authored.linear_steps, share),
                bisection_steps: steps(authored.bisection_steps, share),
                ..authored.clone()
            })
        });
        held::hold(world, camera, |authored: Option<&ContactShadows>| {
            let authored = authored.filter(|_| is_on)?;
            Some(ContactShadows { linear_steps: steps(authored.linear_steps, share), ..*authored })
        });
        held::hold(world, camera, |authored: Option<&VolumetricFog>| {
            let authored = authored.filter(|_| is_on)?;
            Some(VolumetricFog { step_count: steps(authored.step_count, share), ..*authored })
        });
    }

    fn is_applied(&self, world: &World, camera: Entity, _: &Level) -> bool {
        held::is_held::<ScreenSpaceReflections>(world, camera)
            && held::is_held::<ContactShadows>(world, camera)
            && held::is_held::<VolumetricFog>(world, camera)
    }

    fn release(&self, world: &mut World, camera: Entity) {
        held::release::<ScreenSpaceReflections>(world, camera);
        held::release::<ContactShadows>(world, camera);
        held::release::<VolumetricFog>(world, camera);
    }
}

impl Authored for ScreenSpaceReflections {
    fn is_same(&self, other: &Self) -> bool {
        let numbers = |it: &Self| {
            [
                it.min_perceptual_roughness.start,
                it.min_perceptual_roughness.end,
                it.max_perceptual_roughness.start,
                it.max_perceptual_roughness.end,
                it.thickness,
                it.linear_march_exponent,
                it.edge_fadeout.start,
                it.edge_fadeout.end,
            ]
            .map(f32::to_bits)
        };
        numbers(self) == numbers(other)
            && self.linear_steps == other.linear_steps
            && self.bisection_steps == other.bisection_steps
            && self.use_secant == other.use_secant
    }

    fn take_back(&mut self, written: &Self, authored: &Self) {
        if self.linear_steps == written.linear_steps {
            self.linear_steps = authored.linear_steps;
        }
        if self.bisection_steps == written.bisection_steps {
            self.bisection_steps = authored.bisection_steps;
        }
    }
}

impl Authored for ContactShadows {
    fn is_same(&self, other: &Self) -> bool {
        self.linear_steps == other.linear_steps
            && self.thickness.to_bits() == other.thickness.to_bits()
            && self.length.to_bits() == other.length.to_bits()
    }

    fn take_back(&mut self, written: &Self, authored: &Self) {
        if self.linear_steps == written.linear_steps {
            self.linear_steps = authored.linear_steps;
        }
    }
}

impl Authored for VolumetricFog {
    fn is_same(&self, other: &Self) -> bool {
        let numbers =
            |fog: &Self| [fog.ambient_intensity.to_bits(), fog.jitter.to_bits(), fog.step_count];
        numbers(self) == numbers(other) && self.ambient_color == other.ambient_color
    }

    fn take_back(&mut self, written: &Self, authored: &Self) {
        if self.step_count == written.step_count {
            self.step_count = authored.step_count;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_fall_with_the_level_and_never_reach_zero_while_on() {
        let (mut world, levels) = (World::new(), Effects.knob().levels);
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
            Effects.apply(&mut world, camera, level);
            assert_eq!(counts(&world), expected, "{}", level.label);
            assert!(Effects.is_applied(&world, camera, level));
        }
        // The app's own changes of other fields stay; of the steps, those that it wrote.
        Effects.apply(&mut world, camera, &levels[1]);
        world.get_mut::<VolumetricFog>(camera).expect("fog").jitter = 0.5;
        world.get_mut::<ContactShadows>(camera).expect("shadows").linear_steps = 40;
        assert!(!Effects.is_applied(&world, camera, &levels[1]));
        Effects.apply(&mut world, camera, &levels[1]);
        assert_eq!(counts(&world), [Some(3), Some(10), Some(16)]);
        Effects.release(&mut world, camera);
        assert_eq!(counts(&world), [Some(10), Some(40), Some(64)]);
        assert_eq!(world.get::<VolumetricFog>(camera).map(|fog| fog.jitter), Some(0.5));
    }

    #[test]
    fn nothing_is_added_that_the_app_did_not_author() {
        let mut world = World::new();
        let camera = world.spawn_empty().id();
        for level in &Effects.knob().levels {
            Effects.apply(&mut world, camera, level);
            assert!(!world.entity(camera).contains::<ScreenSpaceReflections>());
            assert!(!world.entity(camera).contains::<ContactShadows>());
            assert!(!world.entity(camera).contains::<VolumetricFog>());
        }
    }
}
