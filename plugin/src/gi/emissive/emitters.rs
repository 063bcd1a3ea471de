//! Glowing surfaces: which meshes give off light, and the texels that stand for them.
//!
//! Texels are made by the processor and not from a picture: a glowing surface has no view of its
//! own from which a reflective shadow map could be taken, and a thousand points are few enough.
//! They join the maps' texels in the store, so that they are weighed by what the camera sees,
//! drawn, gathered, hidden and filtered as light that bounced is.

use std::sync::Arc;

use bevy::asset::{AssetEvent, AssetId};
use bevy::camera::visibility::InheritedVisibility;
use bevy::camera::{Camera, Exposure};
use bevy::color::ColorToComponents;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::math::{Affine3A, DVec3, Vec3};
use bevy::mesh::skinning::SkinnedMesh;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::platform::collections::{HashMap, HashSet};
use bevy::render::extract_resource::ExtractResource;
use bevy::transform::components::GlobalTransform;

use super::emission::{Emission, emission};
use super::surface::GlowingSurface;
use crate::gi::settings::FrugalGi;
use crate::gi::surfaces::{
    Cutout, Mask, Place, PlacedTexture, SurfaceAssets, SurfacePoints, TextureUse, Triangles,
    triangles,
};
use crate::gi::texels::{Texel, TexelRow};
use crate::gi::view::LightPresence;

/// Texels that all glowing surfaces share, more or less: each has a power of two of them, so that a
/// lamp that flickers does not deal all others' anew.
const TEXELS: usize = 1024;
/// Most surfaces that glow; the most powerful ones do.
const MOST_SURFACES: usize = 4096;
/// Points of a surface with a texture or a mask for each that becomes a texel: where the texture is
/// dark, or a hole, none does.
const PATTERNED_POINTS: usize = 16;

/// Texels of everything that glows, for cameras of one exposure.
#[derive(Clone, Debug, Default)]
struct EmitterSet {
    /// The cameras' exposure; none where it makes no difference.
    exposure: Option<f32>,
    texels: Arc<Vec<Texel>>,
}

/// What glows, kept while a camera has global illumination and empty else.
///
/// Every visible mesh with a [`StandardMaterial`] whose `emissive` is not black does, on the sides
/// that its `cull_mode` shows, but: unlit and multiplying ones, skinned ones (their triangles here
/// are those of the bind pose), and those whose mesh is kept for the GPU alone (a warning says so).
/// An emissive texture is read where its image is there for the processor in a format without
/// compression, and taken for white else (another warning). Holes of alpha masks do not glow.
/// Morphs, shaders that move vertices, other kinds of material and render layers are not looked at.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub struct GiEmitters {
    sets: Vec<EmitterSet>,
    surfaces: usize,
}

impl GiEmitters {
    /// Surfaces that glow.
    pub fn surface_count(&self) -> usize {
        self.surfaces
    }

    /// Texels that stand for them.
    pub fn texel_count(&self) -> usize {
        self.sets.iter().map(|set| set.texels.len()).sum()
    }

    /// All texels, as they lie in the store.
    pub(super) fn texels(&self) -> impl Iterator<Item = &Arc<Vec<Texel>>> {
        self.sets.iter().map(|set| &set.texels)
    }

    /// Adds the rows of what glows for a camera of `exposure` to those of its maps. The first texel
    /// of all sets is the store's `first`.
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

/// Whose points are whose: a mesh, how a texture lies on it, and where it has holes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct SurfaceKey {
    mesh: AssetId<Mesh>,
    texture: Option<TextureUse>,
    mask: Option<Mask>,
}

impl SurfaceKey {
    /// Points for each that becomes a texel.
    fn points_per_texel(&self) -> usize {
        if self.texture.is_some() || self.mask.is_some() { PATTERNED_POINTS } else { 1 }
    }
}

/// A surface in its place.
#[derive(Clone, Debug, PartialEq)]
struct Placed {
    entity: Entity,
    key: SurfaceKey,
    affine: Affine3A,
    emission: Emission,
}

/// What the present [`GiEmitters`] was made of.
#[derive(Resource, Default)]
pub(super) struct Glow {
    /// Materials that glow.
    materials: HashMap<AssetId<StandardMaterial>, Emission>,
    /// None where a mesh has no triangles that can be read.
    surfaces: HashMap<SurfaceKey, Option<GlowingSurface>>,
    placed: Vec<Placed>,
    exposures: Vec<Option<f32>>,
    /// Set when a mesh or a texture changed.
    stale: bool,
}

