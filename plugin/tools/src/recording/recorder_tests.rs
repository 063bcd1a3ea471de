//! Tests of the recorder in a Bevy app without a renderer.

use bevy::camera::{OrthographicProjection, PerspectiveProjection};
use bevy::time::TimeUpdateStrategy;

use super::*;
use crate::row_log::rows_to_text;

/// An app that samples its cameras every second frame.
fn app_with(plugin: CameraRecorderPlugin) -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, TransformPlugin, plugin));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(125)));
    app.finish();
    app.cleanup();
    app
}

fn lens(fov: f32, aspect_ratio: f32) -> Projection {
    Projection::Perspective(PerspectiveProjection { fov, aspect_ratio, ..default() })
}

fn spawn_camera(app: &mut App, transform: Transform) -> Entity {
    app.world_mut().spawn((Camera::default(), lens(1.0, 1.5), transform, RecordCamera)).id()
}

fn set_transform(app: &mut App, camera: Entity, transform: Transform) {
    app.world_mut().entity_mut(camera).insert(transform);
}

fn insert(camera: &mut EntityWorldMut, bundle: impl Bundle) {
    camera.insert(bundle);
}

fn run(app: &mut App, frames: usize) {
    (0..frames).for_each(|_| app.update());
}

/// A file that is not there yet, in a folder of its own.
fn file() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("cameras.txt");
    (folder, file)
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).expect("a file")
}

/// Ends the app, and reads its recording.
fn end(app: App, path: &Path) -> Vec<CameraSample> {
    drop(app);
    read_rows(&read(path)).expect("a recording")
}

fn recorder(app: &App) -> &CameraRecorder {
    app.world().resource::<CameraRecorder>()
}

#[test]
fn the_path_of_a_moving_camera_is_recorded() {
    let (_folder, path) = file();
    let mut app = app_with(CameraRecorderPlugin::new(&path));
    let camera = spawn_camera(&mut app, Transform::IDENTITY);
    let mut transforms = Vec::new();
    for frame in 0..20 {
        let transform = Transform::from_xyz(frame as f32, 1.7, -0.5).looking_to(Vec3::X, Vec3::Y);
        set_transform(&mut app, camera, transform);
        app.update();
        transforms.push(transform);
    }
    assert_eq!((recorder(&app).samples(), recorder(&app).is_recording()), (10, true));
    let samples = end(app, &path);
    assert_eq!(samples.len(), 10);
    for (index, sample) in samples.iter().enumerate() {
        let transform = transforms[2 * index];
        assert_eq!((sample.camera, sample.view().position), (0, transform.translation));
        assert!(sample.view().rotation.angle_between(transform.rotation) < 1e-3);
        assert_eq!((sample.vertical_fov_rad, sample.aspect), (1.0, 1.5));
        assert_eq!(sample.time_s - samples[0].time_s, 0.25 * index as f64);
    }
}

#[test]
fn only_changes_of_the_view_are_recorded() {
    let (_folder, path) = file();
    let mut app = app_with(CameraRecorderPlugin {
        interval: Duration::ZERO,
        ..CameraRecorderPlugin::new(&path)
    });
    let camera = spawn_camera(&mut app, Transform::IDENTITY);
    run(&mut app, 10);
    assert_eq!(recorder(&app).samples(), 1);
    // Slow motion accumulates: 12 steps of 2 cm give a sample every 6 cm, beyond the 5 cm limit.
    for step in 1..=12 {
        set_transform(&mut app, camera, Transform::from_xyz(0.02 * step as f32, 0.0, 0.0));
        app.update();
    }
    assert_eq!(recorder(&app).samples(), 5);
    let mut changes = |change: &dyn Fn(&mut EntityWorldMut), written: usize, what: &str| {
        let before = recorder(&app).samples();
        change(&mut app.world_mut().entity_mut(camera));
        run(&mut app, 3);
        assert_eq!(recorder(&app).samples() - before, written, "{what}");
    };
    let position = Transform::from_xyz(0.24, 0.0, 0.0);
    let turned = |degrees: f32| position.with_rotation(Quat::from_rotation_y(degrees.to_radians()));
    changes(&|camera| insert(camera, turned(1.0)), 0, "one degree");
    changes(&|camera| insert(camera, turned(3.0)), 1, "three degrees");
    changes(&|camera| insert(camera, lens(1.01, 1.5)), 0, "half a degree of the lens");
    changes(&|camera| insert(camera, lens(1.1, 1.5)), 1, "six degrees of the lens");
    changes(&|camera| insert(camera, lens(1.1, 1.8)), 1, "a wider window");
}

