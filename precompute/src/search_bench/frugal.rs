//! The project's own search at one camera, as in precomputation.

use super::Recorded;
use super::lookup::Lookup;
use super::others::Others;
use crate::pool::{CameraSearch, SearchedCamera as _, round_seed};

/// Without prior knowledge.
pub(super) fn cold(recorded: &Recorded, batch: usize, seed: u64, lookup: &mut Lookup<'_>) {
    let Ok(()) = search(recorded, batch, seed).run(lookup);
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
        let Ok(()) = lookup.ask_all(proposed);
        if lookup.is_done() {
            return;
        }
    }
    let Ok(()) = search(recorded, batch, seed).rounds(others.screening(), lookup);
}

const fn search(recorded: &Recorded, batch: usize, seed: u64) -> CameraSearch<'_> {
    CameraSearch { space: &recorded.space, layout: &recorded.layout, batch, seed }
}
