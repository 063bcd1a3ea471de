//! A machine-independent hash of a scene.

use std::collections::BTreeMap;

use frugal_trace::light::Light;
use frugal_trace::scene::{SceneGeometry, SceneMaterial, SceneMesh};
use serde::Serialize;

use super::description::{Environment, Geometry, SceneDescription};

/// 32 hexadecimal digits that change with every change of the scene's images or camera space.
/// `environment`: the content of the environment.
///
/// Paths do not count: a map is valid for every path through the scene's bounds. Nor do the names of
/// files, whose content counts.
pub(crate) fn fingerprint(
    description: &SceneDescription,
    geometry: &SceneGeometry,
    environment: &impl Serialize,
) -> String {
    let description = SceneDescription {
        geometry: Geometry::Procedural(String::new()),
        environment: match &description.environment {
            Environment::Map(_, intensity) => Environment::Map(String::new(), *intensity),
            other => other.clone(),
        },
        paths: BTreeMap::new(),
        ..description.clone()
    };
    format!("{:032x}", hash(&(description, surfaces(geometry), environment)))
}

/// The same for the level of an app, of what stays while the app moves things, lights and colours:
/// each mesh's triangles and texture coordinates, textures, and the number of lights of each kind.
pub(crate) fn level_fingerprint(
    description: &SceneDescription,
    geometry: &SceneGeometry,
) -> String {
    let mesh = |mesh: &SceneMesh| hash(&(&mesh.indices, &mesh.uvs, &mesh.second_uvs));
    let mut meshes: Vec<u128> = geometry.meshes.iter().map(mesh).collect();
    let mut textures: Vec<u128> = geometry.textures.iter().map(hash).collect();
    meshes.sort_unstable();
    textures.sort_unstable();
    let mut lights = [0_u32; 3];
    for light in &description.lights {
        let kind = match light {
            Light::Directional { .. } => 0,
            Light::Point { .. } => 1,
            Light::Spot { .. } => 2,
        };
        lights[kind] += 1;
    }
    format!("{:032x}", hash(&(meshes, textures, lights)))
}

/// 32 hexadecimal digits that change with every change of the bytes of `files`, in their order.
pub(super) fn content_hash(files: impl Iterator<Item = Vec<u8>>) -> String {
    let files: Vec<u128> = files.map(|bytes| fnv(&bytes)).collect();
    format!("{:032x}", hash(&files))
}

/// Hashes of the meshes, each with its material and textures, in whatever order these are.
fn surfaces(geometry: &SceneGeometry) -> Vec<u128> {
    let of = |hashes: &[u128], index: usize| hashes.get(index).copied().unwrap_or_default();
    let textures: Vec<u128> = geometry.textures.iter().map(hash).collect();
    let material = |material: &SceneMaterial| {
        let read: Vec<u128> = material.textures().map(|it| of(&textures, it.texture)).collect();
        let mut material = material.clone();
        let SceneMaterial {
            base_color_texture, metallic_roughness_texture, emissive_texture, ..
        } = &mut material;
        for slot in [base_color_texture, metallic_roughness_texture, emissive_texture] {
            slot.iter_mut().for_each(|slot| slot.texture = 0);
        }
        hash(&(material, read))
    };
    let materials: Vec<u128> = geometry.materials.iter().map(material).collect();
    let mesh = |mesh: &SceneMesh| {
        // In full, so that a new field cannot be forgotten.
        let SceneMesh { positions, normals, uvs, second_uvs, colors, indices, material } = mesh;
        let material = of(&materials, *material);
        hash(&(positions, normals, uvs, second_uvs, colors, indices, material))
    };
    let mut meshes: Vec<u128> = geometry.meshes.iter().map(mesh).collect();
    meshes.sort_unstable();
    meshes
}

/// Of the value in postcard's format, which is the same on every machine.
fn hash(value: &impl Serialize) -> u128 {
    fnv(&postcard::to_stdvec(value).expect("plain data"))
}

/// FNV-1a of 128 bits (Fowler, Noll, Vo; draft-eastlake-fnv): not safe against forgery, but
/// accidental collisions are negligible.
fn fnv(bytes: &[u8]) -> u128 {
    let next = |hash: u128, byte: &u8| {
        (hash ^ u128::from(*byte)).wrapping_mul(0x0000_0000_0100_0000_0000_0000_0000_013b)
    };
    bytes.iter().fold(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d, next)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    #[test]
    fn agrees_with_the_published_function() {
        // The published value of an input of one byte, "a".
        assert_eq!(fnv(b"a"), 0xd228_cb69_6f1a_8caf_7891_2b70_4e4a_8964);
    }

    #[test]
    fn parts_are_told_apart() {
        assert_ne!(hash(&("ab", "c")), hash(&("a", "bc")));
    }

    #[test]
    fn a_level_stays_the_same_while_its_things_move() {
        let light = |x: f32| Light::Point {
            position: Vec3::X * x,
            luminous_power: 100.0 + x,
            range: 10.0,
            color: [1.0; 3],
        };
        let level = |x: f32, indices: Vec<u32>, lights: usize| {
            let mesh = SceneMesh {
                positions: vec![Vec3::X * x, Vec3::Y, Vec3::Z],
                normals: vec![Vec3::Z * x; 3],
                indices,
                ..SceneMesh::default()
            };
            let glow = SceneMaterial { emissive: [x; 3], ..SceneMaterial::default() };
            let geometry =
                SceneGeometry { meshes: vec![mesh], materials: vec![glow], textures: Vec::new() };
            let description = SceneDescription {
                lights: vec![light(x); lights],
                ..SceneDescription::new(Geometry::Procedural(String::new()))
            };
            level_fingerprint(&description, &geometry)
        };
        let one = level(1.0, vec![0, 1, 2], 1);
        assert_eq!(one, level(2.0, vec![0, 1, 2], 1), "it moved and glows");
        assert_ne!(one, level(1.0, vec![0, 2, 1], 1), "another mesh");
        assert_ne!(one, level(1.0, vec![0, 1, 2], 2), "another light");
    }

    #[test]
    fn geometry_counts_in_any_order() {
        let triangle = |x: f32, material| SceneMesh {
            positions: vec![Vec3::X * x, Vec3::Y, Vec3::Z],
            normals: vec![Vec3::Z; 3],
            indices: vec![0, 1, 2],
            material,
            ..SceneMesh::default()
        };
        let glossy = SceneMaterial { perceptual_roughness: 0.2, ..SceneMaterial::default() };
        let geometry = |meshes: Vec<SceneMesh>, materials: Vec<SceneMaterial>| SceneGeometry {
            meshes,
            materials,
            textures: Vec::new(),
        };
        let plain = SceneMaterial::default();
        let one =
            geometry(vec![triangle(1.0, 0), triangle(2.0, 1)], vec![plain.clone(), glossy.clone()]);
        let other = geometry(vec![triangle(2.0, 0), triangle(1.0, 1)], vec![glossy, plain]);
        assert_eq!(surfaces(&one), surfaces(&other));
        let mut changed = one.clone();
        changed.materials[1].metallic = 1e-6;
        assert_ne!(surfaces(&one), surfaces(&changed));
        let mut changed = one.clone();
        changed.meshes[0].positions[2].x = 1e-9;
        assert_ne!(surfaces(&one), surfaces(&changed));
    }
}
