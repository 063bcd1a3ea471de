//! The shipped compute shaders on buffers of our own, against sums in 64-bit floats, and at the extremes.

use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized, texture_2d, texture_depth_2d, texture_storage_2d, uniform_buffer_sized,
};
use bevy::render::render_resource::*;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy_frugal_gi::gi::FrugalGi;
use frugal::stage::{Component, Stage};
use frugal_tests::gpu::{self, Point};
use frugal_tests::kernel::{self, Kernel};
use frugal_tests::set;

tests!(
    the_gather_is_the_sum_over_vpls,
    the_gather_is_finite_at_the_extremes,
    drawing_follows_flux,
    drawing_by_importance_keeps_the_expectation,
    drawing_from_nothing_gives_nothing
);

fn stage() -> Stage {
    set::bare(vec![], set::radiance_options(32, 18, Component::Indirect))
}

/// Receivers: 8 × 8 pixels whose centres lie 1 m apart around `center`, all in the plane y = `center`.y.
const EDGE: u32 = 8;
const COUNT: usize = 4;
const EXPOSURE: f32 = 0.01;

/// A normal of the G-buffer, 12 bits an axis, as its packed word and as what `octahedral_decode` makes of it.
fn normal() -> (u32, [f64; 3]) {
    let (x, y) = (1900u32, 2300u32);
    let [fx, fy] = [x, y].map(|bits| f64::from(bits) / 4095.0 * 2.0 - 1.0);
    let z = 1.0 - fx.abs() - fy.abs();
    let fold = (-z).clamp(0.0, 1.0);
    let [nx, ny] = [fx, fy].map(|f| if f >= 0.0 { f - fold } else { f + fold });
    let length = (nx * nx + ny * ny + z * z).sqrt();
    (x | y << 12, [nx / length, ny / length, z / length])
}

struct Gather {
    kernel: Kernel,
    g_buffer: TextureView,
    depth: TextureView,
    irradiance: Texture,
}

fn texture(stage: &Stage, format: TextureFormat, usage: TextureUsages) -> Texture {
    stage.render_world().resource::<RenderDevice>().create_texture(&TextureDescriptor {
        label: Some("frugal_tests/texture"),
        size: Extent3d { width: EDGE, height: EDGE, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: TextureDimension::D2,
        format,
        usage: usage | TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

impl Gather {
    fn new(stage: &mut Stage) -> Self {
        let layout = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer_sized(false, None),
                uniform_buffer_sized(false, None),
                uniform_buffer_sized(false, None),
                storage_buffer_read_only_sized(false, None),
                texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
            ),
        );
        let kernel = Kernel::new(stage, "gi/gather/gather.wgsl", "gather_vpls", vec![], &layout);
        let g_buffer = texture(stage, TextureFormat::Rgba32Uint, TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST);
        let depth = texture(stage, TextureFormat::Depth32Float, TextureUsages::TEXTURE_BINDING | TextureUsages::RENDER_ATTACHMENT);
        let irradiance = texture(stage, TextureFormat::Rgba16Float, TextureUsages::STORAGE_BINDING);
        let gather =
            Self { kernel, g_buffer: g_buffer.create_view(&Default::default()), depth: depth.create_view(&Default::default()), irradiance };
        gather.fill(stage, &g_buffer);
        gather
    }

    /// Every pixel at depth 0.5, with [`normal`].
    fn fill(&self, stage: &Stage, g_buffer: &Texture) {
        let (device, queue) = (stage.render_world().resource::<RenderDevice>(), stage.render_world().resource::<RenderQueue>());
        let texels: Vec<u8> = (0..EDGE * EDGE).flat_map(|_| [0, 0, 0, normal().0].map(u32::to_le_bytes)).flatten().collect();
        let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * EDGE), rows_per_image: None };
        queue.write_texture(g_buffer.as_image_copy(), &texels, layout, g_buffer.size());
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("frugal_tests/depth") });
        encoder.begin_render_pass(&RenderPassDescriptor {
            label: Some("frugal_tests/depth"),
            color_attachments: &[],
            depth_stencil_attachment: Some(RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(Operations { load: LoadOp::Clear(0.5), store: StoreOp::Store }),
                stencil_ops: None,
            }),
            timestamp_writes: None,
            occlusion_query_set: None,
            multiview_mask: None,
        });
        queue.submit([encoder.finish()]);
    }

    fn run(&self, stage: &Stage, center: [f32; 3], vpls: &[Point; COUNT]) -> Vec<[f64; 4]> {
        // Of Bevy's view, the shader reads world_from_clip (third matrix) and exposure (after seven matrices and a position).
        let mut view = vec![0.0f32; 256];
        let half = EDGE as f32 / 2.0;
        view[32..48].copy_from_slice(&[half, 0.0, 0.0, 0.0, 0.0, 0.0, half, 0.0, 0.0, 0.0, 0.0, 0.0, center[0], center[1], center[2], 1.0]);
        view[115] = EXPOSURE;
        let mut words: Vec<f32> = vpls.iter().flat_map(|vpl| vpl.to_vpl()).collect();
        words.resize(12 * FrugalGi::MAX_VPLS_PER_PIXEL as usize, 0.0);
        let [view, vpls] = [view, words].map(|words| kernel::buffer(stage, &gpu::bytes(&words)));
        // Cells of one pixel; one set for all of them.
        let settings = kernel::buffer(stage, &[1, 1, 0, 0].map(u32::to_le_bytes).concat());
        let plan = kernel::buffer(stage, &[1, 1, COUNT as u32, 16].map(u32::to_le_bytes).concat());
        let output = self.irradiance.create_view(&Default::default());
        let bindings = BindGroupEntries::sequential((
            &self.g_buffer,
            &self.depth,
            view.as_entire_binding(),
            vpls.as_entire_binding(),
            settings.as_entire_binding(),
            plan.as_entire_binding(),
            &output,
        ));
        self.kernel.run(stage, &bindings, (1, 1));
        gpu::read_halves(stage.render_world(), &self.irradiance)
    }
}

