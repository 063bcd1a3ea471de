//! From a light's G-buffer to the weights of its texels: `rsm/resolve.wgsl` and `vpl/weigh.wgsl`
//! against their CPU references.

use bevy::math::{DVec3, Vec3};
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d,
    uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutEntries, ShaderStages, TextureSampleType,
};
use bevy::shader::ShaderDefVal;
use frugal::stage::Stage;
use frugal_tests::gpu::{self, Point};
use frugal_tests::kernel::{self, Kernel};
use frugal_tests::meshes::stored_albedo;
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};

use super::{Random, stage};

tests!(
    texels_hold_the_flux_of_any_punctual_light,
    texels_hold_the_flux_of_any_sun,
    weights_follow_importance_at_any_scale,
    close_texels_share_an_importance_where_there_are_many
);

const SIZE: [u32; 2] = [8, 8];

/// `resolve.wgsl`'s `Light`.
#[derive(Clone, Copy)]
pub(crate) struct Light {
    pub intensity: Vec3,
    pub texel_extent: f32,
    pub position: Vec3,
    pub inverse_range_squared: f32,
    pub direction: Vec3,
    pub cone: [f32; 2],
}

impl Light {
    fn words(&self) -> Vec<f32> {
        let ([ix, iy, iz], [px, py, pz], [dx, dy, dz]) =
            (self.intensity.to_array(), self.position.to_array(), self.direction.to_array());
        let [scale, offset] = self.cone;
        vec![
            ix,
            iy,
            iz,
            self.texel_extent,
            px,
            py,
            pz,
            self.inverse_range_squared,
            dx,
            dy,
            dz,
            scale,
            offset,
            0.0,
            0.0,
            0.0,
            // Fades nowhere.
            0.0,
            0.0,
            0.0,
            0.0,
        ]
    }
}

/// The shipped pass `rsm/resolve.wgsl`.
pub(crate) struct Resolve(Kernel);

impl Resolve {
    pub(crate) fn new(stage: &mut Stage, defs: Vec<ShaderDefVal>) -> Self {
        let layout = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer_sized(false, None),
                uniform_buffer_sized(false, None),
                storage_buffer_sized(false, None),
            ),
        );
        Self(Kernel::new(stage, "gi/rsm/resolve.wgsl", "resolve", defs, &layout))
    }

    pub(crate) fn run(
        &self,
        stage: &Stage,
        pixels: &Pixels,
        plane: &Plane,
        light: &Light,
    ) -> Vec<Point> {
        let texels = kernel::buffer(stage, &gpu::bytes(&[0.0; 64 * Point::TEXEL_WORDS]));
        let (view, light) =
            (pixels.view(stage, plane), kernel::buffer(stage, &gpu::bytes(&light.words())));
        let bindings = BindGroupEntries::sequential((
            &pixels.g_buffer,
            &pixels.depth,
            view.as_entire_binding(),
            light.as_entire_binding(),
            texels.as_entire_binding(),
        ));
        self.0.run(stage, &bindings, (1, 1));
        gpu::texels(&gpu::read_buffer(stage.render_world(), &texels))
    }
}

/// G-buffer texels of black, white, grey, coloured and metallic surfaces that face roughly upwards,
/// their albedos and their normals.
fn surfaces() -> (Vec<[u32; 4]>, Vec<[f64; 3]>, Vec<DVec3>) {
    let mut random = Random(29);
    let mut texels = (Vec::new(), Vec::new(), Vec::new());
    for index in 0..64 {
        let (color, metallic) = match index % 5 {
            0 => ([0.0; 3], 0.0),
            1 => ([1.0; 3], 0.0),
            2 => ([0.5; 3], 0.0),
            3 => ([0.9, 0.04, 0.3], 0.0),
            _ => ([1.0, 0.6, 0.2], 0.4),
        };
        let bits = color.map(|channel: f64| (channel.powf(1.0 / 2.2) * 255.0).round() as u32);
        let (packed, normal) = g_buffer_normal((Vec3::Y + 0.5 * random.direction()).normalize());
        // 102 of 255 is 0.4.
        texels.0.push([
            bits[0] | bits[1] << 8 | bits[2] << 16,
            0,
            if metallic > 0.0 { 102 << 8 } else { 0 },
            packed,
        ]);
        texels.1.push(color.map(|channel| stored_albedo(channel) * (1.0 - metallic)));
        texels.2.push(normal);
    }
    texels
}

