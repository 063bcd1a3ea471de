//! Temporal filter: settings move to new ones level by level, so that quality never jumps.
//!
//! Wang et al. 2016, equation 3.8: s = round((1 − t/T)·s_old + (t/T)·s_new) for each knob, t seconds after the settings were to change, T = 2 s.
//!
//! What to do when the target changes before T has passed is left open there. Options: 1. start all knobs anew: while the camera turns, knobs whose
//! target stays the same would never arrive. 2. go on from the unrounded value: a target that flips back and forth at a leaf's border would hold it near
//! one half, where every flip changes the level. 3. start anew, from the level that is applied, only those knobs whose own target changed. We use 3:
//! steady knobs arrive in time, and a knob whose target flips faster than it can follow stays where it is.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;

use crate::knobs::{KnobSpace, RenderSettings};

/// The longest step that is believed, in seconds; anything longer ends every transition all the same.
const LONGEST_STEP: f64 = 1e9;

/// One knob on its way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
struct Transition {
    from: u8,
    to: u8,
    /// How much of the way is done, 0 to 1: t/T. Not t, so that a change of T never takes a knob back.
    share: f64,
}

impl Transition {
    fn level(self) -> usize {
        ((1.0 - self.share) * f64::from(self.from) + self.share * f64::from(self.to)).round() as usize
    }
}

/// The temporal filter of one camera.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Default, Clone, Debug, PartialEq)]
pub struct SettingsFilter {
    transitions: [Transition; RenderSettings::MAX_KNOBS],
    applied: RenderSettings,
    /// Whether the next step goes on from `applied`, rather than straight to its target.
    smooth: bool,
}

impl SettingsFilter {
    /// The settings that the last step gave.
    pub fn applied(&self) -> RenderSettings {
        self.applied
    }

    /// Makes the next step go straight to its target. Call it when the camera cuts to another place: there is no old picture to be gentle to. A filter
    /// that was never stepped does so too.
    pub fn cut(&mut self) {
        self.smooth = false;
    }

    /// Whether the next step goes on from what is applied: not after a [cut](Self::cut), nor before the first step.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// Goes on from `settings`, which something else has applied, at the start of a full transition.
    pub fn resume_from(&mut self, settings: RenderSettings) {
        for (knob, transition) in self.transitions.iter_mut().enumerate() {
            *transition = Transition { from: settings.level(knob) as u8, to: settings.level(knob) as u8, share: 0.0 };
        }
        self.applied = settings;
        self.smooth = true;
    }

    /// Goes on by `delta_seconds` towards `target`, and returns the settings to apply, which are always of `space`.
    ///
    /// A whole transition takes `transition_seconds`; higher values are smoother, and longer over or under the budget. 0 and negative values mean at
    /// once; NaN means the default, [`ControlSettings::TRANSITION_SECONDS`](super::ControlSettings::TRANSITION_SECONDS). A step that is negative or NaN
    /// counts as none.
    pub fn step(&mut self, space: &KnobSpace, target: RenderSettings, delta_seconds: f64, transition_seconds: f64) -> RenderSettings {
        // Not `clamp` alone, which lets NaN pass.
        let delta_seconds = if delta_seconds > 0.0 { delta_seconds.min(LONGEST_STEP) } else { 0.0 };
        let transition_seconds = if transition_seconds.is_nan() { super::ControlSettings::TRANSITION_SECONDS } else { transition_seconds };
        let target = space.from_levels(|knob, _| target.level(knob));
        if !self.smooth {
            self.resume_from(target);
            return target;
        }
        let at_once = transition_seconds <= 0.0;
        let progress = if at_once { 1.0 } else { delta_seconds / transition_seconds };
        let applied = self.applied;
        let transitions = &mut self.transitions;
        self.applied = space.from_levels(|knob, _| {
            let transition = &mut transitions[knob];
            let to = target.level(knob) as u8;
            if transition.to == to {
                transition.share = (transition.share + progress).min(1.0);
            } else {
                // t = 0 on the frame of the change.
                *transition = Transition { from: applied.level(knob) as u8, to, share: if at_once { 1.0 } else { 0.0 } };
            }
            transition.level()
        });
        self.applied
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frontier::testing::space;

    fn settings(samples: usize, scale: usize) -> RenderSettings {
        RenderSettings::default().with_level(0, samples).with_level(1, scale)
    }

    fn started(at: RenderSettings) -> SettingsFilter {
        let mut filter = SettingsFilter::default();
        assert_eq!(filter.step(&space(), at, 0.1, 2.0), at, "the first step is not smoothed");
        filter
    }

    #[test]
    fn it_is_the_closed_form() {
        for (old, new) in [(settings(0, 0), settings(4, 2)), (settings(4, 2), settings(0, 1)), (settings(1, 2), settings(3, 0))] {
            let mut filter = started(old);
            for frame in 0..200 {
                // The first frame sees the new target at t = 0.
                let got = filter.step(&space(), new, 1.0 / 64.0, 2.0);
                let share = (f64::from(frame) / 64.0 / 2.0).min(1.0);
                let level = |knob| ((1.0 - share) * old.level(knob) as f64 + share * new.level(knob) as f64).round() as usize;
                assert_eq!(got, settings(level(0), level(1)), "frame {frame}");
            }
            assert_eq!(filter.applied(), new);
        }
    }

    #[test]
    fn levels_change_one_by_one() {
        let mut filter = started(settings(0, 0));
        let mut last = filter.applied();
        for _ in 0..200 {
            let next = filter.step(&space(), settings(4, 2), 1.0 / 60.0, 2.0);
            assert!((0..2).all(|knob| next.level(knob) - last.level(knob) <= 1));
            last = next;
        }
        assert_eq!(last, settings(4, 2));
    }

    #[test]
    fn a_changed_target_starts_from_what_is_applied() {
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.0, 2.0);
        assert_eq!(filter.step(&space(), settings(4, 2), 1.0, 2.0), settings(2, 1));
        // The samples turn round at level 2; the scale goes on and arrives on time.
        assert_eq!(filter.step(&space(), settings(0, 2), 0.0, 2.0), settings(2, 1));
        assert_eq!(filter.step(&space(), settings(0, 2), 0.75, 2.0), settings(1, 2));
        assert_eq!(filter.step(&space(), settings(0, 2), 0.25, 2.0), settings(1, 2));
        assert_eq!(filter.step(&space(), settings(0, 2), 1.0, 2.0), settings(0, 2));
    }

