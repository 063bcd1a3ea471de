//! Closed forms against quadrature, and the claims about lights, each in a sweep.

use super::*;
use crate::metrics::Radiance;

fn wave(frequency: f64, duty: f64, phase: f64) -> Waveform {
    Waveform::new(frequency, duty, phase, 10_000.0).expect("a wave")
}

fn shutter(exposure: f64, row_time: f64, rows: u32) -> Shutter {
    Shutter::new(exposure, row_time, rows).expect("a shutter")
}

/// Rows of the cameras.
const ROWS: u32 = 20_000;

/// Light and width of the stripes of a square wave: Zhu et al. 2017, equations 3 to 6. Light ramps
/// linearly between them.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stripes {
    /// Light of the brightest and darkest rows: the peak's unit × seconds.
    bright: f64,
    /// See `bright`.
    dark: f64,
    /// Rows of full light in each stripe; infinite where there are no stripes.
    bright_rows: f64,
    /// Rows of least light in each stripe; infinite where there are no stripes.
    dark_rows: f64,
}

impl Stripes {
    /// The stripes of `wave` in a frame of `shutter`.
    ///
    /// Where the exposure is a whole number of periods, to a billionth of one, all rows have the light of
    /// that many.
    fn new(wave: &Waveform, shutter: &Shutter) -> Self {
        let period = 1.0 / wave.frequency();
        let (on, off) = (period * wave.duty(), period * (1.0 - wave.duty()));
        let periods = shutter.exposure * wave.frequency();
        let (whole, rest) = (periods.floor(), periods - periods.floor());
        if rest.min(1.0 - rest) < 1e-9 {
            let light = wave.peak() * on * periods.round();
            return Self {
                bright: light,
                dark: light,
                bright_rows: f64::INFINITY,
                dark_rows: f64::INFINITY,
            };
        }
        let rest = rest * period;
        Self {
            bright: wave.peak() * (whole * on + rest.min(on)),
            dark: wave.peak() * (whole * on + (rest - off).max(0.0)),
            bright_rows: (rest - on).abs() / shutter.row_time,
            dark_rows: (rest - off).abs() / shutter.row_time,
        }
    }
}

/// Brightest ÷ darkest light of stripes, at least 1.
fn contrast(stripes: Stripes) -> f64 {
    if stripes.bright == stripes.dark { 1.0 } else { stripes.bright / stripes.dark }
}

/// The least standard deviation ÷ mean that a light's stripes have at one of these exposures.
fn faintest(modulation: &impl Modulation, exposures: impl IntoIterator<Item = f64>) -> f64 {
    let deviation = |exposure: f64| {
        let profile = shutter(exposure, 1.0 / 75_000.0, 2448).profile(modulation, 0.0);
        let (count, mean) = (2448.0, profile.iter().sum::<f64>() / 2448.0);
        (profile.iter().map(|row| (row / mean - 1.0).powi(2)).sum::<f64>() / count).sqrt()
    };
    exposures.into_iter().map(deviation).fold(f64::INFINITY, f64::min)
}

/// The midpoint rule on the square wave itself.
fn quadrature(wave: &Waveform, phase: f64, start: f64, duration: f64) -> f64 {
    let steps = 40_000;
    let is_on = |i: usize| {
        let time = start + (i as f64 + 0.5) / steps as f64 * duration;
        (time * wave.frequency() + phase).rem_euclid(1.0) < wave.duty()
    };
    wave.peak() * duration * (0..steps).filter(|i| is_on(*i)).count() as f64 / steps as f64
}

#[test]
fn a_rows_light_is_the_integral_of_the_wave() {
    for frequency in [60.0, 100.0, 437.0, 12_345.0] {
        for duty in [0.0, 0.1, 0.5, 0.9, 1.0] {
            for phase in [0.0, 0.3, -7.45] {
                let wave = wave(frequency, duty, phase);
                for (start, duration) in [(0.0, 0.01), (0.0123, 1e-4), (-3.3, 0.0033), (9.7, 0.02)]
                {
                    let exact = wave.light(start, duration);
                    let found = quadrature(&wave, phase, start, duration);
                    // Each edge of the wave costs at most half a step.
                    let edges = 2.0 * (duration * frequency + 1.0);
                    let tolerance = wave.peak() * duration * edges / 40_000.0 + 1e-9;
                    assert!((exact - found).abs() <= tolerance, "{wave:?} {start} {duration}");
                }
            }
        }
    }
}

