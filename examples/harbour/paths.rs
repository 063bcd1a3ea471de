//! Walks through the harbour, as recordings for the tool.

use std::path::Path;

use bevy::prelude::*;
use bevy_frugal_gi::frontier::CameraView;
use bevy_frugal_gi_tools::recording::CameraSample;
use bevy_frugal_gi_tools::row_log::rows_to_text;

use crate::town::{PLATFORM, TOWER};

/// Eyes of who walks, metres.
const EYES: f32 = 1.7;
/// Metres and radians in a second: a walk, and a turn of the head.
const PACE: f32 = 2.2;
const TURN: f32 = 0.9;
/// Seconds between samples of a recording.
const INTERVAL: f32 = 0.25;

/// A stop of a walk: where, and what is looked at from there.
type Stop = ([f32; 3], [f32; 3]);

/// From the pier over the quay to the tavern, through the lanes, and up the tower.
const TOUR: [&[Stop]; 2] = [
    &[
        ([-16.0, EYES, -24.0], [-4.0, 2.0, 12.0]),
        ([-16.0, EYES, -14.0], [-30.0, 1.0, -60.0]),
        ([-15.5, EYES, -2.0], [-8.0, 2.0, 12.0]),
        ([-8.0, EYES, 4.5], [16.0, 4.0, 2.0]),
        ([3.0, EYES, 3.5], [12.0, 1.0, -40.0]),
        ([6.0, EYES, 8.5], [-30.0, 2.0, 4.0]),
        ([-2.4, EYES, 9.5], [-2.4, 1.4, 16.0]),
        ([-2.4, EYES, 13.6], [1.8, 1.0, 18.6]),
        ([-3.5, EYES, 16.5], [4.0, 1.2, 18.0]),
        ([-2.4, EYES, 13.8], [-2.4, 1.5, 4.0]),
        ([0.0, EYES, 9.5], [8.0, 2.0, 14.0]),
        ([7.5, EYES, 12.5], [7.5, 2.2, 30.0]),
        ([7.5, EYES, 23.5], [-10.0, 2.2, 24.0]),
        ([-1.0, EYES, 24.2], [-1.5, 2.2, 40.0]),
        ([-1.5, EYES, 35.3], [14.0, 2.2, 35.5]),
        ([12.0, EYES, 35.4], [30.0, 2.2, 35.5]),
        ([21.5, EYES, 34.5], [28.0, 2.0, 28.0]),
        ([24.5, EYES, 28.5], [36.0, 6.0, 30.0]),
    ],
    &[
        ([TOWER.x - 2.4, PLATFORM + EYES, TOWER.z - 2.4], [-10.0, 0.0, -20.0]),
        ([TOWER.x - 2.5, PLATFORM + EYES, TOWER.z - 1.5], [-20.0, 2.0, 20.0]),
    ],
];

/// Another way: from the western quay through lanes to the square and back to the crane.
const WALK: [&[Stop]; 1] = [&[
    ([-42.0, EYES, 6.0], [-15.0, 1.0, -10.0]),
    ([-30.0, EYES, 3.0], [-10.0, 1.5, 3.0]),
    ([-20.0, EYES, 9.8], [-12.0, 2.0, 16.0]),
    ([-11.5, EYES, 13.0], [-11.5, 2.0, 28.0]),
    ([-11.5, EYES, 23.6], [8.0, 2.2, 24.0]),
    ([8.0, EYES, 24.0], [30.0, 3.0, 27.0]),
    ([24.0, EYES, 27.0], [32.0, 2.0, 34.0]),
    ([30.0, EYES, 35.4], [0.0, 2.2, 35.5]),
    ([10.0, EYES, 35.5], [-20.0, 2.2, 35.5]),
    ([-1.5, EYES, 34.5], [-1.5, 2.0, 10.0]),
    ([-1.5, EYES, 24.4], [8.0, 2.0, 22.0]),
    ([7.5, EYES, 17.0], [10.0, 1.0, -10.0]),
    ([10.0, EYES, 6.5], [14.0, 6.0, 0.0]),
    ([20.0, EYES, 2.5], [-10.0, 0.0, -25.0]),
]];