/// Compares texels with their expected flux and area; returns the largest relative error.
/// `share_and_area` returns a pixel's light per intensity, and its area in m².
fn check(
    label: &str,
    found: &[Point],
    albedos: &[[f64; 3]],
    intensity: Vec3,
    share_and_area: impl Fn(usize) -> (f64, f64),
) -> f64 {
    let mut worst = 0.0f64;
    for (pixel, texel) in found.iter().enumerate() {
        let (share, area) = share_and_area(pixel);
        for channel in 0..3 {
            let expected = share * albedos[pixel][channel] * f64::from(intensity[channel]);
            let found = f64::from(texel.flux[channel]);
            assert!(found.is_finite() && found >= 0.0, "{label}, pixel {pixel}: {found}");
            // Values below the smallest float become zero, and texels above the bound are left out.
            if !(1e-37..=1e30).contains(&expected) {
                assert!(found <= 1e-36, "{label}, pixel {pixel}: {found}, {expected} expected");
            } else {
                worst = worst.max((found / expected - 1.0).abs());
            }
        }
        worst =
            worst.max(if area > 0.0 { (f64::from(texel.extent) / area - 1.0).abs() } else { 0.0 });
    }
    worst
}

fn texels_hold_the_flux_of_any_punctual_light() {
    let mut stage = stage();
    let resolve = Resolve::new(&mut stage, vec!["LAMBERTIAN".into()]);
    let (texels, albedos, normals) = surfaces();
    let pixels = Pixels::with_texels(&stage, SIZE, &texels, 0.5);
    let (mut worst, mut cases) = (0.0f64, 0);
    for far in [0.0f32, 1e6] {
        let plane = Plane { center: Vec3::new(far, 0.0, -far), ..Plane::ORIGIN };
        // Above the centre of pixel (4, 3), from the surface itself to 1,000 km.
        for height in [0.0, 1e-6, 1e-3, 1.0, 30.0, 1e3, 1e6f32] {
            for brightness in [1e-20, 1.0, 1e20f32] {
                // A point light, and a spot light with angles of 45° and 60° and a range of 50 m.
                for (cone, range) in
                    [([0.0, 1.0], f32::INFINITY), ([4.828_427, -2.414_213_6], 50.0)]
                {
                    let light = Light {
                        intensity: Vec3::new(1.0, 0.5, 0.25) * brightness,
                        texel_extent: 0.001,
                        position: plane.center + Vec3::new(0.5, height, 0.5),
                        inverse_range_squared: (range * range).recip(),
                        direction: Vec3::NEG_Y,
                        cone,
                    };
                    let share_and_area = |pixel: usize| {
                        let at = plane.position(SIZE, pixel as u32 % 8, pixel as u32 / 8);
                        let ray = at - light.position.as_dvec3();
                        let square = ray.length_squared().max(1e-12);
                        let below = (-ray.y / square.sqrt()).max(0.0);
                        let cone =
                            (below * f64::from(cone[0]) + f64::from(cone[1])).clamp(0.0, 1.0);
                        let window = (1.0
                            - (square * f64::from(light.inverse_range_squared)).powi(2))
                        .clamp(0.0, 1.0);
                        let solid_angle = f64::from(light.texel_extent) * below.powi(3);
                        let cosine = -normals[pixel].dot(ray) / square.sqrt();
                        (
                            solid_angle * cone * cone * window * window,
                            solid_angle * square / cosine.max(0.1),
                        )
                    };
                    let label = format!("{far} m away, {height} m above, {brightness} cd");
                    let found = resolve.run(&stage, &pixels, &plane, &light);
                    let off = check(&label, &found, &albedos, light.intensity, share_and_area);
                    worst = worst.max(off);
                    assert!(off < 1e-3, "{label}: {off}");
                    cases += 1;
                }
            }
        }
    }
    println!("    {cases} lights: off by at most {worst:.1e}");
}

