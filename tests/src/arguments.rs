//! Arguments of the benchmarks that print tables.

use bevy::math::UVec2;

/// Command-line arguments of a benchmark.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arguments {
    /// Width and height of the images, pixels: `--size WxH`.
    pub size: UVec2,
    /// Paths per pixel of the path-traced reference: `--spp N`.
    pub samples: u32,
    /// Number of rounds or frames: `--count N`.
    pub count: u32,
    /// Parts to run; all if empty.
    pub names: Vec<String>,
}

impl Arguments {
    /// Reads the arguments of this process; `self` holds the defaults.
    ///
    /// # Panics
    /// If an argument is invalid.
    #[must_use]
    pub fn read(self) -> Self {
        self.over(std::env::args().skip(1))
    }

    fn over(mut self, mut arguments: impl Iterator<Item = String>) -> Self {
        while let Some(argument) = arguments.next() {
            let mut value =
                || arguments.next().unwrap_or_else(|| panic!("{argument} needs a value"));
            let number =
                |text: &str| text.parse::<u32>().unwrap_or_else(|error| panic!("{text}: {error}"));
            match argument.as_str() {
                "--size" => {
                    let text = value();
                    let (width, height) =
                        text.split_once('x').unwrap_or_else(|| panic!("{text} is no WxH"));
                    self.size = UVec2::new(number(width), number(height));
                }
                "--spp" => self.samples = number(&value()),
                "--count" => self.count = number(&value()),
                // Passed by Cargo.
                "--bench" => (),
                name => self.names.push(name.to_owned()),
            }
        }
        self
    }

    /// Whether to run the part called `name`.
    pub fn wants(&self, name: &str) -> bool {
        self.names.is_empty() || self.names.iter().any(|wanted| wanted == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_override_the_defaults() {
        let defaults =
            Arguments { size: UVec2::new(160, 90), samples: 256, count: 5, names: vec![] };
        let read = |text: &str| defaults.clone().over(text.split_whitespace().map(str::to_owned));
        assert_eq!(read("--bench"), defaults);
        assert!(defaults.wants("anything"));
        let asked = read("--bench --size 64x36 cornell --spp 16");
        assert_eq!(
            asked,
            Arguments {
                size: UVec2::new(64, 36),
                samples: 16,
                names: vec!["cornell".into()],
                ..defaults
            }
        );
        assert!(asked.wants("cornell") && !asked.wants("courtyard"));
    }
}
