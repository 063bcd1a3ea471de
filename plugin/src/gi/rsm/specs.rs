//! The maps that should exist in a frame: which lights get one, of which size, and what each covers.

use bevy::camera::primitives::Frustum;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{OrthographicProjection, PerspectiveProjection, Projection, ScalingMode};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::math::{Mat3, Quat, Vec3};
use bevy::transform::components::Transform;

use super::air::Air;
use super::capacity::MapCapacity;
use super::focus::Focus;
use super::lights::{BouncingLight, LightShape, RsmLight};
use super::region::{LightRegion, cover, near};
use super::selection::{Candidate, LightSelection};
use super::{MapLayers, MapWeight, RsmView};
use crate::gi::settings::GiShading;
use crate::gi::texels::CascadeCut;

/// Maps render before every camera that an app orders; each has its own order.
const FIRST_ORDER: isize = isize::MIN / 2;

/// A map that should exist in this frame.
pub(super) struct MapSpec {
    pub view: RsmView,
    pub resolution: u32,
    pub transform: Transform,
    pub projection: Projection,
    pub light: RsmLight,
    pub cut: CascadeCut,
    pub shading: GiShading,
    pub layers: MapLayers,
    pub weight: MapWeight,
}

impl MapSpec {
    /// Unique, as offsets in the store are: cameras of equal order and target are ambiguous to
    /// Bevy.
    pub(super) fn order(&self) -> isize {
        FIRST_ORDER + self.light.texel_offset as isize
    }
}

/// A GI camera of this frame, which maps serve.
pub(super) struct Viewer<'a> {
    pub entity: Entity,
    pub focus: Focus,
    pub frustum: Frustum,
    pub resolution: u32,
    pub shading: GiShading,
    pub layers: RenderLayers,
    pub air: Option<Air<'a>>,
}

/// The maps of the most important lights, up to `most` maps, as far as the device has capacity.
/// `seconds` since the last frame.
pub(super) fn choose(
    lights: &[(BouncingLight, MapLayers)],
    viewers: &[Viewer],
    scene: (Vec3, Vec3),
    selection: &mut LightSelection,
    (most, seconds): (usize, f32),
    mut capacity: MapCapacity,
) -> Vec<MapSpec> {
    // Shared maps satisfy the most demanding camera.
    let finest = viewers.iter().map(|viewer| viewer.resolution).max().unwrap_or(0);
    let lambertian = viewers.iter().all(|viewer| viewer.shading == GiShading::Lambertian);
    let shading = if lambertian { GiShading::Lambertian } else { GiShading::Standard };
    let mut maps = EntityHashMap::default();
    let mut candidates = Vec::new();
    for (light, layers) in lights {
        let importance = lit(viewers, layers)
            .map(|viewer| light.importance(viewer.focus.position, &viewer.frustum))
            .max_by(f32::total_cmp);
        let Some(importance) = importance else { continue };
        let specs: Vec<MapSpec> = match light.shape {
            LightShape::Directional => lit(viewers, layers)
                .flat_map(|viewer| parallel_maps(light, viewer, scene, layers))
                .collect(),
            _ => (0..light.faces())
                .map(|face| perspective_map(light, face, finest, shading, layers))
                .collect(),
        };
        candidates.push(Candidate { light: light.entity, importance, maps: specs.len() });
        maps.insert(light.entity, (importance, specs));
    }
    let chosen = selection.next(&candidates, most, seconds, |candidate| {
        let maps = &maps[&candidate.light].1;
        let largest = maps.iter().map(|map| map.resolution).max().unwrap_or(0);
        capacity.take(maps.len(), largest)
    });
    let mut specs = Vec::new();
    for (light, share) in chosen {
        let Some((importance, mut maps)) = maps.remove(&light) else { continue };
        for map in &mut maps {
            map.weight = MapWeight { importance, share };
        }
        specs.append(&mut maps);
    }
    specs
}

/// The cameras that a light lights, as Bevy's: those with which it shares a layer.
fn lit<'a>(
    viewers: &'a [Viewer<'a>],
    layers: &'a MapLayers,
) -> impl Iterator<Item = &'a Viewer<'a>> {
    viewers.iter().filter(|viewer| viewer.layers.intersects(&layers.0))
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
    let direction = light.rotation * Vec3::NEG_Z;
    let arriving = viewer.air.map_or(Vec3::ONE, |air| air.sunlight(-direction, light.disk));
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
            intensity: light.intensity * arriving,
            texel_area_or_solid_angle: region.size.x * region.size.y
                / (resolution * resolution) as f32,
            direction,
            cone_offset: 1.0,
            fade: region.fade,
            ..Default::default()
        },
        cut,
        shading: viewer.shading,
        layers: layers.clone(),
        weight: MapWeight::default(),
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
        weight: MapWeight::default(),
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
