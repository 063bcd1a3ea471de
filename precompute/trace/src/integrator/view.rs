//! A camera's rays, and what they hit first.

use glam::{DVec2, DVec3, UVec2, Vec3};
use rayon::prelude::*;

use super::{Pixels, ReferenceScene};
use crate::bsdf::Surface;
use crate::sampler::Sampler;
use crate::scene::CameraPose;

/// A camera's pose, lens and resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Position and rotation.
    pub pose: CameraPose,
    /// Vertical field of view, degrees, in (0, 180).
    pub vertical_fov_degrees: f32,
    /// Distance of the near plane, metres; nearer geometry is clipped, as in the renderer. There is
    /// no far plane, as in Bevy.
    pub near: f32,
    /// Width and height, pixels.
    pub size: UVec2,
}

/// What a camera ray hits first: a surface point and its normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstHit {
    /// World space, metres.
    pub position: DVec3,
    /// Geometric normal on the visible side, unit length.
    pub normal: DVec3,
}

/// The surface at each pixel's centre, row by row; `None` where there is none.
pub fn surfaces(scene: &ReferenceScene, view: &View) -> Vec<Option<FirstHit>> {
    let pixel = |index: u32| {
        let (origin, direction) = view.middle_ray(index);
        let surface = Surface::new(&scene.geometry, &scene.closest(origin, direction)?);
        Some(FirstHit { position: surface.position, normal: surface.geometric_normal })
    };
    (0..view.size.element_product()).into_par_iter().map(pixel).collect()
}

impl View {
    /// Unit directions of the rays through the pixels' centres, row by row.
    pub fn rays(&self) -> Vec<DVec3> {
        (0..self.size.element_product()).map(|index| self.middle_ray(index).1).collect()
    }

    /// The [ray](Self::ray) through the centre of a pixel, counted row by row.
    pub(crate) fn middle_ray(&self, index: u32) -> (Vec3, DVec3) {
        self.ray(f64::from(index % self.size.x) + 0.5, f64::from(index / self.size.x) + 0.5)
    }

    /// The [ray](Self::ray) of a sample of the pixel at `x` and `y`.
    pub(crate) fn sampled_ray(
        &self,
        pixels: Pixels,
        [x, y]: [u32; 2],
        sampler: &mut Sampler,
    ) -> (Vec3, DVec3) {
        // Sampled in either case, so that the path uses the same random numbers.
        let offset = sampler.pair();
        let [right, down] = if pixels == Pixels::Middle { [0.5; 2] } else { offset };
        self.ray(f64::from(x) + right, f64::from(y) + down)
    }

    /// Origin (on the near plane) and unit direction of the ray through a point of the image, in
    /// pixels from its upper left corner.
    pub(crate) fn ray(&self, x: f64, y: f64) -> (Vec3, DVec3) {
        let (size, half) = (self.size.as_dvec2(), self.half());
        let ahead =
            DVec3::new((2.0 * x / size.x - 1.0) * half.x, (1.0 - 2.0 * y / size.y) * half.y, -1.0);
        let ray = self.pose.rotation.as_dquat() * ahead;
        ((self.pose.position.as_dvec3() + ray * f64::from(self.near)).as_vec3(), ray.normalize())
    }

    /// Half the width and height of the image on a plane at 1 metre.
    pub(crate) fn half(&self) -> DVec2 {
        let height = (f64::from(self.vertical_fov_degrees).to_radians() * 0.5).tan();
        let size = self.size.as_dvec2();
        DVec2::new(height * size.x / size.y, height)
    }
}
