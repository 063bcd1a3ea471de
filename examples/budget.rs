//! A scene under a budget: `budget [SCENE] [MAP]`.
//!
//! Look at the text: settings follow the budget while the camera tours the scene, and the image
//! hardly changes. Up and Down change the budget by 5 % of the map's range, P selects a power
//! budget and E an error budget, Space pauses the tour, C cuts to another place.
//!
//! Without a map the settings are fixed; `make demo` writes the default map,
//! `target/demo/courtyard.pareto.ron`.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use bevy::anti_alias::smaa::Smaa;
use bevy::camera::CameraOutputMode;
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy::render::render_resource::BlendState;
use bevy_frugal_gi::control::{FeedbackState, PowerCorrection};
use bevy_frugal_gi::frontier::SceneIdentity;
use bevy_frugal_gi::knobs::{Knob, KnobLevels};
use bevy_frugal_gi::power::{MeterState, Provenance};
use bevy_frugal_gi::prelude::*;
use frugal::scene::{self, SceneDescription};
use frugal_examples::{ExamplePlugin, Tour, travel, workspace_file};

fn main() -> AppExit {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let scene =
        arguments.next().unwrap_or_else(|| workspace_file("assets/scenes/courtyard.scene.ron"));
    let map =
        arguments.next().unwrap_or_else(|| workspace_file("target/demo/courtyard.pareto.ron"));
    match build(&scene, &map) {
        Ok(mut app) => app.run(),
        Err(message) => {
            eprintln!("{message}");
            AppExit::from_code(2)
        }
    }
}

fn build(scene: &Path, map: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let path = scene.paths.get("tour").or_else(|| scene.paths.values().next());
    let tour =
        Tour::new(path.ok_or_else(|| format!("{}: no camera path", scene.source.display()))?);
    let map = read_map(map, &scene);

    let mut app = App::new();
    app.add_plugins((DefaultPlugins, FrugalGiPlugins, ExamplePlugin { title: "budget" }));
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
    match map {
        Ok(map) => {
            // The first switch to a level compiles its shaders: the warm-up does so now, behind the
            // overlay.
            app.world_mut().entity_mut(camera).insert(WarmKnobs::new(Arc::new(map.knobs.clone())));
            let range = BudgetRange::of(&map);
            let period = Duration::from_secs_f64(1.0 / map.capture.frames_per_second);
            let map = app.world_mut().resource_mut::<Assets<FrontierMap>>().add(map);
            app.insert_resource(Controlled { map, range, kind: BudgetKind::Power, share: 0.6 })
                .add_systems(Update, (start_controller, change_budget).chain())
                .add_systems(Last, move |mut last: Local<Option<Instant>>| {
                    hold_frame_rate(&mut last, period);
                });
        }
        Err(problem) => drop(app.insert_resource(NoMap(problem))),
    }
    app.insert_resource(tour)
        .add_systems(Startup, spawn_text)
        .add_systems(Update, (travel, write_text.after(change_budget), update_overlay));
    Ok(app)
}

/// Why there is no map, with the remedy.
#[derive(Resource)]
struct NoMap(String);

fn read_map(path: &Path, scene: &SceneDescription) -> Result<FrontierMap, String> {
    let file = path.display();
    let text = std::fs::read_to_string(path)
        .map_err(|error| format!("no map: {file}\n{error}\n`make demo` writes one"))?;
    let map = FrontierMap::from_ron(&text).map_err(|error| format!("no map: {file}: {error}"))?;
    let fingerprint = scene.fingerprint().map_err(|error| error.to_string())?;
    let identity = SceneIdentity { name: scene.source.display().to_string(), fingerprint };
    map.matches_scene(&identity).map_err(|error| format!("no map: {file}: {error}"))?;
    Ok(map)
}

