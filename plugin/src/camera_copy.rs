//! A copy of a camera for comparison with the camera's own image: for the error meter, and for the
//! HUD of `bevy_frugal_gi_tools`.
//!
//! Only listed components are copied: with the app's own components, the app's queries for its one
//! camera would find the copy, too. A test fails for a component of Bevy's renderer that is neither
//! copied nor left out for a reason.

use bevy::anti_alias::contrast_adaptive_sharpening::ContrastAdaptiveSharpening;
use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::Smaa;
use bevy::anti_alias::taa::TemporalAntiAliasing;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{Camera3d, CameraMainTextureUsages, CompositingSpace, Exposure, Hdr};
use bevy::core_pipeline::oit::OrderIndependentTransparencySettings;
use bevy::core_pipeline::prepass::background_motion_vectors::NoBackgroundMotionVectors;
use bevy::core_pipeline::prepass::{
    DeferredPrepass, DeferredPrepassDoubleBuffer, DepthPrepass, DepthPrepassDoubleBuffer,
    MotionVectorPrepass, NormalPrepass,
};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::EntityCloner;
use bevy::ecs::prelude::*;
use bevy::light::cluster::ClusterConfig;
use bevy::light::{
    AmbientLight, EnvironmentMapLight, ShadowFilteringMethod, Skybox, VolumetricFog,
};
use bevy::pbr::deferred::PbrDeferredLightingDepthId;
use bevy::pbr::{
    AtmosphereSettings, ContactShadows, DistanceFog, ScreenSpaceAmbientOcclusion,
    ScreenSpaceReflections, ScreenSpaceTransmission,
};
use bevy::post_process::auto_exposure::AutoExposure;
use bevy::post_process::bloom::Bloom;
use bevy::post_process::dof::DepthOfField;
use bevy::post_process::effect_stack::{ChromaticAberration, LensDistortion, Vignette};
use bevy::post_process::motion_blur::MotionBlur;
use bevy::render::camera::{CameraRenderGraph, MipBias, TemporalJitter};
use bevy::render::occlusion_culling::OcclusionCulling;
use bevy::render::view::{ColorGrading, Msaa, NoIndirectDrawing};

pub use crate::atmosphere::share_atmosphere;
use crate::gi::FrugalGi;
use crate::knobs::allow_authored;

/// What rendering reads of a camera, besides its place, lens and target. A generated environment map
/// is shared, not generated again.
type Looks = (
    (Camera3d, CameraMainTextureUsages, CameraRenderGraph, RenderLayers),
    (Hdr, Msaa, CompositingSpace, Exposure, Tonemapping, DebandDither, ColorGrading),
    (DepthPrepass, NormalPrepass, MotionVectorPrepass, DeferredPrepass),
    (DepthPrepassDoubleBuffer, DeferredPrepassDoubleBuffer, NoBackgroundMotionVectors),
    PbrDeferredLightingDepthId,
    (TemporalJitter, MipBias, OcclusionCulling, ClusterConfig, ShadowFilteringMethod),
    (Fxaa, Smaa, TemporalAntiAliasing, ContrastAdaptiveSharpening),
    (Bloom, AutoExposure, DepthOfField, MotionBlur),
    (ChromaticAberration, LensDistortion, Vignette),
    (ScreenSpaceAmbientOcclusion, ScreenSpaceReflections, ContactShadows),
    (ScreenSpaceTransmission, OrderIndependentTransparencySettings),
    (DistanceFog, VolumetricFog, AtmosphereSettings),
    (AmbientLight, EnvironmentMapLight, Skybox, FrugalGi),
);

/// Effects by which a part of an image differs from the same part of the whole: light reaches it
/// from outside, or it matters where in the image it is.
pub(crate) type ShowsWholeOnly = Or<(
    With<Bloom>,
    With<AutoExposure>,
    With<DepthOfField>,
    With<MotionBlur>,
    With<ChromaticAberration>,
    With<LensDistortion>,
    With<Vignette>,
    With<ScreenSpaceReflections>,
    With<ScreenSpaceTransmission>,
)>;

/// Gives `to` what rendering reads of `from`, and what knobs keep of the components that the app
/// authored: they may have taken some away, or reduced them.
pub fn copy_looks(world: &mut World, from: Entity, to: Entity) {
    if world.get_entity(from).is_err() || world.get_entity(to).is_err() {
        return;
    }
    let mut cloner = EntityCloner::build_opt_in(world);
    cloner.without_required_components(|cloner| {
        cloner.allow::<Looks>();
        allow_authored(cloner);
    });
    cloner.clone_entity(from, to);
    // It has no `Clone`.
    if world.entity(from).contains::<NoIndirectDrawing>() {
        world.entity_mut(to).insert(NoIndirectDrawing);
    }
}

#[cfg(test)]
mod tests {
    use std::any::TypeId;
    use std::collections::BTreeSet;

