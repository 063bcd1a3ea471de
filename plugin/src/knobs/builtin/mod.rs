//! The built-in knobs.

mod ambient_occlusion;
mod antialiasing;
mod effects;
mod frame_rate;
pub(super) mod gi;
mod held;
mod post_processing;
mod resolution_scale;
mod shadow_cascades;
mod shadow_maps;
mod texture_detail;
mod view_distance;

pub(super) use ambient_occlusion::AmbientOcclusion;
pub(super) use antialiasing::Antialiasing;
pub(super) use effects::Effects;
pub(super) use frame_rate::FrameRate;
pub(super) use post_processing::PostProcessing;
pub(super) use resolution_scale::ResolutionScaleKnob;
pub(super) use shadow_cascades::ShadowCascades;
pub(super) use shadow_maps::ShadowMapResolution;
pub(super) use texture_detail::TextureDetail;
pub(super) use view_distance::ViewDistance;

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::Smaa;
use bevy::ecs::entity::{EntityClonerBuilder, OptIn};
use bevy::light::VolumetricFog;
use bevy::pbr::{ContactShadows, ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::post_process::bloom::Bloom;

use held::Held;

/// Adds the systems of knobs whose state other parts of the app change, too.
pub(super) fn build(app: &mut bevy::app::App) {
    post_processing::build(app);
    shadow_cascades::build(app);
    view_distance::build(app);
}

/// Lets a clone of a camera have what knobs keep of the components that the app authored.
pub(crate) fn allow_authored(builder: &mut EntityClonerBuilder<OptIn>) {
    builder
        .allow::<(gi::HeldGi, Held<Bloom>, Held<Fxaa>, Held<Smaa>)>()
        .allow::<(Held<ScreenSpaceAmbientOcclusion>, Held<ScreenSpaceReflections>)>()
        .allow::<(Held<ContactShadows>, Held<VolumetricFog>)>();
}
