//! Models of one camera from readings of others: error and power of all settings, and active knobs.
//!
//! ln e = mean over the other cameras of ln e, plus a Gaussian process over the residuals here. ln
//! p likewise, plus one offset for the camera.

use std::collections::HashMap;
use std::convert::Infallible;

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobLevels, KnobSpace};

use super::Recorded;
use super::lookup::Lookup;
use crate::pool::{
    ErrorModel, GREATEST_ERROR, LEAST_ERROR, OPTIMISM, Screening, SearchedCamera as _,
    model_search, portfolio,
};
use crate::search::{Evaluate, Search};
use crate::table::CostTable;

/// Prior weight, in readings, of an offset of 0 of this camera's power.
const CAMERA_PRIOR: f64 = 1.0;

/// Mean logarithms over the other cameras.
#[derive(Clone, Copy, Debug)]
struct Mean {
    power: f64,
    error: f64,
}

/// Prior knowledge from other cameras.
#[derive(Debug)]
pub(super) struct Others {
    screening: Screening,
    means: HashMap<KnobLevels, Mean>,
}

/// Both models at this camera, as the objectives of a search.
struct Models<'a> {
    others: &'a Others,
    /// The error model's prediction without readings.
    before: ErrorModel<'a>,
    /// Fitted to readings that deviate from `before` as those here deviate from the other cameras'
    /// mean.
    after: ErrorModel<'a>,
    power: f64,
}

impl Others {
    /// `None` without other cameras.
    pub(super) fn of(recorded: &Recorded) -> Option<Self> {
        let table = &recorded.others;
        let mean = |settings: &KnobLevels| {
            let costs: Vec<CostPoint> =
                (0..table.rows()).filter_map(|row| table.get(row, *settings)).collect();
            let mean = |value: fn(&CostPoint) -> f64| {
                costs.iter().map(value).sum::<f64>() / costs.len() as f64
            };
            let mean = Mean {
                power: mean(|cost| cost.power.0.ln()),
                error: mean(|cost| logarithm(cost.error)),
            };
            (!costs.is_empty()).then_some((*settings, mean))
        };
        let means: HashMap<_, _> = table.settings().iter().filter_map(mean).collect();
        (!means.is_empty())
            .then(|| Self { screening: Screening::of(&recorded.space, table), means })
    }

    /// Up to `count` settings that were not requested yet: those of greatest expected gain over the
    /// known ones; then those on the predicted frontier that are farthest in power from all known
    /// ones.
    pub(super) fn propose(
        &self,
        space: &KnobSpace,
        lookup: &Lookup<'_>,
        count: usize,
        seed: u64,
    ) -> Vec<KnobLevels> {
        let readings = lookup.readings();
        let mut models = self.models(space, &readings);
        let known: Vec<KnobLevels> = readings.iter().map(|(settings, _)| *settings).collect();
        let Ok(found) =
            Search::new(space, model_search(seed)).run(&mut models, &known, &mut |_| true);
        let mut table = CostTable::new(1);
        readings.iter().for_each(|(settings, cost)| table.set(0, *settings, *cost));
        for point in found.frontier.points().iter().filter(|point| !lookup.is_known(point.settings))
        {
            let error = (point.cost.error.exp() - LEAST_ERROR).max(0.0);
            table.set(0, point.settings, CostPoint::new(point.cost.power.0.exp(), error));
        }
        let mut chosen = portfolio(&table, known.len() + count, &known);
        while chosen.len() < known.len() + count {
            let Some(next) = farthest(&table, &chosen) else { break };
            chosen.push(next);
        }
        chosen.split_off(known.len().min(chosen.len()))
    }

    fn models<'a>(
        &'a self,
        space: &'a KnobSpace,
        readings: &[(KnobLevels, CostPoint)],
    ) -> Models<'a> {
        let before = ErrorModel::fit(space, &self.screening, &[]);
        let both = || {
            readings
                .iter()
                .filter_map(|(settings, cost)| Some((*settings, *cost, *self.means.get(settings)?)))
        };
        let beyond = |(settings, cost, mean): (KnobLevels, CostPoint, Mean)| {
            (
                settings,
                (before.predict(settings).0 + logarithm(cost.error) - mean.error).exp()
                    - LEAST_ERROR,
            )
        };
        let after =
            ErrorModel::fit(space, &self.screening, &both().map(beyond).collect::<Vec<_>>());
        let (sum, count) = both().fold((0.0, CAMERA_PRIOR), |(sum, count), (_, cost, mean)| {
            (sum + cost.power.0.ln() - mean.power, count + 1.0)
        });
        Models { others: self, before, after, power: sum / count }
    }
}

impl Evaluate for Models<'_> {
    type Error = Infallible;

    fn evaluate(&mut self, settings: KnobLevels) -> Result<CostPoint, Infallible> {
        let Some(mean) = self.others.means.get(&settings) else {
            return Ok(CostPoint::new(f64::INFINITY, f64::INFINITY));
        };
        let (after, deviation) = self.after.predict(settings);
        let error = mean.error + after - self.before.predict(settings).0 - OPTIMISM * deviation;
        Ok(CostPoint::new(
            mean.power + self.power,
            error.clamp(LEAST_ERROR.ln(), logarithm(GREATEST_ERROR)),
        ))
    }
}

/// The settings in `table` that are not `chosen` and are farthest from them in the logarithm of
/// power.
fn farthest(table: &CostTable, chosen: &[KnobLevels]) -> Option<KnobLevels> {
    let power =
        |settings: &KnobLevels| table.get(0, *settings).map_or(f64::NAN, |cost| cost.power.0.ln());
    let near: Vec<f64> = chosen.iter().map(power).collect();
    let distance = |settings: &KnobLevels| {
        near.iter().map(|other| (other - power(settings)).abs()).fold(f64::INFINITY, f64::min)
    };
    let open = table.settings().iter().filter(|settings| !chosen.contains(settings));
    open.copied().max_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn logarithm(error: f64) -> f64 {
    (error.max(0.0) + LEAST_ERROR).ln()
}
