//! Copies of textures that the CPU cannot read, because they are compressed or kept for the GPU
//! alone: the GPU averages each of them once into a small image, which is read back.
//!
//! | step | world |
//! |---|---|
//! | a surface asks for a texture ([`Textures::get`]) and waits, as for one that is still loading | main |
//! | `ask` spawns a [`CopyRequest`] with a buffer | main |
//! | `copy.wgsl` averages the texture into the buffer | render |
//! | `receive` keeps the image, and the surface finds it | main |

use std::sync::{Mutex, PoisonError};

use bevy::app::{App, PostUpdate};
use bevy::asset::{
    AssetId, Assets, Handle, RenderAssetUsages, embedded_asset, load_embedded_asset,
};
use bevy::core_pipeline::schedule::camera_driver;
use bevy::ecs::prelude::*;
use bevy::image::Image;
use bevy::math::UVec2;
use bevy::platform::collections::{HashMap, HashSet};
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::binding_types::{texture_2d, uniform_buffer_sized};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderContext, RenderGraph};
use bevy::render::storage::{GpuShaderBuffer, ShaderBuffer};
use bevy::render::texture::GpuImage;
use bevy::render::{GpuResourceAppExt, RenderApp};

use super::{MeshChanges, note_changes};
use crate::gi::compute::{Kernel, compute_pass, filled_buffer, write};
use crate::gi::schedule::SceneSystems;

/// Most texels along a side of a copy. Emission and reflectance are averaged over surfaces, which
/// hides finer ones; holes of masks are as fine as they are (`docs/limits.md`).
const MAX_SIDE: u32 = 128;
/// Copies on their way at once: at most 0.5 MiB are read back in a frame.
const MAX_REQUESTS: usize = 4;
/// Frames after which a texture is given up. Its pipeline compiles, and the texture itself loads,
/// within far fewer.
const PATIENCE_FRAMES: u32 = 600;
/// Bytes of a texel: four half floats.
const TEXEL_BYTES: usize = 8;

/// Textures that are read by the GPU for the CPU: those of surfaces that emit, reflect or occlude
/// indirect light, where they are compressed or kept for the GPU alone.
#[derive(Resource, Debug, Default)]
pub struct GiTextureCopies {
    /// `None` where a texture cannot be copied.
    copies: HashMap<AssetId<Image>, Option<Image>>,
    /// Asked for since the last frame: surfaces ask again in every frame until they have it. They
    /// are read in parallel.
    wanted: Mutex<HashSet<AssetId<Image>>>,
    /// On their way.
    requested: HashMap<AssetId<Image>, Entity>,
    /// Whether there is a renderer to make copies.
    has_renderer: bool,
}

impl GiTextureCopies {
    /// Number of textures whose copy is awaited. Surfaces that use them are dark, and let light
    /// pass, until it is there.
    pub fn waiting(&self) -> usize {
        let wanted = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        wanted.iter().filter(|id| self.is_new(**id)).count() + self.requested.len()
    }

    /// Whether the image is neither copied nor on its way.
    fn is_new(&self, image: AssetId<Image>) -> bool {
        !self.copies.contains_key(&image) && !self.requested.contains_key(&image)
    }

    fn forget(&mut self, image: AssetId<Image>, commands: &mut Commands) {
        self.copies.remove(&image);
        if let Some(request) = self.requested.remove(&image) {
            commands.entity(request).despawn();
        }
    }
}

/// The images of an app as surfaces read them.
#[derive(Clone, Copy)]
pub(in crate::gi) struct Textures<'a> {
    /// `None` in an app without images.
    pub images: Option<&'a Assets<Image>>,
    pub copies: &'a GiTextureCopies,
}