pub(super) fn update(
    mut glow: ResMut<Glow>,
    mut emitters: ResMut<GiEmitters>,
    (mut material_events, mut mesh_events, mut image_events): (
        Option<MessageReader<AssetEvent<StandardMaterial>>>,
        Option<MessageReader<AssetEvent<Mesh>>>,
        Option<MessageReader<AssetEvent<Image>>>,
    ),
    assets: SurfaceAssets,
    cameras: Query<(&Camera, &FrugalGi, Option<&Exposure>)>,
    meshes: Query<
        (
            Entity,
            &Mesh3d,
            &MeshMaterial3d<StandardMaterial>,
            &GlobalTransform,
            &InheritedVisibility,
        ),
        Without<SkinnedMesh>,
    >,
) {
    let glow = &mut *glow;
    for event in material_events.iter_mut().flat_map(MessageReader::read) {
        let (AssetEvent::Added { id } | AssetEvent::Modified { id } | AssetEvent::Removed { id }) =
            event
        else {
            continue;
        };
        match assets.materials.as_ref().and_then(|materials| emission(materials.get(*id)?)) {
            Some(emission) => glow.materials.insert(*id, emission),
            None => glow.materials.remove(id),
        };
    }
    for event in mesh_events.iter_mut().flat_map(MessageReader::read) {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else { continue };
        glow.forget(|key| key.mesh == *id);
    }
    for event in image_events.iter_mut().flat_map(MessageReader::read) {
        let (AssetEvent::Modified { id } | AssetEvent::Removed { id }) = event else { continue };
        glow.forget(|key| {
            key.texture.is_some_and(|texture| texture.image == *id)
                || key.mask.is_some_and(|mask| mask.reads(*id))
        });
    }
    let exposures: Vec<f32> = cameras
        .iter()
        .filter(|(camera, gi, _)| camera.is_active && gi.vpl_count > 0 && gi.emissive)
        .map(|(_, _, exposure)| exposure.copied().unwrap_or_default().exposure())
        .collect();
    if exposures.is_empty() || glow.materials.is_empty() {
        if !glow.placed.is_empty() || !glow.surfaces.is_empty() {
            (glow.surfaces, glow.placed, glow.exposures) = Default::default();
            *emitters = GiEmitters::default();
        }
        return;
    }
    let mut now: Vec<Placed> = meshes
        .iter()
        .filter(|(.., transform, visible)| visible.get() && transform.affine().is_finite())
        .filter_map(|(entity, mesh, material, transform, _)| {
            let emission = *glow.materials.get(&material.id())?;
            let key =
                SurfaceKey { mesh: mesh.id(), texture: emission.texture, mask: emission.mask };
            Some(Placed { entity, key, affine: transform.affine(), emission })
        })
        .collect();
    // Entities come in no particular order, and texels should lie the same in every run.
    now.sort_unstable_by_key(|placed| placed.entity);
    let used: HashSet<SurfaceKey> = now.iter().map(|placed| placed.key).collect();
    glow.surfaces.retain(|key, _| used.contains(key));
    for key in used {
        if !glow.surfaces.contains_key(&key)
            && let Some(surface) = surface(&key, FIRST_TEXELS, &assets)
        {
            glow.surfaces.insert(key, surface);
            glow.stale = true;
        }
    }
    let exposures = distinct_exposures(&now, exposures);
    if glow.stale || glow.placed != now || glow.exposures != exposures {
        let sets = exposures
            .iter()
            .map(|exposure| assemble(&mut glow.surfaces, &now, *exposure, &assets))
            .collect();
        *emitters = GiEmitters {
            sets,
            surfaces: now
                .iter()
                .filter(|placed| matches!(glow.surfaces.get(&placed.key), Some(Some(_))))
                .count(),
        };
        (glow.placed, glow.exposures, glow.stale) = (now, exposures, false);
    }
}

/// For those who keep nothing where there is no light.
pub(super) fn note_presence(emitters: Res<GiEmitters>, mut presence: ResMut<LightPresence>) {
    presence.emissive = emitters.texel_count() > 0;
}

