//! The controller: picks every camera's knob settings from its frontiers under its budget, and
//! moves there smoothly.
//!
//! | component of a camera | written by | holds |
//! |---|---|---|
//! | [`FrontierMapHandle`] or [`FrontierSource`] | the app | where its frontiers come from |
//! | [`Budget`] | the app | what it may cost |
//! | [`Selection`] | the controller | what was picked, what it should cost, and whether the budget is kept |
//! | [`ErrorPace`] | the controller | how far views are from those that error budgets were calibrated on |
//! | [`SettingsFilter`] | the controller | the way from old settings to new ones; the app calls [`cut`](SettingsFilter::cut) on it |
//! | [`KnobSettings`](crate::knobs::KnobSettings) | the controller | the settings to apply |
//!
//! [`choose`], [`select`] and [`SettingsFilter`] know nothing of Bevy's schedule, and can be used
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
    ControlSettings, ControlStatus, FrontierMapHandle, FrontierSource, KnownKnobs, OffReason,
    Selection,
};

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::{AssetEventSystems, Assets};
use bevy::ecs::schedule::common_conditions::resource_exists;
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemSet};
use bevy::log::warn;
use bevy::transform::TransformSystems;

use crate::frontier::FrontierMap;

/// When the controller runs.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ControlSystems {
    /// Part of `PostUpdate`, after transform propagation: writes [`Selection`] and
    /// [`KnobSettings`](crate::knobs::KnobSettings). Settings are applied before cameras are
    /// updated, which Bevy does earlier in the schedule: a selection is in the next frame's
    /// picture.
    Select,
}

/// The controller. Needs [`FrontierMapPlugin`](crate::frontier::FrontierMapPlugin) and Bevy's
/// `TimePlugin`; without the former it stays off.
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
                    // Need this frame's changes of maps, so that no map is read with the knobs of
                    // its predecessor.
                    .after(AssetEventSystems)
                    // Need where cameras are in this frame.
                    .after(TransformSystems::Propagate)
                    .run_if(resource_exists::<Assets<FrontierMap>>),
            );
    }

    fn finish(&self, app: &mut App) {
        if !app.world().contains_resource::<Assets<FrontierMap>>() {
            warn!(
                "ControlPlugin stays off: frontier maps are no assets of this app, add FrontierMapPlugin"
            );
        }
    }
}
