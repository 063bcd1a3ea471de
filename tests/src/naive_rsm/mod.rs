//! The baseline: Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", on the plugin's own
//! maps.
//!
//! Every pixel of the camera, at full resolution, sums 400 texels of each light's map, in a fixed
//! pattern around its projection into the map. No visibility, no importance, no interpolation in
//! the picture. Engine, maps, G-buffer and composite equation are the plugin's, so that a ratio of
//! errors or of costs says something about the method alone. Where the publication leaves something
//! open, it is settled in the method's favour: the samples are a Hammersley set and not random,
//! each can count exactly what it stands for ([`Weights`]), and what is near is bounded.
//!
//! | file | job |
//! |---|---|
//! | `pattern` | which texels, and how many each stands for |
//! | `pass` | the draws, one for each light |
//! | `naive.wgsl` | a pixel's sum |

mod pass;
mod pattern;

use bevy::app::{App, Plugin};
use bevy::asset::embedded_asset;
use bevy::core_pipeline::schedule::Core3d;
use bevy::ecs::prelude::*;
use bevy::render::extract_component::{ExtractComponent, ExtractComponentPlugin};
use bevy::render::{GpuResourceAppExt, Render, RenderApp, RenderSystems};
use bevy_frugal_gi::gi::{FrugalGi, GiOutput, GiSystems};
use frugal::stage::Stage;

pub use pattern::Weights;

/// Global illumination on this camera by naive sampling of its maps. The camera needs a
/// [`FrugalGi`] that renders maps and shows nothing: see [`show`].
#[derive(Component, ExtractComponent, Clone, Copy, Debug, PartialEq)]
pub struct NaiveRsm {
    /// Texels that a pixel sums of each light's map, 1 to 4096. As published: 400.
    pub samples: u32,
    /// Greatest distance of a sample from the pixel's projection, in sides of the map; of a cube,
    /// in half turns (1 is all around). The publication leaves it to the user. Wider: light from
    /// farther away is found, and what is near is noisier.
    pub radius: f32,
    /// What each sample counts.
    pub weights: Weights,
    /// Distance in metres within which a texel's light stops growing: cosθ·cosθ′/d² is at most 1 ÷
    /// its square. Above 0.
    pub clamp_distance: f32,
    /// Whether the indirect light is shown over black rather than added to the picture.
    pub alone: bool,
}

impl Default for NaiveRsm {
    fn default() -> Self {
        Self {
            samples: 400,
            radius: 0.3,
            weights: Weights::Exact,
            clamp_distance: 0.25,
            alone: false,
        }
    }
}

/// Gives the stage's camera this baseline, or takes it away, and sets what the plugin does:
/// [`GiOutput::MapsOnly`] where the baseline takes its place. How the maps are rendered stays with
/// the knobs, which must ask for some VPLs: without any, there are no maps.
pub fn show(stage: &mut Stage, naive: Option<NaiveRsm>, output: GiOutput) {
    let camera = crate::set::camera(stage);
    let mut camera = stage.world_mut().entity_mut(camera);
    // The baseline has one map for the whole scene, as it would have elsewhere; the plugin else has
    // one for what is near, too.
    let range = if naive.is_some() { f32::MAX } else { FrugalGi::default().range };
    match naive {
        Some(naive) => camera.insert(naive),
        None => camera.remove::<NaiveRsm>(),
    };
    if let Some(mut gi) = camera.get_mut::<FrugalGi>()
        && (gi.output != output || gi.range != range)
    {
        (gi.output, gi.range) = (output, range);
    }
}

/// Adds [`NaiveRsm`] to an app. Does nothing for cameras without one.
#[derive(Clone, Copy, Debug, Default)]
pub struct NaiveRsmPlugin;

impl Plugin for NaiveRsmPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "naive.wgsl");
        app.add_plugins(ExtractComponentPlugin::<NaiveRsm>::default());
    }

    fn finish(&self, app: &mut App) {
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .init_gpu_resource::<pass::NaivePipelines>()
            .init_resource::<pass::KnownMaps>()
            .add_systems(
                Render,
                (
                    pass::prepare_pipelines.in_set(RenderSystems::Prepare),
                    // Need the store as it is in this frame.
                    (pass::learn_maps, pass::prepare_lights)
                        .chain()
                        .in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            // The plugin's composite draws nothing for such a camera.
            .add_systems(Core3d, pass::draw.in_set(GiSystems::Composite));
    }
}
