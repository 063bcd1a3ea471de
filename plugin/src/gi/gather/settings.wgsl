// What the gather and the filter after it are told.
#define_import_path bevy_frugal_gi::gi::gather::settings

struct Gather {
    /// Width and height in pixels of the cells that are gathered once.
    cell_width: u32,
    cell_height: u32,
    /// Place of this set's pixels in the square that shares the VPLs out.
    residue: vec2<u32>,
}
