//! Reads and checks a `*.scene.ron` file.

use std::path::{Path, PathBuf};

use frugal_core::knobs::did_you_mean;
use frugal_trace::scene::{SkyError, SkyMap};
use ron::error::SpannedError;
use ron::extensions::Extensions;
use thiserror::Error;

use super::check::{self, Problem};
use super::description::{Environment, SceneDescription};
use super::locate;

/// Why a scene cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The description cannot be read.
    #[error("cannot read {file}: {source}; give a scene file, *.scene.ron", file = file.display())]
    Unreadable {
        /// The description.
        file: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The description is invalid.
    #[error("{file}:{line}:{column}: {field}: {problem}; {remedy}", file = file.display(), field = if field.is_empty() { "scene" } else { field })]
    Invalid {
        /// The description.
        file: PathBuf,
        /// From 1.
        line: usize,
        /// From 1, in characters.
        column: usize,
        /// The field, such as `lights[0].direction` or `paths["tour"][1].time`; empty for the
        /// whole.
        field: String,
        /// The problem.
        problem: String,
        /// The remedy.
        remedy: String,
    },
}

/// Reads the scene description at `path` and checks it, but not the files that it names.
///
/// # Errors
/// [`SceneError`], which names file, line, column, field, problem and remedy.
pub(super) fn read(path: &Path) -> Result<SceneDescription, SceneError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| SceneError::Unreadable { file: path.to_path_buf(), source })?;
    parse(&text, path)
}

/// Reads a description from `text` and checks it, but not the files that it names; `path` is named
/// in errors, and those files are relative to it.
///
/// # Errors
/// As [`read`].
pub(super) fn parse(text: &str, path: &Path) -> Result<SceneDescription, SceneError> {
    let options = ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME);
    let mut description: SceneDescription =
        options.from_str(text).map_err(|error| explain(text, path, &error))?;
    description.source = path.to_path_buf();
    let located = |problem| locate_problem(text, path, problem);
    check::check(&description).map_err(located)?;
    // Of two paths of one name the map has the last.
    let values = locate::values(text);
    for name in description.paths.keys() {
        let field = format!("paths[{name:?}]");
        if values.iter().filter(|value| value.field == field).count() > 1 {
            let problem = "there are two of this name".to_owned();
            let remedy = "give each path a name of its own".to_owned();
            return Err(located(Problem { field, problem, remedy }));
        }
    }
    Ok(description)
}

impl SceneDescription {
    /// Reads the environment map; `None` without one.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at its field.
    pub(super) fn read_sky(&self) -> Result<Option<SkyMap>, SceneError> {
        let Environment::Map(name, _) = &self.environment else { return Ok(None) };
        let located = |SkyError { file, problem, remedy }| {
            self.locate(Problem {
                field: "environment[0]".into(),
                problem: format!("{file}: {problem}"),
                remedy: remedy.into(),
            })
        };
        SkyMap::read(&self.resolve(name)).map(Some).map_err(located)
    }

    /// The bytes of the environment map; none without one.
    ///
    /// # Errors
    /// [`SceneError::Invalid`] at its field.
    pub(super) fn environment_bytes(&self) -> Result<Vec<u8>, SceneError> {
        let Environment::Map(name, _) = &self.environment else { return Ok(Vec::new()) };
        let path = self.resolve(name);
        std::fs::read(&path).map_err(|error| {
            self.locate(Problem {
                field: "environment[0]".into(),
                problem: format!("cannot read {}: {error}", path.display()),
                remedy: "give an equirectangular image relative to the description".into(),
            })
        })
    }

    /// The error's location in the description's file; line 1 if that file is missing.
    pub(super) fn locate(&self, problem: Problem) -> SceneError {
        let text = std::fs::read_to_string(&self.source).unwrap_or_default();
        locate_problem(&text, &self.source, problem)
    }
}

fn locate_problem(
    text: &str,
    path: &Path,
    Problem { field, problem, remedy }: Problem,
) -> SceneError {
    // A field with its default is not in the text: takes the nearest enclosing one that is.
    let values = locate::values(text);
    let mut sought = field.as_str();
    let start = loop {
        match values.iter().find(|value| value.field == sought) {
            Some(value) => break value.start,
            None if sought.is_empty() => break 0,
            None => sought = &sought[..sought.rfind(['.', '[']).unwrap_or(0)],
        }
    };
    let (line, column) = locate::line_and_column(text, start);
    SceneError::Invalid { file: path.to_path_buf(), line, column, field, problem, remedy }
}

/// Finds the field and the remedy of a ron error.
fn explain(text: &str, path: &Path, error: &SpannedError) -> SceneError {
    let position = match error.code {
        // Here ron has read past the wrong name.
        ron::Error::NoSuchStructField { .. } | ron::Error::NoSuchEnumVariant { .. } => {
            error.span.start
        }
        _ => error.span.end,
    };
    let (line, column) = (position.line, position.col);
    // ron reports a missing field at the bracket that ends its struct, which is not inside the
    // value before it.
    let with_end = !matches!(error.code, ron::Error::MissingStructField { .. });
    let around = locate::field_at(text, line, column, with_end);
    let (field, remedy) = match &error.code {
        ron::Error::NoSuchStructField { expected, found, .. } => {
            (found.clone(), known("fields", found, expected))
        }
        ron::Error::NoSuchEnumVariant { expected, found, .. } => {
            (around, known("names", found, expected))
        }
        ron::Error::MissingStructField { field, .. } => {
            let inside = if around.is_empty() { String::new() } else { format!("{around}.") };
            (format!("{inside}{field}"), format!("add {field}: …"))
        }
        ron::Error::DuplicateStructField { field, .. } => {
            ((*field).to_owned(), "give it once".to_owned())
        }
        _ => (around, "see the scene files that come with this for the form".to_owned()),
    };
    let problem = lower_first(&error.code.to_string());
    SceneError::Invalid { file: path.to_path_buf(), line, column, field, problem, remedy }
}

fn lower_first(sentence: &str) -> String {
    let mut characters = sentence.chars();
    characters
        .next()
        .map(|first| first.to_lowercase().chain(characters).collect())
        .unwrap_or_default()
}

fn known(what: &str, found: &str, expected: &[&str]) -> String {
    let guess = did_you_mean(found, expected.iter().copied());
    format!("{guess}known {what}: {}", expected.join(", "))
}

#[cfg(test)]
#[path = "load_tests.rs"]
mod tests;
