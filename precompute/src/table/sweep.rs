//! The results of `frugal sweep` as a CSV file: writer and reader.
//!
//! The first line is a comment: `# frugal sweep`, then JSON of the conditions ([`SweepFacts`], and
//! the knobs with their levels). A header follows, and a row for every combination: the settings
//! packed, each knob's level by its label, power in watts, error. Files without the first line are
//! accepted: their knobs are looked up by name.

mod parse;

use std::io;
use std::path::{Path, PathBuf};

use bevy_frugal_gi::frontier::FrontierPoint;
use bevy_frugal_gi::knobs::KnobSpace;
use bevy_frugal_gi::power::MeterInfo;
use serde::{Deserialize, Serialize};

use crate::cost::FrameLayout;

/// Start of the first line.
const MARK: &str = "# frugal sweep ";
/// Columns before and after those of the knobs.
const COLUMNS: (&str, [&str; 2]) = ("settings_bits", ["power_w", "error"]);

/// Assumed layout of a file without one: the default size of `frugal sweep`, one light, and a sky.
pub const ASSUMED_LAYOUT: FrameLayout =
    FrameLayout { size: [320, 180], maps: 1, point_lights: 0, has_sky: true };

/// Conditions of a sweep. Absent in older files and in tables of other kinds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SweepFacts {
    /// The scene's name.
    pub scene: Option<String>,
    /// Width and height, pixels.
    pub size: Option<[u32; 2]>,
    /// Target frame rate.
    pub frames_per_second: Option<f64>,
    /// Number of whole reflective shadow maps.
    pub maps: Option<u32>,
    /// Number of point lights, which have six smaller maps each.
    pub point_lights: Option<u32>,
    /// Whether a sky is gathered.
    pub has_sky: Option<bool>,
    /// The power meter.
    pub meter: Option<MeterInfo>,
}

impl SweepFacts {
    /// Parameters of a frame's work other than settings; `None` where the file has none.
    pub fn layout(&self) -> Option<FrameLayout> {
        Some(FrameLayout {
            size: self.size?,
            maps: self.maps?,
            point_lights: self.point_lights.unwrap_or(0),
            has_sky: self.has_sky?,
        })
    }
}

/// Every combination at one camera, or some of them.
#[derive(Clone, Debug, PartialEq)]
pub struct SweepTable {
    /// Conditions of the sweep.
    pub facts: SweepFacts,
    /// The knobs that settings refer to.
    pub space: KnobSpace,
    /// Each combination once, with its cost.
    pub points: Vec<FrontierPoint>,
}

/// Why a file is not a sweep table.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepTableError {
    /// The file is missing, or not text.
    #[error("cannot read `{path}`: {source}; give a table that `frugal sweep --csv` wrote", path = path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A line is malformed.
    #[error("{path}:{line}: {field}: {reason}; {remedy}", path = path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The field.
        field: String,
        /// The fault.
        reason: String,
        /// The remedy.
        remedy: &'static str,
    },
}

/// The first line's JSON.
#[derive(Serialize)]
struct Head<'a> {
    #[serde(flatten)]
    facts: &'a SweepFacts,
    knobs: &'a KnobSpace,
}

impl SweepTable {
    /// Writes a row for every point.
    ///
    /// # Errors
    /// When `to` cannot be written.
    pub fn write(&self, mut to: impl io::Write) -> io::Result<()> {
        writeln!(
            to,
            "{MARK}{}",
            serde_json::to_string(&Head { facts: &self.facts, knobs: &self.space })?
        )?;
        let mut writer = csv::Writer::from_writer(to);
        let names = self.space.knobs().iter().map(|knob| knob.name.as_str());
        writer.write_record([COLUMNS.0].into_iter().chain(names).chain(COLUMNS.1))?;
        for point in &self.points {
            writer.write_field(point.settings.bits().to_string())?;
            for (index, knob) in self.space.knobs().iter().enumerate() {
                writer.write_field(
                    knob.levels
                        .get(point.settings.level(index))
                        .map_or("?", |level| level.label.as_str()),
                )?;
            }
            writer.write_field(point.cost.power.0.to_string())?;
            writer.write_field(point.cost.error.to_string())?;
            writer.write_record(None::<&[u8]>)?;
        }
        writer.flush()
    }

    /// Reads a file. Without knobs in the file, they are looked up in `known` by name.
    ///
    /// # Errors
    /// When the file cannot be read, or a line of it is not as [`write`](Self::write) writes it.
    pub fn open(path: &Path, known: &KnobSpace) -> Result<Self, SweepTableError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| SweepTableError::Unreadable { path: path.to_owned(), source })?;
        parse::table(&text, known).map_err(|fault| fault.of(path))
    }
}

#[cfg(test)]
mod tests {
    use bevy_frugal_gi::frontier::CostPoint;