/// Exposed irradiance of one pixel, in 64-bit floats.
fn twin(pixel: usize, center: [f32; 3], vpls: &[Point]) -> [f64; 3] {
    let (x, y) = (pixel as u32 % EDGE, pixel as u32 / EDGE);
    let offset = |n: u32| f64::from(n) + 0.5 - f64::from(EDGE) / 2.0;
    // Rows go down and clip space goes up.
    let position = [f64::from(center[0]) + offset(x), f64::from(center[1]), f64::from(center[2]) - offset(y)];
    let (_, normal) = normal();
    let mut sum = [0.0; 3];
    for vpl in vpls {
        let way: [f64; 3] = std::array::from_fn(|axis| f64::from(vpl.position[axis]) - position[axis]);
        let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|axis| a[axis] * b[axis]).sum::<f64>();
        let squared = dot(&way, &way);
        let emitter = -dot(&vpl.normal.map(f64::from), &way);
        let geometry = (dot(&normal, &way).max(0.0) * emitter.max(0.0) / (squared * squared)).min(f64::from(vpl.extent));
        (0..3).for_each(|channel| sum[channel] += f64::from(vpl.flux[channel]) * geometry);
    }
    sum.map(|sum| sum * f64::from(EXPOSURE) / std::f64::consts::PI)
}

const VPLS: [Point; COUNT] = [
    Point { position: [0.3, 2.0, 1.5], normal: [0.0, -1.0, 0.0], flux: [900.0, 400.0, 50.0], extent: 1e10 },
    Point { position: [-2.0, 0.7, 3.0], normal: [0.6, 0.0, -0.8], flux: [10.0, 800.0, 300.0], extent: 0.05 },
    Point { position: [0.6, 0.2, 0.4], normal: [0.0, -0.6, -0.8], flux: [3000.0, 2000.0, 1000.0], extent: 0.5 },
    Point { position: [1.0, -1.0, -4.0], normal: [0.0, 1.0, 0.0], flux: [70_000.0, 500.0, 20.0], extent: 1e10 },
];

