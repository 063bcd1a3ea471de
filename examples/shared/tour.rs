//! Moves the camera along a scene's path, round and round.

use bevy::prelude::*;
use bevy_frugal_gi::control::SettingsFilter;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::knobs::WarmKnobs;
use frugal::scene::CameraPath;

/// Scene paths are made for measuring, many metres a second: a person wants to see something on the
/// way.
const PACE: f32 = 0.25;
/// Share of the path that a cut leaps over.
const LEAP: f32 = 0.4;

/// Where the camera is on its way.
#[derive(Resource)]
pub struct Tour {
    path: CameraPath,
    /// Seconds since the path's start, on the path's own clock.
    time: f32,
    paused: bool,
}

impl Tour {
    /// At the start of `path`.
    pub fn new(path: &CameraPath) -> Self {
        Self { path: path.clone(), time: 0.0, paused: false }
    }

    /// Where the camera is.
    pub fn transform(&self) -> Transform {
        let pose = self.path.sample(self.path.start() + self.time);
        pose.map_or(Transform::default(), |pose| Transform {
            translation: pose.position,
            rotation: pose.rotation,
            ..default()
        })
    }

    /// Goes on by `seconds` of the path's. Whether the camera has jumped back to the start.
    fn advance(&mut self, seconds: f32) -> bool {
        let time = self.time + seconds;
        // A path of one key has no length to divide by.
        self.time = if self.path.duration() > 0.0 { time % self.path.duration() } else { 0.0 };
        self.time != time
    }
}

/// Moves the camera; Space stops it and lets it go on, C cuts. It waits while knobs are warmed.
pub fn travel(
    keys: Res<ButtonInput<KeyCode>>,
    time: Res<Time>,
    mut tour: ResMut<Tour>,
    cameras: Single<
        (&mut Transform, Option<&mut SettingsFilter>),
        (With<FrugalGi>, Without<WarmKnobs>),
    >,
) {
    let (mut transform, filter) = cameras.into_inner();
    if keys.just_pressed(KeyCode::Space) {
        tour.paused = !tour.paused;
    }
    let leaps = keys.just_pressed(KeyCode::KeyC);
    let seconds = if tour.paused { 0.0 } else { time.delta_secs() * PACE };
    let leap = if leaps { tour.path.duration() * LEAP } else { 0.0 };
    let wraps = tour.advance(seconds + leap);
    *transform = tour.transform();
    if (leaps || wraps)
        && let Some(mut filter) = filter
    {
        // There is no old picture to be gentle to: settings need not glide.
        filter.cut();
    }
}
