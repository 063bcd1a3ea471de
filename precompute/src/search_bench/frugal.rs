//! The project's own search at one camera, as in precomputation: screening, then rounds of
//! proposals on models of power and error.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::KnobLevels;

use super::Recorded;
use super::lookup::Lookup;
use super::others::Others;
use crate::cost::{CostModel, CostReading, Work};
use crate::pool::{Proposal, Screening, propose, round_seed, screening_settings};

/// Without prior knowledge.
pub(super) fn cold(recorded: &Recorded, batch: usize, seed: u64, lookup: &mut Lookup<'_>) {
    lookup.ask_all(screening_settings(&recorded.space));
    let screening = Screening::of(&recorded.space, &lookup.known);
    rounds(recorded, &screening, batch, seed, lookup);
}

/// With readings of other cameras, which replace the screening and provide the prior of the models.
/// When these models have no more proposals, the search continues as at an unknown camera.
pub(super) fn warm(
    recorded: &Recorded,
    others: &Others,
    batch: usize,
    seed: u64,
    lookup: &mut Lookup<'_>,
) {
    for round in 0.. {
        let proposed = others.propose(&recorded.space, lookup, batch, round_seed(seed, round));
        if proposed.is_empty() {
            break;
        }
        lookup.ask_all(proposed);
        if lookup.is_done() {
            return;
        }
    }
    rounds(recorded, others.screening(), batch, seed, lookup);
}

/// Rounds of proposals, until all goals are reached or there are no more proposals.
fn rounds(
    recorded: &Recorded,
    screening: &Screening,
    batch: usize,
    seed: u64,
    lookup: &mut Lookup<'_>,
) {
    let Recorded { space, layout, .. } = recorded;
    for round in 0.. {
        if lookup.is_done() {
            return;
        }
        let readings = lookup.readings();
        let reading = |(settings, cost): &(KnobLevels, CostPoint)| CostReading {
            camera: 0,
            work: Work::of(space, *settings, layout),
            power_w: cost.power.0,
        };
        let cost = CostModel::fit(&readings.iter().map(reading).collect::<Vec<_>>());
        let errors: Vec<_> =
            readings.iter().map(|(settings, cost)| (*settings, cost.error)).collect();
        let proposal = Proposal { space, screening, cost: &cost, layout, errors: &errors };
        // Settings that the table lacks have no reading, and so are proposed again.
        let proposed = propose(&proposal, batch + lookup.missing(), round_seed(seed, round));
        let fresh: Vec<_> = proposed
            .into_iter()
            .filter(|settings| !lookup.is_known(*settings))
            .take(batch)
            .collect();
        if fresh.is_empty() {
            return;
        }
        lookup.ask_all(fresh);
    }
}
