//! Rays as the gather draws them, in the order of waves.

use bevy::math::{Quat, UVec2, Vec2, Vec3};
use bevy_frugal_gi::gi::{FrugalGi, inspect};
use frugal::stage::Stage;
use frugal_tests::gather;
use frugal_tests::gpu::{self, Point};
use frugal_trace::integrator::FirstHit;
use frugal_trace::scene::sphere_directions;

use super::replay::{Ray, WAVE};

/// Directions to the sky in a set, as many as the default samples.
const SKY: u32 = 16;

/// What an image of low-resolution pixels shows, and from where.
pub(crate) struct Image {
    /// Width and height.
    pub(crate) size: UVec2,
    /// Row by row.
    pub(crate) hits: Vec<Option<FirstHit>>,
    pub(crate) eye: Vec3,
    /// Length of rays to the sky, metres.
    pub(crate) reach: f32,
}

/// The rays of an image to the VPLs of the stage's camera, and those to the sky.
pub(crate) fn rays(stage: &Stage, image: &Image) -> [Vec<Ray>; 2] {
    let state = inspect::gpu_state(stage.render_world());
    let camera = state.cameras.first().expect("a camera that gathers");
    let bytes = gpu::read_buffer(stage.render_world(), &camera.vpls);
    let guesses = gpu::floats(&bytes).into_iter().skip(Point::VPL_WORDS - 1);
    let lights: Vec<(Point, f32)> =
        gpu::vpl_slots(&bytes).into_iter().zip(guesses.step_by(Point::VPL_WORDS)).collect();
    let sets: Vec<_> = lights.chunks_exact(camera.per_set as usize).collect();
    let strata = FrugalGi::default().visibility.rays() as usize;
    let (mut to_vpls, mut to_sky) = (Vec::new(), Vec::new());
    for Wave { set, tile, cells } in waves(image.size, camera.sets.isqrt()) {
        // Each set has directions of its own.
        let turn = Quat::from_rotation_y(set as f32);
        for stratum in 0..strata {
            let own: Vec<_> = sets[set].iter().skip(stratum).step_by(strata).collect();
            let directions: Vec<Vec3> = sphere_directions(SKY)
                .skip(stratum)
                .step_by(strata)
                .map(|direction| turn * direction)
                .collect();
            let number = (noise(tile) + stratum as f32 * 0.618_034).fract();
            for cell in &cells {
                let from = image.hits[(cell.y * image.size.x + cell.x) as usize]
                    .map(|hit| departure(&hit, image.eye));
                to_vpls.push(from.and_then(|[from, normal]| {
                    let weights = own.iter().map(|(light, guess)| {
                        let geometry = gather::geometry(light, from.as_dvec3(), normal.as_dvec3());
                        geometry * light.luminance() * f64::from(*guess)
                    });
                    let (light, _) = own[chosen(weights, number)?];
                    let [at, facing] = [light.position, light.normal].map(Vec3::from_array);
                    Some([from, at + facing * offset(at, image.eye)])
                }));
                to_sky.push(from.and_then(|[from, normal]| {
                    let weights = directions.iter().map(|to| f64::from(normal.dot(*to).max(0.0)));
                    Some([from, from + directions[chosen(weights, number)?] * image.reach])
                }));
            }
        }
    }
    [to_vpls, to_sky]
}

/// The low-resolution pixels of a wave, their VPL set, and what their random number is drawn by.
struct Wave {
    set: usize,
    tile: UVec2,
    cells: Vec<UVec2>,
}

/// All whole waves of an image, with `side`² VPL sets.
fn waves(size: UVec2, side: u32) -> impl Iterator<Item = Wave> {
    let groups = size / (8 * side);
    (0..groups.element_product() * side * side).map(move |index| {
        let (group, set) = (index / (side * side), index % (side * side));
        let group = UVec2::new(group % groups.x, group / groups.x);
        let shift = UVec2::new(set % side, set / side);
        let cell = |thread| (group * 8 + UVec2::new(thread % 8, thread / 8)) * side + shift;
        let tile = group * side + shift;
        Wave { set: set as usize, tile, cells: (0..WAVE as u32).map(cell).collect() }
    })
}

/// `pixel_noise` of `view/noise.wgsl`, in the first frame.
fn noise(cell: UVec2) -> f32 {
    (52.982_918 * cell.as_vec2().dot(Vec2::new(0.067_110_56, 0.005_837_15)).fract()).fract()
}

/// One of several, in proportion to weights.
fn chosen(weights: impl Iterator<Item = f64>, number: f32) -> Option<usize> {
    let sums: Vec<f64> = weights
        .scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        })
        .collect();
    let total = sums.last().copied().filter(|total| *total > 0.0)?;
    let target = total * f64::from(number);
    Some(sums.iter().position(|sum| *sum > target).unwrap_or(sums.len() - 1))
}

/// `surface_offset` of `trace.wgsl` in a view of 90 degrees, without the width of a pixel.
fn offset(position: Vec3, eye: Vec3) -> f32 {
    5e-4 + 2e-4 * position.distance(eye) + 4e-7 * position.abs().max_element()
}

/// Where a pixel's rays begin, and its normal.
fn departure(hit: &FirstHit, eye: Vec3) -> [Vec3; 2] {
    let (position, normal) = (hit.position.as_vec3(), hit.normal.as_vec3());
    [position + normal * offset(position, eye), normal]
}
