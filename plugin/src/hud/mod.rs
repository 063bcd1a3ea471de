//! A panel over the image for every controlled camera, for development: the frontier at its view,
//! budget, predicted and metered power, error, settings, and the latest switches.
//!
//! Only reads: decisions, meters and messages. The text of a camera is plain functions of `Facts`
//! (`text.rs`), its plot plain pixels of a `Plot` (`plot.rs`). Options for the plot:
//! 1. Gizmos: cameras with gizmos of their own would show them, too, and they are drawn every frame.
//! 2. A UI node for each point: a hundred entities that are laid out whenever the view changes.
//! 3. An image of some kilobytes, drawn anew where the frontier, the points or the limits change.
//!
//! We use option 3. While hidden there are no entities, and one system reads one key.

mod log;
mod panel;
mod plot;
mod show;
mod text;
mod wipe;

use bevy::camera::visibility::VisibilitySystems;
use bevy::prelude::*;

pub use wipe::HudWipe;

/// The HUD: panels that show what the controller does. Needs the feature `hud`, and an app with
/// Bevy's UI. Not part of [`FrugalGiPlugins`](crate::FrugalGiPlugins).
///
/// There is a panel for each camera with a [`Selection`](crate::control::Selection) or
/// [`KnobSettings`](crate::knobs::KnobSettings), at the upper left corner of its viewport. Small
/// viewports get shorter text. See [`HudSettings`]. [`HudWipe`] shows the best settings beside the
/// current ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct HudPlugin;

/// Settings of the HUD, which the app may change at any time.
#[derive(Resource, Clone, Debug, PartialEq, Reflect)]
#[reflect(Resource, Default, Clone, Debug, PartialEq)]
pub struct HudSettings {
    /// Whether the panels are there. Hidden, they cost nothing. Default: true.
    pub visible: bool,
    /// The key that shows and hides them; `None` for none. Default: F3.
    pub key: Option<KeyCode>,
    /// The UI camera that draws them, not one whose image is scaled. `None`: one of the HUD's own,
    /// over the primary window. It draws after the others, so that UI roots without a camera are
    /// drawn by it while it is there. Default: `None`.
    pub camera: Option<Entity>,
}

impl Default for HudSettings {
    fn default() -> Self {
        Self { visible: true, key: Some(KeyCode::F3), camera: None }
    }
}

/// Marks what the HUD spawns: the roots of its panels, and its camera. Put `Without<HudPart>` on
/// queries that mean the app's own cameras and nodes.
#[derive(Component, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Component, Default, Clone, Debug)]
pub struct HudPart;

/// When the HUD is written.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum HudSystems {
    /// In [`Update`]: the decisions shown are those of the frame before, whose settings this frame
    /// shows.
    Write,
}

impl Plugin for HudPlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<HudSettings>()
            .init_resource::<HudWipe>()
            .init_resource::<log::SwitchLog>()
            .add_message::<crate::control::SettingsSwitched>()
            .register_type::<HudSettings>()
            .register_type::<HudWipe>()
            .register_type::<HudPart>()
            .add_systems(
                Update,
                (
                    show::toggle.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    show::remove_panels.run_if(resource_changed::<HudSettings>),
                    (show::spawn_panels, log::record, panel::write).chain().run_if(is_visible),
                    wipe::toggle.run_if(resource_exists::<ButtonInput<KeyCode>>),
                    (wipe::spawn, wipe::retarget).chain().run_if(wipe::is_wanted),
                )
                    .chain()
                    .in_set(HudSystems::Write),
            )
            // A view's frustum follows from its transform.
            .add_systems(
                PostUpdate,
                wipe::follow
                    .after(TransformSystems::Propagate)
                    .before(VisibilitySystems::UpdateFrusta)
                    .run_if(wipe::is_wanted),
            );
    }

    fn finish(&self, app: &mut App) {
        crate::atmosphere::finish(app);
    }
}

fn is_visible(settings: Res<HudSettings>) -> bool {
    settings.visible
}

#[cfg(test)]
mod tests;
