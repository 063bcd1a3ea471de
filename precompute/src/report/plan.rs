//! Plans: a scene from above, X to the right and Z down, true to scale.

use std::fmt::Write as _;

use glam::Vec3;

use super::{Color, escape};

/// A plan under construction. Positions are in world space, metres; their height is ignored.
pub(super) struct Plan {
    svg: String,
    low: [f64; 2],
    /// Pixels per metre.
    scale: f64,
}

impl Plan {
    /// Longer side of the drawn area, pixels.
    const EDGE: f64 = 440.0;
    /// Space around it for what lies on the border, pixels.
    const MARGIN: f64 = 12.0;

    /// A plan of the box between two corners, with its outline; `label` is for readers who do not see it. A box
    /// without extent, or with a corner that is not finite, is drawn as a point.
    pub(super) fn new(label: &str, low: impl Into<Vec3>, high: impl Into<Vec3>) -> Self {
        let [low, high] = [low.into(), high.into()].map(from_above);
        let size = [high[0] - low[0], high[1] - low[1]];
        let longer = size[0].max(size[1]);
        let scale = if longer > 0.0 && longer.is_finite() { Self::EDGE / longer } else { 0.0 };
        let drawn = size.map(|size| if scale > 0.0 { size.max(0.0) * scale } else { 0.0 });
        let [width, height] = drawn.map(|size| size + 2.0 * Self::MARGIN);
        let (label, margin, [across, down]) = (escape(label), Self::MARGIN, drawn);
        let svg = format!(
            "<svg role=\"img\" aria-label=\"{label}\" viewBox=\"0 0 {width:.1} {height:.1}\" style=\"max-width:{width:.0}px\">\n\
             <rect x=\"{margin:.1}\" y=\"{margin:.1}\" width=\"{across:.1}\" height=\"{down:.1}\" fill=\"none\" stroke=\"currentColor\" opacity=\"0.35\"/>\n"
        );
        Self { svg, low, scale }
    }

    fn at(&self, position: Vec3) -> [f64; 2] {
        let [x, z] = from_above(position);
        let along =
            |at: f64, low: f64| if self.scale > 0.0 { (at - low) * self.scale } else { 0.0 };
        [along(x, self.low[0]), along(z, self.low[1])].map(|pixels| Self::MARGIN + pixels)
    }

    /// A circle.
    pub(super) fn ring(&mut self, position: Vec3) {
        let [x, y] = self.at(position);
        let _ = writeln!(
            self.svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"none\" stroke=\"currentColor\" opacity=\"0.6\"/>"
        );
    }

    /// A wedge that points along `forward`.
    pub(super) fn wedge(&mut self, position: Vec3, forward: Vec3) {
        let [x, y] = self.at(position);
        let angle = f64::from(forward.z).atan2(f64::from(forward.x));
        let corners = [(0.0, 9.0), (2.5, 5.0), (-2.5, 5.0)].map(|(turn, length): (f64, f64)| {
            let (sin, cos) = (angle + turn).sin_cos();
            format!("{:.1} {:.1}", x + length * cos, y + length * sin)
        });
        let (corners, color) = (corners.join("L"), Color::BLUE.css());
        let _ = writeln!(self.svg, "<path d=\"M{corners}Z\" fill=\"{color}\"/>");
    }

    /// The SVG.
    pub(super) fn finish(mut self) -> String {
        self.svg.push_str("</svg>");
        self.svg
    }
}

fn from_above(position: Vec3) -> [f64; 2] {
    [f64::from(position.x), f64::from(position.z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_true_to_scale() {
        let (low, high) = (Vec3::new(-8.0, 0.5, -4.0), Vec3::new(8.0, 6.0, 4.0));
        let mut plan = Plan::new("a <plan>", low, high);
        plan.ring(high);
        plan.wedge(Vec3::ZERO, Vec3::X);
        let svg = plan.finish();
        for part in [
            "aria-label=\"a &lt;plan&gt;\"",
            "viewBox=\"0 0 464.0 244.0\"",
            "x=\"12.0\" y=\"12.0\" width=\"440.0\" height=\"220.0\"",
            "cx=\"452.0\" cy=\"232.0\"",
            "d=\"M241.0 122.0L228.0 125.0L228.0 119.0Z\"",
        ] {
            assert!(svg.contains(part), "{part} in {svg}");
        }
    }

    #[test]
    fn a_box_without_extent_is_a_point() {
        for (low, high) in [(0.0, 0.0), (1.0, -1.0), (0.0, f32::INFINITY)] {
            let mut plan = Plan::new("", Vec3::splat(low), Vec3::splat(high));
            plan.ring(Vec3::splat(low));
            let svg = plan.finish();
            assert!(
                svg.contains("viewBox=\"0 0 24.0 24.0\"") && svg.contains("cx=\"12.0\""),
                "{svg}"
            );
        }
    }
}
