//! The export of apps without a renderer.

use bevy::asset::AssetPlugin;
use bevy::image::Image;
use bevy::transform::TransformPlugin;
use bevy::window::WindowPlugin;

use super::*;

fn app(file: &Path) -> App {
    let mut app = App::new();
    let plugins = (MinimalPlugins, AssetPlugin::default(), TransformPlugin);
    app.add_plugins((plugins, SceneExportPlugin::new(file)));
    app.init_asset::<Mesh>().init_asset::<StandardMaterial>().init_asset::<Image>();
    app
}

fn spawn_cube(app: &mut App) {
    let mesh = app.world_mut().resource_mut::<Assets<Mesh>>().add(Cuboid::default());
    let material =
        app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
    app.world_mut().spawn((Mesh3d(mesh), MeshMaterial3d(material)));
    app.world_mut().spawn((Camera3d::default(), Transform::from_xyz(0.0, 2.0, 5.0)));
}

fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("frugal-export-{name}-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn geometry_is_named_after_the_scene() {
    assert_eq!(glb_beside(Path::new("a/my.scene.ron")), Path::new("a/my.glb"));
    assert_eq!(glb_beside(Path::new("level")), Path::new("level.glb"));
}

#[test]
fn files_appear_when_asked_for_and_when_the_app_ends() {
    let folder = folder("end");
    let file = folder.join("my.scene.ron");
    let mut app = app(&file);
    spawn_cube(&mut app);
    app.update();
    assert!(!file.exists());
    app.world_mut().write_message(ExportScene);
    app.update();
    let first = fs::read_to_string(&file).unwrap();
    assert!(first.contains("geometry: Gltf(\"my.glb\")") && first.contains("\"tour\""), "{first}");
    assert!(fs::read(folder.join("my.glb")).unwrap().starts_with(b"glTF"));
    fs::remove_file(&file).unwrap();
    app.world_mut().write_message(AppExit::Success);
    app.update();
    assert!(file.exists());
    let names = fs::read_dir(&folder).unwrap().count();
    assert_eq!(names, 2, "no temporary file is left");
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn closing_the_window_exports() {
    let folder = folder("window");
    let file = folder.join("my.scene.ron");
    let mut app = app(&file);
    app.add_plugins(WindowPlugin::default());
    spawn_cube(&mut app);
    app.update();
    let mut windows = app.world_mut().query_filtered::<Entity, With<Window>>();
    let window = windows.single(app.world()).unwrap();
    app.world_mut().despawn(window);
    while app.should_exit().is_none() {
        app.update();
    }
    assert!(file.exists());
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_empty_scene_and_a_missing_folder_leave_no_file() {
    let folder = folder("none");
    let mut empty = app(&folder.join("my.scene.ron"));
    empty.world_mut().write_message(ExportScene);
    empty.update();
    let mut nowhere = app(&folder.join("no such folder/my.scene.ron"));
    spawn_cube(&mut nowhere);
    nowhere.world_mut().write_message(ExportScene);
    nowhere.update();
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn an_app_without_a_clock_exports_its_scene_without_ways() {
    let folder = folder("clockless");
    let file = folder.join("my.scene.ron");
    let mut app = App::new();
    app.add_plugins((TaskPoolPlugin::default(), AssetPlugin::default(), TransformPlugin));
    app.add_plugins(SceneExportPlugin::new(&file));
    app.init_asset::<Mesh>().init_asset::<StandardMaterial>().init_asset::<Image>();
    spawn_cube(&mut app);
    app.update();
    app.world_mut().write_message(ExportScene);
    app.update();
    assert!(file.exists());
    fs::remove_dir_all(folder).unwrap();
}
