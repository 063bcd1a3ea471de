//! Closed forms against quadrature, and the claims about lights, each in a sweep.

use super::*;
use crate::metrics::Radiance;

fn wave(frequency: f64, duty: f64, phase: f64) -> Waveform {
    Waveform::new(frequency, duty, phase, 10_000.0).expect("a wave")
}

fn shutter(exposure: f64, row_time: f64, rows: u32) -> Shutter {
    Shutter::new(exposure, row_time, rows).expect("a shutter")
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
                let camera = shutter(exposure, row_time, 20_000);
                let stripes = Stripes::new(&wave, &camera);
                let rows: Vec<f64> = (0..camera.rows())
                    .map(|row| wave.light(f64::from(row) * row_time, exposure))
                    .collect();
                let brightest = rows.iter().copied().fold(0.0, f64::max);
                let darkest = rows.iter().copied().fold(f64::INFINITY, f64::min);
                // A level of less than a row's width can lie between two rows.
                let step = wave.peak() * row_time;
                assert!((brightest - stripes.bright).abs() <= step, "{stripes:?} {brightest}");
                assert!((darkest - stripes.dark).abs() <= step, "{stripes:?} {darkest}");
                let periods = f64::from(camera.rows()) * row_time * frequency;
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
        assert_eq!((stripes.contrast(), stripes.bright_rows), (1.0, f64::INFINITY));
        // One per cent off, stripes come back with the contrast of the closed form.
        let off = shutter(0.00808, 1.0 / 75_000.0, 2448);
        let profile = off.profile(&wave(frequency, 0.4, 0.2), 1.7);
        let most = profile.iter().copied().fold(0.0, f64::max);
        let least = profile.iter().copied().fold(f64::INFINITY, f64::min);
        let contrast = Stripes::new(&wave(frequency, 0.4, 0.2), &off).contrast();
        assert!(contrast > 1.0 && (most / least - contrast).abs() < 1e-6, "{most} {least}");
    }
    let short = Stripes::new(&wave(100.0, 0.5, 0.0), &shutter(0.004, 1e-5, 10));
    assert!(short.dark == 0.0 && short.contrast() == f64::INFINITY);
    let contrast = |whole: f64| {
        Stripes::new(&wave(100.0, 0.5, 0.0), &shutter(0.01 * whole + 0.005, 1e-5, 10)).contrast()
    };
    assert!(contrast(1.0) > contrast(3.0) && contrast(3.0) > contrast(30.0));
    assert!((contrast(1000.0) - 1.0).abs() < 1e-2);
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
    let (row_time, rows) = (1.0 / 75_000.0, 2448);
    // The whole pattern lasts 10 ms: that exposure is flat whatever the frequencies.
    let exposures = || (1..=190).map(|i| f64::from(i) * 5e-5);
    let single =
        worst_exposure(&wave(200.0, 0.5, 0.0), exposures(), row_time, rows).expect("exposures");
    assert!(single.1 < 1e-9, "one frequency is undone by one exposure: {single:?}");
    for step in [10.0, 25.0, best_step(0.01), 75.0, 100.0] {
        let modulation =
            Scramble::new(2, 200.0, step).and_then(|scramble| scramble.sequence(0.5, 1.0));
        let modulation = modulation.expect("a light");
        let found = worst_exposure(&modulation, exposures(), row_time, rows).expect("exposures");
        assert!(found.1 > 0.04, "{step}: {found:?}");
        let whole = worst_exposure(&modulation, [0.01], row_time, rows).expect("an exposure");
        assert!(whole.1 < 1e-9, "{step}: {whole:?}");
    }
}

#[test]
fn scrambled_light_does_not_flicker() {
    for (count, rate) in [(2, 200.0), (3, 300.0), (4, 400.0), (5, 500.0), (6, 600.0)] {
        let scramble = Scramble::new(count, rate, 50.0).expect("published");
        assert_eq!(scramble.pattern_rate(), 100.0);
        assert_eq!(scramble.frequencies().len(), count as usize);
        let modulation = scramble.sequence(0.5, 1.0).expect("a light");
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
        assert!(Scramble::new(count, rate, step).is_err(), "{count} {rate} {step}");
    }
}

#[test]
fn recovery_takes_the_frames_of_the_formula() {
    let attack = |duty, levels, channels| Attack::new(duty, levels, 2448, channels).expect("valid");
    for (duty, levels, channels, frames) in [
        (0.5, 10, 1, 145.0),
        (0.5, 100, 1, 1450.0),
        (0.2, 100, 1, 4505.0),
        (0.5, 10, 3, 161.0),
        (0.5, 100, 3, 1609.0),
        (0.2, 100, 3, 4998.0),
    ] {
        let found = attack(duty, levels, channels).frames(Draw::Balanced, 0.9).expect("a share");
        assert!((found - frames).abs() < 1.0, "{found} is not {frames}");
        let back = attack(duty, levels, channels).probability(Draw::Balanced, found);
        assert!((back - 0.9).abs() < 1e-9);
    }
    let chance = |duty, levels, frames| attack(duty, levels, 1).probability(Draw::Balanced, frames);
    assert!(chance(0.5, 10, 150.0) > chance(0.5, 10, 140.0));
    assert!(chance(0.6, 10, 140.0) > chance(0.5, 10, 140.0));
    assert!(chance(0.5, 11, 140.0) < chance(0.5, 10, 140.0));
    assert_eq!(attack(0.0, 10, 1).frames(Draw::Balanced, 0.9), Ok(f64::INFINITY));
}

