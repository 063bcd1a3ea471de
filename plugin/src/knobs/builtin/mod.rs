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

/// Adds the systems of knobs whose state other parts of the app change, too.
pub(super) fn build(app: &mut bevy::app::App) {
    post_processing::build(app);
    shadow_cascades::build(app);
    view_distance::build(app);
}
