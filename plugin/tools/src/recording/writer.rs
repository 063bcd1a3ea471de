//! Appends samples to a file on a thread of its own, so that no frame waits for the disk.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;

use bevy::log::{error, warn};

use super::file::{NAME, header, parse, push_line};
use super::{CameraFileError, CameraSample};
use crate::file_thread::{FileThread, open_or_create};

/// The thread that writes samples.
pub(super) type CameraWriter = FileThread<CameraSample>;

/// Appends to the file at `path` until it has `max_samples` samples. A file error is logged once.
///
/// # Errors
///
/// The thread cannot be created.
pub(super) fn start(path: PathBuf, max_samples: usize) -> io::Result<CameraWriter> {
    let file = path.clone();
    FileThread::start("camera recorder", path, move |samples| {
        match record(&file, max_samples, samples) {
            Ok(()) => {}
            Err(stop @ Stop::Full(_)) => {
                warn!("recording of cameras to {} ends: {stop}", file.display());
            }
            Err(stop) => error!("cameras are not recorded to {}: {stop}", file.display()),
        }
    })
}

/// Why the thread stops before the app ends.
#[derive(Debug, thiserror::Error)]
enum Stop {
    #[error("{0}: name a file in a folder in which the app may write")]
    Open(io::Error),
    #[error("it is not a regular file: name another")]
    NoFile,
    #[error("its content cannot be appended to: name another file, or move this one away ({0})")]
    OtherFile(CameraFileError),
    #[error("{0}: the samples up to now are saved; make room on the disk, and start the app again")]
    Write(io::Error),
    #[error("it has {0} samples, its maximum: raise CameraRecorderPlugin::max_samples for more")]
    Full(usize),
}

/// The recording that a file already has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ExistingRecording {
    samples: usize,
    /// The first unused camera number.
    next_camera: u32,
}

fn record(path: &Path, max_samples: usize, samples: &Receiver<CameraSample>) -> Result<(), Stop> {
    let (mut file, existing) = open(path)?;
    append(&mut file, existing, max_samples, samples)
}

/// Opens or creates the file and prepares it for appending: removes a truncated last line. Never
/// changes a file that is not a recording.
fn open(path: &Path) -> Result<(File, ExistingRecording), Stop> {
    let mut file = open_or_create(path).map_err(Stop::Open)?;
    if !file.metadata().map_err(Stop::Open)?.is_file() {
        return Err(Stop::NoFile);
    }
    let existing = read_existing(&mut file)?;
    Ok((file, existing))
}

/// Reads the existing recording, and prepares the file for the next line.
fn read_existing(file: &mut File) -> Result<ExistingRecording, Stop> {
    let header = header();
    let mut bytes = Vec::new();
    // Only the header's length at first: the file may be a large one of another kind.
    file.take(header.len() as u64).read_to_end(&mut bytes).map_err(Stop::Open)?;
    if String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}').starts_with(NAME) {
        file.read_to_end(&mut bytes).map_err(Stop::Open)?;
    }
    // A new file, or one with a truncated header, has no samples.
    let begun = header.as_bytes().starts_with(&bytes);
    let parsed = if begun { Ok(Vec::new()) } else { parse(&String::from_utf8_lossy(&bytes)) };
    let samples = parsed.map_err(Stop::OtherFile)?;

    let mut ends =
        bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(index, _)| index + 1);
    let whole = if ends.clone().count() < 2 { 0 } else { ends.next_back().unwrap_or(0) };
    file.set_len(whole as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(Stop::Write)?;
    if whole == 0 {
        file.write_all(header.as_bytes()).map_err(Stop::Write)?;
    }
    let next_camera =
        samples.iter().map(|sample| sample.camera.saturating_add(1)).max().unwrap_or(0);
    Ok(ExistingRecording { samples: samples.len(), next_camera })
}

/// Writes samples as they arrive, until the sender is dropped.
fn append(
    out: &mut impl Write,
    existing: ExistingRecording,
    most: usize,
    samples: &Receiver<CameraSample>,
) -> Result<(), Stop> {
    let mut count = existing.samples;
    let mut text = String::new();
    while count < most {
        let Ok(first) = samples.recv() else { return Ok(()) };
        text.clear();
        for sample in std::iter::once(first).chain(samples.try_iter()).take(most - count) {
            // Numbers of earlier runs' cameras are not reused.
            let camera = sample.camera.saturating_add(existing.next_camera);
            push_line(&mut text, &CameraSample { camera, ..sample });
            count += 1;
        }
        // Whole lines at once: if the app crashes, the operating system already has them.
        out.write_all(text.as_bytes()).map_err(Stop::Write)?;
    }
    Err(Stop::Full(count))
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
