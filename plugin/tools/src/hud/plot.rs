//! A frontier as pixels: power to the right, error upwards on a square-root scale, which shows the
//! small errors that matter.

/// Width of the plot, pixels.
pub(super) const WIDTH: usize = 300;
/// Height of the plot, pixels.
pub(super) const HEIGHT: usize = 72;
/// Pixels between the plot's border and its area.
const MARGIN: usize = 5;

type Color = [u8; 4];
const BACKGROUND: Color = [14, 18, 24, 255];
const AXIS: Color = [70, 78, 88, 255];
const STEPS: Color = [60, 100, 140, 255];
const POINT: Color = [130, 185, 240, 255];
pub(super) const LIMIT: Color = [235, 110, 60, 255];
pub(super) const TARGET: Color = [250, 210, 60, 255];
pub(super) const APPLIED: Color = [255, 255, 255, 255];

/// What a plot shows: powers in the meter's watts, errors as 1 − SSIM. Any numbers are accepted;
/// what is NaN is not drawn, and what is beyond the range lies on its border.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Plot {
    /// Power and error of the frontier's points, in order of power.
    pub points: Vec<(f64, f64)>,
    /// The settings in force.
    pub applied: Option<(f64, f64)>,
    /// The selected settings.
    pub target: Option<(f64, f64)>,
    pub power_limit: Option<f64>,
    pub error_limit: Option<f64>,
}

/// An interval of values on a row of pixels.
struct Axis {
    low: f64,
    high: f64,
    first: usize,
    last: usize,
}

impl Axis {
    /// The interval of all finite `values`.
    fn of(values: impl Iterator<Item = f64>, first: usize, last: usize) -> Self {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        Self { low, high, first, last }
    }

    /// The pixel of a value; `None` for NaN.
    fn pixel(&self, value: f64) -> Option<usize> {
        if value.is_nan() {
            return None;
        }
        let share = if self.high > self.low {
            // Halves, whose difference is finite.
            (0.5 * value - 0.5 * self.low) / (0.5 * self.high - 0.5 * self.low)
        } else if value == self.low || self.low == f64::INFINITY {
            // There is no interval: a single value is in the middle.
            0.5
        } else {
            f64::from(value > self.low)
        };
        let span = (self.last - self.first) as f64;
        Some(self.first + (share.clamp(0.0, 1.0) * span).round() as usize)
    }
}

/// The pixels of a plot, row by row from the top, as RGBA.
struct Canvas(Vec<u8>);

impl Canvas {
    fn set(&mut self, x: usize, y: usize, color: Color) {
        if x < WIDTH && y < HEIGHT {
            let start = 4 * (y * WIDTH + x);
            self.0[start..start + 4].copy_from_slice(&color);
        }
    }

    fn fill(&mut self, (x0, x1): (usize, usize), (y0, y1): (usize, usize), color: Color) {
        for y in y0.min(y1)..=y0.max(y1) {
            for x in x0.min(x1)..=x0.max(x1) {
                self.set(x, y, color);
            }
        }
    }

    fn square(&mut self, (x, y): (usize, usize), reach: usize, color: Color) {
        self.fill(
            (x.saturating_sub(reach), x + reach),
            (y.saturating_sub(reach), y + reach),
            color,
        );
    }
}

impl Plot {
    /// RGBA, eight bits a channel, `WIDTH` × `HEIGHT`, from the top.
    pub(super) fn draw(&self) -> Vec<u8> {
        let mut canvas = Canvas(BACKGROUND.repeat(WIDTH * HEIGHT));
        let bottom = HEIGHT - 1 - MARGIN;
        let costs = || self.points.iter().chain(&self.applied).chain(&self.target);
        let power = Axis::of(costs().map(|cost| cost.0), MARGIN, WIDTH - 1 - MARGIN);
        // From 0, so that the height of a point says how good it is.
        let error = Axis::of(costs().map(|cost| height(cost.1)).chain([0.0]), 0, bottom - MARGIN);
        let row = |value: f64| Some(bottom - error.pixel(height(value))?);
        let place = |cost: (f64, f64)| Some((power.pixel(cost.0)?, row(cost.1)?));

        canvas.fill((MARGIN - 2, WIDTH - 1), (bottom + 2, bottom + 2), AXIS);
        canvas.fill((MARGIN - 2, MARGIN - 2), (0, bottom + 2), AXIS);
        let places: Vec<_> = self.points.iter().filter_map(|cost| place(*cost)).collect();
        for pair in places.windows(2) {
            let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
            canvas.fill((x0, x1), (y0, y0), STEPS);
            canvas.fill((x1, x1), (y0, y1), STEPS);
        }
        for point in places {
            canvas.square(point, 1, POINT);
        }
        if let Some(x) = self.power_limit.and_then(|limit| power.pixel(limit)) {
            canvas.fill((x, x), (0, bottom + 1), LIMIT);
        }
        if let Some(y) = self.error_limit.and_then(row) {
            canvas.fill((MARGIN - 1, WIDTH - 1), (y, y), LIMIT);
        }
        if let Some(point) = self.target.and_then(place) {
            canvas.square(point, 3, TARGET);
        }
        if let Some(point) = self.applied.and_then(place) {
            canvas.square(point, 1, APPLIED);
        }
        canvas.0
    }
}

