//! Custom materials, as an app or another plugin would define them.

use bevy::app::App;
use bevy::asset::{Asset, embedded_asset};
use bevy::color::LinearRgba;
use bevy::material::OpaqueRendererMethod;
use bevy::math::Vec4;
use bevy::pbr::{ExtendedMaterial, Material, MaterialExtension, MaterialPlugin, StandardMaterial};
use bevy::reflect::TypePath;
use bevy::render::render_resource::AsBindGroup;
use bevy::shader::ShaderRef;

/// Adds the materials and their shaders to an app before it starts.
pub fn add(app: &mut App) {
    embedded_asset!(app, "tint.wgsl");
    embedded_asset!(app, "shift.wgsl");
    embedded_asset!(app, "forward.wgsl");
    embedded_asset!(app, "deferred.wgsl");
    app.add_plugins((
        MaterialPlugin::<ExtendedMaterial<StandardMaterial, Tint>>::default(),
        MaterialPlugin::<ExtendedMaterial<StandardMaterial, ForwardTint>>::default(),
        MaterialPlugin::<ExtendedMaterial<StandardMaterial, Shift>>::default(),
        MaterialPlugin::<Forward>::default(),
        MaterialPlugin::<WithoutPrepass>::default(),
        MaterialPlugin::<Deferred>::default(),
    ));
}

fn shader(file: &str) -> ShaderRef {
    ShaderRef::Path(format!("embedded://frugal_tests/materials/{file}.wgsl").into())
}

/// An extension that replaces the base colour in the G-buffer and in forward shading.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct Tint {
    /// Linear Rec. 709.
    #[uniform(100)]
    pub color: LinearRgba,
}

impl MaterialExtension for Tint {
    fn fragment_shader() -> ShaderRef {
        shader("tint")
    }

    fn deferred_fragment_shader() -> ShaderRef {
        shader("tint")
    }
}

/// [`Tint`] without a shader for deferred rendering.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct ForwardTint {
    /// Linear Rec. 709.
    #[uniform(100)]
    pub color: LinearRgba,
}

impl MaterialExtension for ForwardTint {
    fn fragment_shader() -> ShaderRef {
        shader("tint")
    }
}

/// An extension that displaces its mesh.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct Shift {
    /// World space, metres.
    #[uniform(100)]
    pub by: Vec4,
}

impl MaterialExtension for Shift {
    fn prepass_vertex_shader() -> ShaderRef {
        shader("shift")
    }

    fn deferred_vertex_shader() -> ShaderRef {
        shader("shift")
    }
}

/// A material of one colour whose shader outputs the final colour: Bevy renders such materials
/// forward.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct Forward {
    /// Linear Rec. 709, exposed.
    #[uniform(0)]
    pub color: LinearRgba,
}

impl Material for Forward {
    fn fragment_shader() -> ShaderRef {
        shader("forward")
    }
}

/// [`Forward`] without a prepass.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct WithoutPrepass {
    /// Linear Rec. 709, exposed.
    #[uniform(0)]
    pub color: LinearRgba,
}

impl Material for WithoutPrepass {
    fn fragment_shader() -> ShaderRef {
        shader("forward")
    }

    fn enable_prepass() -> bool {
        false
    }
}

/// A diffuse material of one colour that writes a G-buffer.
#[derive(Asset, AsBindGroup, TypePath, Clone, Debug)]
pub struct Deferred {
    /// Linear Rec. 709.
    #[uniform(0)]
    pub color: LinearRgba,
}

impl Material for Deferred {
    fn opaque_render_method(&self) -> OpaqueRendererMethod {
        OpaqueRendererMethod::Deferred
    }

    fn deferred_fragment_shader() -> ShaderRef {
        shader("deferred")
    }
}