fn the_gather_is_the_sum_over_vpls() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage);
    for (center, scale) in [([0.0; 3], 1.0), ([0.0; 3], 1e-2), ([0.25, 0.5, -1.0], 1e6)] {
        let vpls = VPLS.map(|vpl| Point { extent: vpl.extent * scale, ..vpl });
        let found = gather.run(&stage, center, &vpls);
        let (mut worst, mut lit) = (0.0f64, 0);
        for (pixel, found) in found.iter().enumerate() {
            let expected = twin(pixel, center, &vpls);
            for channel in 0..3 {
                // Below the smallest normal half, 6e-5, the format rounds more coarsely.
                if expected[channel] > 1e-4 {
                    worst = worst.max((found[channel] / expected[channel] - 1.0).abs());
                    lit += 1;
                }
            }
        }
        println!("    bounds of {scale} times their own: off by at most {worst:.1e} over {lit} values");
        // Half floats round to 4.9e-4.
        assert!(worst < 1e-3 && lit > 100, "{worst}, {lit}");
    }
}

fn the_gather_is_finite_at_the_extremes() {
    let mut stage = stage();
    let gather = Gather::new(&mut stage);
    let at = |position: [f32; 3], flux: f32| Point { position, normal: [0.0, -1.0, 0.0], flux: [flux; 3], extent: 0.0 };
    let check = |label: &str, center: [f32; 3], vpl: Point, extent: f32| {
        let found = gather.run(&stage, center, &[Point { extent, ..vpl }; COUNT]);
        let sound = found.iter().flatten().all(|value| value.is_finite() && *value >= 0.0);
        assert!(sound, "{label}: {:?}", found.iter().find(|texel| texel.iter().any(|value| !value.is_finite() || *value < 0.0)));
        found.iter().map(|texel| texel[1]).fold(0.0, f64::max)
    };
    for extent in [16.0, 1e10] {
        assert_eq!(check("tiny flux", [0.0; 3], at([0.0, 1.0, 1.0], 1e-20), extent), 0.0);
        assert!(check("huge flux", [0.0; 3], at([0.0, 1.0, 1.0], 1e20), extent) >= 64_000.0);
        check("largest flux", [0.0; 3], at([0.0, 1.0, 1.0], 1e30), extent);
        // Pixel centres lie at halves.
        check("no distance", [0.0; 3], at([0.5, 0.0, 0.5], 1e20), extent);
        check("hardly any distance", [0.0; 3], at([0.5, 1e-19, 0.5], 1e20), extent);
        check("1e-6 m", [0.0; 3], at([0.5, 1e-6, 0.5], 1e20), extent);
        check("a thousand kilometres away", [0.0; 3], at([0.0, 1e6, 1e6], 1e20), extent);
        check("far from the origin", [1e6, 1e6, 1e6], at([1e6, 1e6 + 1.0, 1e6], 1e5), extent);
        check("beyond the squares of 32-bit floats", [0.0; 3], at([0.0, 1e20, 1e20], 1e30), extent);
    }
}

/// Draws from maps of equally long rows, the texels' weights being their luminance times what `importance` says of their index.
fn draw(stage: &mut Stage, texels: &[Point], length: u32, count: usize, importance: impl Fn(usize) -> f32) -> Vec<Point> {
    let (read, write) = (|| storage_buffer_read_only_sized(false, None), || storage_buffer_sized(false, None));
    let layout = BindGroupLayoutEntries::sequential(ShaderStages::COMPUTE, (read(), read(), write(), write(), write(), read()));
    let kernels =
        ["accumulate_rows", "accumulate_maps", "sample_vpls"].map(|entry| Kernel::new(stage, "gi/vpl/sample.wgsl", entry, vec![], &layout));
    let row_count = texels.len() as u32 / length;
    let words: Vec<f32> = texels.iter().flat_map(|texel| texel.to_texel()).collect();
    let weights: Vec<f32> = texels.iter().enumerate().map(|(index, texel)| texel.luminance() as f32 * importance(index)).collect();
    let rows: Vec<u8> = (0..row_count).flat_map(|row| [row * length, row * length, length].map(u32::to_le_bytes)).flatten().collect();
    // One set that holds them all.
    let plan = [1, 1, count as u32, count as u32].map(u32::to_le_bytes).concat();
    let zeros = |floats: usize| gpu::bytes(&vec![0.0; floats]);
    let contents = [gpu::bytes(&words), rows, gpu::bytes(&weights), zeros(row_count as usize), zeros(count * 12), plan];
    let buffers = contents.map(|contents| kernel::buffer(stage, &contents));
    let [a, b, c, d, e, f] = buffers.each_ref().map(|buffer| buffer.as_entire_binding());
    let bindings = BindGroupEntries::sequential((a, b, c, d, e, f));
    for (kernel, groups) in kernels.iter().zip([row_count.div_ceil(64), 1, count.div_ceil(64) as u32]) {
        kernel.run(stage, &bindings, (groups, 1));
    }
    gpu::vpl_slots(&gpu::read_buffer(stage.render_world(), &buffers[4]))
}

