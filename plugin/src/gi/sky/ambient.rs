//! Removes Bevy's own diffuse light of an environment map from cameras whose sky is gathered. It
//! would count twice, and once without shadows.
//!
//! Bevy puts the map of each view into the list of light probes that it binds. There, and only for
//! these views, a dimmed copy replaces the diffuse map: black, but while GI comes or goes. The app's
//! component, the specular map, other views and other probes stay as they are. Two terms are lost with it:
//! the diffuse light of meshes that are not deferred and out of reach of
//! [`forward`](crate::gi::forward), and the multiple scattering of rough metals, which Bevy reads from
//! the same map.

use bevy::asset::AssetId;
use bevy::asset::uuid::Uuid;
use bevy::ecs::entity::EntityHashMap;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::light::EnvironmentMapLight;
use bevy::pbr::RenderViewLightProbes;
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

/// What replaces the diffuse maps of views. What no camera has any more is dropped.
#[derive(Resource, Default)]
pub(in crate::gi) struct Cubes(EntityHashMap<Dimmed>);

/// A dimmed copy of a view's diffuse map.
struct Dimmed {
    name: AssetId<Image>,
    texture: Texture,
    replaced: TextureId,
    /// Share of the map's light that is left.
    left: f32,
    /// The same on the GPU.
    share: Buffer,
    /// Whether it changed in this frame.
    is_due: bool,
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
    cubes.0.retain(|view, copy| {
        let is_used = views.get(*view).is_ok_and(|(_, camera, source, ..)| {
            let replaced = images.get(source.diffuse).map(|image| image.texture.id());
            camera.is_active && replaced == Some(copy.replaced)
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
        // Bevy samples the specular map with this sampler, too.
        let (id, sampler) = (replaced.texture.id(), replaced.sampler.clone());
        let edge = replaced.texture_descriptor.size.width.clamp(1, MAX_EDGE);
        let copy = cubes.0.entry(view).or_insert_with(|| {
            let size = Extent3d { width: edge, height: edge, depth_or_array_layers: 6 };
            let descriptor = TextureDescriptor { size, ..DIMMED };
            // Black at first.
            let texture = device.create_texture(&descriptor);
            let name = AssetId::Uuid { uuid: Uuid::new_v4() };
            images.insert(name, cube(&texture, descriptor, sampler));
            let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
            let share = empty_buffer(&device, "frugal_gi/sky/share", 16, usage);
            Dimmed { name, texture, replaced: id, left: 0.0, share, is_due: false }
        });
        let left = 1.0 - share.0;
        copy.is_due = std::mem::replace(&mut copy.left, left) != left;
        queue.write_buffer(&copy.share, 0, bytemuck::cast_slice(&[left, 0.0, 0.0, 0.0]));
        ids.diffuse = copy.name;
    }
}

/// In a GI camera's view: fills its dimmed copy, where another share of the light is left.
pub(super) fn dim(
    view: ViewQuery<(Entity, &SkySource)>,
    cubes: Res<Cubes>,
    kernels: Res<SkyKernels>,
    images: Res<RenderAssets<GpuImage>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    let (view, source) = view.into_inner();
    let copy = cubes.0.get(&view).filter(|copy| copy.is_due);
    let (Some(copy), Some(image)) = (copy, images.get(source.diffuse)) else { return };
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

const DIMMED: CubeDescriptor = TextureDescriptor {
    label: Some("frugal_gi/sky/dimmed"),
    size: Extent3d { width: 1, height: 1, depth_or_array_layers: 6 },
    mip_level_count: 1,
    sample_count: 1,
    dimension: TextureDimension::D2,
    format: TextureFormat::Rgba16Float,
    usage: TextureUsages::TEXTURE_BINDING.union(TextureUsages::STORAGE_BINDING),
    view_formats: &[],
};
