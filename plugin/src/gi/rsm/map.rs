//! A reflective shadow map: its camera, its data, and both of one that should exist.

use bevy::camera::Projection;
use bevy::camera::visibility::RenderLayers;
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryItem;
use bevy::reflect::Reflect;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::sync_component::SyncComponent;
use bevy::transform::components::Transform;

use super::lights::RsmLight;
use crate::gi::settings::GiShading;
use crate::gi::texels::CascadeCut;

/// Marks a hidden camera that renders a light's reflective shadow map. Filter camera queries by
/// `Without<RsmView>` where they mean visible cameras.
#[derive(Component, Reflect, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[reflect(Component, Clone, PartialEq, Hash)]
#[non_exhaustive]
pub struct RsmView {
    /// The light.
    pub light: Entity,
    /// The GI camera whose surroundings it covers; `None` where the map serves all cameras.
    pub camera: Option<Entity>,
    /// Cube face of a point light, 0 to 5. Cascade of a directional light: 0 is the far one and 1
    /// the near one.
    pub face: u8,
}

/// A light's reflective shadow map. In both worlds, beside [`RsmView`]; the renderer has its
/// [`RsmLight`] as a component, too.
#[derive(Component, Clone, Debug, PartialEq)]
pub(in crate::gi) struct LightMap {
    /// Its light, and its place in the store.
    pub light: RsmLight,
    pub cut: CascadeCut,
    pub shading: GiShading,
    /// Render layers of its light: the map draws meshes, and serves cameras, that share one of them.
    pub layers: RenderLayers,
    /// What its light matters to GI cameras. Above 0; those of other maps compare with it.
    pub importance: f32,
    /// Share of its light that cameras get, 0 to 1: below 1 while it fades in or out.
    pub share: f32,
    pub age: MapAge,
}

/// How up to date a map's texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::gi) struct MapAge {
    /// Frames for which the scene has differed from its texels; 0 where it does not.
    pub stale: u32,
    /// Whether its range of the store holds its texels.
    pub filled: bool,
    /// Whether texels of other maps are wrong until it is rendered.
    pub urgent: bool,
}

impl MapAge {
    /// Of a map that was not rendered yet.
    pub(super) const NEW: Self = Self { stale: 1, filled: false, urgent: false };
    /// Of a map that is rendered in this frame.
    pub(super) const FRESH: Self = Self { stale: 0, filled: true, urgent: false };
}

impl SyncComponent for LightMap {
    type Target = (RsmView, LightMap, RsmLight);
}

impl ExtractComponent for LightMap {
    type QueryData = (&'static RsmView, &'static LightMap);
    type QueryFilter = ();
    type Out = (RsmView, LightMap, RsmLight);

    fn extract_component((view, map): QueryItem<Self::QueryData>) -> Option<Self::Out> {
        Some((*view, map.clone(), map.light))
    }
}

/// Maps render before every camera that an app orders; each has its own order.
const FIRST_ORDER: isize = isize::MIN / 2;

/// A map that should exist in this frame. Until [`MapSlots`](super::slots::MapSlots) lays it out, it
/// has no place in the store.
pub(super) struct MapSpec {
    pub view: RsmView,
    pub transform: Transform,
    pub projection: Projection,
    pub map: LightMap,
}

impl MapSpec {
    /// Unique, as offsets in the store are: cameras of equal order and target are ambiguous to
    /// Bevy.
    pub(super) fn order(&self) -> isize {
        FIRST_ORDER + self.map.light.texel_offset as isize
    }
}
