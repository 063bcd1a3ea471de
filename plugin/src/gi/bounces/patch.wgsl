// Pieces of surface that reflect what lights them, and where a camera has them.
#define_import_path bevy_frugal_gi::gi::bounces::patch

struct Patch {
    /// World space, metres.
    position: vec3<f32>,
    /// m²; 0 for none.
    area: f32,
    /// As the G-buffer has them: colour and roughness, and the rest.
    color: u32,
    properties: u32,
    packed_normal: u32,
    padding: u32,
}

struct PatchRange {
    /// Index of the first patch's texel in the store.
    first_texel: u32,
}
