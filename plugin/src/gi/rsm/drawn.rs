//! Which meshes maps draw: those that cast shadows and are in the map's frustum.
//!
//! Bevy tests every mesh against every active view in every frame. Few meshes change, and most maps
//! hardly move. So a map keeps a list for a somewhat wider frustum, and changes edit it. Bevy's own
//! test leaves out the cameras of maps, which are active only after it, to the end of the frame.

use std::any::TypeId;

use bevy::camera::primitives::{Aabb, Frustum, Sphere};
use bevy::camera::visibility::{
    InheritedVisibility, NoCpuCulling, NoFrustumCulling, RenderLayers, SetViewVisibility,
    ViewVisibility, VisibilityRange, VisibleEntities,
};
use bevy::camera::{Camera, Projection};
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryData;
use bevy::light::NotShadowCaster;
use bevy::math::primitives::{HalfSpace, ViewFrustum};
use bevy::math::{Vec3A, Vec4};
use bevy::mesh::Mesh3d;
use bevy::transform::components::GlobalTransform;
use fixedbitset::FixedBitSet;

use super::map::{MapPlace, RsmView};
use crate::gi::surfaces::MeshChanges;
use crate::gi::view::{GiFrame, level_position};

/// Padding of a map's frustum, as a share of its diagonal. Higher values list anew less often while
/// a map moves; lower values draw fewer meshes that it does not show.
const PADDING: f32 = 1.0 / 32.0;

/// What a map's list, its camera's [`VisibleEntities`], is of.
#[derive(Component, Clone, Copy, Debug, Default)]
pub(super) struct MapMeshes {
    /// The list has what casts shadows in it. `None`: it must be made anew.
    padded: Option<PaddedFrustum>,
}

/// A frustum around a map's.
#[derive(Clone, Copy, Debug)]
struct PaddedFrustum {
    frustum: Frustum,
    /// Of what the map could show when it was made: from a corner of the near plane to the opposite
    /// one of the far plane, metres.
    diagonal: f32,
}

/// A map and its list.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Map {
    camera: &'static Camera,
    projection: &'static Projection,
    place: &'static MapPlace,
    frustum: Ref<'static, Frustum>,
    layers: Ref<'static, RenderLayers>,
    visible: &'static mut VisibleEntities,
    meshes: &'static mut MapMeshes,
}

/// A mesh that a map may show. Those that Bevy does not cull on the CPU are in every view's list.
#[derive(QueryData)]
pub(super) struct Candidate {
    entity: Entity,
    inherited: &'static InheritedVisibility,
    place: &'static GlobalTransform,
    bounds: Option<&'static Aabb>,
    layers: Option<&'static RenderLayers>,
    is_everywhere: Has<NoFrustumCulling>,
    range: Option<&'static VisibilityRange>,
}

type Casts = (With<Mesh3d>, Without<NotShadowCaster>, Without<NoCpuCulling>);

/// Whether a list may have to change, or is drawn.
pub(super) fn is_needed(changes: Res<MeshChanges>, frame: Res<GiFrame>) -> bool {
    frame.maps || !changes.is_empty()
}

/// Keeps the lists of maps, and makes what is drawn in this frame visible, so that Bevy extracts it.
pub(super) fn list(
    mut maps: Query<Map, With<RsmView>>,
    meshes: Query<Candidate, Casts>,
    mut visibilities: Query<(Entity, &mut ViewVisibility), With<Mesh3d>>,
    changes: Res<MeshChanges>,
) {
    let changed = changes.changed();
    // Entities that live at the same time differ in their index.
    let mut drawn = FixedBitSet::new();
    for mut map in &mut maps {
        if changes.unknown || map.layers.is_changed() {
            map.meshes.padded = None;
        }
        let corners = || corners(map.projection, &map.place.0);
        if map.frustum.is_changed() {
            map.meshes.padded = map.meshes.padded.filter(|padded| padded.fits(&corners()));
        }
        let is_listed = map.meshes.padded.is_some();
        if !is_listed && map.camera.is_active {
            map.meshes.padded = Some(PaddedFrustum::new(&map.frustum, &corners()));
        }
        let Some(padded) = map.meshes.padded else { continue };
        let list = map.visible.get_mut(TypeId::of::<Mesh3d>());
        let eye = map.place.0.translation();
        let is_shown = |mesh: &CandidateItem| {
            mesh.inherited.get()
                && map.layers.intersects(mesh.layers.unwrap_or_default())
                && mesh.range.is_none_or(|range| {
                    let position = level_position(range, mesh.bounds, mesh.place);
                    range.is_visible_at_all(eye.distance(position))
                })
                && (mesh.is_everywhere
                    || mesh
                        .bounds
                        .is_none_or(|bounds| is_inside(&padded.frustum, bounds, mesh.place)))
        };
        if is_listed {
            edit(list, &changed, |mesh| meshes.get(mesh).is_ok_and(|mesh| is_shown(&mesh)));
        } else {
            list.clear();
            list.extend(meshes.iter().filter(|mesh| is_shown(mesh)).map(|mesh| mesh.entity));
            // Bevy finds out what joined and what left by comparing sorted lists.
            list.sort_unstable();
        }
        if map.camera.is_active {
            list.iter().for_each(|mesh| drawn.grow_and_insert(mesh.index_u32() as usize));
        }
    }
    if drawn.is_clear() {
        return;
    }
    for (mesh, mut visibility) in &mut visibilities {
        if drawn.contains(mesh.index_u32() as usize) {
            visibility.set_visible();
        }
    }
}

