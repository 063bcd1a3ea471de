//! Changes of single knobs in a log.

use bevy_frugal_gi_tools::control_log::ControlSample;

/// A knob whose level changes in a log.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct KnobChange {
    /// The knob.
    pub name: String,
    /// Number of samples whose level differs from that of the sample before.
    pub changes: usize,
    /// Its levels with the share of the samples that have them, the most frequent first.
    pub levels: Vec<(String, f64)>,
}

/// The knobs whose levels change over `samples` of one camera, in the order of their names in the
/// log.
pub(crate) fn changes(samples: &[ControlSample]) -> Vec<KnobChange> {
    let mut knobs: Vec<KnobChange> = Vec::new();
    let mut before: Vec<(&str, &str)> = Vec::new();
    for sample in samples {
        let levels: Vec<(&str, &str)> = levels(&sample.settings).collect();
        for (name, level) in &levels {
            let index = knobs.iter().position(|knob| knob.name == *name).unwrap_or_else(|| {
                knobs.push(KnobChange { name: (*name).to_owned(), changes: 0, levels: Vec::new() });
                knobs.len() - 1
            });
            let knob = &mut knobs[index];
            let is_changed = before.iter().any(|(other, was)| other == name && was != level);
            knob.changes += usize::from(is_changed);
            match knob.levels.iter_mut().find(|(known, _)| known == level) {
                Some((_, count)) => *count += 1.0,
                None => knob.levels.push(((*level).to_owned(), 1.0)),
            }
        }
        if !levels.is_empty() {
            before = levels;
        }
    }
    knobs.retain(|knob| knob.changes > 0);
    for knob in &mut knobs {
        let count: f64 = knob.levels.iter().map(|(_, count)| count).sum();
        knob.levels.iter_mut().for_each(|(_, share)| *share /= count);
        knob.levels.sort_by(|a, b| b.1.total_cmp(&a.1));
    }
    knobs
}

/// Knobs and levels of settings as an app describes them: `a=1,b=on`.
fn levels(settings: &str) -> impl Iterator<Item = (&str, &str)> {
    settings.split([',', ' ']).filter_map(|part| part.split_once('='))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_knobs_that_change_are_counted() {
        let sample = |settings: &str| ControlSample {
            settings: settings.to_owned(),
            ..ControlSample::default()
        };
        let samples = ["", "a=1,b=off", "a=2,b=off", "a=2,b=off", "a=1,b=off,c=x"].map(sample);
        let levels = vec![("1".to_owned(), 0.5), ("2".to_owned(), 0.5)];
        assert_eq!(changes(&samples), [KnobChange { name: "a".into(), changes: 2, levels }]);
        assert!(changes(&[]).is_empty() && changes(&[sample("odd"), sample("=,=")]).is_empty());
    }
}
