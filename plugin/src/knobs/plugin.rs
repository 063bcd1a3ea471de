//! The plugin of knobs: the built-in ones, and the systems that apply them.

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::ecs::prelude::*;

use super::driver::update_known;
use super::reconcile::{is_needed, reconcile};
use super::{KnobRegistry, KnobSettings, KnownKnobs, builtin, warm};
use crate::schedule::KnobSystems;

/// Registers the built-in knobs and adds the systems that apply [`KnobSettings`] and
/// [warm](super::WarmKnobs) them.
#[derive(Clone, Debug, Default)]
pub struct KnobPlugin;

impl Plugin for KnobPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<KnobSettings>()
            .configure_sets(PostUpdate, KnobSystems::Apply.before(CameraUpdateSystems))
            .add_systems(
                PostUpdate,
                (
                    reconcile.run_if(is_needed),
                    update_known.run_if(resource_changed::<KnobRegistry>),
                )
                    .in_set(KnobSystems::Apply),
            );
        builtin::build(app);
        warm::build(app);
    }

    fn finish(&self, app: &mut App) {
        crate::schedule::watch_pipelines(app);
        // By now every plugin has registered its knobs: the controller rejects a map with others
        // from the first frame on.
        let known = KnownKnobs::of(app.world().resource::<KnobRegistry>());
        app.insert_resource(known);
    }
}
