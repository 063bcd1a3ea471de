//! Emissive surfaces: which meshes emit light, and the texels that represent them.
//!
//! The CPU makes the texels, not a render pass: an emissive surface has no view of its own from
//! which a reflective shadow map could be rendered, and a thousand points are few enough. They join
//! the maps' texels in the store, so importance, sampling, visibility, gather and denoising are
//! those of bounced light.

use std::sync::Arc;

use bevy::asset::AssetId;
use bevy::camera::{Camera, Exposure};
use bevy::color::ColorToComponents;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::math::{DVec3, Vec3};
use bevy::mesh::Mesh;
use bevy::mesh::skinning::SkinnedMesh;
use bevy::pbr::StandardMaterial;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::render::extract_resource::ExtractResource;

use super::emission::{Emission, emission};
use super::surface::EmissiveSurface;
use crate::gi::surfaces::{
    Cutout, Mask, MeshChanges, MeshTexture, SurfaceAssets, SurfaceChange, SurfaceInstance,
    SurfaceKey, SurfaceMesh, SurfacePoints, SurfaceSet, TextureUse, TrianglePoint, Triangles,
    triangles,
};
use crate::gi::texels::{Texel, TexelRow};
use crate::gi::view::{ActiveGi, GiCameras, LightPresence};

/// Texels of all emissive surfaces, approximately: each surface has a power of two of them, so that
/// one that flickers does not change the others' texels.
const TEXELS: usize = 1024;
/// Most emissive surfaces. The most powerful ones are kept.
const MAX_SURFACES: usize = 4096;
/// Candidate points for each texel of a surface with a texture or a mask: points on dark texture or
/// in holes become no texel.
const PATTERNED_POINTS: usize = 16;

/// Texels of all emissive surfaces, for cameras of one exposure.
#[derive(Clone, Debug, Default)]
struct EmitterSet {
    /// The cameras' exposure; `None` where it makes no difference.
    exposure: Option<f32>,
    texels: Arc<Vec<Texel>>,
}

/// The emissive surfaces. Maintained while a camera has global illumination, else empty.
///
/// These are the meshes with a [`StandardMaterial`] whose `emissive` is not black, on the sides that
/// its `cull_mode` shows, where they are visible, on a render layer of a GI camera and at the level
/// of detail of its distance. Exceptions: unlit and multiplying materials, skinned meshes (their
/// triangles here are those of the bind pose), and meshes whose asset is kept for the GPU alone
/// (with a warning). Emissive textures that are compressed or kept for the GPU alone are
/// [copied](crate::gi::GiTextureCopies) once. Holes of alpha masks emit nothing. Morphs,
/// shaders that move vertices and other kinds of material are ignored.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiEmitters {
    sets: Vec<EmitterSet>,
}

impl GiEmitters {
    /// Number of texels that represent emissive surfaces.
    pub fn texel_count(&self) -> usize {
        self.sets.iter().map(|set| set.texels.len()).sum()
    }

    /// All texels, in the order of the store.
    pub(super) fn texels(&self) -> impl Iterator<Item = &[Texel]> {
        self.sets.iter().map(|set| set.texels.as_slice())
    }

    /// Adds the rows of emissive texels for a camera of `exposure` to those of its maps. `first`:
    /// index of the first set's first texel in the store.
    pub(in crate::gi) fn add_rows(&self, exposure: f32, first: u32, rows: &mut Vec<TexelRow>) {
        let mut first_texel = first;
        for set in &self.sets {
            let count = set.texels.len() as u32;
            if set.exposure.is_none_or(|own| own == exposure) {
                TexelRow::add_scattered(rows, first_texel, count);
            }
            first_texel += count;
        }
    }
}

/// Identifies a surface's points: its mesh, the mapping of its texture, and its alpha mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct EmissiveKey {
    mesh: AssetId<Mesh>,
    texture: Option<TextureUse>,
    mask: Option<Mask>,
}

