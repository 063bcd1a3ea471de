//! Logs of rows: CSV files that an app appends to while it runs, and that a crash may cut off.
//!
//! A file has a [`Row`]'s preamble, if there is one, then the names of the columns, which are those of
//! the type's fields, and then a line for each row. Lines are only appended: a crash or a full disk
//! loses at most the last one, which readers and later runs drop.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use bevy::log::{error, warn};
use csv::{ErrorKind, Position, ReaderBuilder, StringRecord, Trim, WriterBuilder};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Capacity of the queue; rows beyond it are dropped.
const QUEUE: usize = 4096;
/// Timeout for joining the thread when the disk does not answer.
const JOIN_TIMEOUT: Duration = Duration::from_secs(5);
/// Maximum number of characters that an error quotes from a file.
const MAX_QUOTE: usize = 60;

/// Whether the tool `frugal` runs the app, as `bevy_frugal_gi::stage` describes: nobody plays.
pub(crate) fn is_on_stage() -> bool {
    std::env::var_os("FRUGAL_STAGE").is_some()
}

/// A row of a log: a struct of plain fields, whose names are those of the columns. Its texts have no
/// line breaks.
pub trait Row: Default + Serialize + DeserializeOwned + Send + 'static {
    /// The plugin that writes such logs, for messages.
    const PLUGIN: &'static str;
    /// First line, with the name and version of the format and its line end. Empty: there is none.
    const PREAMBLE: &'static str = "";

    /// The row, if its numbers are in their ranges.
    ///
    /// # Errors
    ///
    /// In words, which field is out of its range.
    fn validated(self) -> Result<Self, String>;
}

/// Why a text is not a log of these rows: it is another kind of file, or one of another version, or has
/// an invalid row. The message includes the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {reason}")]
#[non_exhaustive]
pub struct RowLogError {
    /// Line, from 1.
    pub line: u64,
    /// What is wrong with it, and the remedy.
    pub reason: String,
}

/// The text of a log of `rows`, which [`read_rows`] restores bit by bit if they are
/// [valid](Row::validated), but for white space at the ends of texts.
pub fn rows_to_text<'a, R: Row>(rows: impl IntoIterator<Item = &'a R>) -> String {
    header::<R>() + &to_lines(rows, false)
}

/// The rows of a log, in file order, each [valid](Row::validated). Ignores empty lines and an
/// unterminated last line. Accepts a byte order mark, CRLF line ends, and spaces around fields.
///
/// # Errors
///
/// [`RowLogError`] when the text is not such a log, or has an invalid row; it names line, field and
/// remedy.
pub fn read_rows<R: Row>(text: &str) -> Result<Vec<R>, RowLogError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let header = header::<R>();
    if !text.is_empty() && header.starts_with(text) {
        return Ok(Vec::new());
    }
    for (index, expected) in header.lines().enumerate() {
        let found = text.lines().nth(index).unwrap_or_default();
        if !found.split(',').map(str::trim).eq(expected.split(',')) {
            let (found, plugin) = (quote(found), R::PLUGIN);
            let reason = format!(
                "`{found}` instead of `{expected}`: give a file that {plugin} of this version wrote"
            );
            return Err(RowLogError { line: index as u64 + 1, reason });
        }
    }
    let whole = text.rfind('\n').map_or(0, |end| end + 1);
    let skipped = R::PREAMBLE.lines().count();
    let table = text[..whole].splitn(skipped + 1, '\n').last().unwrap_or_default();
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(table.as_bytes());
    let fault = |at: Option<&Position>, reason: String| RowLogError {
        line: at.map_or(0, Position::line) + skipped as u64,
        reason: format!("{reason}: correct the line, or remove it"),
    };
    let columns = reader.headers().map_err(|error| fault(error.position(), error.to_string()))?;
    let columns = columns.clone();
    let row = |record: csv::Result<StringRecord>| {
        let record = record.map_err(|error| fault(error.position(), fault_of_line(&error)))?;
        let at = record.position();
        let row: R = record
            .deserialize(Some(&columns))
            .map_err(|error| fault(at, fault_of_field(&error, &columns, &record)))?;
        row.validated().map_err(|reason| fault(at, reason))
    };
    reader.records().map(row).collect()
}

fn fault_of_line(error: &csv::Error) -> String {
    match error.kind() {
        ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} fields instead of {expected_len}")
        }
        _ => error.to_string(),
    }
}

fn fault_of_field(error: &csv::Error, columns: &StringRecord, record: &StringRecord) -> String {
    let ErrorKind::Deserialize { err, .. } = error.kind() else { return error.to_string() };
    let field = err.field().unwrap_or(u64::MAX) as usize;
    let (name, found) = (columns.get(field).unwrap_or("?"), record.get(field).unwrap_or("?"));
    format!("`{name}` is `{}`: {}", quote(found), err.kind())
}

/// The beginning of a line.
fn quote(line: &str) -> String {
    line.chars().take(MAX_QUOTE).collect()
}

/// The lines before the first row.
fn header<R: Row>() -> String {
    let table = to_lines(&[R::default()], true);
    let columns = table.lines().next().unwrap_or_default();
    format!("{}{columns}\n", R::PREAMBLE)
}

/// Rows as lines. Numbers have enough digits to restore every bit.
fn to_lines<'a, R: Row>(rows: impl IntoIterator<Item = &'a R>, has_headers: bool) -> String {
    let mut writer = WriterBuilder::new().has_headers(has_headers).from_writer(Vec::new());
    for row in rows {
        writer.serialize(row).expect("a row has plain fields");
    }
    let bytes = writer.into_inner().expect("memory has no errors");
    String::from_utf8(bytes).expect("fields are text")
}

