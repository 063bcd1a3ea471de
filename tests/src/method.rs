//! Ways to light a stage indirectly, which are compared.

use bevy_frugal_gi::gi::GiOutput;
use frugal::metrics::Radiance;
use frugal::stage::Stage;

use crate::naive_rsm::{self, NaiveRsm, Weights};
use crate::set;

/// What all methods have in common: no part of the frame that is not compared costs more than it
/// must.
const REST: &str = "min,resolution_scale=100%,gi_refresh_period=1";

/// A way to light a stage indirectly. Shown alone, over black.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// What tables call it.
    pub name: String,
    settings: String,
    output: GiOutput,
    naive: Option<NaiveRsm>,
}

impl Method {
    /// No global illumination.
    pub fn none() -> Self {
        Self {
            name: "none".into(),
            settings: format!("{REST},gi_vpl_count=0"),
            output: GiOutput::IndirectOnly,
            naive: None,
        }
    }

    /// The plugin's: VPLs, shared out among squares of so many pixels, rays, share of the pixels,
    /// texels along the side of a map. As the knobs' levels are called.
    pub fn ours(vpls: u32, interleave: &str, visibility: &str, fraction: &str, rsm: u32) -> Self {
        let settings = format!(
            "{REST},gi_vpl_count={vpls},gi_interleave={interleave},gi_visibility={visibility},gi_pixel_fraction={fraction},rsm_resolution={rsm}"
        );
        let name =
            format!("{vpls} VPLs, {interleave}, {visibility}, {fraction} of the pixels, RSM {rsm}");
        Self { name, settings, output: GiOutput::IndirectOnly, naive: None }
    }

    /// With more settings.
    #[must_use]
    pub fn with(self, more: &str) -> Self {
        Self { settings: format!("{},{more}", self.settings), ..self }
    }

    /// With maps and VPLs of every so-many-th frame alone.
    #[must_use]
    pub fn every(self, period: u32) -> Self {
        let name = format!("{}, maps of every {period}th frame", self.name);
        Self { name, ..self.with(&format!("gi_refresh_period={period}")) }
    }

    /// The baseline, on maps of so many texels along their side.
    pub fn naive(naive: NaiveRsm, rsm: u32) -> Self {
        let weights = match naive.weights {
            Weights::Exact => "exact",
            Weights::Published => "published",
        };
        Self {
            name: format!(
                "naive-rsm, radius {}, {weights} weights, bound {} m, RSM {rsm}",
                naive.radius, naive.clamp_distance
            ),
            settings: format!("{REST},gi_vpl_count=64,rsm_resolution={rsm}"),
            output: GiOutput::MapsOnly,
            naive: Some(NaiveRsm { alone: true, ..naive }),
        }
    }

    /// Maps of so many texels along their side, of which nothing is made.
    pub fn maps(rsm: u32) -> Self {
        let settings = format!("{REST},gi_vpl_count=64,rsm_resolution={rsm}");
        Self {
            name: format!("the maps alone, RSM {rsm}"),
            settings,
            output: GiOutput::MapsOnly,
            naive: None,
        }
    }

    /// Whether it is the baseline.
    pub fn is_naive(&self) -> bool {
        self.naive.is_some()
    }

    /// Asks the stage for it, from the next frame on.
    pub fn apply(&self, stage: &mut Stage) {
        set::apply(stage, &self.settings);
        naive_rsm::show(stage, self.naive, self.output);
    }

    /// Shows it and waits for whatever has to be compiled.
    pub fn radiance(&self, stage: &mut Stage) -> Radiance {
        self.apply(stage);
        set::radiance(stage)
    }
}
