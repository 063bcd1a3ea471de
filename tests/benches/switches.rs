//! Every switch that a map can ask for: frame times, compiled pipelines, and how far the image steps.
//!
//! `make bench BENCH=switches ARGS='MAP [--count PAIRS]'`. MAP is one of `courtyard`; images have its
//! size, and time passes at its frame rate. `WarmKnobs` shows the map's settings first, as in an
//! app. Then the camera stands still in the middle of the tour, and its settings go along a circuit
//! in which every ordered pair of the map's settings follow each other once.
//!
//! Time: wall time until the GPU has finished, relative to the median of the new settings' own
//! settled frames. A pair whose frames take more than twice that is switched again, and the least of
//! its ratios counts: what else runs on the machine does not come again at the same pair.
//!
//! Step of the image: mean absolute difference of two successive frames in 1/255 of the display's
//! range, over all pixels, and over the block of 8 × 8 pixels in which it is largest. Once without
//! the temporal filter, and once through it for the PAIRS that step furthest. Beside them, what the
//! scene's own motion steps: the tour at the best settings.

use std::path::Path;
use std::time::Instant;

use bevy::math::UVec2;
use bevy::render::render_resource::PipelineCache;
use bevy_frugal_gi::control::{ControlSettings, SettingsFilter};
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::knobs::{KnobLevels, WarmKnobs};
use frugal::scene::SceneDescription;
use frugal::stage::{Stage, StageOptions, adapter};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::{median, spread};
use frugal_tests::map::{change, circuit};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::metrics::Picture;

/// Frames that each settings stay. The last one counts as settled.
const FRAMES: usize = 4;
/// Ratio to the settled frame above which a switch is repeated.
const SLOW: f64 = 2.0;
const REPEATS: usize = 3;
/// Edge of a block, pixels.
const BLOCK: usize = 8;

/// Mean absolute difference of two images, in 1/255.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Step {
    everywhere: f64,
    /// Of the block in which it is largest.
    block: f64,
}

impl Step {
    fn between(a: &Picture, b: &Picture) -> Self {
        let width = a.width as usize;
        let columns = width.div_ceil(BLOCK);
        let mut blocks = vec![(0.0, 0.0); columns * (a.height as usize).div_ceil(BLOCK)];
        for (index, (a, b)) in a.rgb.iter().zip(&b.rgb).enumerate() {
            let block = &mut blocks[index / width / BLOCK * columns + index % width / BLOCK];
            for channel in 0..3 {
                block.0 += f64::from(a[channel].abs_diff(b[channel]));
                block.1 += 1.0;
            }
        }
        let (sum, count) = blocks.iter().fold((0.0, 0.0), |sum, b| (sum.0 + b.0, sum.1 + b.1));
        let block = blocks.iter().map(|(sum, count)| sum / count).fold(0.0, f64::max);
        Self { everywhere: sum / count, block }
    }

    fn max(self, other: Self) -> Self {
        Self {
            everywhere: self.everywhere.max(other.everywhere),
            block: self.block.max(other.block),
        }
    }
}

struct Bench {
    stage: Stage,
    scene: SceneDescription,
    frames_per_second: f64,
}

impl Bench {
    fn open(map: &FrontierMap) -> Self {
        let scene = set::scene("courtyard");
        let frames_per_second = map.capture.frames_per_second;
        let options = StageOptions {
            size: UVec2::from_array(map.capture.size),
            frames_per_second,
            knobs: Some(map.knobs.knobs().iter().map(|knob| knob.name.clone()).collect()),
            ..Default::default()
        };
        Self { stage: set::open(&scene, options), scene, frames_per_second }
    }

    /// Shows all settings once, as an app does behind its loading screen. Returns the number of
    /// frames.
    fn warm(&mut self, map: &FrontierMap) -> usize {
        let camera = set::camera(&mut self.stage);
        let warm = WarmKnobs::new(map.knobs.clone()).with_settings(map.settings());
        self.stage.world_mut().entity_mut(camera).insert(warm);
        let mut frames = 0;
        while self.stage.world_mut().get::<WarmKnobs>(camera).is_some() {
            self.stage.frame();
            frames += 1;
        }
        frames
    }

