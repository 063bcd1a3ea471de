// Interleaving of a camera's virtual point lights among its pixels.
#define_import_path bevy_frugal_gi::gi::vpl::plan

/// In a storage buffer because loops depend on its counts: software Vulkan drivers recompile a
/// shader for each value of a uniform that control flow depends on.
struct Plan {
    /// Side of the square of low-resolution pixels among which the VPLs are interleaved.
    interleave: u32,
    /// Sets of VPLs: `interleave`².
    sets: u32,
    /// VPLs in each set.
    per_set: u32,
    /// Which samples of the weights: 0 while something changes, others at rest.
    sequence: u32,
}
