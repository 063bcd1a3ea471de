//! Settings as text: `knob=level` pairs.

use super::{Knob, KnobLevels, KnobSpace, KnobSpaceError, join};

impl KnobSpace {
    /// Parses `max`, `min` and `knob=level` pairs, separated by commas and applied in order,
    /// starting from the best settings. A level is given by its label.
    ///
    /// # Errors
    /// [`KnobSpaceError`] when the text is of another form, or names an unknown knob or level.
    pub fn parse(&self, text: &str) -> Result<KnobLevels, KnobSpaceError> {
        let mut settings = self.highest();
        for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
            match part {
                "max" => settings = self.highest(),
                "min" => settings = self.lowest(),
                _ => {
                    let (name, label) = part
                        .split_once('=')
                        .ok_or_else(|| KnobSpaceError::NotAnAssignment(part.to_owned()))?;
                    let (name, label) = (name.trim(), label.trim());
                    let index = self.index_of(name).ok_or_else(|| self.unknown(name))?;
                    let levels = &self.knobs[index].levels;
                    let level =
                        levels.iter().position(|level| level.label == label).ok_or_else(|| {
                            KnobSpaceError::UnknownLevel {
                                knob: name.to_owned(),
                                level: label.to_owned(),
                                known: join(levels.iter().map(|level| level.label.as_str())),
                            }
                        })?;
                    settings = settings.with_level(index, level);
                }
            }
        }
        Ok(settings)
    }

    /// The settings as `knob=level` pairs separated by commas, as [`parse`](Self::parse) reads
    /// them; `?` for a level that the knob lacks.
    pub fn describe(&self, settings: KnobLevels) -> String {
        let pair = |(index, knob): (usize, &Knob)| {
            let label =
                knob.levels.get(settings.level(index)).map_or("?", |level| level.label.as_str());
            format!("{}={label}", knob.name)
        };
        self.knobs.iter().enumerate().map(pair).collect::<Vec<_>>().join(",")
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::space;
    use super::*;

    #[test]
    fn text_and_settings_round_trip() {
        let space = space();
        for settings in space.iter() {
            assert_eq!(space.parse(&space.describe(settings)), Ok(settings));
        }
        assert_eq!(space.parse("min,antialiasing=FXAA").map(|s| s.level(2)), Ok(1));
        assert!(matches!(space.parse("sharpness=3"), Err(KnobSpaceError::Unknown { .. })));
        assert!(matches!(
            space.parse("antialiasing=MSAA"),
            Err(KnobSpaceError::UnknownLevel { .. })
        ));
        assert!(matches!(space.parse("best"), Err(KnobSpaceError::NotAnAssignment(_))));
    }

    #[test]
    fn a_misspelt_name_or_level_gets_the_nearest_one() {
        let space = space();
        let refused = |text: &str| space.parse(text).expect_err(text).to_string();
        let knob = refused("gi_vpl_cuont=32");
        assert!(knob.contains("did you mean `gi_vpl_count`?"), "{knob}");
        let knob = space.subset(["antialiassing"]).expect_err("no such knob").to_string();
        assert!(knob.contains("did you mean `antialiasing`?"), "{knob}");
        let level = refused("antialiasing=fxaa");
        assert!(level.contains("did you mean `FXAA`?"), "{level}");
        // All names are listed, and none is suggested where none is near.
        for far in ["sharpness=3", "rsm_resolution=512", "antialiasing=MSAA", "=", "a=1"] {
            let message = refused(far);
            assert!(!message.contains("did you mean"), "{message}");
            assert!(
                message.contains("64, 128")
                    || message.contains("FXAA")
                    || message.contains("rsm_resolution"),
                "{message}"
            );
        }
    }
}
