//! Temporal filter: moves settings to their target level by level, so that quality never jumps.
//!
//! Wang et al. 2016, equation 3.8: `s = round((1 − t/T)·s_old + (t/T)·s_new)` for each knob, t
//! seconds after the target changed; T is 2 s there and 0.3 s here. For a constant target the filter
//! equals this closed form.
//!
//! Where a target changes before T has passed, every knob continues from its unrounded position. A
//! level reverses its last change only `REVERSAL_MARGIN` beyond the half-way point. A moving knob
//! keeps its rate while its target stays on the same side, so it reaches the range of its targets
//! within T.
//!
//! A knob that depends on another (rays need virtual point lights) moves while it has no effect,
//! within T: before the other is switched on, or after it is switched off. Otherwise settings on
//! the way would be on no frontier: lights without rays shine through walls.
//!
//! The knob that others need is a switch. It goes to its target in one step, half-way through the
//! transition: the renderer fades what it switches, and levels on the way would show in the fade.

use std::cmp::Ordering;
use std::time::Duration;

use glam::Vec3;

use super::choose::Dwell;
use crate::frontier::{CameraView, is_cut};
use crate::knobs::{KnobLevels, KnobSpace};

/// Upper limit of one step, in seconds. A longer step ends every transition anyway.
const MAX_STEP_SECONDS: f64 = 1e9;

/// Distance beyond the half-way point at which a position reverses the last change of its level, in
/// levels.
///
/// Higher values suppress more level changes under an alternating target. The margin must stay
/// below one half, so that a knob at rest is at its target. A target that alternates between
/// neighbouring levels then moves the level only if it stays at each for more than half a
/// transition. A target that alternates between levels A apart, h seconds at each, makes the
/// position oscillate over A·r / (2 − r) levels, where r is h ÷ T; up to two margins, the level comes
/// to rest.
const REVERSAL_MARGIN: f64 = 0.25;

/// The transition of one knob.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Transition {
    /// Unrounded position, in levels.
    position: f64,
    to: u8,
    /// Levels per transition, at least the remaining distance. Not per second, so that times may
    /// change during a transition.
    rate: f64,
    /// The applied level.
    level: u8,
    /// Direction of its last change since the knob was at rest.
    last: Option<Ordering>,
    /// Whether the level waits while the position moves.
    is_held: bool,
}

impl Transition {
    fn at_rest(level: u8) -> Self {
        Self { position: f64::from(level), to: level, level, ..Self::default() }
    }

    /// Remaining levels; negative downwards.
    fn remaining(&self) -> f64 {
        f64::from(self.to) - self.position
    }

    fn advance(&mut self, delta_seconds: f64, time: Duration) {
        let share = match time {
            Duration::ZERO => 1.0,
            Duration::MAX => 0.0,
            time => (delta_seconds / time.as_secs_f64()).min(1.0),
        };
        let (remaining, step) = (self.remaining(), self.rate * share);
        // Set exactly at the end: rounding errors must not prolong a transition for ever.
        self.position = if remaining.abs() <= step {
            f64::from(self.to)
        } else {
            self.position + step.copysign(remaining)
        };
    }

    /// Whether the way to the target switches other knobs, which have an effect from level `switch` on.
    fn crosses(&self, switch: Option<usize>) -> bool {
        let is_on = |level: u8| switch.is_some_and(|switch| usize::from(level) >= switch);
        is_on(self.level) != is_on(self.to)
    }

    /// Takes a target. `is_kept`: the level waits until the knob has no effect.
    fn turn_to(&mut self, to: u8, is_kept: bool, switch: Option<usize>) {
        let before = self.remaining();
        self.to = to;
        let is_held = is_kept || self.crosses(switch);
        // It goes on from what is shown.
        if self.is_held && !is_held {
            self.position = f64::from(self.level);
        }
        self.is_held = is_held;
        let after = self.remaining();
        // A knob that slowed at each change of the target's distance would never arrive.
        let same_side = before * after > 0.0;
        self.rate = if same_side { self.rate.max(after.abs()) } else { after.abs() };
        if before == 0.0 {
            self.last = None;
        }
    }

    /// Rounds the position as the closed form does, with hysteresis on reversals. A switch is on one
    /// side until half of the way is done.
    fn round(&mut self, switch: Option<usize>) {
        if self.crosses(switch) {
            let way = f64::from(self.to) - f64::from(self.level);
            if (self.position - f64::from(self.level)) / way >= 0.5 {
                *self = Self::at_rest(self.to);
            }
            return;
        }
        let margin = |taken_back| if self.last == Some(taken_back) { REVERSAL_MARGIN } else { 0.0 };
        let (up, down) = (0.5 + margin(Ordering::Less), 0.5 + margin(Ordering::Greater));
        let offset = self.position - f64::from(self.level);
        // A tie rounds up, as in `f64::round`: positions are never negative.
        let change = if offset >= up {
            Ordering::Greater
        } else if offset < -down {
            Ordering::Less
        } else {
            return;
        };
        self.level = self.position.round() as u8;
        self.last = Some(change);
    }
}

