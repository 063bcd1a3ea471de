//! The final frontier of a camera: from every evaluated point, measured again where that may change it.

use bevy_frugal_gi::frontier::{CostPoint, Frontier, FrontierPoint};

use super::{Cached, Evaluate, Monitor, SampleCamera};

/// The frontier of all that is known at `camera`, after [refining](Evaluate::refine) its points and those that miss it by at most `margin`.
///
/// Only refined points are on it, so that a lucky first reading does not take the place of an honest second one. Points that were refined before
/// are not refined again. When `monitor` says stop, the readings so far stand.
///
/// Under a time limit nothing is refined: more than half of a short run's time would go into it, and a map's costs are measured again afterwards, where its
/// frontiers are used (see [`cells`](crate::cells)). What is left of the luck of first readings is a few per cent of power; what a frontier
/// lacks for want of evaluations is more.
///
/// # Errors
/// When a refinement fails.
pub fn settle<E: Evaluate>(
    cached: &mut Cached<'_, E>,
    camera: SampleCamera,
    margin: f64,
    monitor: &mut dyn Monitor,
) -> Result<Frontier, E::Error> {
    let frontier = Frontier::from_points(cached.points(camera));
    if monitor.remaining_seconds().is_some() {
        return Ok(frontier);
    }
    let near = near(&frontier, cached.points(camera), margin);
    let mut refined = Vec::new();
    for point in frontier.points().iter().chain(&near) {
        let cost = if monitor.keep_going() { cached.refine(camera, point.settings, point.cost)? } else { point.cost };
        refined.push(FrontierPoint { settings: point.settings, cost });
    }
    Ok(Frontier::from_points(refined))
}

/// Points off the frontier that would be on it, were they better by `margin` of its ranges: the closest, at most as many as it has points.
fn near(frontier: &Frontier, points: impl Iterator<Item = FrontierPoint>, margin: f64) -> Vec<FrontierPoint> {
    let (Some(first), Some(last)) = (frontier.points().first(), frontier.points().last()) else { return Vec::new() };
    let range = CostPoint { power: last.cost.power - first.cost.power, error: first.cost.error - last.cost.error };
    let on = |point: &FrontierPoint| frontier.points().iter().any(|other| other.settings == point.settings);
    let mut missing: Vec<_> = points
        .filter(|point| point.cost.is_finite() && !on(point))
        .map(|point| (missing_by(frontier, point.cost, range), point))
        .filter(|(missing, _)| *missing <= margin)
        .collect();
    missing.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.settings.cmp(&b.1.settings)));
    missing.into_iter().map(|(_, point)| point).take(frontier.points().len()).collect()
}

/// The least share of the ranges by which `cost` would have to be better in both to be beaten by none.
fn missing_by(frontier: &Frontier, cost: CostPoint, range: CostPoint) -> f64 {
    let share = |excess: f64, range: f64| if excess <= 0.0 { 0.0 } else { excess / range };
    let beating = frontier.points().iter().filter(|point| point.cost.power <= cost.power && point.cost.error <= cost.error);
    beating
        .map(|point| {
            let (power, error) = (cost.power - point.cost.power, cost.error - point.cost.error);
            share(power.0, range.power.0).min(share(error, range.error))
        })
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use bevy::math::Vec3;
    use bevy_frugal_gi::frontier::ViewDirection;
    use bevy_frugal_gi::knobs::RenderSettings;

    use super::*;
    use crate::search::Unwatched;

    const CAMERA: SampleCamera = SampleCamera { position: Vec3::ZERO, view: ViewDirection::PositiveX };

    /// First readings that flatter setting 1 and wrong setting 2.
    #[derive(Default)]
    struct Noisy {
        refined: Vec<u64>,
    }

    impl Evaluate for Noisy {
        type Error = Infallible;

        fn sees(&mut self, _: SampleCamera) -> Result<bool, Infallible> {
            Ok(true)
        }

        fn evaluate(&mut self, _: SampleCamera, settings: RenderSettings) -> Result<CostPoint, Infallible> {
            Ok([(1.0, 0.5), (1.9, 0.1), (2.0, 0.101), (3.0, 0.0), (2.9, 0.4)].map(|(p, e)| CostPoint::new(p, e))[settings.bits() as usize])
        }

        fn refine(&mut self, _: SampleCamera, settings: RenderSettings, so_far: CostPoint) -> Result<CostPoint, Infallible> {
            self.refined.push(settings.bits());
            Ok(match settings.bits() {
                1 => CostPoint::new(2.2, 0.2),
                _ => so_far,
            })
        }
    }

    #[test]
    fn refinement_unmasks_a_lucky_reading_and_happens_once() {
        let mut noisy = Noisy::default();
        let mut cached = Cached::new(&mut noisy);
        for bits in 0..5 {
            let Ok(_) = cached.evaluate(CAMERA, RenderSettings::from_bits(bits));
        }
        let settings = |frontier: &Frontier| frontier.points().iter().map(|point| point.settings.bits()).collect::<Vec<_>>();
        assert_eq!(settings(&Frontier::from_points(cached.points(CAMERA))), [0, 1, 3]);
        let Ok(frontier) = settle(&mut cached, CAMERA, 0.01, &mut Unwatched);
        // 2 missed by 0.2 % of the error's range; 4 misses by 50 % of the power's.
        assert_eq!(settings(&frontier), [0, 2, 3]);
        let Ok(again) = settle(&mut cached, CAMERA, 0.01, &mut Unwatched);
        assert_eq!(again, frontier);
        assert_eq!(cached.counts().refinements, 4);
        assert_eq!(noisy.refined, [0, 1, 3, 2]);
    }

    #[test]
    fn without_a_margin_only_the_frontier_is_refined() {
        let mut noisy = Noisy::default();
        let mut cached = Cached::new(&mut noisy);
        for bits in 0..5 {
            let Ok(_) = cached.evaluate(CAMERA, RenderSettings::from_bits(bits));
        }
        let Ok(_) = settle(&mut cached, CAMERA, 0.0, &mut Unwatched);
        assert_eq!(noisy.refined, [0, 1, 3]);
    }
}
