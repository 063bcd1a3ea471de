//! Resolution of shadow maps. App scope.

use bevy::ecs::prelude::*;
use bevy::light::{DirectionalLightShadowMap, PointLightShadowMap};

use crate::knobs::{Knob, KnobDriver, KnobScope, Level};

/// Texels along the edge of a cascade or a spot light's map; a point light's six faces have half as
/// many. Higher levels give sharper shadow edges and cost more fill rate and memory.
pub(crate) struct ShadowMapResolution;

/// The app's own sizes, and those written last: of directional lights, of point lights.
#[derive(Resource, Clone, Copy)]
struct HeldShadowMaps {
    authored: [Option<usize>; 2],
    written: [Option<usize>; 2],
}

impl KnobDriver for ShadowMapResolution {
    fn knob(&self) -> Knob {
        Knob::new("shadow_map_resolution", [256.0, 512.0, 1024.0, 2048.0])
    }

    fn scope(&self) -> KnobScope {
        KnobScope::App
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        let authored = authored(world);
        let size = level.value as usize;
        set(world, [Some(size), Some(size / 2)]);
        let written = sizes(world);
        world.insert_resource(HeldShadowMaps { authored, written });
    }

    fn is_applied(&self, world: &World, _: Entity, _: &Level) -> bool {
        world.get_resource::<HeldShadowMaps>().is_none_or(|held| held.written == sizes(world))
    }

    fn release(&self, world: &mut World, _: Entity) {
        set(world, authored(world));
        world.remove_resource::<HeldShadowMaps>();
    }
}

/// Sizes in the world; `None` where the app lacks the resource.
fn sizes(world: &World) -> [Option<usize>; 2] {
    [
        world.get_resource::<DirectionalLightShadowMap>().map(|map| map.size),
        world.get_resource::<PointLightShadowMap>().map(|map| map.size),
    ]
}

/// The app's own sizes: those that the knob has not written are.
fn authored(world: &World) -> [Option<usize>; 2] {
    let now = sizes(world);
    let Some(held) = world.get_resource::<HeldShadowMaps>() else { return now };
    [0, 1].map(|map| if now[map] == held.written[map] { held.authored[map] } else { now[map] })
}

fn set(world: &mut World, [directional, point]: [Option<usize>; 2]) {
    if let (Some(mut map), Some(size)) =
        (world.get_resource_mut::<DirectionalLightShadowMap>(), directional)
        && map.size != size
    {
        map.size = size;
    }
    if let (Some(mut map), Some(size)) = (world.get_resource_mut::<PointLightShadowMap>(), point)
        && map.size != size
    {
        map.size = size;
    }
}