fn texels_hold_the_flux_of_any_sun() {
    let mut stage = stage();
    let resolve = Resolve::new(&mut stage, vec!["PARALLEL".into(), "LAMBERTIAN".into()]);
    let (texels, albedos, normals) = surfaces();
    let pixels = Pixels::with_texels(&stage, SIZE, &texels, 0.5);
    let mut worst = 0.0f64;
    for brightness in [1e-20, 1.0, 1e20, 1e29, 1e31f32] {
        for (direction, texel_extent) in
            [(Vec3::NEG_Y, 0.01), (Vec3::new(0.8, -0.6, 0.0), 1e-8), (Vec3::Y, 1e6), (Vec3::X, 1.0)]
        {
            let light = Light {
                intensity: Vec3::new(1.0, 0.5, 0.25) * brightness,
                texel_extent,
                position: Vec3::ZERO,
                inverse_range_squared: 0.0,
                direction,
                cone: [0.0, 1.0],
            };
            let share_and_area = |pixel: usize| {
                let cosine = -normals[pixel].dot(direction.as_dvec3());
                (f64::from(texel_extent), f64::from(texel_extent) / cosine.max(0.1))
            };
            let found = resolve.run(&stage, &pixels, &Plane::ORIGIN, &light);
            // If one channel is out of bounds, the texel is left out.
            let is_in_bounds =
                |pixel: usize| albedos[pixel][0] * f64::from(brightness * texel_extent) < 0.9e30;
            let kept: Vec<usize> = (0..64).filter(|pixel| is_in_bounds(*pixel)).collect();
            let points: Vec<Point> = kept.iter().map(|pixel| found[*pixel]).collect();
            let kept_albedos: Vec<_> = kept.iter().map(|pixel| albedos[*pixel]).collect();
            let label = format!("{brightness} lux along {direction}");
            let off = check(&label, &points, &kept_albedos, light.intensity, |index| {
                share_and_area(kept[index])
            });
            assert!(off < 1e-3, "{label}: {off}");
            assert!(
                (0..64).all(|pixel| is_in_bounds(pixel) || found[pixel].flux == [0.0; 3]),
                "{label}: left out"
            );
            worst = worst.max(off);
        }
    }
    // Without a surface there is no light.
    let sky = Pixels::with_texels(&stage, SIZE, &texels, 0.0);
    let sun = Light {
        intensity: Vec3::ONE,
        texel_extent: 1.0,
        position: Vec3::ZERO,
        inverse_range_squared: 0.0,
        direction: Vec3::NEG_Y,
        cone: [0.0, 1.0],
    };
    assert!(
        resolve
            .run(&stage, &sky, &Plane::ORIGIN, &sun)
            .iter()
            .all(|texel| texel.flux == [0.0; 3] && texel.extent == 0.0)
    );
    println!("    off by at most {worst:.1e}");
}

const ROWS: u32 = 12;
const LENGTH: u32 = 80;

