//! Plots as SVG.
//!
//! Text and axes are drawn in the colour of the page's own text, and the data in middle tones that
//! stand out from white as well as from near black (contrast 3 : 1 or more on both), so that one
//! drawing suits light and dark pages.

use frugal_core::frontier::Frontier;
use plotters::coord::Shift;
use plotters::coord::ranged1d::{IntoSegmentedCoord, SegmentValue};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use plotters::style::Color as _;

use super::ReportError;

/// Width and height of a plot, in its own pixels; pages scale it.
const SIZE: (u32, u32) = (560, 320);
const FONT: (&str, i32) = ("sans-serif", 17);

/// A colour of data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Color(pub u8, pub u8, pub u8);

impl Color {
    /// First choice.
    pub(crate) const BLUE: Self = Self(0x2f, 0x7d, 0xe1);
    /// Limits.
    pub(crate) const RED: Self = Self(0xd6, 0x45, 0x50);
    /// Background data.
    pub(crate) const GREY: Self = Self(0x80, 0x88, 0x90);
    /// Distinguishable, also with most red-green colour vision deficiencies.
    pub(crate) const SERIES: [Self; 6] = [
        Self::BLUE,
        Self(0xd9, 0x73, 0x0d),
        Self(0x2a, 0x9d, 0x8a),
        Self(0xb0, 0x5f, 0xc8),
        Self(0x93, 0x7a, 0x2c),
        Self(0xd4, 0x4c, 0x8a),
    ];

