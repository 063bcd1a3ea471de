//! What a journal's file holds: lines of text, each with a checksum.

use frugal_core::frontier::CostPoint;

use super::JournalHeader;

/// First word of a journal, with the version of its format: of its lines, and of what is counted in
/// them.
pub(super) const MAGIC: &str = "frugal-journal 4";

/// A hash of `text`: FNV-1a, 64 bits (Fowler, Noll, Vo 1991). It detects accidental damage, not
/// forgery.
pub fn hash(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// A record of what was asked for, and its cost: exact bits, so that it reads back as it was rendered.
pub fn cost_record(question: &str, cost: CostPoint) -> String {
    format!("{question} {:016x} {:016x}", cost.power.0.to_bits(), cost.error.to_bits())
}

/// What a [`cost_record`] says; `None` for other records.
pub fn read_cost(record: &str) -> Option<(&str, CostPoint)> {
    let mut words = record.rsplitn(3, ' ');
    let mut number = || u64::from_str_radix(words.next()?, 16).ok().map(f64::from_bits);
    let (error, power) = (number()?, number()?);
    Some((words.next()?, CostPoint::new(power, error)))
}

/// `text` as a line with its checksum.
pub(super) fn line(text: &str) -> String {
    format!("{text} {:016x}\n", hash(text))
}

/// The text of a line with a valid checksum.
fn checked(line: &[u8]) -> Option<&str> {
    let (text, sum) = std::str::from_utf8(line).ok()?.strip_suffix('\n')?.rsplit_once(' ')?;
    // Compared as text, so that only one spelling of the number passes.
    (sum == format!("{:016x}", hash(text))).then_some(text)
}

/// The valid lines of a journal.
pub(super) struct Contents {
    pub header: JournalHeader,
    pub records: Vec<String>,
    /// Bytes up to the end of the last complete line.
    pub end: usize,
    /// Complete lines that are damaged.
    pub damaged: usize,
}

impl Contents {
    /// `None` where the header is invalid. A torn last line is left out, as are damaged ones.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let mut lines =
            bytes.split_inclusive(|byte| *byte == b'\n').filter(|line| line.ends_with(b"\n"));
        let first = lines.next()?;
        let header = JournalHeader::read(checked(first)?)?;
        let mut contents = Self { header, records: Vec::new(), end: first.len(), damaged: 0 };
        for line in lines {
            contents.end += line.len();
            match checked(line) {
                Some(record) => contents.records.push(record.to_owned()),
                None => contents.damaged += 1,
            }
        }
        Some(contents)
    }
}

/// Whether the run that made the file was killed before its first line was complete. After a power
/// cut there may be zeros.
pub(super) fn is_unbegun(bytes: &[u8]) -> bool {
    let zeros = bytes.iter().rev().take_while(|byte| **byte == 0).count();
    let bytes = &bytes[..bytes.len() - zeros];
    let begins = bytes.starts_with(MAGIC.as_bytes()) || MAGIC.as_bytes().starts_with(bytes);
    begins && !bytes.contains(&b'\n')
}

/// Whether the file is ours, of whatever version.
pub(super) fn is_of_us(bytes: &[u8]) -> bool {
    let name = MAGIC.split(' ').next().unwrap_or(MAGIC);
    bytes.starts_with(name.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_changed_byte_is_found() {
        let whole = line("m 1 2 3 0 f 0 0");
        assert!(checked(whole.as_bytes()).is_some());
        for index in 0..whole.len() {
            let mut bytes = whole.as_bytes().to_vec();
            bytes[index] ^= 1;
            assert!(checked(&bytes).is_none(), "{index}");
        }
    }
}
