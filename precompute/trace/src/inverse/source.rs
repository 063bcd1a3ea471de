//! A small source from the light that it leaves on a plane.
//!
//! A virtual point light leaves on the plane z = 0 the irradiance (m · (p − x)) h ÷ |p − x|⁴ at p,
//! with x its place, h its height and m its normal × flux ÷ π: linear in m. Liu, Hua and others solve such systems
//! of six unknowns with Gröbner bases; here the three of m are eliminated by least squares, and the
//! three of x found by iteration (Golub and Pereyra 1973, "The Differentiation of Pseudo-Inverses
//! and Nonlinear Least Squares Problems Whose Variables Separate").

use glam::{DMat3, DVec2, DVec3};

use super::InverseError;

/// Heights from which the search starts, as shares of the plane's lit extent.
const STARTS: [f64; 3] = [0.15, 0.5, 1.5];
const ITERATIONS: usize = 60;
/// Points that are darker than this share of the brightest may be behind the source.
const DARK: f64 = 1e-4;

/// The irradiance of a point of the plane z = 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Irradiance {
    /// x and y, metres.
    pub point: DVec2,
    /// Lux, at least 0.
    pub lux: f64,
}

/// A small Lambertian source, as a virtual point light is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Source {
    /// Metres; z is above 0.
    pub position: DVec3,
    /// Unit length.
    pub normal: DVec3,
    /// Lumens.
    pub flux: f64,
}

impl Source {
    /// The irradiance that it leaves at a point of the plane z = 0, lux.
    pub fn lux(&self, point: DVec2) -> f64 {
        let ray = point.extend(0.0) - self.position;
        let squared = ray.length_squared();
        let cosines = self.normal.dot(ray).max(0.0) * self.position.z.max(0.0);
        if cosines > 0.0 {
            self.flux / std::f64::consts::PI * cosines / (squared * squared)
        } else {
            0.0
        }
    }

    /// The source of the least squared relative error. Of a source and its mirror image below the
    /// plane, which leaves the same light on a plane that shines through, the one above is it.
    ///
    /// Dark points are left out: they may be behind the source. Values that are not finite are, too.
    ///
    /// # Errors
    /// [`InverseError::Size`] for less than 7 lit points, [`InverseError::NoSource`] where the
    /// search finds none.
    pub fn find(light: &[Irradiance]) -> Result<Self, InverseError> {
        let is_sound = |one: &&Irradiance| one.lux.is_finite() && one.point.is_finite();
        let most = light.iter().filter(is_sound).map(|one| one.lux).fold(0.0, f64::max);
        let lit: Vec<Irradiance> =
            light.iter().filter(is_sound).filter(|one| one.lux > DARK * most).copied().collect();
        if lit.len() < 7 {
            let (what, expected) = ("lit points", 7);
            return Err(InverseError::Size { what, given: lit.len(), expected });
        }
        let total: f64 = lit.iter().map(|one| one.lux).sum();
        let middle = lit.iter().map(|one| one.point * one.lux).sum::<DVec2>() / total;
        let spread =
            lit.iter().map(|one| one.point.distance_squared(middle) * one.lux).sum::<f64>();
        let extent = (spread / total).sqrt();
        let fits = STARTS.map(|start| descend(&lit, middle.extend(start * extent)));
        let best = fits.into_iter().flatten().min_by(|a, b| a.error.total_cmp(&b.error));
        let best = best.ok_or(InverseError::NoSource)?;
        let length = best.moment.length();
        if !(length > 0.0 && length.is_finite() && best.position.is_finite()) {
            return Err(InverseError::NoSource);
        }
        Ok(Self {
            position: best.position,
            normal: best.moment / length,
            flux: length * std::f64::consts::PI,
        })
    }
}

#[derive(Clone, Debug)]
struct Fit {
    position: DVec3,
    moment: DVec3,
    residuals: Vec<f64>,
    /// Sum of squared residuals.
    error: f64,
}

/// The best moment for a place, relative to the light so that faint points count as much.
fn fit(lit: &[Irradiance], position: DVec3) -> Option<Fit> {
    let factor = |one: &Irradiance| {
        let ray = one.point.extend(0.0) - position;
        let squared = ray.length_squared();
        ray * (position.z / (squared * squared * one.lux))
    };
    let (mut matrix, mut right) = (DMat3::ZERO, DVec3::ZERO);
    for one in lit {
        let own = factor(one);
        matrix += DMat3::from_cols(own * own.x, own * own.y, own * own.z);
        right += own;
    }
    let scale = matrix.to_cols_array().iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let moment = (matrix * (1.0 / scale)).inverse() * (right / scale);
    let residuals: Vec<f64> = lit.iter().map(|one| factor(one).dot(moment) - 1.0).collect();
    let error = residuals.iter().map(|residual| residual * residual).sum::<f64>();
    (error.is_finite() && moment.is_finite()).then_some(Fit { position, moment, residuals, error })
}

/// Levenberg 1944 and Marquardt 1963, with differences for derivatives. The height is searched as
/// its logarithm, which keeps the source above the plane.
fn descend(lit: &[Irradiance], start: DVec3) -> Option<Fit> {
    let placed = |place: DVec3| DVec3::new(place.x, place.y, place.z.exp());
    let mut place = DVec3::new(start.x, start.y, start.z.max(1e-9).ln());
    let mut best = fit(lit, placed(place))?;
    let mut damping = 1e-3;
    for _ in 0..ITERATIONS {
        let step = 1e-6 * best.position.z;
        let steps = [DVec3::X * step, DVec3::Y * step, DVec3::Z * 1e-6];
        let mut slopes = Vec::with_capacity(3);
        for step in steps {
            let other = fit(lit, placed(place + step))?;
            let length = step.length();
            let pairs = other.residuals.iter().zip(&best.residuals);
            slopes.push(pairs.map(|(after, before)| (after - before) / length).collect::<Vec<_>>());
        }
        let (mut matrix, mut right) = ([[0.0; 3]; 3], DVec3::ZERO);
        for a in 0..3 {
            for (b, entry) in matrix[a].iter_mut().enumerate() {
                *entry = slopes[a].iter().zip(&slopes[b]).map(|(a, b)| a * b).sum();
            }
            right[a] = -slopes[a].iter().zip(&best.residuals).map(|(a, b)| a * b).sum::<f64>();
        }
        let matrix = DMat3::from_cols_array_2d(&matrix);
        let mut is_better = false;
        while damping < 1e9 && !is_better {
            let damped = matrix
                + DMat3::from_diagonal(
                    DVec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z) * damping,
                );
            let moved = place + damped.inverse() * right;
            match fit(lit, placed(moved)).filter(|fit| fit.error < best.error) {
                Some(better) => {
                    is_better = true;
                    (place, best) = (moved, better);
                    damping = (damping * 0.3).max(1e-12);
                }
                None => damping *= 4.0,
            }
        }
        if !is_better {
            break;
        }
    }
    Some(best)
}
