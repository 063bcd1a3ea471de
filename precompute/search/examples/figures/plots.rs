//! The drawings of the documents, one function each.

use crate::data::{Data, LevelRow, Played, PowerRow};
use crate::summary::{BASELINES, Spread, baseline_ratios, paths};
use crate::svg::{Axis, BLUE, GREEN, GREY, Mark, OCHRE, ORANGE, Panel, RED, Svg, VIOLET, WIDTH};

/// Name and text of every drawing.
pub(crate) fn all(data: &Data) -> Vec<(&'static str, String)> {
    vec![
        ("error-at-equal-power", error_at_equal_power(data)),
        ("error-ratios", error_ratios(data)),
        ("metered-power", metered_power(data)),
        ("knobs", knobs(data)),
        ("levels-against-reference", levels(data)),
        ("naive-rsm", naive_rsm(data)),
        ("stability", stability(data)),
        ("lights", lights(data)),
    ]
}

/// The ticks of `candidates` between two values.
fn ticks<'a>(candidates: &[(f64, &'a str)], (low, high): (f64, f64)) -> Vec<(f64, &'a str)> {
    candidates.iter().copied().filter(|(value, _)| (low..=high).contains(value)).collect()
}

/// Least and greatest of `values`.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    })
}

fn error_at_equal_power(data: &Data) -> String {
    type Of = fn(&PowerRow) -> Played;
    let series: [(&str, &str, Of, Mark, f64, bool); 4] = [
        ("oracle, knows the path", GREY, |row| row.oracle, Mark::Disc(0.0), 2.0, true),
        ("two constants in turns", GREEN, |row| row.turns, Mark::Diamond(4.0), 1.5, false),
        ("trained constant", ORANGE, |row| row.trained, Mark::Square(3.2), 0.0, false),
        ("frugal", BLUE, |row| row.frugal, Mark::Disc(3.6), 2.5, false),
    ];
    let rows = &data.policies.power_budgets;
    let (low, high) = range(rows.iter().flat_map(|row| series.iter().map(|it| it.2(row).error)));
    let errors = (0.85 * low, 1.3 * high);
    let mut svg = Svg::new(
        "Mean error against mean power on each path: the controller, the trained constant, two constants in \
         turns, and an oracle.",
        548.0,
    );
    let mut entries: Vec<_> = series.iter().rev().map(|it| (it.3, it.1, it.0)).collect();
    entries[3].0 = Mark::Square(2.0);
    svg.legend((60.0, 22.0), &entries);
    let at = |row: &PowerRow, played: Played| {
        let [low, high] = row.range_w;
        (100.0 * (played.w - low) / (high - low), played.error)
    };
    let paths = paths(data);
    // Two rows; columns share the width.
    let (margin, gap) = (56.0, 18.0);
    let pitch = (WIDTH - margin + 4.0) / paths.len().div_ceil(2) as f64;
    for (index, (scene, path)) in paths.into_iter().enumerate() {
        let (left, top) = (margin + pitch * (index / 2) as f64, 66.0 + 236.0 * (index % 2) as f64);
        let panel = Panel {
            x: Axis::linear((-4.0, 96.0), (left, left + pitch - gap)),
            y: Axis::logarithmic(errors, (top + 186.0, top)),
        };
        let xs = [(10.0, "10"), (30.0, "30"), (50.0, "50"), (70.0, "70"), (90.0, "90")];
        let ys = [
            (0.001, "0.001"),
            (0.002, "0.002"),
            (0.005, "0.005"),
            (0.01, "0.01"),
            (0.02, "0.02"),
            (0.05, "0.05"),
            (0.1, "0.1"),
            (0.2, "0.2"),
            (0.5, "0.5"),
        ];
        let ys = if index < 2 { ticks(&ys, errors) } else { unnamed(&ticks(&ys, errors)) };
        panel.frame(&mut svg, &format!("{scene}, {path}"), &xs, &ys);
        for (_, color, of, mark, width, dashed) in series {
            let here = rows.iter().filter(|row| row.scene == scene && row.path == path);
            let points: Vec<_> = here.map(|row| at(row, of(row))).collect();
            if width > 0.0 {
                panel.line(&mut svg, &points, color, width, dashed);
            }
            for (x, y) in points {
                svg.mark(panel.at(x, y), mark, color);
            }
        }
    }
    svg.text(
        (WIDTH / 2.0, 536.0),
        "m",
        "mean power, % of the range from the cheapest to the best settings",
    );
    svg.rising((12.0, 277.0), "mean error, 1 − SSIM");
    svg.finish()
}

