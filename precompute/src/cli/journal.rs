//! Journals of commands: their names and headers, opening them, and advice on those that are there.

use std::path::{Path, PathBuf};

use frugal_core::frontier::{Capture, SceneIdentity};
use frugal_core::knobs::KnobSpace;
use frugal_core::power::MeterInfo;
use frugal_search::journal::{Existing, Journal, JournalError, JournalHeader, hash, records_of};
use frugal_search::pipeline::PipelineError;

use super::CliError;
use crate::device;
use crate::stage::adapter;
use crate::work_meter::is_work_meter;

/// What to do with the journal of an earlier run.
#[derive(clap::Args, Debug, Clone, Copy)]
pub(super) struct JournalArguments {
    /// Continue an interrupted run from its journal
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// Begin anew, and drop the journal of an earlier run
    #[arg(long)]
    overwrite: bool,
}

impl JournalArguments {
    pub(super) fn existing(self) -> Existing {
        match self {
            Self { resume: true, .. } => Existing::Resume,
            Self { overwrite: true, .. } => Existing::Overwrite,
            _ => Existing::Refuse,
        }
    }
}

/// A command with a journal. All advice on journals is made here, so that none names an option that the
/// command lacks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum JournalUse {
    /// Has `--resume` and `--overwrite`.
    Precompute,
    /// Goes on by itself, and has `--overwrite`.
    Evaluate,
}

impl JournalUse {
    /// The user stopped the run.
    fn interrupted(self) -> CliError {
        CliError::failed(format!("interrupted: {}", self.going_on()))
    }

    /// Why a run ended before its end.
    pub(super) fn ended(self, error: PipelineError) -> CliError {
        match error {
            PipelineError::Interrupted => self.interrupted(),
            PipelineError::Journal(error) => self.failed(&error),
            PipelineError::NeedsOthers => self.needs_others(),
            error => CliError::failed(error),
        }
    }

    /// A fault of a journal that was to be opened: nothing was touched.
    pub(super) fn refused(self, error: &JournalError) -> CliError {
        CliError::usage(self.with_advice(error))
    }

    /// A journal that can no longer be written.
    fn failed(self, error: &JournalError) -> CliError {
        CliError::failed(format!("{error}; then {}", self.going_on()))
    }

    /// This shard has rendered its share.
    fn needs_others(self) -> CliError {
        let again = self.going_on();
        CliError::failed(format!(
            "this shard's share is rendered: once the other shards' journals, or what `frugal merge` made of them, are beside the map, {again}"
        ))
    }

    fn going_on(self) -> &'static str {
        match self {
            Self::Precompute => "the same command with --resume continues",
            Self::Evaluate => "the same command continues",
        }
    }

    fn with_advice(self, error: &JournalError) -> String {
        let is_precompute = self == Self::Precompute;
        let first = match error {
            JournalError::HasRecords { .. } => {
                is_precompute.then(|| "add --resume to continue it".to_owned())
            }
            JournalError::OtherRun { field, .. } => {
                let resume = if is_precompute { " and --resume" } else { "" };
                Some(format!("run with that {field}{resume}"))
            }
            JournalError::NotAJournal { .. } => Some("move it away".to_owned()),
            JournalError::InUse { .. } => Some("wait until that has ended".to_owned()),
            JournalError::File(_) => return error.to_string(),
        };
        let is_earlier =
            matches!(error, JournalError::HasRecords { .. } | JournalError::OtherRun { .. });
        let anew = is_earlier.then(|| "add --overwrite to drop it and begin anew".to_owned());
        let place = if is_precompute { "--output" } else { "--record" };
        let ways = [first, anew, Some(format!("give another {place}"))];
        format!("{error}: {}", ways.into_iter().flatten().collect::<Vec<_>>().join(", or "))
    }
}

/// The journal beside the map; each shard has its own.
pub(super) fn journal_path(map: &Path, shard: Option<(usize, usize)>) -> PathBuf {
    let mut path = map.as_os_str().to_owned();
    if let Some((index, count)) = shard.filter(|(_, count)| *count > 1) {
        path.push(format!(".{index}-of-{count}"));
    }
    path.push(".journal");
    path.into()
}

