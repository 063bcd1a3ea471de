//! Frames that do not continue the one before: camera cuts, and shifts of the whole world.

use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::prelude::*;
use bevy::render::extract_resource::ExtractResource;
pub(crate) use frugal_core::frontier::{CUT_DISTANCE, is_cut};

/// Marks a camera whose next frame shows another place: a teleport, another scene. GI drops its
/// history and resamples its VPLs regardless of
/// [`refresh_period`](crate::gi::FrugalGi::refresh_period), and the controller's next settings
/// apply without transition. Removed at the end of that frame, in `Last`.
///
/// A jump is a cut without this mark: from one frame to the next the camera moves by more than 1 m
/// and faster than 300 m/s, or turns by more than 30° and faster than 900° a second, in real time.
/// Frames longer than 0.1 s count as 0.1 s. Where all that the camera shows moves with it, the
/// world's origin was shifted: that is no cut.
#[derive(Component, Reflect, Clone, Copy, Debug, Default, PartialEq, Eq)]
#[reflect(Component, Default, Clone, PartialEq)]
pub struct CameraCut;

/// The cuts and shifts of this frame, and what tells them from motion. Extracted for the renderer.
#[derive(Resource, ExtractResource, Clone, Debug, Default)]
pub(crate) struct Jumps {
    /// Cameras whose cut the app announced. Complete at the end of the frame.
    pub cuts: EntityHashSet,
    /// By how much a camera's world was shifted since the last frame, metres: its surroundings, and
    /// the camera with them. Found by global illumination.
    pub shifts: EntityHashMap<Vec3>,
    /// Since the last frame, in seconds of real time: neither slow motion nor a pause slows the
    /// camera that looks at it.
    pub seconds: f32,
}

/// Adds [`Jumps`], and what ends announced cuts. Every plugin that obeys cuts calls it.
pub(crate) fn build(app: &mut App) {
    if !app.is_plugin_added::<CutPlugin>() {
        app.add_plugins(CutPlugin);
    }
}

struct CutPlugin;

impl Plugin for CutPlugin {
    fn build(&self, app: &mut App) {
        app.register_type::<CameraCut>().init_resource::<Jumps>().add_systems(Last, end_cuts);
    }
}

/// Notes the announced cuts for the renderer, which extracts after this, and ends them.
fn end_cuts(
    mut jumps: ResMut<Jumps>,
    time: Option<Res<Time<Real>>>,
    cameras: Query<Entity, With<CameraCut>>,
    mut commands: Commands,
) {
    jumps.seconds = time.map_or(0.0, |time| time.delta_secs());
    jumps.cuts.clear();
    for camera in &cameras {
        jumps.cuts.insert(camera);
        commands.entity(camera).try_remove::<CameraCut>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_lasts_a_frame_in_every_app_that_obeys_it() {
        let mut app = App::new();
        build(&mut app);
        build(&mut app);
        let camera = app.world_mut().spawn(CameraCut).id();
        let cuts = |app: &App| app.world().resource::<Jumps>().cuts.contains(&camera);
        app.update();
        assert!(cuts(&app) && !app.world().entity(camera).contains::<CameraCut>());
        app.update();
        assert!(!cuts(&app));
    }
}
