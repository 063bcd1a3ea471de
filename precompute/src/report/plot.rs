//! Plots as SVG.
//!
//! Text and axes are drawn in the colour of the page's own text, and the data in middle tones that
//! stand out from white as well as from near black (contrast 3 : 1 or more on both), so that one
//! drawing suits light and dark pages.

use std::ops::Range;

use frugal_core::frontier::Frontier;
use plotters::coord::Shift;
use plotters::coord::combinators::BindKeyPoints;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Width and height of a plot, in its own pixels; pages scale it.
const SIZE: (u32, u32) = (560, 320);
const FONT: (&str, i32) = ("sans-serif", 17);
/// Of names beside points.
const SMALL: (&str, i32) = ("sans-serif", 14);
/// Room for such a name, pixels.
const NAME_WIDTH: i32 = 130;
const NAME_HEIGHT: i32 = 15;
/// Length of the longest logarithmic axis.
const MOST_DECADES: f64 = 5.0;

/// First choice.
pub(crate) const BLUE: RGBColor = RGBColor(0x2f, 0x7d, 0xe1);
/// Limits.
pub(crate) const RED: RGBColor = RGBColor(0xd6, 0x45, 0x50);
/// Background data.
pub(crate) const GREY: RGBColor = RGBColor(0x80, 0x88, 0x90);
/// Distinguishable, also with most red-green colour vision deficiencies.
pub(crate) const SERIES: [RGBColor; 4] =
    [BLUE, RGBColor(0xd9, 0x73, 0x0d), RGBColor(0x2a, 0x9d, 0x8a), RGBColor(0xb0, 0x5f, 0xc8)];

/// What an axis shows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis<'a> {
    /// Quantity and unit.
    pub name: &'a str,
    /// Whether it is logarithmic. Values of 0 and less are drawn at its lower end.
    pub is_log: bool,
    /// Whether it begins at 0, if it is not logarithmic.
    pub from_zero: bool,
}

impl<'a> Axis<'a> {
    /// Error of images.
    pub(crate) const ERROR: Axis<'static> = Axis::logarithmic("error, 1 − SSIM");
    /// Power of settings, which often differ by orders of magnitude.
    pub(crate) const POWER: Axis<'static> = Axis::logarithmic("power, W");
    /// Time of a path or of an app.
    pub(crate) const TIME: Axis<'static> = Axis::along("time, s");

    /// An axis in equal factors.
    pub(crate) const fn logarithmic(name: &'a str) -> Self {
        Self { name, is_log: true, from_zero: false }
    }

    /// An axis in equal steps, from 0.
    pub(crate) const fn linear(name: &'a str) -> Self {
        Self { name, is_log: false, from_zero: true }
    }

    /// An axis in equal steps, around its values alone.
    pub(crate) const fn along(name: &'a str) -> Self {
        Self { name, is_log: false, from_zero: false }
    }
}

/// A line through points.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Its colour.
    pub color: RGBColor,
    /// Line width, pixels.
    pub width: u32,
    /// x and y; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// A point with its name beside it.
#[derive(Clone, Debug)]
pub(crate) struct Mark {
    /// Name.
    pub name: String,
    /// x and y.
    pub at: (f64, f64),
    /// Its colour.
    pub color: RGBColor,
}

/// Curves and named marks over two axes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Plot<'a> {
    /// For readers who do not see it.
    pub label: &'a str,
    /// Drawn from the last to the first: the first is on top.
    pub curves: &'a [Curve],
    /// On top of all.
    pub marks: &'a [Mark],
    /// y of a dashed line across.
    pub limit: Option<f64>,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A frontier as a step function, power against error: no settings below or left of it were found.
pub(crate) fn staircase(frontier: &Frontier) -> Vec<(f64, f64)> {
    let mut corners = Vec::new();
    for point in frontier.points() {
        if let Some(&(_, error)) = corners.last() {
            corners.push((point.cost.power.0, error));
        }
        corners.push((point.cost.power.0, point.cost.error));
    }
    corners
}

