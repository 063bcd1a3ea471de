//! The text of a panel, from plain facts. ASCII only, as far as the HUD's own words go: Bevy's
//! default font has little more.

use std::fmt::Debug;

use bevy_frugal_gi::control::{
    Budget, ControlStatus, FeedbackState, PowerCorrection, PowerFeedback, Selection,
};
use bevy_frugal_gi::error_meter::MeasuredError;
use bevy_frugal_gi::frontier::{CostPoint, Frontier, KnobEffects, MapFit};
use bevy_frugal_gi::knobs::{Knob, KnobLevels, KnobSettings, KnobSpace};
use bevy_frugal_gi::power::{MeterState, MeteredPower};
use bevy_frugal_gi::units::Watts;

/// What is known of a camera; `None` is unknown, or not there.
#[derive(Clone, Copy, Default)]
pub(super) struct Facts<'a> {
    /// Heading, where there are several panels.
    pub name: Option<&'a str>,
    /// Share of the levels that a warm-up has shown.
    pub warming: Option<f32>,
    pub selection: Option<&'a Selection>,
    pub budget: Option<&'a Budget>,
    /// The limit of all cameras together.
    pub app_budget: Option<Watts>,
    pub fit: Option<&'a MapFit>,
    pub settings: Option<&'a KnobSettings>,
    /// What levels save and cost alone, at a frame rate.
    pub effects: Option<(&'a KnobEffects, f64)>,
    pub metered: Option<&'a MeteredPower>,
    pub measured: Option<&'a MeasuredError>,
    pub feedback: Option<&'a PowerFeedback>,
}

impl Facts<'_> {
    /// Budget, outcome, power and error.
    pub(super) fn summary(&self) -> String {
        let predicted = self.selection.and_then(|selection| selection.predicted_applied);
        let mut lines: Vec<String> = self.name.map(str::to_owned).into_iter().collect();
        let mut row = |label: &str, text: String| lines.push(format!("{label:<10}{text}"));
        row("budget", self.limits());
        row("outcome", self.outcome());
        if let Some(limit) = self.selection.and_then(|selection| selection.binding) {
            row("held by", words(&limit));
        }
        if let (Some(selection), Some(applied)) = (self.selection, predicted) {
            row("predicted", cost(applied));
            if let Some(target) = selection.predicted.filter(|target| *target != applied) {
                row("target", cost(target));
            }
        }
        if let Some(metered) = self.metered {
            row("metered", power(metered));
        }
        if let Some((error, count)) = self.measured.and_then(|it| Some((it.last?, it.count))) {
            row("measured", format!("error {}, number {count}", number(error, 4)));
        }
        // It corrects predictions; without any it says nothing.
        if let (Some(feedback), Some(_)) = (self.feedback, predicted)
            && let Some(text) = correction(feedback)
        {
            row("feedback", text);
        }
        let misfits: Vec<_> =
            self.fit.into_iter().flat_map(MapFit::misfits).map(|misfit| words(&misfit)).collect();
        if !misfits.is_empty() {
            row("map", format!("made for another {}", misfits.join(", ")));
        }
        if self.feedback.is_some_and(|feedback| feedback.has_left_map) {
            row("map", "the scene has changed since: all views as one".to_owned());
        }
        lines.join("\n")
    }

    fn limits(&self) -> String {
        let budget = self.budget.copied().unwrap_or_default();
        // Infinity is no limit.
        let finite = |limit: Option<f64>| limit.filter(|limit| *limit != f64::INFINITY);
        let power = |limit: Option<Watts>| finite(limit.map(|it| it.0)).map(|it| watts(Watts(it)));
        let energy = finite(budget.energy_per_frame.map(|limit| limit.0));
        let limits: Vec<String> = [
            power(budget.power),
            power(budget.peak).map(|limit| format!("peak {limit}")),
            finite(budget.error).map(|limit| format!("error {}", number(limit, 4))),
            energy.map(|limit| format!("{} mJ a frame", number(1e3 * limit, 1))),
            budget.frame_time.map(|limit| format!("{} ms", number(1e3 * limit.as_secs_f64(), 1))),
            budget
                .battery_until
                .map(|end| format!("battery until {} min", number(end.as_secs_f64() / 60.0, 1))),
            budget
                .headroom
                .filter(|keep| *keep > 0.0)
                .map(|keep| format!("headroom {} %", number(100.0 * keep, 0))),
            power(self.app_budget).map(|limit| format!("{limit} of the app")),
        ]
        .into_iter()
        .flatten()
        .collect();
        if limits.is_empty() { "none".to_owned() } else { limits.join(", ") }
    }

    fn outcome(&self) -> String {
        if let Some(share) = self.warming {
            return format!("warming up, {} %", number(100.0 * f64::from(share), 0));
        }
        let Some(selection) = self.selection else {
            return "settings by hand".to_owned();
        };
        match selection.status {
            ControlStatus::Waiting => "waiting for the map".to_owned(),
            ControlStatus::Active(outcome) => words(&outcome),
            ControlStatus::Off(reason) => format!("off: {}", words(&reason)),
            status => words(&status),
        }
    }

    /// Power and error of a knob's level against its best, alone; nothing where neither is seen.
    fn effect(&self, knob: usize, level: usize) -> String {
        let effect = self.effects.and_then(|(effects, rate)| effects.of(knob, level, rate));
        let seen = effect.filter(|effect| effect.power.0 >= 0.005 || effect.error >= 0.00005);
        seen.map_or(String::new(), |CostPoint { power, error, .. }| {
            format!(" -{}, error +{}", watts(power), number(error, 4))
        })
    }

    /// The knobs in force with their levels, a line for each.
    pub(super) fn knobs(&self) -> String {
        let Some(KnobSettings { space, settings }) = self.settings else { return String::new() };
        let target = self
            .selection
            .filter(|selection| matches!(selection.status, ControlStatus::Active(_)))
            .map_or(*settings, |selection| selection.target);
        let knobs = || space.knobs().iter().enumerate();
        let change = |index: usize, knob: &Knob| {
            let (now, then) =
                (label(knob, settings.level(index)), label(knob, target.level(index)));
            if now == then { now.to_owned() } else { format!("{now} > {then}") }
        };
        let place = |index: usize, knob: &Knob| {
            let last = knob.levels.len();
            // A level beyond the last counts as the last.
            format!("{}/{last}", (settings.level(index) + 1).min(last))
        };
        let width = knobs().map(|(_, knob)| knob.name.len()).max().unwrap_or(0);
        let line = |(index, knob)| {
            let (name, level) = (spaced(knob), place(index, knob));
            let effect = self.effect(index, settings.level(index));
            let line = format!("{name:<width$} {level:>5}  {:<8}{effect}", change(index, knob));
            line.trim_end().to_owned()
        };
        knobs().map(line).collect::<Vec<_>>().join("\n")
    }
}

