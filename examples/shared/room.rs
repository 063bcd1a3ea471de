//! Rooms of blocks.

use bevy::prelude::*;

/// Spawns matte boxes: size, centre and colour of each.
pub fn spawn_blocks(
    commands: &mut Commands,
    meshes: &mut Assets<Mesh>,
    materials: &mut Assets<StandardMaterial>,
    blocks: impl IntoIterator<Item = (Vec3, Vec3, Color)>,
) {
    for (size, centre, base_color) in blocks {
        let surface = StandardMaterial {
            base_color,
            perceptual_roughness: 1.0,
            reflectance: 0.0,
            ..default()
        };
        commands.spawn((
            Mesh3d(meshes.add(Cuboid::from_size(size))),
            MeshMaterial3d(materials.add(surface)),
            Transform::from_translation(centre),
        ));
    }
}
