//! Maintains one hidden camera per map: spawns, moves, resizes and despawns them as lights and GI
//! cameras change. [`specs`](super::specs) says which maps should exist.

use bevy::camera::primitives::Frustum;
use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::camera::{
    Camera, Camera3d, OrthographicProjection, Projection, RenderTarget, RenderTargetInfo,
    ScalingMode,
};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::light::cluster::Clusters;
use bevy::light::{DirectionalLight, PointLight, SpotLight, SunDisk};
use bevy::math::UVec2;
use bevy::math::primitives::ViewFrustum;
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::TextureUsages;
use bevy::render::renderer::RenderDevice;
use bevy::render::view::Msaa;
use bevy::time::{Real, Time};
use bevy::transform::components::{GlobalTransform, Transform};

use super::air::Atmospheres;
use super::capacity::MapCapacity;
use super::drawn::MapMeshes;
use super::focus::Focus;
use super::lights::{BouncingLight, RsmLight};
use super::scene_box::SceneBox;
use super::selection::LightSelection;
use super::slots::MapSlots;
use super::specs::{MapSpec, Viewer, choose};
use super::{MapAge, MapLayers, MapWeight, RsmView};
use crate::gi::settings::{FrugalGi, GiLimits, GiShading};
use crate::gi::texels::CascadeCut;
use crate::gi::view::{CameraCut, LightPresence};

/// Changes of maps in this frame.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct MapDelta {
    /// A map went, or its light fades: texels that need not be rendered count differently.
    pub reweighted: bool,
}

type Lit<L> = (
    Entity,
    &'static L,
    &'static GlobalTransform,
    &'static InheritedVisibility,
    Option<&'static RenderLayers>,
);