impl Plot<'_> {
    /// Draws it.
    ///
    /// # Errors
    /// When plotting fails.
    pub(crate) fn svg(&self, axes: [Axis<'_>; 2]) -> Result<String, String> {
        let all = || {
            let curves = self.curves.iter().flat_map(|curve| &curve.points);
            curves.copied().chain(self.marks.iter().map(|mark| mark.at))
        };
        let limit = self.limit.filter(|limit| limit.is_finite());
        let xs = axis_range(all().map(|point| point.0), axes[0]);
        let ys = axis_range(all().map(|point| point.1).chain(limit), axes[1]);
        let (x_range, y_range) = (xs.0..xs.1, ys.0..ys.1);
        let log = |range: &Range<f64>| range.clone().log_scale().with_key_points(ticks(range));
        let mut svg = String::new();
        let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
        match axes.map(|axis| axis.is_log) {
            [false, false] => self.paint(&area, axes, x_range, y_range),
            [false, true] => self.paint(&area, axes, x_range, log(&y_range)),
            [true, false] => self.paint(&area, axes, log(&x_range), y_range),
            [true, true] => self.paint(&area, axes, log(&x_range), log(&y_range)),
        }?;
        area.present().map_err(failed)?;
        drop(area);
        // Black stands for the page's text colour. Texts inside the drawing cannot contain the quotes
        // of the pattern.
        let svg = svg.replace("=\"#000000\"", "=\"currentColor\"");
        let svg = svg.replacen(" xmlns=\"http://www.w3.org/2000/svg\"", "", 1);
        let label = escape(self.label);
        Ok(svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{label}\" "), 1))
    }

    fn paint<X, Y>(
        &self,
        area: &Area<'_>,
        [x, y]: [Axis<'_>; 2],
        xs: X,
        ys: Y,
    ) -> Result<(), String>
    where
        X: AsRangedCoord<Value = f64, CoordDescType: ValueFormatter<f64>>,
        Y: AsRangedCoord<Value = f64, CoordDescType: ValueFormatter<f64>>,
    {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .margin_right(18)
            .x_label_area_size(46)
            .y_label_area_size(72)
            .build_cartesian_2d(xs, ys)
            .map_err(failed)?;
        let text = || FONT.into_font().color(&BLACK);
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .axis_style(BLACK.mix(0.5))
            .label_style(text())
            .axis_desc_style(text())
            .x_labels(7)
            .y_labels(6)
            .x_label_formatter(&|value| short(*value))
            .y_label_formatter(&|value| short(*value))
            .x_desc(x.name)
            .y_desc(y.name)
            .draw()
            .map_err(failed)?;
        let ends = (chart.x_range(), chart.y_range());
        let visible = |&(x, y): &(f64, f64)| {
            let inside = (x.max(ends.0.start), y.max(ends.1.start));
            (x.is_finite() && y.is_finite()).then_some(inside)
        };
        for curve in self.curves.iter().rev() {
            let style = curve.color.stroke_width(curve.width);
            let points = curve.points.iter().filter_map(visible);
            chart.draw_series(LineSeries::new(points, style)).map_err(failed)?;
        }
        if let Some(limit) = self.limit.filter(|limit| limit.is_finite()) {
            let style = RED.stroke_width(2);
            let ends = [ends.0.start, ends.0.end].map(|x| (x, limit.max(ends.1.start)));
            chart.draw_series(DashedLineSeries::new(ends, 7, 5, style)).map_err(failed)?;
        }
        // Names keep a line's distance from those above them.
        let mut marks: Vec<(&Mark, (f64, f64))> =
            self.marks.iter().filter_map(|mark| Some((mark, visible(&mark.at)?))).collect();
        marks.sort_by(|a, b| b.1.1.total_cmp(&a.1.1));
        let mut taken: Vec<(i32, i32)> = Vec::new();
        for (mark, at) in marks {
            let (left, mut top) = chart.backend_coord(&at);
            let own = top;
            // Near the right end a name stands before its point.
            let is_left = left > SIZE.0 as i32 - NAME_WIDTH;
            let column = if is_left { left - NAME_WIDTH } else { left };
            taken.sort_by_key(|place| place.1);
            for &(x, y) in &taken {
                if (x - column).abs() < NAME_WIDTH && (y - top).abs() < NAME_HEIGHT {
                    top = y + NAME_HEIGHT;
                }
            }
            taken.push((column, top));
            let anchor = if is_left { HPos::Right } else { HPos::Left };
            let style = SMALL.into_font().color(&BLACK).pos(Pos::new(anchor, VPos::Center));
            let aside = if is_left { -9 } else { 9 };
            let element = EmptyElement::at(at)
                + Circle::new((0, 0), 5, mark.color.filled())
                + Text::new(mark.name.clone(), (aside, top - own), style);
            chart.draw_series([element]).map_err(failed)?;
        }
        Ok(())
    }
}

/// The range of an axis.
fn axis_range(values: impl Iterator<Item = f64>, axis: Axis<'_>) -> (f64, f64) {
    if !axis.is_log {
        return range(values, axis.from_zero);
    }
    let (low, high) = range(values.filter(|value| *value > 0.0).map(f64::log10), false);
    // A map may hold an error of 1e-12 beside one of 0.1.
    (10f64.powf(low.max(high - MOST_DECADES)), 10f64.powf(high))
}

/// 1, 2 and 5 of each power of ten, or the powers alone where there are many.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let steps: &[f64] =
        if (range.end / range.start).log10() > 2.0 { &[1.0] } else { &[1.0, 2.0, 5.0] };
    let all = decades.flat_map(|decade| steps.iter().map(move |step| step * 10f64.powi(decade)));
    all.filter(|tick| range.contains(tick)).collect()
}

/// A number of an axis, without digits that are rounding.
fn short(value: f64) -> String {
    format!("{}", format!("{value:.3e}").parse::<f64>().unwrap_or(value))
}

