//! Maintains one hidden camera per map: spawns, moves, resizes and despawns them as lights and GI
//! cameras change.

use bevy::camera::visibility::{InheritedVisibility, RenderLayers};
use bevy::camera::{
    Camera, Camera3d, OrthographicProjection, PerspectiveProjection, Projection, RenderTarget,
    ScalingMode,
};
use bevy::core_pipeline::prepass::{DeferredPrepass, DepthPrepass};
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::light::cluster::Clusters;
use bevy::light::{DirectionalLight, PointLight, SpotLight};
use bevy::math::{Mat3, Quat, UVec2, Vec3};
use bevy::platform::collections::HashMap;
use bevy::render::render_resource::TextureUsages;
use bevy::render::renderer::RenderDevice;
use bevy::render::view::Msaa;
use bevy::transform::components::Transform;
use bevy::transform::helper::TransformHelper;

use super::capacity::MapCapacity;
use super::focus::Focus;
use super::lights::{BouncingLight, LightShape, RsmLight};
use super::region::{LightRegion, SceneBox, cover, near};
use super::{MapLayers, RsmView};
use crate::gi::settings::{FrugalGi, GiLimits, GiShading};
use crate::gi::texels::CascadeCut;
use crate::gi::view::LightPresence;

/// Maps render before every camera that an app orders; each has its own order.
const FIRST_ORDER: isize = isize::MIN / 2;

/// A map that should exist in this frame.
struct MapSpec {
    view: RsmView,
    resolution: u32,
    transform: Transform,
    projection: Projection,
    light: RsmLight,
    cut: CascadeCut,
    shading: GiShading,
    layers: MapLayers,
}

impl MapSpec {
    /// Unique, as offsets in the store are: cameras of equal order and target are ambiguous to
    /// Bevy.
    fn order(&self) -> isize {
        FIRST_ORDER + self.light.texel_offset as isize
    }
}

/// A GI camera of this frame, which maps serve.
struct Viewer {
    entity: Entity,
    focus: Focus,
    resolution: u32,
    shading: GiShading,
    layers: RenderLayers,
}

/// Changes of maps in this frame.
#[derive(Resource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::gi) struct MapDelta {
    /// A map was added, removed or resized: the layout of the store changed.
    pub laid_out: bool,
    /// A map's light or region moved or changed.
    pub moved: bool,
}

type Lit<L> = (Entity, &'static L, &'static InheritedVisibility, Option<&'static RenderLayers>);

pub(super) fn maintain(
    mut commands: Commands,
    (mut delta, mut presence): (ResMut<MapDelta>, ResMut<LightPresence>),
    (limits, device): (Res<GiLimits>, Option<Res<RenderDevice>>),
    scene: Res<SceneBox>,
    cameras: Query<
        (Entity, &Camera, &Projection, &FrugalGi, Option<&RenderLayers>),
        Without<RsmView>,
    >,
    suns: Query<Lit<DirectionalLight>, Without<RsmView>>,
    spots: Query<Lit<SpotLight>, Without<RsmView>>,
    points: Query<Lit<PointLight>, Without<RsmView>>,
    // Both access transforms: those of lights and cameras are read first, then those of maps are
    // written.
    mut params: ParamSet<(TransformHelper, Query<Map, Without<FrugalGi>>)>,
) {
    let transforms = params.p0();
    let transform_of =
        |entity| transforms.compute_global_transform(entity).ok().map(|t| t.compute_transform());
    let viewers: Vec<Viewer> = cameras
        .iter()
        .filter(|(_, camera, _, gi, _)| camera.is_active && gi.vpl_count > 0)
        .filter_map(|(entity, _, projection, gi, layers)| {
            let resolution = gi.rsm_resolution.clamp(16, 2048);
            Some(Viewer {
                entity,
                focus: Focus::new(
                    scene.0.unwrap_or_default(),
                    &transform_of(entity)?,
                    projection.get_clip_from_view(),
                    gi.range,
                ),
                resolution,
                shading: gi.shading,
                layers: layers.cloned().unwrap_or_default(),
            })
        })
        .collect();

    let mut specs = Vec::new();
    if let (Some(scene), false) = (scene.0, viewers.is_empty()) {
        let layers = |layers: Option<&RenderLayers>| MapLayers(layers.cloned().unwrap_or_default());
        let mut lights: Vec<(BouncingLight, MapLayers)> = Vec::new();
        lights.extend(suns.iter().filter(|(_, _, visible, _)| visible.get()).filter_map(
            |(entity, light, _, mask)| {
                Some((
                    BouncingLight::directional(entity, light, transform_of(entity)?.rotation)?,
                    layers(mask),
                ))
            },
        ));
        lights.extend(spots.iter().filter(|(_, _, visible, _)| visible.get()).filter_map(
            |(entity, light, _, mask)| {
                let at = transform_of(entity)?;
                Some((
                    BouncingLight::spot(entity, light, at.translation, at.rotation)?,
                    layers(mask),
                ))
            },
        ));
        lights.extend(points.iter().filter(|(_, _, visible, _)| visible.get()).filter_map(
            |(entity, light, _, mask)| {
                Some((
                    BouncingLight::point(entity, light, transform_of(entity)?.translation)?,
                    layers(mask),
                ))
            },
        ));
        specs = choose(
            &lights,
            &viewers,
            scene,
            limits.max_rsm_count,
            MapCapacity::new(device.as_deref()),
        );
    }
    lay_out(&mut specs);
    presence.maps = !specs.is_empty();

    let mut missing: HashMap<RsmView, MapSpec> =
        specs.into_iter().map(|spec| (spec.view, spec)).collect();
    *delta = MapDelta::default();
    for map in &mut params.p1() {
        match missing.remove(map.view) {
            Some(spec) => map.update(spec, &mut delta),
            None => {
                commands.entity(map.entity).despawn();
                delta.laid_out = true;
            }
        }
    }
    delta.laid_out |= !missing.is_empty();
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
    transform: &'static mut Transform,
    light: &'static mut RsmLight,
    cut: &'static mut CascadeCut,
    shading: &'static mut GiShading,
    layers: &'static mut MapLayers,
    drawn_layers: &'static mut RenderLayers,
}

impl MapItem<'_, '_> {
    /// Applies the differences from `spec`.
    fn update(mut self, spec: MapSpec, delta: &mut MapDelta) {
        delta.laid_out |= (self.light.texel_offset, self.light.resolution)
            != (spec.light.texel_offset, spec.light.resolution);
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
            delta.moved = true;
        }
        delta.moved |= self.transform.set_if_neq(spec.transform);
        self.drawn_layers.set_if_neq(spec.layers.0.clone());
        delta.moved |= self.layers.set_if_neq(spec.layers);
        delta.moved |= self.light.set_if_neq(spec.light) | self.shading.set_if_neq(spec.shading);
        // The cut moves texels from one cascade to the other, so both must be rendered in this
        // frame.
        delta.laid_out |= self.cut.set_if_neq(spec.cut);
    }
}

