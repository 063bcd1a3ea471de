//! Values with their first and second derivatives by position.
//!
//! Second-order forward differentiation stands in for the closed forms of Marco et al. 2018,
//! "Second-Order Occlusion-Aware Volumetric Radiance Caching": their triangle is the same.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

/// A value at a point x, and its derivatives by x.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Jet {
    pub(crate) value: f64,
    /// Per metre.
    pub(crate) gradient: DVec3,
    /// Per square metre; symmetric.
    pub(crate) hessian: DMat3,
}

impl Jet {
    /// 0, with derivatives 0: a matrix defaults to the identity.
    pub(crate) const ZERO: Self = Self { value: 0.0, gradient: DVec3::ZERO, hessian: DMat3::ZERO };

    pub(crate) fn plus(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: self.gradient + other.gradient,
            hessian: self.hessian + other.hessian,
        }
    }

    pub(crate) fn times(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            gradient: self.gradient * other.value + other.gradient * self.value,
            hessian: self.hessian * other.value
                + other.hessian * self.value
                + outer(self.gradient, other.gradient)
                + outer(other.gradient, self.gradient),
        }
    }

    /// exp(−`factor` × self).
    pub(crate) fn decay(self, factor: f64) -> Self {
        let value = (-factor * self.value).exp();
        Self {
            value,
            gradient: self.gradient * (-factor * value),
            hessian: outer(self.gradient, self.gradient) * (factor * factor * value)
                - self.hessian * (factor * value),
        }
    }
}

/// The distance of a point that is `ray` away from x, more than 0.
pub(crate) fn distance(ray: DVec3) -> Jet {
    let (length, unit) = (ray.length(), ray.normalize());
    let hessian = (DMat3::IDENTITY - outer(unit, unit)) * (1.0 / length);
    Jet { value: length, gradient: -unit, hessian }
}

fn dot(a: DVec3, b: DVec3) -> Jet {
    Jet { value: a.dot(b), gradient: -(a + b), hessian: DMat3::IDENTITY * 2.0 }
}

/// Solid angle ÷ 4π of a triangle whose corners are `rays` away from x, with the sign of its turn:
/// van Oosterom and Strackee 1983, "The Solid Angle of a Plane Triangle". 0 where x is on an edge
/// or a corner. The sign makes closed meshes sum to 1 even where some triangles overlap.
pub(crate) fn form_factor(rays: [DVec3; 3]) -> Jet {
    let [a, b, c] = rays;
    let lengths = rays.map(|ray| ray.length());
    let size: f64 = lengths.iter().product();
    if !(size > 0.0 && size.is_finite()) {
        return Jet::ZERO;
    }
    let triple = Jet {
        value: a.dot(b.cross(c)),
        gradient: -(a.cross(b) + b.cross(c) + c.cross(a)),
        hessian: DMat3::ZERO,
    };
    let [la, lb, lc] = rays.map(distance);
    let base = la
        .times(lb)
        .times(lc)
        .plus(dot(a, b).times(lc))
        .plus(dot(b, c).times(la))
        .plus(dot(a, c).times(lb));
    let squared = triple.value * triple.value + base.value * base.value;
    if squared <= 1e-20 * size * size {
        return Jet::ZERO;
    }
    // Derivatives of atan2(triple, base); F = 2 atan2 / 4π.
    let slope = triple.gradient * base.value - base.gradient * triple.value;
    let turn = outer(triple.gradient, base.gradient)
        - outer(base.gradient, triple.gradient)
        - base.hessian * triple.value;
    let rise = (triple.gradient * triple.value + base.gradient * base.value) * 2.0;
    let scale = 0.5 / PI;
    Jet {
        value: triple.value.atan2(base.value) * scale,
        gradient: slope * (scale / squared),
        hessian: (turn * (1.0 / squared) - outer(slope, rise) * (1.0 / (squared * squared)))
            * scale,
    }
}

/// `a` × `b` transposed.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

/// Eigenvalues and, as columns, unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
pub(crate) fn eigen(mut matrix: DMat3) -> (DVec3, DMat3) {
    let mut vectors = DMat3::IDENTITY;
    for _ in 0..12 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let off = matrix.col(q)[p];
            if off == 0.0 {
                continue;
            }
            let angle = 0.5 * (2.0 * off).atan2(matrix.col(q)[q] - matrix.col(p)[p]);
            let (sin, cos) = angle.sin_cos();
            let mut turn = DMat3::IDENTITY;
            turn.col_mut(p)[p] = cos;
            turn.col_mut(q)[q] = cos;
            turn.col_mut(q)[p] = sin;
            turn.col_mut(p)[q] = -sin;
            matrix = turn.transpose() * matrix * turn;
            vectors *= turn;
        }
    }
    (DVec3::new(matrix.col(0).x, matrix.col(1).y, matrix.col(2).z), vectors)
}
