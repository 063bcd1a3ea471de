//! What levels of knobs cost alone: those that the renderer keeps once for the whole app, and all of
//! them for people.

use frugal_core::frontier::{SharedKnobs, WorkPrices};
use frugal_core::knobs::{KnobLevels, KnobSpace};

use super::{CostModel, FrameLayout, Work};

/// Built-in knobs of app scope whose work is priced, in the order of the table. The frame rate is the
/// app's, too, but no work of a frame.
pub const SHARED_KNOBS: [&str; 2] = ["shadow_map_resolution", "shadow_cascades"];

/// A model's prices as energy, for a map or a file of a device.
pub fn work_prices(
    model: &CostModel,
    space: &KnobSpace,
    layout: &FrameLayout,
    frames_per_second: f64,
) -> WorkPrices {
    let kinds = super::work_names(space);
    let mut joules: Vec<f64> = model.prices.iter().map(|watts| watts / frames_per_second).collect();
    joules.resize(kinds.len(), 0.0);
    let prices = WorkPrices {
        kinds,
        joules,
        idle: model.idle,
        maps: layout.maps,
        point_lights: layout.point_lights,
        has_sky: layout.has_sky,
        ..WorkPrices::default()
    };
    with_shared_knobs(prices, space, layout)
}

/// `prices` with the energy of each combination of levels of the shared knobs that `space` has, all
/// other knobs at their best.
pub(super) fn with_shared_knobs(
    mut prices: WorkPrices,
    space: &KnobSpace,
    layout: &FrameLayout,
) -> WorkPrices {
    let shared: Vec<usize> = SHARED_KNOBS.iter().filter_map(|name| space.index_of(name)).collect();
    let mut combinations = vec![space.highest()];
    for knob in &shared {
        let levels = 0..space.knobs()[*knob].levels.len();
        combinations = combinations
            .iter()
            .flat_map(|held| levels.clone().map(|level| held.with_level(*knob, level)))
            .collect();
    }
    let energies: Vec<f64> =
        combinations.iter().map(|settings| energy(&prices, space, *settings, layout)).collect();
    let lowest = energies.iter().copied().fold(f64::INFINITY, f64::min);
    prices.shared = if shared.is_empty() {
        SharedKnobs::default()
    } else {
        SharedKnobs {
            names: shared.iter().map(|knob| space.knobs()[*knob].name.clone()).collect(),
            joules: energies.iter().map(|energy| short(energy - lowest)).collect(),
        }
    };
    prices
}

/// Energy that each level of each knob saves in a frame, all other knobs at their best; at least 0.
pub(crate) fn saved_joules(
    prices: &WorkPrices,
    space: &KnobSpace,
    layout: &FrameLayout,
) -> Vec<Vec<f64>> {
    let best = space.highest();
    let highest = energy(prices, space, best, layout);
    let saved = |knob: usize, level: usize| {
        short((highest - energy(prices, space, best.with_level(knob, level), layout)).max(0.0))
    };
    let knobs = space.knobs().iter().enumerate();
    knobs.map(|(knob, it)| (0..it.levels.len()).map(|level| saved(knob, level)).collect()).collect()
}

/// Energy of a frame's work at `prices`, joules.
pub(super) fn energy(
    prices: &WorkPrices,
    space: &KnobSpace,
    settings: KnobLevels,
    layout: &FrameLayout,
) -> f64 {
    let work = Work::of(space, settings, layout);
    work.0.iter().zip(&prices.joules).map(|(work, joules)| work * joules).sum()
}

/// Four digits: prices are known to a few percent.
fn short(joules: f64) -> f64 {
    format!("{joules:.3e}").parse().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::work_names;

    #[test]
    fn finer_shadows_cost_every_camera_more() {
        let space = crate::testing::every_knob();
        let layout = FrameLayout { size: [160, 90], maps: 1, point_lights: 0, has_sky: true };
        let kinds = work_names(&space);
        let joules = kinds.iter().map(|kind| if kind == "shadow texels" { 1e-9 } else { 1e-6 });
        let prices = WorkPrices { joules: joules.collect(), kinds, ..WorkPrices::default() };
        let shared = with_shared_knobs(prices.clone(), &space, &layout).shared;
        assert!(shared.is_sound(&space) && shared.joules.len() == 16, "{shared:?}");
        assert_eq!((shared.joules[0], shared.names.len()), (0.0, 2));
        // 2048² texels in four cascades, less 256² in one, and three cascades.
        let expected = 1e-9 * (4.0 * 2048.0 * 2048.0 - 256.0 * 256.0) + 3e-6;
        assert!((shared.joules[15] / expected - 1.0).abs() < 1e-3, "{}", shared.joules[15]);
        let scopes = space.subset(["gi_vpl_count"]).expect("a knob");
        assert_eq!(with_shared_knobs(prices, &scopes, &layout).shared, SharedKnobs::default());
    }

    #[test]
    fn a_lower_level_saves_energy_and_the_best_none() {
        let space = crate::testing::knobs();
        let layout = FrameLayout { size: [160, 90], maps: 1, point_lights: 0, has_sky: true };
        let kinds = work_names(&space);
        let prices = WorkPrices { joules: vec![1e-9; kinds.len()], kinds, ..WorkPrices::default() };
        let saved = saved_joules(&prices, &space, &layout);
        let vpls = &saved[space.index_of("gi_vpl_count").expect("a knob")];
        assert!(vpls.windows(2).all(|pair| pair[0] > pair[1]), "{vpls:?}");
        assert!(saved.iter().all(|levels| levels.last() == Some(&0.0)), "{saved:?}");
    }
}
