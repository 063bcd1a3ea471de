//! Fake trees of the kernel's files, for tests.

use std::cell::RefCell;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use crate::power::root::SysRoot;

thread_local! {
    /// Files that were opened by this thread since they were last taken.
    static OPENED: RefCell<Vec<PathBuf>> = const { RefCell::new(Vec::new()) };
}

/// A temporary folder with files; removed when dropped.
pub(crate) struct Tree(PathBuf);

impl Tree {
    /// An empty tree.
    pub(crate) fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let folder =
            std::env::temp_dir().join(format!("frugal-gi-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    /// A tree of these files.
    pub(crate) fn of(files: &[(&str, &str)]) -> Self {
        let tree = Self::new();
        files.iter().for_each(|(path, text)| tree.write(path, text));
        tree
    }

    /// Where a file lies.
    pub(crate) fn path(&self, path: &str) -> PathBuf {
        self.0.join(path)
    }

    /// Writes a file, as the kernel does: with a line end.
    pub(crate) fn write(&self, path: &str, text: &str) {
        let (path, text) = (self.path(path), format!("{text}\n"));
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        // Some file systems flush a file that is cut to nothing first: too slow for thousands.
        let file = File::options().write(true).create(true).truncate(false).open(path);
        let mut file = file.expect("a file");
        file.write_all(text.as_bytes()).expect("a file");
        file.set_len(text.len() as u64).expect("a file");
    }

    /// Removes a file.
    pub(crate) fn remove(&self, path: &str) {
        fs::remove_file(self.path(path)).expect("a file");
    }

    /// Renames a file or folder.
    pub(crate) fn rename(&self, from: &str, to: &str) {
        fs::rename(self.path(from), self.path(to)).expect("a file");
    }

    /// Lets a file fail with an error of Linux, or answer again.
    pub(crate) fn fail(&self, path: &str, number: Option<i32>) {
        let mark = mark(&self.path(path));
        match number {
            Some(number) => fs::write(mark, number.to_string()).expect("a file"),
            None => {
                let _ = fs::remove_file(mark);
            }
        }
    }

    /// The tree as a system's root.
    pub(crate) fn root(&self) -> SysRoot {
        let open = |path: &Path| {
            OPENED.with_borrow_mut(|opened| opened.push(path.to_owned()));
            match fs::read_to_string(mark(path)).map(|number| number.parse()) {
                Ok(Ok(number)) => Err(io::Error::from_raw_os_error(number)),
                _ => File::open(path),
            }
        };
        SysRoot::new(self.0.clone(), open)
    }
}

/// The names of the files that this thread has opened since the last call.
pub(crate) fn opened() -> Vec<String> {
    let opened = OPENED.take();
    let name = |path: &PathBuf| Some(path.file_name()?.to_string_lossy().into_owned());
    opened.iter().filter_map(name).collect()
}

impl Drop for Tree {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn mark(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.fails"))
}
