//! Spawns a scene's geometry, lights, sky and camera in an app.

use bevy::anti_alias::smaa::Smaa;
use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::camera::{
    Camera, Camera3d, ClearColorConfig, Exposure, PerspectiveProjection, Projection,
};
use bevy::color::{Color, LinearRgba};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::ecs::world::World;
use bevy::image::{Image, ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::light::{
    CascadeShadowConfigBuilder, DirectionalLight, GlobalAmbientLight, PointLight, SpotLight,
};
use bevy::mesh::{Indices, Mesh, Mesh3d, PrimitiveTopology};
use bevy::pbr::{MeshMaterial3d, ScreenSpaceAmbientOcclusion, StandardMaterial};
use bevy::post_process::bloom::Bloom;
use bevy::prelude::AlphaMode;
use bevy::render::render_resource::{Extent3d, Face, TextureDimension, TextureFormat};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::FrugalGi;
use frugal_trace::light::Light;
use frugal_trace::scene::{SceneGeometry, SceneMaterial, SceneMesh, SceneTexture};
use glam::Vec3;

use super::{StageError, environment};
use crate::scene::{Environment, LoadedScene};

/// Sets up `scene` for `camera`: spawns its geometry and lights, sets the app's environment light,
/// and gives the camera the scene's lens, exposure and background. The camera's other components,
/// including its transform, are unchanged.
///
/// `camera` must be a `Camera3d`, and the world that of an app with Bevy's 3D renderer.
///
/// # Errors
/// When the environment map cannot be read. The rest of the scene has been spawned by then.
pub fn populate(world: &mut World, scene: &LoadedScene, camera: Entity) -> Result<(), StageError> {
    let geometry = &scene.geometry;
    let reach =
        geometry.bounds().map_or(scene.camera.far, |b| b.size().length().min(scene.camera.far));
    let exposure = 1.0 / (1.2 * scene.exposure_ev100.exp2());
    spawn_geometry(world, geometry, exposure);
    for light in &scene.lights {
        spawn_light(world, light, reach);
    }
    let lens = PerspectiveProjection {
        fov: scene.camera.vertical_fov.to_radians(),
        near: scene.camera.near,
        far: scene.camera.far,
        ..Default::default()
    };
    world
        .entity_mut(camera)
        .insert((Projection::Perspective(lens), Exposure { ev100: scene.exposure_ev100 }));
    if let Some(mut camera) = world.get_mut::<Camera>(camera) {
        camera.clear_color = ClearColorConfig::Custom(Color::BLACK);
    }
    world.insert_resource(GlobalAmbientLight::NONE);
    match &scene.environment {
        Environment::None => {}
        Environment::Constant(radiance) => {
            environment::constant(world, camera, *radiance, exposure);
        }
        Environment::Map(file, intensity) => {
            environment::map(world, camera, &scene.resolve(file), *intensity)?;
        }
    }
    Ok(())
}

/// Spawns `scene` and a camera for it, with the effects on which knobs act, at their own defaults: a
/// knob adds none by itself.
pub(super) fn spawn(world: &mut World, scene: &LoadedScene) -> Result<Entity, StageError> {
    let camera = world.spawn((
        Camera3d::default(),
        Tonemapping::TonyMcMapface,
        DebandDither::Disabled,
        FrugalGi::default(),
        Transform::default(),
        ScreenSpaceAmbientOcclusion::default(),
        Bloom::NATURAL,
        Smaa::default(),
    ));
    let camera = camera.id();
    populate(world, scene, camera)?;
    Ok(camera)
}

fn spawn_geometry(world: &mut World, geometry: &SceneGeometry, exposure: f32) {
    let textures: Vec<Handle<Image>> = geometry
        .textures
        .iter()
        .map(|texture| world.resource_mut::<Assets<Image>>().add(image(texture)))
        .collect();
    let materials: Vec<_> = geometry
        .materials
        .iter()
        .map(|material| {
            world
                .resource_mut::<Assets<StandardMaterial>>()
                .add(standard_material(material, &textures, exposure))
        })
        .collect();
    for mesh in &geometry.meshes {
        let Some(material) = materials.get(mesh.material).cloned() else { continue };
        let textured = geometry.materials[mesh.material].base_color_texture.is_some();
        let handle = world.resource_mut::<Assets<Mesh>>().add(bevy_mesh(mesh, textured));
        world.spawn((Mesh3d(handle), MeshMaterial3d(material), Transform::default()));
    }
}

/// Leaves out texture coordinates of untextured materials: with them, the shader branches on a
/// uniform for every possible texture, and software Vulkan drivers recompile it in every frame.
fn bevy_mesh(mesh: &SceneMesh, textured: bool) -> Mesh {
    let usage = RenderAssetUsages::RENDER_WORLD | RenderAssetUsages::MAIN_WORLD;
    let positions: Vec<[f32; 3]> = mesh.positions.iter().map(|p| p.to_array()).collect();
    let normals: Vec<[f32; 3]> = mesh.normals.iter().map(|n| n.to_array()).collect();
    let uvs: Vec<[f32; 2]> = mesh.uvs.iter().map(|uv| uv.to_array()).collect();
    let bare = Mesh::new(PrimitiveTopology::TriangleList, usage)
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, normals)
        .with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, mesh.colors.clone())
        .with_inserted_indices(Indices::U32(mesh.indices.clone()));
    if textured { bare.with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, uvs) } else { bare }
}

