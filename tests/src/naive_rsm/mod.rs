//! The baseline: Dachsbacher and Stamminger 2005, "Reflective Shadow Maps", on the plugin's own
//! maps.
//!
//! Every pixel of the camera, at full resolution, sums 400 texels of each light's map, in a fixed
//! pattern around its projection into the map. There is no visibility, no importance sampling and
//! no interpolation in image space. Engine, maps, G-buffer and composite equation are the plugin's,
//! so that ratios of errors and of costs depend on the method only. Details that the publication
//! leaves open are chosen in the method's favour: the samples are a Hammersley set instead of
//! random, their weights can be exact ([`Weights`]), and the geometry term is bounded.
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
/// [`FrugalGi`] with [`GiOutput::MapsOnly`]: see [`show`].
#[derive(Component, ExtractComponent, Clone, Copy, Debug, PartialEq)]
pub struct NaiveRsm {
    /// Samples per pixel of each light's map, 1 to 4096. As published: 400.
    pub samples: u32,
    /// Largest distance of a sample from the pixel's projection, in sides of the map; for a cube
    /// map, in half turns (1 covers all directions). The publication leaves it to the user. A
    /// larger radius finds light from farther away and makes that from nearby noisier.
    pub radius: f32,
    /// Weights of the samples.
    pub weights: Weights,
    /// Clamping distance, metres: the geometry term cosθ·cosθ′/d² is at most 1 ÷ its square. Above
    /// 0.
    pub clamp_distance: f32,
    /// Whether the indirect light is rendered over black instead of added to the image.
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

/// Adds the baseline to the stage's camera, or removes it, and sets the plugin's output:
/// [`GiOutput::MapsOnly`] together with the baseline. The knobs still control how the maps are
/// rendered. They must ask for VPLs, since there are no maps without any.
pub fn show(stage: &mut Stage, naive: Option<NaiveRsm>, output: GiOutput) {
    let camera = crate::set::camera(stage);
    let mut camera = stage.world_mut().entity_mut(camera);
    // The baseline has one map for the whole scene, as published; by default the plugin adds a near
    // cascade.
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
                    // They need this frame's store.
                    (pass::learn_maps, pass::prepare_lights)
                        .chain()
                        .in_set(RenderSystems::PrepareBindGroups),
                ),
            )
            // The plugin's composite draws nothing for such a camera.
            .add_systems(Core3d, pass::draw.in_set(GiSystems::Composite));
    }
}