/// The maps of the most important lights, up to `most` maps, as far as the device has capacity.
fn choose(
    lights: &[(BouncingLight, MapLayers)],
    viewers: &[Viewer],
    scene: (Vec3, Vec3),
    most: usize,
    mut capacity: MapCapacity,
) -> Vec<MapSpec> {
    let mut ranked: Vec<_> = lights
        .iter()
        .filter_map(|(light, layers)| {
            // As Bevy: a light lights the cameras with which it shares a layer.
            let lit = viewers.iter().filter(|viewer| viewer.layers.intersects(&layers.0));
            let importance =
                lit.map(|viewer| light.importance(viewer.focus.position)).max_by(f32::total_cmp)?;
            Some((importance, light, layers))
        })
        .collect();
    // Ties are broken by entity, so that the choice does not flicker.
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.entity.cmp(&b.1.entity)));

    // Shared maps satisfy the most demanding camera.
    let finest = viewers.iter().map(|viewer| viewer.resolution).max().unwrap_or(0);
    let lambertian = viewers.iter().all(|viewer| viewer.shading == GiShading::Lambertian);
    let shading = if lambertian { GiShading::Lambertian } else { GiShading::Standard };
    let mut specs = Vec::new();
    for (_, light, layers) in ranked {
        let mut maps: Vec<MapSpec> = match light.shape {
            LightShape::Directional => {
                let lit = viewers.iter().filter(|viewer| viewer.layers.intersects(&layers.0));
                lit.flat_map(|viewer| parallel_maps(light, viewer, scene, layers)).collect()
            }
            _ => (0..light.faces())
                .map(|face| perspective_map(light, face, finest, shading, layers))
                .collect(),
        };
        let largest = maps.iter().map(|map| map.resolution).max().unwrap_or(0);
        if specs.len() + maps.len() <= most && capacity.take(maps.len(), largest) {
            specs.append(&mut maps);
        }
    }
    specs
}

/// One map where the scene is small; else a far and a near cascade of about as many texels
/// together.
///
/// A map of a whole level is mostly ground that lights nothing in the image. For a hall of 17 m in
/// the middle of 100 m of ground, a single map of 512 × 512 texels had 2,400 on sunlit surfaces
/// inside, 21 cm each, and the hall's light was 5 % too low.
fn parallel_maps(
    light: &BouncingLight,
    viewer: &Viewer,
    scene: (Vec3, Vec3),
    layers: &MapLayers,
) -> Vec<MapSpec> {
    let rotation = Mat3::from_quat(light.rotation);
    let shared = shared_resolution(viewer.resolution);
    let Focus { position, range } = viewer.focus;
    let far = cover(scene, rotation, position, range, shared);
    if let Some((near, cut)) = near(&far, rotation, position, range, shared) {
        let maps = [(far, cut), (near, CascadeCut::default())];
        return (0..)
            .zip(maps)
            .map(|(face, (region, cut))| {
                parallel_map(light, viewer, face, shared, region, cut, layers)
            })
            .collect();
    }
    let whole = cover(scene, rotation, position, range, viewer.resolution);
    vec![parallel_map(light, viewer, 0, viewer.resolution, whole, CascadeCut::default(), layers)]
}

