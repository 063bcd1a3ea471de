//! The volume around each camera that draws meshes that are not deferred: one of Bevy's irradiance
//! volumes, which only that camera sees.

use std::any::TypeId;
use std::sync::{Arc, Mutex, PoisonError};

use bevy::asset::RenderAssetUsages;
use bevy::camera::Exposure;
use bevy::camera::visibility::{RenderLayers, VisibleEntities};
use bevy::core_pipeline::core_3d::{AlphaMask3d, Opaque3d, Transparent3d};
use bevy::ecs::entity::EntityHashSet;
use bevy::image::ImageSampler;
use bevy::light::cluster::ClusterVisibilityClass;
use bevy::light::{EnvironmentMapLight, FogVolume, IrradianceVolume, VolumetricFog};
use bevy::pbr::Transmissive3d;
use bevy::prelude::*;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::render_phase::{ViewBinnedRenderPhases, ViewSortedRenderPhases};
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;

use crate::gi::settings::{FrugalGi, GiOutput};
use crate::gi::view::{ActiveGi, ForwardVolume};

/// Places along each axis: powers of two.
pub(in crate::gi) const PLACES: UVec3 = UVec3::new(32, 16, 32);

/// Least and most distance between places, metres.
const SPACINGS: [f32; 2] = [0.01, 100.0];

/// Cameras that have drawn meshes that are not deferred, or fog. Shared by both worlds: of meshes the
/// renderer knows it, whatever the materials are.
#[derive(Resource, Clone, Default)]
pub(super) struct ForwardDrawn(Arc<Mutex<EntityHashSet>>);

/// A camera's volume. In both worlds.
#[derive(Component, ExtractComponent, Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct ForwardCamera {
    volume: Entity,
    /// What Bevy samples.
    pub image: AssetId<Image>,
    /// The place with the least coordinates, in steps of `spacing` from the world's origin.
    pub base: IVec3,
    /// Metres.
    pub spacing: f32,
}

/// Notes which cameras draw meshes that are not deferred.
pub(super) fn note_drawn(
    drawn: Res<ForwardDrawn>,
    views: Query<(&MainEntity, &ExtractedView), With<FrugalGi>>,
    opaque: Res<ViewBinnedRenderPhases<Opaque3d>>,
    masked: Res<ViewBinnedRenderPhases<AlphaMask3d>>,
    transmissive: Res<ViewSortedRenderPhases<Transmissive3d>>,
    transparent: Res<ViewSortedRenderPhases<Transparent3d>>,
) {
    for (camera, view) in &views {
        let key = &view.retained_view_entity;
        let draws = opaque.get(key).is_some_and(|phase| !phase.is_empty())
            || masked.get(key).is_some_and(|phase| !phase.is_empty())
            || transmissive.get(key).is_some_and(|phase| !phase.items.is_empty())
            || transparent.get(key).is_some_and(|phase| !phase.items.is_empty());
        if draws {
            drawn.0.lock().unwrap_or_else(PoisonError::into_inner).insert(camera.id());
        }
    }
}

