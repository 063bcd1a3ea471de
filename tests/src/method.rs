//! Methods of global illumination to compare.

use bevy_frugal_gi::gi::GiOutput;
use frugal::stage::Stage;
use frugal_trace::metrics::Radiance;

use crate::naive_rsm::{self, NaiveRsm, Weights};
use crate::set;

/// Settings common to all methods: the rest of the frame is as cheap as possible.
const REST: &str = "min,resolution_scale=100%,gi_refresh_period=1";

/// A method of global illumination. Renders the indirect light only, over black.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// Name in tables.
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

    /// The plugin's: number of VPLs, interleaving pattern, visibility, fraction of the pixels
    /// gathered, and texels along the side of an RSM. All but the numbers are names of knob levels.
    pub fn ours(vpls: u32, interleave: &str, visibility: &str, fraction: &str, rsm: u32) -> Self {
        let settings = format!(
            "{REST},gi_vpl_count={vpls},gi_interleave={interleave},gi_visibility={visibility},gi_pixel_fraction={fraction},rsm_resolution={rsm}"
        );
        let name =
            format!("{vpls} VPLs, {interleave}, {visibility}, {fraction} of the pixels, RSM {rsm}");
        Self { name, settings, output: GiOutput::IndirectOnly, naive: None }
    }

    /// Adds settings.
    #[must_use]
    pub fn with(self, more: &str) -> Self {
        Self { settings: format!("{},{more}", self.settings), ..self }
    }

    /// Renders maps and VPLs only in every `period`-th frame.
    #[must_use]
    pub fn every(self, period: u32) -> Self {
        let name = format!("{}, maps of every {period}th frame", self.name);
        Self { name, ..self.with(&format!("gi_refresh_period={period}")) }
    }

    /// The same under another name.
    pub fn named(self, name: String) -> Self {
        Self { name, ..self }
    }

    /// The baseline, on maps of `rsm` × `rsm` texels.
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

    /// Only renders maps of `rsm` × `rsm` texels, without any light from them.
    pub fn maps(rsm: u32) -> Self {
        let settings = format!("{REST},gi_vpl_count=64,rsm_resolution={rsm}");
        Self {
            name: format!("the maps alone, RSM {rsm}"),
            settings,
            output: GiOutput::MapsOnly,
            naive: None,
        }
    }

    /// Whether this is the baseline.
    pub fn is_naive(&self) -> bool {
        self.naive.is_some()
    }

    /// Applies the method from the next frame on.
    pub fn apply(&self, stage: &mut Stage) {
        set::apply(stage, &self.settings);
        naive_rsm::show(stage, self.naive, self.output);
    }

    /// Applies the method, waits until the stage is ready, and returns the radiance.
    pub fn radiance(&self, stage: &mut Stage) -> Radiance {
        self.apply(stage);
        set::radiance(stage)
    }
}
