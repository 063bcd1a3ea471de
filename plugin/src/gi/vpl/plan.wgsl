// How a camera's virtual point lights are shared out among its pixels.
#define_import_path bevy_frugal_gi::gi::vpl::plan

/// In a storage buffer because counts decide about loops: software Vulkan drivers compile a shader
/// anew for each value that control flow takes from a uniform.
struct Plan {
    /// Side of the square of pixels that share them out.
    interleave: u32,
    /// Sets of them: `interleave`².
    sets: u32,
    /// In each set.
    per_set: u32,
    /// From one set to the next in the buffer.
    stride: u32,
}