/// Ticks without their names.
fn unnamed<'a>(ticks: &[(f64, &'a str)]) -> Vec<(f64, &'a str)> {
    ticks.iter().map(|(value, _)| (*value, "")).collect()
}

fn error_ratios(data: &Data) -> String {
    let colors = [ORANGE, VIOLET, GREEN, OCHRE];
    let paths = paths(data);
    let spreads: Vec<Vec<Spread>> = paths
        .iter()
        .map(|path| {
            BASELINES.iter().map(|baseline| baseline_ratios(data, path, baseline)).collect()
        })
        .collect();
    let (low, high) = range(spreads.iter().flatten().flat_map(|it| [it.low, it.high]));
    let (low, high) = ((10.0 * low).floor() / 10.0, (10.0 * high).ceil() / 10.0);
    let bottom = 50.0 + 62.0 * paths.len() as f64;
    let mut svg = Svg::new(
        "Error of the controller divided by that of each of four baselines under the same power budget: median and \
         extremes of seven budgets for each path.",
        bottom + 44.0,
    );
    let entries: Vec<_> = BASELINES
        .iter()
        .zip(colors)
        .map(|(baseline, color)| (Mark::Disc(4.5), color, baseline.name))
        .collect();
    svg.legend((20.0, 22.0), &entries);
    let panel = Panel {
        x: Axis::linear((low, high), (150.0, 735.0)),
        y: Axis::linear((paths.len() as f64, 0.0), (bottom, 50.0)),
    };
    let names: Vec<(f64, String)> = (0..=20)
        .map(|tenth| (f64::from(tenth) / 10.0, format!("{:.1}", f64::from(tenth) / 10.0)))
        .filter(|(value, _)| (low - 1e-9..=high + 1e-9).contains(value))
        .collect();
    let xs: Vec<_> = names.iter().map(|(value, name)| (*value, name.as_str())).collect();
    panel.frame(&mut svg, "", &xs, &[]);
    svg.rule((panel.x.at(1.0), 46.0), (panel.x.at(1.0), bottom), "a");
    for (row, (scene, path)) in paths.iter().enumerate() {
        let row = row as f64;
        svg.text((140.0, panel.y.at(row + 0.5) + 4.0), "e", &format!("{scene}, {path}"));
        if row > 0.0 {
            svg.rule((150.0, panel.y.at(row)), (735.0, panel.y.at(row)), "g");
        }
        for (index, (spread, color)) in spreads[row as usize].iter().zip(colors).enumerate() {
            let y = row + 0.2 + 0.2 * index as f64;
            panel.line(&mut svg, &[(spread.low, y), (spread.high, y)], color, 2.0, false);
            svg.mark(panel.at(spread.median, y), Mark::Disc(4.5), color);
        }
    }
    svg.text(
        (442.0, bottom + 36.0),
        "m",
        "error of frugal ÷ error of the baseline; below 1, frugal is better",
    );
    svg.finish()
}

