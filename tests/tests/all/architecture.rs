//! Imports run downhill, and documents hold together.

use std::collections::BTreeSet;
use std::path::PathBuf;

use frugal_tests::folder::workspace;
use frugal_tests::imports::imports;

tests!(
    the_core_imports_downhill,
    the_plugin_imports_downhill,
    the_plugin_s_tools_import_downhill,
    the_tool_imports_downhill,
    the_search_imports_downhill,
    the_path_tracer_imports_downhill,
    links_in_documents_lead_somewhere,
    documents_are_short_and_wrapped,
    the_glossary_is_short,
    samples_in_documents_are_compiled,
    the_shell_function_runs_the_tool_in_any_folder,
    the_prelude_is_short_and_has_what_the_readme_names
);

/// The parts of the crate without a renderer: each imports only those above it.
const CORE: &[&str] = &["units", "power", "knobs", "frontier", "control"];

/// The plugin's parts.
const PLUGIN: &[&str] = &[
    "units",
    "schedule",
    "cut",
    "atmosphere",
    "power",
    "signals",
    "resolution",
    "pacing",
    "gi/settings",
    "gi/schedule",
    "gi/compute",
    "gi/texels",
    "gi/view",
    "gi/surfaces",
    "gi/trace",
    "gi/vpl",
    "gi/rsm",
    "gi/emissive",
    "gi/sky",
    "gi/bounces",
    "gi/camera",
    "gi/gather",
    "gi/cache",
    "gi/forward",
    "gi/denoise",
    "gi/composite",
    "gi/fog",
    "gi/diagnostics",
    "gi/inspect",
    "gi",
    "knobs",
    "frontier",
    "control",
    "camera_copy",
    "error_meter",
    "stage",
];

/// The parts of the development tools.
const PLUGIN_TOOLS: &[&str] = &["row_log", "recording", "control_log", "hud"];

/// The tool's parts.
const TOOL: &[&str] = &[
    "scene",
    "subject",
    "work_meter",
    "device",
    "control_log",
    "stage",
    "evaluate",
    "inspect",
    "report",
    "cli",
];

/// The search's parts.
const SEARCH: &[&str] = &[
    "files", "linalg", "journal", "cameras", "table", "search", "cost", "pool", "fit", "pipeline",
    "evaluate",
];

/// The path tracer's parts.
const TRACE: &[&str] = &[
    "color",
    "sampler",
    "fourier",
    "scene",
    "light",
    "bsdf",
    "guide",
    "media",
    "metrics",
    "integrator",
    "fog_cache",
    "fog_beams",
    "caustics",
    "time",
    "coded",
    "inverse",
];

fn assert_downhill(folder: &str, split: &[&str], order: &[&str]) {
    let found = imports(&workspace().join(folder), split).expect("sources");
    let place = |part: &str| {
        order
            .iter()
            .position(|known| *known == part)
            .unwrap_or_else(|| panic!("{folder}/{part} is new: give it its place in the order"))
    };
    let upward: Vec<String> = found
        .iter()
        .filter(|((own, other), _)| place(own) <= place(other))
        .map(|((own, other), files)| format!("{own} imports {other}: {files:?}"))
        .collect();
    println!("    {folder}: {} imports between parts, {} upward", found.len(), upward.len());
    assert!(!found.is_empty(), "imports are found at all");
    assert!(upward.is_empty(), "{folder}: imports run upward\n{}", upward.join("\n"));
}

fn the_core_imports_downhill() {
    assert_downhill("plugin/core/src", &[], CORE);
}

fn the_plugin_imports_downhill() {
    assert_downhill("plugin/src", &["gi"], PLUGIN);
}

fn the_plugin_s_tools_import_downhill() {
    assert_downhill("plugin/tools/src", &[], PLUGIN_TOOLS);
}

fn the_tool_imports_downhill() {
    assert_downhill("precompute/src", &[], TOOL);
}

fn the_search_imports_downhill() {
    assert_downhill("precompute/search/src", &[], SEARCH);
}

fn the_path_tracer_imports_downhill() {
    assert_downhill("precompute/trace/src", &[], TRACE);
}

/// Every document, and its text.
fn documents() -> Vec<(PathBuf, String)> {
    let mut files: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md"].map(|name| workspace().join(name)).into();
    for folder in ["docs", "docs/architecture"] {
        let entries = std::fs::read_dir(workspace().join(folder)).expect("documents");
        files.extend(entries.map(|entry| entry.expect("an entry").path()));
    }
    files.retain(|file| file.extension().is_some_and(|extension| extension == "md"));
    files.sort();
    let read = |file: PathBuf| {
        let text = std::fs::read_to_string(&file).expect("a document");
        (file, text)
    };
    files.into_iter().map(read).collect()
}

/// The anchor that a heading gets.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

