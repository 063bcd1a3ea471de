//! Regret on a synthetic renderer.

use std::ops::ControlFlow;
use std::path::Path;

use bevy_frugal_gi::frontier::{Frontier, FrontierMap, FrontierPoint, Octree};

use super::*;
use crate::cameras::CameraSet;
use crate::inspect::testing::map_of;
use crate::journal::{Existing, Journal, JournalHeader};
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
        journal: Journal::open(journal, &JournalHeader::default(), Existing::Resume)
            .expect("a journal"),
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
fn a_map_has_little_regret_at_unseen_cameras_and_one_that_selects_badly_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let (space, bounds, mut cameras, outcome) = searched();
    // None that the map was fitted to.
    cameras.training = std::mem::take(&mut cameras.unrendered);
    let map = map_of(&outcome, bounds, space);
    let (found, made) = regret(&map, &cameras, &folder.path().join("map"), usize::MAX);
    let found = found.expect("regret");
    assert_eq!(found.len(), cameras.training.len());
    assert!(made <= 4 * 43 + 3 * found.len(), "{made}");
    let searched: Vec<usize> =
        (0..found.len()).filter(|camera| found[*camera].budgets[0].least_w.is_some()).collect();
    assert_eq!(searched, [0, 10, 20, 30]);
    for (number, camera) in found.iter().enumerate() {
        let is_searched = searched.contains(&number);
        assert_eq!((camera.budgets.len(), camera.rendered > 15), (3, is_searched), "{camera:?}");
        let regrets = camera.budgets.iter().map(AtCamera::regret);
        assert!(regrets.into_iter().all(|regret| match regret {
            Some(regret) => is_searched && regret >= 0.0,
            None => !is_searched,
        }));
    }
    // One that knows nothing but few VPLs at a few pixels, with all else at its best.
    let settings = map.knobs.highest().with_level(0, 1).with_level(1, 0);
    let point = FrontierPoint { settings, cost: CostPoint::new(1.0, 0.001) };
    let bad = FrontierMap {
        shared: Frontier::from_points([point]),
        octree: Octree { corners: Vec::new(), frontiers: Vec::new(), ..map.octree.clone() },
        ..map.clone()
    };
    let (worse, _) = regret(&bad, &cameras, &folder.path().join("bad"), usize::MAX);
    let [little, more] = [median(&found), median(&worse.expect("regret"))];
    assert!(little < 0.1 && more > little + 0.1, "{little} and {more}");
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
    let known: BTreeMap<KnobLevels, CostPoint> =
        [(4.0, 0.03), (5.0, 0.02), (5.5, 0.001), (6.0, 0.02)]
            .into_iter()
            .enumerate()
            .map(|(bits, (power, error))| {
                (KnobLevels::from_bits(bits as u128), CostPoint::new(power, error))
            })
            .collect();
    let selected = (KnobLevels::from_bits(3), CostPoint::new(6.0, 0.02));
    assert_eq!(least(&known, selected), (KnobLevels::from_bits(1), 5.0));
    assert_eq!(least(&BTreeMap::new(), selected), (selected.0, 6.0), "nothing takes less");
    let at = |power_w: f64, least_w: Option<f64>| AtCamera {
        budget: 0.02,
        settings: String::new(),
        power_w,
        error: 0.02,
        least_w,
        least_settings: None,
    };
    assert!((at(6.0, Some(5.0)).regret().expect("searched") - 0.2).abs() < 1e-12);
    assert_eq!(at(6.0, None).regret(), None);
    assert_eq!(at(0.0, Some(0.0)).regret(), None, "0 of 0 W");
}
