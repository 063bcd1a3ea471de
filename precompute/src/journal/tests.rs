//! A killed run, simulated at every byte of its journal.

use std::fs;

use super::*;

fn header() -> JournalHeader {
    JournalHeader::default().with("scene", "cornell 1f").with("seed", 3)
}

fn fresh(path: &Path) -> Journal {
    Journal::open(path, &header(), Existing::Refuse).expect("a fresh journal").0
}

fn resumed(path: &Path) -> Result<(Journal, Vec<String>), JournalError> {
    Journal::open(path, &header(), Existing::Resume)
}

/// A journal with two records.
fn written(path: &Path) -> Vec<u8> {
    let mut journal = fresh(path);
    for record in ["m 1", "m 2"] {
        journal.append(record).expect("room");
    }
    fs::read(path).expect("the journal")
}

#[test]
fn a_journal_cut_at_any_byte_keeps_every_whole_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let mut journal = fresh(&path);
    let records = ["m 1 2", "m 3 4", "pool 5"];
    let mut ends = vec![fs::metadata(&path).expect("a file").len()];
    for record in records {
        journal.append(record).expect("room");
        ends.push(fs::metadata(&path).expect("a file").len());
    }
    drop(journal);
    let bytes = fs::read(&path).expect("the journal");
    for end in 0..=bytes.len() {
        fs::write(&path, &bytes[..end]).expect("can be written");
        let (mut journal, found) = resumed(&path).expect("resumes anywhere");
        let whole = ends.iter().skip(1).filter(|whole| **whole <= end as u64).count();
        assert_eq!(found, records[..whole], "cut at {end}");
        for record in &records[whole..] {
            journal.append(record).expect("room");
        }
        drop(journal);
        assert_eq!(
            fs::read(&path).expect("the journal"),
            bytes,
            "cut at {end}: the journal is whole again"
        );
    }
}

#[test]
fn a_changed_byte_invalidates_the_rest() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let mut journal = fresh(&path);
    let header_end = fs::metadata(&path).expect("a file").len() as usize;
    (0..4).for_each(|number| journal.append(&format!("m {number}")).expect("room"));
    drop(journal);
    let bytes = fs::read(&path).expect("the journal");
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 4;
        fs::write(&path, &changed).expect("can be written");
        match resumed(&path) {
            Ok((_, records)) => {
                assert!(at >= header_end, "the header's damage is noticed");
                assert!(
                    records.len() < 4
                        && records
                            .iter()
                            .enumerate()
                            .all(|(number, record)| *record == format!("m {number}"))
                );
            }
            Err(error) => assert!(
                at < header_end && error.to_string().contains("run.journal"),
                "{at}: {error}"
            ),
        }
    }
    // A line that is missing breaks the chain as well.
    let text = String::from_utf8(bytes).expect("text");
    let without_second: String = text
        .split_inclusive('\n')
        .enumerate()
        .filter(|(number, _)| *number != 2)
        .map(|(_, line)| line)
        .collect();
    fs::write(&path, without_second).expect("can be written");
    let (journal, records) = resumed(&path).expect("resumes");
    assert_eq!((records, journal.damaged()), (vec!["m 0".to_owned()], 2), "and says so");
}

#[test]
fn other_runs_and_other_files_are_refused_with_a_reason_and_left_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let bytes = written(&path);
    for existing in [Existing::Resume, Existing::Refuse] {
        let refused = |header: JournalHeader| {
            let checked = Journal::check(&path, &header, existing).expect_err("checked");
            let opened = Journal::open(&path, &header, existing).expect_err("opened");
            assert_eq!(checked.to_string(), opened.to_string());
            opened.to_string()
        };
        let error = refused(header().with("seed", 4));
        assert!(error.contains("its seed is `3`, here it is `4`"), "{error}");
        let error = refused(header().with("adapter", "llvmpipe"));
        assert!(error.contains("its adapter is `nothing`, here it is `llvmpipe`"), "{error}");
    }
    // A field that is known later, and one that the run lacks.
    let part = JournalHeader::default().with("seed", 3);
    assert!(Journal::check(&path, &part, Existing::Resume).is_ok());
    assert!(matches!(
        Journal::open(&path, &part, Existing::Resume),
        Err(JournalError::OtherRun { field, .. }) if field == "scene"
    ));
    assert_eq!(fs::read(&path).expect("the journal"), bytes);
    fs::write(&path, "a letter to a friend\n").expect("can be written");
    for existing in [Existing::Resume, Existing::Refuse, Existing::Overwrite] {
        let refused = Journal::open(&path, &header(), existing);
        assert!(matches!(refused, Err(JournalError::NotAJournal { .. })), "{existing:?}");
    }
    assert_eq!(fs::read(&path).expect("the letter"), b"a letter to a friend\n");
    let missing = Journal::open(&folder.path().join("no/folder"), &header(), Existing::Refuse);
    assert!(missing.expect_err("no folder").to_string().contains("create its folder"));
}

