//! Regret on a synthetic renderer.

use std::ops::ControlFlow;
use std::path::Path;

use bevy_frugal_gi::frontier::{Frontier, FrontierMap, Octree};

use super::*;
use crate::cameras::CameraSet;
use crate::inspect::testing::map_of;
use crate::journal::{Journal, JournalHeader};
use crate::pipeline::Progress;
use crate::pipeline::tests::{Formula, layout, searched};

const BUDGETS: [f64; 3] = [0.01, 0.03, 0.06];

/// Regret of `map` at the training cameras of `cameras`, with the number of renderings that were made;
/// `patience`: renderings after which it is stopped.
fn regret(
    map: &FrontierMap,
    cameras: &CameraSet,
    journal: &Path,
    patience: usize,
) -> (Option<Vec<CameraRegret>>, usize) {
    let layout = layout();
    let plan = RegretPlan {
        map,
        layout: &layout,
        budgets: &BUDGETS,
        searched: 4,
        renderings: 40,
        batch: 8,
        seed: 1,
    };
    let mut formula = Formula { space: map.knobs.clone(), renderings: 0 };
    let mut left = patience;
    let mut report = |_: &Progress<'_>| {
        left -= 1;
        if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let setup = Setup {
        measure: &mut formula,
        journal: Journal::resume(journal, &JournalHeader::default()).expect("a journal"),
        cameras,
        clip: (2, 15.0),
        shard: (0, 1),
        limit: None,
        report: &mut report,
    };
    let found = match run(&plan, (1.0, 1.5), setup) {
        Ok(found) => Some(found),
        Err(PipelineError::Interrupted) => None,
        Err(error) => panic!("{error}"),
    };
    (found, formula.renderings)
}

fn median(found: &[CameraRegret]) -> f64 {
    let mut all: Vec<f64> =
        found.iter().flat_map(|camera| &camera.budgets).filter_map(AtCamera::regret).collect();
    all.sort_by(f64::total_cmp);
    crate::quantile::quantile(&all, 0.5)
}

#[test]
fn a_good_map_has_less_regret_than_its_shared_frontier_and_a_poor_one_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let (space, bounds, mut cameras, outcome) = searched();
    // None that the map was fitted to.
    cameras.training = std::mem::take(&mut cameras.unrendered);
    let map = map_of(&outcome, bounds, space);
    let (found, made) = regret(&map, &cameras, &folder.path().join("map"), usize::MAX);
    let found = found.expect("regret");
    assert_eq!(found.len(), cameras.training.len());
    let searched = found.iter().filter(|camera| camera.rendered >= 40).count();
    assert_eq!(searched, 4, "and the others render their selections alone");
    assert!(made <= 4 * 43 + 3 * found.len(), "{made}");
    for camera in &found {
        assert_eq!(camera.budgets.len(), BUDGETS.len());
        for at in &camera.budgets {
            assert_eq!(at.regret().is_some(), camera.rendered >= 40);
            assert!(at.regret().is_none_or(|regret| regret >= 0.0), "{at:?}");
        }
    }
    // Nothing but the best settings: whatever saves power has more error than none.
    let best = map.knobs.canonical(map.knobs.highest());
    let dear = map.shared.points().iter().filter(|point| point.settings == best).copied();
    let dear = FrontierMap {
        shared: Frontier::from_points(dear),
        octree: Octree { corners: Vec::new(), frontiers: Vec::new(), ..map.octree.clone() },
        ..map.clone()
    };
    let (poor, _) = regret(&dear, &cameras, &folder.path().join("dear"), usize::MAX);
    let poor = poor.expect("regret");
    assert!(poor.iter().all(|camera| camera.budgets.iter().all(|at| at.error < 1e-9)));
    assert!(median(&found) < 0.2, "{}", median(&found));
}

#[test]
fn an_interrupted_comparison_goes_on_where_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let (space, bounds, cameras, outcome) = searched();
    let map = map_of(&outcome, bounds, space);
    let (whole, all) = regret(&map, &cameras, &folder.path().join("whole"), usize::MAX);
    let file = folder.path().join("stopped");
    let mut made = 0;
    let found = loop {
        let (found, more) = regret(&map, &cameras, &file, 37);
        made += more;
        if let Some(found) = found {
            break found;
        }
    };
    assert_eq!((Some(found), made), (whole, all));
}

#[test]
fn regret_is_power_above_the_least_of_as_little_error() {
    let cost = CostPoint::new(6.0, 0.02);
    let known = [(4.0, 0.03), (5.0, 0.02), (5.5, 0.001), (6.0, 0.02)]
        .map(|(power, error)| CostPoint::new(power, error));
    let at = at_camera(0.02, cost, Some(&known));
    assert!((at.regret().expect("searched") - 0.2).abs() < 1e-12, "{at:?}");
    assert_eq!(at_camera(0.02, cost, None).regret(), None);
    let odd = at_camera(0.02, CostPoint::new(0.0, 0.0), Some(&[]));
    assert_eq!(odd.regret(), None, "0 of 0 W");
}