/// The temporal filter of one camera.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "bevy", derive(bevy_ecs::component::Component))]
pub struct SettingsFilter {
    transitions: [Transition; KnobLevels::MAX_KNOBS],
    applied: KnobLevels,
    /// Whether the next step continues from `applied` instead of jumping to its target.
    smooth: bool,
    /// Position and viewing direction of the last frame.
    seen: Option<(Vec3, Vec3)>,
    pub(super) dwell: Dwell,
}

impl SettingsFilter {
    /// Settings of the last step; all levels 0 before the first.
    pub fn applied(&self) -> KnobLevels {
        self.applied
    }

    /// Makes the next step jump to its target. Call it when the camera cuts to another place: no
    /// transition from the previous image is visible. The first step of a new filter jumps too.
    pub fn cut(&mut self) {
        self.smooth = false;
        self.dwell.end();
    }

    /// Lets the next target in at once, with a transition.
    pub fn end_dwell(&mut self) {
        self.dwell.end();
    }

    /// Tells the filter this frame's view, `delta_seconds` after the last call. A jump, as
    /// [`is_cut`] finds it, is a [cut](Self::cut).
    pub fn observe_view(&mut self, view: &CameraView, delta_seconds: f64) {
        let now = (view.position, view.rotation * Vec3::NEG_Z);
        self.dwell.see(now);
        if let Some(then) = self.seen.replace(now)
            && is_cut(then, now, delta_seconds as f32)
        {
            self.cut();
        }
    }

    /// Whether the view has moved since the target changed last.
    pub fn has_moved(&self) -> bool {
        self.dwell.has_moved
    }

    /// Whether the next step continues from the applied settings: false after a [cut](Self::cut)
    /// and before the first step.
    pub fn is_smooth(&self) -> bool {
        self.smooth
    }

    /// Continues from `settings`, which were applied outside this filter, at the start of a full
    /// transition.
    pub fn resume_from(&mut self, settings: KnobLevels) {
        for (knob, transition) in self.transitions.iter_mut().enumerate() {
            *transition = Transition::at_rest(settings.level(knob) as u8);
        }
        self.applied = settings;
        self.smooth = true;
    }

    /// Advances by `delta_seconds` towards `target` and returns the settings to apply, always valid
    /// in `space`.
    ///
    /// A transition from rest takes `time`, whatever its length in levels. The step
    /// itself belongs to the previous target: a new target starts at t = 0. A negative or NaN step
    /// counts as 0. Levels of `target` beyond those of `space` are clamped.
    pub fn step(
        &mut self,
        space: &KnobSpace,
        target: KnobLevels,
        delta_seconds: f64,
        time: Duration,
    ) -> KnobLevels {
        // Not `clamp` alone, which lets NaN pass.
        let delta_seconds =
            if delta_seconds > 0.0 { delta_seconds.min(MAX_STEP_SECONDS) } else { 0.0 };
        let target = space.from_levels(|knob, _| target.level(knob));
        if !self.smooth {
            self.resume_from(target);
            return target;
        }
        let (transitions, before) = (&mut self.transitions, self.applied);
        self.applied = space.from_levels(|index, knob| {
            let transition = &mut transitions[index];
            let highest = (knob.levels.len() - 1) as f64;
            let to = target.level(index) as u8;
            let is_at_rest = transition.to == to && transition.remaining() == 0.0;
            let depends = !is_at_rest && knob.needs.is_some();
            if depends && !space.has_effect(before, knob) {
                // Nobody sees it: it is there before it has an effect.
                *transition = Transition::at_rest(to);
                return target.level(index);
            }
            let switch = if is_at_rest { None } else { space.needed_level(knob) };
            transition.advance(delta_seconds, time);
            // Resumed settings may belong to a larger space. `max` also rejects NaN, which
            // reflection may write.
            transition.position = transition.position.max(0.0).min(highest);
            let is_kept = depends && !space.has_effect(target, knob);
            if transition.to != to || transition.is_held {
                transition.turn_to(to, is_kept, switch);
                // A time of 0 completes the transition here.
                transition.advance(0.0, time);
            }
            if !is_kept || transition.remaining() == 0.0 {
                transition.round(switch);
            }
            usize::from(transition.level)
        });
        self.applied
    }
}

#[cfg(test)]
#[path = "filter_tests.rs"]
mod tests;