#[test]
fn stripes_have_their_closed_forms_in_sweeps_of_exposure_and_read_out() {
    for duty in [0.2, 0.5, 0.7] {
        for exposure in [0.0003, 0.0012, 0.0025, 0.0041, 0.0077, 0.0133] {
            for per_second in [30_000.0, 75_000.0, 100_000.0] {
                let (frequency, row_time) = (100.0 * 7.3, 1.0 / per_second);
                let wave = wave(frequency, duty, 0.37);
                let camera = shutter(exposure, row_time, ROWS);
                let stripes = Stripes::new(&wave, &camera);
                let rows: Vec<f64> =
                    (0..ROWS).map(|row| wave.light(f64::from(row) * row_time, exposure)).collect();
                let brightest = rows.iter().copied().fold(0.0, f64::max);
                let darkest = rows.iter().copied().fold(f64::INFINITY, f64::min);
                // A level of less than a row's width can lie between two rows.
                let step = wave.peak() * row_time;
                assert!((brightest - stripes.bright).abs() <= step, "{stripes:?} {brightest}");
                assert!((darkest - stripes.dark).abs() <= step, "{stripes:?} {darkest}");
                let periods = f64::from(ROWS) * row_time * frequency;
                for (level, width) in
                    [(stripes.bright, stripes.bright_rows), (stripes.dark, stripes.dark_rows)]
                {
                    let near = rows.iter().filter(|row| (**row - level).abs() < 1e-6 * step);
                    let found = near.count() as f64 / periods;
                    assert!((found - width).abs() < 0.1 + 2.0 * width / periods, "{found} {width}");
                }
                let mean = rows.iter().sum::<f64>() / rows.len() as f64;
                let steady = wave.mean() * exposure;
                assert!((mean / steady - 1.0).abs() < 2.0 / periods / duty, "{mean} {steady}");
            }
        }
    }
}

#[test]
fn whole_periods_are_flat_and_short_exposures_black() {
    for periods in [1, 2, 7, 40] {
        let frequency = authorised_frequency(0.008, periods).expect("a frequency");
        let camera = shutter(0.008, 1.0 / 75_000.0, 2448);
        let flat = camera.profile(&wave(frequency, 0.4, 0.2), 1.7);
        assert!(flat.iter().all(|row| (row - 1.0).abs() < 1e-9));
        let stripes = Stripes::new(&wave(frequency, 0.4, 0.2), &camera);
        assert_eq!((contrast(stripes), stripes.bright_rows), (1.0, f64::INFINITY));
        // One per cent off, stripes come back with the contrast of the closed form.
        let off = shutter(0.00808, 1.0 / 75_000.0, 2448);
        let profile = off.profile(&wave(frequency, 0.4, 0.2), 1.7);
        let most = profile.iter().copied().fold(0.0, f64::max);
        let least = profile.iter().copied().fold(f64::INFINITY, f64::min);
        let exact = contrast(Stripes::new(&wave(frequency, 0.4, 0.2), &off));
        assert!(exact > 1.0 && (most / least - exact).abs() < 1e-6, "{most} {least}");
    }
    let short = Stripes::new(&wave(100.0, 0.5, 0.0), &shutter(0.004, 1e-5, 10));
    assert!(short.dark == 0.0 && contrast(short) == f64::INFINITY);
    let after = |whole: f64| {
        let camera = shutter(0.01 * whole + 0.005, 1e-5, 10);
        contrast(Stripes::new(&wave(100.0, 0.5, 0.0), &camera))
    };
    assert!(after(1.0) > after(3.0) && after(3.0) > after(30.0));
    assert!((after(1000.0) - 1.0).abs() < 1e-2);
}