fn metered_power(data: &Data) -> String {
    let metered = &data.metered;
    let bottom = 58.0 + 34.0 * metered.rows.len() as f64;
    let mut svg = Svg::new(
        "Metered watts of a GPU with 95 % intervals under three power budgets, under two error budgets, and \
         at the best settings; the predictions of the controller and the limits beside them.",
        bottom + 44.0,
    );
    svg.legend(
        (130.0, 22.0),
        &[
            (Mark::Disc(4.5), BLUE, "metered, 95 % interval"),
            (Mark::Ring(4.5), ORANGE, "predicted"),
            (Mark::Square(3.0), RED, "power budget"),
        ],
    );
    let panel = Panel {
        x: Axis::linear((0.0, 260.0), (130.0, 590.0)),
        y: Axis::linear((metered.rows.len() as f64, 0.0), (bottom, 58.0)),
    };
    let xs =
        [(0.0, "0"), (50.0, "50"), (100.0, "100"), (150.0, "150"), (200.0, "200"), (250.0, "250")];
    panel.frame(&mut svg, "", &xs, &[]);
    let [least, most] = metered.idle_w.map(|watts| panel.x.at(watts));
    svg.bar((least, 58.0), (most, bottom), GREY, 0.5);
    svg.text((least - 4.0, bottom - 6.0), "s e", "idle");
    svg.text((690.0, 50.0), "s e", "power saved");
    svg.text((750.0, 50.0), "s e", "error");
    for (index, row) in metered.rows.iter().enumerate() {
        let y = index as f64 + 0.5;
        let name =
            if row.limit_w.is_some() { format!("budget {}", row.name) } else { row.name.clone() };
        svg.text((120.0, panel.y.at(y) + 4.0), "e", &name);
        if let Some(limit) = row.limit_w {
            let x = panel.x.at(limit);
            svg.path(&[(x, panel.y.at(y) - 12.0), (x, panel.y.at(y) + 12.0)], RED, 3.0, false);
        }
        let ends = [(row.watts - row.interval_w, y), (row.watts + row.interval_w, y)];
        panel.line(&mut svg, &ends, BLUE, 2.0, false);
        svg.mark(panel.at(row.watts, y), Mark::Disc(4.5), BLUE);
        svg.mark(panel.at(row.predicted_w, y), Mark::Ring(6.0), ORANGE);
        if let Some((saved, interval)) = row.saved.zip(row.saved_interval) {
            let text = format!("{:.0} ± {:.0} %", 100.0 * saved, 100.0 * interval);
            svg.text((690.0, panel.y.at(y) + 4.0), "e", &text);
        }
        svg.text((750.0, panel.y.at(y) + 4.0), "e", &row.error.to_string());
    }
    svg.text((360.0, bottom + 36.0), "m", "watts of the whole board");
    svg.finish()
}

fn knobs(data: &Data) -> String {
    let here = || data.levels.rows.iter().filter(|row| row.scene == "courtyard");
    let mut names: Vec<&str> = here().map(|row| row.knob.as_str()).collect();
    names.dedup();
    let rows_of =
        |name: &str| -> Vec<&LevelRow> { here().filter(|row| row.knob == name).collect() };
    let saving = |name: &str| range(rows_of(name).iter().map(|row| 1.0 - row.cost)).1;
    names.sort_by(|a, b| saving(b).total_cmp(&saving(a)));
    let bottom = 52.0 + 29.0 * names.len() as f64;
    let mut svg = Svg::new(
        "For each knob, power saved and error at every level when it alone is lowered from the best settings.",
        bottom + 44.0,
    );
    let zero = 470.0;
    let saved = Axis::linear((0.0, 90.0), (zero - 14.0, 215.0));
    let error = Axis::linear((0.0, 0.35), (zero + 14.0, 735.0));
    svg.text((zero - 14.0, 24.0), "b e", "power saved, % of the best settings");
    svg.text((zero + 14.0, 24.0), "b", "error, 1 − SSIM");
    for (axis, marks) in [
        (saved, [(0.0, "0"), (20.0, "20"), (40.0, "40"), (60.0, "60"), (80.0, "80")].as_slice()),
        (error, &[(0.0, "0"), (0.1, "0.1"), (0.2, "0.2"), (0.3, "0.3")]),
    ] {
        for (value, name) in marks {
            svg.rule((axis.at(*value), 44.0), (axis.at(*value), bottom), "g");
            svg.text((axis.at(*value), bottom + 16.0), "s m", name);
        }
    }
    for (index, name) in names.iter().enumerate() {
        let y = 52.0 + 29.0 * (index as f64 + 0.5);
        svg.text((10.0, y), "", name);
        let levels = rows_of(name);
        if let [cheapest, .., best] = levels.as_slice() {
            svg.text((10.0, y + 12.0), "s", &format!("{} to {}", cheapest.level, best.level));
        }
        for (axis, color, of) in [
            (saved, BLUE, (|row| 100.0 * (1.0 - row.cost)) as fn(&LevelRow) -> f64),
            (error, RED, |row| row.loss),
        ] {
            let most = range(levels.iter().map(|row| of(row))).1;
            svg.bar((axis.at(0.0), y - 8.0), (axis.at(most), y + 8.0), color, 0.3);
            for row in &levels {
                svg.mark((axis.at(of(row)), y), Mark::Disc(3.2), color);
            }
        }
    }
    svg.text((zero, bottom + 37.0), "m", "each dot is a level; bars reach to the greatest");
    svg.finish()
}