    use bevy::DefaultPlugins;
    use bevy::app::{App, PluginGroup};
    use bevy::ecs::component::ComponentId;
    use bevy::light::AtmosphereEnvironmentMapLight;
    use bevy::log::LogPlugin;
    use bevy::render::RenderPlugin;
    use bevy::render::gpu_readback::Readback;
    use bevy::render::settings::WgpuSettings;
    use bevy::render::sync_world::SyncToRenderWorld;
    use bevy::window::{ExitCondition, WindowPlugin};
    use bevy::winit::WinitPlugin;

    use super::*;

    /// Crates whose components may change the image of a camera.
    const CRATES: [&str; 8] = [
        "bevy_anti_alias::",
        "bevy_camera::",
        "bevy_core_pipeline::",
        "bevy_light::",
        "bevy_pbr::",
        "bevy_post_process::",
        "bevy_render::",
        "bevy_solari::",
    ];

    /// What is not copied, by the reason.
    const LEFT_OUT: [(&str, &[&str]); 9] = [
        (
            "of its own: place, lens, target, order, and what the renderer made of them",
            &[
                "bevy_camera::camera::Camera",
                "bevy_camera::camera::RenderTarget",
                "bevy_camera::camera::MainPassResolutionOverride",
                "bevy_camera::projection::Projection",
                "bevy_camera::visibility::Visibility",
                "bevy_camera::visibility::InheritedVisibility",
                "bevy_camera::visibility::ViewVisibility",
                "bevy_camera::visibility::VisibilityClass",
                "bevy_camera::primitives::Frustum",
                "bevy_camera::visibility::VisibleEntities",
                "bevy_camera::visibility::VisibleMeshEntities",
                "bevy_camera::visibility::CubemapVisibleEntities",
                "bevy_camera::visibility::CascadesVisibleEntities",
                "bevy_camera::primitives::CubemapFrusta",
                "bevy_camera::primitives::CascadesFrusta",
            ],
        ),
        (
            "names one camera of the app",
            &[
                "bevy_camera::camera::ShadowLodOrigin",
                "bevy_camera::components::Camera2d",
                "bevy_camera::camera::ManualTextureViewHandle",
            ],
        ),
        (
            "of meshes",
            &[
                "bevy_camera::primitives::Aabb",
                "bevy_camera::primitives::Sphere",
                "bevy_camera::visibility::NoFrustumCulling",
                "bevy_camera::visibility::DynamicSkinnedMeshBounds",
                "bevy_camera::visibility::range::VisibilityRange",
            ],
        ),
        (
            "of lights, probes and volumes",
            &[
                "bevy_light::cascade::CascadeShadowConfig",
                "bevy_light::cascade::Cascades",
                "bevy_light::cluster::ClusteredDecal",
                "bevy_light::directional_light::DirectionalLight",
                "bevy_light::directional_light::DirectionalLightTexture",
                "bevy_light::gizmos::ShowLightGizmo",
                "bevy_light::NotShadowCaster",
                "bevy_light::NotShadowReceiver",
                "bevy_light::TransmittedShadowReceiver",
                "bevy_light::point_light::PointLight",
                "bevy_light::point_light::PointLightTexture",
                "bevy_light::probe::LightProbe",
                "bevy_light::probe::IrradianceVolume",
                "bevy_light::probe::ParallaxCorrection",
                "bevy_light::rect_light::RectLight",
                "bevy_light::spot_light::SpotLight",
                "bevy_light::spot_light::SpotLightTexture",
                "bevy_light::volumetric::VolumetricLight",
                "bevy_light::volumetric::FogVolume",
            ],
        ),
        (
            "makes an environment map, which is copied",
            &["bevy_light::probe::GeneratedEnvironmentMapLight"],
        ),
        (
            "of meshes and decals, as the renderer shows them",
            &[
                "bevy_pbr::lightmap::Lightmap",
                "bevy_pbr::mesh_material::MeshMaterial3d",
                "bevy_pbr::wireframe::Wireframe",
                "bevy_pbr::wireframe::WireframeColor",
                "bevy_pbr::wireframe::WireframeLineWidth",
                "bevy_pbr::wireframe::NoWireframe",
                "bevy_pbr::wireframe::WireframeTopology",
                "bevy_pbr::wireframe::Mesh3dWireframe",
            ],
        ),
        ("of the render world", &["bevy_anti_alias::contrast_adaptive_sharpening::DenoiseCas"]),
        ("of views without a camera", &["bevy_core_pipeline::schedule::RootNonCameraView"]),
        (
            "of an entity's own part in the renderer",
            &[
                "bevy_render::sync_world::SyncToRenderWorld",
                "bevy_render::sync_world::RenderEntity",
                "bevy_render::sync_world::MainEntity",
                "bevy_render::sync_world::TemporaryRenderEntity",
                "bevy_render::view::visibility::RenderShadowMapVisibleEntities",
                "bevy_render::view::window::screenshot::Screenshot",
            ],
        ),
    ];

