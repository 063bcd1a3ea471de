//! Records as data: what a policy is tried on without the scene, in a small file. For the examples and
//! benchmarks that play docs/data/records.

use std::path::Path;

use frugal_core::frontier::{CostPoint, FrontierMap};
use frugal_core::knobs::{KnobLevels, KnobSpace};
use frugal_core::units::Watts;
use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};

use crate::evaluate::{Made, PathPlan, PathRecord, Pose};
use crate::table::CostTable;

/// A [`PathRecord`] as JSON. Its settings are in the terms of a map's knobs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecordFile {
    /// How it was made.
    pub made: Made,
    /// The scene's name.
    pub scene: String,
    /// The path's name.
    pub path: String,
    /// Frames per second.
    pub fps: f64,
    /// Width and height of the images, pixels.
    pub size: [u32; 2],
    /// Vertical field of view in radians, and width ÷ height.
    pub lens: [f32; 2],
    /// Position, metres, and rotation as a quaternion (x, y, z, w) of every frame's camera.
    pub poses: Vec<[f32; 7]>,
    /// Packed settings, as hexadecimal numbers.
    pub settings: Vec<String>,
    /// Milliwatts by settings and frame; one number where all frames have the same.
    pub milliwatts: Vec<Vec<u32>>,
    /// 1 − SSIM by settings and frame, in millionths; one number where all frames have the same.
    pub error_millionths: Vec<Vec<u32>>,
}

impl RecordFile {
    /// The record in the terms of `space`.
    ///
    /// # Errors
    /// In a sentence, for a file that contradicts itself.
    pub fn record(&self, space: &KnobSpace) -> Result<PathRecord, String> {
        let of_file =
            |what: String| format!("the record of {} in {}: {what}", self.path, self.scene);
        let frames = self.poses.len();
        let counts = [self.settings.len(), self.milliwatts.len(), self.error_millionths.len()];
        if frames == 0 || counts.iter().any(|count| *count != counts[0]) {
            return Err(of_file(format!("{frames} frames, and columns of {counts:?} settings")));
        }
        let pose = |[x, y, z, a, b, c, d]: &[f32; 7]| Pose {
            position: Vec3::new(*x, *y, *z),
            rotation: Quat::from_xyzw(*a, *b, *c, *d),
        };
        let path =
            PathPlan::new(&self.path, self.fps, self.poses.iter().map(pose)).map_err(of_file)?;
        let mut table = CostTable::new(frames);
        let columns = self.milliwatts.iter().zip(&self.error_millionths);
        for (settings, (powers, errors)) in self.settings.iter().zip(columns) {
            let bits = u128::from_str_radix(settings, 16)
                .map_err(|error| of_file(format!("settings `{settings}`: {error}")))?;
            let number = |column: &[u32], frame: usize| match column {
                [one] => Some(*one),
                all => all.get(frame).copied().filter(|_| all.len() == frames),
            };
            for frame in 0..frames {
                let cost = number(powers, frame).zip(number(errors, frame));
                let Some((power, error)) = cost else {
                    return Err(of_file(format!("settings `{settings}` lack frame {frame}")));
                };
                let cost = CostPoint::new(f64::from(power) * 1e-3, f64::from(error) * 1e-6);
                table.set(frame, KnobLevels::from_bits(bits), cost);
            }
        }
        Ok(PathRecord { path, space: space.clone(), table })
    }
}

impl PathRecord {
    /// Mean power of the cheapest and of the dearest settings that are known in every frame.
    pub fn power_range(&self) -> [Watts; 2] {
        let means = self.table.means().map(|(_, cost)| cost.power.0);
        let (low, high) = means
            .fold((f64::INFINITY, 0.0_f64), |(low, high), power| (low.min(power), high.max(power)));
        [Watts(low), Watts(high)]
    }
}

/// The records in a folder, each with its scene's map, in the order of their names.
///
/// # Errors
/// When a file cannot be read, or is no record or map.
pub fn read_records(
    folder: &Path,
) -> Result<Vec<(RecordFile, FrontierMap)>, Box<dyn std::error::Error>> {
    let mut files: Vec<_> = std::fs::read_dir(folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<std::io::Result<_>>()?;
    files.retain(|file| file.to_string_lossy().ends_with(".record.json"));
    files.sort();
    let read = |file: &std::path::PathBuf| {
        let record: RecordFile = serde_json::from_str(&std::fs::read_to_string(file)?)?;
        let map = folder.join(format!("{}.pareto.ron", record.scene));
        let map = FrontierMap::from_ron(&std::fs::read_to_string(map)?)?;
        Ok((record, map))
    };
    files.iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::formula::{path, record_of, space};

    /// The file of a record whose errors are the same in all frames.
    fn file_of(PathRecord { path, table, .. }: &PathRecord) -> RecordFile {
        let columns = |value: fn(CostPoint) -> f64, most: usize| -> Vec<Vec<u32>> {
            let of = |column: usize| -> Vec<u32> {
                table.known(column).take(most).map(|(_, cost)| value(cost).round() as u32).collect()
            };
            (0..table.settings().len()).map(of).collect()
        };
        let pose = |pose: &Pose| {
            let ([x, y, z], [a, b, c, d]) = (pose.position.to_array(), pose.rotation.to_array());
            [x, y, z, a, b, c, d]
        };
        RecordFile {
            made: Made::default(),
            scene: "court".into(),
            path: path.name().into(),
            fps: path.fps(),
            size: [16, 12],
            lens: [1.0, 1.5],
            poses: path.poses().iter().map(pose).collect(),
            settings: table.settings().iter().map(|one| format!("{:x}", one.bits())).collect(),
            milliwatts: columns(|cost| cost.power.0 * 1e3, usize::MAX),
            error_millionths: columns(|cost| cost.error * 1e6, 1),
        }
    }

    #[test]
    fn a_record_is_read_back_to_the_last_milliwatt() {
        let record = record_of(path(), space(), &space().iter().collect::<Vec<_>>());
        let file = file_of(&record);
        let text = serde_json::to_string(&file).expect("JSON");
        let file: RecordFile = serde_json::from_str(&text).expect("the same");
        let read = file.record(&space()).expect("a record");
        assert_eq!(read.table.settings(), record.table.settings());
        assert_eq!((read.path.fps(), read.path.poses().len()), (5.0, 10));
        for (row, pose) in record.path.poses().iter().enumerate() {
            assert!(read.path.poses()[row].position.distance(pose.position) < 1e-3);
            for column in 0..record.table.settings().len() {
                let [a, b] = [&read, &record].map(|it| it.table.at(row, column).expect("a cost"));
                assert!((a.power.0 - b.power.0).abs() < 6e-4 && (a.error - b.error).abs() < 6e-7);
            }
        }
    }

    #[test]
    fn a_file_that_contradicts_itself_is_refused() {
        let record = record_of(path(), space(), &[space().lowest()]);
        let file = || file_of(&record);
        let faults: [(fn(&mut RecordFile), &str); 5] = [
            (|file| file.poses.clear(), "0 frames"),
            (|file| file.settings.truncate(1), "columns of [1, 2, 2]"),
            (|file| file.settings[0] = "words".into(), "settings `words`"),
            (|file| file.milliwatts[0] = vec![1, 2], "lack frame 0"),
            (|file| file.fps = f64::NAN, "frame rate"),
        ];
        for (fault, words) in faults {
            let mut faulty = file();
            fault(&mut faulty);
            let refused = faulty.record(&space()).expect_err(words);
            assert!(refused.contains(words), "{refused}");
        }
    }
}
