//! The sky: environment light and background.
//!
//! Its light on surfaces is an environment map on the camera: without global illumination Bevy's,
//! which only ambient occlusion attenuates.

use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::camera::{Camera, ClearColorConfig};
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::{Image, ImageSampler};
use bevy::light::{EnvironmentMapLight, Skybox};
use bevy::render::render_resource::{
    Extent3d, TextureDimension, TextureFormat, TextureViewDescriptor, TextureViewDimension,
};
use frugal_trace::scene::SkyMap;
use half::f16;

use super::prefilter::{Cube, Pyramid};

/// Texels along the edge of a face of the background cube map.
const BACKGROUND_EDGE: u32 = 256;
/// Slightly below the greatest half float.
const BRIGHTEST_TEXEL: f32 = 60_000.0;

/// A constant sky: `radiance` in nits, linear RGB.
pub(super) fn constant(world: &mut World, camera: Entity, radiance: [f32; 3], exposure: f32) {
    // Maps are normalised to the brightest channel, so that no radiance overflows.
    let intensity = radiance.into_iter().fold(0.0, f32::max);
    if intensity > 0.0 {
        let map = add_cube(world, &Cube::constant(radiance.map(|nits| nits / intensity)), 1.0);
        world.entity_mut(camera).insert(EnvironmentMapLight {
            diffuse_map: map.clone(),
            specular_map: map,
            intensity,
            ..Default::default()
        });
    }
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        let [red, green, blue] = radiance.map(|nits| nits * exposure);
        camera.clear_color =
            ClearColorConfig::Custom(Color::LinearRgba(LinearRgba::rgb(red, green, blue)));
    }
}

/// A latitude-longitude map, times `intensity`, in nits.
pub(super) fn map(world: &mut World, camera: Entity, picture: &SkyMap, intensity: f32) {
    let pyramid = Pyramid::new(picture);
    let cubes = [
        pyramid.diffuse(),
        pyramid.specular(),
        Cube::new(&[BACKGROUND_EDGE], |_, direction| picture.look_up(direction)),
    ];
    let brightest =
        cubes.iter().flat_map(|cube| cube.texels.iter().flatten()).fold(0.0, |a: f32, b| a.max(*b));
    // Scales the map so that half floats do not overflow.
    let unit = (brightest / BRIGHTEST_TEXEL).max(1.0);
    let [diffuse_map, specular_map, sky] = cubes.map(|cube| add_cube(world, &cube, unit));
    world.entity_mut(camera).insert((
        EnvironmentMapLight {
            diffuse_map,
            specular_map,
            intensity: intensity * unit,
            ..Default::default()
        },
        Skybox { image: Some(sky), brightness: intensity * unit, ..Default::default() },
    ));
}

/// A cube map in units of `unit`. In half floats: many mobile GPUs do not filter 32-bit floats.
fn add_cube(world: &mut World, cube: &Cube, unit: f32) -> Handle<Image> {
    let size = Extent3d { width: cube.edge, height: cube.edge, depth_or_array_layers: 6 };
    let mut image = Image::new_uninit(
        size,
        TextureDimension::D2,
        TextureFormat::Rgba16Float,
        RenderAssetUsages::all(),
    );
    image.texture_descriptor.mip_level_count = cube.levels;
    let halves = cube
        .texels
        .iter()
        .flat_map(|[red, green, blue]| [red / unit, green / unit, blue / unit, 1.0])
        .map(f16::from_f32);
    image.data = Some(halves.flat_map(f16::to_le_bytes).collect());
    image.texture_view_descriptor = Some(TextureViewDescriptor {
        dimension: Some(TextureViewDimension::Cube),
        ..Default::default()
    });
    image.sampler = ImageSampler::linear();
    world.resource_mut::<Assets<Image>>().add(image)
}
