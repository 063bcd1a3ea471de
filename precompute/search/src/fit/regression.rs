//! Errors of settings at views that no camera has rendered, by Gaussian process regression
//! (Rasmussen and Williams 2006, "Gaussian processes for machine learning", chapter 2).
//!
//! Views are alike where they show alike things ([view features](crate::view_features)), and where
//! they are near each other. Logarithms of errors are predicted, with their uncertainty.

use glam::{Quat, Vec3};

use crate::linalg::{cholesky, dot, inverse};
use crate::pool::LEAST_ERROR;
use crate::view_features::ViewFeatures;

/// Unit of distance between viewpoints: metres, and radians of rotation, per step. A camera's weight falls
/// to 1/e with each step: higher values average more cameras, which keeps more error budgets; lower
/// values tell views apart better where cameras are dense.
const STEP: (f32, f32) = (2.0, 0.7);
/// Variances of a linear function of the features, of a smooth one, and of one of position and
/// direction, in parts of a setting's own.
const VARIANCES: [f64; 3] = [0.5, 0.5, 0.4];
/// Range of the function of position and direction, steps.
const REACH: f32 = 1.0;
/// Variance of what neither explains, and of the renderings' noise. Higher values predict means.
const NOISE: f64 = 0.1;

/// A camera's position and direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Viewpoint {
    position: Vec3,
    forward: Vec3,
}

impl Viewpoint {
    pub(crate) fn new(position: Vec3, rotation: Quat) -> Self {
        Self { position, forward: rotation * Vec3::NEG_Z }
    }

    /// Distance of two viewpoints in steps; infinite instead of NaN.
    pub(super) fn steps(&self, other: &Self) -> f32 {
        let metres = self.position.distance(other.position) / STEP.0;
        let turn = self.forward.angle_between(other.forward) / STEP.1;
        if (metres + turn).is_finite() { metres + turn } else { f32::INFINITY }
    }
}

/// Where a view is, and what it shows.
#[derive(Clone, Debug)]
pub(crate) struct DescribedView {
    /// Its position and direction.
    pub viewpoint: Viewpoint,
    /// Its features.
    pub features: ViewFeatures,
}

/// Predicts errors at views from errors at others.
#[derive(Clone, Debug)]
pub(super) struct Regression {
    views: Vec<DescribedView>,
    /// Mean and standard deviation of each feature.
    scale: Vec<(f64, f64)>,
    /// Inverse of the views' covariance.
    inverse: Vec<Vec<f64>>,
    /// By setting.
    settings: Vec<Logarithm>,
}

/// What is known of the logarithm of a setting's error.
#[derive(Clone, Debug)]
struct Logarithm {
    mean: f64,
    /// By view.
    weights: Vec<f64>,
    /// In units of the covariance's.
    variance: f64,
}

impl Regression {
    /// From `errors` by view, then by setting. `None` for fewer than eight views, which say too
    /// little, or for views with different numbers of features.
    pub(super) fn fit(views: Vec<DescribedView>, errors: &[Vec<f64>]) -> Option<Self> {
        let (count, features) = (views.len(), views.first()?.features.len());
        if count < 8
            || errors.len() != count
            || features == 0
            || views.iter().any(|view| view.features.len() != features)
        {
            return None;
        }
        let n = count as f64;
        let scale: Vec<(f64, f64)> = (0..features)
            .map(|feature| {
                let values = || views.iter().map(|view| view.features[feature]);
                let mean = values().sum::<f64>() / n;
                let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / n;
                (mean, variance.sqrt() + 1e-6)
            })
            .collect();
        let views: Vec<DescribedView> =
            views.into_iter().map(|view| scaled(view, &scale)).collect();
        let covariance: Vec<Vec<f64>> = (0..count)
            .map(|a| {
                let noise = |b: usize| if a == b { NOISE } else { 0.0 };
                (0..count).map(|b| covariance(&views[a], &views[b]) + noise(b)).collect()
            })
            .collect();
        let inverse = inverse(&cholesky(&covariance)?);
        let of_setting = |setting: usize| {
            let logarithms: Vec<f64> =
                errors.iter().map(|of_view| (of_view[setting] + LEAST_ERROR).ln()).collect();
            let mean = logarithms.iter().sum::<f64>() / n;
            let beyond: Vec<f64> = logarithms.iter().map(|logarithm| logarithm - mean).collect();
            let weights: Vec<f64> = inverse.iter().map(|row| dot(row, &beyond)).collect();
            // By the residuals with each view left out (Rasmussen and Williams, equation 5.12).
            let squares: f64 = weights
                .iter()
                .enumerate()
                .map(|(view, weight)| weight * weight / inverse[view][view])
                .sum();
            Logarithm { mean, weights, variance: squares / n }
        };
        let settings = (0..errors[0].len()).map(of_setting).collect();
        Some(Self { views, scale, inverse, settings })
    }

