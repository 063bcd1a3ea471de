//! A recorded path, read back: benchmarks move an app along it and look its costs up.

use std::path::Path;

use frugal_core::frontier::{CostPoint, FrontierMap};
use frugal_core::knobs::KnobLevels;
use frugal_core::units::Watts;
use frugal_search::evaluate::{
    PathRecord, Policy, Pose, Reactive, ResolvedBudget, best_constant, ladder,
};
use frugal_search::journal::read_journal;

use crate::scene::SceneDescription;

/// Power and error of a map's settings at every frame of a path, as `frugal evaluate --record`
/// wrote them.
#[derive(Clone, Debug)]
pub struct RecordedPath(PathRecord);

impl RecordedPath {
    /// Reads the record of the scene's path called `name`, made with `map`.
    ///
    /// # Errors
    /// In a sentence: the scene has no such path, or the file cannot be read or holds no complete
    /// run of the path.
    pub fn read(
        file: &Path,
        scene: &SceneDescription,
        name: &str,
        map: &FrontierMap,
    ) -> Result<Self, String> {
        let path =
            scene.paths.get(name).ok_or_else(|| format!("the scene has no path `{name}`"))?;
        let fps = map.capture.frames_per_second;
        let plan = super::plan_along(name, path, fps)?;
        let (_, lines) = read_journal(file)
            .map_err(|error| format!("{error}; `frugal evaluate --record` writes such a file"))?;
        let record = PathRecord::restore(&plan, &map.knobs, &lines);
        if record.table.settings().is_empty() {
            return Err(format!(
                "{}: no complete run of `{name}` at {fps} frames per second",
                file.display()
            ));
        }
        Ok(Self(record))
    }

    /// Number of frames, at least 1.
    pub fn frames(&self) -> usize {
        self.0.path.poses().len()
    }

    /// The camera's position, metres, and rotation at a frame.
    pub fn pose(&self, frame: usize) -> (glam::Vec3, glam::Quat) {
        let pose = &self.0.path.poses()[frame];
        (pose.position, pose.rotation)
    }

    /// Cost of `settings` at a frame, on the way to `target`. `last`: the last recorded settings of
    /// the run. NaN where neither is recorded.
    pub fn cost(
        &self,
        frame: usize,
        settings: KnobLevels,
        target: KnobLevels,
        last: &mut Option<KnobLevels>,
    ) -> CostPoint {
        self.0.cost(frame, settings, target, last)
    }

    /// Mean power of the cheapest and of the dearest recorded settings, watts.
    pub fn range(&self) -> [Watts; 2] {
        let table = &self.0.table;
        let means = (0..table.settings().len())
            .filter_map(|column| table.mean(column, 0..table.rows()))
            .map(|cost| cost.power.0);
        let (low, high) = means
            .fold((f64::INFINITY, 0.0_f64), |(low, high), power| (low.min(power), high.max(power)));
        [Watts(low), Watts(high)]
    }

    /// The single settings of least mean error within a mean power.
    pub fn best_constant(&self, limit: Watts) -> Option<KnobLevels> {
        let budget = ResolvedBudget { power_w: Some(limit), ..Default::default() };
        best_constant(&self.0.table, &budget).map(|(settings, _)| settings)
    }

    /// The ladder that engines ship, over the map's shared frontier.
    pub fn reactive(&self, map: &FrontierMap, limit: Watts) -> ReactiveLadder {
        let budget = ResolvedBudget { power_w: Some(limit), ..Default::default() };
        ReactiveLadder(Reactive::new(ladder(&map.shared), budget), self.0.path.poses()[0])
    }
}

/// Settings stepped by meter readings.
#[derive(Clone, Debug)]
pub struct ReactiveLadder(Reactive, Pose);

impl ReactiveLadder {
    /// Settings of the next frame of `seconds`, after one at `metered` watts.
    pub fn step(&mut self, seconds: f64, metered: Watts) -> KnobLevels {
        self.0.observe(CostPoint::new(metered.0, 0.0));
        self.0.decide(0, seconds, &self.1).settings
    }
}
