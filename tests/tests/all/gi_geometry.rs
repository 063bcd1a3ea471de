//! Whatever the renderer draws bounces as it is drawn: masks, skins, textures and vertex colours.

use bevy::asset::Assets;
use bevy::camera::visibility::NoFrustumCulling;
use bevy::math::{Mat4, Vec3};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Mesh, VertexAttributeValues};
use bevy::prelude::{AlphaMode, Cuboid};
use bevy::transform::components::Transform;
use frugal::stage::Stage;
use frugal_tests::{meshes, set};

use super::gi::{PLAIN, corner, sun};

tests!(holes_of_a_mask_let_light_through, a_skin_bounces_where_its_joint_is, textures_tint_the_bounce, vertex_colours_tint_the_bounce);

/// Mean of the bounce on the wall behind a black drape over the whole floor.
fn under_drape(alpha: Option<[u8; 4]>) -> f64 {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    if let Some([a, b, c, d]) = alpha {
        let texels = [[0, 0, 0, a], [0, 0, 0, b], [0, 0, 0, c], [0, 0, 0, d]];
        let texture = meshes::texture(&mut stage, 2, 2, &texels);
        let mut material = meshes::matt(1.0, 1.0, 1.0);
        material.base_color_texture = Some(texture);
        (material.alpha_mode, material.double_sided, material.cull_mode) = (AlphaMode::Mask(0.5), true, None);
        meshes::spawn_box(&mut stage, Vec3::new(0.0, 3.0, 0.0), Vec3::new(5.0, 0.01, 5.0), material);
    }
    set::radiance(&mut stage).mean()
}

fn holes_of_a_mask_let_light_through() {
    let (none, half, all) = (under_drape(None), under_drape(Some([255, 0, 0, 255])), under_drape(Some([255; 4])));
    println!("    without drape {none:.2} nits, with half of it {half:.2}, with all of it {all:.4}");
    assert!(none > 1.0 && all < 0.001 * none, "a whole drape lets nothing through");
    // Two opposite quarters of the floor are lit. Their mean over the wall is half by symmetry; the walls' own top is always lit.
    assert!((0.35..0.65).contains(&(half / none)), "{}", half / none);
}

fn skinned(stage: &mut Stage) -> bevy::ecs::entity::Entity {
    let mut mesh: Mesh = Cuboid::new(6.0, 0.1, 6.0).into();
    let count = mesh.count_vertices();
    mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(vec![[0; 4]; count]));
    mesh.insert_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![[1.0f32, 0.0, 0.0, 0.0]; count]);
    let skin = meshes::spawn(stage, mesh, meshes::matt(0.0, 0.0, 0.0), Transform::default());
    let world = stage.world_mut();
    let joint = world.spawn(Transform::from_xyz(0.0, 6.0, 30.0)).id();
    let bind: SkinnedMeshInverseBindposes = vec![Mat4::IDENTITY].into();
    let inverse_bindposes = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>().add(bind);
    world.entity_mut(skin).insert((SkinnedMesh { inverse_bindposes, joints: vec![joint] }, NoFrustumCulling));
    joint
}

fn a_skin_bounces_where_its_joint_is() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let joint = skinned(&mut stage);
    // Keeps the map where the skin goes: skins are not looked at vertex by vertex.
    meshes::spawn_box(&mut stage, Vec3::new(0.0, 6.0, 30.0), Vec3::new(0.1, 0.1, 0.1), meshes::matt(0.0, 0.0, 0.0));
    set::apply(&mut stage, &format!("{PLAIN},rsm_resolution=128"));
    let open = set::radiance(&mut stage).mean();
    stage.world_mut().get_mut::<Transform>(joint).expect("the joint").translation = Vec3::new(0.0, 3.0, 0.0);
    let covered = set::radiance(&mut stage).mean();
    assert!(open > 1.0 && covered < 0.001 * open, "beside the floor {open}, over it {covered}");
}

/// Puts a tinted plate over the floor.
fn tinted(stage: &mut Stage, mesh: Mesh, texture: Option<[u8; 4]>) -> [f64; 3] {
    let mut material = meshes::matt(1.0, 1.0, 1.0);
    material.base_color_texture = texture.map(|texel| meshes::texture(stage, 2, 2, &[texel; 4]));
    meshes::spawn(stage, mesh, material, Transform::from_xyz(0.0, 0.05, 0.0));
    set::apply(stage, PLAIN);
    set::channel_means(&set::radiance(stage))
}

fn textures_tint_the_bounce() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let [red, green, blue] = tinted(&mut stage, Cuboid::new(5.0, 0.1, 5.0).into(), Some([255, 0, 0, 255]));
    // The wall's own top, which is grey, is not over the floor.
    assert!(red > 1.0 && green < 0.05 * red && (green - blue).abs() < 1e-3 * red, "{red} {green} {blue}");
}

fn vertex_colours_tint_the_bounce() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let mesh: Mesh = Cuboid::new(5.0, 0.1, 5.0).into();
    let count = mesh.count_vertices();
    let mesh = mesh.with_inserted_attribute(Mesh::ATTRIBUTE_COLOR, vec![[0.1f32, 0.8, 0.1, 1.0]; count]);
    let [red, green, blue] = tinted(&mut stage, mesh, None);
    let expected = meshes::stored_albedo(0.8) / meshes::stored_albedo(0.1);
    // The ratio of the bounce is that of the albedos, up to half floats and what the grey wall's top adds.
    assert!((green / red / expected - 1.0).abs() < 0.05 && (red - blue).abs() < 1e-2 * red, "{red} {green} {blue}, {expected}");
}
