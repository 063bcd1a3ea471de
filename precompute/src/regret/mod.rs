//! Regret of a map at unseen cameras: the power of what it selects there, above the least power of as
//! little error that a search at that camera finds.
//!
//! Every error budget is selected for as at run time, by the camera's address and the calibrated rate
//! of the budget. At all cameras the selections are rendered, which tells their errors; at some a whole
//! search, which tells what would have been possible. All renderings are journaled. Independent of the
//! renderer.

mod select;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use bevy_frugal_gi::frontier::{CameraView, CostPoint, FrontierMap};
use bevy_frugal_gi::knobs::KnobLevels;
use serde::Serialize;

use crate::cameras::MovingCamera;
use crate::cost::FrameLayout;
use crate::pipeline::{Job, PipelineError, Purpose, Renderings, Setup};
use crate::pool::{CameraSearch, SearchedCamera};
use crate::table::{CostTable, Measure};

/// The extent of the comparison.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RegretPlan<'a> {
    /// The map.
    pub map: &'a FrontierMap,
    /// Parameters of the work model other than settings.
    pub layout: &'a FrameLayout,
    /// Error budgets, 1 − SSIM.
    pub budgets: &'a [f64],
    /// Number of cameras, evenly spread over all, at which a search is made. Higher values take longer.
    pub searched: usize,
    /// Renderings of each search. Higher values find less power, and so more regret.
    pub renderings: usize,
    /// Settings proposed per round of a search.
    pub batch: usize,
    /// Seed of the searches.
    pub seed: u64,
}

/// A budget at one camera.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct AtCamera {
    /// The error budget.
    pub budget: f64,
    /// What the map selects, in words.
    pub settings: String,
    /// Its power, watts.
    pub power_w: f64,
    /// Its error.
    pub error: f64,
    /// The least power of at most that error that is known at the camera, watts. `None` where no search
    /// was made.
    pub least_w: Option<f64>,
    /// The settings of that power, in words.
    pub least_settings: Option<String>,
}

impl AtCamera {
    /// Power above the least, as a part of it.
    pub(crate) fn regret(&self) -> Option<f64> {
        self.least_w.map(|least| self.power_w / least - 1.0).filter(|regret| regret.is_finite())
    }
}

/// A camera, by budget.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct CameraRegret {
    /// The camera's position, metres.
    pub position: [f32; 3],
    /// Number of settings that were rendered there.
    pub rendered: usize,
    /// By budget.
    pub budgets: Vec<AtCamera>,
}

/// Renders the selections at all of `setup`'s training cameras, and the searches at some.
///
/// # Errors
/// When rendering fails or is stopped; what was rendered before is in the journal.
pub(crate) fn run<M: Measure>(
    plan: &RegretPlan<'_>,
    lens: (f32, f32),
    setup: Setup<'_, M>,
) -> Result<Vec<CameraRegret>, PipelineError<M::Error>> {
    let cameras: &[MovingCamera] = &setup.cameras.training;
    if cameras.is_empty() {
        return Err(PipelineError::NoCameras);
    }
    let mut renderings = Renderings::new(setup);
    let selected: Vec<Vec<KnobLevels>> = cameras
        .iter()
        .map(|camera| {
            let view = CameraView {
                position: camera.pose.position,
                rotation: camera.pose.rotation,
                vertical_fov: lens.0,
                aspect: lens.1,
            };
            plan.budgets.iter().map(|budget| select::settings(plan.map, &view, *budget)).collect()
        })
        .collect();
    let job = |(camera, settings): (usize, &Vec<KnobLevels>)| Job {
        purpose: Purpose::Training,
        camera,
        settings: plan.map.knobs.canonical_once(settings.iter().copied()),
    };
    let jobs: Vec<Job> = selected.iter().enumerate().map(job).collect();
    renderings.batch("selections", &jobs)?;
    let count = plan.searched.min(cameras.len());
    let searched: Vec<usize> = (0..count).map(|number| number * cameras.len() / count).collect();
    for camera in &searched {
        let mut camera = Rendered {
            camera: *camera,
            known: CostTable::new(1),
            most: plan.renderings,
            renderings: &mut renderings,
        };
        let search = CameraSearch {
            space: &plan.map.knobs,
            layout: plan.layout,
            batch: plan.batch,
            seed: plan.seed,
        };
        search.run(&mut camera)?;
    }
    let of_camera = |(camera, selected): (usize, &Vec<KnobLevels>)| {
        let known = renderings.at(Purpose::Training, camera);
        let is_searched = searched.contains(&camera);
        let at = |(budget, settings): (&f64, &KnobLevels)| {
            let cost = renderings.get(Purpose::Training, camera, *settings)?;
            let least = is_searched.then(|| least(&known, (*settings, cost)));
            Some(AtCamera {
                budget: *budget,
                settings: plan.map.knobs.describe(*settings),
                power_w: cost.power.0,
                error: cost.error,
                least_w: least.map(|(_, power)| power),
                least_settings: least.map(|(settings, _)| plan.map.knobs.describe(settings)),
            })
        };
        CameraRegret {
            position: cameras[camera].pose.position.to_array(),
            rendered: known.len(),
            budgets: plan.budgets.iter().zip(selected).filter_map(at).collect(),
        }
    };
    Ok(selected.iter().enumerate().map(of_camera).collect())
}

/// The settings of least power, watts, whose error is at most that of the `selected` ones; these where
/// none takes less.
fn least(
    known: &BTreeMap<KnobLevels, CostPoint>,
    selected: (KnobLevels, CostPoint),
) -> (KnobLevels, f64) {
    let within = known.iter().filter(|(_, cost)| cost.error <= selected.1.error);
    let powers = within.map(|(settings, cost)| (*settings, cost.power.0));
    let start = (selected.0, selected.1.power.0);
    powers.fold(start, |least, other| if other.1 < least.1 { other } else { least })
}

/// A camera at which a search renders.
struct Rendered<'a, 'b, M> {
    camera: usize,
    known: CostTable,
    most: usize,
    renderings: &'a mut Renderings<'b, M>,
}

impl<M: Measure> SearchedCamera for Rendered<'_, '_, M> {
    type Error = PipelineError<M::Error>;

    fn ask_all(&mut self, mut settings: Vec<KnobLevels>) -> Result<(), Self::Error> {
        settings.truncate(self.most.saturating_sub(self.known.settings().len()));
        let (purpose, camera) = (Purpose::Training, self.camera);
        self.renderings
            .batch("searches", &[Job { purpose, camera, settings: settings.clone() }])?;
        for settings in settings {
            if let Some(cost) = self.renderings.get(purpose, camera, settings) {
                self.known.set(0, settings, cost);
            }
        }
        Ok(())
    }

    fn known(&self) -> &CostTable {
        &self.known
    }

    fn is_done(&self) -> bool {
        self.known.settings().len() >= self.most
    }
}