/// Texels along the side of each of two cascades that replace one map of `resolution`.
fn shared_resolution(resolution: u32) -> u32 {
    (resolution * 11 / 16).next_multiple_of(4)
}

fn parallel_map(
    light: &BouncingLight,
    viewer: &Viewer,
    face: u8,
    resolution: u32,
    region: LightRegion,
    cut: CascadeCut,
    layers: &MapLayers,
) -> MapSpec {
    MapSpec {
        view: RsmView { light: light.entity, camera: Some(viewer.entity), face },
        resolution,
        transform: Transform::from_translation(region.origin).with_rotation(light.rotation),
        projection: Projection::Orthographic(OrthographicProjection {
            near: 0.0,
            far: region.depth,
            scaling_mode: ScalingMode::Fixed { width: region.size.x, height: region.size.y },
            ..OrthographicProjection::default_3d()
        }),
        light: RsmLight {
            intensity: light.intensity,
            texel_area_or_solid_angle: region.size.x * region.size.y
                / (resolution * resolution) as f32,
            direction: light.rotation * Vec3::NEG_Z,
            cone_offset: 1.0,
            fade: region.fade,
            ..Default::default()
        },
        cut,
        shading: viewer.shading,
        layers: layers.clone(),
    }
}

fn perspective_map(
    light: &BouncingLight,
    face: u8,
    resolution: u32,
    shading: GiShading,
    layers: &MapLayers,
) -> MapSpec {
    let half_angle = match light.shape {
        LightShape::Spot { outer, .. } => outer,
        _ => std::f32::consts::FRAC_PI_4,
    };
    let resolution = light.resolution(resolution);
    let rotation = if light.shape == LightShape::Point { cube_face(face) } else { light.rotation };
    let edge = 2.0 * half_angle.tan() / resolution as f32;
    let (cone_scale, cone_offset) = light.cone();
    MapSpec {
        view: RsmView { light: light.entity, camera: None, face },
        resolution,
        transform: Transform::from_translation(light.position).with_rotation(rotation),
        projection: Projection::Perspective(PerspectiveProjection {
            fov: 2.0 * half_angle,
            aspect_ratio: 1.0,
            // Surfaces that touch the light do not matter; a nearer plane would show walls around
            // it from inside.
            near: 0.02,
            far: light.range,
            ..Default::default()
        }),
        light: RsmLight {
            intensity: light.intensity,
            texel_area_or_solid_angle: edge * edge,
            position: light.position,
            inverse_range_squared: light.inverse_range_squared(),
            direction: light.rotation * Vec3::NEG_Z,
            cone_scale,
            cone_offset,
            ..Default::default()
        },
        cut: CascadeCut::default(),
        shading,
        layers: layers.clone(),
    }
}

/// Rotation of a camera (which looks along its own −Z) for the cube's `face`: +X, −X, +Y, −Y, +Z,
/// −Z.
fn cube_face(face: u8) -> Quat {
    let axis = [Vec3::X, Vec3::Y, Vec3::Z][usize::from(face) / 2 % 3];
    let forward = if face.is_multiple_of(2) { axis } else { -axis };
    let up = if axis == Vec3::Y { Vec3::NEG_Z } else { Vec3::Y };
    Quat::from_mat3(&Mat3::from_cols(forward.cross(up), up, -forward))
}

/// Assigns every map its offset in the store, in an order that does not depend on the iteration of
/// entities.
fn lay_out(specs: &mut [MapSpec]) {
    specs.sort_by_key(|spec| (spec.view.light, spec.view.camera, spec.view.face));
    let mut texel = 0;
    for map in specs {
        map.light.texel_offset = texel;
        map.light.resolution = map.resolution;
        texel += map.resolution * map.resolution;
    }
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

fn spawn(commands: &mut Commands, spec: MapSpec) {
    let depth_texture_usages =
        (TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING).into();
    let order = spec.order();
    let mut camera = commands.spawn((
        spec.view,
        // Meshes of these layers cast the light's shadows, and reflect its light.
        spec.layers.0.clone(),
        spec.light,
        spec.cut,
        spec.shading,
        Camera3d { depth_texture_usages, ..Default::default() },
        Camera { order, ..Default::default() },
        RenderTarget::None { size: UVec2::splat(spec.resolution) },
        Msaa::Off,
        // Forward-rendered meshes write only depth: they block light, and reflect none.
        DepthPrepass,
        DeferredPrepass,
        spec.projection,
        spec.transform,
        spec.layers,
    ));
    // Without clusters Bevy builds no cascades, light lists or mesh-view bind groups for it. In the
    // same flush as the spawn: the render world must never have seen them.
    camera.remove::<Clusters>();
}