    /// As CSS writes it.
    pub(crate) fn css(self) -> String {
        format!("#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }

    fn rgb(self) -> RGBColor {
        RGBColor(self.0, self.1, self.2)
    }
}

/// A line through points.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// Its colour.
    pub color: Color,
    /// Line width, pixels.
    pub width: u32,
    /// x and y; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
}

/// One bar.
#[derive(Clone, Debug)]
pub(crate) struct Bar {
    /// Label.
    pub name: String,
    /// Its length, 0 or more.
    pub value: f64,
    /// Its colour.
    pub color: Color,
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'b, SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

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

/// Points, with those on the same pixel drawn once, and lines over them.
///
/// # Errors
/// When plotting fails.
pub(crate) fn cloud(
    label: &str,
    axes: [&str; 2],
    points: &[(f64, f64)],
    lines: &[Curve],
) -> Result<String, ReportError> {
    let all = || points.iter().chain(lines.iter().flat_map(|line| &line.points)).copied();
    let (xs, ys) = (range(all().map(|p| p.0), false), range(all().map(|p| p.1), true));
    draw(label, |area| {
        let mut chart =
            chart(area, 64).build_cartesian_2d(xs.0..xs.1, ys.0..ys.1).map_err(failed)?;
        mesh(&mut chart, axes)?;
        let pixel = |(x, y): (f64, f64)| {
            let coordinate = |value: f64, (low, high): (f64, f64), pixels: u32| {
                ((value - low) / (high - low) * f64::from(pixels)) as u32
            };
            (coordinate(x, xs, SIZE.0), coordinate(y, ys, SIZE.1))
        };
        let mut seen = std::collections::HashSet::new();
        let visible =
            points.iter().copied().filter(|&point| finite(point) && seen.insert(pixel(point)));
        let style = Color::GREY.rgb().mix(0.55).filled();
        chart.draw_series(visible.map(|point| Circle::new(point, 2, style))).map_err(failed)?;
        for line in lines {
            draw_curve(&mut chart, line)?;
            let marks = line.points.iter().copied().filter(|&point| finite(point));
            chart
                .draw_series(marks.map(|point| Circle::new(point, 1, line.color.rgb().filled())))
                .map_err(failed)?;
        }
        Ok(())
    })
}

/// Curves over one x axis, with a dashed line across where there is a `limit`.
///
/// # Errors
/// When plotting fails.
pub(crate) fn curves(
    label: &str,
    axes: [&str; 2],
    curves: &[Curve],
    limit: Option<f64>,
) -> Result<String, ReportError> {
    let all = || curves.iter().flat_map(|curve| &curve.points);
    let (xs, ys) = (range(all().map(|p| p.0), false), range(all().map(|p| p.1).chain(limit), true));
    draw(label, |area| {
        let mut chart =
            chart(area, 64).build_cartesian_2d(xs.0..xs.1, ys.0..ys.1).map_err(failed)?;
        mesh(&mut chart, axes)?;
        // The first curve is the most important: drawn last, on top.
        for curve in curves.iter().rev() {
            draw_curve(&mut chart, curve)?;
        }
        if let Some(limit) = limit.filter(|limit| limit.is_finite()) {
            let style = Color::RED.rgb().stroke_width(2);
            chart
                .draw_series(DashedLineSeries::new([(xs.0, limit), (xs.1, limit)], 7, 5, style))
                .map_err(failed)?;
        }
        Ok(())
    })
}

/// Horizontal bars from top to bottom, each with its value at its end.
///
/// # Errors
/// When plotting fails.
pub(crate) fn bars(
    label: &str,
    axis: &str,
    bars: &[Bar],
    decimals: usize,
) -> Result<String, ReportError> {
    let count = bars.len().max(1);
    let (low, high) = range(bars.iter().map(|bar| bar.value).chain([0.0]), true);
    // Room for the value at the end of the longest bar.
    let high = high + 0.14 * (high - low);
    let name = |row: &SegmentValue<usize>| match row {
        SegmentValue::CenterOf(row) => count
            .checked_sub(row + 1)
            .and_then(|bar| bars.get(bar))
            .map_or(String::new(), |bar| bar.name.clone()),
        _ => String::new(),
    };
    draw(label, |area| {
        // Both ends of the range are rows.
        let mut chart = chart(area, 196)
            .build_cartesian_2d(low..high, (0..count - 1).into_segmented())
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .axis_style(BLACK.mix(0.5))
            .label_style(FONT.into_font().color(&BLACK))
            .axis_desc_style(FONT.into_font().color(&BLACK))
            .x_labels(6)
            .y_labels(count)
            .x_desc(axis)
            .y_label_formatter(&name)
            .draw()
            .map_err(failed)?;
        for (index, bar) in bars.iter().enumerate().filter(|(_, bar)| bar.value.is_finite()) {
            let row = count - 1 - index;
            let above = if index == 0 { SegmentValue::Last } else { SegmentValue::Exact(row + 1) };
            let ends = [(0.0, SegmentValue::Exact(row)), (bar.value, above)];
            let mut body = Rectangle::new(ends, bar.color.rgb().filled());
            body.set_margin(6, 6, 0, 0);
            let middle = (bar.value, SegmentValue::CenterOf(row));
            let value = format!("{:.decimals$}", bar.value);
            let text = EmptyElement::at(middle)
                + Text::new(value, (6, -7), FONT.into_font().color(&BLACK));
            chart.draw_series([body]).map_err(failed)?;
            chart.draw_series([text]).map_err(failed)?;
        }
        Ok(())
    })
}

fn draw(
    label: &str,
    paint: impl FnOnce(&Area<'_>) -> Result<(), ReportError>,
) -> Result<String, ReportError> {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
    paint(&area)?;
    area.present().map_err(failed)?;
    drop(area);
    // Black stands for the page's text colour. Texts inside the drawing cannot contain the quotes
    // of the pattern.
    let svg = svg.replace("=\"#000000\"", "=\"currentColor\"").replacen(
        " xmlns=\"http://www.w3.org/2000/svg\"",
        "",
        1,
    );
    Ok(svg.replacen("<svg ", &format!("<svg role=\"img\" aria-label=\"{}\" ", escape(label)), 1))
}

fn chart<'a, 'b>(area: &'b Area<'a>, left: u32) -> ChartBuilder<'b, 'b, SVGBackend<'a>> {
    let mut builder = ChartBuilder::on(area);
    builder.margin(8).margin_right(18).x_label_area_size(46).y_label_area_size(left);
    builder
}

fn mesh(chart: &mut Chart<'_, '_>, [x, y]: [&str; 2]) -> Result<(), ReportError> {
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .axis_style(BLACK.mix(0.5))
        .label_style(FONT.into_font().color(&BLACK))
        .axis_desc_style(FONT.into_font().color(&BLACK))
        .x_labels(7)
        .y_labels(6)
        .x_desc(x)
        .y_desc(y)
        .draw()
        .map_err(failed)
}

fn draw_curve(chart: &mut Chart<'_, '_>, curve: &Curve) -> Result<(), ReportError> {
    let style = curve.color.rgb().stroke_width(curve.width);
    chart
        .draw_series(LineSeries::new(
            curve.points.iter().copied().filter(|&point| finite(point)),
            style,
        ))
        .map_err(failed)?;
    Ok(())
}

fn failed(error: impl std::fmt::Display) -> ReportError {
    ReportError::Plot(error.to_string())
}

fn finite((x, y): (f64, f64)) -> bool {
    x.is_finite() && y.is_finite()
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
        let line = Curve { color: Color::BLUE, width: 2, points: odd.to_vec() };
        let bar = |value| Bar { name: "<a & b>".into(), value, color: Color::GREY };
        let drawings = [
            cloud("cloud", ["x", "y"], &odd, &[]),
            cloud("cloud", ["x", "y"], &[], &[]),
            curves("curves", ["x", "y"], &[line], Some(0.7)),
            curves("curves", ["x", "y"], &[], None),
            bars("bars", "watts", &[bar(1.0), bar(f64::NAN), bar(0.0)], 2),
            bars("bars", "watts", &[], 2),
        ];
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
    fn points_on_one_pixel_are_drawn_once() {
        let points = vec![(1.0, 1.0); 10_000];
        let svg = cloud("cloud", ["x", "y"], &points, &[]).unwrap();
        assert_eq!(svg.matches("<circle").count(), 1);
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