    use super::*;
    use crate::evaluate::fake::{error, meter, power, space};

    fn table() -> SweepTable {
        let facts = SweepFacts {
            scene: Some("court, \"inner\"".into()),
            size: Some([128, 72]),
            frames_per_second: Some(15.0),
            maps: Some(2),
            point_lights: Some(3),
            has_sky: Some(false),
            meter: Some(meter()),
        };
        let point = |settings| FrontierPoint {
            settings,
            cost: CostPoint::new(power(settings) / 3.0, error(settings) - 1e-17),
        };
        SweepTable { facts, space: space(), points: space().iter().map(point).collect() }
    }

    fn text(table: &SweepTable) -> String {
        let mut bytes = Vec::new();
        table.write(&mut bytes).expect("written");
        String::from_utf8(bytes).expect("text")
    }

    fn read(text: &str, known: &KnobSpace) -> Result<SweepTable, String> {
        parse::table(text, known).map_err(|fault| fault.of(Path::new("a.csv")).to_string())
    }

    #[test]
    fn a_table_has_a_row_for_every_point_and_reads_back_to_the_last_bit() {
        let table = table();
        let text = text(&table);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[1],
            "settings_bits,gi_vpl_count,resolution_scale,antialiasing,power_w,error"
        );
        assert!(lines.len() == 2 + 36 && lines[2].starts_with("0,0,50%,off,0.33"), "{}", lines[2]);
        // The knobs are in the file: no known knobs are needed.
        assert_eq!(read(&text, &KnobSpace::default()), Ok(table.clone()));
        assert_eq!(read(&text.replace('\n', "\r\n"), &KnobSpace::default()), Ok(table.clone()));
        assert_eq!(
            table.facts.layout(),
            Some(FrameLayout { size: [128, 72], maps: 2, point_lights: 3, has_sky: false })
        );
    }

    #[test]
    fn a_file_without_the_first_line_takes_knobs_by_their_names() {
        let (_, old) = text(&table())
            .split_once('\n')
            .map(|(first, rest)| (first.to_owned(), rest.to_owned()))
            .expect("lines");
        let read_back = read(&old, &space()).expect("a table");
        assert_eq!(read_back, SweepTable { facts: SweepFacts::default(), ..table() });
        assert_eq!(read_back.facts.layout(), None);
        let unknown = read(&old, &KnobSpace::default()).expect_err("no such knob");
        assert!(
            unknown.contains("a.csv:1: gi_vpl_count:") && unknown.contains("sweep"),
            "{unknown}"
        );
    }

    #[test]
    fn malformed_lines_are_named_with_line_and_field() {
        let good = text(&table());
        let row = good.lines().nth(2).expect("a row").to_owned();
        let power = row.split(',').nth(4).expect("a field").to_owned();
        let with = |from: &str, to: &str| {
            read(&good.replacen(from, to, 1), &KnobSpace::default()).expect_err("malformed")
        };
        let changed = |to: &str| with(&row, to);
        for (message, says) in [
            (changed(&row.replace(&power, "NaN")), "a.csv:3: power_w: `NaN`"),
            (changed(&row.replace(&power, "0")), "a.csv:3: power_w: `0`"),
            (changed(&row.replace(&power, "watts")), "a.csv:3: power_w: `watts`"),
            (changed("0,0,50%,off,1.0,inf"), "a.csv:3: error: `inf`"),
            (changed("0,0,50%,off,1.0"), "a.csv:3: row:"),
            (changed("0,0,55%,off,1.0,0.1"), "a.csv:3: resolution_scale: `55%`"),
            (changed("5,0,50%,off,1.0,0.1"), "a.csv:3: settings_bits: `5`"),
            (changed("x,0,50%,off,1.0,0.1"), "a.csv:3: settings_bits: `x`"),
            (
                changed("1,32,50%,off,1.0,0.1"),
                "a.csv:4: settings_bits: the same settings as on line 3",
            ),
            (with("antialiasing,power_w", "power_w"), "a.csv:2: header:"),
            (with("settings_bits", "bits"), "a.csv:2: header:"),
            (with("\"knobs\":[", "\"knobs\":{"), "a.csv:1: first line:"),
        ] {
            assert!(message.starts_with(says) && message.contains("; "), "{message}: not {says}");
        }
        for (text, says) in
            [("", "header"), ("a,b\n1,2\n", "header"), ("settings_bits,power_w,error\n", "row")]
        {
            let message = read(text, &space()).expect_err("no table");
            assert!(message.contains(says), "{message}");
        }
        let missing =
            SweepTable::open(Path::new("/no/such.csv"), &space()).expect_err("missing").to_string();
        assert!(
            missing.contains("/no/such.csv") && missing.contains("frugal sweep --csv"),
            "{missing}"
        );
    }
}