fn links_in_documents_lead_somewhere() {
    let mut count = 0;
    for (file, text) in documents() {
        let name = file.file_name().expect("a name").to_string_lossy().into_owned();
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if link.contains("://") {
                continue;
            }
            count += 1;
            let (path, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { file.clone() } else { file.with_file_name(path) };
            assert!(target.exists(), "{name}: {link} leads nowhere");
            if !heading.is_empty() {
                let text = std::fs::read_to_string(&target).expect("a document");
                let mut headings = text.lines().filter(|line| line.starts_with('#'));
                let is_there = headings.any(|line| anchor(line.trim_start_matches('#')) == heading);
                assert!(is_there, "{name}: there is no heading for {link}");
            }
        }
    }
    assert!(count > 40, "links are found at all: {count}");
}

fn documents_are_short_and_wrapped() {
    for (file, text) in documents() {
        let name = file.file_name().expect("a name").to_string_lossy().into_owned();
        let most = if name == "README.md" { 200 } else { 600 };
        let lines = text.lines().count();
        assert!(lines <= most, "{name} has {lines} lines, more than {most}");
        let mut is_code = false;
        for (number, line) in (1..).zip(text.lines()) {
            is_code ^= line.trim_start().starts_with("```");
            let is_prose = !is_code && !line.contains('|') && !line.contains("](");
            assert!(
                !is_prose || line.chars().count() <= 120,
                "{name}:{number}: wrap it at 120 characters"
            );
        }
    }
}

fn the_glossary_is_short() {
    let overview = workspace().join("ARCHITECTURE.md");
    let text = std::fs::read_to_string(&overview).expect("a document");
    let (_, text) = text.split_once("## Glossary").expect("a glossary");
    let rows = text.lines().skip_while(|line| !line.starts_with('|')).skip(2);
    let rows: Vec<&str> = rows.take_while(|line| line.starts_with('|')).collect();
    assert!((30..=40).contains(&rows.len()), "{} entries, not 30 to 40", rows.len());
    for row in rows {
        assert!(row.chars().count() <= 120, "too long: {row}");
    }
}

/// Code without what `rustfmt` may change.
fn squeezed(code: &str) -> String {
    let lines = code.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.flat_map(str::chars).filter(|c| !c.is_whitespace() && *c != ',').collect()
}

fn samples_in_documents_are_compiled() {
    let compiled = squeezed(include_str!("../../src/samples.rs"));
    let mut count = 0;
    for (file, text) in documents() {
        for sample in text.split("```rust\n").skip(1) {
            let sample = sample.split("```").next().unwrap_or_default();
            count += 1;
            assert!(
                compiled.contains(&squeezed(sample)),
                "{}: put this sample into tests/src/samples.rs, which is compiled:\n{sample}",
                file.display()
            );
        }
    }
    assert!(count >= 8, "samples are found at all: {count}");
}

fn the_shell_function_runs_the_tool_in_any_folder() {
    let text = std::fs::read_to_string(workspace().join("docs/tool.md")).expect("a document");
    let sample = text.split("```").nth(1).expect("a sample");
    let lines = sample.lines().skip(1).filter(|line| !line.starts_with("make "));
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::create_dir(folder.path().join("debug")).expect("a folder");
    // A shell in place of the tool.
    std::os::unix::fs::symlink("/bin/sh", folder.path().join("debug/frugal")).expect("a link");
    let script = lines.chain(["cd /", "frugal -c pwd"]).collect::<Vec<_>>().join("\n");
    let mut shell = std::process::Command::new("sh");
    shell.args(["-c", &script]).current_dir(workspace()).env("CARGO_TARGET_DIR", folder.path());
    let output = shell.output().expect("a shell");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(String::from_utf8_lossy(&output.stdout), "/\n", "{said}");
}

/// Identifiers in a text.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// What `pub use` statements of a source name, and the types that it declares.
fn exported(source: &str) -> BTreeSet<&str> {
    let lists = source.split("pub use ").skip(1).filter_map(|rest| rest.split(';').next());
    let types = source.lines().filter_map(|line| {
        let line = line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub enum "))?;
        words(line).next()
    });
    lists.flat_map(words).chain(types).filter(|word| word.starts_with(char::is_uppercase)).collect()
}

fn the_prelude_is_short_and_has_what_the_readme_names() {
    let read = |path: &str| std::fs::read_to_string(workspace().join(path)).expect("a file");
    let library = read("plugin/src/lib.rs");
    let prelude = exported(&library);
    assert!(prelude.len() <= 25, "{} names", prelude.len());
    let modules = ["control", "frontier", "gi", "knobs", "power", "resolution", "signals"];
    let sources = modules.map(|module| read(&format!("plugin/src/{module}/mod.rs")));
    let public: BTreeSet<&str> = sources.iter().flat_map(|source| exported(source)).collect();
    assert!(public.len() > 80, "public items are found at all: {}", public.len());
    let text = read("README.md");
    let named: BTreeSet<&str> = words(&text).filter(|word| public.contains(word)).collect();
    let lacking: Vec<_> = named.difference(&prelude).collect();
    println!("    {} names; README.md names {} public items", prelude.len(), named.len());
    assert!(lacking.is_empty(), "README.md names {lacking:?}, which the prelude lacks");
}
