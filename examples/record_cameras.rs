//! Records the camera's path: `record_cameras [SCENE] [FILE]`.
//!
//! Look at the text: the number of samples grows while the camera tours the scene, and stays
//! constant while the tour is paused (Space pauses it, C cuts to another place). Look at the file,
//! `target/cameras.txt` by default, while this runs: each line is a camera pose. A second run
//! appends to it.

use std::path::Path;

use bevy::prelude::*;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi_tools::{CameraRecorder, CameraRecorderPlugin, RecordCamera};
use frugal::scene;
use frugal_examples::{ExamplePlugin, Tour, run, scene_plugins, travel};

fn main() -> AppExit {
    run("target/cameras.txt", build)
}

fn build(scene: &Path, file: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let tour = Tour::of(&scene)?;
    let file = file.to_owned();

    let mut app = App::new();
    let example = ExamplePlugin { title: "record_cameras" };
    let recorder = CameraRecorderPlugin::new(&file);
    app.add_plugins((scene_plugins(), FrugalGiPlugins, recorder, example));
    let camera =
        (Camera3d::default(), Msaa::Off, FrugalGi::default(), RecordCamera, tour.transform());
    let camera = app.world_mut().spawn(camera).id();
    frugal::stage::populate(app.world_mut(), &scene, camera).map_err(|error| error.to_string())?;
    let write_text = move |recorder: Res<CameraRecorder>, mut text: Single<&mut Text>| {
        let state = if recorder.is_recording() { "in" } else { "(recording has ended) in" };
        let (samples, file) = (recorder.samples(), file.display());
        let line = format!("{samples} samples {state}\n{file}\nSpace: pause   C: cut");
        if text.0 != line {
            text.0 = line;
        }
    };
    app.insert_resource(tour)
        .add_systems(Startup, spawn_text)
        .add_systems(Update, (travel, write_text));
    Ok(app)
}

fn spawn_text(mut commands: Commands) {
    let panel = Node {
        position_type: PositionType::Absolute,
        padding: UiRect::axes(px(8), px(6)),
        ..default()
    };
    commands
        .spawn((panel, BackgroundColor(Color::srgba(0.0, 0.0, 0.0, 0.65))))
        .with_child((Text::default(), TextFont { font_size: FontSize::Px(11.0), ..default() }));
}
