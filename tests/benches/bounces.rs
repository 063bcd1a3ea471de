//! Number of bounces: light and error against path tracing with all bounces, and cost.
//!
//! `make bench BENCH=bounces ARGS='[--size WxH] [--spp N] [--count ROUNDS] [SCENE@SECONDS | json]…'`: a
//! view is a scene of the repository, or a scene file, and a time of its tour. `json` prints rows for
//! docs/data/bounces.json.
//!
//! Indirect light of punctual lights between Lambertian surfaces, at the default settings. Cost is that of
//! a frame whose maps are rendered, ÷ that with three bounces.

use bevy::math::UVec2;
use bevy_frugal_gi::gi::{FrugalGi, GiRefresh};
use frugal::stage::{Component, Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{Clock, median};
use frugal_tests::reference::{Tracing, bounces, view as parse_view};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::integrator::Pixels;
use frugal_trace::metrics::Difference;

const BOUNCES: [(&str, u32); 4] = [("1", 1), ("2", 2), ("3", 3), ("all", FrugalGi::ALL_BOUNCES)];
/// Frames of a reading.
const FRAMES: u32 = 4;

fn main() {
    if adapter().is_none() {
        println!("no graphics adapter: nothing is measured");
        return;
    }
    let options =
        Arguments { size: UVec2::new(192, 108), samples: 256, count: 5, names: vec![] }.read();
    let (json, views): (Vec<&str>, Vec<&str>) =
        options.names.iter().map(String::as_str).partition(|name| *name == "json");
    let views = if views.is_empty() {
        vec!["cornell@0", "two_rooms@0", "courtyard@2", "courtyard@6", "hall@0"]
    } else {
        views
    };
    let mut rows = Vec::new();
    for view in views {
        measure(view, &options, &mut rows);
    }
    if json.is_empty() {
        let head = ["view", "bounces", "cost", "mean ratio", "relative L1, 4×4"];
        println!("{}", markdown(&head, &rows));
        return;
    }
    for row in rows {
        let [view, bounces, cost, ratio, error] = &row[..] else { continue };
        println!(
            r#"    {{"scene": "{view}", "bounces": "{bounces}", "cost": {cost}, "mean_ratio": {ratio}, "error": {error}}},"#
        );
    }
}

fn measure(view: &str, options: &Arguments, rows: &mut Vec<Vec<String>>) {
    let (scene, seconds) = parse_view(view);
    let pose =
        scene.paths["tour"].sample(seconds).unwrap_or_else(|| panic!("{view}: no such time"));
    let tracing = Tracing {
        size: options.size,
        samples: options.samples,
        seed: 0,
        pixels: Pixels::default(),
    };
    let truth = bounces(&scene, pose, tracing, None);
    let mut stage = set::open(
        &scene,
        set::radiance_options(options.size.x, options.size.y, Component::Indirect),
    );
    stage.place(pose.position, pose.rotation);
    set::apply(&mut stage, "default");
    set::make_lambertian(&mut stage);
    let clock = Clock::suitable();
    let mut found = Vec::new();
    for (_, bounces) in BOUNCES {
        set::gi(&mut stage).bounces = bounces;
        let shown = set::radiance(&mut stage);
        found.push(Difference::new(&shown, &truth, None).expect("images of one size"));
    }
    let mut readings = [const { Vec::new() }; BOUNCES.len()];
    for _ in 0..options.count.max(1) {
        for ((_, bounces), readings) in BOUNCES.iter().zip(&mut readings) {
            set::gi(&mut stage).bounces = *bounces;
            readings.push(cost(&mut stage, clock));
        }
    }
    let costs = readings.map(median);
    let name = view.rsplit('/').next().unwrap_or(view);
    for (((label, _), found), cost) in BOUNCES.iter().zip(found).zip(costs) {
        let row = vec![
            name.to_owned(),
            (*label).to_owned(),
            format!("{:.2}", cost / costs[2]),
            format!("{:.3}", found.mean_ratio),
            format!("{:.3}", found.relative_l1_boxes),
        ];
        println!("{row:?}");
        rows.push(row);
    }
}

/// Milliseconds of a frame in which everything is rendered.
fn cost(stage: &mut Stage, clock: Clock) -> f64 {
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    stage.frame();
    let cost = clock.frames_ms(stage, FRAMES);
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    cost
}
