//! Tests of written files, of their state after errors, and of what is read again.

use std::fs;
use std::sync::mpsc::channel;

use proptest::prelude::*;
use serde::Deserialize;

use super::*;

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Note {
    time_s: f64,
    size: Option<f32>,
    number: u32,
    text: String,
}

impl Row for Note {
    const PLUGIN: &'static str = "NotePlugin";
    const PREAMBLE: &'static str = "notes 1\n";

    fn validated(self) -> Result<Self, String> {
        if self.time_s.is_finite() { Ok(self) } else { Err("`time_s` is not finite".into()) }
    }
}

const HEADER: &str = "notes 1\ntime_s,size,number,text\n";

fn note(time_s: f64) -> Note {
    Note { time_s, size: Some(0.1), number: 3, text: "a \"fine\" day, \u{e9}".into() }
}

/// Writes these rows as one run of an app does.
fn run(path: &Path, most: usize, rows: &[Note]) -> Result<(), End> {
    let (sender, receiver) = channel();
    rows.iter().for_each(|row| sender.send(row.clone()).expect("a receiver"));
    drop(sender);
    append(&mut open::<Note>(path)?, most, &receiver)
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).expect("a file")
}

/// A disk with room for a given number of bytes.
struct SmallDisk(Vec<u8>, usize);

impl Write for SmallDisk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let room = (self.1 - self.0.len()).min(bytes.len());
        self.0.extend(&bytes[..room]);
        if room == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(room) }
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_log_reads_back_as_it_was_written() {
    let rows = [note(0.25), Note::default()];
    let text = rows_to_text(&rows);
    assert_eq!(text, format!("{HEADER}0.25,0.1,3,\"a \"\"fine\"\" day, \u{e9}\"\n0.0,,0,\n"));
    assert_eq!(read_rows(&text), Ok(rows.to_vec()));
    assert_eq!(read_rows(&rows_to_text::<Note>(&[])), Ok(Vec::<Note>::new()));
    let edited = format!("\u{feff}{}\n\n", text.replace('\n', "\r\n").replace("0.1,3", " 0.1 , 3"));
    assert_eq!(read_rows(&edited), Ok(rows.to_vec()));
    // Truncated anywhere: only the last line is lost.
    for end in (1..text.len()).filter(|end| text.is_char_boundary(*end)) {
        let read = read_rows::<Note>(&text[..end]).expect("a log");
        assert!(read.len() < 2 && read[..] == rows[..read.len()], "{end}");
    }
}

#[test]
fn errors_name_line_field_and_remedy() {
    let message = |text: &str| read_rows::<Note>(text).expect_err(text).to_string();
    let of_row = |row: &str| message(&format!("{}{row}\n", rows_to_text(&[note(0.0)])));
    let remedy = ": correct the line, or remove it";
    assert_eq!(of_row("1.0,2"), format!("line 4: 2 fields instead of 4{remedy}"));
    assert_eq!(of_row("inf,,0,a"), format!("line 4: `time_s` is not finite{remedy}"));
    for (row, expected) in [
        ("zero,,0,a", "line 4: `time_s` is `zero`: "),
        ("0,large,0,a", "line 4: `size` is `large`: "),
        ("0,,-1,a", "line 4: `number` is `-1`: "),
        ("0,,,a", "line 4: `number` is ``: "),
    ] {
        let message = of_row(row);
        assert!(message.starts_with(expected) && message.ends_with(remedy), "{message}");
    }
    for (text, found) in [
        ("", "line 1: `` instead of `notes 1`"),
        ("\n", "line 1: ``"),
        ("notes 2\nanything", "line 1: `notes 2`"),
        ("notes 1\ntime_s,camera\n", "line 2: `time_s,camera`"),
    ] {
        let message = message(text);
        assert!(message.starts_with(found) && message.contains("NotePlugin"), "{message}");
    }
    assert!(
        message(&"\u{e4}".repeat(1000)).starts_with(&format!("line 1: `{}`", "\u{e4}".repeat(60)))
    );
}

