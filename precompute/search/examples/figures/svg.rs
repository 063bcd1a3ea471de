//! Drawings as SVG: shapes, axes, legends.
//!
//! Text and axes have the colour of the reader's scheme. Data have middle tones, which stand out from
//! white and from near black.

use std::fmt::Write as _;

/// Width of every drawing, in its own pixels.
pub(crate) const WIDTH: f64 = 760.0;

pub(crate) const BLUE: &str = "#2f7de1";
pub(crate) const ORANGE: &str = "#d9730d";
pub(crate) const GREEN: &str = "#2a9d8a";
pub(crate) const VIOLET: &str = "#b05fc8";
pub(crate) const OCHRE: &str = "#937a2c";
pub(crate) const RED: &str = "#d64550";
pub(crate) const GREY: &str = "#808890";

const STYLE: &str = "svg{color:#1f2328;font:13px system-ui,-apple-system,'Segoe UI',Roboto,sans-serif}\
text{fill:currentColor}.s{font-size:11px}.b{font-weight:600}.m{text-anchor:middle}.e{text-anchor:end}\
.g{stroke:currentColor;stroke-opacity:.14}.a{stroke:currentColor;stroke-opacity:.55}\
@media(prefers-color-scheme:dark){svg{color:#e6edf3}}";

/// A drawing.
pub(crate) struct Svg {
    label: String,
    height: f64,
    body: String,
}

type Point = (f64, f64);

impl Svg {
    /// An empty drawing, which `label` describes to those who do not see it.
    pub(crate) fn new(label: &str, height: f64) -> Self {
        Self { label: label.to_owned(), height, body: String::new() }
    }

    fn add(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = writeln!(self.body, "{element}");
    }

    /// Text, whose classes say how large, how bold, and where it is anchored.
    pub(crate) fn text(&mut self, (x, y): Point, classes: &str, text: &str) {
        self.add(format_args!(
            r#"<text x="{x:.1}" y="{y:.1}" class="{classes}">{}</text>"#,
            escape(text)
        ));
    }

    /// Text from bottom to top.
    pub(crate) fn rising(&mut self, (x, y): Point, text: &str) {
        self.add(format_args!(
            r#"<text transform="translate({x:.1},{y:.1}) rotate(-90)" class="m">{}</text>"#,
            escape(text)
        ));
    }

    /// A line of the grid (`g`) or of an axis (`a`).
    pub(crate) fn rule(&mut self, from: Point, to: Point, class: &str) {
        self.add(format_args!(
            r#"<line x1="{:.1}" y1="{:.1}" x2="{:.1}" y2="{:.1}" class="{class}"/>"#,
            from.0, from.1, to.0, to.1
        ));
    }

    /// A line of data.
    pub(crate) fn path(&mut self, points: &[Point], color: &str, width: f64, dashed: bool) {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        let dash = if dashed { r#" stroke-dasharray="5 4""# } else { "" };
        self.add(format_args!(
            r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="{width}"{dash}/>"#,
            points.join(" ")
        ));
    }

    /// A mark of data.
    pub(crate) fn mark(&mut self, (x, y): Point, mark: Mark, color: &str) {
        match mark {
            Mark::Disc(r) => self.add(format_args!(
                r#"<circle cx="{x:.1}" cy="{y:.1}" r="{r}" fill="{color}"/>"#
            )),
            Mark::Ring(r) => self.add(format_args!(
                r#"<circle cx="{x:.1}" cy="{y:.1}" r="{r}" fill="none" stroke="{color}" stroke-width="1.6"/>"#
            )),
            Mark::Square(r) => self.bar((x - r, y - r), (x + r, y + r), color, 1.0),
            Mark::Diamond(r) => self.add(format_args!(
                r#"<path d="M{:.1},{y:.1}L{x:.1},{:.1}L{:.1},{y:.1}L{x:.1},{:.1}Z" fill="{color}"/>"#,
                x - r,
                y - r,
                x + r,
                y + r
            )),
        }
    }

    /// A filled rectangle between two corners.
    pub(crate) fn bar(&mut self, from: Point, to: Point, color: &str, opacity: f64) {
        let (x, y) = (from.0.min(to.0), from.1.min(to.1));
        let (w, h) = ((from.0 - to.0).abs(), (from.1 - to.1).abs());
        self.add(format_args!(
            r#"<rect x="{x:.1}" y="{y:.1}" width="{w:.1}" height="{h:.1}" fill="{color}" fill-opacity="{opacity}"/>"#
        ));
    }

    /// Marks and their meanings in a row from `at`.
    pub(crate) fn legend(&mut self, at: Point, entries: &[(Mark, &str, &str)]) {
        let mut x = at.0;
        for (mark, color, name) in entries {
            self.mark((x, at.1 - 4.5), *mark, color);
            self.text((x + 10.0, at.1), "", name);
            // Widths of glyphs are the reader's: wide ones have room.
            x += 40.0 + 7.4 * name.chars().count() as f64;
        }
    }

    /// The file.
    pub(crate) fn finish(self) -> String {
        let (label, height, body) = (escape(&self.label), self.height, self.body);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
             role=\"img\" aria-label=\"{label}\">\n<style>{STYLE}</style>\n{body}</svg>\n"
        )
    }
}

/// Shape and half the size of a mark.
#[derive(Clone, Copy)]
pub(crate) enum Mark {
    Disc(f64),
    Ring(f64),
    Square(f64),
    Diamond(f64),
}

/// Where values lie on the drawing.
#[derive(Clone, Copy)]
pub(crate) struct Axis {
    values: (f64, f64),
    pixels: (f64, f64),
    logarithmic: bool,
}

impl Axis {
    pub(crate) fn linear(values: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { values, pixels, logarithmic: false }
    }

    pub(crate) fn logarithmic(values: (f64, f64), pixels: (f64, f64)) -> Self {
        Self { values, pixels, logarithmic: true }
    }

    pub(crate) fn at(&self, value: f64) -> f64 {
        let scale = |value: f64| if self.logarithmic { value.ln() } else { value };
        let (low, high) = (scale(self.values.0), scale(self.values.1));
        self.pixels.0 + (scale(value) - low) / (high - low) * (self.pixels.1 - self.pixels.0)
    }
}

/// Two axes with ticks.
pub(crate) struct Panel {
    pub(crate) x: Axis,
    pub(crate) y: Axis,
}

impl Panel {
    pub(crate) fn at(&self, x: f64, y: f64) -> Point {
        (self.x.at(x), self.y.at(y))
    }

    /// Grid, tick labels and a title above.
    pub(crate) fn frame(&self, svg: &mut Svg, title: &str, xs: &[(f64, &str)], ys: &[(f64, &str)]) {
        let ((left, right), (bottom, top)) = (self.x.pixels, self.y.pixels);
        svg.text((left, top - 8.0), "b", title);
        for (value, name) in xs {
            let x = self.x.at(*value);
            svg.rule((x, top), (x, bottom), "g");
            svg.text((x, bottom + 15.0), "s m", name);
        }
        for (value, name) in ys {
            let y = self.y.at(*value);
            svg.rule((left, y), (right, y), "g");
            svg.text((left - 6.0, y + 4.0), "s e", name);
        }
        svg.rule((left, bottom), (right, bottom), "a");
    }

    pub(crate) fn line(
        &self,
        svg: &mut Svg,
        points: &[Point],
        color: &str,
        width: f64,
        dashed: bool,
    ) {
        let points: Vec<Point> = points.iter().map(|(x, y)| self.at(*x, *y)).collect();
        svg.path(&points, color, width, dashed);
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
