//! What a search has to know of a scene: its frames' layout, what its views show, and tracks of
//! cameras.

mod tracks;

use bevy_frugal_gi::gi::GiLimits;
use frugal_search::cost::{FrameLayout, POINT_LIGHT_MAPS};
use frugal_trace::light::Light;

use crate::scene::LoadedScene;

pub(crate) use tracks::{camera_space, recorded_tracks, tracks_of};

/// The layout of frames of `scene` at `size` pixels.
pub(crate) fn frame_layout(scene: &LoadedScene, size: [u32; 2]) -> FrameLayout {
    let is_point = |light: &&Light| matches!(light, Light::Point { .. });
    let points = scene.lights.iter().filter(is_point).count();
    let most = GiLimits::default().max_rsm_count;
    let maps = (scene.lights.len() - points).max(usize::from(points == 0)).min(most);
    let points = points.min((most - maps) / POINT_LIGHT_MAPS as usize);
    FrameLayout {
        size,
        maps: maps as u32,
        point_lights: points as u32,
        has_sky: scene.has_environment_map,
    }
}

#[cfg(test)]
mod tests {
    use frugal_search::cameras::{CameraSet, MovingCamera};
    use frugal_trace::scene::RayScene;
    use glam::Vec3;

    use super::*;
    use crate::scene::load;

    fn loaded(scene: &str) -> LoadedScene {
        let file = format!("../assets/scenes/{scene}.scene.ron");
        load(std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).expect("a scene")
    }

    #[test]
    fn a_layout_has_the_maps_that_the_plugin_renders() {
        let layout = |scene: &str| {
            let layout = frame_layout(&loaded(scene), [160, 90]);
            (layout.maps, layout.point_lights)
        };
        // A hall of 64 point lights has as many maps as the plugin renders.
        assert_eq!(layout("hall"), (0, 64));
        assert_eq!(
            [layout("courtyard"), layout("cornell"), layout("furnace")],
            [(1, 0), (1, 0), (0, 1)]
        );
    }

    #[test]
    fn cameras_are_at_reachable_positions_and_the_sets_are_disjoint() {
        let scene = loaded("courtyard");
        let rays = &*scene.rays;
        let bounds = scene.camera_bounds();
        let tracks = tracks_of(scene.paths.values(), 15.0);
        let lens = (scene.camera.vertical_fov.to_radians(), 16.0 / 9.0);
        let sampled = |seed| CameraSet::sample(rays, &bounds, &tracks, [60, 20], lens, seed);
        let set = sampled(3);
        assert_eq!((set.training.len(), set.calibration.len()), (60, 20));
        assert_eq!(set, sampled(3), "the same seed");
        assert_ne!(set, sampled(4));
        for camera in set.training.iter().chain(&set.calibration) {
            let position = camera.pose.position;
            assert!(!rays.inside_geometry(position), "{position}");
            // Under the arcade or in the court: a floor below, within the walls.
            let floor = rays.closest(position, Vec3::NEG_Y, 10.0).expect("a floor").distance;
            assert!((0.8..3.0).contains(&floor), "{floor} m above the floor");
            assert!(camera.pose.forward().y.abs() < 0.75, "looks ahead");
        }
        assert!(
            set.training
                .iter()
                .all(|a| set.calibration.iter().all(|b| a.pose.position != b.pose.position))
        );
        let is_near = |camera: &&MovingCamera| {
            tracks
                .iter()
                .flatten()
                .any(|sample| sample.pose.position.distance(camera.pose.position) < 0.3)
        };
        let share = set.training.iter().filter(is_near).count();
        assert!((30..50).contains(&share), "{share} of 60 near a path");
        // None of the cameras on and near tracks is replaced by one in free space.
        let tracked = set.training.iter().filter(|camera| camera.is_on_track()).count();
        assert_eq!(tracked, 36 + 9);
        // No part of a track is left out.
        for track in &tracks {
            for (number, stretch) in track.chunks(45).enumerate() {
                let is_covered = stretch.iter().any(|sample| {
                    set.training.iter().any(|camera| {
                        camera.is_on_track()
                            && camera.pose.position.distance(sample.pose.position) < 0.2
                            && camera.pose.forward().dot(sample.pose.forward()) > 0.99
                    })
                });
                assert!(is_covered, "no camera at samples {} to {}", 45 * number, 45 * number + 44);
            }
        }
    }

    #[test]
    fn without_tracks_all_come_from_free_space_and_without_space_none() {
        let scene = loaded("courtyard");
        let rays = &*scene.rays;
        let bounds = scene.camera_bounds();
        let sampled =
            |rays: &RayScene, bounds| CameraSet::sample(rays, bounds, &[], [10, 5], (1.0, 1.5), 1);
        assert_eq!(sampled(rays, &bounds).training.len(), 10);
        let nothing = RayScene::new([]);
        assert!(sampled(&nothing, &bounds).training.is_empty(), "nothing can be seen");
    }
}
