//! The figures of `docs/data`, as its files have them.

use std::path::Path;

use frugal_search::evaluate::Made;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

type Failure = Box<dyn std::error::Error>;

/// Every file of the folder.
pub(crate) struct Data {
    pub(crate) policies: Policies,
    pub(crate) meters: Rows<MeterRow>,
    /// Plays of records beside the same rendered; for the prose alone.
    pub(crate) rendered: Rows<IgnoredAny>,
    pub(crate) metered: Metered,
    pub(crate) levels: Rows<LevelRow>,
    pub(crate) accuracy: Rows<AccuracyRow>,
    pub(crate) bounces: Rows<LevelRow>,
    pub(crate) naive: NaiveRsm,
    pub(crate) stability: Stability,
    pub(crate) lights: Lights,
    pub(crate) cost: Rows<CostRow>,
    /// Methods of the path tracer; for reference.md alone.
    pub(crate) reference: Rows<IgnoredAny>,
}

impl Data {
    /// Reads the files in `folder`.
    ///
    /// # Errors
    /// When a file cannot be read, or lacks a field; names the file.
    pub(crate) fn read(folder: &Path) -> Result<Self, Failure> {
        Ok(Self {
            policies: read(folder, "policies")?,
            meters: read(folder, "meters")?,
            rendered: read(folder, "rendered")?,
            metered: read(folder, "metered")?,
            levels: read(folder, "levels")?,
            accuracy: read(folder, "accuracy")?,
            bounces: read(folder, "bounces")?,
            naive: read(folder, "naive-rsm")?,
            stability: read(folder, "stability")?,
            lights: read(folder, "lights")?,
            cost: read(folder, "cost")?,
            reference: read(folder, "reference")?,
        })
    }