/// A log that a thread of its own writes, so that no frame waits for the disk. The thread ends when
/// this is dropped.
pub(crate) struct RowLog<R> {
    path: PathBuf,
    rows: Option<SyncSender<R>>,
    thread: Option<JoinHandle<()>>,
    has_warned: bool,
}

impl<R: Row> RowLog<R> {
    /// Appends to the file at `path`, at most `max_rows` rows; creates it, and its folder, where
    /// missing. Never changes a file that is not such a log. What goes wrong is logged once.
    pub(crate) fn start(path: &Path, max_rows: usize) -> Self {
        let (sender, receiver) = sync_channel(QUEUE);
        let file = path.to_owned();
        let write = move || {
            let end = open::<R>(&file).and_then(|mut file| append(&mut file, max_rows, &receiver));
            match end {
                Ok(()) => {}
                Err(end @ End::Full(_)) => warn!("{} ends: {end}", file.display()),
                Err(end) => error!("{} is not written: {end}", file.display()),
            }
        };
        let thread = thread::Builder::new().name(R::PLUGIN.to_owned()).spawn(write);
        if let Err(error) = &thread {
            error!("{} is not written: there is no thread: {error}", path.display());
        }
        let (rows, thread) = (Some(sender), thread.ok());
        Self { path: path.to_owned(), rows, thread, has_warned: false }
    }

    /// Queues a row, and returns whether it was. Never waits: warns once where the disk is too slow.
    pub(crate) fn push(&mut self, row: R) -> bool {
        let sent = self.rows.as_ref().map(|rows| rows.try_send(row));
        if matches!(sent, Some(Err(TrySendError::Full(_))))
            && !std::mem::replace(&mut self.has_warned, true)
        {
            warn!("{} lacks some lines: the disk is too slow", self.path.display());
        }
        matches!(sent, Some(Ok(())))
    }

    /// Whether rows are written. False once the file is full or cannot be written.
    pub(crate) fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl<R> Drop for RowLog<R> {
    fn drop(&mut self) {
        // Without a sender the thread ends after it has written the queued rows.
        self.rows = None;
        let Some(thread) = self.thread.take() else { return };
        let start = Instant::now();
        while !thread.is_finished() && start.elapsed() < JOIN_TIMEOUT {
            thread::sleep(Duration::from_millis(1));
        }
        if !thread.is_finished() {
            warn!("{} may lack its last lines: the disk does not answer", self.path.display());
        } else if thread.join().is_err() {
            error!("{} may lack its last lines: its thread panicked", self.path.display());
        }
    }
}

/// Why the thread ends before the app.
#[derive(Debug, thiserror::Error)]
enum End {
    #[error("{0}: name a file in a folder in which the app may write")]
    Open(#[from] io::Error),
    #[error("it is not a log of this version: name another file, or move this one away")]
    OtherFile,
    #[error("{0}: the lines up to now are saved; make room on the disk, and start the app again")]
    Write(io::Error),
    #[error("it has as many lines as it may: raise {0}::max_samples for more")]
    Full(&'static str),
}

/// Opens or creates a log, and removes a truncated last line. Never changes a file that is not one.
fn open<R: Row>(path: &Path) -> Result<File, End> {
    // An existing path, folder or not, is left to `open`, whose errors are more specific.
    if let Some(folder) = path.parent()
        && !folder.exists()
    {
        std::fs::create_dir_all(folder)?;
    }
    let mut file =
        File::options().read(true).write(true).create(true).truncate(false).open(path)?;
    if !file.metadata()?.is_file() {
        return Err(End::OtherFile);
    }
    let header = header::<R>();
    // As long as a header that an editor saved, with a byte order mark and other line ends: the file
    // may be a large one of another kind.
    let most = header.len() + header.lines().count() + '\u{feff}'.len_utf8();
    let mut start = Vec::new();
    (&mut file).take(most as u64).read_to_end(&mut start)?;
    let start = String::from_utf8_lossy(&start).replace("\r\n", "\n");
    let start = start.trim_start_matches('\u{feff}');
    let is_new = header.starts_with(start);
    if !is_new && !start.starts_with(&header) {
        return Err(End::OtherFile);
    }
    let whole = if is_new { 0 } else { whole_lines(&mut file)? };
    file.set_len(whole).and_then(|()| file.seek(SeekFrom::End(0))).map_err(End::Write)?;
    if is_new {
        file.write_all(header.as_bytes()).map_err(End::Write)?;
    }
    Ok(file)
}

/// Length of the file up to its last line end.
fn whole_lines(file: &mut File) -> io::Result<u64> {
    file.rewind()?;
    let (mut reader, mut line, mut whole) = (BufReader::new(file), Vec::new(), 0);
    loop {
        line.clear();
        let length = reader.read_until(b'\n', &mut line)?;
        if !line.ends_with(b"\n") {
            return Ok(whole);
        }
        whole += length as u64;
    }
}

/// Writes rows as they arrive, until the sender is dropped.
fn append<R: Row>(out: &mut impl Write, most: usize, rows: &Receiver<R>) -> Result<(), End> {
    let mut count = 0;
    while count < most {
        let Ok(first) = rows.recv() else { return Ok(()) };
        let queued = std::iter::once(first).chain(rows.try_iter()).take(most - count);
        let batch: Vec<R> = queued.collect();
        count += batch.len();
        // Whole lines at once: if the app crashes, the operating system already has them.
        out.write_all(to_lines(&batch, false).as_bytes()).map_err(End::Write)?;
    }
    Err(End::Full(R::PLUGIN))
}

#[cfg(test)]
#[path = "row_log_tests.rs"]
mod tests;