impl<'a> Textures<'a> {
    /// The image, or its copy. `None` while it is not loaded or its copy is on the way; an image
    /// that cannot be read where it cannot be copied, either.
    pub(crate) fn get(self, id: AssetId<Image>) -> Option<&'a Image> {
        let image = self.images?.get(id)?;
        if is_readable(image) || !self.copies.has_renderer {
            return Some(image);
        }
        match self.copies.copies.get(&id) {
            Some(copy) => Some(copy.as_ref().unwrap_or(image)),
            None => {
                let mut wanted = self.copies.wanted.lock().unwrap_or_else(PoisonError::into_inner);
                wanted.insert(id);
                None
            }
        }
    }
}

/// Whether the CPU can read an image: it is not kept for the GPU alone, and not compressed.
pub(super) fn is_readable(image: &Image) -> bool {
    image.get_color_at(0, 0).is_ok()
}

/// A texture on its way to the CPU.
#[derive(Component, ExtractComponent, Clone, Debug)]
struct CopyRequest {
    image: AssetId<Image>,
    /// The copy's texels, row by row, and behind them 1 once they are written.
    buffer: Handle<ShaderBuffer>,
    size: UVec2,
    frames: u32,
}

pub(super) fn build(app: &mut App) {
    embedded_asset!(app, "copy.wgsl");
    app.init_resource::<GiTextureCopies>()
        .add_plugins(ExtractComponentPlugin::<CopyRequest>::default())
        // Before surfaces are read, so that they find no copy of an image that changed.
        .add_systems(PostUpdate, ask.in_set(SceneSystems::Changes).after(note_changes));
}

pub(in crate::gi) fn finish(app: &mut App) {
    app.sub_app_mut(RenderApp)
        .init_gpu_resource::<CopyKernel>()
        .add_systems(RenderGraph, copy.before(camera_driver));
    app.world_mut().resource_mut::<GiTextureCopies>().has_renderer = true;
}

/// Forgets copies of images that changed, and requests those that surfaces asked for.
fn ask(
    mut copies: ResMut<GiTextureCopies>,
    mut requests: Query<&mut CopyRequest>,
    changes: Res<MeshChanges>,
    (images, buffers): (Option<Res<Assets<Image>>>, Option<ResMut<Assets<ShaderBuffer>>>),
    mut commands: Commands,
) {
    let copies = &mut *copies;
    // A copy that cannot be had now may be later: an image that is replaced counts as changed.
    for image in &changes.images {
        copies.forget(*image, &mut commands);
    }
    // An app may clear its level with all that it does not know.
    copies.requested.retain(|_, request| requests.contains(*request));
    for mut request in &mut requests {
        request.frames += 1;
        if request.frames > PATIENCE_FRAMES {
            copies.forget(request.image, &mut commands);
            copies.copies.insert(request.image, None);
        }
    }
    let wanted = copies.wanted.get_mut().unwrap_or_else(PoisonError::into_inner);
    let mut wanted: Vec<_> = wanted.drain().collect();
    wanted.retain(|id| copies.is_new(*id));
    // The same order in every run. The others are asked for again.
    wanted.sort_unstable();
    wanted.truncate(MAX_REQUESTS.saturating_sub(copies.requested.len()));
    let (Some(images), Some(mut buffers)) = (images, buffers) else { return };
    for id in wanted {
        let Some(image) = images.get(id) else { continue };
        if !is_sampled(image) {
            copies.copies.insert(id, None);
            continue;
        }
        let size = image.size().max(UVec2::ONE).min(UVec2::splat(MAX_SIDE));
        let bytes = (size.element_product() as usize + 1) * TEXEL_BYTES;
        let buffer = buffers.add(ShaderBuffer::with_size(bytes, RenderAssetUsages::RENDER_WORLD));
        let readback = Readback::buffer(buffer.clone());
        let request = CopyRequest { image: id, buffer, size, frames: 0 };
        let entity = commands.spawn((request, readback)).observe(receive).id();
        copies.requested.insert(id, entity);
    }
}

