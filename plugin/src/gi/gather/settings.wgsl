// Settings of the gather and of the denoiser.
#define_import_path bevy_frugal_gi::gi::gather::settings

struct Gather {
    /// Width and height of a low-resolution pixel, in pixels.
    cell_width: u32,
    cell_height: u32,
    padding: vec2<u32>,
}
