//! GI that an app or a knob switches on or off comes and goes gradually.
//!
//! A camera whose GI is switched off keeps the settings that it had until its light has faded. What
//! gathers light, in both worlds, reads those settings.

use std::ops::Deref;

use bevy::camera::Camera;
use bevy::ecs::prelude::*;
use bevy::ecs::query::QueryItem;
use bevy::light::IrradianceVolume;
use bevy::render::extract_component::ExtractComponent;
use bevy::render::sync_component::SyncComponent;
use bevy::time::{Real, Time};

use super::CameraCut;
use crate::gi::settings::FrugalGi;

/// Seconds in which indirect light fades. Higher values: softer; GI that is switched off costs its power
/// for longer.
const FADE_SECONDS: f32 = 0.8;

/// The settings by which a camera gathers, and how much of that light it shows. In the main world.
#[derive(Component, Clone, Debug, PartialEq)]
pub(in crate::gi) struct ActiveGi {
    gi: FrugalGi,
    /// 0 to 1.
    share: f32,
}

impl Default for ActiveGi {
    fn default() -> Self {
        Self { gi: FrugalGi { vpl_count: 0, ..Default::default() }, share: 0.0 }
    }
}

impl Deref for ActiveGi {
    type Target = FrugalGi;

    fn deref(&self) -> &FrugalGi {
        &self.gi
    }
}

impl ActiveGi {
    /// Share of the gathered light that is shown, 0 to 1.
    pub(crate) fn share(&self) -> f32 {
        self.share
    }

    /// Goes on by a step of the fade towards `gi`; to its end if `jumps`.
    fn advance(&mut self, gi: &FrugalGi, step: f32, jumps: bool) {
        let jumps = jumps || gi.output != self.gi.output;
        let gathers = gi.gathers();
        // NaN counts as a whole step.
        let step = if jumps || step.is_nan() { 1.0 } else { step };
        self.share = (self.share + if gathers { step } else { -step }).clamp(0.0, 1.0);
        if gathers || self.share == 0.0 {
            self.gi.clone_from(gi);
        }
    }
}

/// An irradiance volume that holds a camera's own light.
#[derive(Component)]
pub(in crate::gi) struct ForwardVolume;

/// Share of indirect light that a camera shows. In the render world.
#[derive(Component, Clone, Copy, Debug, PartialEq)]
pub(in crate::gi) struct GiShare(pub f32);

impl SyncComponent for ActiveGi {
    type Target = (FrugalGi, GiShare);
}

impl ExtractComponent for ActiveGi {
    type QueryData = &'static Self;
    type QueryFilter = ();
    type Out = (FrugalGi, GiShare);

    fn extract_component(active: QueryItem<Self::QueryData>) -> Option<Self::Out> {
        Some((active.gi.clone(), GiShare(active.share)))
    }
}

/// After knobs have set this frame's settings.
pub(super) fn advance(
    time: Option<Res<Time<Real>>>,
    mut cameras: Query<(&Camera, &FrugalGi, &mut ActiveGi, Has<CameraCut>)>,
    baked: Query<(), (With<IrradianceVolume>, Without<ForwardVolume>)>,
) {
    let step = time.map_or(1.0, |time| time.delta_secs() / FADE_SECONDS);
    // Baked volumes light a camera as soon as it does not gather, and cannot fade.
    let are_baked = !baked.is_empty();
    for (camera, gi, mut active, is_cut) in &mut cameras {
        // A camera begins with all of its light.
        let jumps = active.is_added() || is_cut || are_baked || !camera.is_active;
        active.advance(gi, step, jumps);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gi::settings::GiOutput;

    #[test]
    fn light_comes_and_goes_in_steps_by_the_settings_that_made_it() {
        let on = FrugalGi { vpl_count: 64, ..Default::default() };
        let off = FrugalGi { vpl_count: 0, bounces: 1, ..Default::default() };
        let mut active = ActiveGi::default();
        active.advance(&on, 0.25, true);
        assert_eq!((active.share(), &active.gi), (1.0, &on));
        active.advance(&off, 0.25, false);
        assert_eq!((active.share(), &active.gi), (0.75, &on));
        // It turns back from where it is.
        let other = FrugalGi { vpl_count: 128, ..Default::default() };
        active.advance(&other, 0.125, false);
        assert_eq!((active.share(), &active.gi), (0.875, &other));
        for _ in 0..4 {
            active.advance(&off, 0.25, false);
        }
        assert_eq!((active.share(), &active.gi), (0.0, &off));
        active.advance(&on, 0.5, false);
        assert_eq!((active.share(), &active.gi), (0.5, &on));
    }

    #[test]
    fn cuts_and_broken_clocks_end_a_fade() {
        let off = FrugalGi { vpl_count: 0, ..Default::default() };
        let lit = || {
            let mut active = ActiveGi::default();
            active.advance(&FrugalGi::default(), 0.0, true);
            active
        };
        for (step, jumps) in [(0.0, true), (f32::NAN, false), (f32::INFINITY, false)] {
            let mut active = lit();
            active.advance(&off, step, jumps);
            assert_eq!(active.share(), 0.0, "{step}, {jumps}");
        }
        let mut active = lit();
        active.advance(&off, 0.0, false);
        assert_eq!(active.share(), 1.0, "no time has passed");
        let maps = FrugalGi { output: GiOutput::MapsOnly, ..Default::default() };
        active.advance(&maps, 0.0, false);
        assert_eq!(active.share(), 0.0);
    }
}
