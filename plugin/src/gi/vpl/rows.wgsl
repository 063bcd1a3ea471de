// The rows of a camera's reflective shadow maps, one after another.
#define_import_path bevy_frugal_gi::gi::vpl::rows

struct Row {
    /// Index of its first texel among all maps' texels.
    first_texel: u32,
    /// Index of its first texel among the camera's weights.
    first_weight: u32,
    /// Texels in it.
    length: u32,
}