#[test]
fn a_sequence_is_the_sum_of_its_waves() {
    let waves = [(0.004, wave(400.0, 0.5, 0.1)), (0.007, wave(333.0, 0.25, 0.0))];
    let sequence = Sequence::new(waves).expect("waves");
    let parts = |start: f64, duration: f64| {
        let steps = 30_000;
        let at = |i: usize| {
            let time = (start + (i as f64 + 0.5) / steps as f64 * duration).rem_euclid(0.011);
            let (time, wave, phase) = if time < 0.004 {
                (time, waves[0].1, 0.1)
            } else {
                (time - 0.004, waves[1].1, 0.0)
            };
            let is_on = (time * wave.frequency() + phase).rem_euclid(1.0) < wave.duty();
            if is_on { wave.peak() } else { 0.0 }
        };
        (0..steps).map(at).sum::<f64>() * duration / steps as f64
    };
    for (start, duration) in
        [(0.0, 0.011), (0.002, 0.004), (0.0105, 0.001), (-0.3, 0.05), (7.0, 0.0)]
    {
        let (found, exact) = (parts(start, duration), sequence.light(start, duration));
        assert!((found - exact).abs() < 2e-3 * 10_000.0 * duration + 1e-12, "{start} {duration}");
    }
    assert!((sequence.light(0.3, 1100.0) / 1100.0 / sequence.mean() - 1.0).abs() < 1e-4);
}

#[test]
fn scrambling_leaves_no_good_exposure_below_a_whole_pattern() {
    // The whole pattern lasts 10 ms: that exposure is flat whatever the frequencies.
    let exposures = || (1..=190).map(|i| f64::from(i) * 5e-5);
    let single = faintest(&wave(200.0, 0.5, 0.0), exposures());
    assert!(single < 1e-9, "one frequency is undone by one exposure: {single}");
    for step in [10.0, 25.0, 50.0, 75.0, 100.0] {
        let modulation = Sequence::scrambled(2, 200.0, step, 0.5, 1.0).expect("a light");
        let found = faintest(&modulation, exposures());
        assert!(found > 0.04, "{step}: {found}");
        let whole = faintest(&modulation, [0.01]);
        assert!(whole < 1e-9, "{step}: {whole}");
    }
}

#[test]
fn scrambled_light_does_not_flicker() {
    for (count, rate) in [(2, 200.0), (3, 300.0), (4, 400.0), (5, 500.0), (6, 600.0)] {
        let modulation = Sequence::scrambled(count, rate, 50.0, 0.5, 1.0).expect("published");
        // At a multiple of 100 Hz, so that no harmonic is mistaken for a lower one.
        let (count, rate) = (16_384, 12_800.0);
        let fourier = crate::fourier::Fourier::at_least(count);
        let sample =
            |i: usize| glam::DVec2::new(modulation.light(i as f64 / rate, 1.0 / rate), 0.0);
        let mut lines: Vec<glam::DVec2> = (0..count).map(sample).collect();
        fourier.forward(&mut lines);
        let greatest = |from: f64, to: f64| {
            let of = |hertz: f64| (hertz / rate * count as f64) as usize;
            let line = |i: usize| lines[i].length() / lines[0].length();
            (of(from).max(1)..of(to)).map(line).fold(0.0, f64::max)
        };
        assert!(greatest(0.0, 99.0) < 1e-9, "{}", greatest(0.0, 99.0));
        assert!(greatest(99.0, 700.0) > 0.1, "{}", greatest(99.0, 700.0));
    }
    for (count, rate, step) in
        [(0, 200.0, 50.0), (3, 80.0, 50.0), (4, 300.0, 50.0), (2, 200.0, 200.0)]
    {
        let refused = Sequence::scrambled(count, rate, step, 0.5, 1.0);
        assert!(refused.is_err(), "{count} {rate} {step}");
    }
}

/// A grey image of `height` rows.
fn grey(height: u32) -> Radiance {
    Radiance { width: 8, height, rgb: vec![[100.0; 3]; 8 * height as usize] }
}

