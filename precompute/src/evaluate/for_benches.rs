//! A recorded path, read back: benchmarks move an app along it and look its costs up.

use std::path::Path;

use frugal_core::frontier::FrontierMap;
use frugal_search::evaluate::PathRecord;
use frugal_search::journal::read_journal;

use super::plan_along;
use crate::scene::SceneDescription;

/// Power and error of a map's settings at every frame of the scene's path called `name`, as
/// `frugal evaluate --record` wrote them to `file`.
///
/// # Errors
/// In a sentence: the scene has no such path, or the file cannot be read or holds no complete run of the
/// path.
pub fn read_record(
    file: &Path,
    scene: &SceneDescription,
    name: &str,
    map: &FrontierMap,
) -> Result<PathRecord, String> {
    let path = scene.paths.get(name).ok_or_else(|| format!("the scene has no path `{name}`"))?;
    let fps = map.capture.frames_per_second;
    let plan = plan_along(name, path, fps)?;
    let (_, lines) = read_journal(file)
        .map_err(|error| format!("{error}; `frugal evaluate --record` writes such a file"))?;
    let record = PathRecord::restore(&plan, &map.knobs, &lines);
    if record.table.settings().is_empty() {
        return Err(format!(
            "{}: no complete run of `{name}` at {fps} frames per second",
            file.display()
        ));
    }
    Ok(record)
}
