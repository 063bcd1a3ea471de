//! The plugin against `naive-rsm` (see `frugal_tests::naive_rsm`) in one run: error against path
//! tracing, cost, and how both costs grow.
//!
//! `make bench BENCH=baseline ARGS='…'`: `[--size WxH] [--spp N] [--count ROUNDS] [cornell |
//! courtyard | two_rooms | growth | passes]…`
//!
//! Runs all parts if none is named. Tables are Markdown. Cost is the time of a frame minus that of
//! a frame without global illumination, with all other knobs at their cheapest: CPU time on a
//! software adapter, time to the finished frame on a GPU. Both methods render their maps in every
//! frame while everything moves, and in none while only the camera does.

use bevy::math::{UVec2, Vec3};
use bevy::mesh::{Mesh, Meshable};
use bevy::prelude::{Cuboid, Sphere};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::gi::inspect::{self, PASSES, RepeatedPass};
use frugal::scene::CameraPath;
use frugal::stage::{Component, Stage, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{Clock, Moving, Readings, above_none, median};
use frugal_tests::method::Method;
use frugal_tests::naive_rsm::{NaiveRsm, Weights};
use frugal_tests::reference::Tracing;
use frugal_tests::table::markdown;
use frugal_tests::{meshes, reference, set};
use frugal_trace::integrator::Pixels;
use frugal_trace::light::Light;
use frugal_trace::metrics::{Difference, Radiance};

const SCENES: [&str; 3] = ["cornell", "courtyard", "two_rooms"];

/// Settings of the plugin, the cheapest first.
fn ladder() -> Vec<Method> {
    vec![
        Method::ours(64, "2x2", "none", "1/16", 64),
        Method::ours(64, "4x4", "cached", "1/16", 64),
        Method::ours(64, "4x4", "cached", "1/16", 64).every(8),
        Method::ours(1024, "4x4", "cached", "1/16", 128),
        Method::ours(64, "4x4", "coarse", "1/16", 64),
        Method::ours(128, "2x2", "coarse", "1/16", 64),
        Method::ours(128, "2x2", "coarse", "1/16", 64).every(4),
        Method::ours(128, "2x2", "coarse", "1/16", 64).every(8),
        Method::ours(256, "4x4", "coarse", "1/16", 64),
        Method::ours(1024, "4x4", "coarse", "1/16", 64),
        Method::ours(1024, "4x4", "coarse", "1/16", 128),
        Method::ours(256, "2x2", "coarse", "1/4", 128),
        Method::ours(1024, "4x4", "coarse", "1/4", 128),
        Method::ours(4096, "8x8", "fine", "1/4", 128),
        Method::ours(4096, "4x4", "fine", "1/1", 256),
        Method::ours(4096, "2x2", "fine", "1/1", 256),
    ]
}

/// The baseline with each parameter that its publication leaves to the user: the plugin is compared
/// with the best of them.
fn naives() -> Vec<Method> {
    let mut methods = Vec::new();
    for weights in [Weights::Exact, Weights::Published] {
        for radius in [0.1, 0.3, 1.0] {
            methods.push(Method::naive(NaiveRsm { radius, weights, ..Default::default() }, 128));
        }
    }
    methods.push(Method::naive(NaiveRsm { clamp_distance: 0.01, ..Default::default() }, 128));
    methods.push(Method::naive(NaiveRsm::default(), 256));
    methods
}

fn main() {
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let options =
        Arguments { size: UVec2::new(160, 90), samples: 1024, count: 5, names: vec![] }.read();
    println!(
        "Adapter: {}. Cost: {} per frame above a frame without global illumination.\n",
        adapter.name,
        Clock::suitable().label()
    );
    SCENES.into_iter().filter(|name| options.wants(name)).for_each(|name| compare(name, &options));
    if options.wants("growth") {
        growth(&options);
    }
    if options.wants("passes") {
        passes(&options);
    }
}

fn readings(options: &Arguments) -> Readings {
    Readings { rounds: options.count as usize, frames: 8 }
}

fn ms(value: f64) -> String {
    format!("{value:.2}")
}

/// A method, its error and, if measured, its costs: while everything moves, and while only the
/// camera does.
struct Row {
    method: Method,
    difference: Option<Difference>,
    costs_ms: Option<[f64; 2]>,
}

impl Row {
    fn new(method: Method, difference: Option<Difference>) -> Self {
        Self { method, difference, costs_ms: None }
    }

    fn cells(&self, baseline: [f64; 2]) -> Vec<String> {
        let error = |pick: fn(&Difference) -> f64| {
            self.difference.as_ref().map_or_else(String::new, |found| format!("{:.3}", pick(found)))
        };
        let mut cells = vec![
            self.method.name.clone(),
            error(|d| d.mean_ratio),
            error(|d| d.relative_l1),
            error(|d| d.relative_l1_boxes),
        ];
        cells.extend(
            self.costs_ms
                .iter()
                .flatten()
                .zip(baseline)
                .flat_map(|(cost, baseline)| [ms(*cost), format!("{:.1}", baseline / cost)]),
        );
        cells
    }
}

const HEADERS: [&str; 8] = [
    "method",
    "mean ratio",
    "relative L1",
    "of 4x4 means",
    "all moves",
    "times cheaper",
    "camera moves",
    "times cheaper",
];

fn compare(name: &str, options: &Arguments) {
    let scene = reference::without_environment(&set::scene(name));
    let pose = scene.paths["tour"].sample(0.0).unwrap_or_else(|| panic!("{name} has a path"));
    let started = std::time::Instant::now();
    let tracing =
        |seed| Tracing { size: options.size, samples: options.samples, seed, pixels: Pixels::Area };
    let [reference, other] = [0, 1].map(|seed| reference::one_bounce(&scene, pose, tracing(seed)));
    let against = |radiance: &Radiance| {
        Difference::new(radiance, &reference, None).unwrap_or_else(|error| panic!("{error}"))
    };
    let noise = against(&other);
    println!("## {name}, {}x{}\n", options.size.x, options.size.y);
    println!(
        "Reference: {} paths per pixel, {:.0} s for two. Two seeds differ by {:.3} relative L1, {:.3} of 4x4 means.\n",
        options.samples,
        started.elapsed().as_secs_f64(),
        noise.relative_l1,
        noise.relative_l1_boxes
    );
    let mut stage = set::open(
        &scene,
        set::radiance_options(options.size.x, options.size.y, Component::Indirect),
    );
    stage.place(pose.position, pose.rotation);
    let mut shown = |method: Method| {
        let difference = against(&method.radiance(&mut stage));
        Row::new(method, Some(difference))
    };
    let naives: Vec<Row> = naives().into_iter().map(&mut shown).collect();
    let ours: Vec<Row> = ladder().into_iter().map(&mut shown).collect();
    let maps = [64, 128].map(|rsm| Row::new(Method::maps(rsm), None));
    println!(
        "{}\n",
        markdown(&HEADERS[..4], &naives.iter().map(|row| row.cells([0.0; 2])).collect::<Vec<_>>())
    );

    // Two baselines: the default parameters, and the best ones, which only the reference can tell.
    let usual = Method::naive(NaiveRsm::default(), 128);
    let best =
        naives.iter().min_by(|a, b| boxes(a).total_cmp(&boxes(b))).map(|row| row.method.clone());
    let baselines: Vec<Row> = naives
        .into_iter()
        .filter(|row| row.method == usual || Some(&row.method) == best.as_ref())
        .collect();
    let mut rows: Vec<Row> = baselines.into_iter().chain(ours).chain(maps).collect();
    let methods: Vec<Method> = rows.iter().map(|row| row.method.clone()).collect();
    let walk = Some(&scene.paths["tour"]);
    let (all, none_ms) = priced(&mut stage, &methods, Moving::Everything, options, walk);
    let (camera, _) = priced(&mut stage, &methods, Moving::Camera, options, walk);
    for (row, costs) in rows.iter_mut().zip(all.into_iter().zip(camera)) {
        row.costs_ms = Some(costs.into());
    }
    let (baselines, others): (Vec<&Row>, Vec<&Row>) =
        rows.iter().partition(|row| row.method.is_naive());
    println!(
        "A frame without global illumination: {} {}.\n",
        ms(none_ms),
        Clock::suitable().label()
    );
    let of = |row: &Row| row.costs_ms.unwrap_or([f64::INFINITY; 2]);
    println!(
        "{}\n",
        markdown(&HEADERS, &rows.iter().map(|row| row.cells(of(baselines[0]))).collect::<Vec<_>>())
    );
    for baseline in baselines {
        for (index, motion) in ["everything moves", "the camera moves"].into_iter().enumerate() {
            conclude(baseline, &others, motion, |row| of(row)[index]);
        }
    }
}

fn boxes(row: &Row) -> f64 {
    row.difference.map_or(f64::INFINITY, |difference| difference.relative_l1_boxes)
}

/// Prints the plugin's cheapest settings whose errors, by both metrics, are no larger than a
/// baseline's.
fn conclude(baseline: &Row, ours: &[&Row], motion: &str, cost: impl Fn(&Row) -> f64) {
    let Some(least) = baseline.difference else { return };
    let errs_no_more = |found: Difference| {
        found.relative_l1 <= least.relative_l1 && found.relative_l1_boxes <= least.relative_l1_boxes
    };
    let enough = ours.iter().filter(|row| row.difference.is_some_and(errs_no_more));
    let name = &baseline.method.name;
    match enough.min_by(|a, b| cost(a).total_cmp(&cost(b))) {
        Some(row) => {
            println!(
                "While {motion}: error no larger than {name}'s, and {:.1} times cheaper: {}.\n",
                cost(baseline) / cost(row),
                row.method.name
            );
        }
        None => {
            println!(
                "While {motion}: no settings of the plugin have errors as small as {name}'s.\n"
            );
        }
    }
}

/// The plugin's defaults, and the baseline.
fn default_and_naive() -> [Method; 2] {
    [Method::ours(1024, "4x4", "coarse", "1/4", 128), Method::naive(NaiveRsm::default(), 128)]
}

/// Costs of methods on a stage, and that of a frame without global illumination, milliseconds.
fn priced(
    stage: &mut Stage,
    methods: &[Method],
    moving: Moving,
    options: &Arguments,
    path: Option<&CameraPath>,
) -> (Vec<f64>, f64) {
    for method in methods {
        method.radiance(stage);
    }
    above_none(stage, methods, moving, readings(options), path)
}

/// Cost of each pass: the additional time of a frame that runs it twice.
fn passes(options: &Arguments) {
    println!(
        "## Passes, courtyard with its sky, {}x{}: {} per frame, everything moves\n",
        options.size.x,
        options.size.y,
        Clock::suitable().label()
    );
    let scene = set::scene("courtyard");
    let mut stage = set::open_with(
        &scene,
        set::radiance_options(options.size.x, options.size.y, Component::Global),
        inspect::allow_repeats,
    );
    let pose = scene.paths["tour"].sample(0.0).unwrap_or_else(|| panic!("courtyard has a path"));
    stage.place(pose.position, pose.rotation);
    let methods = [
        Method::ours(1024, "4x4", "coarse", "1/4", 128),
        Method::ours(4096, "2x2", "fine", "1/1", 256),
    ];
    let mut rows = Vec::new();
    for method in methods {
        let method = method.with("gi_environment_samples=16").with("gi_bounces=2");
        method.radiance(&mut stage);
        stage.world_mut().insert_resource(GiRefresh::EveryFrame);
        let mut read = |method: &Method, pass: Option<&'static str>| {
            method.apply(&mut stage);
            stage.world_mut().insert_resource(RepeatedPass(pass));
            (0..3).for_each(|_| stage.frame());
            Clock::suitable().frames_ms(&mut stage, readings(options).frames)
        };
        let (mut gains, mut whole) = (vec![Vec::new(); PASSES.len()], Vec::new());
        for _ in 0..readings(options).rounds {
            let once = read(&method, None);
            whole.push(once - read(&Method::none(), None));
            for (pass, gains) in PASSES.into_iter().zip(&mut gains) {
                gains.push(read(&method, Some(pass)) - once);
            }
        }
        let whole = median(whole);
        let mut rest = whole;
        let mut row = |pass: &str, cost: f64| {
            rows.push(vec![
                method.name.clone(),
                pass.into(),
                ms(cost),
                format!("{:.0} %", 100.0 * cost / whole),
            ]);
        };
        for (pass, gains) in PASSES.into_iter().zip(gains) {
            let cost = median(gains);
            rest -= cost;
            row(pass, cost);
        }
        row("the rest: maps' G-buffers, occluders", rest);
        row("all", whole);
    }
    println!("{}", markdown(&["settings", "pass", "cost", "share"], &rows));
}

