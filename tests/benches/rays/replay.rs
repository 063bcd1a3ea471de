//! The shipped traversal with counters in it, over the trees of a stage.

use bevy::asset::Assets;
use bevy::math::Vec3;
use bevy::render::render_resource::binding_types::{
    storage_buffer_read_only_sized, storage_buffer_sized,
};
use bevy::render::render_resource::{
    BindGroupEntries, BindGroupLayoutEntries, BindGroupLayoutEntry, Buffer, ShaderStages,
};
use bevy::shader::{Shader, ShaderDefVal};
use bevy_frugal_gi::gi::inspect;
use frugal::stage::Stage;
use frugal_tests::gpu;
use frugal_tests::kernel::{self, Kernel};

/// A ray between two points, or none.
pub(crate) type Ray = Option<[Vec3; 2]>;

const TRACE: &str = include_str!("../../../plugin/src/gi/trace/trace.wgsl");
/// What is counted of the traversal: text that occurs once in it, and the count before it.
const COUNTED: [(&str, &str); 5] = [
    ("let node = instance_nodes[index];", "tops++;"),
    ("if meets_mesh(instances[first + i]", "instance = i; round = 0u;"),
    ("while held < 65536u {", "begin_round();"),
    ("let node = mesh_nodes[", "count(65536u);"),
    ("if meets_triangle(triangles[", "count(1u);"),
];
/// A ray's log: whether it is occluded and its rounds; loads of nodes over instances; then for each round
/// which it is (top node, instance, round), and in a second word its loads and triangle tests (16 bits each).
const REPLAY: &str = "
struct Ray { origin: vec3<f32>, is_traced: u32, end: vec3<f32>, padding: u32 }
@group(0) @binding(0) var<storage, read> rays: array<Ray>;
@group(0) @binding(1) var<storage, read_write> logs: array<u32>;
const WORDS: u32 = #{WORDS}u;
var<private> log: u32;
var<private> rounds: u32;
var<private> tops: u32;
var<private> instance: u32;
var<private> round: u32;
fn begin_round() {
    rounds++;
    logs[log + min(2u * rounds, WORDS - 2u)] = (tops << 16u) | (instance << 13u) | round;
    round++;
}
fn count(what: u32) {
    logs[log + min(2u * rounds, WORDS - 2u) + 1u] += what;
}
@compute @workgroup_size(64)
fn replay(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    begin_trace(thread);
    let ray = rays[id.x];
    log = id.x * WORDS;
    if ray.is_traced == 0u {
        return;
    }
    let occluded = is_occluded(ray.origin, ray.end);
    logs[log] = (rounds << 1u) | u32(occluded);
    logs[log + 1u] = tops;
}
";
pub(crate) const WORDS: usize = 256;
pub(crate) const WAVE: usize = 64;

/// The counted traversal, and the stage's trees.
pub(crate) struct Replay {
    kernel: Kernel,
    occluders: [Buffer; 4],
}

impl Replay {
    pub(crate) fn new(stage: &mut Stage) -> Self {
        let mut source: String = TRACE
            .lines()
            .filter(|line| !line.starts_with("#define"))
            .fold(String::new(), |all, line| all + line + "\n");
        for (text, count) in COUNTED {
            assert_eq!(source.matches(text).count(), 1, "`{text}` in trace.wgsl");
            source = source.replace(text, &format!("{count} {text}"));
        }
        let shader = Shader::from_wgsl(source + REPLAY, "frugal_tests/rays.wgsl");
        let shader = stage.world_mut().resource_mut::<Assets<Shader>>().add(shader);
        let own = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (storage_buffer_read_only_sized(false, None), storage_buffer_sized(false, None)),
        );
        let read = || storage_buffer_read_only_sized(false, None);
        let trees = BindGroupLayoutEntries::sequential(
            ShaderStages::COMPUTE,
            (read(), read(), read(), read()),
        );
        let both: [&[BindGroupLayoutEntry]; 2] = [&own, &trees];
        let words = vec![ShaderDefVal::UInt("WORDS".into(), WORDS as u32)];
        let kernel = Kernel::of(stage, shader, "replay", words, &both);
        let occluders = inspect::gpu_state(stage.render_world()).occluders;
        Self { kernel, occluders: occluders.expect("a camera that traces") }
    }

    /// The log of each ray, [`WORDS`] words.
    pub(crate) fn run(&self, stage: &Stage, rays: &[Ray]) -> Vec<u32> {
        let words = |ray: &Ray| {
            let traced = f32::from_bits(u32::from(ray.is_some()));
            let [from, to] = ray.unwrap_or([Vec3::ZERO; 2]);
            [from.x, from.y, from.z, traced, to.x, to.y, to.z, 0.0]
        };
        let mut given: Vec<f32> = rays.iter().flat_map(words).collect();
        given.resize(rays.len().next_multiple_of(WAVE) * 8, 0.0);
        let count = given.len() / 8;
        let given = kernel::buffer(stage, &gpu::bytes(&given));
        let logs = kernel::buffer(stage, &vec![0; count * WORDS * 4]);
        let own =
            BindGroupEntries::sequential((given.as_entire_binding(), logs.as_entire_binding()));
        let [a, b, c, d] = self.occluders.each_ref().map(|buffer| buffer.as_entire_binding());
        let trees = BindGroupEntries::sequential((a, b, c, d));
        self.kernel.run_with_groups(stage, &[&own, &trees], ((count / WAVE) as u32, 1));
        gpu::words(&gpu::read_buffer(stage.render_world(), &logs))
    }
}
