//! Runs one of the plugin's shipped compute shaders on synthetic buffers.

use bevy::asset::{AssetServer, Handle};
use bevy::render::render_resource::{
    BindGroupEntry, BindGroupLayoutDescriptor, BindGroupLayoutEntry, Buffer, BufferInitDescriptor,
    BufferUsages, CachedComputePipelineId, CommandEncoderDescriptor, ComputePassDescriptor,
    ComputePipelineDescriptor, PipelineCache,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::shader::{Shader, ShaderDefVal};
use frugal::stage::Stage;

/// A compiled compute shader.
pub struct Kernel {
    /// One layout per bind group.
    layouts: Vec<BindGroupLayoutDescriptor>,
    pipeline: CachedComputePipelineId,
    // Keeps the shader loaded.
    _shader: Handle<Shader>,
}

impl Kernel {
    /// Compiles `entry_point` of the plugin's shader at `path` (under its `src`).
    pub fn new(
        stage: &mut Stage,
        path: &str,
        entry_point: &'static str,
        shader_defs: Vec<ShaderDefVal>,
        layout: &[BindGroupLayoutEntry],
    ) -> Self {
        Self::with_groups(stage, path, entry_point, shader_defs, &[layout])
    }

    /// [`new`](Self::new) for a shader with several bind groups.
    pub fn with_groups(
        stage: &mut Stage,
        path: &str,
        entry_point: &'static str,
        shader_defs: Vec<ShaderDefVal>,
        layouts: &[&[BindGroupLayoutEntry]],
    ) -> Self {
        let shader: Handle<Shader> = stage
            .world_mut()
            .resource::<AssetServer>()
            .load(format!("embedded://bevy_frugal_gi/{path}"));
        Self::of(stage, shader, entry_point, shader_defs, layouts)
    }

    /// [`with_groups`](Self::with_groups) for any shader.
    pub fn of(
        stage: &mut Stage,
        shader: Handle<Shader>,
        entry_point: &'static str,
        shader_defs: Vec<ShaderDefVal>,
        layouts: &[&[BindGroupLayoutEntry]],
    ) -> Self {
        let layouts: Vec<_> = layouts
            .iter()
            .map(|layout| BindGroupLayoutDescriptor::new("frugal_tests/kernel", layout))
            .collect();
        let pipeline = stage.render_world().resource::<PipelineCache>().queue_compute_pipeline(
            ComputePipelineDescriptor {
                label: Some(entry_point.into()),
                layout: layouts.clone(),
                shader: shader.clone(),
                shader_defs,
                entry_point: Some(entry_point.into()),
                ..Default::default()
            },
        );
        for _ in 0..20 {
            stage.frame();
            if stage
                .render_world()
                .resource::<PipelineCache>()
                .get_compute_pipeline(pipeline)
                .is_some()
            {
                return Self { layouts, pipeline, _shader: shader };
            }
        }
        let state = format!(
            "{:?}",
            stage.render_world().resource::<PipelineCache>().get_compute_pipeline_state(pipeline)
        );
        panic!("{entry_point} did not compile: {state}");
    }

    /// Dispatches it once over `groups` workgroups without waiting; reading back waits.
    pub fn run(&self, stage: &Stage, bindings: &[BindGroupEntry], groups: (u32, u32)) {
        self.run_with_groups(stage, &[bindings], groups);
    }

    /// [`run`](Self::run) for a shader with several bind groups.
    pub fn run_with_groups(
        &self,
        stage: &Stage,
        bindings: &[&[BindGroupEntry]],
        groups: (u32, u32),
    ) {
        let world = stage.render_world();
        let (device, cache) = (world.resource::<RenderDevice>(), world.resource::<PipelineCache>());
        let bind_groups = self.layouts.iter().zip(bindings).map(|(layout, bindings)| {
            device.create_bind_group(
                "frugal_tests/kernel",
                &cache.get_bind_group_layout(layout),
                bindings,
            )
        });
        let bind_groups: Vec<_> = bind_groups.collect();
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor {
            label: Some("frugal_tests/kernel"),
        });
        {
            let mut pass = encoder.begin_compute_pass(&ComputePassDescriptor {
                label: Some("frugal_tests/kernel"),
                timestamp_writes: None,
            });
            let pipeline = cache
                .get_compute_pipeline(self.pipeline)
                .unwrap_or_else(|| panic!("the kernel was compiled before"));
            pass.set_pipeline(pipeline);
            for (index, bind_group) in (0..).zip(&bind_groups) {
                pass.set_bind_group(index, bind_group, &[]);
            }
            pass.dispatch_workgroups(groups.0, groups.1, 1);
        }
        world.resource::<RenderQueue>().submit([encoder.finish()]);
    }
}

/// A buffer with contents, usable as storage and uniform buffer and as a copy source.
pub fn buffer(stage: &Stage, contents: &[u8]) -> Buffer {
    stage.render_world().resource::<RenderDevice>().create_buffer_with_data(&BufferInitDescriptor {
        label: Some("frugal_tests/buffer"),
        contents,
        usage: BufferUsages::STORAGE | BufferUsages::UNIFORM | BufferUsages::COPY_SRC,
    })
}
