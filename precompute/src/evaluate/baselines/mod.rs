//! Baselines, simulated from a [`PathRecord`](super::PathRecord): constants, oracles, and the
//! reactive ladder that engines ship.
//!
//! | run | information used |
//! |---|---|
//! | `best-constant` | this path: the best constant settings for the budget |
//! | `best-constant-elsewhere` | other cameras: the best constant settings there |
//! | `oracle` | every frame in advance: a bound, not a method |
//! | `oracle-filtered` | the same, through the controller's temporal filter |
//! | `reactive` | meter readings of earlier frames |
//! | `default` | none: `FrugalGi::default()`, all other knobs at their best |
mod constant;
mod oracle;
mod reactive;

pub(crate) use constant::{best_constant, best_on};
pub(crate) use oracle::{Oracle, oracle};
pub(crate) use reactive::{Reactive, ladder};

use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};

/// `FrugalGi::default()`, all other knobs at their best: the settings of an app that sets nothing.
pub(crate) fn default_settings(space: &KnobSpace) -> KnobLevels {
    let gi = FrugalGi::default();
    let authored = |name: &str| match name {
        "gi_vpl_count" => Some(f64::from(gi.vpl_count)),
        "gi_pixel_fraction" => Some(gi.pixel_fraction.share()),
        "gi_interleave" => Some(f64::from(gi.interleave.side())),
        "gi_visibility" => Some(f64::from(gi.visibility.rays())),
        "gi_environment_samples" => Some(f64::from(gi.environment_samples)),
        "gi_bounces" => Some(f64::from(gi.bounces)),
        "rsm_resolution" => Some(f64::from(gi.rsm_resolution)),
        "gi_refresh_period" => Some(f64::from(gi.refresh_period).recip()),
        _ => None,
    };
    space.from_levels(|_, knob| {
        let nearest = authored(&knob.name).and_then(|value| {
            let far = |level: &usize| (knob.levels[*level].value - value).abs();
            (0..knob.levels.len()).min_by(|a, b| far(a).total_cmp(&far(b)))
        });
        nearest.unwrap_or(knob.levels.len() - 1)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_is_the_app_s_own() {
        let space = crate::stage::every_knob().expect("the built-in knobs");
        let text = space.describe(default_settings(&space));
        for part in [
            "gi_vpl_count=1024",
            "gi_pixel_fraction=1/4",
            "gi_interleave=4x4",
            "gi_visibility=coarse",
            "gi_environment_samples=16",
        ] {
            assert!(text.contains(part), "{part} in {text}");
        }
        for part in
            ["rsm_resolution=128", "gi_bounces=1", "gi_refresh_period=1", "resolution_scale=100%"]
        {
            assert!(text.contains(part), "{part} in {text}");
        }
    }
}