/// Runs the three passes of `weigh.wgsl` over maps of rows of `length`. A thread weighs a block of `side`.
fn weigh(
    stage: &mut Stage,
    (pixels, plane): (&Pixels, &Plane),
    texels: &[Point],
    (length, side): (u32, u32),
) -> Vec<f32> {
    let (read, write) =
        (|| storage_buffer_read_only_sized(false, None), || storage_buffer_sized(false, None));
    let layout = BindGroupLayoutEntries::sequential(
        ShaderStages::COMPUTE,
        (
            texture_2d(TextureSampleType::Uint),
            texture_depth_2d(),
            uniform_buffer_sized(false, None),
            read(),
            read(),
            write(),
            write(),
            read(),
        ),
    );
    let kernels = ["pick_importance_points", "find_defensive_term", "weigh_texels"]
        .map(|entry| Kernel::new(stage, "gi/vpl/weigh.wgsl", entry, vec![], &layout));
    let words: Vec<f32> = texels.iter().flat_map(|texel| texel.to_texel()).collect();
    let rows = texels.len() as u32 / length;
    let contents = [
        gpu::bytes(&words),
        gpu::row_table(rows, length),
        gpu::bytes(&[0.0; 4 + 32 * 8]),
        gpu::bytes(&vec![0.0; texels.len()]),
        vec![0; 4],
    ];
    let buffers = contents.map(|contents| kernel::buffer(stage, &contents));
    let [a, b, c, d, e] = buffers.each_ref().map(|buffer| buffer.as_entire_binding());
    let view = pixels.view(stage, plane);
    let bindings = BindGroupEntries::sequential((
        &pixels.g_buffer,
        &pixels.depth,
        view.as_entire_binding(),
        a,
        b,
        c,
        d,
        e,
    ));
    for (kernel, groups) in
        kernels.iter().zip([(1, 1), (1, 1), (length.div_ceil(16 * side), rows.div_ceil(4 * side))])
    {
        kernel.run(stage, &bindings, groups);
    }
    gpu::floats(&gpu::read_buffer(stage.render_world(), &buffers[3]))
}

/// CPU reference: the light of each texel at 32 importance points in a staggered grid, plus a
/// defensive-sampling term of a quarter of its mean.
fn weights(plane: &Plane, normal: DVec3, texels: &[Point], length: u32) -> Vec<f64> {
    let rows = texels.len() as u32 / length;
    let importance_points: Vec<(DVec3, f64)> = (0..32u32)
        .map(|index| {
            let (column, row) = (f64::from(index % 8), f64::from(index / 8));
            let uv = [(column + 0.25 + 0.5 * (row % 2.0)) / 8.0, (row + 0.5) / 4.0];
            let at = plane.position(SIZE, (uv[0] * 8.0) as u32, (uv[1] * 8.0) as u32);
            (at, (0.02 * plane.apparent_distance(SIZE[1]).powi(2)).clamp(1e-12, 1e18))
        })
        .collect();
    let received = |texel: &Point| {
        let [from, facing] =
            [texel.position, texel.normal].map(|vector| DVec3::from_array(vector.map(f64::from)));
        let one = |(at, radius_squared): &(DVec3, f64)| {
            let to_light = from - *at;
            let square = to_light.length_squared().max(1e-18);
            normal.dot(to_light).max(0.0) * (-facing.dot(to_light)).max(0.0)
                / square
                / (square + radius_squared)
        };
        importance_points.iter().map(one).sum::<f64>().min(1e6)
    };
    let (mut flux, mut light) = (0.0, 0.0);
    for index in 0..1024u32 {
        // The shader's sequence, in its precision.
        let column = (((index as f32 * 0.618_034).fract() * length as f32) as u32).min(length - 1);
        let texel = &texels[(index * rows / 1024 * length + column) as usize];
        flux += texel.luminance();
        light += texel.luminance() * received(texel);
    }
    let defensive = (0.25 * light / flux.max(1e-36)).clamp(1e-9, 1e6);
    texels.iter().map(|texel| texel.luminance() * (received(texel) + defensive)).collect()
}

