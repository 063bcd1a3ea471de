//! Number of cascades of directional lights. App scope.

use bevy::app::{App, PostUpdate};
use bevy::ecs::prelude::*;
use bevy::light::{CascadeShadowConfig, CascadeShadowConfigBuilder, DirectionalLight};

use crate::knobs::{Knob, KnobDriver, KnobScope, KnobSystems, Level};

/// Number of cascades of every directional light, over the app's own shadow distance. Higher levels
/// give sharper near shadows; each cascade renders the casters once more.
pub(crate) struct ShadowCascades;

/// The app's own cascades, whose distance each level divides again, and what was written last.
#[derive(Component, Clone)]
struct HeldCascades {
    authored: CascadeShadowConfig,
    written: CascadeShadowConfig,
}

/// Whether a light was added, or its cascades overwritten, since a level was applied.
#[derive(Resource, Default)]
struct CascadesDiffer(bool);

impl KnobDriver for ShadowCascades {
    fn knob(&self) -> Knob {
        Knob::new("shadow_cascades", [1.0, 2.0, 3.0, 4.0])
    }

    fn scope(&self) -> KnobScope {
        KnobScope::App
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        world.insert_resource(CascadesDiffer(false));
        let mut lights = world.query_filtered::<(Entity, &CascadeShadowConfig, Option<&HeldCascades>), With<DirectionalLight>>();
        let divided: Vec<_> = lights
            .iter(world)
            .map(|(entity, current, held)| {
                let authored = authored(current, held);
                // Invalid ones are left to Bevy.
                let written =
                    divide(&authored, level.value as usize).unwrap_or_else(|| authored.clone());
                let differs = !is_same(current, &written);
                (entity, differs, HeldCascades { authored, written })
            })
            .collect();
        for (entity, differs, held) in divided {
            let mut light = world.entity_mut(entity);
            if differs {
                light.insert(held.written.clone());
            }
            light.insert(held);
        }
    }

    fn is_applied(&self, world: &World, _: Entity, _: &Level) -> bool {
        !world.get_resource::<CascadesDiffer>().is_some_and(|differ| differ.0)
    }

    fn release(&self, world: &mut World, _: Entity) {
        let mut lights = world.query::<(Entity, &CascadeShadowConfig, &HeldCascades)>();
        let authored: Vec<_> = lights
            .iter(world)
            .map(|(entity, current, held)| (entity, authored(current, Some(held))))
            .collect();
        for (entity, authored) in authored {
            world.entity_mut(entity).insert(authored).remove::<HeldCascades>();
        }
    }
}

/// The app's own cascades of a light with `current` ones.
fn authored(current: &CascadeShadowConfig, held: Option<&HeldCascades>) -> CascadeShadowConfig {
    match held {
        Some(held) if is_same(current, &held.written) => held.authored.clone(),
        _ => current.clone(),
    }
}

fn is_same(a: &CascadeShadowConfig, b: &CascadeShadowConfig) -> bool {
    // Bits, so that NaN is the same as itself.
    let bits = |cascades: &CascadeShadowConfig| {
        [cascades.overlap_proportion, cascades.minimum_distance].map(f32::to_bits)
    };
    bits(a) == bits(b)
        && a.bounds.len() == b.bounds.len()
        && a.bounds.iter().zip(&b.bounds).all(|(a, b)| a.to_bits() == b.to_bits())
}

pub(super) fn build(app: &mut App) {
    app.init_resource::<CascadesDiffer>().add_systems(
        PostUpdate,
        watch_cascades.before(KnobSystems::Apply).run_if(any_match_filter::<ChangedCascades>),
    );
}

/// Lights whose cascades are new.
type ChangedCascades =
    (With<DirectionalLight>, Or<(Added<DirectionalLight>, Changed<CascadeShadowConfig>)>);

fn watch_cascades(
    lights: Query<(&CascadeShadowConfig, Option<&HeldCascades>), ChangedCascades>,
    mut differ: ResMut<CascadesDiffer>,
) {
    let is_ours = |(current, held): (&CascadeShadowConfig, Option<&HeldCascades>)| {
        held.is_some_and(|held| is_same(current, &held.written))
    };
    if !differ.0 && !lights.iter().all(is_ours) {
        differ.0 = true;
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