/// Journals beside the map but its run's `own`: of other shards, and of the whole.
pub(super) fn other_journals(map: &Path, own: &Path) -> Vec<PathBuf> {
    let folder = map.parent().filter(|folder| !folder.as_os_str().is_empty());
    let entries = std::fs::read_dir(folder.unwrap_or(Path::new("."))).into_iter().flatten();
    let name = map.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_of_map = |path: &PathBuf| {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        whole_journal(&file).is_some_and(|whole| whole == format!("{name}.journal"))
            && path.file_name() != own.file_name()
    };
    let mut found: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(is_of_map).collect();
    found.sort();
    found
}

/// The name of the whole run's journal from that of a shard's or its own.
pub(super) fn whole_journal(name: &str) -> Option<String> {
    let stem = name.strip_suffix(".journal")?;
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let of_shard = stem.rsplit_once('.').filter(|(_, shard)| {
        shard.split_once("-of-").is_some_and(|(index, count)| is_number(index) && is_number(count))
    });
    Some(format!("{}.journal", of_shard.map_or(stem, |(map, _)| map)))
}

/// What tells apart runs whose records do not mix: renderer, scene, images, knobs, and what is read.
/// `content`: a hash of the scene's files, as far as they are known. Counted work is the same on every
/// machine; all other watts are of one device.
pub(super) fn journal_header(
    scene: &SceneIdentity,
    content: Option<String>,
    capture: &Capture,
    space: &KnobSpace,
    meter: &MeterInfo,
) -> Result<JournalHeader, CliError> {
    let [width, height] = capture.size;
    let names: Vec<_> = space.knobs().iter().map(|knob| knob.name.as_str()).collect();
    let levels = serde_json::to_string(space).map_err(CliError::failed)?;
    let header = JournalHeader::default()
        .with("version of frugal", env!("CARGO_PKG_VERSION"))
        .with("scene", &scene.fingerprint)
        .with("content of files", content.unwrap_or_else(|| "unknown".to_owned()))
        .with("size", format!("{width}x{height}"))
        .with("frame rate", capture.frames_per_second)
        .with("field of view", capture.vertical_fov)
        .with("exposure", capture.exposure_ev100)
        .with("list of knobs", names.join(","))
        .with("set of levels", format!("{:016x}", hash(&levels)))
        .with("meter", device::kind(&meter.name));
    let header = if is_work_meter(&meter.name).is_some() {
        header
    } else {
        let adapter = adapter().map_or_else(|| "none".to_owned(), |adapter| adapter.name);
        header.with("processor", device::processor()).with("adapter", adapter)
    };
    Ok(header.with("metered device", device::stable_device(meter)))
}

