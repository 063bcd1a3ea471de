//! The maps that should exist in a frame: which lights get one, of which size, and what each covers.

use bevy::camera::primitives::Frustum;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{OrthographicProjection, PerspectiveProjection, Projection, ScalingMode};
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::math::{Mat3, Quat, Vec3};
use bevy::transform::components::Transform;

use super::air::Air;
use super::focus::Focus;
use super::lights::{BouncingLight, LightShape, RsmLight};
use super::map::{LightMap, MapAge, MapCapacity, MapSpec, RsmView};
use super::region::{LightRegion, cover, near};
use super::selection::{Candidate, LightSelection};
use crate::gi::settings::GiShading;
use crate::gi::texels::CascadeCut;

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
    lights: &[BouncingLight],
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
    for light in lights {
        // The cameras that it lights, as Bevy's: those with which it shares a layer.
        let lit = || viewers.iter().filter(|viewer| viewer.layers.intersects(&light.layers));
        let importance = lit()
            .map(|viewer| light.importance(viewer.focus.position, &viewer.frustum))
            .max_by(f32::total_cmp);
        let Some(importance) = importance else { continue };
        let perspective = |face| perspective_map(light, importance, face, finest, shading);
        let specs: Vec<MapSpec> = match light.shape {
            LightShape::Directional => {
                lit().flat_map(|viewer| parallel_maps(light, importance, viewer, scene)).collect()
            }
            LightShape::Spot { .. } => vec![perspective(0)],
            LightShape::Point => (0..6).map(perspective).collect(),
        };
        candidates.push(Candidate { light: light.entity, importance, maps: specs.len() });
        maps.insert(light.entity, specs);
    }
    let chosen = selection.next(&candidates, most, seconds, |candidate| {
        let maps = &maps[&candidate.light];
        let largest = maps.iter().map(|spec| spec.map.light.resolution).max().unwrap_or(0);
        capacity.take(maps.len(), largest)
    });
    let mut specs = Vec::new();
    for (light, share) in chosen {
        for mut spec in maps.remove(&light).unwrap_or_default() {
            spec.map.share = share;
            specs.push(spec);
        }
    }
    specs
}

/// One map where the scene is small; else a far and a near cascade of about as many texels
/// together.
///
/// A map of a whole level is mostly ground that lights nothing in the image.
fn parallel_maps(
    light: &BouncingLight,
    importance: f32,
    viewer: &Viewer,
    scene: (Vec3, Vec3),
) -> Vec<MapSpec> {
    let rotation = Mat3::from_quat(light.rotation);
    // Of each of two cascades that replace one map.
    let shared = (viewer.resolution * 11 / 16).next_multiple_of(4);
    let Focus { position, range } = viewer.focus;
    let far = cover(scene, rotation, position, range, shared);
    let (resolution, maps) = match near(&far, rotation, position, range, shared) {
        Some((near, cut)) => (shared, vec![(far, cut), (near, CascadeCut::default())]),
        None => {
            let whole = cover(scene, rotation, position, range, viewer.resolution);
            (viewer.resolution, vec![(whole, CascadeCut::default())])
        }
    };
    let map = |(face, (region, cut))| {
        parallel_map(light, importance, viewer, (face, resolution), region, cut)
    };
    (0..).zip(maps).map(map).collect()
}

fn parallel_map(
    light: &BouncingLight,
    importance: f32,
    viewer: &Viewer,
    (face, resolution): (u8, u32),
    region: LightRegion,
    cut: CascadeCut,
) -> MapSpec {
    let direction = light.rotation * Vec3::NEG_Z;
    let arriving = viewer.air.map_or(Vec3::ONE, |air| air.sunlight(-direction, light.disk));
    MapSpec {
        view: RsmView { light: light.entity, camera: Some(viewer.entity), face },
        transform: Transform::from_translation(region.origin).with_rotation(light.rotation),
        projection: Projection::Orthographic(OrthographicProjection {
            near: 0.0,
            far: region.depth,
            scaling_mode: ScalingMode::Fixed { width: region.size.x, height: region.size.y },
            ..OrthographicProjection::default_3d()
        }),
        map: LightMap {
            light: RsmLight {
                intensity: light.intensity * arriving,
                texel_area_or_solid_angle: region.size.x * region.size.y
                    / (resolution * resolution) as f32,
                direction,
                cone_offset: 1.0,
                resolution,
                fade: region.fade,
                ..Default::default()
            },
            cut,
            shading: viewer.shading,
            layers: light.layers.clone(),
            importance,
            share: 1.0,
            age: MapAge::NEW,
        },
    }
}

fn perspective_map(
    light: &BouncingLight,
    importance: f32,
    face: u8,
    resolution: u32,
    shading: GiShading,
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
        map: LightMap {
            light: RsmLight {
                intensity: light.intensity,
                texel_area_or_solid_angle: edge * edge,
                position: light.position,
                inverse_range_squared: (light.range * light.range).recip(),
                direction: light.rotation * Vec3::NEG_Z,
                cone_scale,
                cone_offset,
                resolution,
                ..Default::default()
            },
            cut: CascadeCut::default(),
            shading,
            layers: light.layers.clone(),
            importance,
            share: 1.0,
            age: MapAge::NEW,
        },
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
