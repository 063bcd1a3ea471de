//! A settings menu with presets from a map: `settings_menu [SCENE] [PRESETS]`.
//!
//! Look at the caption and the panel: keys 1 to 5 select battery, low, medium, high or ultra, each
//! with the watts and the error that the map predicts, and the panel shows its level of every knob.
//! No controller runs: a preset holds at every view, so it needs more power than a budget for the
//! same error.
//!
//! The presets are a file of the tool, by default `assets/presets/courtyard.ron`. `make demo` makes a map
//! for this machine, and of that the tool writes its presets:
//!
//! ```sh
//! frugal inspect target/demo/courtyard.pareto.ron --presets presets.ron
//! ```

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use bevy::anti_alias::smaa::Smaa;
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_frugal_gi::knobs::KnobLevels;
use bevy_frugal_gi::knobs::KnobRegistry;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi_tools::HudPlugin;
use frugal::scene;
use frugal_examples::{ExamplePlugin, Tour, add_ui_camera, caption, run, scene_plugins, travel};
use serde::Deserialize;

/// What this app needs of the file; serde skips the rest.
#[derive(Deserialize)]
struct PresetFile {
    presets: Vec<Preset>,
}

#[derive(Deserialize)]
struct Preset {
    name: String,
    power_w: f64,
    error: f64,
    /// Labels of levels by knob.
    settings: BTreeMap<String, String>,
}

fn main() -> AppExit {
    run("assets/presets/courtyard.ron", build)
}

fn build(scene: &Path, presets: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let tour = Tour::of(&scene)?;
    let file = presets.display();
    let text = std::fs::read_to_string(presets).map_err(|error| {
        format!("{file}: {error}\n`frugal inspect MAP --presets {file}` writes it")
    })?;
    let PresetFile { presets } =
        ron::from_str(&text).map_err(|error| format!("{file}: {error}"))?;

    let mut app = App::new();
    app.add_plugins((scene_plugins(), FrugalGiPlugins, HudPlugin));
    app.add_plugins(ExamplePlugin { title: "settings_menu" });
    add_ui_camera(&mut app);
    let space =
        app.world().resource::<KnobRegistry>().space().map_err(|error| error.to_string())?;
    let menu = presets.into_iter().map(|preset| {
        let pairs = preset.settings.iter().map(|(knob, level)| format!("{knob}={level}"));
        let levels = space.parse(&pairs.collect::<Vec<_>>().join(","));
        Ok((preset, levels.map_err(|error| format!("{file}: {error}"))?))
    });
    let menu = Menu { presets: menu.collect::<Result<_, String>>()?, chosen: 2 };
    let settings = KnobSettings { space: Arc::new(space), settings: menu.settings() };
    let camera = app
        .world_mut()
        .spawn((
            Camera3d::default(),
            Msaa::Off,
            FrugalGi::default(),
            // The effects that the knobs turn: a knob adds none by itself.
            (ScreenSpaceAmbientOcclusion::default(), Smaa::default(), Bloom::NATURAL),
            (settings, tour.transform()),
        ))
        .id();
    frugal::stage::populate(app.world_mut(), &scene, camera).map_err(|error| error.to_string())?;
    app.world_mut().spawn((caption(""), MenuText));
    app.insert_resource(menu).insert_resource(tour).add_systems(Update, (travel, choose, write));
    Ok(app)
}

/// The presets with their settings, and the number of the chosen one.
#[derive(Resource)]
struct Menu {
    presets: Vec<(Preset, KnobLevels)>,
    chosen: usize,
}

impl Menu {
    fn settings(&self) -> KnobLevels {
        self.presets.get(self.chosen).map_or(KnobLevels::default(), |(_, settings)| *settings)
    }
}

/// Marks the menu's text.
#[derive(Component)]
struct MenuText;

fn choose(
    keys: Res<ButtonInput<KeyCode>>,
    mut menu: ResMut<Menu>,
    mut camera: Single<&mut KnobSettings>,
) {
    let digits =
        [KeyCode::Digit1, KeyCode::Digit2, KeyCode::Digit3, KeyCode::Digit4, KeyCode::Digit5];
    let pressed = digits.into_iter().position(|digit| keys.just_pressed(digit));
    if let Some(number) = pressed.filter(|number| *number < menu.presets.len()) {
        menu.chosen = number;
        camera.settings = menu.settings();
    }
}

fn write(menu: Res<Menu>, mut text: Single<&mut Text, With<MenuText>>) {
    if !menu.is_changed() {
        return;
    }
    let line = |(number, (preset, _)): (usize, &(Preset, KnobLevels))| {
        let mark = if number == menu.chosen { '>' } else { ' ' };
        let Preset { name, power_w, error, .. } = preset;
        format!("{mark} {}  {name:<8} {power_w:6.2} W  error {error:.4}", number + 1)
    };
    let lines = menu.presets.iter().enumerate().map(line);
    let keys = "1 to 5: preset   Space: pause   C: cut   F3: panel".to_owned();
    text.0 = lines.chain([keys]).collect::<Vec<_>>().join("\n");
}
