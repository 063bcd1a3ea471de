//! A time-of-flight camera: the light is modulated, and its phase tells how far it went.
//!
//! Lange and Seitz 2001, "Solid-State Time-of-Flight Range Camera": continuous waves, ideal
//! sinusoids, four phases. A phasor is a pair of real and imaginary part: the sum over all paths of
//! amplitude × exp(i 2π f length ÷ c).

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::SPEED_OF_LIGHT;
use super::film::{TimeError, positive};
use crate::color::luminance;
use crate::integrator::path::{Arrival, Record};
use crate::integrator::render::render_recorded;
use crate::integrator::{ReferenceScene, Settings, View, Watch, surfaces};

/// What one path of `length` metres adds to a pixel's phasor, at a modulation `frequency` in hertz.
pub fn phasor(amplitude: f64, length: f64, frequency: f64) -> DVec2 {
    DVec2::from_angle(TAU * (length * frequency / SPEED_OF_LIGHT).fract()) * amplitude
}

/// The four values that a sensor measures, a quarter of a period apart: correlation with the emitted
/// wave. `offset` is unmodulated light, which the depth does not depend on.
pub fn phases(phasor: DVec2, offset: f64) -> [f64; 4] {
    [offset + phasor.x, offset - phasor.y, offset - phasor.x, offset + phasor.y]
}

/// Distance that four phases stand for, metres, in [0, [`range`]); `None` where there is no
/// modulated light, or values are not finite. With the light at the camera it is half the path of
/// the light; more paths than one are an error that no phase shows.
pub fn depth([c1, c2, c3, c4]: [f64; 4], frequency: f64) -> Option<f64> {
    let (x, y) = (c1 - c3, c4 - c2);
    let metres = y.atan2(x).rem_euclid(TAU) / TAU * range(frequency);
    // A tiny negative angle rounds to a full turn.
    let metres = if metres >= range(frequency) { 0.0 } else { metres };
    (x != 0.0 || y != 0.0).then_some(metres).filter(|metres| metres.is_finite())
}

/// Distance at which the phase of a `frequency` in hertz begins anew, metres.
pub fn range(frequency: f64) -> f64 {
    SPEED_OF_LIGHT / (2.0 * frequency)
}

/// What a time-of-flight camera measured, by pixel and row by row. [`capture`] and
/// [`new`](Capture::new) make it: its lists are of one length.
#[derive(Clone, Debug, PartialEq)]
pub struct Capture {
    pub(super) frequency: f64,
    pub(super) width: usize,
    pub(super) all: Vec<DVec2>,
    direct: Vec<DVec2>,
    distances: Vec<Option<f64>>,
    /// Depths to which those of phasors are near, metres.
    coarse: Vec<Option<f64>>,
    pub(super) rays: Vec<glam::DVec3>,
}

struct Correlation {
    frequency: f64,
    near: f64,
    /// All light and direct light, of this path and of those before.
    path: [DVec2; 2],
    sums: [DVec2; 2],
    paths: u32,
}

impl Record for Correlation {
    fn begin(&mut self, near: f64) {
        self.near = near;
    }

    fn arrived(&mut self, arrival: Arrival) {
        // What shines into the camera itself is not modulated light from a surface.
        if arrival.surfaces == 0 {
            return;
        }
        let length = arrival.length + self.near;
        let own = phasor(luminance(arrival.light), length, self.frequency);
        self.path[0] += own;
        if arrival.surfaces == 1 {
            self.path[1] += own;
        }
    }

    fn end(&mut self, counts: bool) {
        let path = std::mem::take(&mut self.path);
        if counts {
            self.paths += 1;
            (0..2).for_each(|i| self.sums[i] += path[i]);
        }
    }
}

