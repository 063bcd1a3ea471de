//! Journals of renderings: their names and headers, and opening them.

use std::path::{Path, PathBuf};

use bevy_frugal_gi::frontier::{Capture, SceneIdentity};
use bevy_frugal_gi::knobs::KnobSpace;
use bevy_frugal_gi::power::MeterInfo;

use super::super::CliError;
use crate::journal::{Journal, JournalHeader, hash};
use crate::stage::adapter;

/// The journal beside the map; each shard has its own.
pub(in crate::cli) fn journal_path(map: &Path, shard: Option<(usize, usize)>) -> PathBuf {
    let mut path = map.as_os_str().to_owned();
    if let Some((index, count)) = shard.filter(|(_, count)| *count > 1) {
        path.push(format!(".{index}-of-{count}"));
    }
    path.push(".journal");
    path.into()
}

/// Header of journals of renderings: identifies scene and conditions.
pub(in crate::cli) fn journal_header(
    scene: &SceneIdentity,
    space: &KnobSpace,
    capture: &Capture,
    meter: &MeterInfo,
) -> Result<JournalHeader, CliError> {
    let knobs = serde_json::to_string(space).map_err(CliError::failed)?;
    let adapter = adapter().map_or_else(|| "none".to_owned(), |adapter| adapter.name);
    Ok(JournalHeader::default()
        .with("scene", &scene.fingerprint)
        .with("knobs", format!("{:016x}", hash(&knobs)))
        .with("capture", format!("{capture:?}"))
        .with("meter", format!("{}: {}", meter.name, meter.description))
        .with("adapter", adapter))
}

/// The journal, and the records of an earlier run that is resumed.
pub(in crate::cli) fn open_journal(
    path: &Path,
    header: &JournalHeader,
    resume: bool,
) -> Result<(Journal, Vec<String>), CliError> {
    let opened = if resume {
        Journal::resume(path, header)
    } else {
        Journal::create(path, header).map(|journal| (journal, Vec::new()))
    };
    let journal = opened.map_err(CliError::usage)?;
    if resume {
        eprintln!("resuming after {} records", journal.1.len());
    }
    Ok(journal)
}
