//! Temporal error at every switch between two settings of a map, beside `naive-rsm`'s in the same motion.
//!
//! The camera walks to and fro over the frames of one stretch, 2 cm a frame, so that a few path-traced
//! images serve as reference of any number of steps. Settings follow each other along a circuit through
//! all ordered pairs. Each stays four frames, and the error of the step into each is recorded; those that
//! err most go through the temporal filter, too. Where one of two settings has no indirect light, all of it
//! comes or goes: those switches have rows of their own.

use std::path::Path;

use bevy::math::{Quat, UVec2};
use bevy_frugal_gi::control::{ControlSettings, SettingsFilter};
use bevy_frugal_gi::frontier::FrontierMap;
use bevy_frugal_gi::gi::GiRefresh;
use bevy_frugal_gi::knobs::KnobLevels;
use frugal::scene::SceneDescription;
use frugal::stage::{Component, Stage, StageOptions};
use frugal_tests::arguments::Arguments;
use frugal_tests::cost::spread;
use frugal_tests::map::{change, circuit, read};
use frugal_tests::naive_rsm::NaiveRsm;
use frugal_tests::reference::{self, mean_absolute_difference};
use frugal_tests::set;
use frugal_tests::table::markdown;
use frugal_trace::metrics::Radiance;

use crate::moving::{FRAMES_BEFORE, Motion, differences, means, methods, move_to, sun, traced};

/// Frames that settings stay.
const FRAMES: usize = 4;
/// More frames than light takes to come or go: 0.8 s at 30 frames a second.
const FADE_FRAMES: usize = 26;
/// Switches of each kind that go through the temporal filter.
const FILTERED: usize = 20;

/// A stretch of the camera's path, walked to and fro, and the reference's steps along it.
struct Walk {
    scene: SceneDescription,
    /// Difference of each frame of the stretch to the one before.
    steps: Vec<Vec<[f32; 3]>>,
    /// Mean radiance of the reference, nits.
    mean: f64,
    initial: Quat,
    at: usize,
    forward: bool,
}

impl Walk {
    /// Moves the camera by one frame.
    fn step(&mut self, stage: &mut Stage) {
        if self.at == self.steps.len() {
            self.forward = false;
        } else if self.at == 0 {
            self.forward = true;
        }
        self.at = if self.forward { self.at + 1 } else { self.at - 1 };
        move_to(stage, Motion::Camera.at(&self.scene, self.at as i32), self.initial);
    }

    /// Error of the last step from `before` to `after`, relative to the reference's mean.
    fn error(&self, before: &Radiance, after: &Radiance) -> f64 {
        let step = &self.steps[if self.forward { self.at - 1 } else { self.at }];
        let sign = if self.forward { 1.0 } else { -1.0 };
        let own: Vec<[f32; 3]> = (before.rgb.iter().zip(&after.rgb))
            .map(|(before, after)| [0, 1, 2].map(|i| sign * (after[i] - before[i])))
            .collect();
        mean_absolute_difference(&own, step) / self.mean
    }
}

struct Bench {
    stage: Stage,
    walk: Walk,
    last: Radiance,
}

impl Bench {
    /// Walks on by one frame, and returns the error of that step.
    fn frame(&mut self) -> f64 {
        self.walk.step(&mut self.stage);
        self.stage.frame();
        let image = self.stage.radiance().unwrap_or_else(|error| panic!("{error}"));
        let error = self.walk.error(&self.last, &image);
        self.last = image;
        error
    }

    /// Mean error of a step while settings stay as they are.
    fn settled(&mut self) -> f64 {
        (0..FRAMES_BEFORE).for_each(|_| {
            self.frame();
        });
        let count = 2 * self.walk.steps.len();
        (0..count).map(|_| self.frame()).sum::<f64>() / count as f64
    }

    fn switch(&mut self, to: KnobLevels) -> [f64; FRAMES] {
        self.stage.switch(to);
        std::array::from_fn(|_| self.frame())
    }

    /// Errors of the steps on the way from one setting to another through the temporal filter.
    fn filtered(&mut self, map: &FrontierMap, from: KnobLevels, to: KnobLevels) -> Vec<f64> {
        self.switch(from);
        // What was before has faded.
        (0..FADE_FRAMES).for_each(|_| {
            self.frame();
        });
        let seconds = self.stage.options().frames_per_second.recip();
        let times = ControlSettings::TRANSITION;
        let mut filter = SettingsFilter::default();
        filter.resume_from(from);
        let transition = ControlSettings::TRANSITION.as_secs_f64() / seconds;
        let frames = transition.ceil() as usize + FADE_FRAMES;
        let step = |_| {
            let applied = filter.step(&map.knobs, to, seconds, times);
            self.stage.switch(applied);
            self.frame()
        };
        (0..frames).map(step).collect()
    }
}

