//! `denoise/spatial.wgsl` against its CPU reference, and with values in its input that are not
//! finite.

use bevy::math::Vec3;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d,
    uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutEntries, ShaderStages, StorageTextureAccess, TextureFormat,
    TextureSampleType,
};
use bevy::shader::ShaderDefVal;
use frugal::stage::Stage;
use frugal_tests::kernel::Kernel;
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::{gather, gpu};

use super::{Random, stage};

tests!(the_filter_averages_along_the_surface, values_that_are_not_finite_do_not_spread);

const SIZE: [u32; 2] = [13, 9];
const COUNT: usize = (SIZE[0] * SIZE[1]) as usize;

struct Filter {
    window: i32,
    kernel: Kernel,
}

impl Filter {
    fn new(stage: &mut Stage, window: u32) -> Self {
        let layout = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer_sized(false, None),
                storage_buffer_read_only_sized(false, None),
                texture_2d(TextureSampleType::Float { filterable: false }),
                texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
            ),
        );
        let defs = vec![ShaderDefVal::UInt("WINDOW".into(), window)];
        Self {
            window: window as i32,
            kernel: Kernel::new(
                stage,
                "gi/denoise/spatial.wgsl",
                "filter_spatially",
                defs,
                &layout,
            ),
        }
    }

    fn run(&self, stage: &Stage, pixels: &Pixels, plane: &Plane, light: &[u16]) -> Vec<f64> {
        let halves: Vec<[u16; 4]> = light.iter().map(|half| [*half, *half, *half, ONE]).collect();
        let (view, plan) = (pixels.view(stage, plane), gather::plan(stage, 0));
        let (input, texture) = (pixels.input(stage, &halves), pixels.output(stage));
        let output = texture.create_view(&Default::default());
        let bindings = BindGroupEntries::sequential((
            &pixels.g_buffer,
            &pixels.depth,
            view.as_entire_binding(),
            plan.as_entire_binding(),
            &input,
            &output,
        ));
        self.kernel.run(stage, &bindings, (pixels.size[0].div_ceil(8), pixels.size[1].div_ceil(8)));
        gpu::read_halves(stage.render_world(), &texture).iter().map(|texel| texel[1]).collect()
    }

    /// Whether the windows of two pixels contain each other.
    fn reaches(&self, pixel: usize, other: usize) -> bool {
        let at = |pixel: usize| [pixel as i32 % SIZE[0] as i32, pixel as i32 / SIZE[0] as i32];
        (0..2).all(|axis| (at(pixel)[axis] - at(other)[axis]).abs() <= self.window / 2)
    }
}

const ONE: u16 = 0x3c00;
const INFINITY: u16 = 0x7c00;
const NAN: u16 = 0x7e00;

/// Half floats between 1 and 2.
fn noise(random: &mut Random) -> Vec<u16> {
    (0..COUNT).map(|_| ONE | (random.next() * 1024.0) as u16).collect()
}

/// CPU reference of the filter: the weighted mean of the finite values.
fn reference(
    filter: &Filter,
    plane: &Plane,
    normals: &[bevy::math::DVec3],
    light: &[u16],
    pixel: usize,
) -> Option<f64> {
    let coordinates = |pixel: usize| [pixel as i32 % SIZE[0] as i32, pixel as i32 / SIZE[0] as i32];
    let position =
        |pixel: usize| plane.position(SIZE, pixel as u32 % SIZE[0], pixel as u32 / SIZE[0]);
    let tolerance = 0.02 * plane.apparent_distance(SIZE[1]) + 1e-6;
    let (mut sum, mut weights) = (0.0, 0.0);
    for other in (0..COUNT).filter(|other| filter.reaches(pixel, *other)) {
        let found = gpu::half(light[other]);
        if !found.is_finite() {
            continue;
        }
        // The window's outermost rows and columns count half.
        let share = |axis: usize| {
            if (coordinates(other)[axis] - coordinates(pixel)[axis]).abs() == filter.window / 2 {
                0.5
            } else {
                1.0
            }
        };
        let off_plane = (position(other) - position(pixel)).dot(normals[pixel]) / tolerance;
        let alike = normals[pixel].dot(normals[other]).max(0.0).powi(8);
        let weight = share(0) * share(1) * (-off_plane * off_plane).exp() * alike;
        sum += weight * found;
        weights += weight;
    }
    (weights > 1e-9).then(|| sum / weights)
}

