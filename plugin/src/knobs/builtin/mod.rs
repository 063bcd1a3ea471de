//! The built-in knobs.

mod ambient_occlusion;
mod antialiasing;
mod gi;
mod post_processing;
mod resolution_scale;
mod shadows;
mod texture_detail;

pub(super) use ambient_occlusion::AmbientOcclusion;
pub(super) use antialiasing::Antialiasing;
pub(super) use gi::{
    GiBounces, GiEnvironmentSamples, GiInterleaving, GiPixelShare, GiRays, GiRefreshPeriod,
    GiVplCount, RsmResolution,
};
pub(super) use post_processing::PostProcessing;
pub(super) use resolution_scale::ResolutionScaleKnob;
pub(super) use shadows::{ShadowCascades, ShadowMapResolution};
pub(super) use texture_detail::TextureDetail;

/// Adds the systems of knobs whose levels depend on the view's size.
pub(super) fn build(app: &mut bevy::app::App) {
    post_processing::build(app);
}