#[test]
fn a_simulated_attack_succeeds_as_often_as_the_formulas_say() {
    let (duty, levels, rows, frames, trials) = (0.5, 4, 20, 24_u32, 2000_u64);
    let attack = Attack::new(duty, levels, rows, 1).expect("valid");
    for draw in [Draw::Balanced, Draw::Independent] {
        let succeeds = |trial: u64| {
            let mut sampler = crate::sampler::Sampler::new(5, trial, 0);
            let mut is_missing = vec![true; rows as usize];
            for frame in 0..frames {
                for missing in &mut is_missing {
                    let has_level = match draw {
                        Draw::Balanced => frame % levels == 0,
                        Draw::Independent => sampler.number() * f64::from(levels) < 1.0,
                    };
                    *missing &= !(has_level && sampler.number() < duty);
                }
            }
            is_missing.iter().all(|missing| !missing)
        };
        let share = (0..trials).filter(|trial| succeeds(*trial)).count() as f64 / trials as f64;
        let exact = attack.probability(draw, f64::from(frames));
        let tolerance = 4.0 * (exact * (1.0 - exact) / trials as f64).sqrt();
        assert!((share - exact).abs() < tolerance, "{draw:?}: {share} is not {exact}");
    }
}

#[test]
fn random_intensities_stay_within_their_levels() {
    let modulation = Sequence::random_intensities(500.0, 0.5, 8.0, 4, 400, 3).expect("a light");
    let peaks: Vec<f64> =
        (0..400).map(|i| modulation.light(f64::from(i) / 500.0, 0.001) / 0.001).collect();
    for level in [2.0, 4.0, 6.0, 8.0] {
        let count = peaks.iter().filter(|peak| (**peak - level).abs() < 1e-6).count();
        // 100 of 400 expected, standard deviation 8.7.
        assert!((65..=135).contains(&count), "{count} at {level}");
    }
    assert!(Sequence::random_intensities(500.0, 0.5, 8.0, 0, 400, 3).is_err());
    assert!(Sequence::random_intensities(500.0, 0.5, 8.0, 4, 0, 3).is_err());
}

#[test]
fn one_camera_is_let_in_and_others_are_not() {
    let own = shutter(0.005, 1.0 / 75_000.0, 2448);
    let modulation = dynamic(&own, 5, 0.004, 300.0, 0.5, 1.0).expect("a light");
    for frame in [0.0, 1.0, 7.0] {
        let own = own.profile(&modulation, frame * modulation.period());
        assert!(deviation(&own) < 1e-9, "{frame}");
    }
    let other = shutter(0.0035, 1.0 / 75_000.0, 2448);
    assert!(deviation(&other.profile(&modulation, 0.0)) > 0.05);

    for (duty, count) in [(0.5, 2), (0.25, 4), (0.5, 6)] {
        let frames = critical_frames(317.0, duty, 1.0, count).expect("frames");
        let profiles: Vec<Vec<f64>> =
            frames.iter().map(|frame| other.profile(frame, 0.0)).collect();
        let mean = |row: usize| profiles.iter().map(|profile| profile[row]).sum::<f64>();
        assert!((0..2448).all(|row| (mean(row) / f64::from(count) - 1.0).abs() < 1e-9));
        assert!(profiles.iter().all(|profile| deviation(profile) > 0.05));
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
    let striped = compose(&[(&grey(3), [&one; 3])]).expect("fits");
    assert_eq!(psnr(&grey(3), &grey(3), 255.0), Ok(f64::INFINITY));
    // Means of 7/6: rows are 6/7, 12/7 and 3/7 of the reference.
    let squared = ((1.0f64 / 7.0).powi(2) + (5.0f64 / 7.0).powi(2) + (4.0f64 / 7.0).powi(2)) / 3.0;
    let exact = 20.0 * (255.0 / (100.0 * squared.sqrt())).log10();
    let found = psnr(&grey(3), &striped, 255.0).expect("fits");
    assert!((found - exact).abs() < 1e-4, "{found} is not {exact}");
    assert!(psnr(&grey(3), &grey(3), 50.0).expect("fits") < 1.0, "overexposure is an error");
    assert!(psnr(&grey(3), &grey(4), 255.0).is_err());
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
    assert!(Attack::new(0.5, 0, 9, 1).is_err() && Attack::new(f64::NAN, 1, 9, 1).is_err());
    let off = Waveform::new(100.0, 0.0, 0.0, 1.0).expect("off");
    assert_eq!(shutter(0.01, 1e-5, 2).profile(&off, 0.0), [0.0, 0.0]);
    assert_eq!((deviation(&[]), worst_exposure(&off, [], 1e-5, 9)), (0.0, None));
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
