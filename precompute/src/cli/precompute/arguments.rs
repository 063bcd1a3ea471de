//! Arguments of `frugal precompute`.

use std::path::PathBuf;
use std::time::Duration;

use clap::builder::RangedU64ValueParser;
use frugal_core::units::Watts;
use frugal_search::cameras::TrackSample;
use frugal_search::pipeline::PipelineConfig;

use super::super::CliError;
use super::super::arguments::{CaptureArguments, SceneArguments, WorkerArguments, duration};
use super::super::input::path_called;
use super::super::journal::JournalArguments;
use crate::stage::StagedScene;
use crate::subject::{recorded_tracks, tracks_of};
use frugal_search::evaluate::PowerBudget;

#[derive(clap::Args, Debug)]
pub(in crate::cli) struct Arguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    /// Map to write; default: the scene's name with .pareto.ron, beside the scene
    #[arg(short, long, value_name = "MAP")]
    pub(super) output: Option<PathBuf>,
    #[command(flatten)]
    pub(super) capture: CaptureArguments,
    /// Recorded cameras to train on, beside the scene's paths; as the plugin's recorder writes them
    #[arg(long = "cameras", value_name = "FILE")]
    pub(super) recordings: Vec<PathBuf>,
    /// Paths of the scene to train on; default: all
    #[arg(long = "path", value_name = "NAME")]
    pub(super) paths: Vec<String>,
    /// Training cameras; further ones, a sixth of their number, calibrate error budgets
    #[arg(long, value_name = "N", default_value_t = 96, value_parser = RangedU64ValueParser::<usize>::new().range(1..=100_000))]
    pub(super) training: usize,
    /// Power threshold for dividing a node: watts, or a share of the power range
    #[arg(long, value_name = "W|%", default_value = "1%", value_parser = threshold, allow_hyphen_values = true)]
    pub(super) power_threshold: PowerBudget,
    /// Error threshold for dividing a node (1 − SSIM): a node is divided where either is exceeded
    /// and the division lowers the cost
    #[arg(long, value_name = "E", default_value = "0.001", value_parser = least_error, allow_hyphen_values = true)]
    pub(super) error_threshold: f64,
    /// Greatest number of octree levels
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u8).range(0..=6))]
    pub(super) levels: u8,
    /// Seed of every random choice
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Time limit, after which the best map so far is written: 90s, 10m, 1h
    #[arg(long, value_name = "TIME", value_parser = duration)]
    pub(super) time_limit: Option<Duration>,
    /// Renders only every N-th job of each batch, beginning with the I-th: 0/4, 1/4, …; with --resume
    /// a shard reads the others' journals beside the map. Without a time limit, which each shard would
    /// keep apart
    #[arg(long, value_name = "I/N", value_parser = shard, conflicts_with = "time_limit")]
    pub(super) shard: Option<(usize, usize)>,
    #[command(flatten)]
    pub(super) workers: WorkerArguments,
    #[command(flatten)]
    pub(super) journal: JournalArguments,
    /// Folder for a report on the search and its map
    #[arg(long, value_name = "DIR")]
    pub(super) report: Option<PathBuf>,
}

/// Watts, or a share of the range of power.
fn threshold(text: &str) -> Result<PowerBudget, String> {
    PowerBudget::read(text)
        .filter(|threshold| {
            let (PowerBudget::Power(Watts(number)) | PowerBudget::Share(number)) = *threshold;
            number.is_finite() && number >= 0.0
        })
        .ok_or_else(|| "expected watts or a share, as in 0.5W or 10%".to_owned())
}

fn least_error(text: &str) -> Result<f64, String> {
    let error = text.trim().parse().ok().filter(|error: &f64| error.is_finite() && *error >= 0.0);
    error.ok_or_else(|| "expected a finite number, 0 or above".to_owned())
}

/// `0/4`.
fn shard(text: &str) -> Result<(usize, usize), String> {
    let parts = text
        .split_once('/')
        .and_then(|(index, count)| Some((index.trim().parse().ok()?, count.trim().parse().ok()?)));
    match parts {
        Some((index, count)) if index < count => Ok((index, count)),
        _ => Err("expected a shard's number and how many there are, as in 0/4 to 3/4".to_owned()),
    }
}

impl Arguments {
    pub(super) fn config(&self) -> PipelineConfig {
        let mut config = PipelineConfig { seed: self.seed, ..PipelineConfig::default() };
        config.fit.levels = self.levels;
        config.fit.error_threshold = self.error_threshold;
        match self.power_threshold {
            PowerBudget::Power(watts) => config.fit.power_threshold_w = watts.0,
            PowerBudget::Share(share) => config.fit.power_threshold_share = share,
        }
        config
    }

    /// Tracks of the recordings.
    pub(super) fn recorded(&self) -> Result<Vec<Vec<TrackSample>>, CliError> {
        let mut tracks = Vec::new();
        for file in &self.recordings {
            tracks.extend(recorded_tracks(file, self.capture.image.fps).map_err(CliError::usage)?);
        }
        Ok(tracks)
    }

    /// Tracks of the scene's paths.
    pub(super) fn tracks(&self, scene: &StagedScene) -> Result<Vec<Vec<TrackSample>>, CliError> {
        let mut paths = Vec::new();
        for name in &self.paths {
            paths.push(path_called(scene, name, "--cameras")?);
        }
        if self.paths.is_empty() {
            paths.extend(scene.paths.values());
        }
        Ok(tracks_of(paths, self.capture.image.fps))
    }
}
