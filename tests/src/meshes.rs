//! Things to put on a stage.

use bevy::asset::{Assets, RenderAssetUsages};
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::image::{Image, ImageSampler};
use bevy::math::Vec3;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::Cuboid;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::transform::components::Transform;
use frugal::stage::Stage;

/// A matt material without highlight.
pub fn matt(red: f32, green: f32, blue: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::LinearRgba(LinearRgba::rgb(red, green, blue)),
        perceptual_roughness: 1.0,
        metallic: 0.0,
        reflectance: 0.0,
        ..Default::default()
    }
}

/// Puts a mesh on the stage.
pub fn spawn(stage: &mut Stage, mesh: Mesh, material: StandardMaterial, transform: Transform) -> Entity {
    let world = stage.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), transform)).id()
}

/// Puts a box on the stage, its sides along the axes.
pub fn spawn_box(stage: &mut Stage, center: Vec3, size: Vec3, material: StandardMaterial) -> Entity {
    spawn(stage, Cuboid::from_size(size).into(), material, Transform::from_translation(center))
}

/// A sharp-edged texture of `width` × `height` sRGB texels.
pub fn texture(stage: &mut Stage, width: u32, height: u32, texels: &[[u8; 4]]) -> bevy::asset::Handle<Image> {
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let mut image = Image::new(size, TextureDimension::D2, texels.concat(), TextureFormat::Rgba8UnormSrgb, RenderAssetUsages::RENDER_WORLD);
    image.sampler = ImageSampler::nearest();
    stage.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// The albedo that a G-buffer of eight bits with gamma 2.2 keeps of `albedo`.
pub fn stored_albedo(albedo: f64) -> f64 {
    ((albedo.powf(1.0 / 2.2) * 255.0).round() / 255.0).powf(2.2)
}
