//! What the data make of the repository: drawings, and tables between markers in documents.

use std::path::{Path, PathBuf};

use crate::data::Data;
use crate::{plots, tables};

type Failure = Box<dyn std::error::Error>;

/// Documents with tables.
const DOCUMENTS: [&str; 2] = ["README.md", "docs/results.md"];
/// A table stands between a line of this and a name, and the end.
const BEGIN: &str = "<!-- figures: ";
const END: &str = "<!-- end -->";

/// The repository's root.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Every file that the data decide, relative to `root`, and its text.
///
/// # Errors
/// When a file cannot be read, or a marker names no table or is not closed.
pub(crate) fn outputs(root: &Path) -> Result<Vec<(PathBuf, String)>, Failure> {
    let data = Data::read(&root.join("docs/data"))?;
    let mut files: Vec<_> = plots::all(&data)
        .into_iter()
        .map(|(name, svg)| (PathBuf::from(format!("docs/images/{name}.svg")), svg))
        .collect();
    for document in DOCUMENTS {
        let text = std::fs::read_to_string(root.join(document))?;
        let filled = filled(&text, &data).map_err(|error| format!("{document}: {error}"))?;
        files.push((document.into(), filled));
    }
    Ok(files)
}

/// `text` with the tables of `data` between its markers.
fn filled(text: &str, data: &Data) -> Result<String, String> {
    let mut filled = String::new();
    let mut rest = text;
    while let Some(begin) = rest.find(BEGIN) {
        let (before, from) = rest.split_at(begin);
        let line = from.lines().next().unwrap_or_default();
        let name = line.trim_start_matches(BEGIN).trim_end_matches(" -->");
        let table = tables::table(data, name).ok_or(format!("no table is called `{name}`"))?;
        let end = from.find(END).ok_or(format!("`{line}` has no `{END}`"))?;
        filled.push_str(before);
        filled.push_str(&format!("{line}\n{table}{END}"));
        rest = &from[end + END.len()..];
    }
    Ok(filled + rest)
}