#[test]
fn cameras_that_are_inactive_or_not_marked_are_left_out() {
    let (_folder, path) = file();
    let mut app = app_with(CameraRecorderPlugin::new(&path));
    let inactive = Camera { is_active: false, ..default() };
    app.world_mut().spawn((inactive, Transform::IDENTITY, RecordCamera));
    app.world_mut().spawn((Camera::default(), Transform::IDENTITY));
    app.world_mut().spawn((Transform::IDENTITY, RecordCamera));
    run(&mut app, 10);
    assert_eq!(recorder(&app).samples(), 0);
    assert_eq!(end(app, &path), Vec::new());
}

#[test]
fn each_camera_keeps_its_number_after_another_is_despawned() {
    let (_folder, path) = file();
    let mut app = app_with(CameraRecorderPlugin::new(&path));
    let first = spawn_camera(&mut app, Transform::from_xyz(1.0, 0.0, 0.0));
    // A child's position is in world space.
    let parent = app.world_mut().spawn(Transform::from_xyz(10.0, 0.0, 0.0)).id();
    let second = spawn_camera(&mut app, Transform::from_xyz(2.0, 0.0, 0.0));
    app.world_mut().entity_mut(second).insert(ChildOf(parent));
    run(&mut app, 4);
    app.world_mut().despawn(first);
    run(&mut app, 4);
    spawn_camera(&mut app, Transform::from_xyz(3.0, 0.0, 0.0));
    run(&mut app, 4);
    let mut seen: Vec<_> =
        end(app, &path).iter().map(|sample| (sample.camera, sample.x_m)).collect();
    seen[..2].sort_by(|a, b| a.1.total_cmp(&b.1));
    let numbers: Vec<_> = seen.iter().map(|(camera, _)| *camera).collect();
    assert_eq!(seen.iter().map(|(_, x)| *x).collect::<Vec<_>>(), [1.0, 12.0, 3.0]);
    assert!(
        numbers[0] != numbers[1] && numbers[..2].iter().all(|number| *number < 2),
        "{numbers:?}"
    );
    assert_eq!(numbers[2], 2);
}

#[test]
fn invalid_cameras_are_left_out_until_they_are_valid() {
    let (_folder, path) = file();
    let mut app = app_with(CameraRecorderPlugin {
        interval: Duration::ZERO,
        ..CameraRecorderPlugin::new(&path)
    });
    let camera = spawn_camera(&mut app, Transform::from_translation(Vec3::NAN));
    app.update();
    let far = Transform::from_xyz(0.0, 1e8, 0.0);
    let nowhere = Transform::from_rotation(Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0));
    for transform in [far, nowhere, Transform::from_scale(Vec3::ZERO)] {
        set_transform(&mut app, camera, transform);
        app.update();
    }
    set_transform(&mut app, camera, Transform::IDENTITY);
    let none =
        OrthographicProjection { area: Rect::default(), ..OrthographicProjection::default_3d() };
    let none = Projection::Orthographic(none);
    for projection in
        [lens(f32::NAN, 1.0), lens(0.0, 1.0), lens(1.0, f32::INFINITY), lens(4.0, 1.0), none]
    {
        app.world_mut().entity_mut(camera).insert(projection);
        app.update();
    }
    assert_eq!(recorder(&app).samples(), 0);
    app.world_mut().entity_mut(camera).remove::<Projection>();
    run(&mut app, 3);
    set_transform(
        &mut app,
        camera,
        Transform::from_xyz(9.9e6, -9.9e6, 1e-30).with_scale(Vec3::splat(1e-3)),
    );
    run(&mut app, 3);
    assert_eq!(end(app, &path).len(), 2);
}