#[test]
fn records_are_never_dropped_without_being_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let bytes = written(&path);
    let refused = || {
        let checked = Journal::check(&path, &header(), Existing::Refuse);
        let opened = Journal::open(&path, &header(), Existing::Refuse).map(|_| ());
        for result in [checked, opened] {
            assert!(matches!(result, Err(JournalError::HasRecords { .. })), "{result:?}");
        }
    };
    refused();
    assert_eq!(fs::read(&path).expect("the journal"), bytes);
    // Damage in the first record hides all of them, and is no reason to drop them.
    let at = bytes.iter().position(|byte| *byte == b'\n').expect("a header") + 3;
    let mut damaged = bytes.clone();
    damaged[at] ^= 1;
    fs::write(&path, &damaged).expect("can be written");
    refused();
    assert_eq!(fs::read(&path).expect("the journal"), damaged);
    // Asked for, also where the run is another, or the first line is damaged.
    for begin in [&bytes, &damaged, &[&b"frugal-journal 1 {}\n"[..], &bytes[at..]].concat()] {
        fs::write(&path, begin).expect("can be written");
        let other = header().with("seed", 9);
        let (_, records) = Journal::open(&path, &other, Existing::Overwrite).expect("begins anew");
        assert_eq!(records, [""; 0]);
        assert_eq!(fs::read_to_string(&path).expect("it").lines().count(), 1);
    }
}

#[test]
fn a_journal_without_records_is_taken_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let bytes = written(&path);
    let first = bytes.iter().position(|byte| *byte == b'\n').expect("a header") + 1;
    let torn = [&b""[..], b"fru", &bytes[..first - 1], &bytes[..first], &bytes[..first + 4]];
    // After a power cut the end of a file may be zeros.
    let zeros = [&bytes[..first / 2], &[0; 700]].concat();
    for begin in torn.into_iter().chain([&zeros[..], &[0; 9]]) {
        for existing in [Existing::Resume, Existing::Refuse, Existing::Overwrite] {
            fs::write(&path, begin).expect("can be written");
            let other = header().with("seed", 9);
            let opened = Journal::open(&path, &other, existing);
            assert_eq!(opened.expect("nothing is lost").1, [""; 0], "{existing:?}: {begin:?}");
        }
    }
}

#[test]
fn two_runs_never_share_a_journal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let first = fresh(&path);
    for existing in [Existing::Resume, Existing::Refuse, Existing::Overwrite] {
        let second = Journal::open(&path, &header(), existing);
        assert!(matches!(second, Err(JournalError::InUse { .. })));
        let second = Journal::check(&path, &header(), existing);
        assert!(matches!(second, Err(JournalError::InUse { .. })));
    }
    drop(first);
    assert!(resumed(&path).is_ok());
}

#[test]
fn a_merge_takes_no_journal_that_is_being_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b, whole, other] = ["a", "b", "whole", "other"].map(|name| folder.path().join(name));
    let mut running = fresh(&a);
    running.append("m 1").expect("room");
    written(&b);
    let both = [a.clone(), b.clone()];
    for output in [None, Some(&*whole), Some(&*a)] {
        let merged = merge_journals(&both, output);
        assert!(matches!(merged, Err(JournalError::InUse { .. })), "{merged:?}");
        let merged = merge_journals(&both[1..], Some(&*a));
        assert!(matches!(merged, Err(JournalError::InUse { .. })), "{merged:?}");
    }
    assert!(!whole.exists());
    // The shard goes on, and loses nothing.
    running.append("m 3").expect("room");
    drop(running);
    let read = |path: &Path| read_journal(path).expect("a journal").1;
    let (count, outputs) =
        merge_journals(&[both.to_vec(), both.to_vec()].concat(), None).expect("merges");
    assert_eq!((count, &outputs[..]), (3, &both[..]), "a file given twice counts once");
    assert_eq!([read(&a), read(&b)], [["m 1", "m 3", "m 2"]; 2]);
    // Into a third, over itself, but over nothing else.
    assert_eq!(merge_journals(&both, Some(&whole)).expect("merges").0, 3);
    assert_eq!(merge_journals(&[a.clone(), whole.clone()], Some(&whole)).expect("merges").0, 3);
    let over = |path: &Path| merge_journals(&both, Some(path)).expect_err("refused").to_string();
    assert!(over(&whole).contains("holds 3 records"), "{}", over(&whole));
    fs::write(&other, "a letter to a friend\n").expect("can be written");
    assert!(over(&other).contains("is not a journal"), "{}", over(&other));
    assert_eq!(fs::read(&other).expect("the letter"), b"a letter to a friend\n");
    // Nothing of another run, and nothing is written then.
    let seed = header().with("seed", 4);
    let (mut journal, _) =
        Journal::open(&other.with_extension("seed"), &seed, Existing::Refuse).expect("one");
    journal.append("m 7").expect("room");
    drop(journal);
    let merged = merge_journals(&[a.clone(), other.with_extension("seed")], None);
    assert!(matches!(merged, Err(JournalError::OtherRun { .. })), "{merged:?}");
    assert_eq!(read(&a), ["m 1", "m 3", "m 2"]);
}

/// A run opened the file before a merge replaced it, and locks it after: it must not write to a file that
/// has no name any more.
#[cfg(unix)]
#[test]
fn a_file_that_was_replaced_is_opened_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    written(&path);
    let held = OpenOptions::new().read(true).write(true).open(&path).expect("opens");
    assert!(contents::is_at(&held, &path));
    merge_journals(std::slice::from_ref(&path), None).expect("merges");
    assert!(!contents::is_at(&held, &path));
    let (mut journal, records) = resumed(&path).expect("resumes");
    journal.append("m 3").expect("room");
    assert_eq!(records.len(), 2);
    assert_eq!(read_journal(&path).expect("a journal").1.len(), 3);
}
