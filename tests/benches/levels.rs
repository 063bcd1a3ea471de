//! The levels of knobs, one lowered at a time: cost, loss, and error against path tracing.
//!
//! `make bench BENCH=levels ARGS='[--size WxH] [--spp N] [--count ROUNDS] [default] [json]
//! [SCENE@SECONDS | KNOB]…'`: a view is a scene of the repository, or a scene file, and a time of its tour.
//! All other knobs are at their best, or with `default` at the default settings. Without the name of a
//! KNOB, all but those that must be named, such as `gi_bounces`. `json` prints rows for
//! docs/data/levels.json or bounces.json.
//!
//! Cost is that of a frame in which everything is rendered, ÷ that of the unchanged settings. Loss is
//! 1 − SSIM to their image. Mean ratio and error are those of indirect light of punctual lights between
//! Lambertian surfaces, with all bounces; for knobs that concern it.

use bevy::math::UVec2;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use bevy_frugal_gi::knobs::KnobRegistry;
use frugal::scene::SceneDescription;
use frugal::stage::{Component, Stage, StageOptions, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{Clock, median};
use frugal_tests::reference::{Tracing, bounces, view as parse_view, without_environment};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::integrator::Pixels;
use frugal_trace::metrics::{Difference, ssim};
use frugal_trace::scene::CameraPose;

/// Frames of a reading.
const FRAMES: u32 = 4;
/// Frames before it.
const SETTLED: u32 = 2;

/// A level of a knob, and what is found at it.
struct Level {
    knob: String,
    label: String,
    settings: String,
    /// Cost ÷ that of the unchanged settings in the same round.
    readings: Vec<f64>,
    loss: f64,
    light: Option<Difference>,
}

fn main() {
    if adapter().is_none() {
        println!("no graphics adapter: nothing is measured");
        return;
    }
    let options =
        Arguments { size: UVec2::new(192, 108), samples: 64, count: 3, names: vec![] }.read();
    let has = |word: &str| options.names.iter().any(|name| name == word);
    let base = if has("default") { "default" } else { "max" };
    let words = ["json", "default"];
    let (views, knobs): (Vec<&str>, Vec<&str>) = (options.names.iter().map(String::as_str))
        .filter(|name| !words.contains(name))
        .partition(|name| name.contains('@'));
    let views = if views.is_empty() {
        vec!["cornell@0", "two_rooms@0", "courtyard@2", "hall@0"]
    } else {
        views
    };
    let mut rows = Vec::new();
    for view in views {
        let name = view.rsplit('/').next().unwrap_or(view);
        for Level { knob, label, readings, loss, light, .. } in
            measure(view, base, &knobs, &options)
        {
            let cost = median(readings);
            let light = light.map(|light| (light.mean_ratio, light.relative_l1_boxes));
            if has("json") {
                let light = light.map_or(String::new(), |(ratio, error)| {
                    format!(r#", "light": {{"mean_ratio": {ratio:.3}, "error": {error:.3}}}"#)
                });
                println!(
                    r#"    {{"scene": "{name}", "knob": "{knob}", "level": "{label}", "cost": {cost:.2}, "loss": {loss:.4}{light}}},"#
                );
            }
            let [ratio, error] = light
                .map_or([const { String::new() }; 2], |(a, b)| [a, b].map(|x| format!("{x:.3}")));
            rows.push(vec![
                name.to_owned(),
                knob,
                label,
                format!("{cost:.2}"),
                format!("{loss:.4}"),
                ratio,
                error,
            ]);
        }
    }
    if !has("json") {
        let head = ["view", "knob", "level", "cost", "loss", "mean ratio", "relative L1, 4×4"];
        println!("{}", markdown(&head, &rows));
    }
}

fn measure(view: &str, base: &str, knobs: &[&str], options: &Arguments) -> Vec<Level> {
    let (scene, seconds) = parse_view(view);
    let pose =
        scene.paths["tour"].sample(seconds).unwrap_or_else(|| panic!("{view}: no such time"));
    let UVec2 { x: width, y: height } = options.size;
    let mut stage = open_at(&scene, pose, set::options(width, height));
    let offered = stage.space().clone();
    let all = stage.world_mut().resource::<KnobRegistry>().space_with(|_| true);
    let all = all.unwrap_or_else(|error| panic!("{error}"));
    let wanted = |name: &str| match knobs {
        [] => offered.index_of(name).is_some(),
        _ => knobs.contains(&name),
    };
    let mut levels = Vec::new();
    for knob in all.knobs().iter().filter(|knob| wanted(&knob.name)) {
        levels.extend(knob.levels.iter().map(|level| Level {
            knob: knob.name.clone(),
            label: level.label.clone(),
            settings: format!("{base},{}={}", knob.name, level.label),
            readings: Vec::new(),
            loss: 0.0,
            light: None,
        }));
    }
    let picture = |stage: &mut Stage, settings: &str| {
        set::apply(stage, settings);
        stage.get_ready().unwrap_or_else(|error| panic!("{error}"));
        stage.picture().unwrap_or_else(|error| panic!("{error}"))
    };
    let unchanged = picture(&mut stage, base);
    for level in &mut levels {
        level.loss = ssim::error(&unchanged, &picture(&mut stage, &level.settings))
            .unwrap_or_else(|error| panic!("{error}"));
    }
    let clock = Clock::suitable();
    for _ in 0..options.count.max(1) {
        let unchanged = cost(&mut stage, base, clock);
        for level in &mut levels {
            level.readings.push(cost(&mut stage, &level.settings, clock) / unchanged);
        }
    }
    drop(stage);

    let scene = without_environment(&scene);
    let tracing = Tracing {
        size: options.size,
        samples: options.samples,
        seed: 0,
        pixels: Pixels::default(),
    };
    let truth = bounces(&scene, pose, tracing, None);
    let indirect = set::radiance_options(width, height, Component::Indirect);
    let mut stage = open_at(&scene, pose, indirect);
    let lights = |name: &str| {
        (name.starts_with("gi_") && name != "gi_environment_samples") || name == "rsm_resolution"
    };
    for level in levels.iter_mut().filter(|level| lights(&level.knob)) {
        set::apply(&mut stage, &level.settings);
        set::make_lambertian(&mut stage);
        let shown = set::radiance(&mut stage);
        level.light = Some(Difference::new(&shown, &truth, None).expect("images of one size"));
    }
    levels
}

fn open_at(scene: &SceneDescription, pose: CameraPose, options: StageOptions) -> Stage {
    let mut stage = set::open(scene, options);
    set::gi(&mut stage).bounces = FrugalGi::ALL_BOUNCES;
    stage.place(pose.position, pose.rotation);
    stage
}

/// Milliseconds of a frame in which everything is rendered.
fn cost(stage: &mut Stage, settings: &str, clock: Clock) -> f64 {
    set::apply(stage, settings);
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    (0..SETTLED).for_each(|_| stage.frame());
    let cost = clock.frames_ms(stage, FRAMES);
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    cost
}
