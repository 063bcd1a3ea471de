//! Opens small stages and controls them.

use std::sync::Arc;

use bevy::app::App;
use bevy::camera::{Camera, Camera3d, Exposure, Projection, RenderTarget, Viewport};
use bevy::core_pipeline::tonemapping::{DebandDither, Tonemapping};
use bevy::ecs::entity::Entity;
use bevy::ecs::query::With;
use bevy::ecs::world::Mut;
use bevy::math::{UVec2, Vec3};
use bevy::mesh::Mesh3d;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{CameraCut, FrugalGi, GiCounts, GiShading};
use bevy_frugal_gi::knobs::{AppliedKnobs, KnobSettings};
use frugal::scene::{self, Geometry, LoadedScene, SceneDescription};
use frugal::stage::{self, Component, Output, Stage, StageOptions};
use frugal_trace::light::Light;
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::CameraPose;

use crate::folder;
use crate::naive_rsm::NaiveRsmPlugin;

/// Loads a scene of the repository by its name.
pub fn scene(name: &str) -> SceneDescription {
    let file = folder::workspace().join(format!("assets/scenes/{name}.scene.ron"));
    scene::load(&file).unwrap_or_else(|error| panic!("{error}")).description
}

/// A scene with its geometry.
pub fn loaded(scene: &SceneDescription) -> LoadedScene {
    LoadedScene::new(scene.clone()).unwrap_or_else(|error| panic!("{error}"))
}

/// Options for an image of `width` × `height` pixels.
pub fn options(width: u32, height: u32) -> StageOptions {
    StageOptions { size: UVec2::new(width, height), ..Default::default() }
}

/// Options for the radiance of one component.
pub fn radiance_options(width: u32, height: u32, component: Component) -> StageOptions {
    StageOptions { output: Output::Radiance, component, ..options(width, height) }
}

/// Opens a stage that can also render the baseline.
pub fn open(scene: &SceneDescription, options: StageOptions) -> Stage {
    open_with(scene, options, |_| {})
}

/// [`open`] with more plugins, which `extend` adds.
pub fn open_with(
    scene: &SceneDescription,
    options: StageOptions,
    extend: impl FnOnce(&mut App),
) -> Stage {
    let extend = |app: &mut App| {
        app.add_plugins(NaiveRsmPlugin);
        extend(app);
    };
    let mut stage =
        stage::open_with(&loaded(scene), options, extend).unwrap_or_else(|error| panic!("{error}"));
    // Closed forms and references are of one bounce, unless a test asks for more.
    gi(&mut stage).bounces = 1;
    stage
}

/// Opens a stage with `lights` and no meshes.
pub fn bare(lights: Vec<Light>, options: StageOptions) -> Stage {
    bare_with(lights, options, |_| {})
}

/// [`bare`] with more plugins, which `extend` adds.
pub fn bare_with(
    lights: Vec<Light>,
    options: StageOptions,
    extend: impl FnOnce(&mut App),
) -> Stage {
    let mut scene = SceneDescription::new(Geometry::Procedural("furnace".into()));
    (scene.lights, scene.exposure_ev100) = (lights, 8.0);
    scene.camera.near = 0.01;
    let mut stage = open_with(&scene, options, extend);
    let world = stage.world_mut();
    let meshes: Vec<Entity> = world.query_filtered::<Entity, With<Mesh3d>>().iter(world).collect();
    meshes.into_iter().for_each(|mesh| assert!(world.despawn(mesh)));
    stage
}

/// Applies settings in the syntax of the command line, with a camera cut.
pub fn apply(stage: &mut Stage, text: &str) {
    stage.apply_text(text).unwrap_or_else(|error| panic!("{error}"));
}

/// Applies settings without a camera cut.
pub fn switch(stage: &mut Stage, text: &str) {
    stage.switch_text(text).unwrap_or_else(|error| panic!("{error}"));
}

/// Moves the camera to `position`, looking at `target`.
pub fn look(stage: &mut Stage, position: Vec3, target: Vec3) {
    let pose = CameraPose::looking_at(position, target);
    stage.place(pose.position, pose.rotation);
}

/// The stage's camera.
pub fn camera(stage: &mut Stage) -> Entity {
    let world = stage.world_mut();
    world
        .query_filtered::<Entity, With<FrugalGi>>()
        .single(world)
        .unwrap_or_else(|error| panic!("the stage's camera: {error}"))
}

/// Announces that the next frame is a cut.
pub fn cut(stage: &mut Stage) {
    let camera = camera(stage);
    stage.world_mut().entity_mut(camera).insert(CameraCut);
}

