//! Number of cascades of directional lights. App scope.

use bevy::app::{App, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::ecs::prelude::*;
use bevy::light::{CascadeShadowConfig, CascadeShadowConfigBuilder, DirectionalLight};

use crate::knobs::overrides::Field;
use crate::knobs::{FieldKnob, Knob, KnobField, KnobSystems};

/// Number of cascades of every directional light, over the app's own shadow distance. Higher levels
/// give sharper near shadows; each cascade renders the casters once more.
pub(super) fn knob() -> FieldKnob {
    FieldKnob::new(
        Knob::new("shadow_cascades", [1.0, 2.0, 3.0, 4.0]),
        KnobField::new(
            |count: &mut CascadeCount| &mut count.0,
            |level, _| Some(level.value as usize),
        )
        .of_resource(),
    )
}

/// Number of cascades of every light; `None` leaves the app's own.
#[derive(Resource, Clone, Copy, Default)]
struct CascadeCount(Option<usize>);

pub(super) fn build(app: &mut App) {
    app.init_resource::<CascadeCount>().add_systems(
        PostUpdate,
        divide_cascades.after(KnobSystems::Apply).before(CameraUpdateSystems).run_if(is_needed),
    );
}

/// Whether another number is asked for, or a light has new cascades.
fn is_needed(
    count: Res<CascadeCount>,
    changed: Query<
        (),
        (With<DirectionalLight>, Or<(Added<DirectionalLight>, Changed<CascadeShadowConfig>)>),
    >,
) -> bool {
    count.is_changed() || (count.0.is_some() && !changed.is_empty())
}

const BOUNDS: Field<CascadeShadowConfig, Vec<f32>> = Field(|cascades| &mut cascades.bounds);

fn divide_cascades(
    world: &mut World,
    lights: &mut QueryState<Entity, (With<DirectionalLight>, With<CascadeShadowConfig>)>,
) {
    let count = world.resource::<CascadeCount>().0;
    let lights: Vec<Entity> = lights.iter(world).collect();
    for light in lights {
        match count {
            // The app's own stay where they are invalid.
            Some(count) => BOUNDS.set(world, light, |authored| {
                authored.map(|own| divide(&own, count).unwrap_or(own))
            }),
            None => BOUNDS.release(world, light),
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