fn standard_material(
    material: &SceneMaterial,
    textures: &[Handle<Image>],
    exposure: f32,
) -> StandardMaterial {
    let [red, green, blue, alpha] = material.base_color;
    // Bevy 0.19's G-buffer does not store the exposure weight of emission: nits are exposed here.
    let emissive = material.emissive.map(|nits| nits * exposure);
    StandardMaterial {
        base_color: Color::LinearRgba(LinearRgba::new(red, green, blue, alpha)),
        base_color_texture: material
            .base_color_texture
            .and_then(|index| textures.get(index).cloned()),
        perceptual_roughness: material.perceptual_roughness,
        metallic: material.metallic,
        reflectance: material.reflectance,
        emissive: LinearRgba::rgb(emissive[0], emissive[1], emissive[2]),
        emissive_exposure_weight: 0.0,
        alpha_mode: match material.alpha {
            frugal_trace::scene::AlphaMode::Opaque => AlphaMode::Opaque,
            frugal_trace::scene::AlphaMode::Mask(cutoff) => AlphaMode::Mask(cutoff),
        },
        double_sided: material.double_sided,
        cull_mode: (!material.double_sided).then_some(Face::Back),
        ..Default::default()
    }
}

fn image(texture: &SceneTexture) -> Image {
    let size = Extent3d { width: texture.width, height: texture.height, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(
        size,
        TextureDimension::D2,
        TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::all(),
    );
    image.texture_descriptor.mip_level_count = texture.mips.len() as u32;
    image.data = Some(texture.mips.concat());
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        mipmap_filter: ImageFilterMode::Linear,
        ..ImageSamplerDescriptor::linear()
    });
    image
}

fn linear([red, green, blue]: [f32; 3]) -> Color {
    Color::LinearRgba(LinearRgba::rgb(red, green, blue))
}

fn spawn_light(world: &mut World, light: &Light, reach: f32) {
    match light {
        Light::Directional { direction, illuminance, color } => {
            let cascades = CascadeShadowConfigBuilder {
                num_cascades: 4,
                minimum_distance: 0.1,
                maximum_distance: reach.max(1.0),
                first_cascade_far_bound: (reach / 12.0).max(0.5),
                ..Default::default()
            };
            world.spawn((
                DirectionalLight {
                    color: linear(*color),
                    illuminance: *illuminance,
                    shadow_maps_enabled: true,
                    shadow_normal_bias: 1.0,
                    ..Default::default()
                },
                cascades.build(),
                toward(Vec3::ZERO, *direction),
            ));
        }
        Light::Point { position, luminous_power, range, color } => {
            world.spawn((
                PointLight {
                    color: linear(*color),
                    intensity: *luminous_power,
                    range: *range,
                    shadow_maps_enabled: true,
                    ..Default::default()
                },
                Transform::from_translation(*position),
            ));
        }
        Light::Spot {
            position,
            direction,
            luminous_power,
            range,
            inner_angle,
            outer_angle,
            color,
        } => {
            world.spawn((
                SpotLight {
                    color: linear(*color),
                    intensity: *luminous_power,
                    range: *range,
                    inner_angle: inner_angle.to_radians(),
                    outer_angle: outer_angle.to_radians(),
                    shadow_maps_enabled: true,
                    ..Default::default()
                },
                toward(*position, *direction),
            ));
        }
    }
}

fn toward(position: Vec3, direction: Vec3) -> Transform {
    let direction = direction.normalize_or(Vec3::NEG_Y);
    Transform::from_translation(position).looking_to(direction, direction.any_orthonormal_vector())
}
