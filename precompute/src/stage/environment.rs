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
    let fail = |problem: String| StageError::Environment { file: file.display().to_string(), problem };
    let picture = image::open(file).map_err(|error| fail(error.to_string()))?.into_rgb32f();
    if picture.width() == 0 || picture.height() == 0 {
        return Err(fail("it is empty".to_owned()));
    }
    if picture.iter().any(|value| !value.is_finite() || *value < 0.0) {
        return Err(fail("it holds values that are negative or not finite".to_owned()));
    }
    ambient(world, mean_radiance(&picture).map(|nits| nits * intensity));

    let mut faces = Vec::with_capacity((FACE * FACE * 6 * 16) as usize);
    for face in 0..6 {
        for y in 0..FACE {
            for x in 0..FACE {
                let [red, green, blue] = look_up(&picture, cube_direction(face, x, y));
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

/// Mean over directions: rows near the poles stand for less of the sphere.
fn mean_radiance(picture: &image::Rgb32FImage) -> [f32; 3] {
    let mut sum = [0.0f64; 3];
    let mut weights = 0.0;
    for (_, y, pixel) in picture.enumerate_pixels() {
        let weight = (std::f64::consts::PI * (f64::from(y) + 0.5) / f64::from(picture.height())).sin();
        weights += weight;
        for (sum, value) in sum.iter_mut().zip(pixel.0) {
            *sum += weight * f64::from(value);
        }
    }
    sum.map(|sum| (sum / weights) as f32)
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

fn look_up(picture: &image::Rgb32FImage, direction: Vec3) -> [f32; 3] {
    let u = 0.5 + direction.x.atan2(-direction.z) / std::f32::consts::TAU;
    let v = direction.y.clamp(-1.0, 1.0).acos() / std::f32::consts::PI;
    let x = ((u * picture.width() as f32) as u32).min(picture.width() - 1);
    let y = ((v * picture.height() as f32) as u32).min(picture.height() - 1);
    picture.get_pixel(x, y).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_sky_has_its_own_mean() {
        let picture = image::Rgb32FImage::from_pixel(16, 8, image::Rgb([1.0, 2.0, 3.0]));
        let mean = mean_radiance(&picture);
        assert!(mean.iter().zip([1.0, 2.0, 3.0]).all(|(a, b): (&f32, f32)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn up_is_the_first_row_and_ahead_the_middle() {
        let mut picture = image::Rgb32FImage::from_pixel(16, 8, image::Rgb([0.0; 3]));
        picture.put_pixel(8, 4, image::Rgb([5.0, 0.0, 0.0]));
        (0..16).for_each(|x| picture.put_pixel(x, 0, image::Rgb([0.0, 7.0, 0.0])));
        assert_eq!(look_up(&picture, Vec3::Y), [0.0, 7.0, 0.0]);
        assert_eq!(look_up(&picture, Vec3::new(0.01, -0.01, -1.0).normalize()), [5.0, 0.0, 0.0]);
    }
}