/// Settings that concern GI; all others are at their best, and equal.
fn gi_settings(map: &FrontierMap) -> Vec<KnobLevels> {
    let best = map.knobs.highest();
    let names: Vec<_> = map.knobs.knobs().iter().map(|knob| knob.name.as_str()).collect();
    let of_gi = |name: &str| name.starts_with("gi_") || name == "rsm_resolution";
    let mut found: Vec<KnobLevels> = (map.settings().into_iter())
        .map(|settings| {
            map.knobs.from_levels(|index, _| {
                let kept = if of_gi(names[index]) { settings } else { best };
                kept.level(index)
            })
        })
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Prints the errors at all switches of a map.
pub(crate) fn measure(file: &Path, options: &Arguments) {
    let map = read(file);
    let scene = reference::without_environment(&set::scene("courtyard"));
    let motion = Motion::Camera;
    let images = |seed| -> Vec<Radiance> {
        (0..=options.count as i32)
            .map(|frame| traced(&scene, motion, frame, seed, options))
            .collect()
    };
    let [first, second] = [images(0), images(1)];
    let steps: Vec<_> =
        (differences(&first).iter().zip(&differences(&second))).map(|(a, b)| means(a, b)).collect();
    let stage_options = StageOptions {
        knobs: Some(map.knobs.knobs().iter().map(|knob| knob.name.clone()).collect()),
        ..set::radiance_options(options.size.x, options.size.y, Component::Indirect)
    };
    let mut stage = set::open(&scene, stage_options);
    reference::strip_textures(&mut stage);
    let initial = sun(&mut stage);
    let walk = Walk { scene, steps, mean: first[0].mean(), initial, at: 0, forward: false };
    let last = first[0].clone();
    let mut bench = Bench { stage, walk, last };

    // As in `steps`: the variant with the smallest error of the image.
    let naive: Vec<(f64, f64)> = (methods().iter().filter(|method| method.is_naive()))
        .map(|method| {
            bench.last = method.radiance(&mut bench.stage);
            let at = &first[bench.walk.at];
            let image = mean_absolute_difference(&bench.last.rgb, &at.rgb);
            (image, bench.settled())
        })
        .collect();
    let naive = naive.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(f64::NAN, |n| n.1);
    report(&mut bench, &map, naive, options.size);
}

fn report(bench: &mut Bench, map: &FrontierMap, naive: f64, size: UVec2) {
    let settings = gi_settings(map);
    let gi = bevy_frugal_gi::gi::GiOutput::IndirectOnly;
    frugal_tests::naive_rsm::show(&mut bench.stage, None::<NaiveRsm>, gi);
    bench.stage.world_mut().insert_resource(GiRefresh::AsIfCamerasMoved);
    let settled: Vec<f64> = (settings.iter())
        .map(|settings| {
            bench.stage.switch(*settings);
            bench.settled()
        })
        .collect();
    let order = circuit(settings.len());
    bench.switch(settings[order[0]]);
    let mut pairs: Vec<Pair> = (order.windows(2))
        .map(|pair| Pair {
            from: pair[0],
            to: pair[1],
            errors: bench.switch(settings[pair[1]]).to_vec(),
            filtered: Vec::new(),
        })
        .collect();
    pairs.sort_by(|a, b| most(&b.errors).total_cmp(&most(&a.errors)));
    let has_light = lights(map, &settings);
    let (mut lit, mut dark): (Vec<Pair>, Vec<Pair>) =
        pairs.into_iter().partition(|pair| has_light[pair.from] && has_light[pair.to]);
    for pair in lit.iter_mut().take(FILTERED).chain(dark.iter_mut().take(FILTERED)) {
        pair.filtered = bench.filtered(map, settings[pair.from], settings[pair.to]);
    }

    println!(
        "## Switches of a map\n\n{} settings of GI, {} switches, {}x{}. Temporal error of `naive-rsm`: {:.3} % of the mean.\n",
        settings.len(),
        lit.len() + dark.len(),
        size.x,
        size.y,
        100.0 * naive
    );
    let mut rows = vec![row("settings that stay", settled, naive)];
    for (name, pairs) in [("with light", &lit), ("light comes or goes", &dark)] {
        for frame in 0..FRAMES {
            let errors = pairs.iter().map(|pair| pair.errors[frame]).collect();
            rows.push(row(&format!("{name}, frame {}", frame + 1), errors, naive));
        }
        let furthest = || pairs.iter().take(FILTERED);
        let worst = |errors: &dyn Fn(&Pair) -> f64| furthest().map(errors).collect::<Vec<_>>();
        rows.push(row("the furthest, worst frame", worst(&|pair| most(&pair.errors)), naive));
        rows.push(row("filtered, worst frame", worst(&|pair| most(&pair.filtered)), naive));
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        rows.push(row(
            "filtered, mean over the second",
            worst(&|pair| mean(&pair.filtered)),
            naive,
        ));
    }
    let headers =
        ["temporal error, relative to naive-rsm's", "number", "median", "95 %", "most", "≤ 1/3"];
    println!("{}\n", markdown(&headers, &rows));
    for pair in lit.iter().take(5).chain(dark.iter().take(2)) {
        let change = change(map, settings[pair.from], settings[pair.to]);
        println!("- {:.2}: {change}", most(&pair.errors) / naive);
    }
}

/// A switch from one setting to another, by their numbers.
struct Pair {
    from: usize,
    to: usize,
    /// Of each frame after it.
    errors: Vec<f64>,
    /// The same through the temporal filter, of those that err most.
    filtered: Vec<f64>,
}

/// Which settings have indirect light.
fn lights(map: &FrontierMap, settings: &[KnobLevels]) -> Vec<bool> {
    let knob = map.knobs.index_of("gi_vpl_count");
    let value = |settings: &KnobLevels, knob: usize| {
        map.knobs.knobs()[knob].levels[settings.level(knob)].value
    };
    settings.iter().map(|settings| knob.is_none_or(|knob| value(settings, knob) > 0.0)).collect()
}

fn most(errors: &[f64]) -> f64 {
    errors.iter().copied().fold(0.0, f64::max)
}

fn row(name: &str, errors: Vec<f64>, naive: f64) -> Vec<String> {
    let third = errors.iter().filter(|error| 3.0 * **error <= naive).count();
    let mut row = vec![name.to_owned(), errors.len().to_string()];
    row.extend(spread(errors).map(|error| format!("{:.2}", error / naive)));
    row.push(third.to_string());
    row
}
