//! Removes Bevy's own diffuse light of an environment map from cameras whose sky is gathered. It
//! would count twice, and once without shadows.
//!
//! Bevy puts the map of each view into the list of light probes that it binds. There, and only for
//! these views, a black cube replaces the diffuse map; the app's component, the specular map, other
//! views and other probes stay as they are. Two terms are lost with it: the diffuse light of meshes
//! that are not deferred and out of reach of [`forward`](crate::gi::forward), and the multiple
//! scattering of rough metals, which Bevy reads from the same map.

use bevy::asset::AssetId;
use bevy::asset::uuid::Uuid;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::EnvironmentMapLight;
use bevy::pbr::RenderViewLightProbes;
use bevy::platform::collections::HashMap;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;

use super::camera::SkyCamera;
use crate::gi::view::SkySource;

/// Black cubes by the map that each replaces: the same texture, but each with that map's sampler,
/// since Bevy samples the specular map with it, too. Those of maps that no camera has any more are
/// dropped.
#[derive(Resource, Default)]
pub(super) struct BlackCubes {
    texture: Option<Texture>,
    names: HashMap<AssetId<Image>, AssetId<Image>>,
}

pub(super) fn take_out_diffuse(
    mut cubes: ResMut<BlackCubes>,
    mut images: ResMut<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<(&SkyCamera, &SkySource, &mut RenderViewLightProbes<EnvironmentMapLight>)>,
) {
    let BlackCubes { texture, names } = &mut *cubes;
    names.retain(|replaced, name| {
        let is_used = views.iter().any(|(_, source, _)| source.diffuse == *replaced);
        if !is_used {
            images.remove(*name);
        }
        is_used
    });
    for (camera, source, mut probes) in &mut views {
        if !camera.is_active {
            continue;
        }
        let Some(ids) = probes
            .binding_index_to_textures
            .iter_mut()
            .find(|ids| ids.diffuse == source.diffuse && ids.specular == source.specular)
        else {
            continue;
        };
        let Some(replaced) = images.get(source.diffuse) else { continue };
        let texture = texture.get_or_insert_with(|| black_cube(&device, &queue));
        let sampler = replaced.sampler.clone();
        let new = || AssetId::Uuid { uuid: Uuid::new_v4() };
        let name = *names.entry(source.diffuse).or_insert_with(new);
        // The map may have been reloaded.
        if images.get(name).is_none_or(|old| old.sampler.id() != sampler.id()) {
            let black = GpuImage {
                texture_view: texture.create_view(&TextureViewDescriptor {
                    dimension: Some(TextureViewDimension::Cube),
                    ..Default::default()
                }),
                texture: texture.clone(),
                sampler,
                texture_descriptor: DESCRIPTOR,
                texture_view_descriptor: None,
                had_data: true,
            };
            images.insert(name, black);
        }
        ids.diffuse = name;
    }
}

const DESCRIPTOR: TextureDescriptor<'static> = TextureDescriptor {
    label: Some("frugal_gi/sky/black"),
    size: Extent3d { width: 1, height: 1, depth_or_array_layers: 6 },
    mip_level_count: 1,
    sample_count: 1,
    dimension: TextureDimension::D2,
    format: TextureFormat::Rgba8Unorm,
    usage: TextureUsages::TEXTURE_BINDING.union(TextureUsages::COPY_DST),
    view_formats: &[],
};

fn black_cube(device: &RenderDevice, queue: &RenderQueue) -> Texture {
    device.create_texture_with_data(queue, &DESCRIPTOR, TextureDataOrder::default(), &[0; 6 * 4])
}
