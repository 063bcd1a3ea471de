//! Meshes, materials and textures for a stage.

use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::camera::visibility::NoFrustumCulling;
use bevy::color::{Color, LinearRgba};
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::image::{Image, ImageSampler};
use bevy::math::{Mat4, Vec3};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Mesh, Mesh3d, Meshable, VertexAttributeValues};
use bevy::pbr::{Material, MeshMaterial3d, StandardMaterial};
use bevy::prelude::{Cuboid, Plane3d};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};
use bevy::transform::components::Transform;
use frugal::stage::Stage;

/// A Lambertian material, linear Rec. 709.
pub fn diffuse(red: f32, green: f32, blue: f32) -> StandardMaterial {
    StandardMaterial {
        base_color: Color::LinearRgba(LinearRgba::rgb(red, green, blue)),
        perceptual_roughness: 1.0,
        metallic: 0.0,
        reflectance: 0.0,
        ..Default::default()
    }
}

/// Spawns a mesh.
pub fn spawn<M: Material>(
    stage: &mut Stage,
    mesh: Mesh,
    material: M,
    transform: Transform,
) -> Entity {
    let world = stage.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(mesh);
    let material = world.resource_mut::<Assets<M>>().add(material);
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material), transform)).id()
}

/// Spawns a white floor of 4 m and, 2 m behind its centre, a grey wall of 2 m, facing +Z.
pub fn spawn_corner(stage: &mut Stage, grey: f32) {
    spawn_box(stage, Vec3::new(0.0, -0.1, 0.0), Vec3::new(4.0, 0.2, 4.0), diffuse(0.8, 0.8, 0.8));
    let wall = diffuse(grey, grey, grey);
    spawn_box(stage, Vec3::new(0.0, 1.0, -2.0), Vec3::new(4.0, 2.0, 0.2), wall);
}

/// Spawns an axis-aligned box.
pub fn spawn_box(
    stage: &mut Stage,
    center: Vec3,
    size: Vec3,
    material: StandardMaterial,
) -> Entity {
    spawn(stage, Cuboid::from_size(size).into(), material, Transform::from_translation(center))
}

/// A square of 1 m in the plane y = 0, facing up. Texture coordinates begin at −x, −z.
///
/// Texture coordinates are optional: a software driver recompiles the shader of every mesh with
/// texture coordinates in each frame.
pub fn plate(coordinates: bool) -> Mesh {
    let mut mesh: Mesh = Plane3d::default().mesh().size(1.0, 1.0).into();
    if !coordinates {
        mesh.remove_attribute(Mesh::ATTRIBUTE_UV_0);
    }
    mesh
}

/// Adds a skin in which each vertex follows one joint, as a transform would move it.
pub fn with_joints(mesh: Mesh, joint: impl Fn(usize) -> u16) -> Mesh {
    let count = mesh.count_vertices();
    let joints = (0..count).map(|vertex| [joint(vertex), 0, 0, 0]).collect();
    mesh.with_inserted_attribute(
        Mesh::ATTRIBUTE_JOINT_INDEX,
        VertexAttributeValues::Uint16x4(joints),
    )
    .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[1.0f32, 0.0, 0.0, 0.0]; count])
}

/// Spawns the joints of a mesh [`with_joints`], each a child of the one before, and returns them.
pub fn add_joints(stage: &mut Stage, skin: Entity, count: usize) -> Vec<Entity> {
    let world = stage.world_mut();
    let joints: Vec<_> = (0..count).map(|_| world.spawn(Transform::default()).id()).collect();
    for pair in joints.windows(2) {
        world.entity_mut(pair[1]).insert(ChildOf(pair[0]));
    }
    let bind: SkinnedMeshInverseBindposes = vec![Mat4::IDENTITY; count].into();
    let inverse_bindposes = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(bind);
    world
        .entity_mut(skin)
        .insert((SkinnedMesh { inverse_bindposes, joints: joints.clone() }, NoFrustumCulling));
    joints
}

/// A texture of `width` × `height` texels with nearest-neighbour sampling, in
/// [`TextureFormat::Rgba8UnormSrgb`], or [`TextureFormat::Rgba8Unorm`] for data other than colour.
pub fn texture(
    stage: &mut Stage,
    format: TextureFormat,
    width: u32,
    height: u32,
    texels: &[[u8; 4]],
) -> Handle<Image> {
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let mut image =
        Image::new(size, TextureDimension::D2, texels.concat(), format, RenderAssetUsages::all());
    image.sampler = ImageSampler::nearest();
    stage.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// A compressed texture (BC1) of one row of blocks of 4 x 4 texels, each of one colour: five, six
/// and five bits of red, green and blue.
pub fn compressed_texture(stage: &mut Stage, colors: &[u16]) -> Handle<Image> {
    let block = |color: &u16| [color.to_le_bytes()[0], color.to_le_bytes()[1], 0, 0, 0, 0, 0, 0];
    let size = Extent3d { width: 4 * colors.len() as u32, height: 4, depth_or_array_layers: 1 };
    let mut image = Image::new(
        size,
        TextureDimension::D2,
        colors.iter().flat_map(block).collect(),
        TextureFormat::Bc1RgbaUnormSrgb,
        RenderAssetUsages::all(),
    );
    image.sampler = ImageSampler::nearest();
    stage.world_mut().resource_mut::<Assets<Image>>().add(image)
}

/// Keeps a texture on the GPU only; no frame may have rendered it yet.
pub fn keep_for_the_gpu(stage: &mut Stage, texture: &Handle<Image>) {
    let mut images = stage.world_mut().resource_mut::<Assets<Image>>();
    images.get_mut(texture).unwrap_or_else(|| panic!("a texture of the stage")).asset_usage =
        RenderAssetUsages::RENDER_WORLD;
}

/// `albedo` after quantisation in the G-buffer: eight bits with gamma 2.2.
pub fn stored_albedo(albedo: f64) -> f64 {
    ((albedo.powf(1.0 / 2.2) * 255.0).round() / 255.0).powf(2.2)
}
