//! The shipped gather on synthetic pixels and virtual point lights, and its CPU reference in 64-bit
//! floats.

use bevy::math::DVec3;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, texture_2d, texture_depth_2d, texture_storage_2d,
    uniform_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupEntry, BindGroupLayoutEntries, BindGroupLayoutEntry, Buffer,
    ShaderStages, StorageTextureAccess, TextureFormat, TextureSampleType,
};
use bevy::shader::ShaderDefVal;
use frugal::stage::Stage;

use crate::gpu::{self, Point};
use crate::kernel::{self, Kernel};
use crate::pixels::{Pixels, Plane};

/// `gather/gather.wgsl`, compiled.
pub struct Gather {
    kernel: Kernel,
}

impl Gather {
    /// Compiles it with `rays` rays per pixel; 0 for none.
    pub fn new(stage: &mut Stage, rays: u32) -> Self {
        let read = || storage_buffer_read_only_sized(false, None);
        let pixels = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (
                texture_2d(TextureSampleType::Uint),
                texture_depth_2d(),
                uniform_buffer_sized(false, None),
                read(),
                read(),
                texture_storage_2d(TextureFormat::Rgba16Float, StorageTextureAccess::WriteOnly),
            ),
        );
        let occluders = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (read(), read(), read(), read()),
        );
        let both: [&[BindGroupLayoutEntry]; 2] = [&pixels, &occluders];
        let (defs, groups) = if rays == 0 {
            (vec![], &both[..1])
        } else {
            (vec![ShaderDefVal::UInt("RAYS".into(), rays)], &both[..])
        };
        Self {
            kernel: Kernel::with_groups(
                stage,
                "gi/gather/gather.wgsl",
                "gather_vpls",
                defs,
                groups,
            ),
        }
    }

    /// Exposed irradiance of every pixel from one set of `vpls`, as stored.
    pub fn run(
        &self,
        stage: &Stage,
        pixels: &Pixels,
        plane: &Plane,
        vpls: &[Point],
    ) -> Vec<[f64; 4]> {
        self.run_with(stage, pixels, plane, vpls, None)
    }

    /// [`run`](Self::run) with the geometry that rays intersect.
    pub fn run_with(
        &self,
        stage: &Stage,
        pixels: &Pixels,
        plane: &Plane,
        vpls: &[Point],
        occluders: Option<&[Buffer; 4]>,
    ) -> Vec<[f64; 4]> {
        let mut words: Vec<f32> = vpls.iter().flat_map(|vpl| vpl.to_vpl()).collect();
        // No binding may be empty.
        words.resize(words.len().max(Point::VPL_WORDS), 0.0);
        let (view, vpl_buffer) =
            (pixels.view(stage, plane), kernel::buffer(stage, &gpu::bytes(&words)));
        let plan = plan(stage, vpls.len() as u32);
        let texture = pixels.output(stage);
        let output = texture.create_view(&Default::default());
        let bindings = BindGroupEntries::sequential((
            &pixels.g_buffer,
            &pixels.depth,
            view.as_entire_binding(),
            vpl_buffer.as_entire_binding(),
            plan.as_entire_binding(),
            &output,
        ));
        let workgroups = (pixels.size[0].div_ceil(8), pixels.size[1].div_ceil(8));
        match occluders {
            None => self.kernel.run(stage, &bindings, workgroups),
            Some(occluders) => {
                let [a, b, c, d] = occluders.each_ref().map(|buffer| buffer.as_entire_binding());
                let occluders = BindGroupEntries::sequential((a, b, c, d));
                let both: [&[BindGroupEntry]; 2] = [&bindings, &occluders];
                self.kernel.run_with_groups(stage, &both, workgroups);
            }
        }
        gpu::read_halves(stage.render_world(), &texture)
    }
}

/// `Plan` of the shader: one set of `count` VPLs for all pixels, at full resolution.
pub fn plan(stage: &Stage, count: u32) -> Buffer {
    kernel::buffer(stage, &plan_bytes(count))
}

/// Bytes of such a `Plan`.
pub fn plan_bytes(count: u32) -> Vec<u8> {
    [1, 1, count, 0, 0, 1, 1].map(u32::to_le_bytes).concat()
}

/// Exposed irradiance of one point: `gather.wgsl` in 64-bit floats, without rounding to half
/// floats.
pub fn irradiance(vpls: &[Point], position: DVec3, normal: DVec3, exposure: f32) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for vpl in vpls {
        let geometry = geometry(vpl, position, normal);
        (0..3).for_each(|channel| sum[channel] += f64::from(vpl.flux[channel]) * geometry);
    }
    sum.map(|sum| sum * f64::from(exposure) / std::f64::consts::PI)
}

/// The geometry term between a point and a VPL, bounded by the VPL's `extent`, 1/m².
pub fn geometry(vpl: &Point, position: DVec3, normal: DVec3) -> f64 {
    let [from, facing] =
        [vpl.position, vpl.normal].map(|vector| DVec3::from_array(vector.map(f64::from)));
    let to_light = from - position;
    let square = to_light.length_squared().max(1e-18);
    let cosines =
        normal.dot(to_light).max(0.0) / square * (-facing.dot(to_light)).max(0.0) / square;
    cosines.min(f64::from(vpl.extent))
}