    #[test]
    fn a_target_that_flips_does_not_make_the_level_flip() {
        let mut filter = started(settings(1, 0));
        for frame in 0..600 {
            let got = filter.step(&space(), settings(frame / 6 % 2, 0), 1.0 / 60.0, 2.0);
            assert_eq!(got, settings(1, 0), "frame {frame}");
        }
    }

    #[test]
    fn cuts_and_transitions_of_no_length_act_at_once() {
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.1, 2.0);
        filter.cut();
        assert_eq!(filter.step(&space(), settings(4, 0), 0.0, 2.0), settings(4, 0));
        assert_eq!(filter.step(&space(), settings(0, 0), 0.0, 2.0), settings(4, 0), "a cut is over after one step");
        assert_eq!(filter.step(&space(), settings(3, 1), 0.0, 0.0), settings(3, 1));
        assert_eq!(filter.step(&space(), settings(1, 2), 0.0, -1.0), settings(1, 2));
        assert_eq!(filter.step(&space(), settings(2, 2), 0.0, f64::NAN), settings(1, 2), "NaN is the default length");
        assert_eq!(filter.step(&space(), settings(2, 2), 0.9, f64::NAN), settings(1, 2));
        assert_eq!(filter.step(&space(), settings(2, 2), 0.1, f64::NAN), settings(2, 2));
        assert_eq!(filter.step(&space(), settings(2, 2), 0.0, 1e6), settings(2, 2), "a longer transition takes nothing back");
        filter.resume_from(settings(0, 2));
        assert_eq!(filter.step(&space(), settings(2, 2), 9.0, 2.0), settings(0, 2), "t = 0 on the frame of the change");
    }

    #[test]
    fn strange_steps_are_harmless() {
        let mut filter = started(settings(0, 0));
        filter.step(&space(), settings(4, 2), 0.0, 2.0);
        for delta in [f64::NAN, -5.0, f64::NEG_INFINITY, 0.0] {
            assert_eq!(filter.step(&space(), settings(4, 2), delta, 2.0), settings(0, 0));
        }
        assert_eq!(filter.step(&space(), settings(4, 2), f64::INFINITY, f64::INFINITY), settings(0, 0));
        assert_eq!(filter.step(&space(), settings(4, 2), f64::INFINITY, 2.0), settings(4, 2));
    }

    proptest! {
        #[test]
        fn what_it_gives_is_always_of_the_space(steps in prop::collection::vec((any::<u64>(), prop::num::f64::ANY, prop::num::f64::ANY, any::<bool>()), 0..50)) {
            let mut filter = SettingsFilter::default();
            for (bits, delta, transition, cut) in steps {
                if cut {
                    filter.cut();
                } else if bits % 7 == 0 {
                    filter.resume_from(RenderSettings::from_bits(!bits));
                }
                let given = filter.step(&space(), RenderSettings::from_bits(bits), delta, transition);
                prop_assert!(space().contains(given));
                prop_assert_eq!(given, filter.applied());
            }
        }
    }
}
