//! Environment light and background.

use bevy::asset::{Assets, Handle};
use bevy::camera::ClearColor;
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::Image;
use bevy::light::{
    AmbientLight, AtmosphereEnvironmentMapLight, EnvironmentMapLight, GeneratedEnvironmentMapLight,
    GlobalAmbientLight, Skybox, VolumetricFog,
};
use bevy::math::{DVec3, Quat, Vec2, Vec3};
use bevy::pbr::DistanceFog;
use frugal_trace::scene::{Filter, SceneTexture, SkyMap, Wrap};

use super::light::linear;
use super::texture::{Unreadable, texels};
use super::{ExtractedSky, Gaps};

/// Columns of an extracted sky; half as many rows.
const COLUMNS: u32 = 512;
/// Most look-ups of a texel along each axis: more would take seconds.
const MOST_STEPS: u32 = 8;

/// Whether a camera has an environment map that sends light, be it readable or not. Bevy makes one of
/// the generated kinds where there is no other.
pub(super) fn has_environment_map(world: &World, camera: Option<Entity>) -> bool {
    let Some(camera) = camera else { return false };
    let own = world.get::<EnvironmentMapLight>(camera).map(|map| map.intensity);
    let generated = world.get::<GeneratedEnvironmentMapLight>(camera).map(|map| map.intensity);
    let of_air = world.get::<AtmosphereEnvironmentMapLight>(camera).map(|map| map.intensity);
    let intensity = own.or(generated).or(of_air);
    intensity.is_some_and(|intensity| intensity > 0.0 && intensity.is_finite())
}

/// The sky of a camera: its environment map, in the finest form that is readable, else the ambient
/// light.
pub(super) fn sky(world: &World, camera: Option<Entity>, gaps: &mut Gaps) -> ExtractedSky {
    let has_fog = camera.is_some_and(|camera| {
        world.get::<DistanceFog>(camera).is_some() || world.get::<VolumetricFog>(camera).is_some()
    });
    if has_fog {
        gaps.add("fog is not traced", "camera");
    }
    let light = camera.and_then(|camera| world.get::<EnvironmentMapLight>(camera));
    let shown = camera.and_then(|camera| world.get::<Skybox>(camera));
    if camera.is_some_and(|camera| world.get::<GeneratedEnvironmentMapLight>(camera).is_some()) {
        gaps.add("environment light that the GPU generates is left out", "camera");
    }
    let background =
        shown.and_then(|sky| Some((sky.image.as_ref()?, sky.brightness, sky.rotation)));
    let Some(light) = light else {
        if background.is_some() {
            gaps.add("a background that sends no light is left out", "camera");
        }
        return ambient(world, camera, gaps);
    };
    // The background has the finest texels, if it is of the same sky.
    let own = (&light.specular_map, light.intensity, light.rotation);
    let of_background = background.filter(|(_, intensity, _)| *intensity == light.intensity);
    let mut problem = None;
    for (cube, intensity, rotation) in of_background.into_iter().chain([own]) {
        match map(world, cube, rotation) {
            Ok(map) if map.texels().iter().all(|texel| *texel == map.texels()[0]) => {
                let texel = map.texels()[0];
                return ExtractedSky::Constant(texel.map(|value| value * intensity));
            }
            Ok(map) => return ExtractedSky::Map(map, intensity),
            Err(other) => problem = Some(other),
        }
    }
    gaps.add(problem.unwrap_or("skies that are not loaded are left out"), "camera");
    ExtractedSky::Black
}

fn ambient(world: &World, camera: Option<Entity>, gaps: &mut Gaps) -> ExtractedSky {
    let own = camera.and_then(|camera| world.get::<AmbientLight>(camera));
    let light = own.map(|own| (own.color, own.brightness)).or_else(|| {
        world.get_resource::<GlobalAmbientLight>().map(|all| (all.color, all.brightness))
    });
    let nits = light.map_or([0.0; 3], |(color, brightness)| {
        linear(color).map(|value| if brightness.is_finite() { value * brightness } else { 0.0 })
    });
    if nits.iter().all(|value| *value <= 0.0) {
        let is_dark = world
            .get_resource::<ClearColor>()
            .is_none_or(|clear| linear(clear.0).iter().all(|value| *value <= 0.1));
        if !is_dark {
            gaps.add("the colour of an empty background is traced as black", "camera");
        }
        return ExtractedSky::Black;
    }
    gaps.add("ambient light is traced as that of a uniform sky", "camera");
    ExtractedSky::Constant(nits)
}