fn levels(data: &Data) -> String {
    let colors = [BLUE, ORANGE, GREEN, VIOLET, OCHRE];
    let rows = &data.levels.rows;
    let mut names: Vec<&str> = rows
        .iter()
        .filter(|row| row.scene == "courtyard" && row.light.is_some())
        .map(|row| row.knob.as_str())
        .collect();
    names.dedup();
    names.truncate(colors.len());
    let mut svg = Svg::new(
        "Cost and error of every level of five knobs of global illumination against a path-traced reference, \
         in two scenes.",
        392.0,
    );
    let entries: Vec<_> =
        names.iter().zip(colors).map(|(name, color)| (Mark::Disc(4.0), color, *name)).collect();
    svg.legend((20.0, 22.0), &entries);
    for (index, scene) in ["courtyard", "two_rooms"].into_iter().enumerate() {
        let left = 60.0 + 355.0 * index as f64;
        let panel = Panel {
            x: Axis::linear((0.0, 120.0), (left, left + 335.0)),
            y: Axis::logarithmic((0.05, 1.1), (332.0, 66.0)),
        };
        let xs = [(0.0, "0"), (25.0, "25"), (50.0, "50"), (75.0, "75"), (100.0, "100")];
        let ys = [(0.1, "0.1"), (0.2, "0.2"), (0.4, "0.4"), (0.8, "0.8")];
        let ys = if index == 0 { ys.to_vec() } else { unnamed(&ys) };
        panel.frame(&mut svg, scene, &xs, &ys);
        for (name, color) in names.iter().zip(colors) {
            let here = || rows.iter().filter(|row| row.scene == scene && row.knob == *name);
            let points: Vec<_> =
                here().filter_map(|row| Some((100.0 * row.cost, row.light?.error))).collect();
            panel.line(&mut svg, &points, color, 1.5, false);
            for (x, y) in &points {
                svg.mark(panel.at(*x, *y), Mark::Disc(4.0), color);
            }
            if let Some((cheapest, (x, y))) = here().next().zip(points.first().copied()) {
                let (x, y) = panel.at(x, y);
                svg.text((x + 7.0, y - 5.0), "s", &cheapest.level);
            }
        }
    }
    svg.text((407.0, 378.0), "m", "cost of a frame, % of the best settings");
    svg.rising((16.0, 199.0), "relative L1, 4×4 means");
    svg.finish()
}

/// The name of settings in few words.
fn short(method: &str) -> String {
    method.replace(" of the pixels", "").replace("every pixel", "1/1")
}

fn naive_rsm(data: &Data) -> String {
    let rows = &data.naive.rows;
    let bottom = 58.0 + 30.0 * rows.len() as f64;
    let mut svg = Svg::new(
        "CPU milliseconds and errors of the naive reflective shadow map method and of settings of the plugin.",
        bottom + 44.0,
    );
    svg.legend(
        (330.0, 22.0),
        &[(Mark::Disc(4.5), GREY, "the camera moves"), (Mark::Ring(4.5), GREY, "everything moves")],
    );
    svg.text((745.0, 22.0), "b e", "error");
    let panel = Panel {
        x: Axis::logarithmic((10.0, 2000.0), (330.0, 690.0)),
        y: Axis::linear((rows.len() as f64, 0.0), (bottom, 42.0)),
    };
    let xs = [(10.0, "10"), (30.0, "30"), (100.0, "100"), (300.0, "300"), (1000.0, "1000")];
    panel.frame(&mut svg, "", &xs, &[]);
    for (index, row) in rows.iter().enumerate() {
        let y = index as f64 + 0.5;
        let color = if row.method.starts_with("naive") { RED } else { BLUE };
        svg.text((318.0, panel.y.at(y) + 4.0), "s e", &short(&row.method));
        panel.line(&mut svg, &[(row.camera_ms, y), (row.everything_ms, y)], color, 1.5, false);
        svg.mark(panel.at(row.camera_ms, y), Mark::Disc(4.5), color);
        svg.mark(panel.at(row.everything_ms, y), Mark::Ring(5.5), color);
        svg.text((745.0, panel.y.at(y) + 4.0), "e", &format!("{:.2}", row.error));
    }
    svg.text((510.0, bottom + 36.0), "m", "CPU milliseconds above a frame without GI");
    svg.finish()
}