impl SurfaceKey for EmissiveKey {
    fn mesh(&self) -> AssetId<Mesh> {
        self.mesh
    }

    fn reads(&self, images: &HashSet<AssetId<Image>>) -> bool {
        self.texture.is_some_and(|texture| images.contains(&texture.image))
            || self.mask.is_some_and(|mask| mask.reads(images))
    }
}

impl EmissiveKey {
    /// Candidate points for each texel.
    fn points_per_texel(&self) -> usize {
        if self.texture.is_some() || self.mask.is_some() { PATTERNED_POINTS } else { 1 }
    }
}

type EmissiveInstance = SurfaceInstance<EmissiveKey, Emission>;

/// The inputs of the current [`GiEmitters`].
#[derive(Resource, Default)]
pub(super) struct EmissiveState {
    /// Emissive materials.
    materials: HashMap<AssetId<StandardMaterial>, Emission>,
    /// A value is `None` where a mesh has no readable triangles.
    surfaces: SurfaceSet<EmissiveKey, Emission, Option<EmissiveSurface>>,
    exposures: Vec<Option<f32>>,
}

pub(super) fn update(
    mut state: ResMut<EmissiveState>,
    mut emitters: ResMut<GiEmitters>,
    assets: SurfaceAssets,
    cameras: Query<(&Camera, &ActiveGi, Option<&Exposure>)>,
    meshes: Query<SurfaceMesh, Without<SkinnedMesh>>,
    gi_cameras: GiCameras,
    changes: Res<MeshChanges>,
) {
    let EmissiveState { materials, surfaces, exposures } = &mut *state;
    for id in &changes.materials {
        match assets.materials.as_ref().and_then(|materials| emission(materials.get(*id)?)) {
            Some(emission) => materials.insert(*id, emission),
            None => materials.remove(id),
        };
    }
    surfaces.cache.read(&changes);
    let of_cameras: Vec<f32> = cameras
        .iter()
        .filter(|(camera, gi, _)| camera.is_active && gi.vpl_count > 0 && gi.emissive)
        .map(|(_, _, exposure)| exposure.copied().unwrap_or_default().exposure())
        .collect();
    if of_cameras.is_empty() || materials.is_empty() {
        if !surfaces.instances.is_empty() || !surfaces.cache.values.is_empty() {
            surfaces.cache.values.clear();
            exposures.clear();
            *emitters = GiEmitters::default();
        }
        surfaces.clear();
        return;
    }
    let change = surfaces.update(
        &meshes,
        (&gi_cameras.shown(), &changes),
        |mesh, material| {
            let emission = *materials.get(&material)?;
            let Emission { texture, mask, .. } = emission;
            Some((EmissiveKey { mesh, texture, mask }, emission))
        },
        |key| surface(key, FIRST_TEXELS, &assets),
    );
    let now = distinct_exposures(&surfaces.instances, of_cameras);
    if change != SurfaceChange::Nothing || *exposures != now {
        *exposures = now;
        let mut is_coarse = false;
        let (values, instances) = (&mut surfaces.cache.values, &surfaces.instances);
        let set = |exposure: &Option<f32>| {
            assemble(values, instances, *exposure, &assets, &mut is_coarse)
        };
        *emitters = GiEmitters { sets: exposures.iter().map(set).collect() };
        surfaces.cache.changed = is_coarse;
    }
}

/// For systems that hold nothing while there is no light.
pub(super) fn note_presence(emitters: Res<GiEmitters>, mut presence: ResMut<LightPresence>) {
    presence.emissive = emitters.texel_count() > 0;
}

/// The exposures for which texels differ: each camera's own where a surface is equally bright on
/// screen at any exposure, as Bevy's are by default; else one set for all.
fn distinct_exposures(instances: &[EmissiveInstance], mut exposures: Vec<f32>) -> Vec<Option<f32>> {
    if instances.iter().all(|instance| instance.material.unexposed == Vec3::ZERO) {
        return vec![None];
    }
    exposures.sort_unstable_by(f32::total_cmp);
    exposures.dedup();
    exposures.into_iter().map(Some).collect()
}

