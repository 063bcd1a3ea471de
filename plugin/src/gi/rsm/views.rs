//! Maintains one hidden camera per map: spawns, moves, resizes and despawns them as lights and GI
//! cameras change. [`specs`](super::specs) says which maps should exist.

use bevy::camera::primitives::Frustum;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera, Camera3d, Projection, RenderTarget, RenderTargetInfo};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::light::cluster::Clusters;
use bevy::light::{DirectionalLight, PointLight, SpotLight, SunDisk};
use bevy::math::UVec2;
use bevy::math::primitives::ViewFrustum;
use bevy::platform::collections::HashMap;
use bevy::render::Extract;
use bevy::render::camera::{ExtractedCamera, MipBias, TemporalJitter};
use bevy::render::render_resource::TextureUsages;
use bevy::render::renderer::RenderDevice;
use bevy::render::sync_world::MainEntity;
use bevy::render::view::{
    ExtractedView, Msaa, NoIndirectDrawing, RenderVisibleEntities, ViewUniformOffset,
};
use bevy::time::{Real, Time};
use bevy::transform::components::{GlobalTransform, Transform};

use super::air::Atmospheres;
use super::drawn::MapMeshes;
use super::extent::SceneBox;
use super::focus::Focus;
use super::lights::{BouncingLight, Placed};
use super::map::{LightMap, MapAge, MapCapacity, MapPlace, MapSlots, MapSpec, RsmView};
use super::selection::LightSelection;
use super::specs::{Viewer, choose};
use crate::gi::compute::limits_of;
use crate::gi::settings::GiLimits;
use crate::gi::view::{ActiveGi, CameraCut, LightPresence};

/// Whether a map went in this frame, or a light fades: texels that need not be rendered count
/// differently.
#[derive(Resource, Default)]
pub(super) struct MapsReweighted(pub bool);

pub(super) fn maintain(
    mut commands: Commands,
    (mut reweighted, mut selection, mut slots, mut presence): (
        ResMut<MapsReweighted>,
        ResMut<LightSelection>,
        ResMut<MapSlots>,
        ResMut<LightPresence>,
    ),
    (limits, device, atmospheres): (Res<GiLimits>, Option<Res<RenderDevice>>, Atmospheres),
    (scene, time): (Res<SceneBox>, Option<Res<Time<Real>>>),
    cuts: Query<(), With<CameraCut>>,
    cameras: Query<
        (Entity, &Camera, &Projection, &ActiveGi, Option<&RenderLayers>, &GlobalTransform),
        Without<RsmView>,
    >,
    suns: Query<(Placed<DirectionalLight>, Option<&SunDisk>), Without<RsmView>>,
    spots: Query<Placed<SpotLight>, Without<RsmView>>,
    points: Query<Placed<PointLight>, Without<RsmView>>,
    mut maps: Query<Map, Without<ActiveGi>>,
) {
    let viewers: Vec<Viewer> = cameras
        .iter()
        .filter(|(_, camera, _, gi, ..)| camera.is_active && gi.vpl_count > 0)
        .map(|(entity, _, projection, gi, layers, placed)| {
            let resolution = gi.rsm_resolution.clamp(16, 2048);
            let pose = placed.compute_transform();
            let clip_from_view = projection.get_clip_from_view();
            Viewer {
                entity,
                focus: Focus::new(scene.0.unwrap_or_default(), &pose, clip_from_view, gi.range),
                frustum: Frustum(ViewFrustum::from_clip_from_world(
                    &(clip_from_view * pose.to_matrix().inverse()),
                )),
                resolution,
                shading: gi.shading,
                layers: layers.cloned().unwrap_or_default(),
                air: atmospheres.around(entity, pose.translation),
            }
        })
        .collect();

    if !cuts.is_empty() {
        selection.forget();
    }
    let capacity = MapCapacity::new(&limits_of(device.as_deref()));
    let mut specs = Vec::new();
    if let (Some(scene), false) = (scene.0, viewers.is_empty()) {
        let suns = suns.iter().filter_map(|(light, disk)| BouncingLight::directional(light, disk));
        let spots = spots.iter().filter_map(BouncingLight::spot);
        let points = points.iter().filter_map(BouncingLight::point);
        let lights: Vec<BouncingLight> = suns.chain(spots).chain(points).collect();
        specs = choose(
            &lights,
            &viewers,
            scene,
            &mut selection,
            (limits.max_rsm_count, time.map_or(0.0, |time| time.delta_secs())),
            capacity,
        );
    }
    slots.lay_out(&mut specs, capacity.texels);
    presence.maps = !specs.is_empty();

    let mut missing: HashMap<RsmView, MapSpec> =
        specs.into_iter().map(|spec| (spec.view, spec)).collect();
    reweighted.0 = false;
    for map in &mut maps {
        match missing.remove(map.view) {
            Some(spec) => {
                reweighted.0 |= map.map.share != spec.map.share;
                map.update(spec, &mut commands);
            }
            None => {
                reweighted.0 = true;
                commands.entity(map.entity).despawn();
            }
        }
    }
    for (_, spec) in missing {
        spawn(&mut commands, spec);
    }
}