/// Gives cameras that draw such meshes, or fog volumes, a volume, which follows them from place to
/// place. It stays while GI is off for a while: Bevy compiles pipelines anew for views with a volume.
pub(super) fn place(
    mut commands: Commands,
    drawn: Res<ForwardDrawn>,
    mut images: ResMut<Assets<Image>>,
    mut cameras: Query<(
        Entity,
        &ActiveGi,
        &GlobalTransform,
        &Exposure,
        Option<&RenderLayers>,
        (Has<VolumetricFog>, Has<EnvironmentMapLight>),
        Option<&mut ForwardCamera>,
    )>,
    fogs: Query<(), With<FogVolume>>,
    mut volumes: Query<
        (&mut Transform, &mut GlobalTransform, &mut IrradianceVolume, &mut RenderLayers),
        (With<ForwardVolume>, Without<ActiveGi>),
    >,
) {
    let mut drawn = drawn.0.lock().unwrap_or_else(PoisonError::into_inner);
    for (camera, gi, transform, exposure, layers, (has_fog, has_sky), held) in &mut cameras {
        if gi.fog && has_fog && !fogs.is_empty() {
            drawn.insert(camera);
        }
        let is_wanted = drawn.contains(&camera)
            && gi.forward_spacing.is_finite()
            && gi.forward_spacing > 0.0
            && gi.output != GiOutput::MapsOnly
            && !gi.irradiance_volumes;
        if !is_wanted {
            if held.is_some() {
                commands.entity(camera).remove::<ForwardCamera>();
            }
            continue;
        }
        let spacing = gi.forward_spacing.clamp(SPACINGS[0], SPACINGS[1]);
        // Beyond, 32 bits do not tell neighbouring places apart.
        let middle = (transform.translation() / spacing).floor();
        let base = middle.clamp(Vec3::splat(-1e7), Vec3::splat(1e7)).as_ivec3() - half();
        let place = Transform::from_translation((base + half()).as_vec3() * spacing)
            .with_scale(PLACES.as_vec3() * spacing);
        // Where Bevy sees a volume, it leaves out the sky's light, which would be missing while this
        // fades.
        let share = if has_sky { 1.0 } else { gi.share() };
        // Its light is exposed, so that half floats hold any scene.
        let intensity = share / exposure.exposure();
        let layers = layers.cloned().unwrap_or_default();
        match held {
            Some(mut held) => {
                held.set_if_neq(ForwardCamera { base, spacing, ..*held });
                let Ok((mut own, mut global, mut light, mut shown)) = volumes.get_mut(held.volume)
                else {
                    commands.entity(camera).remove::<ForwardCamera>();
                    continue;
                };
                own.set_if_neq(place);
                global.set_if_neq(place.into());
                shown.set_if_neq(layers);
                light.intensity = intensity;
            }
            None => {
                let voxels = images.add(blank_image());
                let image = voxels.id();
                let light =
                    IrradianceVolume { voxels, intensity, affects_lightmapped_meshes: true };
                let parts = (ForwardVolume, LightProbe::default(), light, layers);
                let volume = commands.spawn((parts, place, GlobalTransform::from(place))).id();
                commands.entity(camera).insert(ForwardCamera { volume, image, base, spacing });
            }
        }
    }
}

/// From the first place to the one at the camera.
fn half() -> IVec3 {
    PLACES.as_ivec3() / 2
}

/// Six faces of each place: two along the height, three along the depth.
fn blank_image() -> Image {
    let (width, height, depth_or_array_layers) = (PLACES.x, PLACES.y * 2, PLACES.z * 3);
    let mut image = Image::new_fill(
        Extent3d { width, height, depth_or_array_layers },
        TextureDimension::D3,
        &[0; 8],
        TextureFormat::Rgba16Float,
        RenderAssetUsages::RENDER_WORLD,
    );
    image.texture_descriptor.usage |= TextureUsages::STORAGE_BINDING;
    image.sampler = ImageSampler::linear();
    image
}

/// A volume goes with its camera.
pub(super) fn despawn(
    removed: On<Remove, ForwardCamera>,
    mut commands: Commands,
    cameras: Query<&ForwardCamera>,
) {
    if let Ok(camera) = cameras.get(removed.entity) {
        commands.entity(camera.volume).try_despawn();
    }
}

/// Takes volumes from the lists of cameras that they are not for: those of other cameras, and, where a
/// camera has one and gathers, the app's own, whose light would count twice.
pub(super) fn show_to_its_camera(
    mut cameras: Query<(&mut VisibleEntities, Option<(&ActiveGi, &ForwardCamera)>), With<Camera>>,
    ours: Query<(), With<ForwardVolume>>,
    all: Query<(), With<IrradianceVolume>>,
) {
    if ours.is_empty() {
        return;
    }
    for (mut visible, camera) in &mut cameras {
        let own = camera.filter(|(gi, _)| gi.traces()).map(|(_, camera)| camera.volume);
        let Some(probes) = visible.entities.get_mut(&TypeId::of::<ClusterVisibilityClass>()) else {
            continue;
        };
        probes.retain(|probe| match own {
            Some(own) => *probe == own || !all.contains(*probe),
            None => !ours.contains(*probe),
        });
    }
}