fn weights_follow_importance_at_any_scale() {
    let mut stage = stage();
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(&stage, SIZE, &[packed; 64]);
    for (label, far, spread, flux) in [
        ("a room", 0.0f32, 4.0f32, 1.0f32),
        ("a dark room", 0.0, 4.0, 1e-20),
        ("a bright room", 0.0, 4.0, 1e20),
        ("a dolls' house", 0.0, 1e-3, 1.0),
        ("a country", 0.0, 1e6, 1.0),
        ("a room a thousand kilometres away", 1e6, 4.0, 1.0),
    ] {
        let plane = Plane {
            center: Vec3::new(far, -far, far),
            spacing: spread / 4.0,
            eye: Vec3::new(far, -far, far) + Vec3::new(0.5, 1.0, 1.0) * spread,
            exposure: 1.0,
        };
        let mut random = Random(31);
        let texel = |index: u32| {
            let position = plane.center
                + random.inside(Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 1.5, 2.0)) * spread;
            // Some lie at importance points, some are dark. Normals are those that the store keeps.
            let position = if index % 50 == 7 {
                plane.position(SIZE, index % 8, 3).as_vec3()
            } else {
                position
            };
            let normal = gpu::unpack_normal(gpu::pack_normal(random.direction().to_array()));
            let flux = if index.is_multiple_of(11) { 0.0 } else { flux * (0.1 + random.next()) };
            Point {
                position: position.to_array(),
                normal,
                flux: [flux, 0.5 * flux, 2.0 * flux],
                extent: 1e-3,
            }
        };
        let texels: Vec<Point> = (0..ROWS * LENGTH).map(texel).collect();
        let found = weigh(&mut stage, (&pixels, &plane), &texels, (LENGTH, 1));
        let expected = weights(&plane, normal, &texels, LENGTH);
        let mut worst = 0.0f64;
        for (index, (found, expected)) in found.iter().zip(&expected).enumerate() {
            assert!(found.is_finite(), "{label}, texel {index}: {found}");
            assert_eq!(
                *found > 0.0,
                *expected > 0.0,
                "{label}, texel {index}: only dark texels have no weight"
            );
            if *expected > 0.0 {
                worst = worst.max((f64::from(*found) / expected - 1.0).abs());
            }
        }
        println!("    {label}: off by at most {worst:.1e}");
        // 32-bit floats, and cosines that cancel.
        assert!(worst < 1e-3, "{label}: {worst}");
    }
}

fn close_texels_share_an_importance_where_there_are_many() {
    let mut stage = stage();
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(&stage, SIZE, &[packed; 64]);
    let plane = Plane { eye: Vec3::new(0.5, 1.0, 1.0) * 4.0, ..Plane::ORIGIN };
    // More than 65,536, in a ceiling that rises in every `steps`-th column.
    let (length, rows) = (256, 260);
    let mut worst = |steps: Option<u32>| {
        let texel = |index: u32| {
            let (row, column) = (index / length, index % length);
            let height = if steps.is_some_and(|steps| column % steps == 0) { 2.5 } else { 1.5 };
            let across = |place: u32, count: u32| 4.0 * place as f32 / count as f32 - 2.0;
            Point {
                position: [across(column, length), height, across(row, rows)],
                normal: [0.0, -1.0, 0.0],
                // Some are dark.
                flux: [if steps.is_none() && index.is_multiple_of(11) { 0.0 } else { 1.0 }; 3],
                extent: (4.0 / 256.0) * (4.0 / 260.0),
            }
        };
        let texels: Vec<Point> = (0..rows * length).map(texel).collect();
        let found = weigh(&mut stage, (&pixels, &plane), &texels, (length, 4));
        let expected = weights(&plane, normal, &texels, length);
        let mut off = 0.0_f64;
        for (found, expected) in found.into_iter().zip(expected) {
            assert_eq!(found > 0.0, expected > 0.0);
            if expected > 0.0 {
                off = off.max((f64::from(found) / expected - 1.0).abs());
            }
        }
        off
    };
    let (flat, alternating, stepped) = (worst(None), worst(Some(2)), worst(Some(8)));
    println!("    off by at most {flat:.1e}, {alternating:.1e}, {stepped:.1e}");
    // A block is 6 cm wide, and 1.5 m away.
    assert!(flat > 1e-3 && flat < 0.05, "{flat}");
    assert!(alternating < 1e-3, "each neighbour lies elsewhere: {alternating}");
    assert!(stepped > 1e-3 && stepped < 0.05, "{stepped}");
}