impl Glow {
    fn forget(&mut self, is_gone: impl Fn(&SurfaceKey) -> bool) {
        let before = self.surfaces.len();
        self.surfaces.retain(|key, _| !is_gone(key));
        self.stale |= self.surfaces.len() != before;
    }
}

/// The exposures for which texels differ: one for each camera's where a surface glows as brightly
/// on screen at any exposure, as Bevy's do by default.
fn distinct_exposures(placed: &[Placed], mut exposures: Vec<f32>) -> Vec<Option<f32>> {
    if placed.iter().all(|placed| placed.emission.unexposed == Vec3::ZERO) {
        return vec![None];
    }
    exposures.sort_unstable_by(f32::total_cmp);
    exposures.dedup();
    exposures.into_iter().map(Some).collect()
}

/// Texels' worth of points for a first look at a surface.
const FIRST_TEXELS: usize = 64;

/// Points of a surface for so many texels; `None` while its assets are not there, and `Some(None)`
/// where they cannot be read.
fn surface(
    key: &SurfaceKey,
    texels: usize,
    assets: &SurfaceAssets,
) -> Option<Option<GlowingSurface>> {
    let mesh = assets.meshes.get(key.mesh)?;
    let texture = PlacedTexture::new(key.texture, mesh, assets.images.as_deref())?;
    let cutout = Cutout::new(key.mask.as_ref(), mesh, assets.images.as_deref())?;
    let Some(Triangles { corners, positions }) = triangles(mesh) else {
        warn_once!(
            "a glowing mesh is kept for the GPU alone or is no triangle list: it lights nothing (RenderAssetUsages::MAIN_WORLD keeps it readable)"
        );
        return Some(None);
    };
    let color = |Place { triangle, weights }| {
        if cutout.as_ref().is_some_and(|cutout| !cutout.is_there(corners[triangle], weights)) {
            return Vec3::ZERO;
        }
        let Some(texture) = &texture else { return Vec3::ONE };
        let Some(color) = texture.color(corners[triangle], weights) else {
            warn_once!(
                "an emissive texture is kept for the GPU alone or is compressed: what it lights is lit as if it were white"
            );
            return Vec3::ONE;
        };
        let color = color.to_vec3();
        if color.is_finite() { color.max(Vec3::ZERO) } else { Vec3::ZERO }
    };
    Some(SurfacePoints::new(&positions, texels * key.points_per_texel(), color).map(GlowingSurface))
}

/// The texels of all surfaces, as cameras of `exposure` see them glow.
fn assemble(
    surfaces: &mut HashMap<SurfaceKey, Option<GlowingSurface>>,
    placed: &[Placed],
    exposure: Option<f32>,
    assets: &SurfaceAssets,
) -> EmitterSet {
    let mut glowing: Vec<(&Placed, DVec3, f64)> = placed
        .iter()
        .filter_map(|placed| {
            let surface = surfaces.get(&placed.key)?.as_ref()?;
            let radiance = placed.emission.radiance(exposure);
            let power =
                surface.power(&placed.affine, radiance) * placed.emission.sides.count() as f64;
            (power > 0.0 && power.is_finite()).then_some((placed, radiance, power))
        })
        .collect();
    if glowing.len() > MOST_SURFACES {
        warn_once!(
            "{} surfaces glow: only the {MOST_SURFACES} most powerful ones light others",
            glowing.len()
        );
        glowing.sort_by(|a, b| b.2.total_cmp(&a.2).then(a.0.entity.cmp(&b.0.entity)));
        glowing.truncate(MOST_SURFACES);
        glowing.sort_unstable_by_key(|(placed, ..)| placed.entity);
    }
    let total: f64 = glowing.iter().map(|(.., power)| power).sum();
    let mut texels = Vec::new();
    for (placed, radiance, power) in glowing {
        let sides = placed.emission.sides;
        let share = (TEXELS as f64 * power / total / sides.count() as f64).ceil() as usize;
        let count = share.clamp(1, TEXELS).next_power_of_two();
        let Some(Some(points)) = surfaces.get_mut(&placed.key) else { continue };
        if points.len() < count * placed.key.points_per_texel()
            && let Some(Some(finer)) = surface(&placed.key, count, assets)
        {
            *points = finer;
        }
        points.add_texels(&placed.affine, radiance, sides, count, &mut texels);
    }
    EmitterSet { exposure, texels: Arc::new(texels) }
}
