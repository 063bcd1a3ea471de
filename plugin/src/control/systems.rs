//! The controller's systems: look up, select, filter, write.

use std::collections::HashMap;
use std::sync::Arc;

use bevy::asset::{AssetEvent, AssetId, AssetServer, Assets, LoadState};
use bevy::camera::{Camera, Projection};
use bevy::ecs::prelude::*;
use bevy::log::warn;
use bevy::time::{Real, Time};
use bevy::transform::components::GlobalTransform;

use super::{
    Budget, ControlSettings, ControlStatus, ErrorPace, FrontierMapHandle, FrontierSource,
    OffReason, Selection, SettingsFilter, choose,
};
use crate::frontier::{CameraView, FrontierMap, FrontierStore};
use crate::knobs::{KnobLevels, KnobSettings, KnobSpace, KnownKnobs};

/// Computed once per map: its knobs, shared by all cameras, or the reason why it cannot be used.
type Prepared = Result<Arc<KnobSpace>, (OffReason, String)>;

/// Cache of validated maps, so that nothing is validated or allocated per frame.
#[derive(Resource, Default)]
pub(super) struct PreparedMaps(HashMap<AssetId<FrontierMap>, Prepared>);

impl PreparedMaps {
    fn get(
        &mut self,
        id: AssetId<FrontierMap>,
        map: &FrontierMap,
        known: Option<&KnownKnobs>,
    ) -> &Prepared {
        self.0.entry(id).or_insert_with(|| {
            map.validate().map_err(|error| (OffReason::MapInvalid, error.to_string()))?;
            check_known(&map.knobs, known)?;
            Ok(Arc::new(map.knobs.clone()))
        })
    }
}

fn check_known(space: &KnobSpace, known: Option<&KnownKnobs>) -> Result<(), (OffReason, String)> {
    match known.and_then(|known| known.first_unknown(space)) {
        None => Ok(()),
        Some(name) => {
            let reason = format!(
                "the map sets knob `{name}`, which this app has not registered: register it, or precompute without it"
            );
            Err((OffReason::UnknownKnobs, reason))
        }
    }
}

/// Invalidates the cache of maps that changed or were removed, and all of it when the known knobs
/// change.
pub(super) fn forget_changed_maps(
    mut events: MessageReader<AssetEvent<FrontierMap>>,
    known: Option<Res<KnownKnobs>>,
    mut prepared: ResMut<PreparedMaps>,
) {
    for event in events.read() {
        match event {
            AssetEvent::Added { id }
            | AssetEvent::Modified { id }
            | AssetEvent::Removed { id }
            | AssetEvent::Unused { id } => {
                prepared.0.remove(id);
            }
            AssetEvent::LoadedWithDependencies { .. } => {}
        }
    }
    if known.is_some_and(|known| known.is_changed()) {
        prepared.0.clear();
    }
}