    /// How each file was made.
    pub(crate) fn made(&self) -> [(&'static str, &Made); 12] {
        [
            ("policies", &self.policies.made),
            ("meters", &self.meters.made),
            ("rendered", &self.rendered.made),
            ("metered", &self.metered.made),
            ("accuracy", &self.accuracy.made),
            ("bounces", &self.bounces.made),
            ("levels", &self.levels.made),
            ("naive-rsm", &self.naive.made),
            ("stability", &self.stability.made),
            ("lights", &self.lights.made),
            ("cost", &self.cost.made),
            ("reference", &self.reference.made),
        ]
    }
}

fn read<T: DeserializeOwned>(folder: &Path, name: &str) -> Result<T, Failure> {
    let file = folder.join(name).with_extension("json");
    let of_file = |error: &dyn std::fmt::Display| format!("{}: {error}", file.display());
    let text = std::fs::read_to_string(&file).map_err(|error| of_file(&error))?;
    Ok(serde_json::from_str(&text).map_err(|error| of_file(&error))?)
}

/// A file of one table.
#[derive(Deserialize)]
pub(crate) struct Rows<T> {
    pub(crate) made: Made,
    pub(crate) rows: Vec<T>,
}

/// What the example `policies` writes.
#[derive(Deserialize)]
pub(crate) struct Policies {
    pub(crate) made: Made,
    pub(crate) power_budgets: Vec<PowerRow>,
    pub(crate) error_budgets: Vec<ErrorRow>,
    pub(crate) seeds: Vec<SeedRow>,
}

/// A path by the map of one seed: frugal's error ÷ a policy's.
#[derive(Deserialize)]
pub(crate) struct SeedRow {
    pub(crate) scene: String,
    pub(crate) path: String,
    pub(crate) seed: u64,
    pub(crate) trained: f64,
    pub(crate) turns: f64,
    pub(crate) shared: f64,
    /// Share of the way from the best constant to the oracle.
    pub(crate) way: f64,
}

/// A path under a power budget.
#[derive(Deserialize)]
pub(crate) struct PowerRow {
    pub(crate) scene: String,
    pub(crate) path: String,
    /// Share of the range from the cheapest to the best settings.
    pub(crate) budget: f64,
    /// Mean power of the cheapest and of the best settings.
    pub(crate) range_w: [f64; 2],
    pub(crate) limit_w: f64,
    pub(crate) frugal: Played,
    pub(crate) trained: Played,
    pub(crate) best: Played,
    pub(crate) turns: Played,
    pub(crate) shared: Played,
    pub(crate) oracle: Played,
    /// Share of windows of the horizon that exceed the budget by 2 %.
    pub(crate) windows_over: f64,
}

/// Mean power and error of a policy.
#[derive(Clone, Copy, Deserialize)]
pub(crate) struct Played {
    pub(crate) w: f64,
    pub(crate) error: f64,
}

/// A path under an error budget.
#[derive(Deserialize)]
pub(crate) struct ErrorRow {
    pub(crate) error_budget: f64,
    pub(crate) frugal: Played,
    /// With an error meter, its power included.
    pub(crate) measured: Played,
    pub(crate) trained: Played,
}

/// What the example `meters` writes.
#[derive(Deserialize)]
pub(crate) struct MeterRow {
    pub(crate) meter: String,
    pub(crate) used: f64,
    pub(crate) windows_over: f64,
}

/// Watts of a GPU under budgets.
#[derive(Deserialize)]
pub(crate) struct Metered {
    pub(crate) made: Made,
    pub(crate) size: [u32; 2],
    /// Least and most power of the idle board.
    pub(crate) idle_w: [f64; 2],
    pub(crate) rows: Vec<MeteredRow>,
}

/// A budget, played.
#[derive(Deserialize)]
pub(crate) struct MeteredRow {
    pub(crate) name: String,
    pub(crate) limit_w: Option<f64>,
    pub(crate) watts: f64,
    /// Half of the 95 % interval.
    pub(crate) interval_w: f64,
    /// Share of the best settings' power, and half of its 95 % interval.
    pub(crate) saved: Option<f64>,
    pub(crate) saved_interval: Option<f64>,
    pub(crate) error: f64,
    pub(crate) predicted_w: f64,
}

/// A level of a knob, which alone is not as the other settings are.
#[derive(Deserialize)]
pub(crate) struct LevelRow {
    pub(crate) scene: String,
    pub(crate) knob: String,
    pub(crate) level: String,
    /// Of a frame in which everything is rendered, ÷ that of the unchanged settings.
    pub(crate) cost: f64,
    /// 1 − SSIM to their image.
    pub(crate) loss: f64,
    /// Of indirect light against a path-traced reference, for knobs that concern it.
    pub(crate) light: Option<Light>,
}

/// Indirect light against a path-traced reference.
#[derive(Clone, Copy, Deserialize)]
pub(crate) struct Light {
    pub(crate) mean_ratio: f64,
    /// Relative L1, 4×4.
    pub(crate) error: f64,
}

/// A view against a path-traced reference.
#[derive(Deserialize)]
pub(crate) struct AccuracyRow {
    pub(crate) view: String,
    pub(crate) ratio: f64,
    pub(crate) l1_4x4: f64,
}

/// GI beside the method of Dachsbacher and Stamminger.
#[derive(Deserialize)]
pub(crate) struct NaiveRsm {
    pub(crate) made: Made,
    pub(crate) cheaper_by: Vec<Factor>,
    pub(crate) rows: Vec<NaiveRow>,
}

/// How many times cheaper GI is at no more error.
#[derive(Deserialize)]
pub(crate) struct Factor {
    pub(crate) case: String,
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// A method: error, and CPU milliseconds more than a frame without GI.
#[derive(Deserialize)]
pub(crate) struct NaiveRow {
    pub(crate) method: String,
    pub(crate) error: f64,
    pub(crate) camera_ms: f64,
    pub(crate) everything_ms: f64,
}

/// Change from frame to frame that the reference does not have, as a share of the mean.
#[derive(Deserialize)]
pub(crate) struct Stability {
    pub(crate) made: Made,
    pub(crate) rows: Vec<StabilityRow>,
}

/// A method.
#[derive(Deserialize)]
pub(crate) struct StabilityRow {
    pub(crate) method: String,
    pub(crate) sun: f64,
    pub(crate) camera: f64,
}

/// A hall of many lights.
#[derive(Deserialize)]
pub(crate) struct Lights {
    pub(crate) made: Made,
    pub(crate) times: Vec<LightTime>,
    pub(crate) rows: Vec<LightRow>,
}

/// Milliseconds of two runs.
#[derive(Deserialize)]
pub(crate) struct LightTime {
    pub(crate) lights: f64,
    pub(crate) above_none_ms: [f64; 2],
}

/// Settings with some lights of the hall: errors at three views.
#[derive(Deserialize)]
pub(crate) struct LightRow {
    pub(crate) settings: String,
    pub(crate) lights: f64,
    pub(crate) error: [f64; 3],
}

/// Time or memory.
#[derive(Deserialize)]
pub(crate) struct CostRow {
    pub(crate) part: String,
    pub(crate) low: f64,
    pub(crate) high: f64,
    pub(crate) unit: String,
}
