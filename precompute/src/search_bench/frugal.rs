//! The project's own search at one camera, as in precomputation.

use super::Recorded;
use super::lookup::Lookup;
use super::others::Others;
use crate::pool::{CameraSearch, SearchedCamera as _, round_seed};

/// Without prior knowledge.
pub(super) fn cold(recorded: &Recorded, batch: usize, seed: u64, lookup: &mut Lookup<'_>) {
    let Ok(()) = search(recorded, batch, seed).run(lookup);
}

/// With readings of other cameras: proposals by their models, in turn with the search at an unknown
/// camera, which a view unlike the others needs. Models of other cameras alone needed 63 to 116
/// renderings at one of four views, where 4 to 10 are enough.
pub(super) fn warm(
    recorded: &Recorded,
    others: &Others,
    batch: usize,
    seed: u64,
    lookup: &mut Lookup<'_>,
) {
    let by_others = |round: u64, lookup: &mut Lookup<'_>| {
        let proposed = others.propose(&recorded.space, lookup, batch, round_seed(seed, round));
        let proposes = !proposed.is_empty();
        let Ok(()) = lookup.ask_all(proposed);
        proposes
    };
    let search = search(recorded, batch, seed);
    by_others(0, lookup);
    let Ok(screening) = search.screen(lookup);
    for round in 1.. {
        if lookup.is_done() {
            break;
        }
        let others_propose = by_others(round, lookup);
        let Ok(proposes) = search.round(&screening, round, lookup);
        if !(others_propose || proposes) {
            break;
        }
    }
}

const fn search(recorded: &Recorded, batch: usize, seed: u64) -> CameraSearch<'_> {
    CameraSearch { space: &recorded.space, layout: &recorded.layout, batch, seed }
}
