//! Applies a camera's settings when they change, and is idle otherwise.

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::{Camera, CameraUpdateSystems};
use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::platform::collections::HashMap;

use super::{KnobLevels, KnobRegistry, KnobScope, KnobSettings, KnownKnobs, RegisterKnob};
use super::{builtin, warm};
use crate::schedule::KnobSystems;

/// Registers the built-in knobs and adds the systems that apply [`KnobSettings`] and
/// [warm](super::WarmKnobs) them.
#[derive(Clone, Debug, Default)]
pub struct KnobPlugin;

impl Plugin for KnobPlugin {
    fn build(&self, app: &mut App) {
        app.register_knob(builtin::GiVplCount)
            .register_knob(builtin::GiPixelShare)
            .register_knob(builtin::GiInterleaving)
            .register_knob(builtin::GiRays)
            .register_knob(builtin::GiEnvironmentSamples)
            .register_knob(builtin::GiBounces)
            .register_knob(builtin::RsmResolution)
            .register_knob(builtin::GiRefreshPeriod)
            .register_knob(builtin::ShadowMapResolution)
            .register_knob(builtin::ShadowCascades)
            .register_knob(builtin::AmbientOcclusion)
            .register_knob(builtin::Antialiasing)
            .register_knob(builtin::TextureDetail)
            .register_knob(builtin::PostProcessing)
            .register_knob(builtin::ResolutionScaleKnob)
            .register_type::<KnobLevels>()
            .configure_sets(PostUpdate, KnobSystems::Apply.before(CameraUpdateSystems))
            .add_systems(
                PostUpdate,
                apply_settings.run_if(any_settings_changed).in_set(KnobSystems::Apply),
            );
        builtin::build(app);
        warm::build(app);
    }

    fn finish(&self, app: &mut App) {
        crate::pipelines::finish(app);
        // By now every plugin has registered its knobs: the controller rejects a map with other
        // knobs.
        let known = app
            .world()
            .get_resource::<KnobRegistry>()
            .and_then(|registry| registry.space_with(|_| true).ok());
        if let Some(space) = known {
            app.insert_resource(KnownKnobs(
                space.knobs().iter().map(|knob| knob.name.clone()).collect(),
            ));
        }
    }
}

/// The levels last applied to a camera, by knob name. Written by [`KnobPlugin`].
#[derive(Component, Clone, Debug, Default, PartialEq)]
pub struct AppliedKnobs {
    levels: HashMap<String, usize>,
}

impl AppliedKnobs {
    /// Index of the level last applied to the knob called `name`; `None` if it was never set.
    pub fn level(&self, name: &str) -> Option<usize> {
        self.levels.get(name).copied()
    }
}

fn any_settings_changed(
    changed: Query<(), Changed<KnobSettings>>,
    mut removed: RemovedComponents<KnobSettings>,
) -> bool {
    // Both must be read every frame, or removals accumulate.
    let removed = removed.read().count() > 0;
    removed || !changed.is_empty()
}

fn apply_settings(world: &mut World, mut last_run: Local<bevy::ecs::change_detection::Tick>) {
    let registry = world.resource::<KnobRegistry>().clone();
    let since = std::mem::replace(&mut *last_run, world.change_tick());
    let now = world.change_tick();
    let mut cameras = world.query_filtered::<(Entity, Ref<KnobSettings>, &Camera), With<Camera>>();
    let mut requested: Vec<(Entity, bool, KnobSettings)> = Vec::new();
    for (entity, settings, camera) in cameras.iter(world) {
        if camera.is_active {
            let changed = settings.last_changed().is_newer_than(since, now);
            requested.push((entity, changed, KnobSettings::clone(&settings)));
        }
    }
    for (entity, _, settings) in requested.iter().filter(|(_, changed, _)| *changed) {
        apply_to_camera(world, &registry, *entity, settings);
    }
    apply_to_app(world, &registry, &requested);
    world.increment_change_tick();
}

/// Applies every knob of the camera's scope whose level differs from the one last applied.
fn apply_to_camera(
    world: &mut World,
    registry: &KnobRegistry,
    entity: Entity,
    requested: &KnobSettings,
) {
    let mut applied = world.get::<AppliedKnobs>(entity).cloned().unwrap_or_default();
    for (index, knob) in requested.space.knobs().iter().enumerate() {
        let level = requested.settings.level(index).min(knob.levels.len() - 1);
        let Some(driver) = registry.get(&knob.name) else {
            warn_once!("knob `{}` is not registered in this app and is ignored", knob.name);
            continue;
        };
        if driver.scope() == KnobScope::Camera && applied.level(&knob.name) != Some(level) {
            driver.apply(world, entity, &knob.levels[level]);
            applied.levels.insert(knob.name.clone(), level);
        }
    }
    if world.get::<AppliedKnobs>(entity) != Some(&applied) {
        world.entity_mut(entity).insert(applied);
    }
}

/// The levels last applied for the whole app.
#[derive(Resource, Default)]
struct AppliedToApp(HashMap<String, f64>);

/// Applies, for every knob of app scope, the highest level among all active cameras.
fn apply_to_app(
    world: &mut World,
    registry: &KnobRegistry,
    requested: &[(Entity, bool, KnobSettings)],
) {
    let mut highest: HashMap<String, (Entity, super::Level)> = HashMap::default();
    for (entity, _, settings) in requested {
        for (index, knob) in settings.space.knobs().iter().enumerate() {
            if registry.get(&knob.name).is_none_or(|driver| driver.scope() != KnobScope::App) {
                continue;
            }
            let level = &knob.levels[settings.settings.level(index).min(knob.levels.len() - 1)];
            match highest.get(&knob.name) {
                Some((_, other)) if other.value >= level.value => {}
                _ => drop(highest.insert(knob.name.clone(), (*entity, level.clone()))),
            }
        }
    }
    for (name, (entity, level)) in highest {
        let mut applied = world.get_resource_or_init::<AppliedToApp>();
        if applied.0.insert(name.clone(), level.value) != Some(level.value)
            && let Some(driver) = registry.get(&name)
        {
            driver.apply(world, entity, &level);
        }
    }
}