    fn pipelines(&self) -> usize {
        self.stage.render_world().resource::<PipelineCache>().pipelines().count()
    }

    fn place(&mut self, seconds: f32) {
        let pose = self.scene.paths["tour"].sample(seconds).expect("courtyard has a tour");
        self.stage.place(pose.position, pose.rotation);
    }

    /// Milliseconds of one frame.
    fn frame(&mut self) -> f64 {
        let start = Instant::now();
        self.stage.frame();
        start.elapsed().as_secs_f64() * 1e3
    }

    fn picture(&self) -> Picture {
        self.stage.picture().unwrap_or_else(|error| panic!("{error}"))
    }

    /// Milliseconds of each frame after a switch, and the largest step among them.
    fn switch(&mut self, to: KnobLevels, before: &mut Picture) -> ([f64; FRAMES], Step) {
        self.stage.switch(to);
        let mut step = Step::default();
        let times = std::array::from_fn(|_| {
            let time = self.frame();
            let picture = self.picture();
            step = step.max(Step::between(before, &picture));
            *before = picture;
            time
        });
        (times, step)
    }

    /// The largest step on the way from one setting to another through the temporal filter.
    fn filtered(&mut self, map: &FrontierMap, from: KnobLevels, to: KnobLevels) -> Step {
        self.stage.switch(from);
        (0..FRAMES).for_each(|_| self.stage.frame());
        let seconds = self.frames_per_second.recip();
        let times = ControlSettings::TRANSITION;
        let mut filter = SettingsFilter::default();
        filter.resume_from(from);
        let frames = (ControlSettings::TRANSITION.as_secs_f64() / seconds).ceil() as usize + FRAMES;
        let (mut step, mut before) = (Step::default(), self.picture());
        for _ in 0..frames {
            let applied = filter.step(&map.knobs, to, seconds, times);
            self.stage.switch(applied);
            self.stage.frame();
            let picture = self.picture();
            step = step.max(Step::between(&before, &picture));
            before = picture;
        }
        assert_eq!(filter.applied(), to, "the filter arrives");
        step
    }

    /// Steps from frame to frame along the tour.
    fn motion(&mut self, settings: KnobLevels) -> Vec<Step> {
        self.stage.switch(settings);
        let path = &self.scene.paths["tour"];
        let count = (path.duration() * self.frames_per_second as f32) as usize;
        let mut before: Option<Picture> = None;
        let mut steps = Vec::new();
        for frame in 0..count {
            self.place(frame as f32 / self.frames_per_second as f32);
            self.stage.frame();
            let picture = self.picture();
            // The first frames converge.
            if let Some(before) = before.filter(|_| frame > FRAMES) {
                steps.push(Step::between(&before, &picture));
            }
            before = Some(picture);
        }
        steps
    }
}

/// What was found of one ordered pair.
struct Switch {
    from: usize,
    to: usize,
    /// Milliseconds of each frame.
    times: [f64; FRAMES],
    step: Step,
}

fn row(name: &str, values: Vec<f64>) -> Vec<String> {
    let mut row = vec![name.to_owned(), values.len().to_string()];
    row.extend(spread(values).map(|value| format!("{value:.2}")));
    row
}