/// The journal, and the records of an earlier run that is continued, with those of `others`.
pub(super) fn open_journal(
    path: &Path,
    header: &JournalHeader,
    existing: Existing,
    of: JournalUse,
    others: &[PathBuf],
) -> Result<(Journal, Vec<String>), CliError> {
    let (journal, mut records) =
        Journal::open(path, header, existing).map_err(|error| of.refused(&error))?;
    for other in others.iter().filter(|_| existing == Existing::Resume) {
        match records_of(other, header) {
            Ok(more) => records.extend(more),
            Err(error) => eprintln!("not read: {error}"),
        }
    }
    if !records.is_empty() {
        eprintln!("resuming after {} records", records.len());
    }
    if journal.damaged() > 0 {
        eprintln!(
            "{}: {} damaged lines are left out, and made anew",
            path.display(),
            journal.damaged()
        );
    }
    Ok((journal, records))
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use frugal_core::power::Provenance;
    use frugal_search::files::FileError;

    use super::*;

    fn header(name: &str, description: &str) -> JournalHeader {
        let meter = MeterInfo {
            name: name.to_owned(),
            provenance: Provenance::Measured,
            description: description.to_owned(),
        };
        let space = crate::stage::built_in_knobs(false);
        let map = frugal_core::testing::map(0);
        let content = Some("00ff".to_owned());
        journal_header(&map.scene, content, &map.capture, &space, &meter).expect("a header")
    }

    #[test]
    fn a_renumbered_card_resumes_and_another_processor_only_where_work_is_counted() {
        // Another version or changed files never do.
        let card = "whole card or APU 0000:04:00.0 (card1, PPT), power1_average of its driver";
        assert_eq!(header("amdgpu", card), header("amdgpu", &card.replace("card1", "card0")));
        assert_ne!(header("amdgpu", card), header("amdgpu", &card.replace("04:", "0b:")));
        let folder = tempfile::tempdir().expect("a folder");
        for (name, field) in [
            ("cpu-time", "processor"),
            ("rapl", "processor"),
            ("rapl", "adapter"),
            ("work", "version of frugal"),
            ("work", "content of files"),
        ] {
            let here = header(name, "a counter");
            let file = folder.path().join(field);
            let there = here.clone().with(field, "PDP-11");
            let (mut journal, _) =
                Journal::open(&file, &there, Existing::Overwrite).expect("a journal");
            journal.append("m 1").expect("room");
            drop(journal);
            let open = |existing| open_journal(&file, &here, existing, JournalUse::Evaluate, &[]);
            let error = open(Existing::Resume).expect_err("another run").to_string();
            assert!(error.contains(&format!("its {field} is `PDP-11`, here it is ")), "{error}");
            assert!(error.contains("add --overwrite"), "{error}");
            assert!(open(Existing::Overwrite).expect("a journal").1.is_empty(), "{field}");
        }
        let work = format!("{:?}", header("work", "work of each frame at the prices of a device"));
        assert!(!work.contains("processor") && !work.contains("adapter"), "{work}");
    }

    #[test]
    fn the_journals_of_a_map_s_shards_are_found() {
        let folder = tempfile::tempdir().expect("a folder");
        let ours = ["a.ron.0-of-4.journal", "a.ron.3-of-4.journal", "a.ron.journal"];
        for name in ["a.ron", "b.ron.1-of-4.journal", "a.ron.x-of-4.journal"].iter().chain(&ours) {
            std::fs::write(folder.path().join(name), "").expect("can be written");
        }
        let [map, own] = ["a.ron", "a.ron.3-of-4.journal"].map(|name| folder.path().join(name));
        let found = other_journals(&map, &own);
        assert_eq!(found, [ours[0], ours[2]].map(|name| folder.path().join(name)));
        assert_eq!(whole_journal(ours[1]).as_deref(), Some("a.ron.journal"));
        assert_eq!(whole_journal("a.scene.ron"), None);
    }

    #[test]
    fn no_advice_names_an_option_that_its_command_lacks() {
        let (path, text) = (|| PathBuf::from("a.journal"), || "seed".to_owned());
        let full = std::io::ErrorKind::StorageFull.into();
        let errors = [
            JournalError::File(FileError::new("write", Path::new("a.journal"), full)),
            JournalError::NotAJournal { path: path() },
            JournalError::HasRecords { path: path(), records: 3 },
            JournalError::OtherRun { path: path(), field: text(), found: text(), expected: text() },
            JournalError::InUse { path: path() },
        ];
        for (of, name) in
            [(JournalUse::Precompute, "precompute"), (JournalUse::Evaluate, "evaluate")]
        {
            let mut said: Vec<String> =
                errors.iter().map(|error| of.refused(error).to_string()).collect();
            said.extend(errors.iter().map(|error| of.failed(error).to_string()));
            said.extend([of.interrupted().to_string(), of.needs_others().to_string()]);
            crate::cli::tests::assert_options_of(name, &said);
            // And every option that goes on or begins anew is named somewhere.
            let cli = crate::cli::Cli::command();
            let command = cli.find_subcommand(name).expect("a command");
            for option in ["resume", "overwrite"] {
                let is_there = command.get_arguments().any(|it| it.get_long() == Some(option));
                let is_named = said.iter().any(|text| text.contains(&format!("--{option}")));
                assert_eq!(is_there, is_named, "{name}: --{option}");
            }
        }
    }
}
