//! The evening sky: a gradient, a glow around the sun, and streaks of cloud.
//!
//! Cube maps are computed here, so that the background and the light are of one sky.

use bevy::asset::RenderAssetUsages;
use bevy::image::ImageSampler;
use bevy::light::Skybox;
use bevy::prelude::*;
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use half::f16;

use crate::surfaces::noise;

/// Towards the sun: low, over the water.
pub(crate) const TO_SUN: Vec3 = Vec3::new(-0.52, 0.17, -0.84);
/// Radiance in nits overhead, at the horizon below the sun, and at the horizon opposite.
const ZENITH: Vec3 = Vec3::new(14.0, 24.0, 52.0);
const SUNSET: Vec3 = Vec3::new(260.0, 118.0, 52.0);
const OPPOSITE: Vec3 = Vec3::new(52.0, 42.0, 60.0);
/// Edges of the light's cube faces, by roughness; of the background, and of the light by normal.
const SPECULAR: [u32; 5] = [64, 32, 16, 8, 4];
const BACKGROUND: [u32; 1] = [256];
const DIFFUSE: [u32; 1] = [8];

/// Gives a camera the background and the light of the sky.
pub(crate) fn sky(images: &mut Assets<Image>) -> (Skybox, EnvironmentMapLight) {
    let background = images.add(cube(&BACKGROUND, |_, towards| radiance(towards, true)));
    let diffuse_map = images.add(cube(&DIFFUSE, |_, normal| around(normal, 1.0, 400)));
    let specular_map = images.add(cube(&SPECULAR, |level, mirror| match level {
        0 => radiance(mirror, false),
        level => around(mirror, 0.5 / (SPECULAR.len() - level) as f32, 60),
    }));
    let light = EnvironmentMapLight { diffuse_map, specular_map, intensity: 1.0, ..default() };
    (Skybox { image: Some(background), brightness: 1.0, ..default() }, light)
}

/// Nits from a direction. The sun's disk is in the background only: its light is the directional one.
fn radiance(towards: Vec3, with_disk: bool) -> Vec3 {
    let sun = TO_SUN.normalize();
    let level = |direction: Vec3| direction.with_y(0.0).normalize_or_zero();
    let facing = 0.5 + 0.5 * level(towards).dot(level(sun));
    let horizon = OPPOSITE.lerp(SUNSET, facing.powi(3));
    let height = towards.y.max(0.0);
    let mut nits = horizon.lerp(ZENITH, 1.0 - (1.0 - height).powi(5));
    let near = towards.dot(sun).max(0.0);
    nits += vec3(420.0, 190.0, 60.0) * near.powi(24);
    if height > 0.0 {
        // A flat layer: streaks are finer towards the horizon.
        let layer = vec2(towards.x, towards.z) / (height + 0.08);
        let streaks = noise(layer * vec2(1.1, 3.0)) * 0.6 + noise(layer * vec2(3.0, 9.0)) * 0.4;
        let cloud = ((streaks - 0.5) * 4.0).clamp(0.0, 1.0) * (height * 6.0).min(1.0);
        let lit = horizon.lerp(ZENITH * 1.6, 0.45) + SUNSET * 0.9 * near.powi(6);
        nits = nits.lerp(lit, 0.75 * cloud);
    } else {
        // Under the horizon is dark water and land.
        nits *= 0.25 + 0.75 * (1.0 + towards.y * 6.0).clamp(0.0, 1.0);
    }
    if with_disk && towards.dot(sun) > 0.9994 {
        nits += vec3(9000.0, 4200.0, 1300.0);
    }
    nits
}

/// Mean around a direction. `spread`: 1 for a cosine lobe, less for a narrower one.
fn around(axis: Vec3, spread: f32, samples: u32) -> Vec3 {
    let turn = Quat::from_rotation_arc(Vec3::Y, axis);
    let sample = |number: u32| {
        let share = (number as f32 + 0.5) / samples as f32;
        let sine = share.sqrt() * spread;
        let angle = Vec2::from_angle(2.399_963 * number as f32) * sine;
        radiance(turn * vec3(angle.x, (1.0 - sine * sine).max(0.0).sqrt(), angle.y), false)
    };
    (0..samples).map(sample).sum::<Vec3>() / samples as f32
}

/// A cube map whose texels are nits by level and direction.
fn cube(edges: &[u32], nits: impl Fn(usize, Vec3) -> Vec3) -> Image {
    let mut data = Vec::new();
    for face in 0..6 {
        for (level, edge) in edges.iter().enumerate() {
            for texel in 0..edge * edge {
                let at = |index: u32| 2.0 * (index as f32 + 0.5) / *edge as f32 - 1.0;
                let direction = direction(face, at(texel % edge), -at(texel / edge));
                let colour = nits(level, direction).extend(1.0);
                data.extend(
                    colour.to_array().map(f16::from_f32).into_iter().flat_map(f16::to_le_bytes),
                );
            }
        }
    }
    let size = Extent3d { width: edges[0], height: edges[0], depth_or_array_layers: 6 };
    let (format, usage) = (TextureFormat::Rgba16Float, RenderAssetUsages::all());
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, usage);
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = edges.len() as u32;
    image.texture_view_descriptor =
        Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..default() });
    image.sampler = ImageSampler::linear();
    image
}

/// A direction on a face, in the order of GPUs. Bevy samples cube maps with z negated.
fn direction(face: u32, u: f32, v: f32) -> Vec3 {
    let direction = match face {
        0 => vec3(1.0, v, u),
        1 => vec3(-1.0, v, -u),
        2 => vec3(u, 1.0, v),
        3 => vec3(u, -1.0, -v),
        4 => vec3(u, v, -1.0),
        _ => vec3(-u, v, 1.0),
    };
    direction.normalize()
}
