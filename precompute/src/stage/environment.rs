//! The sky: what lights a scene from all around, and what is seen where there is no geometry.
//!
//! Its light on surfaces is Bevy's ambient light, which nothing occludes but ambient occlusion.

use std::path::Path;

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::camera::{Camera, ClearColorConfig};
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::light::{GlobalAmbientLight, Skybox};
use bevy::math::Vec3;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension};

use super::StageError;
use crate::scene::SkyMap;

/// Texels along the edge of a sky cube's face.
const FACE: u32 = 256;

/// The same radiance (nits, linear RGB) everywhere.
pub(super) fn constant(world: &mut World, camera: Entity, radiance: [f32; 3], exposure: f32) {
    ambient(world, radiance);
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        let [red, green, blue] = radiance.map(|nits| nits * exposure);
        camera.clear_color = ClearColorConfig::Custom(Color::LinearRgba(LinearRgba::rgb(red, green, blue)));
    }
}

fn ambient(world: &mut World, radiance: [f32; 3]) {
    let brightness = radiance.into_iter().fold(0.0, f32::max);
    let [red, green, blue] = radiance.map(|nits| if brightness > 0.0 { nits / brightness } else { 0.0 });
    world.insert_resource(GlobalAmbientLight {
        color: Color::LinearRgba(LinearRgba::rgb(red, green, blue)),
        brightness,
        ..Default::default()
    });
}

/// A latitude-longitude picture, times `intensity`, in nits.
pub(super) fn map(world: &mut World, camera: Entity, file: &Path, intensity: f32) -> Result<(), StageError> {
    let picture = SkyMap::read(file)?;
    ambient(world, picture.mean_radiance().map(|nits| nits * intensity));

    let mut faces = Vec::with_capacity((FACE * FACE * 6 * 16) as usize);
    for face in 0..6 {
        for y in 0..FACE {
            for x in 0..FACE {
                let [red, green, blue] = picture.look_up(cube_direction(face, x, y));
                faces.extend([red, green, blue, 1.0].into_iter().flat_map(f32::to_le_bytes));
            }
        }
    }
    let size = Extent3d { width: FACE, height: FACE, depth_or_array_layers: 6 };
    let mut sky = Image::new(size, TextureDimension::D2, faces, TextureFormat::Rgba32Float, RenderAssetUsages::RENDER_WORLD);
    sky.texture_view_descriptor = Some(TextureViewDescriptor { dimension: Some(TextureViewDimension::Cube), ..Default::default() });
    let sky = world.resource_mut::<Assets<Image>>().add(sky);
    world.entity_mut(camera).insert(Skybox { image: Some(sky), brightness: intensity, ..Default::default() });
    Ok(())
}

/// Direction through a texel's centre, in the order of faces that GPUs use (+X, −X, +Y, −Y, +Z, −Z; left-handed).
fn cube_direction(face: u32, x: u32, y: u32) -> Vec3 {
    let u = 2.0 * (x as f32 + 0.5) / FACE as f32 - 1.0;
    let v = 1.0 - 2.0 * (y as f32 + 0.5) / FACE as f32;
    let direction = match face {
        0 => Vec3::new(1.0, v, -u),
        1 => Vec3::new(-1.0, v, u),
        2 => Vec3::new(u, 1.0, -v),
        3 => Vec3::new(u, -1.0, v),
        4 => Vec3::new(u, v, 1.0),
        _ => Vec3::new(-u, v, -1.0),
    };
    // Bevy samples its sky with z turned round.
    (direction * Vec3::new(1.0, 1.0, -1.0)).normalize()
}