/// An existing map.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Map {
    entity: Entity,
    view: &'static RsmView,
    map: &'static mut LightMap,
    camera: &'static mut Camera,
    target: &'static mut RenderTarget,
    projection: &'static mut Projection,
    place: &'static mut MapPlace,
    frustum: &'static mut Frustum,
    was_due: Has<GlobalTransform>,
    drawn_layers: &'static mut RenderLayers,
}

impl MapItem<'_, '_> {
    /// Applies the differences from `spec`.
    fn update(mut self, mut spec: MapSpec, commands: &mut Commands) {
        // Until it is decided that the map is due.
        if self.was_due {
            self.camera.is_active = false;
            commands.entity(self.entity).remove::<GlobalTransform>();
        }
        let order = spec.order();
        if self.camera.order != order {
            self.camera.order = order;
        }
        let size = UVec2::splat(spec.map.light.resolution);
        let resized = !matches!(*self.target, RenderTarget::None { size: old } if old == size);
        if resized {
            *self.target = RenderTarget::None { size };
        }
        // Bevy checks a target without texture only when the projection is marked as changed.
        spec.projection.update(size.x as f32, size.y as f32);
        let lens = |projection: &Projection| (projection.get_clip_from_view(), projection.far());
        let reprojected = resized || lens(&self.projection) != lens(&spec.projection);
        if reprojected {
            *self.projection = spec.projection;
            measure(&mut self.camera, &self.projection, size);
        }
        let moved = self.place.set_if_neq(MapPlace(spec.transform.into()));
        if moved || reprojected {
            *self.frustum = self.projection.compute_frustum(&self.place.0);
        }
        self.drawn_layers.set_if_neq(spec.map.layers.clone());
        let (before, now) = (&*self.map, spec.map);
        let shows = |map: &LightMap| (map.light, map.shading, map.layers.clone());
        let place = |map: &LightMap| (map.light.texel_offset, map.light.resolution);
        let is_elsewhere = place(before) != place(&now);
        // The cut moves texels from one cascade to the other, so both must be rendered in this
        // frame.
        let is_cut = before.cut != now.cut;
        let MapAge { stale, filled, urgent } = before.age;
        let changed = reprojected || moved || is_cut || shows(before) != shows(&now);
        let age = MapAge {
            stale: if changed { stale.max(1) } else { stale },
            filled: filled && !is_elsewhere,
            // A map that was there must not leave its light out for a while.
            urgent: urgent || is_cut || is_elsewhere && filled,
        };
        *self.map = LightMap { age, ..now };
    }
}

/// What Bevy has computed for this frame's other cameras already.
fn measure(camera: &mut Camera, projection: &Projection, size: UVec2) {
    camera.computed.target_info = Some(RenderTargetInfo { physical_size: size, scale_factor: 1.0 });
    camera.computed.clip_from_view = projection.get_clip_from_view();
}

fn spawn(commands: &mut Commands, mut spec: MapSpec) {
    let depth_texture_usages =
        (TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING).into();
    let order = spec.order();
    let size = UVec2::splat(spec.map.light.resolution);
    let mut camera = Camera { order, is_active: false, ..Default::default() };
    spec.projection.update(size.x as f32, size.y as f32);
    measure(&mut camera, &spec.projection, size);
    let place = GlobalTransform::from(spec.transform);
    let frustum = spec.projection.compute_frustum(&place);
    let mut camera = commands.spawn((
        spec.view,
        // Meshes of these layers cast the light's shadows, and reflect its light.
        spec.map.layers.clone(),
        spec.map,
        Camera3d { depth_texture_usages, ..Default::default() },
        camera,
        RenderTarget::None { size },
        Msaa::Off,
        // Forward-rendered meshes write only depth: they block light, and reflect none.
        DepthPrepass,
        DeferredPrepass,
        spec.projection,
        (MapPlace(place), frustum, MapMeshes::default()),
    ));
    // Without clusters Bevy builds no cascades, light lists or mesh-view bind groups for it. In the
    // same flush as the spawn: the render world must never have seen them.
    camera.remove::<Clusters>();
    // An app's `Single<&mut Transform, With<Camera>>` means its own camera.
    camera.remove::<(Transform, GlobalTransform)>();
}

/// In the render world: ends the views of maps that are not due. Bevy leaves out cameras without a
/// place, and would keep them.
pub(super) fn end_views(
    maps: Extract<Query<&Camera, With<RsmView>>>,
    views: Query<(Entity, &MainEntity), (With<RsmView>, With<ExtractedView>)>,
    mut commands: Commands,
) {
    for (view, map) in &views {
        if maps.get(map.id()).is_ok_and(|camera| !camera.is_active) {
            // What Bevy removes of cameras that are not active.
            commands.entity(view).remove::<(
                ExtractedCamera,
                ExtractedView,
                RenderVisibleEntities,
                TemporalJitter,
                MipBias,
                RenderLayers,
                Projection,
                NoIndirectDrawing,
                ViewUniformOffset,
            )>();
        }
    }
}