/// Corners of what a map can show, in the world. Those of Bevy's half-spaces are others: of a parallel
/// projection its near plane lies behind the far one, and cuts nothing off in front.
fn corners(projection: &Projection, place: &GlobalTransform) -> [Vec3A; 8] {
    let near = match projection {
        Projection::Perspective(lens) => lens.near,
        Projection::Orthographic(lens) => lens.near,
        Projection::Custom(_) => 0.0,
    };
    let world_from_map = place.affine();
    projection
        .get_frustum_corners(-near, -projection.far())
        .map(|corner| world_from_map.transform_point3a(corner))
}

impl PaddedFrustum {
    fn new(frustum: &Frustum, corners: &[Vec3A; 8]) -> Self {
        let mut padded = Self { frustum: *frustum, diagonal: diagonal(corners) };
        if padded.diagonal.is_finite() {
            for side in &mut padded.frustum.half_spaces[..ViewFrustum::FAR_PLANE_IDX] {
                *side = HalfSpace::new(side.normal_d() + PADDING * padded.diagonal * Vec4::W);
            }
        }
        padded
    }

    /// Whether it fits around these corners: all are in it, but for its far plane, which does not
    /// count in [`is_inside`] either, and it is not much wider. False where a corner is not finite.
    fn fits(&self, corners: &[Vec3A; 8]) -> bool {
        let sides = &self.frustum.half_spaces[..ViewFrustum::FAR_PLANE_IDX];
        diagonal(corners) >= (1.0 - 2.0 * PADDING) * self.diagonal
            && sides.iter().all(|side| {
                corners.iter().all(|corner| side.normal_d().dot(corner.extend(1.0)) >= 0.0)
            })
    }
}

/// In the order of `CameraProjection::get_frustum_corners`.
fn diagonal(corners: &[Vec3A; 8]) -> f32 {
    corners[0].distance(corners[6])
}

/// Bevy's own test, so that a map draws what a camera in its place would.
fn is_inside(frustum: &Frustum, aabb: &Aabb, place: &GlobalTransform) -> bool {
    let world_from_local = place.affine();
    let sphere = Sphere {
        center: world_from_local.transform_point3a(aabb.center),
        radius: place.radius_vec3a(aabb.half_extents),
    };
    frustum.intersects_sphere(&sphere, false)
        && frustum.intersects_obb(aabb, &world_from_local, true, false)
}

/// Takes those of `changed` out of a list that are not shown any more, and puts those in that are
/// now. Both are sorted.
fn edit(list: &mut Vec<Entity>, changed: &[Entity], is_shown: impl Fn(Entity) -> bool) {
    let (mut joined, mut left) = (Vec::new(), Vec::new());
    for mesh in changed {
        match (list.binary_search(mesh).is_ok(), is_shown(*mesh)) {
            (false, true) => joined.push(*mesh),
            (true, false) => left.push(*mesh),
            _ => {}
        }
    }
    if !left.is_empty() {
        let mut left = left.iter().peekable();
        list.retain(|mesh| left.next_if_eq(&mesh).is_none());
    }
    if !joined.is_empty() {
        list.append(&mut joined);
        // Finds the two sorted parts, and merges them.
        list.sort();
    }
}

#[cfg(test)]
#[path = "drawn_tests.rs"]
mod tests;
