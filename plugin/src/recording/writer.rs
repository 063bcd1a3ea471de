//! Appends samples to a file on a thread of its own: no frame waits for a disk.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bevy::log::{error, warn};

use super::file::{NAME, header, parse, push_line};
use super::{CameraFileError, CameraSample};

/// Samples that wait for the disk before others are left out.
const QUEUE: usize = 4096;

/// How long the end of the app waits for a disk that does not answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// What becomes of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sent {
    /// It is on its way to the file.
    Queued,
    /// Too many wait for the disk: it is left out.
    LeftOut,
    /// Nothing is written any more; the reason was logged.
    Stopped,
}

/// The writing thread. It writes what it gets at once, and ends when this is dropped.
pub(super) struct CameraWriter {
    path: PathBuf,
    samples: Option<SyncSender<CameraSample>>,
    thread: Option<JoinHandle<()>>,
}

impl CameraWriter {
    /// Appends to the file at `path` until it holds `max_samples`. What goes wrong with the file is
    /// logged, once.
    ///
    /// # Errors
    ///
    /// The system has no more threads.
    pub(super) fn start(path: PathBuf, max_samples: usize) -> io::Result<Self> {
        let (sender, receiver) = sync_channel(QUEUE);
        let file = path.clone();
        let run = move || match record(&file, max_samples, &receiver) {
            Ok(()) => {}
            Err(stop @ Stop::Full(_)) => {
                warn!("recording of cameras into {} ends: {stop}", file.display())
            }
            Err(stop) => error!("cameras are not recorded into {}: {stop}", file.display()),
        };
        let thread = thread::Builder::new().name("camera recorder".to_owned()).spawn(run)?;
        Ok(Self { path, samples: Some(sender), thread: Some(thread) })
    }

    /// Never waits.
    pub(super) fn send(&self, sample: CameraSample) -> Sent {
        match self.samples.as_ref().map(|samples| samples.try_send(sample)) {
            Some(Ok(())) => Sent::Queued,
            Some(Err(TrySendError::Full(_))) => Sent::LeftOut,
            Some(Err(TrySendError::Disconnected(_))) | None => Sent::Stopped,
        }
    }

    /// Whether the thread takes samples.
    pub(super) fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for CameraWriter {
    fn drop(&mut self) {
        // Without a sender the thread ends when it has written what waits.
        self.samples = None;
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() {
            if start.elapsed() > PATIENCE {
                warn!(
                    "{} may lack the last cameras: the disk does not answer",
                    self.path.display()
                );
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
        if thread.join().is_err() {
            error!(
                "{} may lack the last cameras: the thread that writes it panicked",
                self.path.display()
            );
        }
    }
}

/// Why the thread stops before the app does.
#[derive(Debug, thiserror::Error)]
enum Stop {
    #[error("{0}: name a file in a folder in which the app may write")]
    Open(io::Error),
    #[error("it is no regular file: name another")]
    NoFile,
    #[error("what it holds cannot be appended to: name another file, or move this one away ({0})")]
    Occupied(CameraFileError),
    #[error(
        "{0}: what was written until now is there; make room on the disk, and start the app again"
    )]
    Write(io::Error),
    #[error(
        "it holds {0} samples, the most that it may: raise CameraRecorderPlugin::max_samples for more"
    )]
    Full(usize),
}

/// What a file holds already.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Held {
    samples: usize,
    /// The first number that no camera has.
    next_camera: u32,
}

fn record(path: &Path, max_samples: usize, samples: &Receiver<CameraSample>) -> Result<(), Stop> {
    let (mut file, held) = open(path)?;
    append(&mut file, held, max_samples, samples)
}

/// Opens or makes the file, which is ready to be appended to: a torn last line is taken off.
/// Changes no other file.
fn open(path: &Path) -> Result<(File, Held), Stop> {
    // What is there, folder or not, is left to `open`, whose errors say more.
    if let Some(folder) = path.parent()
        && !folder.exists()
    {
        std::fs::create_dir_all(folder).map_err(Stop::Open)?;
    }
    let file = File::options().read(true).write(true).create(true).truncate(false).open(path);
    let mut file = file.map_err(Stop::Open)?;
    if !file.metadata().map_err(Stop::Open)?.is_file() {
        return Err(Stop::NoFile);
    }
    let held = take_up(&mut file)?;
    Ok((file, held))
}

/// Reads what is there, and leaves the file ready for the next line.
fn take_up(file: &mut File) -> Result<Held, Stop> {
    let header = header();
    let mut bytes = Vec::new();
    // Not the whole of somebody's film to see that it is none of ours.
    file.take(header.len() as u64).read_to_end(&mut bytes).map_err(Stop::Open)?;
    if String::from_utf8_lossy(&bytes).trim_start_matches('\u{feff}').starts_with(NAME) {
        file.read_to_end(&mut bytes).map_err(Stop::Open)?;
    }
    // A new file, and one whose header is torn, hold no samples.
    let begun = header.as_bytes().starts_with(&bytes);
    let parsed = if begun { Ok(Vec::new()) } else { parse(&String::from_utf8_lossy(&bytes)) };
    let samples = parsed.map_err(Stop::Occupied)?;

    let mut ends =
        bytes.iter().enumerate().filter(|(_, byte)| **byte == b'\n').map(|(index, _)| index + 1);
    let whole = if ends.clone().count() < 2 { 0 } else { ends.next_back().unwrap_or(0) };
    file.set_len(whole as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(Stop::Write)?;
    if whole == 0 {
        file.write_all(header.as_bytes()).map_err(Stop::Write)?;
    }
    let next_camera =
        samples.iter().map(|sample| sample.camera.saturating_add(1)).max().unwrap_or(0);
    Ok(Held { samples: samples.len(), next_camera })
}

/// Writes what comes, as soon as it comes, until nobody sends.
fn append(
    out: &mut impl Write,
    held: Held,
    most: usize,
    samples: &Receiver<CameraSample>,
) -> Result<(), Stop> {
    let mut count = held.samples;
    let mut text = String::new();
    while count < most {
        let Ok(first) = samples.recv() else { return Ok(()) };
        text.clear();
        for sample in std::iter::once(first).chain(samples.try_iter()).take(most - count) {
            // Cameras of an earlier run keep their numbers to themselves.
            let camera = sample.camera.saturating_add(held.next_camera);
            push_line(&mut text, &CameraSample { camera, ..sample });
            count += 1;
        }
        // Whole lines at once: should the app crash, its lines are with the system already.
        out.write_all(text.as_bytes()).map_err(Stop::Write)?;
    }
    Err(Stop::Full(count))
}

#[cfg(test)]
#[path = "writer_tests.rs"]
mod tests;
