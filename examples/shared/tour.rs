//! Moves the camera along a scene's path in a loop.

use bevy::prelude::*;
use bevy_frugal_gi::gi::{CameraCut, FrugalGi};
use bevy_frugal_gi::knobs::WarmKnobs;
use bevy_frugal_gi_tools::HudPart;
use frugal::scene::{CameraPath, SceneDescription};

/// Playback speed as a fraction of the path's own, which is many metres per second, for
/// measurements.
const TIME_SCALE: f32 = 0.25;
/// Fraction of the path that a cut skips.
const CUT_FRACTION: f32 = 0.4;

/// State of the camera's tour along a path.
#[derive(Resource)]
pub struct Tour {
    path: CameraPath,
    /// Path time since its start, seconds.
    time: f32,
    paused: bool,
}

impl Tour {
    /// A tour at the start of `path`.
    pub fn new(path: &CameraPath) -> Self {
        Self { path: path.clone(), time: 0.0, paused: false }
    }

    /// A tour of the scene's path "tour", or else of its first path.
    ///
    /// # Errors
    /// Where the scene has no path.
    pub fn of(scene: &SceneDescription) -> Result<Self, String> {
        let path = scene.paths.get("tour").or_else(|| scene.paths.values().next());
        let path = path.ok_or_else(|| format!("{}: no camera path", scene.source.display()))?;
        Ok(Self::new(path))
    }

    /// The camera's pose; the identity for an empty path.
    pub fn transform(&self) -> Transform {
        let pose = self.path.sample(self.path.start() + self.time);
        pose.map_or(Transform::default(), |pose| Transform {
            translation: pose.position,
            rotation: pose.rotation,
            ..default()
        })
    }

    /// Advances by `seconds` of path time. Returns whether the camera has wrapped around to the
    /// start.
    fn advance(&mut self, seconds: f32) -> bool {
        let time = self.time + seconds;
        // A path of one key has no length to divide by.
        self.time = if self.path.duration() > 0.0 { time % self.path.duration() } else { 0.0 };
        self.time != time
    }
}

/// The app's camera, not the one that the HUD's wipe copies from it.
type Toured = (With<FrugalGi>, Without<WarmKnobs>, Without<HudPart>);

/// Moves the camera; Space pauses and resumes, C cuts. Waits while knobs are warmed.
pub fn travel(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    mut tour: ResMut<Tour>,
    mut commands: Commands,
    camera: Single<(Entity, &mut Transform), Toured>,
) {
    let (camera, mut transform) = camera.into_inner();
    if keys.just_pressed(KeyCode::Space) {
        tour.paused = !tour.paused;
    }
    let cuts = keys.just_pressed(KeyCode::KeyC);
    let seconds = if tour.paused { 0.0 } else { time.delta_secs() * TIME_SCALE };
    let skipped = if cuts { tour.path.duration() * CUT_FRACTION } else { 0.0 };
    let wraps = tour.advance(seconds + skipped);
    *transform = tour.transform();
    if cuts || wraps {
        commands.entity(camera).insert(CameraCut);
    }
}