/// Height of an error above the axis, before scaling; NaN stays NaN.
fn height(error: f64) -> f64 {
    if error < 0.0 { 0.0 } else { error.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pixels of a colour, as columns and rows.
    fn pixels(plot: &Plot, color: Color) -> Vec<(usize, usize)> {
        let drawn = plot.draw();
        assert_eq!(drawn.len(), 4 * WIDTH * HEIGHT);
        let is_color = |(_, pixel): &(usize, &[u8])| **pixel == color;
        let at = |(index, _): (usize, &[u8])| (index % WIDTH, index / WIDTH);
        drawn.chunks(4).enumerate().filter(is_color).map(at).collect()
    }

    fn frontier() -> Plot {
        Plot { points: vec![(1.0, 0.2), (2.0, 0.05), (4.0, 0.0)], ..Default::default() }
    }

    #[test]
    fn power_grows_to_the_right_and_error_upwards() {
        let at = |applied| {
            let pixels = pixels(&Plot { applied: Some(applied), ..frontier() }, APPLIED);
            assert_eq!(pixels.len(), 9);
            pixels[4]
        };
        let [cheap, middle, best] = [(1.0, 0.2), (2.0, 0.05), (4.0, 0.0)].map(at);
        assert!(cheap.0 < middle.0 && middle.0 < best.0, "{cheap:?} {middle:?} {best:?}");
        assert!(cheap.1 < middle.1 && middle.1 < best.1, "{cheap:?} {middle:?} {best:?}");
        assert_eq!((cheap.0, best), (MARGIN, (WIDTH - 1 - MARGIN, HEIGHT - 1 - MARGIN)));
        // A quarter of the error is at half the height.
        assert!((2 * middle.1).abs_diff(cheap.1 + best.1) <= 1, "{middle:?}");
    }

    #[test]
    fn limits_are_lines_and_those_beyond_the_range_are_on_its_border() {
        let column = |limit| {
            let pixels = pixels(&Plot { power_limit: Some(limit), ..frontier() }, LIMIT);
            pixels.first().map(|pixel| pixel.0)
        };
        let (left, right) = (MARGIN, WIDTH - 1 - MARGIN);
        assert_eq!(
            [0.0, 1.0, 2.5, 4.0, f64::INFINITY, f64::NAN].map(column),
            [Some(left), Some(left), Some((left + right) / 2 + 1), Some(right), Some(right), None]
        );
        let row = |limit| {
            let pixels = pixels(&Plot { error_limit: Some(limit), ..frontier() }, LIMIT);
            pixels.first().map(|pixel| pixel.1)
        };
        let (top, bottom) = (MARGIN, HEIGHT - 1 - MARGIN);
        assert_eq!(
            [-1.0, 0.0, 0.2, f64::INFINITY, f64::NAN].map(row),
            [Some(bottom), Some(bottom), Some(top), Some(top), None]
        );
    }

    #[test]
    fn odd_numbers_draw_what_they_can() {
        let odd = [0.0, -1.0, 1e308, -1e308, f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        for power in odd {
            for error in odd {
                let cost = (power, error);
                for points in [vec![], vec![cost], vec![(1.0, 0.5), cost]] {
                    let plot = Plot {
                        points,
                        applied: Some(cost),
                        target: Some(cost),
                        power_limit: Some(power),
                        error_limit: Some(error),
                    };
                    let is_number = !power.is_nan() && !error.is_nan();
                    assert!(!is_number || !pixels(&plot, APPLIED).is_empty(), "{plot:?}");
                }
            }
        }
        assert!(pixels(&Plot::default(), POINT).is_empty());
        let single = Plot { points: vec![(3.0, 0.1)], ..Default::default() };
        assert_eq!(pixels(&single, POINT)[4].0, WIDTH / 2);
    }
}