/// Whether a shader can read the image as one plane of colours.
fn is_sampled(image: &Image) -> bool {
    let texture = &image.texture_descriptor;
    let view = image.texture_view_descriptor.as_ref().and_then(|view| view.dimension);
    matches!(texture.format.sample_type(None, None), Some(TextureSampleType::Float { .. }))
        && texture.dimension == TextureDimension::D2
        && texture.size.depth_or_array_layers == 1
        && texture.sample_count == 1
        && view.is_none_or(|view| view == TextureViewDimension::D2)
}

/// Keeps a copy that has arrived.
fn receive(
    read: On<ReadbackComplete>,
    requests: Query<&CopyRequest>,
    mut copies: ResMut<GiTextureCopies>,
    mut commands: Commands,
) {
    let Ok(request) = requests.get(read.entity) else { return };
    let texels = request.size.element_product() as usize * TEXEL_BYTES;
    // Not written yet: the pipeline compiles, or the texture loads.
    if read.data.len() < texels + TEXEL_BYTES || read.data[texels] == 0 {
        return;
    }
    // Of a request that is still meant: its image did not change.
    if copies.requested.remove(&request.image).is_some() {
        let UVec2 { x: width, y: height } = request.size;
        // Linear, whatever the texture's colour space: the GPU has converted it.
        let copy = Image::new(
            Extent3d { width, height, depth_or_array_layers: 1 },
            TextureDimension::D2,
            read.data[..texels].to_vec(),
            TextureFormat::Rgba16Float,
            RenderAssetUsages::MAIN_WORLD,
        );
        copies.copies.insert(request.image, Some(copy));
    }
    commands.entity(read.entity).despawn();
}

/// Threads along a side of a workgroup of `copy.wgsl`.
const GROUP: u32 = 8;

/// Its pipeline is queued with the first request.
#[derive(Resource)]
struct CopyKernel(Kernel);

impl FromWorld for CopyKernel {
    fn from_world(world: &mut World) -> Self {
        let entries = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Float { filterable: false }),
                write(),
                uniform_buffer_sized(false, None),
            ),
        );
        let shader = load_embedded_asset!(world, "copy.wgsl");
        Self(Kernel::new("frugal_gi/surfaces/copy", "copy_texture", &shader, &entries))
    }
}

/// Writes every requested copy whose texture is there.
fn copy(
    requests: Query<&CopyRequest>,
    mut kernel: ResMut<CopyKernel>,
    images: Res<RenderAssets<GpuImage>>,
    buffers: Res<RenderAssets<GpuShaderBuffer>>,
    cache: Res<PipelineCache>,
    mut context: RenderContext,
) {
    if requests.is_empty() {
        return;
    }
    kernel.0.queue(&cache, Vec::new());
    let Some(pipeline) = kernel.0.get(&cache, &[]) else { return };
    for request in &requests {
        let (Some(image), Some(buffer)) = (images.get(request.image), buffers.get(&request.buffer))
        else {
            continue;
        };
        let size = filled_buffer(
            context.render_device(),
            "frugal_gi/surfaces/copy",
            bytemuck::cast_slice(&request.size.to_array()),
            BufferUsages::UNIFORM,
        );
        let entries = BindGroupEntries::sequential((
            &image.texture_view,
            buffer.buffer.as_entire_binding(),
            size.as_entire_binding(),
        ));
        let bindings = kernel.0.bind(&context, &cache, &entries);
        compute_pass(&mut context, "frugal_gi/copy", &[], |pass| {
            pass.set_bind_group(0, &bindings, &[]);
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(
                request.size.x.div_ceil(GROUP),
                request.size.y.div_ceil(GROUP),
                1,
            );
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_whose_request_an_app_despawned_is_asked_for_again() {
        let mut world = World::new();
        let (gone, image) = (world.spawn_empty().id(), AssetId::default());
        let mut copies = GiTextureCopies::default();
        copies.requested.insert(image, gone);
        world.init_resource::<MeshChanges>();
        world.insert_resource(copies);
        world.run_system_cached(ask).expect("a system");
        assert!(world.resource::<GiTextureCopies>().is_new(image));
    }
}