/// A cube map as a map by latitude and longitude.
fn map(world: &World, cube: &Handle<Image>, rotation: Quat) -> Result<SkyMap, Unreadable> {
    let image = world
        .get_resource::<Assets<Image>>()
        .and_then(|images| images.get(cube))
        .ok_or("skies that are not loaded are left out")?;
    let descriptor = &image.texture_descriptor;
    let edge = descriptor.size.width;
    let is_cube = descriptor.size.depth_or_array_layers == 6 && descriptor.size.height == edge;
    let data = image.data.as_ref().ok_or("skies kept for the GPU alone are left out")?;
    if !is_cube || edge == 0 || data.len() % 6 != 0 {
        return Err("skies that are not cube maps are left out");
    }
    // A face with all its levels follows another.
    let faces = (0..6)
        .map(|face| {
            let texels = texels(image, face * data.len() / 6, edge as usize * edge as usize)?;
            let (wrap, filter) = ([Wrap::Clamp; 2], Filter::Nearest);
            let face = SceneTexture { width: edge, height: edge, texels, wrap, filter };
            if face.is_complete() { Ok(face) } else { Err("skies without texels are left out") }
        })
        .collect::<Result<Vec<SceneTexture>, Unreadable>>()
        .map_err(|_| "skies of compressed or unusual formats are left out")?;
    // A texel covers several of a fine cube, of which one may be the sun.
    let steps = (8 * edge / COLUMNS).clamp(1, MOST_STEPS);
    let place = |texel: u32, step: u32| texel as f32 + (step as f32 + 0.5) / steps as f32;
    let texel = |column: u32, row: u32| {
        let sum: DVec3 = (0..steps * steps)
            .map(|step| {
                let (x, y) = (place(column, step % steps), place(row, step / steps));
                let angle = (x / COLUMNS as f32 - 0.5) * std::f32::consts::TAU;
                let (sine, cosine) = (y / (COLUMNS / 2) as f32 * std::f32::consts::PI).sin_cos();
                let direction = Vec3::new(sine * angle.sin(), cosine, -sine * angle.cos());
                let [red, green, blue, _] = look_up(&faces, rotation.inverse() * direction);
                let valid = |value: f32| if value.is_finite() { value.max(0.0) } else { 0.0 };
                Vec3::new(valid(red), valid(green), valid(blue)).as_dvec3()
            })
            .sum();
        (sum / f64::from(steps * steps)).as_vec3().to_array()
    };
    let coordinates =
        (0..COLUMNS / 2).flat_map(|row| (0..COLUMNS).map(move |column| (column, row)));
    let texels = coordinates.map(|(column, row)| texel(column, row)).collect();
    SkyMap::new(COLUMNS, COLUMNS / 2, texels).map_err(|_| "skies without texels are left out")
}

/// The cube's value in a direction; Bevy samples cubes with z negated.
fn look_up(faces: &[SceneTexture], direction: Vec3) -> [f32; 4] {
    let Vec3 { x, y, z } = direction * Vec3::new(1.0, 1.0, -1.0);
    let axis = Vec3::new(x, y, z).abs();
    let (face, along, u, v) = if axis.x >= axis.y && axis.x >= axis.z {
        if x > 0.0 { (0, x, -z, -y) } else { (1, -x, z, -y) }
    } else if axis.y >= axis.z {
        if y > 0.0 { (2, y, x, z) } else { (3, -y, x, -z) }
    } else if z > 0.0 {
        (4, z, x, -y)
    } else {
        (5, -z, -x, -y)
    };
    faces[face].sample(Vec2::new(0.5 + 0.5 * u / along, 0.5 + 0.5 * v / along))
}