/// A frontier in a line, with its powers in the meter's watts; `None`: none is known.
pub(super) fn caption(frontier: Option<&Frontier>, correction: PowerCorrection) -> String {
    let points = frontier.map_or(&[][..], Frontier::points);
    let (Some(first), Some(last)) = (points.first(), points.last()) else {
        return "no frontier".to_owned();
    };
    let power = |cost: CostPoint| number(correction.corrected(cost.power).0, 2);
    format!(
        "{} points, {}..{} W, error {}..{}",
        points.len(),
        power(first.cost),
        power(last.cost),
        number(first.cost.error, 3),
        number(last.cost.error, 3)
    )
}

/// A transition: when it began, at most `most` knobs that change, and the number of others. Dots
/// where it has not ended.
pub(super) fn switch_line(
    space: &KnobSpace,
    seconds: f64,
    (from, to): (KnobLevels, KnobLevels),
    is_done: bool,
    most: usize,
) -> String {
    let is_changed = |(index, _): &(usize, &Knob)| from.level(*index) != to.level(*index);
    let changed = || space.knobs().iter().enumerate().filter(is_changed);
    let named = changed().take(most).map(|(index, knob)| {
        let [from, to] = [from, to].map(|settings| label(knob, settings.level(index)));
        format!("{} {from} > {to}", spaced(knob))
    });
    let mut line = format!("{} s  {}", number(seconds, 1), named.collect::<Vec<_>>().join(", "));
    let others = changed().count().saturating_sub(most);
    if others > 0 {
        line += &format!(", +{others}");
    }
    if !is_done {
        line += " ...";
    }
    line
}

/// A number with `decimals`, as a power of ten where it has too many digits, and `?` for NaN.
pub(super) fn number(value: f64, decimals: usize) -> String {
    match value.abs() {
        _ if value.is_nan() => "?".to_owned(),
        f64::INFINITY => if value > 0.0 { "inf" } else { "-inf" }.to_owned(),
        size if size >= 1e5 => format!("{value:.1e}"),
        _ => format!("{value:.decimals$}"),
    }
}

fn watts(power: Watts) -> String {
    format!("{} W", number(power.0, 2))
}

fn cost(cost: CostPoint) -> String {
    format!("{}, error {}", watts(cost.power), number(cost.error, 4))
}

/// Metered power with its provenance, or why it is unknown.
fn power(metered: &MeteredPower) -> String {
    match (&metered.state, metered.mean, &metered.info) {
        (_, Some(mean), Some(info)) => {
            format!("{}, {} ({})", watts(mean), info.provenance, info.name)
        }
        (MeterState::Lost { reason }, ..) => format!("lost: {reason}"),
        (MeterState::Unavailable { reason }, ..) => format!("unknown: {reason}"),
        _ => "not yet".to_owned(),
    }
}

/// How metered power corrects the predictions, with the uncertainty; `None` where it does not.
fn correction(feedback: &PowerFeedback) -> Option<String> {
    let state = match feedback.state {
        FeedbackState::Off => return None,
        FeedbackState::Waiting => return Some("waiting for a reading".to_owned()),
        FeedbackState::Running => "",
        FeedbackState::Held => "meter lost, ",
    };
    let PowerCorrection { gain, offset } = feedback.correction;
    let deviation =
        feedback.deviation.map_or(String::new(), |deviation| format!(", +-{}", watts(deviation)));
    Some(format!("{state}map x {} + {}{deviation}", number(gain, 2), watts(offset)))
}

fn label(knob: &Knob, level: usize) -> &str {
    knob.levels.get(level).or(knob.levels.last()).map_or("?", |level| level.label.as_str())
}

fn spaced(knob: &Knob) -> String {
    knob.name.replace('_', " ")
}

/// `MapNotLoaded` as "map not loaded".
fn words(name: &impl Debug) -> String {
    let mut words = String::new();
    for letter in format!("{name:?}").chars() {
        if letter.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(letter.to_lowercase());
    }
    words
}

#[cfg(test)]
#[path = "text_tests.rs"]
mod tests;