/// A map of `rows` rows, in which every texel tells its place.
fn texels(rows: u32, length: u32, scale: f32) -> Vec<Point> {
    let texel = |index: u32| {
        // Anything but regular; some are dark.
        let weight = (index.wrapping_mul(2_654_435_761) >> 24) as f32;
        let flux = if index.is_multiple_of(3) { 0.0 } else { weight * scale };
        Point { position: [index as f32, 0.0, 0.0], normal: [0.0, 1.0, 0.0], flux: [flux, 0.5 * flux, 2.0 * flux], extent: 1e-4 }
    };
    (0..rows * length).map(texel).collect()
}

fn drawing_follows_flux() {
    let mut stage = stage();
    for scale in [1.0, 1e-20, 1e20] {
        let texels = texels(100, 32, scale);
        let vpls = draw(&mut stage, &texels, 32, 1024, |_| 1.0);
        let (drawn, all) = (gpu::total_flux(&vpls), gpu::total_flux(&texels));
        let off = drawn[1] / all[1] - 1.0;
        println!("    fluxes of {scale:e}: off by {off:+.1e}");
        // All texels have one colour, so that each channel is kept as luminance is.
        assert!(off.abs() < 1e-4, "{scale}: {off}");
        for vpl in &vpls {
            let source = &texels[vpl.position[0] as usize];
            let turned = (0..3).map(|axis| (source.normal[axis] - vpl.normal[axis]).abs()).fold(0.0, f32::max);
            // Normals are packed to 16 bits an axis.
            assert!(source.flux[0] > 0.0 && turned < 5e-5, "a dark texel was drawn: {vpl:?}");
        }
        // Rows are drawn as often as their share of the flux says, up to one VPL at each end.
        for (row, texels_of_row) in texels.chunks_exact(32).enumerate() {
            let share = 1024.0 * gpu::total_flux(texels_of_row)[1] / all[1];
            let drawn = vpls.iter().filter(|vpl| vpl.position[0] as usize / 32 == row).count() as f64;
            assert!((drawn - share).abs() <= 1.01, "row {row}: {drawn} drawn, {share} expected");
        }
    }
}

fn drawing_by_importance_keeps_the_expectation() {
    let mut stage = stage();
    let texels = texels(100, 32, 1.0);
    // The middle matters a hundred times as much.
    let matters = |index: usize| (1200..2000).contains(&index);
    let vpls = draw(&mut stage, &texels, 32, 1024, |index| if matters(index) { 100.0 } else { 1.0 });
    let sum = |points: &[Point], inside: bool| {
        points.iter().filter(|p| matters(p.position[0] as usize) == inside).map(|p| f64::from(p.flux[1])).sum::<f64>()
    };
    let inside = vpls.iter().filter(|vpl| matters(vpl.position[0] as usize)).count();
    let off = [true, false].map(|inside| sum(&vpls, inside) / sum(&texels, inside) - 1.0);
    println!(
        "    {inside} of 1024 drawn where it matters; flux there off by {:+.2} %, elsewhere by {:+.1} %",
        off[0] * 100.0,
        off[1] * 100.0
    );
    assert!(inside > 950, "{inside}");
    // About 30 VPLs stand for the rest.
    assert!(off[0].abs() < 0.01 && off[1].abs() < 0.2, "{off:?}");
}

fn drawing_from_nothing_gives_nothing() {
    let mut stage = stage();
    let vpls = draw(&mut stage, &texels(64, 16, 0.0), 16, 64, |_| 1.0);
    assert!(vpls.iter().all(|vpl| vpl.flux == [0.0; 3] && vpl.position.iter().all(|value| value.is_finite())));
}
