//! The plugin of knobs: the built-in ones, and the systems that apply them.

use bevy::app::{App, Plugin, PostUpdate};
use bevy::camera::CameraUpdateSystems;
use bevy::ecs::prelude::*;

use super::reconcile::{is_needed, reconcile};
use super::{KnobLevels, KnobRegistry, KnownKnobs, RegisterKnob};
use super::{builtin, warm};
use crate::schedule::KnobSystems;

/// Registers the built-in knobs and adds the systems that apply
/// [`KnobSettings`](super::KnobSettings) and [warm](super::WarmKnobs) them.
#[derive(Clone, Debug, Default)]
pub struct KnobPlugin;

impl Plugin for KnobPlugin {
    fn build(&self, app: &mut App) {
        app.register_knob(builtin::gi::vpl_count())
            .register_knob(builtin::gi::pixel_share())
            .register_knob(builtin::gi::interleaving())
            .register_knob(builtin::gi::rays())
            .register_knob(builtin::gi::environment_samples())
            .register_knob(builtin::gi::bounces())
            .register_knob(builtin::gi::rsm_resolution())
            .register_knob(builtin::gi::refresh_period())
            .register_knob(builtin::ShadowMapResolution)
            .register_knob(builtin::ShadowCascades)
            .register_knob(builtin::AmbientOcclusion)
            .register_knob(builtin::Antialiasing)
            .register_knob(builtin::TextureDetail)
            .register_knob(builtin::PostProcessing)
            .register_knob(builtin::ResolutionScaleKnob)
            .register_knob(builtin::Effects)
            .register_knob(builtin::ViewDistance)
            .register_knob(builtin::FrameRate)
            .register_type::<KnobLevels>()
            .configure_sets(PostUpdate, KnobSystems::Apply.before(CameraUpdateSystems))
            .add_systems(PostUpdate, reconcile.in_set(KnobSystems::Apply).run_if(is_needed));
        builtin::build(app);
        warm::build(app);
    }

    fn finish(&self, app: &mut App) {
        crate::pipelines::finish(app);
        // By now every plugin has registered its knobs: the controller rejects a map with other
        // knobs. Those that are registered later are added with the first frame.
        if let Some(registry) = app.world().get_resource::<KnobRegistry>() {
            let known = KnownKnobs::of(registry);
            app.insert_resource(known);
        }
    }
}