#[test]
fn later_runs_append_and_a_truncated_file_is_repaired() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("new/folders/notes.csv");
    run(&path, 9, &[]).expect("an empty log");
    assert_eq!(read(&path), HEADER);
    run(&path, 9, &[note(0.0), note(0.5)]).expect("a log");
    run(&path, 9, &[note(0.0)]).expect("a log");
    let whole = rows_to_text(&[note(0.0), note(0.5), note(0.0)]);
    assert_eq!(read(&path), whole);
    for end in 0..whole.len() {
        fs::write(&path, &whole.as_bytes()[..end]).expect("a truncated file");
        run(&path, 9, &[note(7.0)]).expect("a log");
        let rows = read_rows::<Note>(&read(&path)).expect("a log");
        assert!(rows.len() <= 3 && rows.last() == Some(&note(7.0)), "truncated at {end}");
    }
    // Saved by an editor, with other line ends.
    for (text, count) in [("\u{feff}notes 1\r\n".to_owned(), 1), (whole.replace('\n', "\r\n"), 4)] {
        fs::write(&path, text).expect("a file");
        run(&path, 9, &[note(7.0)]).expect("a log");
        assert_eq!(read_rows::<Note>(&read(&path)).map(|rows| rows.len()), Ok(count));
    }
}

#[test]
fn a_file_that_is_not_a_log_is_unchanged() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("Cargo.toml");
    let binary: Vec<u8> = (0..=255).cycle().take(10_000).collect();
    for bytes in
        [&b"[package]\nname = \"game\"\n"[..], b"notes 2\n", "\u{1f600}".as_bytes(), b"\n", &binary]
    {
        fs::write(&path, bytes).expect("a file");
        let end = run(&path, 9, &[note(0.0)]).expect_err("not a log");
        assert!(matches!(end, End::OtherFile), "{end}");
        assert!(end.to_string().contains("name another file"), "{end}");
        assert_eq!(fs::read(&path).expect("a file"), bytes);
    }
}

#[test]
fn paths_that_cannot_be_written_give_a_reason() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("file");
    fs::write(&file, "a file, and no folder").expect("a file");
    let folder = folder.path().to_owned();
    for path in [file.join("notes.csv"), file.join("deep/notes.csv"), folder, PathBuf::new()] {
        let end = run(&path, 9, &[note(0.0)]).expect_err("no log");
        assert!(matches!(end, End::Open(_)), "{}: {end}", path.display());
        assert!(end.to_string().contains("name a file in a folder"), "{end}");
    }
    #[cfg(unix)]
    assert!(matches!(run(Path::new("/dev/null"), 9, &[note(0.0)]), Err(End::OtherFile)));
}

#[test]
fn a_run_has_a_maximum() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notes.csv");
    let rows: Vec<Note> = (0..5).map(|time| note(time.into())).collect();
    let end = run(&path, 3, &rows).expect_err("full").to_string();
    assert!(end.contains("raise NotePlugin::max_samples"), "{end}");
    assert_eq!(read(&path), rows_to_text(&rows[..3]));
    assert!(matches!(run(&path, 0, &rows), Err(End::Full(_))));
    assert_eq!(read(&path), rows_to_text(&rows[..3]));
}

#[test]
fn a_full_disk_loses_only_the_rest() {
    let rows: Vec<Note> =
        (0..5).map(|time| Note { text: "met".into(), ..note(time.into()) }).collect();
    let whole = rows_to_text(&rows);
    for room in HEADER.len() + 1..whole.len() {
        let mut disk = SmallDisk(HEADER.into(), room);
        let (sender, receiver) = channel();
        rows.iter().for_each(|row| sender.send(row.clone()).expect("a receiver"));
        let end = append(&mut disk, 100, &receiver).expect_err("a full disk");
        assert!(end.to_string().contains("make room"), "{end}");
        let written = String::from_utf8(disk.0).expect("text");
        assert_eq!(written, whole[..room]);
        assert!(read_rows::<Note>(&written).is_ok());
    }
}

#[test]
fn everything_is_written_when_the_log_is_dropped() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("notes.csv");
    let rows: Vec<Note> = (0..1000).map(|time| note(time.into())).collect();
    let mut log = RowLog::start(&path, 10_000);
    assert!(log.is_running());
    rows.iter().for_each(|row| assert!(log.push(row.clone())));
    drop(log);
    assert_eq!(read(&path), rows_to_text(&rows));
}

proptest! {
    #[test]
    fn any_text_in_a_field_survives(text in "[^\r\n]{0,40}", time_s in prop::num::f64::NORMAL) {
        let row = Note { text: text.trim().to_owned(), ..note(time_s) };
        prop_assert_eq!(read_rows(&rows_to_text([&row])), Ok(vec![row.clone()]));
    }

    #[test]
    fn no_text_panics(text in "\\PC{0,300}", line in "[-0-9.e,naif\"]{0,60}") {
        let _ = read_rows::<Note>(&text);
        let _ = read_rows::<Note>(&format!("{HEADER}{line}\n{text}\n"));
    }
}
