//! A controlled camera, and its frame between look-up and switch.

use std::sync::Arc;

use bevy::ecs::query::QueryData;
use bevy::prelude::*;
use frugal_core::control::{Limits, RateTracker};

use super::components::CameraState;
use super::{
    Budget, CameraPriority, Choice, ErrorFeedback, FrontierSource, Inputs, KnobBounds,
    PowerController, Selection, SettingsFilter,
};
use crate::cut::CameraCut;
use crate::frontier::{Frontier, MapFit, SampleRef, SharedLevels};
use crate::knobs::{KnobLevels, KnobSettings, KnobSpace, WarmKnobs};
use crate::units::Watts;

pub(super) type Source<'w> = AnyOf<(&'w PowerController, &'w FrontierSource)>;

/// A camera under the controller.
#[derive(QueryData)]
#[query_data(mutable)]
pub(super) struct Controlled {
    pub(super) entity: Entity,
    pub(super) source: Source<'static>,
    pub(super) budget: Option<&'static Budget>,
    pub(super) priority: Option<&'static CameraPriority>,
    pub(super) transform: &'static GlobalTransform,
    pub(super) projection: Option<&'static Projection>,
    pub(super) camera: Option<&'static Camera>,
    pub(super) has_cut: Has<CameraCut>,
    pub(super) is_warming: Has<WarmKnobs>,
    pub(super) state: &'static mut CameraState,
    pub(super) fit: &'static mut MapFit,
    pub(super) selection: &'static mut Selection,
    pub(super) bounds: &'static mut KnobBounds,
    pub(super) filter: &'static mut SettingsFilter,
    pub(super) errors: &'static ErrorFeedback,
    pub(super) rates: &'static mut RateTracker,
    pub(super) knobs: Option<&'static mut KnobSettings>,
}

/// A camera's frame after its look-up and its own choice.
pub(super) struct Frame<'a> {
    /// How much its error counts.
    pub(super) weight: f64,
    /// Whether its view has moved since its target changed last.
    pub(super) has_moved: bool,
    pub(super) given: Inputs<'a>,
    /// In the watts of the app's meter.
    pub(super) limits: Limits,
    pub(super) space: Arc<KnobSpace>,
    /// The sample camera, and the frontier in play.
    pub(super) found: SampleRef<'a>,
    /// The part of it within the camera's bounds, if it has any.
    pub(super) bounded: Option<Arc<Frontier>>,
    /// In the store's watts.
    pub(super) choice: Choice,
    /// The power that its own budget can bear now, in the store's watts: in a still view what could stay.
    pub(super) most: Watts,
    /// Levels of the knobs that the cameras share, and what they cost.
    pub(super) agreed: Option<Agreement<'a>>,
}

impl Frame<'_> {
    /// The frontier that choices are made from.
    pub(super) fn frontier(&self) -> &Frontier {
        self.bounded.as_deref().unwrap_or(self.found.frontier)
    }
}

/// How much a camera's error counts: its priority times its pixels.
pub(super) fn weight_of(camera: Option<&Camera>, priority: Option<&CameraPriority>) -> f64 {
    let size = camera.and_then(Camera::physical_viewport_size);
    let pixels = size.map_or(1.0, |size| f64::from(size.x) * f64::from(size.y));
    let priority = priority.map_or(1.0, |priority| priority.0);
    // Infinite weights would leave no difference between errors.
    if priority.is_nan() { pixels } else { priority.clamp(0.0, 1e9) * pixels }
}

/// Levels of shared knobs that all cameras of a knob space get.
#[derive(Clone, Copy)]
pub(super) struct Agreement<'a> {
    pub(super) shared: SharedLevels<'a>,
    pub(super) levels: KnobLevels,
}

impl Agreement<'_> {
    /// Power that `settings` pay for the levels of other cameras, in the store's watts.
    pub(super) fn charge(&self, settings: KnobLevels) -> Watts {
        self.shared.charge(settings, self.levels)
    }
}

/// Whether two spaces are equal. Compares contents only where the pointers differ.
pub(super) fn same_space(a: &Arc<KnobSpace>, b: &Arc<KnobSpace>) -> bool {
    Arc::ptr_eq(a, b) || a == b
}
