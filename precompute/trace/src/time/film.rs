//! The image of each frame, in one call with the steady one.

use glam::DVec3;

use super::SPEED_OF_LIGHT;
use crate::color::color;
use crate::integrator::path::{Arrival, Record};
use crate::integrator::render::render_recorded;
use crate::integrator::{ReferenceScene, Rendering, Settings, View, Watch};

/// Exponent of [`bandwidth`] at which variance and squared bias fall alike, as n^(−4/5).
const ALPHA: f64 = 0.8;

/// Frames of equal duration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Start of the first frame, seconds after the flash.
    pub start: f64,
    /// End of the last frame, seconds, above `start`.
    pub end: f64,
    /// Number of frames, from 1 to 65 536.
    pub frames: u32,
    /// Whether the way to the camera from where light was scattered last takes no time: light then
    /// sweeps over surfaces and through fog as it does in the world.
    pub at_surfaces: bool,
}

/// How an arrival spreads over frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spread {
    /// To the frame of its time: means over frames, whose sum is the steady image.
    Bins,
    /// By a kernel of this bandwidth, seconds: values at the frames' middles.
    Kernel(f64),
}

/// Why there is no time-resolved image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// The window is empty, not finite, or has no frames or too many.
    #[error("a window needs a start before its end, both finite, and 1 to 65536 frames")]
    Window,
    /// A bandwidth, radius, frequency or intensity is not finite or not above 0.
    #[error("a bandwidth, radius, frequency or intensity must be finite and above 0")]
    NotPositive,
    /// A list has not one value for each pixel.
    #[error("a capture needs one value for each pixel of its view")]
    Pixels,
    /// Beams are in fog.
    #[error("the scene has no fog")]
    NoFog,
    /// The caller interrupted it.
    #[error("interrupted")]
    Interrupted,
}

/// A time-resolved image.
#[derive(Clone, Debug, PartialEq)]
pub struct Frames {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// The frames' times.
    pub window: Window,
    /// By pixel, row by row from the top, then by frame: linear RGB, nits per second.
    pub values: Vec<[f32; 3]>,
    /// By pixel: light outside of the window, nits.
    pub outside: Vec<[f32; 3]>,
}

impl Window {
    /// Seconds of a frame.
    pub fn duration(&self) -> f64 {
        (self.end - self.start) / f64::from(self.frames)
    }

    /// Time in the middle of a frame, seconds.
    pub fn middle(&self, frame: u32) -> f64 {
        self.start + (f64::from(frame) + 0.5) * self.duration()
    }

    /// Checks the fields' ranges.
    ///
    /// # Errors
    /// When one is out of range.
    pub fn validate(&self) -> Result<(), TimeError> {
        let fits = self.start.is_finite() && self.end.is_finite() && self.duration() > 0.0;
        if fits && (1..=65_536).contains(&self.frames) { Ok(()) } else { Err(TimeError::Window) }
    }
}

impl Frames {
    /// Means of films, each over as many paths as `count` says.
    pub(super) fn new(
        view: &View,
        window: Window,
        films: Vec<Film>,
        count: impl Fn(&Film) -> u32,
    ) -> Self {
        let (mut values, mut outside) = (Vec::new(), Vec::new());
        for film in films {
            let share = 1.0 / f64::from(count(&film).max(1));
            values.extend(film.values.iter().map(|value| (*value * share).as_vec3().to_array()));
            outside.push((film.outside * share).as_vec3().to_array());
        }
        Self { width: view.size.x, height: view.size.y, window, values, outside }
    }

    /// One frame: linear RGB, nits per second, row by row; `None` beyond the last.
    pub fn frame(&self, frame: u32) -> Option<Vec<[f32; 3]>> {
        let count = self.window.frames as usize;
        let one = |pixel: &[[f32; 3]]| pixel[frame as usize];
        (frame < self.window.frames).then(|| self.values.chunks_exact(count).map(one).collect())
    }

    /// Integral over time of each pixel, nits, with the light outside of the window: of bins it is
    /// the steady image.
    pub fn integral(&self) -> Vec<[f32; 3]> {
        let pixels = self.values.chunks_exact(self.window.frames as usize).zip(&self.outside);
        pixels
            .map(|(frames, outside)| {
                let sum = frames.iter().fold(DVec3::ZERO, |sum, value| sum + color(*value));
                (sum * self.window.duration() + color(*outside)).as_vec3().to_array()
            })
            .collect()
    }
}

/// A pixel's frames as they are filled.
pub(super) struct Film {
    window: Window,
    /// How the first path spreads, and what part of its bandwidth each has.
    first: Spread,
    narrowing: fn(u32) -> f64,
    /// How this path spreads.
    spread: Spread,
    begun: u32,
    near: f64,
    pending: Vec<Arrival>,
    values: Vec<DVec3>,
    outside: DVec3,
    paths: u32,
}

impl Record for Film {
    fn begin(&mut self, near: f64) {
        self.near = near;
        if let Spread::Kernel(first) = self.first {
            self.spread = Spread::Kernel(first * (self.narrowing)(self.begun));
        }
        self.begun += 1;
    }

    fn arrived(&mut self, arrival: Arrival) {
        self.pending.push(arrival);
    }

    fn end(&mut self, counts: bool) {
        self.paths += u32::from(counts);
        // Taken, so that a dropped path leaves nothing.
        for arrival in std::mem::take(&mut self.pending) {
            if counts {
                self.add(arrival);
            }
        }
    }
}