fn growth(options: &Arguments) {
    println!("## Growth of cost, {}x{} unless said otherwise\n", options.size.x, options.size.y);
    let mut rows = Vec::new();
    let mut row = |quantity: &str, method: &str, (small, large): (f64, f64)| {
        rows.push(vec![
            format!("{quantity}: {method}"),
            ms(small),
            ms(large),
            format!("{:.2}", large / small),
        ]);
    };
    let mut both = |quantity: &str, mut small: Stage, mut large: Stage| {
        let methods = default_and_naive();
        let (a, none_a) = priced(&mut small, &methods, Moving::Everything, options, None);
        drop(small);
        let (b, none_b) = priced(&mut large, &methods, Moving::Everything, options, None);
        row(quantity, "the frame without GI", (none_a, none_b));
        row(quantity, "ours", (a[0], b[0]));
        row(quantity, "naive-rsm", (a[1], b[1]));
    };
    both("pixels x4", courtyard(options.size), courtyard(options.size * 2));
    both("lights x4", hall(1, options), hall(4, options));
    both("triangles x10", spheres((20, 9), options), spheres((64, 26), options));
    let mut stage = courtyard(options.size);
    let vpls = [(64, 256), (256, 1024), (1024, 4096)];
    let methods: Vec<Method> = vpls
        .iter()
        .flat_map(|(few, many)| [*few, *many])
        .map(|count| Method::ours(count, "4x4", "coarse", "1/4", 128))
        .collect();
    let (costs, _) = priced(&mut stage, &methods, Moving::Everything, options, None);
    for ((few, many), costs) in vpls.iter().zip(costs.chunks_exact(2)) {
        row("VPLs x4", &format!("ours, {few} to {many}"), (costs[0], costs[1]));
    }
    println!("{}", markdown(&["scaled quantity: method", "before", "after", "ratio"], &rows));
}

