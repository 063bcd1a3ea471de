// What the gather and the filter after it are told.
#define_import_path bevy_frugal_gi::gi::gather::settings

struct Gather {
    /// Most that the geometry term cosθ·cosθ′/d² may be, 1/m².
    largest_geometry_term: f32,
    /// Width and height in pixels of the cells that are gathered once.
    cell_width: u32,
    cell_height: u32,
    padding: u32,
    /// Place of this set's pixels in the square that shares the VPLs out.
    residue: vec2<u32>,
    padding_2: vec2<u32>,
}
