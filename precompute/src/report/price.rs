//! `frugal price`: cost of levels and their error against the path-traced reference, as a table, a
//! page and a plot.

use std::io;

use bevy_frugal_gi::power::MeterInfo;
use frugal_trace::metrics::Difference;

use super::{Color, Curve, Report, ReportError, Section, cloud};

/// One level of a knob, the others at their best.
#[derive(Clone, Debug)]
pub(crate) struct LevelPrice {
    /// The knob.
    pub knob: String,
    /// The level.
    pub label: String,
    /// Power that the global illumination adds to the frame, watts.
    pub power_w: f64,
    /// The same as a share of the power at its best.
    pub cost_share: f64,
    /// Difference of indirect radiance from path tracing.
    pub difference: Difference,
}

/// Prices at one view.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PriceSummary<'a> {
    /// The scene's name.
    pub scene: &'a str,
    /// Width and height of the image, pixels.
    pub size: [u32; 2],
    /// Levels, knob by knob, the best first.
    pub prices: &'a [LevelPrice],
    /// Description of the reference light.
    pub reference: &'a str,
    /// The power meter.
    pub meter: &'a MeterInfo,
    /// Power that the global illumination adds at its best, watts.
    pub best_w: f64,
}

/// The page.
///
/// # Errors
/// When the plot cannot be drawn.
pub(crate) fn price_report(summary: &PriceSummary) -> Result<String, ReportError> {
    let mut section = Section::new(&format!("{}: cost and error of each level", summary.scene));
    section.facts(&[
        ("Image size".to_owned(), format!("{} × {} pixels", summary.size[0], summary.size[1])),
        ("Global illumination at its best".to_owned(), format!("{:.3} W", summary.best_w)),
        ("Reference".to_owned(), summary.reference.to_owned()),
        ("Meter".to_owned(), summary.meter.description.clone()),
    ]);
    section.paragraph(
        "One knob lowered at a time, the others at their best. Cost is the power that the global illumination adds to a frame, as a share of that at its best; error is the mean absolute \
         difference of radiance from the path-traced reference, over squares of 4 × 4 pixels, as a share of the mean.",
    );
    let mut lines: Vec<(&str, Curve)> = Vec::new();
    for price in summary.prices {
        let point = (price.cost_share, price.difference.relative_l1_boxes);
        match lines.last_mut() {
            Some((knob, line)) if *knob == price.knob => line.points.push(point),
            _ => {
                let color = Color::SERIES[lines.len() % Color::SERIES.len()];
                lines.push((&price.knob, Curve { color, width: 2, points: vec![point] }));
            }
        }
    }
    section.legend(lines.iter().map(|(knob, line)| (*knob, line.color)));
    let curves: Vec<Curve> = lines.iter().map(|(_, line)| line.clone()).collect();
    let svg = cloud(
        "Cost and error of each level",
        ["cost, share of the best", "relative L1 of 4 × 4 means"],
        &[],
        &curves,
    )?;
    section.plots(&[("Cost and error, a line for each knob", svg)]);
    let headers = ["knob", "level", "cost", "mean ratio", "relative L1", "of 4 × 4 means"];
    let rows: Vec<Vec<String>> = summary.prices.iter().map(row).collect();
    section.table("Each level, the best first", &headers, &rows);
    let mut report = Report::new(&format!("Prices: {}", summary.scene));
    report.section(section);
    Ok(report.render())
}

fn row(price: &LevelPrice) -> Vec<String> {
    let Difference { mean_ratio, relative_l1, relative_l1_boxes, .. } = price.difference;
    vec![
        price.knob.clone(),
        price.label.clone(),
        format!("{:.1} %", 100.0 * price.cost_share),
        format!("{mean_ratio:.3}"),
        format!("{relative_l1:.3}"),
        format!("{relative_l1_boxes:.3}"),
    ]
}

/// Writes a row for every level.
///
/// # Errors
/// When `to` cannot be written.
pub(crate) fn price_csv(prices: &[LevelPrice], to: impl io::Write) -> Result<(), csv::Error> {
    let mut writer = csv::Writer::from_writer(to);
    writer.write_record([
        "knob",
        "level",
        "power_w",
        "cost_share",
        "mean_ratio",
        "relative_l1",
        "relative_l1_4x4",
        "one_minus_ssim",
    ])?;
    for price in prices {
        let Difference { mean_ratio, relative_l1, relative_l1_boxes, one_minus_ssim, .. } =
            price.difference;
        let numbers = [
            price.power_w,
            price.cost_share,
            mean_ratio,
            relative_l1,
            relative_l1_boxes,
            one_minus_ssim,
        ];
        writer.write_record(
            [price.knob.clone(), price.label.clone()]
                .into_iter()
                .chain(numbers.map(|number| number.to_string())),
        )?;
    }
    writer.flush()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn price(knob: &str, label: &str, cost_share: f64) -> LevelPrice {
        let difference = Difference {
            mean_ratio: 0.99,
            relative_l1: 0.2,
            relative_l1_boxes: 0.1 / cost_share,
            one_minus_ssim: 0.01,
            exposure_ev100: 10.0,
        };
        LevelPrice {
            knob: knob.into(),
            label: label.into(),
            power_w: 4.0 * cost_share,
            cost_share,
            difference,
        }
    }

    #[test]
    fn a_line_for_each_knob_and_a_row_for_each_level() {
        let prices = [
            price("gi_vpl_count", "4096", 1.0),
            price("gi_vpl_count", "64", 0.2),
            price("gi_visibility", "fine", 1.0),
        ];
        let meter = crate::evaluate::fake::meter();
        let html = price_report(&PriceSummary {
            scene: "court",
            size: [320, 180],
            prices: &prices,
            reference: "one bounce",
            meter: &meter,
            best_w: 4.0,
        })
        .unwrap();
        assert!(
            html.contains("<svg ") && html.contains("20.0 %") && html.contains("gi_visibility")
        );
        let mut bytes = Vec::new();
        price_csv(&prices, &mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(text.lines().count(), 4);
        assert!(
            text.lines()
                .nth(2)
                .is_some_and(|line| line.starts_with("gi_vpl_count,64,0.8,0.2,0.99,0.2,0.5,")),
            "{text}"
        );
    }
}
