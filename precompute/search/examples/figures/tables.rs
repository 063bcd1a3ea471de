//! The tables of the documents, one function each.

use crate::data::{AccuracyRow, Data, ErrorRow, Played, SeedRow};
use crate::summary::{BASELINES, Spread, baseline_ratios, paths, rows_of, used};

/// The table called `name`, as Markdown.
pub(crate) fn table(data: &Data, name: &str) -> Option<String> {
    Some(match name {
        "summary" => summary(data),
        "equal-power" => equal_power(data),
        "seeds" => seeds(data),
        "error-budgets" => error_budgets(data),
        "meters" => meters(data),
        "accuracy" => accuracy(data),
        "bounces" => bounces(data),
        "naive-rsm" => naive_rsm(data),
        "cost" => cost(data),
        "conditions" => conditions(data),
        _ => return None,
    })
}

fn markdown(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let rule = vec!["---".to_owned(); header.len()].join("|");
    let header = line(header.iter().map(ToString::to_string).collect());
    rows.into_iter().fold(format!("{header}|{rule}|\n"), |text, row| text + &line(row))
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn percents(share: Spread) -> String {
    span(&format!("{:.0}", 100.0 * share.low), &percent(share.high))
}

/// `low to high`, or one number where both are written alike.
fn span(low: &str, high: &str) -> String {
    if low == high { low.to_owned() } else { format!("{low} to {high}") }
}

fn number(value: f64) -> String {
    value.to_string()
}

/// The README's table.
fn summary(data: &Data) -> String {
    let paths = paths(data);
    let ratios = |baseline: usize| {
        Spread::of(
            paths.iter().map(|path| baseline_ratios(data, path, &BASELINES[baseline]).median),
        )
    };
    let [trained, _, turns, shared] = [0, 1, 2, 3].map(ratios);
    let decimals = |it: Spread| span(&format!("{:.2}", it.low), &format!("{:.2}", it.high));
    let ours = used(data, &paths, |row| row.frugal);
    let constant = used(data, &paths, |row| row.trained);
    let over =
        Spread::of(paths.iter().flat_map(|path| rows_of(data, path)).map(|row| row.windows_over));
    let saved = data.metered.rows.iter().find(|row| row.name == "error 0.01");
    let saved = saved.and_then(|row| row.saved.zip(row.saved_interval)).unwrap_or_default();
    let ratio = Spread::of(data.accuracy.rows.iter().map(|row| row.ratio));
    let factor = data.naive.cheaper_by.first().map_or(String::new(), |row| number(row.low));
    let part = |start: &str| {
        let row = data.cost.rows.iter().find(|row| row.part.starts_with(start));
        row.map_or(String::new(), |row| {
            format!("{} {}", span(&number(row.low), &number(row.high)), row.unit)
        })
    };
    let memory = "GI's GPU memory, ";
    let rows = [
        [
            format!(
                "error ÷ that of one constant: {}. The constant uses {} of the budget",
                decimals(trained),
                percents(constant)
            ),
            format!(
                "same power budget; median over budgets from 30 to 90 % of the range; counted work; {} paths",
                paths.len()
            ),
        ],
        [
            format!("error ÷ that of two constants in turns: {}", decimals(turns)),
            "the same; both tuned on the path".into(),
        ],
        [
            format!("error ÷ that with one frontier for all views: {}", decimals(shared)),
            "the same".into(),
        ],
        [
            format!(
                "{} of the budget used; {} of the windows of 30 s over it by 2 %",
                percents(ours),
                if over.high > 0.0 {
                    format!("at most {:.1} %", 100.0 * over.high)
                } else {
                    "none".into()
                }
            ),
            "the same".into(),
        ],
        [
            format!(
                "{:.0} ± {:.0} % of *metered* power saved at an error of 0.01",
                100.0 * saved.0,
                100.0 * saved.1
            ),
            format!(
                "H100, {}×{}, 30 frames per second, {}",
                data.metered.size[0], data.metered.size[1], data.metered.made.date
            ),
        ],
        [
            format!(
                "mean of the indirect light ÷ that by path tracing: {}",
                span(&format!("{:.2}", ratio.low), &format!("{:.2}", ratio.high))
            ),
            format!("{} views, best settings, one bounce", data.accuracy.rows.len()),
        ],
        [
            format!("{factor} times cheaper than a naive reflective shadow map at no more error"),
            "`courtyard`, moving camera".into(),
        ],
        [
            format!(
                "{} of GPU memory at 320×180, {} at 1920×1080",
                part(&format!("{memory}320")),
                part(&format!("{memory}1920"))
            ),
            "largest settings, three lights".into(),
        ],
    ];
    markdown(&["figure", "conditions"], rows.map(Vec::from))
}

fn equal_power(data: &Data) -> String {
    let rows = paths(data).into_iter().map(|path| {
        let over = Spread::of(rows_of(data, &path).map(|row| row.windows_over));
        let mut cells = vec![format!("{}, {}", path.0, path.1)];
        cells.extend(
            BASELINES.iter().map(|it| format!("{:.2}", baseline_ratios(data, &path, it).median)),
        );
        cells.push(percents(used(data, [&path], |row| row.frugal)));
        cells.push(percents(used(data, [&path], |row| row.trained)));
        cells.push(percent(over.high));
        cells
    });
    markdown(
        &[
            "path",
            "trained",
            "best",
            "in turns",
            "one frontier",
            "used",
            "used by trained",
            "windows over",
        ],
        rows,
    )
}

/// Of each path, all seeds.
fn seeds(data: &Data) -> String {
    let rows = paths(data).into_iter().map(|(scene, path)| {
        let mut here: Vec<&SeedRow> = data.policies.seeds.iter().collect();
        here.retain(|row| row.scene == scene && row.path == path);
        here.sort_by_key(|row| row.seed);
        let all = |of: fn(&SeedRow) -> f64, places: usize| {
            let values = here.iter().map(|row| format!("{:.places$}", of(row)));
            values.collect::<Vec<_>>().join(", ")
        };
        let way = all(|row| 100.0 * row.way, 0) + " %";
        let of: [fn(&SeedRow) -> f64; 3] = [|row| row.trained, |row| row.turns, |row| row.shared];
        let [trained, turns, shared] = of.map(|of| all(of, 2));
        vec![format!("{scene}, {path}"), trained, turns, shared, way]
    });
    markdown(&["path", "trained", "in turns", "one frontier", "of the way to the oracle"], rows)
}

fn error_budgets(data: &Data) -> String {
    let rows = &data.policies.error_budgets;
    let mut budgets: Vec<f64> = rows.iter().map(|row| row.error_budget).collect();
    budgets.sort_by(f64::total_cmp);
    budgets.dedup();
    let rows = budgets.into_iter().map(|budget| {
        let here: Vec<_> = rows.iter().filter(|row| row.error_budget == budget).collect();
        let kept = |errors: &mut dyn Iterator<Item = f64>| {
            errors.filter(|error| *error <= budget).count().to_string()
        };
        let mut cells = vec![number(budget)];
        for of in [(|row| row.frugal) as fn(&ErrorRow) -> Played, |row| row.measured] {
            let used = Spread::of(here.iter().map(|row| of(row).error / budget));
            let watts = Spread::of(here.iter().map(|row| of(row).w / row.trained.w));
            let count = kept(&mut here.iter().map(|row| of(row).error));
            cells.push(format!("{count}, {}, {:.2}", percents(used), watts.median));
        }
        cells.push(kept(&mut here.iter().map(|row| row.trained.error)));
        cells
    });
    markdown(&["error budget", "by the map", "with an error meter", "trained constant"], rows)
}

fn meters(data: &Data) -> String {
    let mut names: Vec<&str> = data.meters.rows.iter().map(|row| row.meter.as_str()).collect();
    names.sort_by_key(|name| {
        ["on time", "lost", "30 s", "hungrier"].iter().position(|it| name.starts_with(it))
    });
    names.dedup();
    let rows = names.into_iter().map(|name| {
        let here = || data.meters.rows.iter().filter(|row| row.meter == name);
        let used = Spread::of(here().map(|row| row.used));
        let over = Spread::of(here().map(|row| row.windows_over));
        vec![
            name.to_owned(),
            percents(used),
            format!("{}, {}", percent(over.median), percent(over.high)),
        ]
    });
    markdown(&["meter", "budget used", "windows over: median, most"], rows)
}

fn accuracy(data: &Data) -> String {
    let rows = &data.accuracy.rows;
    let scene = |row: &AccuracyRow| row.view.split(',').next().unwrap_or_default().to_owned();
    let mut scenes: Vec<String> = rows.iter().map(scene).collect();
    scenes.dedup();
    let rows = scenes.into_iter().map(|name| {
        let views: Vec<_> = rows.iter().filter(|row| scene(row) == name).collect();
        let cell = |of: fn(&AccuracyRow) -> f64| {
            let all = Spread::of(views.iter().map(|row| of(row)));
            span(&format!("{:.2}", all.low), &format!("{:.2}", all.high))
        };
        vec![format!("{name}, {}", views.len()), cell(|row| row.ratio), cell(|row| row.l1_4x4)]
    });
    markdown(&["scene, views", "mean ratio", "relative L1, 4×4"], rows)
}

fn bounces(data: &Data) -> String {
    let rows = &data.bounces.rows;
    let mut scenes: Vec<&str> = rows.iter().map(|row| row.scene.as_str()).collect();
    scenes.dedup();
    let mut header = vec!["bounces"];
    header.extend(&scenes);
    let rows = ["1", "2", "3", "all"].map(|bounces| {
        let mut cells = vec![bounces.to_owned()];
        cells.extend(scenes.iter().map(|scene| {
            let row = rows.iter().find(|row| row.scene == *scene && row.level == bounces);
            row.zip(row.and_then(|row| row.light)).map_or(String::new(), |(row, light)| {
                format!("{}, {:.2}, {:.2}", percent(row.cost), light.mean_ratio, light.error)
            })
        }));
        cells
    });
    markdown(&header, rows)
}

fn naive_rsm(data: &Data) -> String {
    let rows = data
        .naive
        .cheaper_by
        .iter()
        .map(|row| vec![row.case.clone(), span(&number(row.low), &number(row.high))]);
    markdown(&["case", "times cheaper"], rows)
}

fn cost(data: &Data) -> String {
    let rows = data.cost.rows.iter().map(|row| {
        let figure = format!("{} {}", span(&number(row.low), &number(row.high)), row.unit);
        vec![row.part.clone(), figure]
    });
    markdown(&["part", "figure"], rows)
}

/// Device, driver, date, and the commands of the Makefile.
fn conditions(data: &Data) -> String {
    let rows = data.made().into_iter().map(|(name, made)| {
        let driver = made.driver.split(';').next().unwrap_or_default();
        let device = if made.machine.starts_with("NVIDIA") {
            format!("{}, {driver}", made.machine)
        } else {
            driver.to_owned()
        };
        let commands: Vec<String> = made
            .command
            .iter()
            .filter(|command| command.starts_with("make "))
            .map(|command| format!("`{command}`"))
            .collect();
        vec![format!("[{name}](data/{name}.json)"), device, made.date.clone(), commands.join("; ")]
    });
    markdown(&["data", "device, driver", "date", "command"], rows)
}