/// Selects every controlled camera's settings and writes them to [`KnobSettings`].
pub(super) fn select_settings(
    mut commands: Commands,
    time: Res<Time<Real>>,
    settings: Res<ControlSettings>,
    known: Option<Res<KnownKnobs>>,
    maps: Res<Assets<FrontierMap>>,
    server: Option<Res<AssetServer>>,
    mut prepared: ResMut<PreparedMaps>,
    mut cameras: Query<(
        Entity,
        AnyOf<(&FrontierMapHandle, &FrontierSource)>,
        Option<&Budget>,
        &GlobalTransform,
        Option<&Projection>,
        Option<&Camera>,
        &mut Selection,
        (&mut SettingsFilter, &mut ErrorPace),
        Option<&mut KnobSettings>,
    )>,
) {
    let known = known.as_deref();
    for (
        entity,
        (handle, source),
        budget,
        transform,
        projection,
        camera,
        mut selection,
        (mut filter, mut pace),
        knobs,
    ) in &mut cameras
    {
        if camera.is_some_and(|camera| !camera.is_active) {
            continue;
        }
        let unlimited = Budget::default();
        let budget = budget.unwrap_or(&unlimited);
        let view = CameraView::from_camera(transform, projection);

        let (store, space): (&dyn FrontierStore, &Arc<KnobSpace>) = if let Some(source) = source {
            if let Err((reason, message)) = check_known(source.space(), known) {
                turn_off(entity, &mut selection, reason, &message);
                continue;
            }
            (source.store(), source.space())
        } else if let Some(handle) = handle {
            let id = handle.0.id();
            let Some(map) = maps.get(id) else {
                match server.as_ref().and_then(|server| server.get_load_state(id)) {
                    Some(LoadState::Failed(error)) => {
                        turn_off(entity, &mut selection, OffReason::MapNotLoaded, &error);
                    }
                    _ => stand_by(&mut selection, ControlStatus::Waiting),
                }
                continue;
            };
            match prepared.get(id, map, known) {
                Ok(space) => (map, space),
                Err((reason, message)) => {
                    turn_off(entity, &mut selection, *reason, message);
                    continue;
                }
            }
        } else {
            continue;
        };

        if let Err(error) = budget.validate() {
            turn_off(entity, &mut selection, OffReason::InvalidBudget, &error);
            continue;
        }
        let delta = time.delta_secs_f64();
        // As the filter below, this state advances every frame without a change for others to
        // detect.
        let Some((sample, choice)) =
            choose(store, &view, budget, pace.bypass_change_detection(), delta)
        else {
            let message = "no sample camera of the map has a frontier: check that its scene is not empty and its bounds do not lie inside a wall";
            turn_off(entity, &mut selection, OffReason::NothingKnown, &message);
            continue;
        };

        match &knobs {
            // The app wrote them since: continue from there. Not at the start, where no transition
            // from the app's own settings is needed.
            Some(knobs) if same_space(&knobs.space, space) => {
                if filter.is_smooth() && knobs.settings != filter.applied() {
                    filter.resume_from(knobs.settings);
                }
            }
            // Levels of another knob space do not apply to this one.
            _ => filter.cut(),
        }
        // The filter advances every frame without a change for others to detect.
        let applied = filter.bypass_change_detection().step(
            space,
            choice.settings,
            delta,
            settings.times(budget),
        );
        let status = ControlStatus::Active(choice.outcome);
        let predicted = Some(choice.cost);
        selection.set_if_neq(Selection {
            status,
            target: choice.settings,
            applied,
            predicted,
            sample: Some(sample),
        });
        match knobs {
            Some(knobs) => write(knobs, space, applied),
            None => {
                commands
                    .entity(entity)
                    .try_insert(KnobSettings { space: Arc::clone(space), settings: applied });
            }
        }
    }
}

/// Whether two spaces are equal. Compares contents only where the pointers differ; [`write`] then
/// makes the pointers equal.
fn same_space(a: &Arc<KnobSpace>, b: &Arc<KnobSpace>) -> bool {
    Arc::ptr_eq(a, b) || a == b
}

/// Writes the settings, and triggers change detection only if their meaning differs.
fn write(mut knobs: Mut<KnobSettings>, space: &Arc<KnobSpace>, applied: KnobLevels) {
    let same = same_space(&knobs.space, space);
    if !same || knobs.settings != applied {
        *knobs = KnobSettings { space: Arc::clone(space), settings: applied };
    } else if !Arc::ptr_eq(&knobs.space, space) {
        knobs.bypass_change_detection().space = Arc::clone(space);
    }
}

/// Leaves the camera's settings unchanged, and logs the reason unless it was logged before.
fn turn_off(
    camera: Entity,
    selection: &mut Mut<Selection>,
    reason: OffReason,
    message: &dyn std::fmt::Display,
) {
    let status = ControlStatus::Off(reason);
    if selection.status != status {
        warn!("the power controller is off for camera {camera}: {message}");
    }
    stand_by(selection, status);
}

fn stand_by(selection: &mut Mut<Selection>, status: ControlStatus) {
    let kept = **selection;
    selection.set_if_neq(Selection { status, predicted: None, sample: None, ..kept });
}

/// Removes the controller's state from a camera that is no longer controlled. Its [`KnobSettings`]
/// stay and belong to the app from then on.
pub(super) fn forget_camera<C: Component>(
    removed: On<Remove, C>,
    mut commands: Commands,
    cameras: Query<AnyOf<(&FrontierMapHandle, &FrontierSource)>>,
) {
    // The removed component is still present here. If the other kind is present too, the camera
    // stays under control.
    if let Ok((Some(_), Some(_))) = cameras.get(removed.entity) {
        return;
    }
    commands.entity(removed.entity).try_remove::<(Selection, SettingsFilter, ErrorPace)>();
}

#[cfg(test)]
#[path = "systems_tests.rs"]
mod tests;