    /// All of Bevy but a window and a GPU.
    fn bevy() -> App {
        let mut app = App::new();
        let render_creation = WgpuSettings { backends: None, ..Default::default() }.into();
        let window = WindowPlugin {
            primary_window: None,
            exit_condition: ExitCondition::DontExit,
            ..Default::default()
        };
        app.add_plugins(
            DefaultPlugins
                .set(RenderPlugin { render_creation, ..Default::default() })
                .set(window)
                .disable::<LogPlugin>()
                .disable::<WinitPlugin>(),
        );
        app.finish();
        app.cleanup();
        app
    }

    /// The components of the list.
    fn copied(world: &mut World) -> BTreeSet<ComponentId> {
        let info = world.register_bundle::<(Looks, NoIndirectDrawing)>();
        info.explicit_components().iter().copied().collect()
    }

    #[test]
    fn every_component_of_bevy_s_renderer_is_copied_or_left_out_for_a_reason() {
        let mut app = bevy();
        let world = app.world_mut();
        let copied = copied(world);
        let synced = world.register_component::<SyncToRenderWorld>();
        let readback = world.register_component::<Readback>();
        let registry = world.resource::<AppTypeRegistry>().clone();
        let registry = registry.read();
        // Types that a camera may carry: all that are known as components, or are synchronised with
        // the renderer.
        let path = |id: TypeId| registry.get(id).map(|known| known.type_info().type_path());
        let mut found: Vec<(Option<&str>, Option<ComponentId>)> = Vec::new();
        for known in registry.iter() {
            let path = known.type_info().type_path();
            let id = world.components().get_id(known.type_id());
            let is_component = id.is_some() || known.data::<ReflectComponent>().is_some();
            if is_component && known.data::<ReflectResource>().is_none() {
                // Whatever a generic type is made of.
                found.push((path.split('<').next(), id));
            }
        }
        for info in world.components().iter_registered() {
            let is_unknown = info.type_id().and_then(path).is_none();
            let is_synced = info.required_components().iter_ids().any(|id| id == synced);
            if is_unknown && is_synced && info.id() != readback {
                found.push((None, Some(info.id())));
            }
        }
        let left_out: BTreeSet<&str> =
            LEFT_OUT.iter().flat_map(|(_, paths)| paths.iter().copied()).collect();
        let (mut new, mut unnamed) = (BTreeSet::new(), 0);
        for (path, id) in &found {
            let is_ours = path.is_some_and(|path| CRATES.iter().any(|name| path.starts_with(name)));
            let is_copied = id.is_some_and(|id| copied.contains(&id));
            let is_left_out = path.is_some_and(|path| left_out.contains(path));
            assert!(!(is_copied && is_left_out), "{path:?} is both copied and left out");
            match path {
                Some(path) if is_ours && !is_copied && !is_left_out => drop(new.insert(*path)),
                None if !is_copied => unnamed += 1,
                _ => {}
            }
        }
        assert!(found.len() > 60, "components are found at all: {}", found.len());
        assert!(
            new.is_empty(),
            "Bevy has components that pictures compared lack: add them to `Looks`, or to `LEFT_OUT` with a reason\n{new:#?}"
        );
        // One that is private to Bevy: what makes the atmosphere's environment map, which is copied.
        assert_eq!(unnamed, 1, "Bevy synchronises other components that cannot be reflected");
        let gone: Vec<_> = left_out
            .iter()
            .filter(|path| !found.iter().any(|(known, _)| known.as_ref() == Some(*path)))
            .collect();
        assert!(gone.is_empty(), "Bevy has no such components any more: {gone:?}");
    }

    /// A component of the app's own.
    #[derive(Component, Clone)]
    struct Player;

    #[test]
    fn a_copy_has_the_looks_and_nothing_of_the_app_s() {
        let mut world = World::new();
        let camera = world
            .spawn((
                (Player, Camera3d::default(), AtmosphereEnvironmentMapLight::default()),
                (DepthOfField { focal_distance: 3.0, ..Default::default() }, Vignette::default()),
                (LensDistortion::default(), ChromaticAberration::default(), NoIndirectDrawing),
                (TemporalAntiAliasing::default(), MotionBlur::default(), AutoExposure::default()),
                (ContrastAdaptiveSharpening::default(), RenderLayers::layer(3)),
            ))
            .id();
        let copy = world.spawn_empty().id();
        copy_looks(&mut world, camera, copy);
        let copied = copied(&mut world);
        let ids = |world: &World, entity: Entity| -> BTreeSet<ComponentId> {
            world.entity(entity).archetype().components().iter().copied().collect()
        };
        let (of_camera, of_copy) = (ids(&world, camera), ids(&world, copy));
        assert!(copied.intersection(&of_camera).count() >= 12);
        assert!(copied.intersection(&of_camera).all(|id| of_copy.contains(id)));
        assert_eq!(world.get::<DepthOfField>(copy).map(|dof| dof.focal_distance), Some(3.0));
        assert!(!world.entity(copy).contains::<Player>(), "a query by it means one camera");
        // Gone in the meantime.
        world.despawn(camera);
        copy_looks(&mut world, camera, copy);
    }
}