/// Gives the stage's camera a part of its target, `position` and `size` in pixels.
pub fn set_viewport(stage: &mut Stage, camera: Entity, position: UVec2, size: UVec2) {
    let mut camera = stage
        .world_mut()
        .get_mut::<Camera>(camera)
        .unwrap_or_else(|| panic!("{camera} is a camera"));
    camera.viewport =
        Some(Viewport { physical_position: position, physical_size: size, depth: 0.0..1.0 });
}

/// Spawns a second camera with the settings, lens and target of the stage's own, which looks from
/// `position` at `target` and is rendered after it.
pub fn add_camera(stage: &mut Stage, position: Vec3, target: Vec3) -> Entity {
    let first = camera(stage);
    let world = stage.world_mut();
    let (target_image, lens, exposure, gi, knobs, color) = (
        world.get::<RenderTarget>(first).cloned().unwrap_or_default(),
        world.get::<Projection>(first).cloned().unwrap_or_default(),
        world.get::<Exposure>(first).copied().unwrap_or_default(),
        world.get::<FrugalGi>(first).cloned().unwrap_or_default(),
        world.get::<KnobSettings>(first).cloned(),
        world.get::<Camera>(first).map(|camera| camera.clear_color).unwrap_or_default(),
    );
    let pose = CameraPose::looking_at(position, target);
    let second = world
        .spawn((
            Camera3d::default(),
            Camera { order: 1, clear_color: color, ..Default::default() },
            target_image,
            lens,
            exposure,
            gi,
            Tonemapping::None,
            DebandDither::Disabled,
            Transform::from_translation(pose.position).with_rotation(pose.rotation),
        ))
        .id();
    if let Some(knobs) = knobs {
        world.entity_mut(second).insert(knobs);
    }
    second
}

/// Settings of the camera's global illumination that no applied knob controls. Those that knobs do
/// are set to their levels again with the next frame; see [`gi_without_knobs`].
pub fn gi(stage: &mut Stage) -> Mut<'_, FrugalGi> {
    let camera = camera(stage);
    stage
        .world_mut()
        .get_mut::<FrugalGi>(camera)
        .unwrap_or_else(|| panic!("the stage's camera has GI"))
}

/// Settings of the camera's global illumination, of which no knob controls any until settings are
/// applied again: they stay as the knobs have set them, and are the test's to change.
pub fn gi_without_knobs(stage: &mut Stage) -> Mut<'_, FrugalGi> {
    let entity = camera(stage);
    let current = stage.world_mut().get::<KnobSettings>(entity).cloned();
    if let Some(KnobSettings { space, settings }) = current
        && space.index_of("gi_vpl_count").is_some()
    {
        // Applies what was asked last.
        stage.frame();
        let names = space.knobs().iter().map(|knob| knob.name.as_str());
        let kept = space
            .subset(names.filter(|name| !name.starts_with("gi_") && *name != "rsm_resolution"))
            .expect("the space's own knobs");
        let levels = kept.from_levels(|_, knob| {
            space.index_of(&knob.name).map_or(0, |index| settings.level(index))
        });
        // Without the record of what was applied, nothing is released.
        stage
            .world_mut()
            .entity_mut(entity)
            .remove::<AppliedKnobs>()
            .insert(KnobSettings { space: Arc::new(kept), settings: levels });
    }
    gi(stage)
}

/// Shades all surfaces as Lambertian.
pub fn make_lambertian(stage: &mut Stage) {
    gi(stage).shading = GiShading::Lambertian;
}

/// Disables temporal accumulation: each frame shows only the light gathered in it.
pub fn disable_history(stage: &mut Stage) {
    gi(stage).history_frames = 1;
}

/// Counters of the last frame's global illumination.
pub fn gathered(stage: &Stage) -> GiCounts {
    stage.render_world().get_resource::<GiCounts>().copied().unwrap_or_default()
}

/// Renders until the image has converged after all changes, and returns its radiance.
pub fn radiance(stage: &mut Stage) -> Radiance {
    stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
    stage.radiance().unwrap_or_else(|error| panic!("{error}"))
}

/// Mean of each channel, nits.
pub fn channel_means(radiance: &Radiance) -> [f64; 3] {
    let mean = |channel: usize| {
        radiance.rgb.iter().map(|rgb| f64::from(rgb[channel])).sum::<f64>()
            / radiance.rgb.len() as f64
    };
    [mean(0), mean(1), mean(2)]
}
