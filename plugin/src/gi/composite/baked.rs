//! Keeps baked light from being counted twice.
//!
//! An irradiance volume holds the diffuse light that reaches its voxels: that of bounces, which a GI
//! camera gathers, and of the sky. While a camera gathers, Bevy does not get its volumes; where GI is
//! off, by its settings or for want of light, it does. So a level of a knob that switches GI off falls
//! back to what was baked.

use bevy::ecs::prelude::*;
use bevy::light::IrradianceVolume;
use bevy::pbr::RenderViewLightProbes;

use crate::gi::settings::FrugalGi;
use crate::gi::view::GiView;

/// Runs before Bevy notes, for the keys of pipelines, whether a view has volumes: pipelines that read
/// volumes which are not bound end rendering. A view is known to gather from its second frame on.
pub(super) fn leave_out_volumes(
    mut commands: Commands,
    views: Query<
        (Entity, &FrugalGi),
        (With<GiView>, With<RenderViewLightProbes<IrradianceVolume>>),
    >,
) {
    for (view, _) in views.iter().filter(|(_, gi)| !gi.irradiance_volumes) {
        commands.entity(view).remove::<RenderViewLightProbes<IrradianceVolume>>();
    }
}