pub(super) fn maintain(
    mut commands: Commands,
    (mut delta, mut selection, mut slots, mut presence): (
        ResMut<MapDelta>,
        ResMut<LightSelection>,
        ResMut<MapSlots>,
        ResMut<LightPresence>,
    ),
    (limits, device, atmospheres): (Res<GiLimits>, Option<Res<RenderDevice>>, Atmospheres),
    (scene, time): (Res<SceneBox>, Option<Res<Time<Real>>>),
    cuts: Query<(), With<CameraCut>>,
    cameras: Query<
        (Entity, &Camera, &Projection, &FrugalGi, Option<&RenderLayers>, &GlobalTransform),
        Without<RsmView>,
    >,
    suns: Query<(Lit<DirectionalLight>, Option<&SunDisk>), Without<RsmView>>,
    spots: Query<Lit<SpotLight>, Without<RsmView>>,
    points: Query<Lit<PointLight>, Without<RsmView>>,
    mut maps: Query<Map, Without<FrugalGi>>,
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
    let capacity = MapCapacity::new(device.as_deref());
    let most_texels = capacity.texels();
    let mut specs = Vec::new();
    if let (Some(scene), false) = (scene.0, viewers.is_empty()) {
        let layers = |layers: Option<&RenderLayers>| MapLayers(layers.cloned().unwrap_or_default());
        let mut lights: Vec<(BouncingLight, MapLayers)> = Vec::new();
        lights.extend(suns.iter().filter(|((_, _, _, visible, _), _)| visible.get()).filter_map(
            |((entity, light, at, _, mask), disk)| {
                let sun = BouncingLight::directional(entity, light, at.rotation(), disk);
                Some((sun?, layers(mask)))
            },
        ));
        lights.extend(spots.iter().filter(|(_, _, _, visible, _)| visible.get()).filter_map(
            |(entity, light, at, _, mask)| {
                let (position, rotation) = (at.translation(), at.rotation());
                Some((BouncingLight::spot(entity, light, position, rotation)?, layers(mask)))
            },
        ));
        lights.extend(points.iter().filter(|(_, _, _, visible, _)| visible.get()).filter_map(
            |(entity, light, at, _, mask)| {
                Some((BouncingLight::point(entity, light, at.translation())?, layers(mask)))
            },
        ));
        specs = choose(
            &lights,
            &viewers,
            scene,
            &mut selection,
            (limits.max_rsm_count, time.map_or(0.0, |time| time.delta_secs())),
            capacity,
        );
    }
    slots.lay_out(&mut specs, most_texels);
    presence.maps = !specs.is_empty();

    let mut missing: HashMap<RsmView, MapSpec> =
        specs.into_iter().map(|spec| (spec.view, spec)).collect();
    *delta = MapDelta::default();
    for map in &mut maps {
        match missing.remove(map.view) {
            Some(spec) => {
                delta.reweighted |= map.weight.share != spec.weight.share;
                map.update(spec);
            }
            None => {
                delta.reweighted = true;
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
    camera: &'static mut Camera,
    target: &'static mut RenderTarget,
    projection: &'static mut Projection,
    transform: &'static mut GlobalTransform,
    light: &'static mut RsmLight,
    cut: &'static mut CascadeCut,
    shading: &'static mut GiShading,
    layers: &'static mut MapLayers,
    weight: &'static mut MapWeight,
    age: &'static mut MapAge,
    drawn_layers: &'static mut RenderLayers,
}

impl MapItem<'_, '_> {
    /// Applies the differences from `spec`.
    fn update(mut self, spec: MapSpec) {
        let slot = |light: &RsmLight| (light.texel_offset, light.resolution);
        let is_elsewhere = slot(&self.light) != slot(&spec.light);
        let mut moved = is_elsewhere;
        // Until it is decided that the map is due.
        if self.camera.is_active {
            self.camera.is_active = false;
        }
        let size = UVec2::splat(spec.resolution);
        let resized = !matches!(*self.target, RenderTarget::None { size: old } if old == size);
        if resized {
            *self.target = RenderTarget::None { size };
        }
        if self.camera.order != spec.order() {
            self.camera.order = spec.order();
        }
        // Bevy checks a target without texture only when the projection is marked as changed.
        if resized || !same_projection(&self.projection, &spec.projection) {
            *self.projection = spec.projection;
            measure(&mut self.camera, &mut self.projection, size);
            moved = true;
        }
        moved |= self.transform.set_if_neq(spec.transform.into());
        self.drawn_layers.set_if_neq(spec.layers.0.clone());
        moved |= self.layers.set_if_neq(spec.layers);
        moved |= self.light.set_if_neq(spec.light) | self.shading.set_if_neq(spec.shading);
        // The cut moves texels from one cascade to the other, so both must be rendered in this
        // frame.
        let is_cut = self.cut.set_if_neq(spec.cut);
        self.weight.set_if_neq(spec.weight);
        let age = *self.age;
        self.age.set_if_neq(MapAge {
            stale: if moved || is_cut { age.stale.max(1) } else { age.stale },
            filled: age.filled && !is_elsewhere,
            // A map that was there must not leave its light out for a while.
            urgent: age.urgent || is_cut || is_elsewhere && age.filled,
        });
    }
}

/// What Bevy has computed for this frame's other cameras already.
fn measure(camera: &mut Camera, projection: &mut Projection, size: UVec2) {
    projection.update(size.x as f32, size.y as f32);
    camera.computed.target_info = Some(RenderTargetInfo { physical_size: size, scale_factor: 1.0 });
    camera.computed.clip_from_view = projection.get_clip_from_view();
}

fn same_projection(a: &Projection, b: &Projection) -> bool {
    match (a, b) {
        (Projection::Perspective(a), Projection::Perspective(b)) => {
            (a.fov, a.near, a.far) == (b.fov, b.near, b.far)
        }
        (Projection::Orthographic(a), Projection::Orthographic(b)) => {
            let size = |p: &OrthographicProjection| match p.scaling_mode {
                ScalingMode::Fixed { width, height } => Some((width, height)),
                _ => None,
            };
            size(a) == size(b) && (a.near, a.far) == (b.near, b.far)
        }
        _ => false,
    }
}

fn spawn(commands: &mut Commands, mut spec: MapSpec) {
    let depth_texture_usages =
        (TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING).into();
    let order = spec.order();
    let size = UVec2::splat(spec.resolution);
    let mut camera = Camera { order, is_active: false, ..Default::default() };
    measure(&mut camera, &mut spec.projection, size);
    let mut camera = commands.spawn((
        spec.view,
        // Meshes of these layers cast the light's shadows, and reflect its light.
        spec.layers.0.clone(),
        spec.light,
        spec.cut,
        spec.shading,
        Camera3d { depth_texture_usages, ..Default::default() },
        camera,
        RenderTarget::None { size },
        Msaa::Off,
        // Forward-rendered meshes write only depth: they block light, and reflect none.
        DepthPrepass,
        DeferredPrepass,
        spec.projection,
        GlobalTransform::from(spec.transform),
        (spec.layers, spec.weight, MapMeshes::default()),
        // Until it is rendered.
        MapAge { stale: 1, ..Default::default() },
    ));
    // Without clusters Bevy builds no cascades, light lists or mesh-view bind groups for it. In the
    // same flush as the spawn: the render world must never have seen them.
    camera.remove::<Clusters>();
    // An app's `Single<&mut Transform, With<Camera>>` means its own camera.
    camera.remove::<Transform>();
}
