//! Plots and tables of the documents are what docs/data gives.

#[path = "../examples/figures/data.rs"]
mod data;
#[path = "../examples/figures/documents.rs"]
mod documents;
#[path = "../examples/figures/plots.rs"]
mod plots;
#[path = "../examples/figures/summary.rs"]
mod summary;
#[path = "../examples/figures/svg.rs"]
mod svg;
#[path = "../examples/figures/tables.rs"]
mod tables;

#[test]
fn every_figure_of_the_documents_is_in_the_data() {
    let root = documents::root();
    let mut faults = Vec::new();
    for (file, text) in documents::outputs(&root).expect("the data give plots and tables") {
        // Git may end lines in its own way.
        let known = std::fs::read_to_string(root.join(&file)).unwrap_or_default().replace('\r', "");
        let changed = known.lines().zip(text.lines()).find(|(known, text)| known != text);
        if known != text {
            let (known, text) = changed.unwrap_or(("a shorter or longer file", ""));
            faults.push(format!("{}:\n  has  {known}\n  data {text}", file.display()));
        }
    }
    assert!(faults.is_empty(), "run `make figures`, or correct docs/data:\n{}", faults.join("\n"));
}

/// Sections of results.md, and the files in docs/data that their prose may take figures from.
const PROSE: [(&str, &[&str]); 7] = [
    ("Error at equal power", &["policies", "meters", "rendered"]),
    ("Metered on a GPU", &["metered"]),
    ("Knobs", &["levels"]),
    ("Accuracy", &["accuracy", "bounces"]),
    ("Beside a naive method", &["naive-rsm", "stability"]),
    ("Many lights", &["lights"]),
    ("Time and memory", &["cost"]),
];

#[test]
fn every_figure_in_prose_is_in_the_data_of_its_section() {
    let root = documents::root();
    let text = std::fs::read_to_string(root.join("docs/results.md")).expect("results.md");
    assert_eq!(strangers(&root, &text), Vec::<String>::new(), "correct results.md or docs/data");
    for (truth, slip) in [("400 texels", "401 texels"), ("64 point lights", "65 point lights")] {
        assert!(text.contains(truth), "{truth}");
        assert_eq!(strangers(&root, &text.replace(truth, slip)).len(), 1, "{slip}");
    }
}

#[test]
fn every_figure_of_the_reference_methods_is_in_their_data() {
    let root = documents::root();
    let text = std::fs::read_to_string(root.join("docs/reference.md")).expect("reference.md");
    let known = numbers(&root, &["reference"]);
    let unknown = |text: &str| unknown("Reference methods", text.lines(), &known);
    assert_eq!(unknown(&text), Vec::<String>::new(), "correct reference.md or docs/data");
    let slip = text.replacen("100,000 photons", "100,001 photons", 1);
    assert_eq!(unknown(&slip).len(), 1, "a wrong figure is noticed");
}

/// Numbers in the prose of `text` that the data of their section lack.
fn strangers(root: &std::path::Path, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (title, files) in PROSE {
        let start = text.find(&format!("\n## {title}\n")).expect(title) + 4;
        let end = text[start..].find("\n## ").map_or(text.len(), |length| start + length);
        let prose = text[start..end].lines().filter(|line| !line.starts_with('|'));
        found.extend(unknown(title, prose, &numbers(root, files)));
    }
    found
}

/// Numbers in `lines` that `known` lacks, as they stand or as per cent. Years, code, links and names
/// such as 4×4 are no figures.
fn unknown<'a>(title: &str, lines: impl Iterator<Item = &'a str>, known: &[f64]) -> Vec<String> {
    let mut found = Vec::new();
    for line in lines.filter(|line| !line.starts_with(['!', '#', '<'])) {
        let plain: String = line.split('`').step_by(2).collect();
        let words = plain.split(|c: char| c.is_whitespace() || "()[]".contains(c));
        let per_cent = line.contains('%');
        let is_known = |word: &str| {
            let number: f64 = word.parse().expect("a number");
            let places = word.split_once('.').map_or(0, |(_, places)| places.len());
            let same = |value: f64| format!("{value:.places$}") == word;
            number > 1900.0 && number < 2100.0 && places == 0
                || known.iter().any(|value| same(*value) || per_cent && same(100.0 * value))
        };
        for word in words.filter(|word| !word.contains(['×', '/'])) {
            let word = word.trim_matches(|c: char| !c.is_ascii_digit()).replace(',', "");
            if word.parse::<f64>().is_ok() && !is_known(&word) {
                found.push(format!("{title}: {word} in: {line}"));
            }
        }
    }
    found
}

/// All numbers of `files` in docs/data.
fn numbers(root: &std::path::Path, files: &[&str]) -> Vec<f64> {
    let mut numbers = Vec::new();
    for file in files {
        let file = root.join(format!("docs/data/{file}.json"));
        let json = std::fs::read_to_string(&file).expect("a file of data");
        collect(&serde_json::from_str(&json).expect("JSON"), &mut numbers);
    }
    numbers
}

/// All numbers of a file, but dates.
fn collect(value: &serde_json::Value, numbers: &mut Vec<f64>) {
    use serde_json::Value;
    match value {
        Value::Number(number) => numbers.extend(number.as_f64()),
        Value::Array(all) => all.iter().for_each(|value| collect(value, numbers)),
        Value::Object(fields) => {
            let kept = fields.iter().filter(|(name, _)| *name != "date" && *name != "made");
            kept.for_each(|(_, value)| collect(value, numbers));
        }
        _ => {}
    }
}
