//! Tests of the written file, and of its state after errors.

use bevy::math::{Quat, Vec3};

use std::sync::mpsc::sync_channel;

use super::*;
use crate::file_thread::Sent;
use crate::recording::testing::{TestFolder, read};
use crate::recording::to_text;

fn sample(time_s: f64, camera: u32) -> CameraSample {
    let (position, rotation) = (Vec3::new(1.0, 2.0, 3.0), Quat::IDENTITY);
    CameraSample { time_s, camera, position, rotation, vertical_fov: 1.0, aspect: 1.5 }
}

/// Records these samples as one run of an app does.
fn run(path: &Path, max_samples: usize, samples: &[CameraSample]) -> Result<(), Stop> {
    let (sender, receiver) = sync_channel(samples.len());
    samples.iter().for_each(|sample| sender.send(*sample).expect("room in the queue"));
    drop(sender);
    record(path, max_samples, &receiver)
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
fn later_runs_append_under_new_numbers() {
    let folder = TestFolder::new();
    let path = folder.file("new/folders/cameras.txt");
    run(&path, 100, &[]).expect("an empty recording");
    assert_eq!(read(&path), header());
    run(&path, 100, &[sample(0.0, 0), sample(0.0, 1), sample(0.5, 0)]).expect("a recording");
    run(&path, 100, &[sample(0.0, 0), sample(0.5, 0)]).expect("a recording");
    let expected = [sample(0.0, 0), sample(0.0, 1), sample(0.5, 0), sample(0.0, 2), sample(0.5, 2)];
    assert_eq!(read(&path), to_text(&expected));
}

#[test]
fn a_file_truncated_anywhere_is_repaired_and_continued() {
    let folder = TestFolder::new();
    let path = folder.file("cameras.txt");
    let whole = to_text(&[sample(0.0, 0), sample(0.5, 0)]);
    let one = to_text(&[sample(0.0, 0)]);
    for end in 0..whole.len() {
        std::fs::write(&path, &whole[..end]).expect("a truncated file");
        run(&path, 100, &[sample(0.0, 0)]).expect("a recording");
        let left: &[CameraSample] = if end < one.len() { &[] } else { &[sample(0.0, 0)] };
        let next = sample(0.0, left.len() as u32);
        assert_eq!(read(&path), to_text(left.iter().chain([&next])), "truncated at {end}");
    }
    // Saved by an editor, with other line ends.
    for (text, count) in
        [("\u{feff}frugal-cameras 1\r\n".to_owned(), 1), (whole.replace('\n', "\r\n"), 3)]
    {
        std::fs::write(&path, text).expect("a file");
        run(&path, 100, &[sample(0.0, 0)]).expect("a recording");
        assert_eq!(parse(&read(&path)).map(|samples| samples.len()), Ok(count));
    }
}

#[test]
fn a_file_that_is_not_a_recording_is_unchanged() {
    let folder = TestFolder::new();
    let path = folder.file("Cargo.toml");
    let broken = format!("{}a,b\n", header());
    let samples = [sample(0.0, 0)];
    for text in ["[package]\nname = \"game\"\n", "frugal-cameras 2\n", "\u{1f600}", "\n", &broken] {
        std::fs::write(&path, text).expect("a file");
        let stop = run(&path, 100, &samples).expect_err(text);
        assert!(matches!(stop, Stop::OtherFile(_)), "{text}: {stop}");
        assert!(stop.to_string().contains("name another file"), "{stop}");
        assert_eq!(read(&path), text);
    }
    let binary: Vec<u8> = (0..=255).cycle().take(10_000).collect();
    std::fs::write(&path, &binary).expect("a file");
    assert!(matches!(run(&path, 100, &samples), Err(Stop::OtherFile(_))));
    assert_eq!(std::fs::read(&path).expect("a file"), binary);
}

#[test]
fn paths_that_cannot_be_written_give_a_reason() {
    let folder = TestFolder::new();
    let path = folder.file("file");
    std::fs::write(&path, "a file, and no folder").expect("a file");
    for path in
        [path.join("cameras.txt"), path.join("deep/cameras.txt"), folder.file(""), PathBuf::new()]
    {
        let stop = run(&path, 100, &[sample(0.0, 0)]).expect_err("no recording");
        assert!(matches!(stop, Stop::Open(_)), "{}: {stop}", path.display());
        assert!(stop.to_string().contains("name a file in a folder"), "{stop}");
    }
    #[cfg(unix)]
    assert!(matches!(run(Path::new("/dev/null"), 100, &[sample(0.0, 0)]), Err(Stop::NoFile)));
}

#[test]
fn the_maximum_applies_to_the_file_and_not_to_the_run() {
    let folder = TestFolder::new();
    let path = folder.file("cameras.txt");
    let samples: Vec<_> = (0..5).map(|time| sample(time.into(), 0)).collect();
    assert!(matches!(run(&path, 3, &samples), Err(Stop::Full(3))));
    assert_eq!(read(&path), to_text(&samples[..3]));
    assert!(matches!(run(&path, 3, &samples), Err(Stop::Full(3))));
    assert_eq!(read(&path), to_text(&samples[..3]));
    assert!(matches!(run(&path, 0, &samples), Err(Stop::Full(3))));
    let message = run(&path, 3, &samples).expect_err("full").to_string();
    assert!(message.contains("raise CameraRecorderPlugin::max_samples"), "{message}");
}

#[test]
fn a_full_disk_loses_only_the_rest() {
    let samples: Vec<_> = (0..5).map(|time| sample(time.into(), 0)).collect();
    let whole = to_text(&samples);
    for room in header().len() + 1..whole.len() {
        let mut disk = SmallDisk(header().into_bytes(), room);
        let (sender, receiver) = sync_channel(samples.len());
        samples.iter().for_each(|sample| sender.send(*sample).expect("room in the queue"));
        let stop = append(&mut disk, ExistingRecording::default(), 100, &receiver)
            .expect_err("a full disk");
        assert!(stop.to_string().contains("make room"), "{stop}");
        let written = String::from_utf8(disk.0).expect("text");
        assert_eq!(written, whole[..room]);
        assert!(parse(&written).is_ok());
    }
}

#[test]
fn everything_is_written_when_the_writer_is_dropped() {
    let folder = TestFolder::new();
    let path = folder.file("cameras.txt");
    let samples: Vec<_> = (0..1000).map(|time| sample(time.into(), 0)).collect();
    let writer = start(path.clone(), 10_000).expect("a thread");
    assert!(writer.is_running());
    samples.iter().for_each(|sample| assert_eq!(writer.send(*sample), Sent::Queued));
    drop(writer);
    assert_eq!(read(&path), to_text(&samples));
}
