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
fn a_changed_byte_loses_its_line_alone() {
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
            Ok((journal, records)) => {
                assert!(at >= header_end, "the header's damage is noticed");
                // A changed line break joins two lines; at the end it is a torn line.
                let is_torn = at + 1 == bytes.len();
                assert!((2..4).contains(&records.len()), "{at}: {records:?}");
                assert_eq!(journal.damaged(), usize::from(!is_torn), "{at}: and says so");
                let right = |record: &String| (0..4).any(|number| *record == format!("m {number}"));
                assert!(records.iter().all(right) && records.is_sorted(), "{at}: {records:?}");
            }
            Err(error) => assert!(
                at < header_end && error.to_string().contains("run.journal"),
                "{at}: {error}"
            ),
        }
    }
}

#[test]
fn other_runs_and_other_files_are_refused_with_a_reason_and_left_as_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let bytes = written(&path);
    for existing in [Existing::Resume, Existing::Refuse] {
        let refused = |header: JournalHeader| {
            Journal::open(&path, &header, existing).expect_err("opened").to_string()
        };
        let error = refused(header().with("seed", 4));
        assert!(error.contains("its seed is `3`, here it is `4`"), "{error}");
        let error = refused(header().with("adapter", "llvmpipe"));
        assert!(error.contains("its adapter is `nothing`, here it is `llvmpipe`"), "{error}");
    }
    // A field that the run lacks.
    let part = JournalHeader::default().with("seed", 3);
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
        let opened = Journal::open(&path, &header(), Existing::Refuse);
        assert!(matches!(opened, Err(JournalError::HasRecords { .. })), "{opened:?}");
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
    }
    drop(first);
    assert!(resumed(&path).is_ok());
}

#[test]
fn a_merge_adds_to_its_output_and_touches_nothing_else() {
    let folder = tempfile::tempdir().expect("a folder");
    let [a, b, whole, other] = ["a", "b", "whole", "other"].map(|name| folder.path().join(name));
    let mut running = fresh(&a);
    running.append("m 1").expect("room");
    running.append("m 3").expect("room");
    written(&b);
    let (both, of_b) = ([a.clone(), b.clone()], fs::read(&b).expect("the journal"));
    let read = |path: &Path| read_journal(path).expect("a journal").1;
    // A journal that is being written is read, and never written by anyone else.
    let twice = [both.to_vec(), both.to_vec()].concat();
    assert_eq!(merge_journals(&twice, &whole).expect("merges"), 3, "each record once");
    assert_eq!(read(&whole), ["m 1", "m 3", "m 2"]);
    assert!(matches!(merge_journals(&both, &a), Err(JournalError::InUse { .. })));
    running.append("m 4").expect("room");
    assert_eq!(merge_journals(&both, &whole).expect("merges again"), 4);
    assert_eq!(read(&whole), ["m 1", "m 3", "m 2", "m 4"]);
    assert_eq!((read(&a).len(), fs::read(&b).expect("it")), (3, of_b));
    // Over nothing else.
    fs::write(&other, "a letter to a friend\n").expect("can be written");
    let refused = merge_journals(&both, &other).expect_err("refused").to_string();
    assert!(refused.contains("is not a journal"), "{refused}");
    assert_eq!(fs::read(&other).expect("the letter"), b"a letter to a friend\n");
    // Nothing of another run, and nothing is written then.
    let (seed, header) = (other.with_extension("seed"), header().with("seed", 4));
    let (mut journal, _) = Journal::open(&seed, &header, Existing::Refuse).expect("one");
    journal.append("m 7").expect("room");
    let fresh = folder.path().join("fresh");
    let merged = merge_journals(&[a, seed], &fresh);
    assert!(matches!(merged, Err(JournalError::OtherRun { .. })), "{merged:?}");
    assert!(!fresh.exists());
}
