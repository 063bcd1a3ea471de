//! A killed run, simulated at every byte of its journal.

use std::fs;

use super::*;

fn header() -> JournalHeader {
    JournalHeader::default().with("scene", "cornell 1f").with("seed", 3)
}

#[test]
fn a_journal_cut_at_any_byte_keeps_every_whole_record() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let mut journal = Journal::create(&path, &header()).expect("a fresh journal");
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
        let (mut journal, found) = Journal::resume(&path, &header()).expect("resumes anywhere");
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
    let mut journal = Journal::create(&path, &header()).expect("a fresh journal");
    let header_end = fs::metadata(&path).expect("a file").len() as usize;
    (0..4).for_each(|number| journal.append(&format!("m {number}")).expect("room"));
    drop(journal);
    let bytes = fs::read(&path).expect("the journal");
    for at in 0..bytes.len() {
        let mut changed = bytes.clone();
        changed[at] ^= 4;
        fs::write(&path, &changed).expect("can be written");
        match Journal::resume(&path, &header()) {
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
    assert_eq!(Journal::resume(&path, &header()).expect("resumes").1, ["m 0"]);
}

#[test]
fn other_runs_and_other_files_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    drop(Journal::create(&path, &header()).expect("a fresh journal"));
    let error =
        Journal::resume(&path, &header().with("seed", 4)).expect_err("another seed").to_string();
    assert!(error.contains("its seed is `3`, here it is `4`"), "{error}");
    let error = Journal::resume(&path, &header().with("adapter", "llvmpipe"))
        .expect_err("another adapter")
        .to_string();
    assert!(error.contains("its adapter is `nothing`"), "{error}");
    fs::write(&path, "a letter to a friend\n").expect("can be written");
    assert!(matches!(Journal::resume(&path, &header()), Err(JournalError::NotAJournal { .. })));
    assert!(matches!(
        Journal::create(&folder.path().join("no/folder"), &header()),
        Err(JournalError::File { action: "open", .. })
    ));
}

#[test]
fn two_runs_never_share_a_journal() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.journal");
    let first = Journal::create(&path, &header()).expect("a fresh journal");
    assert!(matches!(Journal::resume(&path, &header()), Err(JournalError::InUse { .. })));
    drop(first);
    assert!(Journal::resume(&path, &header()).is_ok());
}