fn stability(data: &Data) -> String {
    let rows = &data.stability.rows;
    let bottom = 50.0 + 40.0 * rows.len() as f64;
    let mut svg = Svg::new(
        "Change between successive frames that the reference does not have: the naive method and five settings \
         of the plugin, under a moving sun and a moving camera.",
        bottom + 44.0,
    );
    let series = [(BLUE, "the sun moves"), (ORANGE, "the camera moves")];
    svg.legend((340.0, 24.0), &series.map(|(color, name)| (Mark::Square(5.0), color, name)));
    let panel = Panel {
        x: Axis::linear((0.0, 6.5), (340.0, 735.0)),
        y: Axis::linear((rows.len() as f64, 0.0), (bottom, 42.0)),
    };
    let xs = [(0.0, "0"), (2.0, "2"), (4.0, "4"), (6.0, "6")];
    panel.frame(&mut svg, "", &xs, &[]);
    for (index, row) in rows.iter().enumerate() {
        let middle = panel.y.at(index as f64 + 0.5);
        svg.text((328.0, middle + 4.0), "s e", &short(&row.method));
        for (top, value, (color, _)) in
            [(middle - 14.0, row.sun, series[0]), (middle + 1.0, row.camera, series[1])]
        {
            let end = panel.x.at(100.0 * value);
            svg.bar((panel.x.at(0.0), top), (end, top + 13.0), color, 0.9);
            svg.text((end + 6.0, top + 11.0), "s", &format!("{:.1}", 100.0 * value));
        }
    }
    svg.text((537.0, bottom + 36.0), "m", "temporal error, % of the mean");
    svg.finish()
}

fn lights(data: &Data) -> String {
    let lights = &data.lights;
    let mut svg = Svg::new(
        "Error in a hall of 64 lights by how many of them have maps, and milliseconds of a frame by how many \
         lights there are.",
        372.0,
    );
    let error = Panel {
        x: Axis::logarithmic((3.0, 90.0), (60.0, 375.0)),
        y: Axis::linear((0.0, 45.0), (318.0, 76.0)),
    };
    let counts = [(4.0, "4"), (8.0, "8"), (16.0, "16"), (32.0, "32"), (64.0, "64")];
    let ys = [(0.0, "0"), (10.0, "10"), (20.0, "20"), (30.0, "30"), (40.0, "40")];
    error.frame(&mut svg, "", &counts, &ys);
    let mut settings: Vec<&str> = lights.rows.iter().map(|row| row.settings.as_str()).collect();
    settings.dedup();
    for (index, (name, (color, mark))) in
        settings.iter().zip([(BLUE, Mark::Disc(4.0)), (ORANGE, Mark::Square(3.5))]).enumerate()
    {
        let short = if name.contains("default") { "near the default" } else { "best settings" };
        svg.legend((70.0 + 150.0 * index as f64, 48.0), &[(mark, color, short)]);
        let here: Vec<_> = lights.rows.iter().filter(|row| row.settings == *name).collect();
        let mean = |views: &[f64; 3]| 100.0 * views.iter().sum::<f64>() / 3.0;
        let points: Vec<_> = here.iter().map(|row| (row.lights, mean(&row.error))).collect();
        error.line(&mut svg, &points, color, 1.5, false);
        for row in here {
            for view in row.error {
                svg.mark(error.at(row.lights, 100.0 * view), mark, color);
            }
        }
    }
    svg.text((60.0, 22.0), "b", "error at three views, and their mean");
    svg.text((217.0, 356.0), "m", "lights with maps, of 64");
    svg.rising((18.0, 197.0), "relative L1, 4×4 means, %");
    let time = Panel {
        x: Axis::linear((0.0, 68.0), (455.0, 740.0)),
        y: Axis::linear((0.0, 90.0), (318.0, 76.0)),
    };
    svg.text((455.0, 22.0), "b", "time of GI, two runs");
    let xs = [(0.0, "0"), (16.0, "16"), (32.0, "32"), (48.0, "48"), (64.0, "64")];
    let ys = [(0.0, "0"), (20.0, "20"), (40.0, "40"), (60.0, "60"), (80.0, "80")];
    time.frame(&mut svg, "", &xs, &ys);
    for run in 0..2 {
        let points: Vec<_> =
            lights.times.iter().map(|row| (row.lights, row.above_none_ms[run])).collect();
        time.line(&mut svg, &points, BLUE, 1.5, false);
        for (x, y) in points {
            svg.mark(time.at(x, y), Mark::Disc(4.0), BLUE);
        }
    }
    svg.text((597.0, 356.0), "m", "lights");
    svg.rising((418.0, 197.0), "ms above a frame without lights");
    svg.finish()
}
