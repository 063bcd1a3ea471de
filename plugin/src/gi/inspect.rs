//! What global illumination holds on the GPU, for tests and debuggers.

use bevy::ecs::prelude::*;
use bevy::render::render_resource::{Buffer, ShaderSize, Texture};
use bevy::render::sync_world::MainEntity;

use super::gather::{GatherSettings, GiCamera, VplPlan};
use super::rsm::{RsmLight, RsmStore, TEXEL_BYTES};
use super::vpl::{MapRow, RECEIVER_BYTES, VPL_BYTES};

/// Bytes that the plugin counts with for the shaders' structs: name, and size of one in a buffer.
pub const STRUCT_BYTES: [(&str, u64); 10] = [
    ("Texel", TEXEL_BYTES),
    ("Vpl", VPL_BYTES),
    super::visibility::STRUCT_BYTES[0],
    super::visibility::STRUCT_BYTES[1],
    super::visibility::STRUCT_BYTES[2],
    ("Receiver", RECEIVER_BYTES),
    ("Plan", size_of::<VplPlan>() as u64),
    ("Gather", size_of::<GatherSettings>() as u64),
    ("Row", size_of::<MapRow>() as u64),
    ("Light", <RsmLight as ShaderSize>::SHADER_SIZE.get()),
];

/// The buffers of the last frame. Handles, not copies: the GPU goes on writing them.
#[derive(Clone, Debug)]
pub struct GiGpuState {
    /// Texels of every reflective shadow map (`rsm/texel.wgsl`), where there are any.
    pub texels: Option<Buffer>,
    /// Every camera that gathers.
    pub cameras: Vec<GiCameraState>,
}

/// What one camera holds.
#[derive(Clone, Debug)]
pub struct GiCameraState {
    /// The camera in the main world.
    pub camera: Entity,
    /// Its virtual point lights (`vpl/vpl.wgsl`), in sets that each carry all light.
    pub vpls: Buffer,
    /// Sets of VPLs.
    pub sets: u32,
    /// VPLs in each set.
    pub per_set: u32,
    /// VPLs from the beginning of one set to that of the next.
    pub stride: u32,
    /// Irradiance of each gathered pixel, exposed, as it is composited.
    pub irradiance: Texture,
}

/// Looks at a render world.
pub fn gpu_state(render_world: &World) -> GiGpuState {
    let texels = render_world.get_resource::<RsmStore>().and_then(|store| store.texels.clone());
    let cameras = render_world.try_query::<(&MainEntity, &GiCamera)>().map_or_else(Vec::new, |mut cameras| {
        let state = |(main, camera): (&MainEntity, &GiCamera)| GiCameraState {
            camera: main.id(),
            vpls: camera.vpls.clone(),
            sets: camera.plan.sets,
            per_set: camera.plan.per_set,
            stride: camera.plan.stride,
            irradiance: camera.shown().texture.clone(),
        };
        cameras.iter(render_world).map(state).collect()
    });
    GiGpuState { texels, cameras }
}
