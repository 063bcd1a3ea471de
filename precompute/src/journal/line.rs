//! A journal's lines: text with a checksum over the whole file up to it.

/// A checksum over everything so far: FNV-1a, 64 bits (Fowler, Noll, Vo 1991). It detects
/// accidental damage, not forgery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Checksum(u64);

impl Checksum {
    pub(super) const START: Self = Self(0xcbf2_9ce4_8422_2325);

    pub(super) fn with(self, text: &str) -> Self {
        Self(text.bytes().fold(self.0, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
        }))
    }
}

/// `text` as a line with its checksum, and the state for the next line.
pub(super) fn line(text: &str, before: Checksum) -> (String, Checksum) {
    let checksum = before.with(text);
    (format!("{text} {:016x}\n", checksum.0), checksum)
}

/// The text of a complete line (without its end) with a valid checksum, and the state for the next
/// line.
pub(super) fn checked(line: &str, before: Checksum) -> Option<(&str, Checksum)> {
    let (text, sum) = line.rsplit_once(' ')?;
    let checksum = before.with(text);
    // Compared as text, so that only one spelling of the number passes.
    (sum == format!("{:016x}", checksum.0)).then_some((text, checksum))
}

/// A hash of `text`.
pub(crate) fn hash(text: &str) -> u64 {
    Checksum::START.with(text).0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_changed_byte_is_found() {
        let (whole, _) = line("m 1 2 3 0 f 0 0", Checksum::START);
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
}
