//! Appends samples to the log on a thread of its own.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use bevy::log::{error, warn};

use super::ControlSample;
use super::file::{header, push_line};
use crate::file_thread::{FileThread, open_or_create};

/// The thread that writes samples.
pub(super) type ControlWriter = FileThread<ControlSample>;

/// Appends to the file at `path` until this run has written `max_samples`. A file error is logged
/// once.
///
/// # Errors
///
/// The thread cannot be created.
pub(super) fn start(path: PathBuf, max_samples: usize) -> io::Result<ControlWriter> {
    let file = path.clone();
    FileThread::start("control log", path, move |samples| {
        let result = open(&file).and_then(|mut file| append(&mut file, max_samples, samples));
        match result {
            Ok(()) => {}
            Err(stop @ Stop::Full(_)) => warn!("the control log {} ends: {stop}", file.display()),
            Err(stop) => error!("the control log {} is not written: {stop}", file.display()),
        }
    })
}

/// Why the thread stops before the app ends.
#[derive(Debug, thiserror::Error)]
enum Stop {
    #[error("{0}: name a file in a folder in which the app may write")]
    Open(io::Error),
    #[error("it is not a control log of this version: name another file, or move this one away")]
    OtherFile,
    #[error("{0}: the lines up to now are saved; make room on the disk, and start the app again")]
    Write(io::Error),
    #[error("this run has {0} lines, its maximum: raise ControlLogPlugin::max_samples for more")]
    Full(usize),
}

/// Opens or creates the log, and removes a truncated last line. Never changes a file that is not a
/// log.
fn open(path: &Path) -> Result<File, Stop> {
    let mut file = open_or_create(path).map_err(Stop::Open)?;
    if !file.metadata().map_err(Stop::Open)?.is_file() {
        return Err(Stop::OtherFile);
    }
    let header = header();
    let mut start = Vec::new();
    // Only the header's length: the file may be a large one of another kind.
    (&mut file).take(header.len() as u64).read_to_end(&mut start).map_err(Stop::Open)?;
    if !header.as_bytes().starts_with(&start) {
        return Err(Stop::OtherFile);
    }
    let whole = if start.len() < header.len() { 0 } else { whole_lines(&mut file)? };
    file.set_len(whole).and_then(|()| file.seek(SeekFrom::End(0))).map_err(Stop::Write)?;
    if whole == 0 {
        file.write_all(header.as_bytes()).map_err(Stop::Write)?;
    }
    Ok(file)
}

/// Length of the file up to its last line end.
fn whole_lines(file: &mut File) -> Result<u64, Stop> {
    let mut end = file.seek(SeekFrom::End(0)).map_err(Stop::Open)?;
    let mut block = [0; 4096];
    while end > 0 {
        let length = end.min(block.len() as u64);
        file.seek(SeekFrom::Start(end - length)).map_err(Stop::Open)?;
        let block = &mut block[..length as usize];
        file.read_exact(block).map_err(Stop::Open)?;
        if let Some(last) = block.iter().rposition(|byte| *byte == b'\n') {
            return Ok(end - length + last as u64 + 1);
        }
        end -= length;
    }
    Ok(0)
}

/// Writes samples as they arrive, until the sender is dropped.
fn append(
    out: &mut impl Write,
    most: usize,
    samples: &Receiver<ControlSample>,
) -> Result<(), Stop> {
    let (mut count, mut text) = (0, String::new());
    while count < most {
        let Ok(first) = samples.recv() else { return Ok(()) };
        text.clear();
        for sample in std::iter::once(first).chain(samples.try_iter()).take(most - count) {
            push_line(&mut text, &sample);
            count += 1;
        }
        // Whole lines at once: if the app crashes, the operating system already has them.
        out.write_all(text.as_bytes()).map_err(Stop::Write)?;
    }
    Err(Stop::Full(count))
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;
    use crate::control_log::{parse, to_text};
    use crate::recording::testing::{TestFolder, read};

    fn sample(time_s: f64) -> ControlSample {
        ControlSample { time_s, status: "met".into(), ..ControlSample::default() }
    }

    /// Writes these samples as one run of an app does.
    fn run(path: &Path, most: usize, times: &[f64]) -> Result<(), Stop> {
        let (sender, receiver) = channel();
        times.iter().for_each(|time| sender.send(sample(*time)).expect("a receiver"));
        drop(sender);
        append(&mut open(path)?, most, &receiver)
    }

    #[test]
    fn later_runs_append_and_a_truncated_line_is_removed() {
        let folder = TestFolder::new();
        let path = folder.file("new/folder/control.csv");
        run(&path, 9, &[0.0, 0.5]).expect("a log");
        run(&path, 9, &[0.0]).expect("a log");
        let whole = to_text(&[0.0, 0.5, 0.0].map(sample));
        assert_eq!(read(&path), whole);
        for end in 0..whole.len() {
            std::fs::write(&path, &whole[..end]).expect("a truncated file");
            run(&path, 9, &[7.0]).expect("a log");
            let read = parse(&read(&path)).expect("a log");
            assert_eq!(read.last(), Some(&sample(7.0)), "truncated at {end}");
            assert!(read.len() <= 3);
        }
    }

    #[test]
    fn a_run_has_a_maximum_and_other_files_stay_as_they_are() {
        let folder = TestFolder::new();
        let path = folder.file("control.csv");
        assert!(matches!(run(&path, 2, &[0.0, 1.0, 2.0]), Err(Stop::Full(2))));
        assert_eq!(parse(&read(&path)).expect("a log").len(), 2);
        let other = folder.file("thesis.txt");
        std::fs::write(&other, "time_s,camera\n1,2\n").expect("a file");
        assert!(matches!(run(&other, 9, &[0.0]), Err(Stop::OtherFile)));
        assert_eq!(read(&other), "time_s,camera\n1,2\n");
        let folder = other.parent().expect("a folder").to_owned();
        assert!(matches!(run(&folder, 9, &[0.0]), Err(Stop::Open(_) | Stop::OtherFile)));
    }
}
