//! Shadow maps: resolution, and number of cascades of a directional light. Both have app scope.

use bevy::ecs::prelude::*;
use bevy::light::{
    CascadeShadowConfig, CascadeShadowConfigBuilder, DirectionalLight, DirectionalLightShadowMap,
    PointLightShadowMap,
};

use crate::knobs::{Knob, KnobDriver, KnobScope, Level};

/// Texels along the edge of a cascade or a spot light's map; a point light's six faces have half as
/// many. Higher levels give sharper shadow edges and cost more fill rate and memory.
pub(crate) struct ShadowMapResolution;

impl KnobDriver for ShadowMapResolution {
    fn knob(&self) -> Knob {
        Knob::new("shadow_map_resolution", [256.0, 512.0, 1024.0, 2048.0])
    }

    fn scope(&self) -> KnobScope {
        KnobScope::App
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        let size = level.value as usize;
        world.insert_resource(DirectionalLightShadowMap { size });
        world.insert_resource(PointLightShadowMap { size: size / 2 });
    }
}

/// Number of cascades of every directional light, over the app's own shadow distance. Higher levels
/// give sharper near shadows; each cascade renders the casters once more.
pub(crate) struct ShadowCascades;

/// The app's own cascades, whose distance each level divides again.
#[derive(Component, Clone)]
struct AuthoredCascades(CascadeShadowConfig);

impl KnobDriver for ShadowCascades {
    fn knob(&self) -> Knob {
        Knob::new("shadow_cascades", [1.0, 2.0, 3.0, 4.0])
    }

    fn scope(&self) -> KnobScope {
        KnobScope::App
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        let mut lights = world.query_filtered::<(Entity, &CascadeShadowConfig, Option<&AuthoredCascades>), With<DirectionalLight>>();
        let divided: Vec<_> = lights
            .iter(world)
            .filter_map(|(entity, current, authored)| {
                let authored =
                    authored.cloned().unwrap_or_else(|| AuthoredCascades(current.clone()));
                Some((entity, divide(&authored.0, level.value as usize)?, authored))
            })
            .collect();
        for (entity, cascades, authored) in divided {
            world.entity_mut(entity).insert((cascades, authored));
        }
    }
}

/// `count` cascades over the same distance; `None` where the app's own are invalid.
fn divide(authored: &CascadeShadowConfig, count: usize) -> Option<CascadeShadowConfig> {
    let (&first, &last) = (authored.bounds.first()?, authored.bounds.last()?);
    let minimum = authored.minimum_distance;
    if !(last > minimum
        && minimum >= 0.0
        && (0.0..1.0).contains(&authored.overlap_proportion)
        && last.is_finite())
    {
        return None;
    }
    // An app with one cascade specifies no bound for the first of several.
    let first = if authored.bounds.len() > 1 && first > minimum {
        first
    } else {
        minimum + (last - minimum) / 15.0
    };
    let builder = CascadeShadowConfigBuilder {
        num_cascades: count.max(1),
        minimum_distance: minimum,
        maximum_distance: last,
        first_cascade_far_bound: first,
        overlap_proportion: authored.overlap_proportion,
    };
    Some(builder.build())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cascades_keep_their_distance_and_reject_invalid_ones() {
        let authored =
            CascadeShadowConfigBuilder { maximum_distance: 60.0, ..Default::default() }.build();
        for count in 0..=4 {
            let divided = divide(&authored, count).expect("valid cascades");
            assert_eq!(divided.bounds.len(), count.max(1));
            assert!((divided.bounds.last().copied().unwrap_or(0.0) - 60.0).abs() < 1e-3);
        }
        let cascades_of = |bounds: Vec<f32>, minimum_distance| CascadeShadowConfig {
            bounds,
            overlap_proportion: 0.2,
            minimum_distance,
        };
        assert!(divide(&cascades_of(vec![], 0.1), 2).is_none());
        assert!(divide(&cascades_of(vec![f32::NAN], 0.1), 2).is_none());
        assert!(divide(&cascades_of(vec![0.05], 0.1), 2).is_none());
        assert_eq!(divide(&cascades_of(vec![30.0], 0.0), 3).map(|c| c.bounds.len()), Some(3));
    }
}
