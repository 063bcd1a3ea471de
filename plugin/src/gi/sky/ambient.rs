//! Removes Bevy's own diffuse light of an environment map from cameras whose sky is gathered. It
//! would count twice, and once without shadows.
//!
//! Bevy puts the map of each view into the list of light probes that it binds. There, and only for
//! these views, another cube replaces the diffuse map: a black one, or while GI comes or goes a dimmed
//! copy. The app's component, the specular map, other views and other probes stay as they are. Two terms
//! are lost with it: the diffuse light of meshes that are not deferred and out of reach of
//! [`forward`](crate::gi::forward), and the multiple scattering of rough metals, which Bevy reads from
//! the same map.

use bevy::asset::AssetId;
use bevy::asset::uuid::Uuid;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::EnvironmentMapLight;
use bevy::pbr::RenderViewLightProbes;
use bevy::platform::collections::HashMap;
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderDevice, RenderQueue, ViewQuery};
use bevy::render::texture::GpuImage;
use bevy::utils::default;

use super::camera::{SkyCamera, SkyKernels};
use super::faces;
use crate::gi::compute::{compute_pass, empty_buffer};
use crate::gi::view::{GiShare, SkySource};

/// Most texels along an edge of a dimmed copy.
const MAX_EDGE: u32 = 64;

/// What replaces diffuse maps. What no camera has any more is dropped.
#[derive(Resource, Default)]
pub(in crate::gi) struct Cubes {
    black: Option<Texture>,
    /// Black cubes by the map that each replaces: the same texture, but each with that map's sampler,
    /// since Bevy samples the specular map with it, too.
    names: HashMap<AssetId<Image>, AssetId<Image>>,
    dimmed: EntityHashMap<Dimmed>,
}

/// A dimmed copy of a view's diffuse map.
struct Dimmed {
    name: AssetId<Image>,
    texture: Texture,
    /// Share of the map's light that is left.
    share: Buffer,
    replaced: TextureId,
}

type SkyViews = (
    Entity,
    &'static SkyCamera,
    &'static SkySource,
    &'static GiShare,
    &'static mut RenderViewLightProbes<EnvironmentMapLight>,
);

pub(in crate::gi) fn take_out_diffuse(
    mut cubes: ResMut<Cubes>,
    mut images: ResMut<RenderAssets<GpuImage>>,
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    mut views: Query<SkyViews>,
) {
    let Cubes { black, names, dimmed } = &mut *cubes;
    names.retain(|replaced, name| {
        let is_used = views.iter().any(|(_, _, source, ..)| source.diffuse == *replaced);
        if !is_used {
            images.remove(*name);
        }
        is_used
    });
    dimmed.retain(|view, copy| {
        let is_used = views.get(*view).is_ok_and(|(_, camera, source, share, _)| {
            let replaced = images.get(source.diffuse).map(|image| image.texture.id());
            camera.is_active && share.0 < 1.0 && replaced == Some(copy.replaced)
        });
        if !is_used {
            images.remove(copy.name);
        }
        is_used
    });
    for (view, camera, source, share, mut probes) in &mut views {
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
        let (id, sampler) = (replaced.texture.id(), replaced.sampler.clone());
        let new = || AssetId::Uuid { uuid: Uuid::new_v4() };
        if share.0 >= 1.0 {
            let texture = black.get_or_insert_with(|| {
                device.create_texture_with_data(&queue, &BLACK, default(), &[0; 6 * 4])
            });
            let name = *names.entry(source.diffuse).or_insert_with(new);
            // The map may have been reloaded.
            if images.get(name).is_none_or(|old| old.sampler.id() != sampler.id()) {
                images.insert(name, cube(texture, BLACK, sampler));
            }
            ids.diffuse = name;
            continue;
        }
        let edge = replaced.texture_descriptor.size.width.clamp(1, MAX_EDGE);
        let copy = dimmed.entry(view).or_insert_with(|| {
            let size = Extent3d { width: edge, height: edge, depth_or_array_layers: 6 };
            let descriptor = TextureDescriptor { size, ..DIMMED };
            let texture = device.create_texture(&descriptor);
            let name = new();
            images.insert(name, cube(&texture, descriptor, sampler));
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            let share = empty_buffer(&device, "frugal_gi/sky/share", 16, usage);
            Dimmed { name, texture, share, replaced: id }
        });
        let left = [1.0 - share.0, 0.0, 0.0, 0.0];
        queue.write_buffer(&copy.share, 0, bytemuck::cast_slice(&left));
        ids.diffuse = copy.name;
    }
}

/// In a GI camera's view: fills its dimmed copy.
pub(super) fn dim(
    view: ViewQuery<(Entity, &SkySource)>,
    cubes: Res<Cubes>,
    kernels: Res<SkyKernels>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (view, source) = view.into_inner();
    let (Some(copy), Some(image)) = (cubes.dimmed.get(&view), images.get(source.diffuse)) else {
        return;
    };
    let Some(pipeline) = kernels.dim.get(&cache, &[]) else { return };
    let (from, to) = (faces(&image.texture), faces(&copy.texture));
    let entries = BindGroupEntries::sequential((&from, copy.share.as_entire_binding(), &to));
    let bindings = kernels.dim.bind(&context, &cache, &entries);
    let groups = copy.texture.width().div_ceil(8);
    compute_pass(&mut context, "frugal_gi/sky", &[], |pass| {
        pass.set_bind_group(0, &bindings, &[]);
        pass.set_pipeline(pipeline);
        pass.dispatch_workgroups(groups, groups, 6);
    });
}

type CubeDescriptor = TextureDescriptor<'static>;

fn cube(texture: &Texture, texture_descriptor: CubeDescriptor, sampler: Sampler) -> GpuImage {
    GpuImage {
        texture_view: texture.create_view(&TextureViewDescriptor {
            dimension: Some(TextureViewDimension::Cube),
            ..default()
        }),
        texture: texture.clone(),
        sampler,
        texture_descriptor,
        texture_view_descriptor: None,
        had_data: true,
    }
}

const BLACK: CubeDescriptor = TextureDescriptor {
    label: Some("frugal_gi/sky/black"),
    size: Extent3d { width: 1, height: 1, depth_or_array_layers: 6 },
    mip_level_count: 1,
    sample_count: 1,
    dimension: TextureDimension::D2,
    format: TextureFormat::Rgba8Unorm,
    usage: TextureUsages::TEXTURE_BINDING.union(TextureUsages::COPY_DST),
    view_formats: &[],
};

const DIMMED: CubeDescriptor = TextureDescriptor {
    label: Some("frugal_gi/sky/dimmed"),
    format: TextureFormat::Rgba16Float,
    usage: TextureUsages::TEXTURE_BINDING.union(TextureUsages::STORAGE_BINDING),
    ..BLACK
};
