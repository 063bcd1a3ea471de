//! The controller: selects every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`FrontierMapHandle`] or [`FrontierSource`] | the app | the source of its frontiers |
//! | [`Budget`] | the app | its power and error limits |
//! | [`Selection`] | the controller | the selected settings, their predicted cost, and whether the budget is met |
//! | [`ErrorPace`] | the controller | correction of the error rate for views unlike the calibration views |
//! | [`SettingsFilter`] | the controller | the transition from old settings to new ones; the app calls [`cut`](SettingsFilter::cut) on it |
//! | [`KnobSettings`](crate::knobs::KnobSettings) | the controller | the settings to apply |
//!
//! [`choose`], [`select`] and [`SettingsFilter`] do not depend on Bevy's schedule and can be used
//! without it.
mod budget;
mod filter;
mod pace;
mod select;
mod selection;
mod systems;
pub use budget::{Budget, BudgetError};
pub use filter::{SettingsFilter, TransitionTimes};
pub use pace::{ErrorPace, choose};
pub use select::{Choice, MOST_OVER_MEAN, Outcome, select};
pub use selection::{
    ControlSettings, ControlStatus, FrontierMapHandle, FrontierSource, OffReason, Selection,
};

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::{AssetEventSystems, Assets};
use bevy::ecs::schedule::common_conditions::resource_exists;
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemSet};
use bevy::log::warn;
use bevy::transform::TransformSystems;

use crate::frontier::FrontierMap;
use crate::knobs::KnownKnobs;

/// When the controller runs.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ControlSystems {
    /// Part of `PostUpdate`, after transform propagation: writes [`Selection`] and
    /// [`KnobSettings`](crate::knobs::KnobSettings). Settings are applied before cameras are
    /// updated, which Bevy does earlier in the schedule: a selection takes effect in the next
    /// frame.
    Select,
}

/// Adds the controller. Needs [`FrontierMapPlugin`](crate::frontier::FrontierMapPlugin) and Bevy's
/// `TimePlugin`; without the former it stays off and logs a warning.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControlPlugin;

impl Plugin for ControlPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<ControlSettings>()
            .init_resource::<systems::PreparedMaps>()
            .register_type::<Budget>()
            .register_type::<ControlSettings>()
            .register_type::<ControlStatus>()
            .register_type::<ErrorPace>()
            .register_type::<FrontierMapHandle>()
            .register_type::<KnownKnobs>()
            .register_type::<OffReason>()
            .register_type::<Outcome>()
            .register_type::<Selection>()
            .register_type::<SettingsFilter>()
            .add_observer(systems::forget_camera::<FrontierMapHandle>)
            .add_observer(systems::forget_camera::<FrontierSource>)
            .add_systems(
                PostUpdate,
                (systems::forget_changed_maps, systems::select_settings)
                    .chain()
                    .in_set(ControlSystems::Select)
                    // Need this frame's map changes, so that no map is read with the knobs of its
                    // predecessor.
                    .after(AssetEventSystems)
                    // Need this frame's camera transforms.
                    .after(TransformSystems::Propagate)
                    .run_if(resource_exists::<Assets<FrontierMap>>),
            );
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<FrontierMap>>() {
            warn!(
                "ControlPlugin stays off: this app has no frontier map assets, add FrontierMapPlugin"
            );
        }
    }
}