    /// Expected errors of all settings at a view: arithmetic means, as budgets need them.
    pub(super) fn errors(&self, view: &DescribedView) -> Vec<f64> {
        let view = scaled(view.clone(), &self.scale);
        let to_views: Vec<f64> = self.views.iter().map(|other| covariance(&view, other)).collect();
        let explained: f64 = self
            .inverse
            .iter()
            .zip(&to_views)
            .map(|(row, to_view)| to_view * dot(row, &to_views))
            .sum();
        let left = (covariance(&view, &view) - explained + NOISE).max(0.0);
        let error = |Logarithm { mean, weights, variance }: &Logarithm| {
            // The mean of a log-normal error.
            let logarithm = mean + dot(weights, &to_views) + variance * left / 2.0;
            let error = logarithm.exp() - LEAST_ERROR;
            if error.is_finite() { error.clamp(0.0, 2.0) } else { 2.0 }
        };
        self.settings.iter().map(error).collect()
    }
}

/// `view` with features of mean 0 and variance 1; `scale`: of each feature.
fn scaled(mut view: DescribedView, scale: &[(f64, f64)]) -> DescribedView {
    for (value, (mean, deviation)) in view.features.iter_mut().zip(scale) {
        *value = (*value - mean) / deviation;
    }
    view
}

/// Covariance of two views' errors, for features of variance 1.
fn covariance(a: &DescribedView, b: &DescribedView) -> f64 {
    let count = a.features.len().max(1) as f64;
    let [linear, smooth, local] = VARIANCES;
    let squares: f64 = a.features.iter().zip(&b.features).map(|(a, b)| (a - b).powi(2)).sum();
    let near = f64::from((-a.viewpoint.steps(&b.viewpoint) / REACH).exp());
    linear * dot(&a.features, &b.features) / count
        + smooth * (-squares / count / 2.0).exp()
        + local * near
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn seen(x: f32, features: [f64; 3]) -> DescribedView {
        let viewpoint = Viewpoint::new(Vec3::X * x, Quat::IDENTITY);
        DescribedView { viewpoint, features: features.to_vec() }
    }

    /// Views far apart from each other, whose errors follow from two of three features.
    fn views(count: usize, seed: u64) -> (Vec<DescribedView>, Vec<Vec<f64>>) {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let views: Vec<DescribedView> = (0..count)
            .map(|_| {
                let mut number = || random.random_range(-1.0..1.0);
                let features = [number(), number(), number()];
                seen(500.0 * number() as f32, features)
            })
            .collect();
        let errors = views
            .iter()
            .map(|view| {
                let [a, b, _] = view.features[..] else { unreachable!("three features") };
                vec![(-4.0 + 0.7 * a).exp(), (-3.0 - 0.5 * a + b * b).exp(), 0.0]
            })
            .collect();
        (views, errors)
    }

    #[test]
    fn errors_follow_from_what_views_show() {
        let (known, errors) = views(120, 1);
        let regression = Regression::fit(known, &errors).expect("views");
        let (others, expected) = views(200, 2);
        let mut sums = [[0.0; 3]; 2];
        for (view, expected) in others.iter().zip(&expected) {
            let found = regression.errors(view);
            for setting in 0..2 {
                let off = (found[setting] / expected[setting]).ln().abs();
                assert!(off < 0.5, "{} for {}", found[setting], expected[setting]);
                sums[0][setting] += found[setting];
                sums[1][setting] += expected[setting];
            }
            assert!(found[2] < 1e-9, "no error is none everywhere: {}", found[2]);
        }
        for (found, expected) in sums[0].iter().zip(&sums[1]).take(2) {
            let ratio = found / expected;
            assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
        }
    }

    #[test]
    fn a_view_like_a_known_one_has_its_errors() {
        let (known, errors) = views(60, 3);
        let regression = Regression::fit(known.clone(), &errors).expect("views");
        for (view, expected) in known.iter().zip(&errors) {
            let found = regression.errors(view)[0];
            assert!((found / expected[0]).ln().abs() < 0.15, "{found} for {}", expected[0]);
        }
    }

    #[test]
    fn too_few_views_and_odd_features_predict_nothing_and_extremes_stay_in_range() {
        let (known, errors) = views(7, 4);
        assert!(Regression::fit(known, &errors).is_none());
        assert!(Regression::fit(Vec::new(), &[]).is_none());
        let (mut known, errors) = views(9, 5);
        assert!(Regression::fit(known.clone(), &errors[..8]).is_none());
        known[3].features.pop();
        assert!(Regression::fit(known.clone(), &errors).is_none());
        known[3].features.push(f64::NAN);
        assert!(Regression::fit(known, &errors).is_none());
        // Equal views.
        let equal = vec![seen(0.0, [1.0; 3]); 12];
        let regression = Regression::fit(equal, &vec![vec![0.02]; 12]).expect("views");
        for odd in [1.0, 1e30, -1e30, f64::NAN, f64::INFINITY] {
            let error = regression.errors(&seen(odd as f32, [odd; 3]))[0];
            assert!((0.0..=2.0).contains(&error), "{odd}: {error}");
        }
        assert!((regression.errors(&seen(0.0, [1.0; 3]))[0] - 0.02).abs() < 1e-3);
    }
}