fn failed(error: impl std::fmt::Display) -> String {
    format!("a plot could not be drawn: {error}")
}

/// A range of all finite values with a margin, never empty; from 0 if `from_zero`.
fn range(values: impl Iterator<Item = f64>, from_zero: bool) -> (f64, f64) {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
    if low > high {
        return (0.0, 1.0);
    }
    let low = if from_zero { low.min(0.0) } else { low };
    // For a single value, half of it to each side; for 0, an arbitrary range.
    let size = if high > low { high - low } else { high.abs().max(1e-3) };
    let room = 0.06 * size;
    if high > low {
        (if from_zero { low } else { low - room }, high + room)
    } else {
        (low - 0.5 * size, high + 0.5 * size)
    }
}

/// `text` as HTML text or as the value of a quoted attribute.
pub(crate) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            // Not allowed in HTML, not even escaped.
            '\0'..='\u{8}' | '\u{b}' | '\u{c}' | '\u{e}'..='\u{1f}' => escaped.push('\u{fffd}'),
            _ => escaped.push(character),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use frugal_core::frontier::{CostPoint, FrontierPoint};
    use frugal_core::knobs::KnobLevels;

    use super::*;

    #[test]
    fn a_range_is_never_empty_whatever_it_is_made_of() {
        let lists: [&[f64]; 7] = [
            &[],
            &[f64::NAN],
            &[0.0],
            &[5.0, 5.0],
            &[-1.0, 1.0],
            &[f64::INFINITY, 2.0],
            &[1e-12, 2e-12],
        ];
        for values in lists {
            for from_zero in [false, true] {
                let (low, high) = range(values.iter().copied(), from_zero);
                assert!(low < high && low.is_finite() && high.is_finite(), "{values:?}");
                assert!(
                    values
                        .iter()
                        .filter(|value| value.is_finite())
                        .all(|value| (low..=high).contains(value)),
                    "{values:?}"
                );
            }
        }
        assert_eq!(range([2.0, 4.0].into_iter(), true).0, 0.0);
    }

    #[test]
    fn plots_are_complete_use_the_page_s_colour_and_leave_out_invalid_values() {
        let odd = [(f64::NAN, 1.0), (1.0, f64::INFINITY), (1.0, 1.0), (1.0, 1.0), (2.0, 0.5)];
        let curves = [Curve { color: BLUE, width: 2, points: odd.to_vec() }];
        let mark = |at| Mark { name: "<a & b>".into(), at, color: GREY };
        let marks = [odd[0], (0.0, 0.0), (2.0, 1.0), (-1.0, 1e300)].map(mark);
        let plain = Plot { label: "plot", ..Plot::default() };
        let full = Plot { curves: &curves, marks: &marks, limit: Some(0.7), ..plain };
        let wild = Plot { limit: Some(f64::NAN), ..full };
        let linear = Axis::linear("x");
        let mut drawings = Vec::new();
        for axes in
            [[linear; 2], [linear, Axis::ERROR], [Axis::POWER, linear], [Axis::POWER, Axis::ERROR]]
        {
            drawings.extend([plain, full, wild].map(|plot| plot.svg(axes)));
        }
        for drawing in drawings {
            let svg = drawing.unwrap();
            assert!(
                svg.starts_with("<svg role=\"img\" aria-label=\"")
                    && svg.trim_end().ends_with("</svg>")
            );
            assert!(svg.contains("currentColor") && !svg.contains("#000000"));
            assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("<a & b>"));
        }
    }

    #[test]
    fn a_logarithmic_axis_has_round_numbers_and_room_for_zero() {
        let points = vec![(1.0, 0.0), (2.0, 1e-12), (3.0, 0.1)];
        let curves = [Curve { color: BLUE, width: 2, points }];
        let plot = Plot { label: "errors", curves: &curves, ..Plot::default() };
        let svg = plot.svg([Axis::TIME, Axis::ERROR]).unwrap();
        assert!(svg.contains("\n0.1\n") && svg.contains("\n0.00001\n"), "{svg}");
        assert!(!svg.contains("0.0000000"), "five decades at most: {svg}");
        assert_eq!(short(0.1 + 0.2), "0.3");
        assert_eq!(ticks(&(0.9..30.0)), [1.0, 2.0, 5.0, 10.0, 20.0]);
    }

    #[test]
    fn a_staircase_goes_right_before_it_goes_down() {
        let point = |power, error| FrontierPoint {
            settings: KnobLevels::default(),
            cost: CostPoint::new(power, error),
        };
        let frontier = Frontier::from_points([point(1.0, 0.5), point(2.0, 0.3), point(4.0, 0.0)]);
        assert_eq!(
            staircase(&frontier),
            [(1.0, 0.5), (2.0, 0.5), (2.0, 0.3), (4.0, 0.3), (4.0, 0.0)]
        );
        assert!(staircase(&Frontier::default()).is_empty());
    }
}