#[test]
fn a_path_that_cannot_be_written_turns_the_recorder_off() {
    let (_folder, file) = file();
    std::fs::write(&file, "no folder").expect("a file");
    for path in [file.join("cameras.txt"), file.clone(), PathBuf::new()] {
        let settings = CameraRecorderPlugin::new(path);
        let mut app = app_with(CameraRecorderPlugin {
            interval: Duration::ZERO,
            min_distance: f32::NAN,
            ..settings
        });
        spawn_camera(&mut app, Transform::IDENTITY);
        app.update();
        while recorder(&app).is_recording() {
            std::thread::yield_now();
        }
        run(&mut app, 3);
        assert!(recorder(&app).samples() <= 1);
    }
    assert_eq!(read(&file), "no folder");
}

#[test]
fn a_full_file_ends_the_recording_and_not_the_app() {
    let (_folder, path) = file();
    let settings = CameraRecorderPlugin::new(&path);
    let every = CameraRecorderPlugin {
        interval: Duration::ZERO,
        min_angle: -1.0,
        max_samples: 7,
        ..settings
    };
    let mut app = app_with(every);
    spawn_camera(&mut app, Transform::IDENTITY);
    run(&mut app, 20);
    while recorder(&app).is_recording() {
        std::thread::yield_now();
    }
    run(&mut app, 20);
    assert_eq!(end(app, &path).len(), 7);
}

#[test]
fn later_runs_append_under_new_numbers_up_to_the_maximum_of_the_file() {
    let (_folder, path) = file();
    let play = || {
        let mut app = app_with(CameraRecorderPlugin {
            interval: Duration::ZERO,
            min_distance: f32::NAN,
            max_samples: 5,
            ..CameraRecorderPlugin::new(&path)
        });
        spawn_camera(&mut app, Transform::IDENTITY);
        run(&mut app, 3);
        let samples = end(app, &path);
        samples.iter().map(|sample| sample.camera).collect::<Vec<_>>()
    };
    assert_eq!(play(), [0, 0, 0]);
    assert_eq!(play(), [0, 0, 0, 1, 1]);
    assert_eq!(play(), [0, 0, 0, 1, 1]);
    // A recording with a broken line is not continued.
    let broken = format!("{}a,b\n", rows_to_text::<CameraSample>(&[]));
    std::fs::write(&path, &broken).expect("a file");
    let mut app = app_with(CameraRecorderPlugin::new(&path));
    spawn_camera(&mut app, Transform::IDENTITY);
    run(&mut app, 3);
    assert!(!recorder(&app).is_recording());
    drop(app);
    assert_eq!(read(&path), broken);
}

#[test]
fn without_a_clock_nothing_is_recorded_and_nothing_breaks() {
    let (_folder, path) = file();
    let mut app = App::new();
    app.add_plugins((TransformPlugin, CameraRecorderPlugin::new(&path)));
    app.finish();
    app.cleanup();
    spawn_camera(&mut app, Transform::IDENTITY);
    run(&mut app, 3);
    drop(app);
    assert!(!path.exists());
}

#[test]
fn an_endless_interval_gives_one_sample() {
    let (_folder, path) = file();
    let settings = CameraRecorderPlugin::new(&path);
    let mut app = app_with(CameraRecorderPlugin {
        interval: Duration::MAX,
        min_distance: f32::NAN,
        ..settings
    });
    spawn_camera(&mut app, Transform::IDENTITY);
    run(&mut app, 5);
    assert_eq!(end(app, &path).len(), 1);
}
