// Patches: pieces of surface that reflect incident light; and the range of a camera's patches.
#define_import_path bevy_frugal_gi::gi::bounces::patch

struct Patch {
    /// World space, metres.
    position: vec3<f32>,
    /// m²; 0 for padding.
    area: f32,
    /// As in the G-buffer: colour and roughness, and further properties.
    color: u32,
    properties: u32,
    packed_normal: u32,
    padding: u32,
}

struct PatchRange {
    /// Index of the first patch's texel in the store.
    first_texel: u32,
}