/// Adjacent surfaces: the floor in the first five columns; then one tilted slightly, one strongly,
/// and one that faces away.
fn normals() -> (Vec<u32>, Vec<bevy::math::DVec3>) {
    let normal = |pixel: usize| match (pixel as u32 % SIZE[0], pixel as u32 / SIZE[0]) {
        (0..5, _) => Vec3::Y,
        (_, 0..3) => Vec3::new(0.1, 1.0, 0.05),
        (_, 3..6) => Vec3::new(1.0, 0.4, 0.0),
        _ => Vec3::new(0.2, -1.0, 0.0),
    };
    (0..COUNT).map(|pixel| g_buffer_normal(normal(pixel).normalize())).unzip()
}

fn the_filter_averages_along_the_surface() {
    let mut stage = stage();
    let (packed, normals) = normals();
    let pixels = Pixels::new(&stage, SIZE, &packed);
    let plane = Plane { eye: Vec3::new(0.0, 20.0, 0.0), ..Plane::ORIGIN };
    let mut random = Random(11);
    for window in [2, 4, 8] {
        let filter = Filter::new(&mut stage, window);
        let light = noise(&mut random);
        let found = filter.run(&stage, &pixels, &plane, &light);
        let off = (0..COUNT).map(|pixel| {
            let expected = reference(&filter, &plane, &normals, &light, pixel)
                .expect("a pixel has its own light");
            (found[pixel] / expected - 1.0).abs()
        });
        let worst = off.fold(0.0, f64::max);
        println!("    window {window}: off by at most {worst:.1e}");
        assert!(worst < 1e-3, "{worst}");
    }
}

fn values_that_are_not_finite_do_not_spread() {
    let mut stage = stage();
    let (packed, normals) = normals();
    let pixels = Pixels::new(&stage, SIZE, &packed);
    let plane = Plane { eye: Vec3::new(0.0, 20.0, 0.0), ..Plane::ORIGIN };
    let mut random = Random(13);
    for window in [2, 4, 8] {
        let filter = Filter::new(&mut stage, window);
        for poison in [NAN, 0xfe00, INFINITY, 0xfc00] {
            let mut light = noise(&mut random);
            // In a corner, inside a surface, and where two surfaces meet.
            let poisoned = [0, 4 * 13 + 2, 4 * 13 + 4, 8 * 13 + 12];
            poisoned.iter().for_each(|pixel| light[*pixel] = poison);
            let found = filter.run(&stage, &pixels, &plane, &light);
            for (pixel, found) in found.into_iter().enumerate() {
                // The pixel itself gets the mean of its neighbours.
                let expected = reference(&filter, &plane, &normals, &light, pixel)
                    .expect("neighbours on the same surface");
                assert!(
                    (found / expected - 1.0).abs() < 1e-3,
                    "window {window}, {poison:#x}, pixel {pixel}: {found}, not {expected}"
                );
            }
        }
    }
    // Without any finite value there is no light.
    let filter = Filter::new(&mut stage, 4);
    let found = filter.run(&stage, &pixels, &plane, &[NAN; COUNT]);
    assert!(found.iter().all(|value| *value == 0.0), "{found:?}");
    // Nor without a surface.
    let sky = Pixels::with_depth(&stage, SIZE, &packed, 0.0);
    let found = filter.run(&stage, &sky, &plane, &noise(&mut random));
    assert!(found.iter().all(|value| *value == 0.0), "{found:?}");
}
