//! Frames that do not continue the one before: camera cuts, and shifts of the whole world.

use bevy::app::{App, Last, Plugin};
use bevy::ecs::entity::{EntityHashMap, EntityHashSet};
use bevy::ecs::prelude::*;
use bevy::math::Vec3;
use bevy::prelude::ReflectDefault;
use bevy::reflect::Reflect;
use bevy::render::extract_resource::ExtractResource;
use bevy::time::{Real, Time};

/// Thresholds of a cut: what a camera may move and turn from one frame to the next, at any frame
/// rate (metres, degrees), and in a second (m/s, degrees/s). A fast vehicle is no cut, nor is a
/// glance at a low frame rate.
pub(crate) const CUT_DISTANCE: f32 = 1.0;
const CUT_ANGLE: f32 = 30.0;
const CUT_SPEED: f32 = 300.0;
const CUT_TURN: f32 = 900.0;
/// Longest frame for which they count, seconds: a stall.
const LONGEST_FRAME: f32 = 0.1;

/// Marks a camera whose next frame is a cut: a teleport, another scene. Its history is dropped, its
/// VPLs are resampled regardless of [`refresh_period`](crate::gi::FrugalGi::refresh_period), and the
/// controller's next settings go straight to their target. Removed at the end of that frame, in
/// `Last`.
///
/// Other cuts are detected without it: from one frame to the next the camera moves by more than 1 m
/// and faster than 300 m/s, or turns by more than 30° and faster than 900° a second, in real time.
/// A camera that moves together with what it shows does not cut: the world's origin was shifted.
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

/// Whether a camera cuts between two frames `seconds` apart, each with its position in metres and
/// its unit viewing direction. Time may stand still, and NaN counts for 0; a position that is NaN is
/// no cut by itself.
pub(crate) fn is_cut(then: (Vec3, Vec3), now: (Vec3, Vec3), seconds: f32) -> bool {
    let seconds = if seconds > 0.0 { seconds.min(LONGEST_FRAME) } else { 0.0 };
    let (farthest, widest) =
        (CUT_DISTANCE.max(CUT_SPEED * seconds), CUT_ANGLE.max(CUT_TURN * seconds));
    then.0.distance_squared(now.0) > farthest * farthest
        || then.1.dot(now.1) < widest.to_radians().cos()
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

    #[test]
    fn teleports_and_whips_are_cuts_and_fast_motion_is_not() {
        let at = |x: f32, degrees: f32| {
            (Vec3::X * x, bevy::math::Quat::from_rotation_y(degrees.to_radians()) * Vec3::NEG_Z)
        };
        let still = at(0.0, 0.0);
        for (now, seconds, expected) in [
            (at(0.9, 0.0), 0.0, false),
            (at(1.1, 0.0), 0.0, true),
            (at(0.0, 29.0), 0.0, false),
            (at(0.0, 31.0), 0.0, true),
            (at(4.0, 0.0), 1.0 / 60.0, false),
            (at(6.0, 0.0), 1.0 / 60.0, true),
            (at(29.0, 80.0), 0.1, false),
            (at(31.0, 0.0), 10.0, true),
            (at(1.1, 0.0), f32::NAN, true),
            (at(f32::NAN, 0.0), 0.1, false),
        ] {
            assert_eq!(is_cut(still, now, seconds), expected, "{now:?} after {seconds} s");
        }
    }
}
