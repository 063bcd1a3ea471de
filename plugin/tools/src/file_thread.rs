//! A thread that writes a file, so that no frame waits for the disk.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bevy::log::{error, warn};

/// Capacity of the queue; items beyond it are dropped.
const QUEUE: usize = 4096;

/// Timeout for joining the thread when the disk does not answer.
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);

/// Result of sending an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sent {
    /// The item is queued for the file.
    Queued,
    /// The queue is full: the item is dropped.
    Dropped,
    /// The thread has stopped; it logged the reason.
    Stopped,
}

/// Handle of the thread, which writes items as they arrive and ends when this is dropped.
pub(crate) struct FileThread<T> {
    path: PathBuf,
    items: Option<SyncSender<T>>,
    thread: Option<JoinHandle<()>>,
}

impl<T: Send + 'static> FileThread<T> {
    /// Runs `write` on a thread `name`, with the receiver of the items. `write` logs its own errors;
    /// the items end when this handle is dropped. `path`: the file, for messages.
    ///
    /// # Errors
    ///
    /// The thread cannot be created.
    pub(crate) fn start(
        name: &str,
        path: PathBuf,
        write: impl FnOnce(&Receiver<T>) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, receiver) = sync_channel(QUEUE);
        let thread =
            thread::Builder::new().name(name.to_owned()).spawn(move || write(&receiver))?;
        Ok(Self { path, items: Some(sender), thread: Some(thread) })
    }

    /// Queues an item. Never waits.
    pub(crate) fn send(&self, item: T) -> Sent {
        match self.items.as_ref().map(|items| items.try_send(item)) {
            Some(Ok(())) => Sent::Queued,
            Some(Err(TrySendError::Full(_))) => Sent::Dropped,
            Some(Err(TrySendError::Disconnected(_))) | None => Sent::Stopped,
        }
    }

    /// Whether the thread accepts items.
    pub(crate) fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl<T> Drop for FileThread<T> {
    fn drop(&mut self) {
        // Without a sender the thread ends after it has written the queued items.
        self.items = None;
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() {
            if start.elapsed() > JOIN_TIMEOUT {
                warn!("{} may lack its last lines: the disk does not answer", self.path.display());
                return;
            }
            thread::sleep(Duration::from_millis(1));
        }
        if thread.join().is_err() {
            error!(
                "{} may lack its last lines: the thread that writes it panicked",
                self.path.display()
            );
        }
    }
}

/// Opens a file for reading and writing, from its start. Creates it, and its folder, where missing;
/// leaves what it holds.
pub(crate) fn open_or_create(path: &Path) -> io::Result<File> {
    // An existing path, folder or not, is left to `open`, whose errors are more specific.
    if let Some(folder) = path.parent()
        && !folder.exists()
    {
        std::fs::create_dir_all(folder)?;
    }
    File::options().read(true).write(true).create(true).truncate(false).open(path)
}
