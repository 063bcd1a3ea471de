//! Devices that lack what global illumination needs: it stays off, and costs nothing.

use bevy::DefaultPlugins;
use bevy::app::{App, PluginGroup, TerminalCtrlCHandlerPlugin};
use bevy::asset::Assets;
use bevy::camera::RenderTarget;
use bevy::color::LinearRgba;
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::light::{DirectionalLight, FogVolume, VolumetricFog};
use bevy::log::LogPlugin;
use bevy::math::UVec2;
use bevy::mesh::{Mesh, Mesh3d};
use bevy::pbr::{MeshMaterial3d, StandardMaterial};
use bevy::prelude::Cuboid;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::render_resource::{
    BindingType, BufferBindingType, PipelineCache, PipelineDescriptor, ShaderStages,
};
use bevy::render::settings::{WgpuLimits, WgpuSettings};
use bevy::render::{RenderApp, RenderPlugin};
use bevy::transform::components::Transform;
use bevy::window::{ExitCondition, WindowPlugin};
use bevy::winit::WinitPlugin;
use bevy_frugal_gi::FrugalGiPlugins;
use bevy_frugal_gi::gi::inspect::GiEmitters;
use bevy_frugal_gi::gi::{FrugalGi, GiCounts, GiOccluders, GiPlugin, GiVisibility, RsmView};
use frugal::stage::Stage;
use frugal_tests::set;

tests!(
    a_device_without_enough_storage_buffers_keeps_nothing_up,
    no_pass_needs_more_than_the_required_limits,
);

/// An app on a device with the given limits.
fn app(limits: WgpuLimits) -> App {
    let settings = WgpuSettings { constrained_limits: Some(limits), ..Default::default() };
    let mut app = App::new();
    app.add_plugins(
        DefaultPlugins
            .set(WindowPlugin {
                primary_window: None,
                exit_condition: ExitCondition::DontExit,
                ..Default::default()
            })
            .set(RenderPlugin {
                render_creation: settings.into(),
                synchronous_pipeline_compilation: true,
                ..Default::default()
            })
            .disable::<WinitPlugin>()
            .disable::<LogPlugin>()
            .disable::<TerminalCtrlCHandlerPlugin>()
            .disable::<PipelinedRenderingPlugin>(),
    )
    .add_plugins(FrugalGiPlugins);
    app.finish();
    app.cleanup();
    let world = app.world_mut();
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Cuboid::default());
    let material = world
        .resource_mut::<Assets<StandardMaterial>>()
        .add(StandardMaterial { emissive: LinearRgba::WHITE, ..Default::default() });
    world.spawn((Mesh3d(mesh), MeshMaterial3d(material)));
    world.spawn((DirectionalLight::default(), Transform::default()));
    world.spawn((
        FrugalGi { visibility: GiVisibility::Coarse, ..Default::default() },
        RenderTarget::None { size: UVec2::new(32, 32) },
        Transform::from_xyz(0.0, 0.0, 4.0),
    ));
    (0..4).for_each(|_| app.update());
    app
}

fn a_device_without_enough_storage_buffers_keeps_nothing_up() {
    let kept = |limits: WgpuLimits| {
        let mut app = app(limits);
        let counts = app.sub_app(RenderApp).world().get_resource::<GiCounts>().copied();
        let world = app.world_mut();
        (
            world.query_filtered::<Entity, With<RsmView>>().iter(world).count(),
            world.resource::<GiOccluders>().instance_count(),
            world.resource::<GiEmitters>().texel_count() > 0,
            counts.unwrap_or_default() != GiCounts::default(),
        )
    };
    let with_buffers =
        |count| WgpuLimits { max_storage_buffers_per_shader_stage: count, ..Default::default() };
    assert_eq!(kept(with_buffers(u32::MAX)), (1, 1, true, true));
    assert_eq!(kept(with_buffers(4)), (0, 0, false, false));
}

/// Largest numbers of storage buffers and of storage textures in a stage of a pipeline, and the
/// pipeline's name.
fn most_bound(stage: &Stage) -> [(u32, String); 2] {
    let mut most = [(0, String::new()), (0, String::new())];
    for pipeline in stage.render_world().resource::<PipelineCache>().pipelines() {
        let (label, layouts) = match &pipeline.descriptor {
            PipelineDescriptor::RenderPipelineDescriptor(it) => (&it.label, &it.layout),
            PipelineDescriptor::ComputePipelineDescriptor(it) => (&it.label, &it.layout),
        };
        let Some(label) = label.as_deref().filter(|label| label.starts_with("frugal_gi")) else {
            continue;
        };
        let entries = || layouts.iter().flat_map(|layout| &layout.entries);
        for shader in [ShaderStages::VERTEX, ShaderStages::FRAGMENT, ShaderStages::COMPUTE] {
            let bound = |of: fn(&BindingType) -> bool| {
                let seen = entries().filter(|entry| entry.visibility.contains(shader));
                seen.filter(|entry| of(&entry.ty)).count() as u32
            };
            let counts = [
                bound(|ty| {
                    matches!(ty, BindingType::Buffer { ty: BufferBindingType::Storage { .. }, .. })
                }),
                bound(|ty| matches!(ty, BindingType::StorageTexture { .. })),
            ];
            for (most, count) in most.iter_mut().zip(counts) {
                if count > most.0 {
                    *most = (count, label.to_owned());
                }
            }
        }
    }
    most
}

/// Under a sky, with all bounces, rays, kept light, places for forward meshes, and fog.
fn no_pass_needs_more_than_the_required_limits() {
    let scene = set::scene("courtyard");
    let mut stage = set::open(&scene, set::options(48, 27));
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(VolumetricFog::default());
    stage.world_mut().spawn((FogVolume::default(), Transform::default()));
    for settings in ["max", "max,gi_visibility=cached", "min,gi_vpl_count=64"] {
        set::apply(&mut stage, settings);
        stage.frame();
    }
    let limits = GiPlugin::required_limits();
    let [buffers, textures] = most_bound(&stage);
    println!("    {buffers:?} {textures:?}");
    assert_eq!(buffers.0, limits.max_storage_buffers_per_shader_stage, "{buffers:?}");
    assert_eq!(textures.0, limits.max_storage_textures_per_shader_stage, "{textures:?}");
}
