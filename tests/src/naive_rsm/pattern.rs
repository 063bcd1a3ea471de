//! The pattern of texels that a pixel samples, and their weights.

use std::f64::consts::{PI, TAU};

/// Weights of the samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Weights {
    /// The inverse of the sample density: the sum over the samples is, in expectation, that over
    /// all texels of the disk.
    #[default]
    Exact,
    /// ξ², as published, with the same total. It is correct for a density proportional to the
    /// inverse squared distance; that of the published samples is proportional to the inverse
    /// distance, so distant samples weigh too much.
    Published,
}

/// Samples of a flat map: offset from the pixel's projection, in sides of the map, and weight, as a
/// share of all texels.
///
/// The offsets are those of Dachsbacher and Stamminger 2005, `radius` · ξ₁ · (sin 2πξ₂, cos 2πξ₂),
/// with ξ from a Hammersley set, whose low discrepancy favours the baseline.
pub(super) fn flat(count: u32, radius: f64, weights: Weights) -> Vec<[f32; 4]> {
    let disk = PI * radius * radius;
    let sample = |(distance, angle): (f64, f64)| {
        let (sine, cosine) = (TAU * angle).sin_cos();
        let share = match weights {
            Weights::Exact => 2.0 * disk * distance,
            Weights::Published => 3.0 * disk * distance * distance,
        };
        [radius * distance * sine, radius * distance * cosine, share / f64::from(count), 0.0]
            .map(|value| value as f32)
    };
    hammersley(count).map(sample).collect()
}

/// Samples around a direction, for lights with a cube map: a unit vector whose z axis is that
/// direction, and its weight, a solid angle (sr). The largest angle is `radius` · π.
pub(super) fn spherical(count: u32, radius: f64, weights: Weights) -> Vec<[f32; 4]> {
    let greatest = PI * radius.min(1.0);
    let sample = |(distance, angle): (f64, f64)| {
        let (sine, cosine) = (TAU * angle).sin_cos();
        let (across, along) = (greatest * distance).sin_cos();
        let measure = match weights {
            Weights::Exact => TAU * greatest * across,
            Weights::Published => 3.0 * TAU * (1.0 - greatest.cos()) * distance * distance,
        };
        [across * sine, across * cosine, along, measure / f64::from(count)]
            .map(|value| value as f32)
    };
    hammersley(count).map(sample).collect()
}

/// A Hammersley set of `count` points in (0, 1) × [0, 1).
fn hammersley(count: u32) -> impl Iterator<Item = (f64, f64)> {
    (0..count).map(move |index| {
        (
            (f64::from(index) + 0.5) / f64::from(count),
            f64::from(index.reverse_bits()) * (-32.0_f64).exp2(),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [Weights; 2] = [Weights::Exact, Weights::Published];

    #[test]
    fn samples_lie_in_the_disk_and_cover_its_area() {
        for (weights, radius) in BOTH.into_iter().zip([0.3, 1.0]) {
            let samples = flat(400, radius, weights);
            let total: f64 = samples.iter().map(|sample| f64::from(sample[2])).sum();
            assert!((total / (PI * radius * radius) - 1.0).abs() < 1e-4, "{weights:?}: {total}");
            assert!(samples.iter().all(|[x, y, ..]| f64::from(x.hypot(*y)) < radius));
            assert!(
                samples.iter().map(|[x, ..]| f64::from(*x)).sum::<f64>().abs()
                    < 0.01 * 400.0 * radius,
                "no side is preferred"
            );
        }
    }

    #[test]
    fn directions_lie_in_the_cap_and_cover_its_solid_angle() {
        for weights in BOTH {
            for radius in [0.1, 0.5, 1.0] {
                let samples = spherical(400, radius, weights);
                let total: f64 = samples.iter().map(|sample| f64::from(sample[3])).sum();
                let cap = TAU * (1.0 - (PI * radius).cos());
                assert!((total / cap - 1.0).abs() < 1e-3, "{weights:?} {radius}: {total} of {cap}");
                for [x, y, z, _] in samples {
                    assert!(
                        ((x * x + y * y + z * z) - 1.0).abs() < 1e-5
                            && f64::from(z) > (PI * radius).cos() - 1e-6
                    );
                }
            }
        }
    }

    #[test]
    fn exact_weights_integrate_a_gaussian() {
        // ∫ exp(−(r/0.2)²) over the plane = π · 0.04; the disk of radius 1 holds all of it.
        // Published weights lose most of the centre.
        let integral = |weights| -> f64 {
            let fall_off = |[x, y, share, _]: [f32; 4]| {
                f64::from(share) * (-f64::from(x * x + y * y) / 0.04).exp()
            };
            flat(400, 1.0, weights).into_iter().map(fall_off).sum::<f64>() / (PI * 0.04)
        };
        assert!((integral(Weights::Exact) - 1.0).abs() < 1e-3, "{}", integral(Weights::Exact));
        assert!(integral(Weights::Published) < 0.5, "{}", integral(Weights::Published));
    }
}
