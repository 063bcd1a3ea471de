//! GPU state of global illumination, and the cost of its passes: for tests, benchmarks and
//! debuggers.

use bevy::app::App;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::math::{Mat4, Vec3};
use bevy::render::RenderApp;
use bevy::render::extract_resource::{ExtractResource, ExtractResourcePlugin};
use bevy::render::render_resource::{Buffer, ShaderSize, Texture};
use bevy::render::sync_world::MainEntity;
use bevy::render::view::ExtractedView;

use crate::gi::bounces::{self, BounceCamera, Patch};
pub use crate::gi::bounces::{GiBouncesState, GiPatches};
use crate::gi::cache::{self, CELL_BYTES, CacheSettings, CacheView};
pub use crate::gi::emissive::GiEmitters;
use crate::gi::forward::{self, PLACES, PROBE_BYTES, VolumeSettings};
use crate::gi::gather::{self, GatherView};
pub use crate::gi::rsm::RsmView;
use crate::gi::rsm::{self, RsmLight};
use crate::gi::schedule::{GiSystems, PassSystems};
use crate::gi::settings::FrugalGi;
use crate::gi::sky::{self, SKY_LIGHT_BYTES, SkyCamera, SkyReading};
use crate::gi::texels::{TEXEL_BYTES, TILE, TexelRow, TexelStore};
use crate::gi::trace::{self, OccluderBuffers};
use crate::gi::view::clip_from_world;
use crate::gi::vpl::{
    self, IMPORTANCE_POINT_BYTES, IMPORTANCE_POINTS, VPL_BYTES, VplPlan, VplView,
};
use crate::gi::{composite, denoise};

/// Sizes of the shaders' structs that the plugin assumes: name, and bytes of one in a buffer.
pub const STRUCT_BYTES: [(&str, u64); 16] = [
    ("Texel", TEXEL_BYTES),
    ("Vpl", VPL_BYTES),
    trace::STRUCT_BYTES[0],
    trace::STRUCT_BYTES[1],
    trace::STRUCT_BYTES[2],
    ("ImportancePoint", IMPORTANCE_POINT_BYTES),
    ("Patch", size_of::<Patch>() as u64),
    ("Plan", size_of::<VplPlan>() as u64),
    ("Row", size_of::<TexelRow>() as u64),
    ("Light", <RsmLight as ShaderSize>::SHADER_SIZE.get()),
    ("Cell", CELL_BYTES),
    ("Settings", size_of::<CacheSettings>() as u64),
    ("Probe", PROBE_BYTES),
    ("Volume", size_of::<VolumeSettings>() as u64),
    ("SkyLight", SKY_LIGHT_BYTES),
    ("SkySource", size_of::<SkyReading>() as u64),
];

/// Constants of the shaders that the plugin assumes: file below `gi`, name, and value.
pub const SHADER_CONSTANTS: [(&str, &str, u64); 24] = [
    ("texels/texels.wgsl", "TILE", TILE as u64),
    ("vpl/vpl.wgsl", "IMPORTANCE_POINTS", IMPORTANCE_POINTS),
    ("vpl/tile_visibility.wgsl", "GROUP_TILES", vpl::TILE_GROUP[0] as u64),
    ("vpl/tile_visibility.wgsl", "GROUP_ROWS", vpl::TILE_GROUP[1] as u64),
    ("vpl/tile_visibility.wgsl", "POINTS", vpl::TILE_POINTS as u64),
    ("vpl/weigh.wgsl", "MANY", vpl::MANY as u64),
    ("vpl/weigh.wgsl", "BLOCK", vpl::BLOCK as u64),
    ("vpl/weigh.wgsl", "GROUP_COLUMNS", vpl::WEIGH_GROUP[0] as u64),
    ("vpl/weigh.wgsl", "GROUP_ROWS", vpl::WEIGH_GROUP[1] as u64),
    ("vpl/sample.wgsl", "CHUNK", vpl::CHUNK as u64),
    ("trace/trace.wgsl", "STACK", trace::MAX_LEVELS as u64),
    ("sky/sky.wgsl", "SKY_STRATA", sky::STRATA as u64),
    ("sky/sky.wgsl", "SKY_STRATA_PER_RAY", sky::STRATA_PER_GROUP as u64),
    ("sky/sky.wgsl", "SKY_STRIDE", FrugalGi::MAX_ENVIRONMENT_SAMPLES as u64),
    ("sky/fill.wgsl", "STEPS", sky::STEPS as u64),
    ("gather/gather.wgsl", "RAY_WINDOW", denoise::RAY_WINDOW as u64),
    ("forward/light.wgsl", "RAYS", forward::RAYS as u64),
    ("forward/light.wgsl", "LOOKS", forward::LOOKS as u64),
    ("forward/probe.wgsl", "ACROSS", PLACES.x as u64),
    ("forward/probe.wgsl", "UPWARDS", PLACES.y as u64),
    ("bounces/reflect.wgsl", "GROUP_PATCHES", bounces::PATCHES_PER_GROUP as u64),
    ("bounces/reflect.wgsl", "PATCHES", bounces::PATCHES as u64),
    ("bounces/reflect.wgsl", "BOUNCE_VPLS", bounces::BOUNCE_VPLS.per_set as u64),
    ("bounces/reflect.wgsl", "SUM_LANES", bounces::SUM_LANES as u64),
];