fn courtyard(size: UVec2) -> Stage {
    let scene = reference::without_environment(&set::scene("courtyard"));
    let mut stage = set::open(&scene, set::radiance_options(size.x, size.y, Component::Indirect));
    let pose = scene.paths["tour"].sample(0.0).unwrap_or_else(|| panic!("courtyard has a path"));
    stage.place(pose.position, pose.rotation);
    stage
}

/// A hall with `lights` spots in a row under its ceiling.
fn hall(lights: usize, options: &Arguments) -> Stage {
    let spot = |index: usize| Light::Spot {
        position: Vec3::new(3.0 * index as f32 - 4.5, 3.5, 0.0),
        direction: Vec3::NEG_Y,
        luminous_power: 20_000.0,
        range: 30.0,
        inner_angle: 30.0,
        outer_angle: 45.0,
        color: [1.0; 3],
    };
    let mut stage = set::bare(
        (0..lights).map(spot).collect(),
        set::radiance_options(options.size.x, options.size.y, Component::Indirect),
    );
    let boxes = [
        (Vec3::new(0.0, -0.1, 0.0), Vec3::new(12.0, 0.2, 6.0)),
        (Vec3::new(0.0, 4.1, 0.0), Vec3::new(12.0, 0.2, 6.0)),
        (Vec3::new(0.0, 2.0, -3.1), Vec3::new(12.0, 4.0, 0.2)),
    ];
    spawn_all(
        &mut stage,
        boxes
            .into_iter()
            .map(|(center, size)| Mesh::from(Cuboid::from_size(size)).translated_by(center)),
    );
    set::look(&mut stage, Vec3::new(0.0, 2.0, 6.0), Vec3::new(0.0, 1.8, -3.0));
    stage
}

