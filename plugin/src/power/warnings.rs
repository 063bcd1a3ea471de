//! One warning for one fault, however long it lasts and however often it comes back.

use std::time::Duration;

/// Faults that were said, by their texts without numbers, with the time when each was there last.
#[derive(Debug, Default)]
pub(crate) struct SaidFaults(Vec<(String, Duration)>);

impl SaidFaults {
    /// A fault is said again after it was gone for this long.
    const SILENCE: Duration = Duration::from_secs(600);
    /// As many different faults are remembered.
    const MAX: usize = 16;

    /// Whether a fault that is there at a time is to be said.
    pub(crate) fn is_new(&mut self, reason: &str, now: Duration) -> bool {
        let is_of_number = |c: &char| c.is_ascii_digit() || ['.', '-'].contains(c);
        let text: String = reason.chars().filter(|c| !is_of_number(c)).collect();
        self.0.retain(|(_, at)| now.saturating_sub(*at) < Self::SILENCE);
        if let Some((_, at)) = self.0.iter_mut().find(|(said, _)| *said == text) {
            *at = now;
            return false;
        }
        if self.0.len() == Self::MAX {
            self.0.remove(0);
        }
        self.0.push((text, now));
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_said_once_however_long_it_lasts_or_flaps() {
        let mut said = SaidFaults::default();
        let mut warnings = 0;
        // An hour of four polls a second: a reason with numbers, one that comes and goes, a third.
        for quarter in 0..14_400_u64 {
            let now = Duration::from_millis(250 * quarter);
            let reason = match quarter % 3 {
                0 => format!("rapl: broken: the counter did not move in {quarter} s"),
                1 if quarter % 200 < 100 => "amdgpu: the GPU sleeps".to_owned(),
                _ => continue,
            };
            warnings += usize::from(said.is_new(&reason, now));
        }
        assert_eq!(warnings, 2);
        let later = Duration::from_secs(3600 + 700);
        assert!(said.is_new("amdgpu: the GPU sleeps", later), "it was gone for ten minutes");
        for fault in 'a'..='z' {
            assert!(said.is_new(&fault.to_string(), later));
        }
        assert!(said.0.len() <= SaidFaults::MAX);
    }
}