fn main() {
    let arguments = Arguments { size: UVec2::ZERO, samples: 0, count: 60, names: vec![] }.read();
    let Some(path) = arguments.names.first() else {
        println!("switches: name a map: ARGS='MAP'");
        return;
    };
    let Some(adapter) = adapter() else {
        println!("no graphics adapter: nothing is measured");
        return;
    };
    let map = frugal_tests::map::read(Path::new(path));
    let settings: Vec<KnobLevels> = map.settings().into_iter().collect();
    let mut bench = Bench::open(&map);
    let middle = 0.5 * bench.scene.paths["tour"].duration();
    bench.place(middle);
    let warmed = bench.warm(&map);
    let compiled = bench.pipelines();
    println!(
        "{}; {path}: {} settings, {}x{} at {} frames/s; {warmed} frames of warming, {compiled} pipelines\n",
        adapter.name,
        settings.len(),
        map.capture.size[0],
        map.capture.size[1],
        map.capture.frames_per_second
    );

    let order = circuit(settings.len());
    bench.stage.switch(settings[order[0]]);
    (0..FRAMES).for_each(|_| bench.stage.frame());
    let mut before = bench.picture();
    let mut switches = Vec::new();
    for pair in order.windows(2) {
        let (times, step) = bench.switch(settings[pair[1]], &mut before);
        switches.push(Switch { from: pair[0], to: pair[1], times, step });
    }
    let settled: Vec<f64> = (0..settings.len())
        .map(|to| {
            let of = switches.iter().filter(|switch| switch.to == to);
            median(of.map(|switch| switch.times[FRAMES - 1]).collect())
        })
        .collect();
    let slowest = |times: &[f64]| times.iter().copied().fold(0.0, f64::max);
    let mut ratios = Vec::new();
    let mut repeated = 0;
    for switch in &switches {
        let first = slowest(&switch.times[..FRAMES - 1]) / settled[switch.to];
        let mut least = first;
        for _ in 0..REPEATS {
            if least <= SLOW {
                break;
            }
            repeated += 1;
            bench.switch(settings[switch.from], &mut before);
            let (times, _) = bench.switch(settings[switch.to], &mut before);
            least = least.min(slowest(&times[..FRAMES - 1]) / settled[switch.to]);
        }
        ratios.push((switch, least));
    }
    let after = bench.pipelines();
    let over = ratios.iter().filter(|(_, ratio)| *ratio > SLOW).count();
    println!("## Time\n");
    println!(
        "{} switches, {repeated} repeated; {} pipelines compiled after warming; {over} take more than {SLOW} times the settled frame.\n",
        switches.len(),
        after - compiled
    );
    let headers =
        ["slowest of the first three frames, relative to", "pairs", "median", "95 %", "most"];
    let tour = median(settled.clone());
    println!(
        "{}\n",
        markdown(
            &headers,
            &[
                row("the new settings' settled frame", ratios.iter().map(|(_, r)| *r).collect()),
                row(
                    "the median of all settings' settled frames",
                    ratios.iter().map(|(switch, r)| r * settled[switch.to] / tour).collect()
                ),
            ]
        )
    );
    ratios.sort_by(|a, b| b.1.total_cmp(&a.1));
    for (switch, ratio) in ratios.iter().take(5) {
        println!("- {ratio:.2}: {}", change(&map, settings[switch.from], settings[switch.to]));
    }

    println!("\n## Step of the image\n");
    let motion = bench.motion(map.knobs.highest());
    bench.place(middle);
    switches.sort_by(|a, b| b.step.everywhere.total_cmp(&a.step.everywhere));
    let furthest = &switches[..switches.len().min(arguments.count as usize)];
    let filtered: Vec<Step> = furthest
        .iter()
        .map(|switch| bench.filtered(&map, settings[switch.from], settings[switch.to]))
        .collect();
    type Part = (&'static str, fn(&Step) -> f64);
    let parts: [Part; 2] =
        [("everywhere", |step| step.everywhere), ("largest block", |step| step.block)];
    let mut rows = Vec::new();
    for (part, value) in parts {
        let mut add = |name: &str, steps: &mut dyn Iterator<Item = &Step>| {
            rows.push(row(&format!("{part}: {name}"), steps.map(value).collect()));
        };
        add("the tour, best settings", &mut motion.iter());
        add("all switches, unfiltered", &mut switches.iter().map(|switch| &switch.step));
        add("furthest switches, unfiltered", &mut furthest.iter().map(|switch| &switch.step));
        add("furthest switches, filtered", &mut filtered.iter());
    }
    let headers = ["largest step between two frames, 1/255", "number", "median", "95 %", "most"];
    println!("{}\n", markdown(&headers, &rows));
    for switch in furthest.iter().take(5) {
        println!(
            "- {:.1}: {}",
            switch.step.everywhere,
            change(&map, settings[switch.from], settings[switch.to])
        );
    }
}