/// Spawns meshes merged into one of a single material, without texture coordinates: no texture
/// reads them, and software Vulkan drivers spend more time on them than on everything measured
/// here.
fn spawn_all(stage: &mut Stage, meshes: impl Iterator<Item = Mesh>) {
    let joined = meshes.reduce(|mut all, mesh| {
        all.merge(&mesh).unwrap_or_else(|error| panic!("{error}"));
        all
    });
    let joined = joined
        .unwrap_or_else(|| panic!("there are some"))
        .with_removed_attribute(Mesh::ATTRIBUTE_UV_0);
    meshes::spawn(stage, joined, meshes::diffuse(0.7, 0.65, 0.6), Transform::default());
}

/// Ten spheres of `sectors` and `stacks` on a floor in the sun.
fn spheres((sectors, stacks): (u32, u32), options: &Arguments) -> Stage {
    let sun = Light::Directional {
        direction: Vec3::new(-0.4, -1.0, -0.3),
        illuminance: 50_000.0,
        color: [1.0; 3],
    };
    let mut stage = set::bare(
        vec![sun],
        set::radiance_options(options.size.x, options.size.y, Component::Indirect),
    );
    let sphere = Sphere::new(0.8).mesh().uv(sectors, stacks);
    let spheres = (0..10).map(|index| {
        sphere.clone().translated_by(Vec3::new(
            2.0 * (index % 5) as f32 - 4.0,
            0.8,
            -2.5 * (index / 5) as f32,
        ))
    });
    let floor = Mesh::from(Cuboid::new(14.0, 0.2, 10.0)).translated_by(Vec3::new(0.0, -0.1, 0.0));
    spawn_all(&mut stage, spheres.chain([floor]));
    set::look(&mut stage, Vec3::new(0.0, 2.5, 6.0), Vec3::new(0.0, 0.8, -1.0));
    stage
}
