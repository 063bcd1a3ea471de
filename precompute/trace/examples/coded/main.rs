//! How often a code in the light is found in a picture, and how often one that is not there.
//!
//! `cargo run -p frugal_trace --features coded --example coded -- [SEEDS [PICTURE.png]]`
//!
//! 200 pictures a seed, by kind and by detector: false alarms of the three codes of one channel and
//! of the code of three channels, then detections by exposure. Half of the light on average is not
//! modulated at most. The picture shows eight of them, each without and with a code.

mod corpus;
mod hidden;

use std::error::Error;
use std::path::Path;

use corpus::{KINDS, Rate, SIZE};
use frugal_trace::coded::{CODES, CodedError, Detector, ratios};
use frugal_trace::metrics::{Picture, Radiance, tone};

/// Exposures, 1 ÷ second.
const EXPOSURES: [f64; 4] = [4000.0, 2000.0, 1000.0, 500.0];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let seeds: u64 = arguments.next().map_or(Ok(1), |text| text.parse())?;
    for seed in 0..seeds {
        for (name, detector) in [("published", Detector::default()), ("strict", Detector::strict())]
        {
            table(seed, name, &detector)?;
        }
    }
    if let Some(file) = arguments.next() {
        picture()?.write_png(Path::new(&file))?;
    }
    Ok(())
}

/// Prints the rates of one seed.
fn table(seed: u64, name: &str, detector: &Detector) -> Result<(), CodedError> {
    let colors = Detector { colors: true, ..*detector };
    let all = ratios(&CODES.concat());
    let mut rates = vec![[[Rate::default(); 4]; 1 + EXPOSURES.len()]; KINDS.len() + 1];
    for mut case in corpus::all(seed) {
        let kind = KINDS.iter().position(|kind| kind.0 == case.kind).unwrap_or(0);
        let mut add = |column: usize, code: usize, image: &Radiance| -> Result<(), CodedError> {
            let found = match code {
                3 => colors.detect(image, &all)?,
                _ => detector.detect(image, &ratios(&CODES[code]))?,
            };
            for row in [kind, KINDS.len()] {
                rates[row][column][code].add(found.is_protected());
            }
            Ok(())
        };
        let clean = hidden::clean(&case)?;
        for code in 0..4 {
            add(0, code, &clean)?;
        }
        for (i, per_second) in EXPOSURES.into_iter().enumerate() {
            for code in 0..3 {
                let image = hidden::coded(&mut case, [code; 3], 1.0 / per_second)?;
                add(1 + i, code, &image)?;
            }
            add(1 + i, 3, &hidden::coded(&mut case, [0, 1, 2], 1.0 / per_second)?)?;
        }
    }
    for (rates, kind) in rates.iter().zip(KINDS.iter().map(|kind| kind.0).chain(["all"])) {
        let row = |column: &[Rate; 4]| {
            let text = column.map(|rate| format!("{:3.0}", 100.0 * rate.share()));
            text.join(" ")
        };
        println!(
            "seed {seed} {name:9} {kind:8} alarms {} | found at {}",
            row(&rates[0]),
            EXPOSURES
                .iter()
                .zip(&rates[1..])
                .map(|(per_second, column)| format!("1/{per_second}: {}", row(column)))
                .collect::<Vec<_>>()
                .join("  ")
        );
    }
    let [low, high] = rates[KINDS.len()][0][0].interval().map(|share| 100.0 * share);
    println!(
        "seed {seed} {name:9} alarms of the first code in all: {low:.1} to {high:.1} % (95 %)"
    );
    Ok(())
}

/// Eight pictures side by side, each without and with a code, half as high as they are.
fn picture() -> Result<Picture, Box<dyn Error>> {
    let mut columns = Vec::new();
    for mut case in corpus::all(0).step_by(25) {
        let clean = hidden::clean(&case)?;
        let coded = hidden::coded(&mut case, [0, 1, 2], 1.0 / 1500.0)?;
        let exposure = tone::middle_grey_ev100(&clean);
        columns.extend([clean, coded].map(|image| tone::display(&image, exposure)));
    }
    let width = SIZE.x * columns.len() as u32;
    Ok(Picture::from_fn(width, SIZE.y / 2, |x, y| {
        columns[(x / SIZE.x) as usize].rgb[(2 * y * SIZE.x + x % SIZE.x) as usize]
    }))
}