#[test]
fn images_are_composed_by_row_and_channel() {
    let (one, two) = (vec![1.0, 2.0, 0.5], vec![0.0, 1.0, 4.0]);
    let image = compose(&[(&grey(3), [&one, &two, &one]), (&grey(3), [&one; 3])]).expect("fits");
    assert_eq!(image.rgb[0], [200.0, 100.0, 200.0]);
    assert_eq!(image.rgb[23], [100.0, 450.0, 100.0]);
    assert!(compose(&[]).is_err() && compose(&[(&grey(2), [&one; 3])]).is_err());
    assert!(compose(&[(&grey(3), [&one; 3]), (&grey(4), [&one; 3])]).is_err());
}

#[test]
fn ratios_survive_any_exposure_and_read_out() {
    let (code, detector) = (ratios(&CODES[0]), Detector::strict());
    for (row_time, rows) in
        [(1.0 / 30_000.0, 1024), (1.0 / 75_000.0, 2448), (1.0 / 100_000.0, 3200)]
    {
        for exposure in [1.0 / 8000.0, 1.0 / 3000.0, 1.0 / 1100.0] {
            let modulation =
                barcode(&CODES[0], f64::from(rows) * row_time / 3.0, 0.5, 1.0).expect("code");
            let profile = shutter(exposure, row_time, rows).profile(&modulation, 0.123);
            let image = compose(&[(&grey(rows), [&profile; 3])]).expect("fits");
            // The detector does not know the read-out: its band must hold what it takes 75 kHz for.
            let wide = Detector { band: [100.0, 15_000.0], ..detector };
            let verdict = wide.detect(&image, &code).expect("a picture");
            assert!(verdict.is_protected(), "{row_time} {exposure} {verdict:?}");
            let scale = row_time * 30_000.0;
            let is_found = |own: &&f64| {
                verdict.frequencies.iter().any(|found| (found / (*own * scale) - 1.0).abs() < 0.06)
            };
            assert!(CODES[0].iter().filter(is_found).count() >= 2, "{verdict:?}");
        }
    }
    let verdict = detector.detect(&grey(1024), &code).expect("a picture");
    assert_eq!((verdict.matches, verdict.threshold, verdict.is_protected()), (0, 3, false));
    assert_eq!((ratios(&CODES[0]).len(), ratios(&CODES.concat()).len()), (3, 36));
}

#[test]
fn extremes_are_errors_or_finite() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Waveform::new(bad, 0.5, 0.0, 1.0).is_err());
        assert!(Shutter::new(bad, 1e-5, 9).is_err() && Shutter::new(1e-3, bad, 9).is_err());
        assert!(authorised_frequency(bad, 1).is_err());
        assert!(Sequence::new([(bad, wave(100.0, 0.5, 0.0))]).is_err());
    }
    assert!(
        Waveform::new(1.0, 1.5, 0.0, 1.0).is_err() && Waveform::new(1.0, 0.5, 0.0, -1.0).is_err()
    );
    assert!(Waveform::new(1.0, 0.5, f64::NAN, 1.0).is_err() && Sequence::new([]).is_err());
    let off = Waveform::new(100.0, 0.0, 0.0, 1.0).expect("off");
    assert_eq!(shutter(0.01, 1e-5, 2).profile(&off, 0.0), [0.0, 0.0]);
    let code = ratios(&CODES[0]);
    let broken = Radiance { rgb: vec![[f32::NAN; 3]; 8 * 1024], ..grey(1024) };
    assert!(!Detector::default().detect(&broken, &code).expect("rows").is_protected());
    for (image, detector) in [
        (Radiance { width: 0, height: 0, rgb: Vec::new() }, Detector::default()),
        (grey(16), Detector::default()),
        (Radiance { width: 9, ..grey(64) }, Detector::default()),
        (grey(64), Detector { blocks: 0, ..Detector::default() }),
        (grey(64), Detector { peaks: 0, ..Detector::default() }),
        (grey(64), Detector { rows_per_second: f64::NAN, ..Detector::default() }),
    ] {
        assert!(detector.detect(&image, &code).is_err(), "{detector:?}");
    }
    let odd = Detector { band: [f64::NAN, -3.0], ..Detector::default() };
    assert!(odd.detect(&grey(64), &code).is_ok());
    assert!(!Detector::strict().detect(&grey(64), &[f64::NAN]).expect("rows").is_protected());
}