/// The buffers of the last frame. Handles, not copies: the GPU keeps writing them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GiGpuState {
    /// Texels of every reflective shadow map, then of emissive surfaces, then of cameras' patches
    /// (`texels/texels.wgsl`), where there are any.
    pub texels: Option<Buffer>,
    /// The occluders, in the order of the bindings of `trace/trace.wgsl`, while a camera traces
    /// rays.
    pub occluders: Option<[Buffer; 4]>,
    /// Every map rendered in the last frame, in the order of its texels. Others keep their texels
    /// in the store.
    pub maps: Vec<GiMapState>,
    /// Every camera that gathers.
    pub cameras: Vec<GiCameraState>,
    /// Number of cameras with buffers for a sky.
    pub skies: usize,
}

/// One reflective shadow map.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct GiMapState {
    /// Its light, the camera that it serves, and its face.
    pub view: RsmView,
    /// Its projection: the middle of texel (x, y) lies at clip position (2 (x + ½) ÷ resolution −
    /// 1, 1 − 2 (y + ½) ÷ resolution) · w.
    pub clip_from_world: Mat4,
    /// Texels along its side.
    pub resolution: u32,
    /// Index of its first texel in [`texels`](GiGpuState::texels); row by row from the top.
    pub texel_offset: u32,
    /// Position of its light, world space, metres; the origin where light is parallel.
    pub light_position: Vec3,
}

/// State of one camera.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct GiCameraState {
    /// The camera in the main world.
    pub camera: Entity,
    /// Its virtual point lights (`vpl/vpl.wgsl`), in sets that each carry the total flux.
    pub vpls: Buffer,
    /// Sets of VPLs.
    pub sets: u32,
    /// VPLs in each set.
    pub per_set: u32,
    /// Irradiance of each low-resolution pixel, exposed, as it is composited.
    pub irradiance: Texture,
    /// Its patches' state, while it has more than one bounce.
    pub bounces: Option<GiBouncesState>,
    /// Its cells of surface (`cache/table.wgsl`), while it keeps light in them: keys, behind them the
    /// number of rays that found cells and that of places that were lit, and the cells.
    pub cache: Option<[Buffer; 2]>,
}

/// The GPU state of a render world.
pub fn gpu_state(render_world: &World) -> GiGpuState {
    let texels = render_world.get_resource::<TexelStore>().and_then(|store| store.texels.clone());
    let occluders = render_world
        .get_resource::<OccluderBuffers>()
        .and_then(|occluders| occluders.buffers().map(|buffers| buffers.map(Buffer::clone)));
    let maps = render_world.try_query::<(&RsmView, &RsmLight, &ExtractedView)>();
    let mut maps: Vec<GiMapState> = maps.map_or_else(Vec::new, |mut maps| {
        let state = |(view, light, extracted): (&RsmView, &RsmLight, &ExtractedView)| GiMapState {
            view: *view,
            clip_from_world: clip_from_world(extracted),
            resolution: light.resolution,
            texel_offset: light.texel_offset,
            light_position: light.position,
        };
        maps.iter(render_world).map(state).collect()
    });
    maps.sort_by_key(|map| map.texel_offset);
    let cameras = render_world.try_query::<(
        &MainEntity,
        &VplView,
        &GatherView,
        Option<&BounceCamera>,
        Option<&CacheView>,
    )>();
    let cameras = cameras.map_or_else(Vec::new, |mut cameras| {
        let cameras = cameras.iter(render_world);
        let states = cameras.map(|(main, vpl, gather, bounces, cache)| GiCameraState {
            camera: main.id(),
            vpls: vpl.vpls.clone(),
            sets: vpl.plan.sets,
            per_set: vpl.plan.per_set,
            irradiance: gather.irradiance.texture.clone(),
            bounces: bounces.map(BounceCamera::state),
            cache: cache.map(|cache| [cache.keys.clone(), cache.cells.clone()]),
        });
        states.collect()
    });
    let skies = render_world
        .try_query::<&SkyCamera>()
        .map_or(0, |mut skies| skies.iter(render_world).count());
    GiGpuState { texels, occluders, maps, cameras, skies }
}

/// Names of the passes in the order of a frame: their spans are `frugal_gi/…` among Bevy's render
/// diagnostics. A system encodes each.
pub const PASSES: [&str; 8] =
    ["rsm", "sky", "bounces", "vpl", "gather", "cache", "denoise", "composite"];

/// The pass of [`PASSES`] that runs twice in a frame. Its cost is the increase of the frame's time, which works
/// on devices without reliable time stamps, too. A repeated composite adds the light twice. A
/// resource of the main world; see [`allow_repeats`].
#[derive(Resource, ExtractResource, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RepeatedPass(pub Option<&'static str>);

/// Adds every pass to the frame a second time, to run when [`RepeatedPass`] names it.
pub fn allow_repeats(app: &mut App) {
    app.init_resource::<RepeatedPass>()
        .add_plugins(ExtractResourcePlugin::<RepeatedPass>::default());
    let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
    let is = |pass: &'static str| {
        move |repeated: Option<Res<RepeatedPass>>| {
            repeated.is_some_and(|repeated| repeated.0 == Some(pass))
        }
    };
    render_app.add_systems(
        Core3d,
        (
            rsm::resolve.in_set(GiSystems::Resolve).run_if(is("rsm")),
            sky::sample.in_set(PassSystems::Sky).run_if(is("sky")),
            bounces::reflect.in_set(PassSystems::Bounces).run_if(is("bounces")),
            vpl::sample.in_set(PassSystems::Vpl).run_if(is("vpl")),
            gather::gather.in_set(PassSystems::Gather).run_if(is("gather")),
            cache::resolve.in_set(PassSystems::Cache).run_if(is("cache")),
            denoise::denoise.in_set(PassSystems::Denoise).run_if(is("denoise")),
            composite::composite.in_set(GiSystems::Composite).run_if(is("composite")),
        ),
    );
}
