//! A scene under a budget: `budget [SCENE] [MAP]`.
//!
//! Look at the panel: settings follow the budget while the camera tours the scene, and the image
//! hardly changes. In its plot the selected point moves along the frontier, which changes with the
//! view. Up and Down change the budget by 5 % of the map's range, P selects a power budget and E an
//! error budget, Space pauses the tour, C cuts to another place, F3 hides the panel. F4 shows the best
//! settings in the right half; Left and Right move the border.
//!
//! `target/budget.csv` logs it all; `frugal plot-log target/budget.csv` plots it afterwards.
//!
//! The default map is that of `make demo`, `target/demo/courtyard.pareto.ron`, or another machine's before
//! it was run. Without a map the settings are fixed.

use std::path::Path;

use bevy::anti_alias::smaa::Smaa;
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi_tools::{ControlLogPlugin, HudPlugin, HudWipe};
use frugal::scene;
use frugal_examples::{
    BudgetRange, ExamplePlugin, Tour, add_ui_camera, caption, control, courtyard_map, read_map,
    run, scene_plugins, travel,
};

fn main() -> AppExit {
    run(courtyard_map(), build)
}

fn build(scene: &Path, map: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let tour = Tour::of(&scene)?;

    let mut app = App::new();
    let log = ControlLogPlugin::new("target/budget.csv");
    app.add_plugins((scene_plugins(), FrugalGiPlugins, HudPlugin, log));
    app.add_plugins(ExamplePlugin { title: "budget" });
    add_ui_camera(&mut app);
    let camera = app
        .world_mut()
        .spawn((
            Camera3d::default(),
            Msaa::Off,
            FrugalGi::default(),
            // The effects that the map's knobs turn: a knob adds none by itself.
            (ScreenSpaceAmbientOcclusion::default(), Smaa::default(), Bloom::NATURAL),
            tour.transform(),
        ))
        .id();
    frugal::stage::populate(app.world_mut(), &scene, camera).map_err(|error| error.to_string())?;
    match read_map(map, &scene) {
        Ok(map) => {
            let range = BudgetRange::of(&map);
            let controlled = Controlled { range, kind: BudgetKind::Power, share: 0.6 };
            app.world_mut().entity_mut(camera).insert(controlled.budget());
            control(&mut app, map, &[camera]);
            app.insert_resource(controlled).add_systems(Update, change_budget);
            app.world_mut().spawn((
                caption(
                    "Up, Down: budget   P: power   E: error   Space: pause   C: cut   F3: panel   F4, Left, Right: wipe",
                ),
                Cover,
            ));
        }
        Err(problem) => {
            app.world_mut().spawn(caption(format!("{problem}\nSpace: pause   C: cut")));
        }
    }
    app.insert_resource(tour).add_systems(Update, (travel, uncover, move_wipe));
    Ok(app)
}

/// The budget set by the keys.
#[derive(Resource)]
struct Controlled {
    range: BudgetRange,
    kind: BudgetKind,
    /// Position of the budget in its range, 0 to 1.
    share: f64,
}

enum BudgetKind {
    Power,
    Error,
}

impl Controlled {
    fn budget(&self) -> Budget {
        match self.kind {
            BudgetKind::Power => Budget::power(self.range.power(self.share)),
            // Finer towards 0, where differences are visible.
            BudgetKind::Error => Budget::error(self.range.most_error * self.share * self.share),
        }
    }
}

fn change_budget(
    keys: Res<ButtonInput<KeyCode>>,
    mut controlled: ResMut<Controlled>,
    mut budget: Single<&mut Budget>,
) {
    for key in keys.get_just_pressed() {
        match key {
            KeyCode::ArrowUp => controlled.share = (controlled.share + 0.05).min(1.0),
            KeyCode::ArrowDown => controlled.share = (controlled.share - 0.05).max(0.0),
            KeyCode::KeyP => controlled.kind = BudgetKind::Power,
            KeyCode::KeyE => controlled.kind = BudgetKind::Error,
            _ => {}
        }
    }
    budget.set_if_neq(controlled.budget());
}

fn move_wipe(keys: Res<ButtonInput<KeyCode>>, mut wipe: ResMut<HudWipe>) {
    let step = f32::from(keys.just_pressed(KeyCode::ArrowRight))
        - f32::from(keys.just_pressed(KeyCode::ArrowLeft));
    if let (Some(at), true) = (wipe.at, step != 0.0) {
        wipe.at = Some((at + 0.05 * step).clamp(0.0, 1.0));
    }
}

/// Marks the caption that covers the window while knobs are warmed, and the image changes with them.
#[derive(Component)]
struct Cover;

fn uncover(
    warming: Query<(), With<WarmKnobs>>,
    mut cover: Single<(&mut Node, &mut BackgroundColor), With<Cover>>,
) {
    // The text stays at the foot, where the panel is not.
    let (height, top, shade) =
        if warming.is_empty() { (Val::Auto, px(4), 0.65) } else { (percent(100), vh(88), 1.0) };
    let (node, color) = &mut *cover;
    let padding = UiRect { top, ..node.padding };
    node.set_if_neq(Node { width: percent(100), height, padding, ..node.clone() });
    color.set_if_neq(BackgroundColor(Color::srgba(0.0, 0.0, 0.0, shade)));
}
