//! Meshes where they are drawn, with their materials.

use std::any::TypeId;

use bevy::asset::{AssetId, Assets};
use bevy::camera::visibility::{InheritedVisibility, RenderLayers, VisibilityRange};
use bevy::ecs::entity::Entity;
use bevy::ecs::reflect::AppTypeRegistry;
use bevy::ecs::world::World;
use bevy::light::NotShadowCaster;
use bevy::mesh::morph::{MeshMorphWeights, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::render::render_resource::Face;
use bevy::transform::components::GlobalTransform;
use frugal_trace::scene::{SceneGeometry, SceneMesh};

use super::material::Materials;
use super::vertices::{Drawn, Placement, scene_mesh};
use super::{Gaps, name};

/// Every mesh that a camera with `layers` can show.
pub(super) fn geometry(
    world: &mut World,
    layers: &RenderLayers,
    exposure: f32,
    gaps: &mut Gaps,
) -> SceneGeometry {
    let mut query = world.query::<(
        Entity,
        &Mesh3d,
        &GlobalTransform,
        Option<&InheritedVisibility>,
        Option<&RenderLayers>,
        Option<&VisibilityRange>,
    )>();
    let shown: Vec<(Entity, AssetId<Mesh>)> = query
        .iter(world)
        .filter(|(_, _, _, visibility, own_layers, range)| {
            visibility.is_none_or(|visibility| visibility.get())
                && own_layers.unwrap_or(&RenderLayers::default()).intersects(layers)
                // The level of detail of a near camera.
                && range.is_none_or(|range| range.start_margin.start <= 0.0)
        })
        .map(|(entity, mesh, ..)| (entity, mesh.id()))
        .collect();
    let mut materials = Materials::default();
    let mut meshes = Vec::new();
    for (entity, mesh) in shown {
        meshes.extend(surface(world, entity, mesh, exposure, &mut materials, gaps));
    }
    let Materials { materials, textures, .. } = materials;
    SceneGeometry { meshes, materials, textures }
}

/// The mesh of an entity; `None` where nothing is drawn, or only light passes.
fn surface(
    world: &World,
    entity: Entity,
    mesh: AssetId<Mesh>,
    exposure: f32,
    materials: &mut Materials,
    gaps: &mut Gaps,
) -> Option<SceneMesh> {
    let name = name(world, entity);
    let (converted, drawn) = match world.get::<MeshMaterial3d<StandardMaterial>>(entity) {
        Some(handle) => {
            let material = world.resource::<Assets<StandardMaterial>>().get(&handle.0)?;
            let drawn = match material.cull_mode {
                Some(Face::Back) => Drawn::Fronts,
                Some(Face::Front) => Drawn::Backs,
                None => Drawn::Both,
            };
            let material = (handle.id(), material);
            (materials.convert(world, material, exposure, &name, gaps), drawn)
        }
        // A mesh without any material is not drawn.
        None if !has_other_material(world, entity) => return None,
        None => {
            gaps.add("materials of other kinds are traced as grey", &*name);
            (Ok(materials.grey()), Drawn::Fronts)
        }
    };
    let Some(mesh) = world.get_resource::<Assets<Mesh>>().and_then(|meshes| meshes.get(mesh))
    else {
        gaps.add("meshes that are not loaded are left out", name);
        return None;
    };
    let vertices = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).map_or(0, |values| values.len());
    if mesh.try_morph_targets().is_ok_and(|targets| targets.len() % vertices.max(1) != 0) {
        // As Bevy's glTF loader leaves them where it computes normals.
        gaps.add("morph targets that do not fit their mesh are left out", &*name);
    }
    let Some(placement) = placement(world, entity) else {
        gaps.add("skinned meshes without joints are left out", name);
        return None;
    };
    let material = converted.unwrap_or_default();
    match scene_mesh(mesh, &placement, weights(world, entity), drawn, material) {
        Ok(mesh) => {
            if let Err(what) = converted {
                gaps.add(what, format!("{name} ({:.2} m²)", area(&mesh)));
                return None;
            }
            if world.get::<NotShadowCaster>(entity).is_some() {
                gaps.add("surfaces that cast no shadow cast one in the path tracer", name);
            }
            Some(mesh)
        }
        Err(problem) => {
            gaps.add(problem, name);
            None
        }
    }
}

/// Whether a material of any other kind draws the entity.
fn has_other_material(world: &World, entity: Entity) -> bool {
    // `MaterialPlugin` registers them. A component's own name is known only with Bevy's feature `debug`.
    let Some(types) = world.get_resource::<AppTypeRegistry>() else { return false };
    let types = types.read();
    let is_material = |id: TypeId| {
        let path = types.get_type_info(id).map(|info| info.type_path_table().ident());
        path == Some(Some("MeshMaterial3d"))
    };
    world.inspect_entity(entity).is_ok_and(|mut components| {
        components.any(|component| component.type_id().is_some_and(is_material))
    })
}

fn placement(world: &World, entity: Entity) -> Option<Placement> {
    let matrix = |entity: Entity| {
        let transform = world.get::<GlobalTransform>(entity)?;
        Some(transform.to_matrix().as_dmat4())
    };
    let Some(skin) = world.get::<SkinnedMesh>(entity) else {
        return matrix(entity).map(Placement::Rigid);
    };
    let poses = world.get_resource::<Assets<SkinnedMeshInverseBindposes>>()?;
    let poses = poses.get(&skin.inverse_bindposes)?;
    let joints = skin.joints.iter().zip(poses.iter());
    let joints = joints.map(|(joint, pose)| Some(matrix(*joint)? * pose.as_dmat4()));
    Some(Placement::Skinned(joints.collect::<Option<_>>()?))
}

/// Weights of the entity's morph targets.
fn weights(world: &World, entity: Entity) -> &[f32] {
    match world.get::<MeshMorphWeights>(entity) {
        Some(MeshMorphWeights::Value { weights }) => weights,
        Some(MeshMorphWeights::Reference(owner)) => {
            world.get::<MorphWeights>(*owner).map_or(&[], MorphWeights::weights)
        }
        None => &[],
    }
}

/// Square metres.
fn area(mesh: &SceneMesh) -> f32 {
    let corner = |index: u32| mesh.positions[index as usize];
    let triangles = mesh.indices.chunks_exact(3).map(|triangle| {
        let [a, b, c] = [0, 1, 2].map(|i| corner(triangle[i]));
        0.5 * (b - a).cross(c - a).length()
    });
    triangles.sum()
}
