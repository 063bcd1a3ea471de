//! How much larger errors are in play than at the end of a short clip.
//!
//! A clip of two frames makes a rendering cheap, but its history is short: less noise is averaged
//! than in play, and nothing lags behind. A few settings are therefore rendered once more at a few
//! cameras, at the end of long clips, and all errors of the search are scaled by what these show.

use bevy_frugal_gi::knobs::KnobLevels;

use super::renderings::{Job, Purpose};
use crate::cameras::CameraSet;

/// Frames of a long clip. More come nearer to play; each is a rendered frame at every camera and
/// setting.
pub(super) const FRAMES: u32 = 12;
/// Cameras that render long clips.
const CAMERAS: usize = 5;
/// Errors for which users ask: the settings that come nearest to each are rendered.
const ERRORS: [f64; 3] = [0.01, 0.02, 0.04];
/// Ratios beyond these say that something is broken, not how play differs.
const RATIOS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// The long clips to render: at cameras of tracks among `rendered` where there are any, evenly
/// spread, with settings of `errors`, which holds the mean error of each setting of the pool.
pub(super) fn jobs(
    cameras: &CameraSet,
    rendered: &[usize],
    errors: &[(KnobLevels, f64)],
) -> Vec<Job> {
    let on_tracks: Vec<usize> =
        rendered.iter().copied().filter(|camera| cameras.training[*camera].is_on_track()).collect();
    let from = if on_tracks.is_empty() { rendered } else { &on_tracks };
    let mut settings: Vec<KnobLevels> = Vec::new();
    for wanted in ERRORS {
        let distance = |error: f64| (error / wanted).ln().abs();
        let nearest = errors
            .iter()
            .filter(|(settings_of, error)| *error > 0.0 && !settings.contains(settings_of))
            .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
        settings.extend(nearest.map(|(settings, _)| *settings));
    }
    let count = CAMERAS.min(from.len());
    (0..count)
        .map(|index| Job {
            purpose: Purpose::Play,
            camera: from[index * from.len() / count],
            settings: settings.clone(),
        })
        .collect()
}

/// The ratio of errors in play to those of clips, from pairs of both, one list for each camera.
///
/// It is one standard error above the estimate, since an error budget that is exceeded is worse
/// than one that is not used up. 1 without pairs.
pub(super) fn ratio(cameras: &[Vec<(f64, f64)>]) -> f64 {
    let of = |without: Option<usize>| {
        let pairs = cameras
            .iter()
            .enumerate()
            .filter(|(camera, _)| Some(*camera) != without)
            .flat_map(|(_, pairs)| pairs);
        let (long, short) = pairs.fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
        long / short
    };
    let all = of(None);
    if !all.is_finite() {
        return 1.0;
    }
    // The jackknife over cameras: settings at one camera have their view in common.
    let count = cameras.len() as f64;
    let deviations = (0..cameras.len()).map(|camera| of(Some(camera)) - all);
    let variance = deviations.filter(|deviation| deviation.is_finite()).map(|d| d * d).sum::<f64>();
    let error = (variance * (count - 1.0) / count).sqrt();
    (all + error).clamp(*RATIOS.start(), *RATIOS.end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ratio_is_that_of_sums_and_a_standard_error() {
        assert_eq!(ratio(&[]), 1.0);
        assert_eq!(ratio(&[vec![(0.0, 0.0)]]), 1.0);
        let same = vec![(0.011, 0.01), (0.022, 0.02)];
        assert!((ratio(&[same.clone(), same.clone()]) - 1.1).abs() < 1e-12);
        // Ratios of 1 and 1.2: 1.1, and half of their difference.
        let spread = ratio(&[vec![(0.01, 0.01)], vec![(0.012, 0.01)]]);
        assert!((spread - 1.2).abs() < 1e-12, "{spread}");
        assert_eq!(ratio(&[vec![(1.0, 1e-9)], vec![(1.0, 1e-9)]]), 2.0);
    }
}