/// Places that the tour leaves out: a boat, the last lane, the tavern's far corner, the eastern quay, and
/// the tower's other sides.
const UNSEEN: [&[Stop]; 3] = [
    &[([-12.4, 1.9, -17.0], [-30.0, 3.0, -8.0]), ([-12.8, 1.9, -19.5], [10.0, 3.0, 8.0])],
    &[
        ([40.0, EYES, 4.0], [20.0, 4.0, 2.0]),
        ([30.0, EYES, 2.2], [24.0, 0.0, -30.0]),
        ([33.5, EYES, 10.5], [33.8, 2.0, 26.0]),
        ([33.8, EYES, 23.0], [26.0, 1.5, 31.0]),
        ([21.6, EYES, 30.0], [21.5, 2.0, 45.0]),
        ([21.5, EYES, 44.5], [6.0, 2.2, 46.5]),
        ([10.0, EYES, 46.4], [-20.0, 2.2, 46.5]),
        ([-6.0, EYES, 46.4], [-23.5, 2.2, 46.0]),
        ([-19.0, EYES, 46.4], [-23.5, 3.0, 30.0]),
    ],
    &[([-7.4, EYES, 17.8], [2.0, 1.0, 15.0]), ([-6.0, EYES, 17.0], [-2.4, 1.4, 8.0])],
];
/// What the tower's other sides see.
const FROM_TOWER: [Stop; 3] = [
    ([TOWER.x + 2.4, PLATFORM + EYES, TOWER.z - 2.4], [40.0, 0.0, -40.0]),
    ([TOWER.x, PLATFORM + EYES, TOWER.z - 2.6], [-40.0, 0.0, -60.0]),
    ([TOWER.x - 2.5, PLATFORM + EYES, TOWER.z + 1.5], [-10.0, 0.0, 50.0]),
];

/// Poses of the tour by time, in samples of a recording.
pub(crate) fn tour() -> Vec<(f32, Transform)> {
    poses(&TOUR)
}

/// Writes the recordings to a folder.
///
/// # Errors
/// Where a file cannot be written.
pub(crate) fn write(folder: &Path, vertical_fov: f32) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let mut unseen = UNSEEN.to_vec();
    unseen.push(&FROM_TOWER);
    for (name, walks) in [("tour", &TOUR[..]), ("walk", &WALK[..]), ("unseen", &unseen[..])] {
        let sample = |(time, place): &(f32, Transform)| {
            let (position, rotation) = (place.translation, place.rotation);
            let view = CameraView { position, rotation, vertical_fov, aspect: 16.0 / 9.0 };
            CameraSample::new(f64::from(*time), 0, &view)
        };
        let samples: Vec<CameraSample> = poses(walks).iter().map(sample).collect();
        let file = folder.join(format!("{name}.cameras"));
        std::fs::write(&file, rows_to_text(&samples))?;
    }
    Ok(())
}

/// Samples of walks, one after the other.
fn poses(walks: &[&[Stop]]) -> Vec<(f32, Transform)> {
    let mut poses = Vec::new();
    let mut now = 0.0;
    for walk in walks {
        let stops: Vec<Transform> = walk
            .iter()
            .map(|(at, seen)| {
                Transform::from_translation((*at).into()).looking_at((*seen).into(), Vec3::Y)
            })
            .collect();
        for (number, two) in stops.windows(2).enumerate() {
            let way = two[0].translation.distance(two[1].translation);
            let angle = two[0].rotation.angle_between(two[1].rotation);
            let steps = ((way / PACE).max(angle / TURN) / INTERVAL).ceil().max(1.0);
            let last = if number + 2 == stops.len() { steps as u32 + 1 } else { steps as u32 };
            for step in 0..last {
                let share = step as f32 / steps;
                let mut pose = along(&stops, number, share);
                // A head turns smoothly between stops.
                let eased = share * share * (3.0 - 2.0 * share);
                pose.rotation = two[0].rotation.slerp(two[1].rotation, eased);
                poses.push((now, pose));
                now += INTERVAL;
            }
        }
        // Two poses at one time are a cut.
        now -= INTERVAL;
    }
    poses
}

/// A place between two stops, on a smooth curve through all (Catmull-Rom).
fn along(stops: &[Transform], number: usize, share: f32) -> Transform {
    let at = |index: usize| stops[index.min(stops.len() - 1)].translation;
    let points = [at(number.saturating_sub(1)), at(number), at(number + 1), at(number + 2)];
    let [before, from, to, after] = points;
    // Half of the usual slope keeps corners tight: lanes are narrow.
    let (leave, arrive) = (0.25 * (to - before), 0.25 * (after - from));
    let (one, two, three) = (share, share * share, share * share * share);
    Transform::from_translation(
        from * (2.0 * three - 3.0 * two + 1.0)
            + leave * (three - 2.0 * two + one)
            + to * (3.0 * two - 2.0 * three)
            + arrive * (three - two),
    )
}
