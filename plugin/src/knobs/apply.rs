//! Applies a camera's settings when they change, and does nothing when they do not.

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::{Camera, CameraUpdateSystems};
use bevy::ecs::prelude::*;
use bevy::log::warn_once;
use bevy::platform::collections::HashMap;

use super::{KnobRegistry, KnobScope, KnobSettings, RegisterKnob, RenderSettings};
use super::{builtin, warm};
use crate::control::KnownKnobs;
use crate::schedule::KnobSystems;

/// Adds the built-in knobs and the systems that apply [`KnobSettings`] and [warm](super::WarmKnobs)
/// them.
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
            .register_type::<RenderSettings>()
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
        // By now every plugin has registered its knobs: a map that asks for others is refused by
        // the controller.
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

/// The levels last applied to a camera, by knob.
#[derive(Component, Clone, Debug, Default, PartialEq)]
pub struct AppliedKnobs {
    levels: HashMap<String, usize>,
}

impl AppliedKnobs {
    /// The level at which the knob called `name` stands, if it was ever set.
    pub fn level(&self, name: &str) -> Option<usize> {
        self.levels.get(name).copied()
    }
}

fn any_settings_changed(
    changed: Query<(), Changed<KnobSettings>>,
    mut removed: RemovedComponents<KnobSettings>,
) -> bool {
    // Both must be asked in each frame, or removals pile up.
    let removed = removed.read().count() > 0;
    removed || !changed.is_empty()
}

fn apply_settings(world: &mut World, mut last_run: Local<bevy::ecs::change_detection::Tick>) {
    let registry = world.resource::<KnobRegistry>().clone();
    let since = std::mem::replace(&mut *last_run, world.change_tick());
    let now = world.change_tick();
    let mut cameras = world.query_filtered::<(Entity, Ref<KnobSettings>, &Camera), With<Camera>>();
    let mut wanted: Vec<(Entity, bool, KnobSettings)> = Vec::new();
    for (entity, settings, camera) in cameras.iter(world) {
        if camera.is_active {
            let fresh = settings.last_changed().is_newer_than(since, now);
            wanted.push((entity, fresh, KnobSettings::clone(&settings)));
        }
    }
    for (entity, _, settings) in wanted.iter().filter(|(_, fresh, _)| *fresh) {
        apply_to_camera(world, &registry, *entity, settings);
    }
    apply_to_app(world, &registry, &wanted);
    world.increment_change_tick();
}

/// Every knob of `settings` whose level differs from the one last applied.
fn apply_to_camera(
    world: &mut World,
    registry: &KnobRegistry,
    entity: Entity,
    wanted: &KnobSettings,
) {
    let mut applied = world.get::<AppliedKnobs>(entity).cloned().unwrap_or_default();
    for (index, knob) in wanted.space.knobs().iter().enumerate() {
        let level = wanted.settings.level(index).min(knob.levels.len() - 1);
        let Some(driver) = registry.get(&knob.name) else {
            warn_once!("knob `{}` is not registered in this app: it is ignored", knob.name);
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

/// For every knob of the app's own state, the highest level that any active camera asks for.
fn apply_to_app(
    world: &mut World,
    registry: &KnobRegistry,
    wanted: &[(Entity, bool, KnobSettings)],
) {
    let mut highest: HashMap<String, (Entity, super::Level)> = HashMap::default();
    for (entity, _, settings) in wanted {
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
