//! The built-in knobs.

mod effects;
mod gi;
mod resolution;
mod shadow_cascades;
mod view_distance;

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::Smaa;
use bevy::app::App;
use bevy::ecs::entity::{EntityClonerBuilder, OptIn};
use bevy::light::VolumetricFog;
use bevy::pbr::{ContactShadows, ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::post_process::bloom::Bloom;

use super::RegisterKnob;
use super::overrides::Override;
use crate::gi::FrugalGi;

/// Registers the knobs, in the order of spaces, and adds their systems.
pub(super) fn build(app: &mut App) {
    app.register_knob(gi::vpl_count())
        .register_knob(gi::pixel_fraction())
        .register_knob(gi::interleave())
        .register_knob(gi::visibility())
        .register_knob(gi::environment_samples())
        .register_knob(gi::bounces())
        .register_knob(gi::rsm_resolution())
        .register_knob(gi::refresh_period())
        .register_knob(resolution::shadow_map_resolution())
        .register_knob(shadow_cascades::knob())
        .register_knob(effects::ambient_occlusion())
        .register_knob(effects::Antialiasing)
        .register_knob(resolution::texture_detail())
        .register_knob(effects::post_processing())
        .register_knob(resolution::resolution_scale())
        .register_knob(effects::effects())
        .register_knob(view_distance::knob())
        .register_knob(resolution::frame_rate());
    effects::build(app);
    shadow_cascades::build(app);
    view_distance::build(app);
}

/// Lets a clone of a camera have what knobs keep of the components that the app authored.
pub(crate) fn allow_authored(builder: &mut EntityClonerBuilder<OptIn>) {
    builder
        .allow::<(Override<FrugalGi>, Override<Bloom>, Override<Fxaa>, Override<Smaa>)>()
        .allow::<(Override<ScreenSpaceAmbientOcclusion>, Override<ScreenSpaceReflections>)>()
        .allow::<(Override<ContactShadows>, Override<VolumetricFog>)>();
}