/// Path-traces what a time-of-flight camera measures at `frequency`, hertz, when all lights of the
/// scene are modulated; a light at the eye makes it a camera of this kind.
///
/// # Errors
/// When the frequency is not above 0, or `watch` interrupts.
pub fn capture(
    scene: &ReferenceScene,
    view: &View,
    settings: &Settings,
    frequency: f64,
    watch: Watch,
) -> Result<Capture, TimeError> {
    positive(frequency)?;
    let empty = || Correlation {
        frequency,
        near: 0.0,
        path: [DVec2::ZERO; 2],
        sums: [DVec2::ZERO; 2],
        paths: 0,
    };
    let (_, records) =
        render_recorded(scene, view, settings, watch, &empty).ok_or(TimeError::Interrupted)?;
    let pick = |i: usize| -> Vec<DVec2> {
        records.iter().map(|record| record.sums[i] / f64::from(record.paths.max(1))).collect()
    };
    let eye = view.pose.position.as_dvec3();
    let hits = surfaces(scene, view).into_iter();
    let distances = hits.map(|hit| hit.map(|hit| hit.position.distance(eye))).collect();
    Capture::new(view, frequency, [pick(0), pick(1)], distances)
}

impl Capture {
    /// What another renderer measured at `frequency`, hertz, in `view`: phasors of all light and of
    /// light that was scattered once, nits, and true distances, metres.
    ///
    /// # Errors
    /// When the frequency is not above 0, or a list has not one value for each pixel.
    pub fn new(
        view: &View,
        frequency: f64,
        [all, direct]: [Vec<DVec2>; 2],
        distances: Vec<Option<f64>>,
    ) -> Result<Self, TimeError> {
        positive(frequency)?;
        let rays = view.rays();
        if [all.len(), direct.len(), distances.len()] != [rays.len(); 3] {
            return Err(TimeError::Pixels);
        }
        let (width, coarse) = (view.size.x as usize, vec![None; rays.len()]);
        Ok(Self { frequency, width, all, direct, distances, coarse, rays })
    }

    /// The same with depths beyond the [`range`], given `coarse` ones of a lower frequency in the same
    /// view, metres (Droeschel, Holz and Behnke 2010, "Multi-frequency Phase Unwrapping for
    /// Time-of-Flight Cameras"). Coarse depths must be off by less than half the range: a few steps up
    /// bear larger errors than one. What goes detours disturbs high frequencies less, because ways of
    /// many lengths cancel out (Gupta et al. 2015, "Phasor Imaging").
    ///
    /// # Errors
    /// When there is not one depth for each pixel.
    pub fn unwrapped(self, coarse: Vec<Option<f64>>) -> Result<Self, TimeError> {
        if coarse.len() != self.rays.len() {
            return Err(TimeError::Pixels);
        }
        Ok(Self { coarse, ..self })
    }

    /// Phasors of all light that surfaces or fog scattered, nits.
    pub fn all(&self) -> &[DVec2] {
        &self.all
    }

    /// Phasors of light that was scattered once, nits.
    pub fn direct(&self) -> &[DVec2] {
        &self.direct
    }

    /// True distances from the eye along the rays through the pixels' middles, metres; `None` where
    /// there is no surface.
    pub fn distances(&self) -> &[Option<f64>] {
        &self.distances
    }

    /// Distances that `phasors`, one for each pixel, stand for, metres: in the first [`range`], or, where
    /// [coarse depths](Self::unwrapped) are known, the nearest to those.
    pub fn depths(&self, phasors: &[DVec2]) -> Vec<Option<f64>> {
        let (frequency, range) = (self.frequency, range(self.frequency));
        let unwrapped = |(own, coarse): (&DVec2, &Option<f64>)| {
            let own = depth(phases(*own, 0.0), frequency)?;
            let near = coarse.filter(|near| near.is_finite()).unwrap_or(own);
            Some(own + range * ((near - own) / range).round().max(0.0))
        };
        phasors.iter().zip(&self.coarse).map(unwrapped).collect()
    }

    /// Solid angle of a pixel, steradians, from its neighbours' rays.
    pub(super) fn solid_angle(&self, pixel: usize) -> f64 {
        let (width, rays) = (self.width, &self.rays);
        let x = pixel % width;
        let right = if x + 1 < width { pixel + 1 } else { pixel - usize::from(x > 0) };
        let below =
            if pixel + width < rays.len() { pixel + width } else { pixel.saturating_sub(width) };
        let [b, c] = [right, below].map(|other| rays[other] - rays[pixel]);
        b.cross(c).length().min(PI)
    }
}
