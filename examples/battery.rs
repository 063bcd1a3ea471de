//! A simulated handheld that must last: `battery [SCENE] [MAP]`.
//!
//! Look at the last line: the time until the battery is empty, at its present power, comes to agree
//! with the time for which it must last, and stays there whatever happens. The device is hungrier
//! than the map says, which the controller learns from the battery. Up and Down move the end by 15
//! seconds, L switches another load on and off, P plugs the charger in and out, H makes the device
//! 40 % hungrier, Space pauses the tour.
//!
//! The default map is that of `make demo`, or another machine's before it was run. Nothing here is measured:
//! battery and device are models.

use std::path::Path;
use std::time::Duration;

use bevy::anti_alias::smaa::Smaa;
use bevy::pbr::ScreenSpaceAmbientOcclusion;
use bevy::post_process::bloom::Bloom;
use bevy::prelude::*;
use bevy_frugal_gi::power::{MeterChoice, PowerPlugin};
use bevy_frugal_gi::prelude::*;
use bevy_frugal_gi::signals::{BatteryLevel, BatterySettings};
use bevy_frugal_gi::units::Joules;
use bevy_frugal_gi_tools::HudPlugin;
use frugal::scene;
use frugal_examples::{
    BudgetRange, ExamplePlugin, Tour, add_ui_camera, caption, control, courtyard_map, read_map,
    run, scene_plugins, travel,
};

/// What the battery must last for at first, in seconds.
const LASTS: f64 = 120.0;
/// Power of the device without any work, in watts.
const IDLE: f64 = 1.5;
/// The other load, in watts.
const OTHER_LOAD: f64 = 2.0;

fn main() -> AppExit {
    run(courtyard_map(), build)
}

fn build(scene: &Path, map: &Path) -> Result<App, String> {
    let scene = scene::load(scene).map_err(|error| error.to_string())?;
    let map = read_map(map, &scene)?;
    let tour = Tour::of(&scene)?;
    let mut app = App::new();
    app.add_plugins((
        scene_plugins(),
        // The simulated device takes the place of this machine.
        FrugalGiPlugins.set(PowerPlugin { meter: MeterChoice::Off, ..default() }),
        HudPlugin,
        ExamplePlugin { title: "battery" },
    ));
    add_ui_camera(&mut app);
    let camera = app
        .world_mut()
        .spawn((
            Camera3d::default(),
            Msaa::Off,
            FrugalGi::default(),
            (ScreenSpaceAmbientOcclusion::default(), Smaa::default(), Bloom::NATURAL),
            (tour.transform(), Budget::default()),
        ))
        .id();
    frugal::stage::populate(app.world_mut(), &scene, camera).map_err(|error| error.to_string())?;

    // Enough for the middle of the map's range.
    let full = (IDLE + BudgetRange::of(&map).power(0.5).0) * LASTS;
    control(&mut app, map, &[camera]);
    app.insert_resource(Handheld { hunger: 1.15, left: Joules(full), ..default() })
        .insert_resource(BatterySettings { enabled: false })
        .insert_resource(tour);
    app.world_mut().spawn((caption(""), Status));
    app.add_systems(Update, (travel, press, run_down, tell).chain());
    Ok(app)
}

/// A device and its battery.
#[derive(Resource, Default)]
struct Handheld {
    /// Power per watt that the map predicts.
    hunger: f64,
    /// Energy left in the battery.
    left: Joules,
    /// Power drawn in this frame.
    power: Watts,
    is_charging: bool,
    has_other_load: bool,
    /// When the battery may be empty, since the app's start; set in the first frame under control.
    end: Option<Duration>,
}

/// Lets the battery run down by what the applied settings take.
fn run_down(
    time: Res<Time<Real>>,
    mut handheld: ResMut<Handheld>,
    mut level: ResMut<BatteryLevel>,
    mut camera: Single<(&Selection, &mut Budget)>,
) {
    let (selection, budget) = &mut *camera;
    let Some(predicted) = selection.predicted_applied else { return };
    let handheld = &mut *handheld;
    let other = Watts(if handheld.has_other_load { OTHER_LOAD } else { 0.0 });
    let seconds = time.delta_secs_f64();
    handheld.power = Watts(IDLE) + predicted.power * handheld.hunger + other;
    let drawn = handheld.power.0 * seconds;
    if !handheld.is_charging {
        handheld.left = Joules((handheld.left.0 - drawn).max(0.0));
    }
    // On a charger nothing runs out, and nothing is limited.
    level.energy = (!handheld.is_charging).then_some(handheld.left);
    level.power = (!handheld.is_charging).then_some(handheld.power);
    let end = *handheld.end.get_or_insert(time.elapsed() + Duration::from_secs_f64(LASTS));
    budget.set_if_neq(Budget::default().with_battery_until(end));
}

fn press(keys: Res<ButtonInput<KeyCode>>, mut handheld: ResMut<Handheld>) {
    let step = Duration::from_secs(15);
    for key in keys.get_just_pressed() {
        match key {
            KeyCode::ArrowUp => handheld.end = handheld.end.map(|end| end + step),
            KeyCode::ArrowDown => handheld.end = handheld.end.map(|end| end.saturating_sub(step)),
            KeyCode::KeyL => handheld.has_other_load = !handheld.has_other_load,
            KeyCode::KeyP => handheld.is_charging = !handheld.is_charging,
            KeyCode::KeyH => handheld.hunger *= 1.4,
            _ => {}
        }
    }
}

/// Marks the text that says how the battery is.
#[derive(Component)]
struct Status;

fn tell(time: Res<Time<Real>>, handheld: Res<Handheld>, mut text: Single<&mut Text, With<Status>>) {
    let keys = "Up, Down: end   L: load   P: charger   H: hungrier   Space: pause   F3: panel";
    let Some(end) = handheld.end else {
        text.set_if_neq(Text::new(keys));
        return;
    };
    let asked = end.saturating_sub(time.elapsed()).as_secs_f64();
    let state = if handheld.is_charging {
        "on the charger: no limit".to_owned()
    } else {
        let lasts = handheld.left.0 / handheld.power.0.max(1e-3);
        format!("must last {asked:.0} s, lasts {lasts:.0} s at {:.1} W", handheld.power.0)
    };
    let mut status = format!("{keys}\n{:.0} J left, {state}", handheld.left.0);
    if handheld.has_other_load {
        status += &format!(", other load {OTHER_LOAD} W");
    }
    text.set_if_neq(Text::new(status));
}