/// Texels for which a new surface gets points, before its power is known.
const FIRST_TEXELS: usize = 64;

/// Points of a surface for `texels` texels; `None` while its assets are not loaded, and
/// `Some(None)` where they cannot be read.
fn surface(
    key: &EmissiveKey,
    texels: usize,
    assets: &SurfaceAssets,
) -> Option<Option<EmissiveSurface>> {
    let mesh = assets.meshes.get(key.mesh)?;
    let texture = MeshTexture::new(key.texture, mesh, assets.textures())?;
    let cutout = Cutout::new(key.mask.as_ref(), mesh, assets.textures())?;
    let Some(Triangles { corners, positions }) = triangles(mesh) else {
        warn_once!(
            "an emissive mesh is kept for the GPU alone or is no triangle list: it lights nothing (RenderAssetUsages::MAIN_WORLD keeps it readable)"
        );
        return Some(None);
    };
    let color = |TrianglePoint { triangle, weights }| {
        if cutout.as_ref().is_some_and(|cutout| !cutout.is_opaque(corners[triangle], weights)) {
            return Vec3::ZERO;
        }
        let Some(texture) = &texture else { return Vec3::ONE };
        let Some(color) = texture.color(corners[triangle], weights) else {
            warn_once!(
                "neither the CPU nor a shader can read an emissive texture: it emits as if it were white"
            );
            return Vec3::ONE;
        };
        let color = color.to_vec3();
        if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO }
    };
    Some(
        SurfacePoints::new(&positions, texels * key.points_per_texel(), color).map(EmissiveSurface),
    )
}

/// The texels of all emissive surfaces for cameras of `exposure`. `is_coarse` is set where more
/// points of a surface must be waited for.
fn assemble(
    surfaces: &mut HashMap<EmissiveKey, Option<EmissiveSurface>>,
    instances: &[EmissiveInstance],
    exposure: Option<f32>,
    assets: &SurfaceAssets,
    is_coarse: &mut bool,
) -> EmitterSet {
    let mut emissive: Vec<(&EmissiveInstance, DVec3, f64)> = instances
        .iter()
        .filter_map(|instance| {
            let surface = surfaces.get(&instance.key)?.as_ref()?;
            let radiance = instance.material.radiance(exposure);
            let power = surface.power(&instance.affine, radiance)
                * instance.material.sides.signs().len() as f64;
            (power > 0.0 && power.is_finite()).then_some((instance, radiance, power))
        })
        .collect();
    if emissive.len() > MAX_SURFACES {
        warn_once!(
            "{} surfaces are emissive: only the {MAX_SURFACES} most powerful ones light others",
            emissive.len()
        );
        emissive.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.entity.cmp(&b.0.entity)));
        emissive.truncate(MAX_SURFACES);
        emissive.sort_unstable_by_key(|(instance, ..)| instance.entity);
    }
    let total: f64 = emissive.iter().map(|(.., power)| power).sum();
    let mut texels = Vec::new();
    for (instance, radiance, power) in emissive {
        let sides = instance.material.sides;
        let share = (TEXELS as f64 * power / total / sides.signs().len() as f64).ceil() as usize;
        let count = share.clamp(1, TEXELS).next_power_of_two();
        let Some(Some(points)) = surfaces.get_mut(&instance.key) else { continue };
        if points.len() < count * instance.key.points_per_texel() {
            match surface(&instance.key, count, assets) {
                Some(Some(finer)) => *points = finer,
                Some(None) => {}
                // Its texture went to the GPU since the first points were read.
                None => *is_coarse = true,
            }
        }
        points.add_texels(&instance.affine, radiance, sides, count, &mut texels);
    }
    EmitterSet { exposure, texels: Arc::new(texels) }
}
