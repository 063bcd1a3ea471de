//! Directional, point and spot lights.

use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::world::World;
use bevy::light::{DirectionalLight, PointLight, RectLight, SpotLight};
use bevy::transform::components::GlobalTransform;
use frugal_trace::light::Light;

use super::{Gaps, name};

/// All lights that shine in the view of a camera with `layers`.
pub(super) fn lights(world: &mut World, layers: &RenderLayers, gaps: &mut Gaps) -> Vec<Light> {
    let mut lights = Vec::new();
    let mut query = world.query::<(
        Entity,
        &GlobalTransform,
        Option<&InheritedVisibility>,
        Option<&RenderLayers>,
        Option<&DirectionalLight>,
        Option<&PointLight>,
        Option<&SpotLight>,
    )>();
    for (entity, at, visibility, own_layers, sun, point, spot) in query.iter(world) {
        if !visibility.is_none_or(|visibility| visibility.get()) {
            continue;
        }
        let (position, direction) = (at.translation(), at.forward().as_vec3());
        let is_lit = |power: f32| power.is_finite() && power > 0.0;
        // Only directional lights have layers.
        let in_view = own_layers.unwrap_or(&RenderLayers::default()).intersects(layers);
        let sun = sun.filter(|light| in_view && is_lit(light.illuminance)).map(|light| {
            let (illuminance, color) = (light.illuminance, linear(light.color));
            (Light::Directional { direction, illuminance, color }, light.shadow_maps_enabled)
        });
        let point = point.filter(|light| is_lit(light.intensity)).map(|light| {
            let (luminous_power, range) = (light.intensity, light.range);
            let color = linear(light.color);
            (Light::Point { position, luminous_power, range, color }, light.shadow_maps_enabled)
        });
        let spot = spot.filter(|light| is_lit(light.intensity)).map(|light| {
            let spot = Light::Spot {
                position,
                direction,
                luminous_power: light.intensity,
                range: light.range,
                inner_angle: light.inner_angle.min(light.outer_angle).to_degrees(),
                outer_angle: light.outer_angle.to_degrees(),
                color: linear(light.color),
            };
            (spot, light.shadow_maps_enabled)
        });
        for (light, has_shadows) in [sun, point, spot].into_iter().flatten() {
            lights.push(light);
            if !has_shadows {
                let what = "lights without shadow maps cast shadows in the path tracer";
                gaps.add(what, name(world, entity));
            }
        }
    }
    let mut areas = world.query_filtered::<Entity, With<RectLight>>();
    for entity in areas.iter(world) {
        gaps.add("rectangular lights are left out", name(world, entity));
    }
    // Queries go by archetype, which says nothing. The sort is stable.
    lights.sort_by_key(|light| match light {
        Light::Directional { .. } => 0,
        Light::Point { .. } => 1,
        Light::Spot { .. } => 2,
    });
    lights
}

pub(super) fn linear(color: Color) -> [f32; 3] {
    let color = LinearRgba::from(color);
    [color.red, color.green, color.blue].map(|value| value.max(0.0))
}