/// The map, and the budget set by the keys.
#[derive(Resource)]
struct Controlled {
    map: Handle<FrontierMap>,
    range: BudgetRange,
    kind: BudgetKind,
    /// Position of the budget in its range, 0 to 1.
    share: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum BudgetKind {
    Power,
    Error,
}

/// Range of power, and maximum error, over all points of the map.
struct BudgetRange {
    least_power: Watts,
    most_power: Watts,
    most_error: f64,
}

impl BudgetRange {
    fn of(map: &FrontierMap) -> Self {
        let points = || map.octree.frontiers.iter().flat_map(|frontier| frontier.points());
        Self {
            least_power: Watts(
                points().map(|point| point.cost.power.0).reduce(f64::min).unwrap_or(0.0),
            ),
            most_power: Watts(
                points().map(|point| point.cost.power.0).reduce(f64::max).unwrap_or(0.0),
            ),
            most_error: points().map(|point| point.cost.error).reduce(f64::max).unwrap_or(0.0),
        }
    }
}

impl Controlled {
    fn budget(&self) -> Budget {
        let BudgetRange { least_power, most_power, most_error } = self.range;
        match self.kind {
            BudgetKind::Power => {
                Budget::power(least_power + (most_power - least_power) * self.share)
            }
            // Finer towards 0, where differences are visible.
            BudgetKind::Error => Budget::error(most_error * self.share * self.share),
        }
    }
}

/// Puts the camera under the controller after its knobs are warmed.
fn start_controller(
    mut commands: Commands,
    controlled: Res<Controlled>,
    cameras: Query<Entity, (With<FrugalGi>, Without<WarmKnobs>, Without<FrontierMapHandle>)>,
) {
    for camera in &cameras {
        commands
            .entity(camera)
            .insert((FrontierMapHandle(controlled.map.clone()), controlled.budget()));
    }
}

fn change_budget(
    keys: Res<ButtonInput<KeyCode>>,
    mut controlled: ResMut<Controlled>,
    mut cameras: Query<&mut Budget, With<FrontierMapHandle>>,
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
    for mut budget in &mut cameras {
        budget.set_if_neq(controlled.budget());
    }
}

/// Limits the frame rate to the map's. Power is energy per frame times frames per second, so the
/// map's watts are valid at its own frame rate only.
fn hold_frame_rate(last: &mut Option<Instant>, period: Duration) {
    if let Some(rest) = last.and_then(|last| period.checked_sub(last.elapsed())) {
        std::thread::sleep(rest);
    }
    *last = Some(Instant::now());
}

/// The panel behind the text. It covers the window while knobs are warmed.
#[derive(Component)]
struct Overlay;

const SHADE: Color = Color::srgba(0.0, 0.0, 0.0, 0.65);

fn spawn_text(mut commands: Commands) {
    // A separate camera, which the other camera's resolution scale does not affect.
    let output_mode = CameraOutputMode::Write {
        blend_state: Some(BlendState::PREMULTIPLIED_ALPHA_BLENDING),
        clear_color: ClearColorConfig::None,
    };
    let camera = Camera {
        order: 1,
        clear_color: ClearColorConfig::Custom(Color::NONE),
        output_mode,
        ..default()
    };
    commands.spawn((Camera2d, camera, Msaa::Off, IsDefaultUiCamera));
    let panel = Node {
        position_type: PositionType::Absolute,
        max_width: percent(100),
        padding: UiRect::axes(px(8), px(6)),
        ..default()
    };
    commands
        .spawn((Overlay, panel, BackgroundColor(SHADE)))
        .with_child((Text::default(), TextFont { font_size: FontSize::Px(11.0), ..default() }));
}

fn update_overlay(
    warming: Query<(), With<WarmKnobs>>,
    mut overlay: Single<(&mut Node, &mut BackgroundColor), With<Overlay>>,
) {
    let (node, color) = &mut *overlay;
    let (size, shade) =
        if warming.is_empty() { (Val::Auto, SHADE) } else { (percent(100), Color::BLACK) };
    node.set_if_neq(Node { width: size, height: size, ..node.clone() });
    color.set_if_neq(BackgroundColor(shade));
}

fn write_text(
    no_map: Option<Res<NoMap>>,
    controlled: Option<Res<Controlled>>,
    maps: Res<Assets<FrontierMap>>,
    (power, feedback): (Res<MeteredPower>, Res<PowerFeedback>),
    camera: Single<
        (Option<&WarmKnobs>, Option<&Selection>, Option<&MapFit>, Option<&KnobSettings>),
        With<FrugalGi>,
    >,
    mut text: Single<&mut Text>,
) {
    let (warming, selection, fit, settings) = *camera;
    let mut lines = Vec::new();
    if let Some(warming) = warming {
        lines.push(format!("warming up… {:.0} %", 100.0 * warming.progress()));
    } else {
        lines.extend(no_map.map(|no_map| no_map.0.clone()));
        if let (Some(controlled), Some(selection)) = (&controlled, selection) {
            lines.push(format!("budget       {}", budget_line(controlled)));
            lines.push(format!(
                "predicted    {}",
                predicted_line(selection, maps.get(&controlled.map))
            ));
            lines.push(format!("state        {}", status_line(selection.status)));
            lines.extend(fit.map(|fit| format!("map          {}", fit_line(fit))));
            lines.push(format!("feedback     {}", feedback_line(&feedback)));
        }
        lines.push(format!("metered      {}", metered_line(&power)));
        if let (Some(settings), Some(selection)) = (settings, selection) {
            lines.push(String::new());
            lines.extend(settings_lines(settings, selection));
        }
        lines.push(String::new());
        lines.extend(controlled.map(|_| "Up, Down: budget   P: power   E: error".to_owned()));
        lines.push("Space: pause   C: cut".to_owned());
    }
    let lines = lines.join("\n");
    if text.0 != lines {
        text.0 = lines;
    }
}

fn budget_line(controlled: &Controlled) -> String {
    let share = 100.0 * controlled.share;
    match (controlled.budget().power, controlled.budget().error) {
        (Some(power), _) => format!("{power}, {share:.0} % of the range"),
        (_, Some(error)) => format!("error {error:.4}"),
        _ => "none".to_owned(),
    }
}

fn predicted_line(selection: &Selection, map: Option<&FrontierMap>) -> String {
    let (Some(cost), Some(map)) = (selection.predicted, map) else { return "none".to_owned() };
    let ([width, height], hertz) = (map.capture.size, map.capture.frames_per_second);
    format!("{}, error {:.4}, at {width}x{height} and {hertz} Hz", cost.power, cost.error)
}

fn status_line(status: ControlStatus) -> String {
    match status {
        ControlStatus::Waiting => "waiting for the map".to_owned(),
        ControlStatus::Active(Outcome::Met) => "budget met".to_owned(),
        ControlStatus::Active(Outcome::Settling) => "on the way to the budget".to_owned(),
        ControlStatus::Active(Outcome::PowerCannotBeMet) => {
            "power limit not met: cheapest settings".to_owned()
        }
        ControlStatus::Active(Outcome::ErrorCannotBeMet) => {
            "error limit not met: best settings".to_owned()
        }
        ControlStatus::Active(Outcome::LimitedByPower) => {
            "power limit met, error limit not met".to_owned()
        }
        ControlStatus::Off(reason) => format!("off: {reason:?}"),
        other => format!("{other:?}"),
    }
}

fn fit_line(fit: &MapFit) -> String {
    let misfits: Vec<String> = fit.misfits().map(|misfit| format!("{misfit:?}")).collect();
    if misfits.is_empty() {
        "fits this app".to_owned()
    } else {
        format!("made for another: {}", misfits.join(", "))
    }
}

/// How metered power corrects the predicted one.
fn feedback_line(feedback: &PowerFeedback) -> String {
    let PowerCorrection { gain, offset } = feedback.correction;
    match feedback.state {
        FeedbackState::Off => "off".to_owned(),
        FeedbackState::Waiting => "waiting for a reading".to_owned(),
        FeedbackState::Running => format!("predicted x {gain:.2} + {offset}"),
        FeedbackState::Held => format!("meter lost, predicted x {gain:.2} + {offset}"),
    }
}

/// The metered power with its provenance.
fn metered_line(power: &MeteredPower) -> String {
    match (&power.state, power.mean, &power.info) {
        (_, Some(mean), Some(info)) => {
            let provenance = match info.provenance {
                Provenance::Measured => "measured",
                Provenance::Modelled => "modelled",
            };
            format!("{mean}, {provenance} ({})", info.name)
        }
        (MeterState::Lost { reason } | MeterState::Unavailable { reason }, ..) => {
            format!("unknown: {reason}")
        }
        _ => "not yet".to_owned(),
    }
}

/// A line per knob: its level, and its target if they differ.
fn settings_lines(settings: &KnobSettings, selection: &Selection) -> Vec<String> {
    let line = |(index, knob): (usize, &Knob)| {
        let label = |settings: KnobLevels| {
            knob.levels.get(settings.level(index)).map_or("?", |level| &level.label)
        };
        let (now, target) = (label(settings.settings), label(selection.target));
        let change = if now == target { String::new() } else { format!(" -> {target}") };
        format!("{:<23}{now}{change}", knob.name.replace('_', " "))
    };
    settings.space.knobs().iter().enumerate().map(line).collect()
}
