//! The journal's lines: a header and records, each with a checksum that covers everything before it.

use bevy_frugal_gi::frontier::CostPoint;
use bevy_frugal_gi::knobs::{KnobSpace, RenderSettings};

use super::{CameraKey, JournalHeader, SampleCamera};

/// First word of a journal, with the version of its format.
pub(super) const MAGIC: &str = "frugal-journal 1";

/// What a record answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Question {
    /// An evaluation.
    Evaluate(CameraKey, RenderSettings),
    /// A refinement.
    Refine(CameraKey, RenderSettings),
    /// How many evaluations a camera was allowed.
    Allow(CameraKey),
}

impl Question {
    pub(super) fn evaluate(camera: SampleCamera, settings: RenderSettings) -> Self {
        Self::Evaluate(camera.key(), settings)
    }

    pub(super) fn refine(camera: SampleCamera, settings: RenderSettings) -> Self {
        Self::Refine(camera.key(), settings)
    }

    fn parts(self) -> (char, CameraKey, RenderSettings) {
        match self {
            Self::Evaluate(camera, settings) => ('e', camera, settings),
            Self::Refine(camera, settings) => ('r', camera, settings),
            Self::Allow(camera) => ('a', camera, RenderSettings::default()),
        }
    }
}

/// An answer: two numbers, bit by bit. An allowance is the first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Answer(pub(super) [u64; 2]);

impl From<CostPoint> for Answer {
    fn from(cost: CostPoint) -> Self {
        Self([cost.power.0.to_bits(), cost.error.to_bits()])
    }
}

impl Answer {
    pub(super) fn cost(self) -> CostPoint {
        CostPoint::new(f64::from_bits(self.0[0]), f64::from_bits(self.0[1]))
    }
}

/// A checksum over everything so far: FNV-1a, 64 bits (Fowler, Noll, Vo 1991). It finds accidents, not forgeries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Checksum(u64);

impl Checksum {
    pub(super) const START: Self = Self(0xcbf2_9ce4_8422_2325);

    pub(super) fn with(self, text: &str) -> Self {
        Self(text.bytes().fold(self.0, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)))
    }

    pub(super) const fn value(self) -> u64 {
        self.0
    }
}

/// `text` as a line with its checksum, and the checksum for the next.
pub(super) fn line(text: &str, before: Checksum) -> (String, Checksum) {
    let checksum = before.with(text);
    (format!("{text} {:016x}\n", checksum.0), checksum)
}

/// The text of a whole line (without its end) whose checksum is right, and the checksum for the next.
pub(super) fn checked(line: &str, before: Checksum) -> Option<(&str, Checksum)> {
    let (text, sum) = line.rsplit_once(' ')?;
    let checksum = before.with(text);
    // Compared as text, so that no other spelling of the number passes.
    (sum == format!("{:016x}", checksum.0)).then_some((text, checksum))
}

/// A record without its checksum: kind, position, view, settings, and the answer, in hexadecimal.
pub(super) fn write(question: Question, answer: Answer) -> String {
    let (kind, camera, settings) = question.parts();
    let ([x, y, z], [first, second]) = (camera.position, answer.0);
    format!("{kind} {x:08x} {y:08x} {z:08x} {} {:x} {first:016x} {second:016x}", camera.view.index(), settings.bits())
}

/// What [`write()`] wrote.
pub(super) fn read(text: &str) -> Option<(Question, Answer)> {
    let mut words = text.split(' ');
    let kind = words.next()?;
    let mut number = || u64::from_str_radix(words.next()?, 16).ok();
    let mut coordinate = || u32::try_from(number()?).ok();
    let position = [coordinate()?, coordinate()?, coordinate()?];
    let view = *bevy_frugal_gi::frontier::ViewDirection::ALL.get(usize::try_from(number()?).ok()?)?;
    let settings = RenderSettings::from_bits(number()?);
    let answer = Answer([number()?, number()?]);
    let camera = CameraKey { position, view };
    let question = match kind {
        "e" => Question::Evaluate(camera, settings),
        "r" => Question::Refine(camera, settings),
        "a" => Question::Allow(camera),
        _ => return None,
    };
    words.next().is_none().then_some((question, answer))
}

/// The header without its checksum.
pub(super) fn header_text(header: &JournalHeader) -> Result<String, serde_json::Error> {
    Ok(format!("{MAGIC} {}", serde_json::to_string(header)?))
}

/// A number that changes with anything in `space`: a knob's name, order, levels, labels or needs.
///
/// # Errors
/// Never in practice: a knob space can always be written.
pub fn knob_space_hash(space: &KnobSpace) -> Result<u64, serde_json::Error> {
    Ok(Checksum::START.with(&serde_json::to_string(space)?).value())
}

#[cfg(test)]
mod tests {
    use bevy::math::Vec3;
    use bevy_frugal_gi::frontier::ViewDirection;

    use super::*;

    #[test]
    fn records_survive_to_the_last_bit() {
        let camera = SampleCamera { position: Vec3::new(-0.1, f32::MIN_POSITIVE, 1e30), view: ViewDirection::NegativeZ };
        for cost in [CostPoint::new(0.1 + 0.2, 1e-300), CostPoint::new(f64::INFINITY, -0.0)] {
            for question in [Question::evaluate(camera, RenderSettings::from_bits(u64::MAX)), Question::Allow(camera.key())] {
                assert_eq!(read(&write(question, cost.into())), Some((question, cost.into())));
            }
        }
        assert!(Answer::from(CostPoint::new(f64::NAN, 0.0)).cost().power.0.is_nan());
    }

    #[test]
    fn any_changed_byte_is_found() {
        let (whole, _) = line("e 1 2 3 0 f 0 0", Checksum::START);
        let whole = whole.trim_end();
        assert!(checked(whole, Checksum::START).is_some());
        assert!(checked(whole, Checksum::START.with("another line before it")).is_none());
        for index in 0..whole.len() {
            let mut bytes = whole.as_bytes().to_vec();
            bytes[index] ^= 1;
            let changed = String::from_utf8(bytes).expect("still text");
            assert!(checked(&changed, Checksum::START).is_none(), "{changed}");
        }
    }

    #[test]
    fn hash_tells_spaces_apart() {
        use bevy_frugal_gi::knobs::Knob;
        let space = |levels: &[f64]| KnobSpace::new(vec![Knob::new("a", levels.iter().copied())]).expect("a valid space");
        let hash = |levels: &[f64]| knob_space_hash(&space(levels)).expect("can be written");
        assert_eq!(hash(&[1.0, 2.0]), hash(&[1.0, 2.0]));
        assert_ne!(hash(&[1.0, 2.0]), hash(&[1.0, 2.5]));
    }
}