impl Film {
    /// `narrowing` gives the share of the bandwidth of `first` that a path, counted from 0, has.
    pub(super) fn new(window: Window, first: Spread, narrowing: fn(u32) -> f64) -> Self {
        Self {
            window,
            first,
            narrowing,
            spread: first,
            begun: 0,
            near: 0.0,
            pending: Vec::new(),
            values: vec![DVec3::ZERO; window.frames as usize],
            outside: DVec3::ZERO,
            paths: 0,
        }
    }

    fn add(&mut self, arrival: Arrival) {
        let length =
            arrival.length + if self.window.at_surfaces { -arrival.last } else { self.near };
        let (time, step) = (length / SPEED_OF_LIGHT, self.window.duration());
        let place = (time - self.window.start) / step;
        let is_inside = place >= 0.0 && place < f64::from(self.window.frames);
        if !is_inside {
            self.outside += arrival.light;
        }
        match self.spread {
            Spread::Bins if is_inside => self.values[place as usize] += arrival.light / step,
            Spread::Bins => {}
            Spread::Kernel(width) => {
                let last = f64::from(self.window.frames - 1);
                let reach = width / step;
                let (from, to) = (place - 0.5 - reach, place - 0.5 + reach);
                if to < 0.0 || from > last {
                    return;
                }
                for frame in from.ceil().max(0.0) as u32..=to.floor().min(last) as u32 {
                    let distance = self.window.middle(frame) - time;
                    self.values[frame as usize] += arrival.light * kernel(distance, width);
                }
            }
        }
    }
}

/// Share of the first pass's width that pass number `pass`, from 0, has, where the product of all widths
/// keeps (j + α) ÷ (j + 1) from pass j to the next, and this width the part β of that, in logarithms.
pub(super) fn narrowed(alpha: f64, beta: f64, pass: u32) -> f64 {
    (1..=pass).map(f64::from).map(|j| ((j + alpha) / (j + 1.0)).powf(beta)).product()
}

/// Path-traces `view` of `scene` once, for the steady image and for the time-resolved one. The
/// steady image is, bit by bit, that of [`render`](crate::integrator::render()).
///
/// Memory: 12 bytes for each frame of each pixel, and 24 more while it runs.
///
/// # Errors
/// When the window or the bandwidth is out of range, or `watch` interrupts.
pub fn frames(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    window: Window,
    spread: Spread,
    watch: Watch,
) -> Result<(Rendering, Frames), TimeError> {
    validate(window, spread)?;
    let film = || Film::new(window, spread, |_| 1.0);
    let (rendering, films) =
        render_recorded(scene, view, settings, watch, &film).ok_or(TimeError::Interrupted)?;
    Ok((rendering, Frames::new(view, window, films, |film| film.paths)))
}

pub(super) fn validate(window: Window, spread: Spread) -> Result<(), TimeError> {
    window.validate()?;
    if let Spread::Kernel(width) = spread { positive(width) } else { Ok(()) }
}

/// Whether `value` is finite and above 0.
pub(super) fn positive(value: f64) -> Result<(), TimeError> {
    if value.is_finite() && value > 0.0 { Ok(()) } else { Err(TimeError::NotPositive) }
}

/// The mean of `passes` passes with kernels that shrink from `first` seconds, see [`bandwidth`];
/// each pass has `settings.samples` paths per pixel and its own random numbers.
///
/// # Errors
/// As of [`frames`].
pub fn progressive(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    window: Window,
    first: f64,
    passes: u32,
    watch: Watch,
) -> Result<Frames, TimeError> {
    let mut mean: Option<Frames> = None;
    for pass in 0..passes.max(1) {
        let seed = settings.seed.wrapping_add(u64::from(pass) << 32);
        let spread = Spread::Kernel(bandwidth(first, pass));
        let settings = Settings { seed, ..*settings };
        let (_, next) = frames(scene, view, &settings, window, spread, watch)?;
        let share = 1.0 / (pass as f32 + 1.0);
        let blend = |mean: &mut [f32; 3], next: &[f32; 3]| {
            (0..3).for_each(|i| mean[i] += (next[i] - mean[i]) * share);
        };
        match &mut mean {
            None => mean = Some(next),
            Some(mean) => {
                mean.values.iter_mut().zip(&next.values).for_each(|(mean, next)| blend(mean, next));
                mean.outside.iter_mut().zip(&next.outside).for_each(|(a, b)| blend(a, b));
            }
        }
    }
    mean.ok_or(TimeError::Interrupted)
}

/// A kernel at a distance in time, per second: Perlin's smooth step, 0 beyond `bandwidth`, with the
/// integral 1. Both in seconds; 0 where `bandwidth` is not above 0.
pub fn kernel(distance: f64, bandwidth: f64) -> f64 {
    let u = (distance / bandwidth).abs();
    // This form also rejects NaN.
    if !(u < 1.0 && bandwidth > 0.0) {
        return 0.0;
    }
    (1.0 - u * u * u * (u * (6.0 * u - 15.0) + 10.0)) / bandwidth
}

/// Bandwidth of pass number `pass`, from 0, where the first has `first`; seconds.
///
/// Jarabo et al. 2014, section 4.1: `T(j + 1) = T(j) (j + α) / (j + 1)` with α = 4/5. The mean over
/// n passes then has a squared error of n^(−4/5); bins of the best width for n have n^(−2/3).
pub fn bandwidth(first: f64, pass: u32) -> f64 {
    first * narrowed(ALPHA, 1.0, pass)
}
