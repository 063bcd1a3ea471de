// What is sampled in a tile: a texel of two words. The first has the pixel, x in its lower half. The
// second has these bits.
#define_import_path bevy_frugal_gi::gi::cache::record

/// There is a surface.
const SURFACE: u32 = 1u;
/// It is lit in this frame.
const LIGHTS: u32 = 2u;
/// Levels that it is stored at: a bit each, of the finest first.
const USES: u32 = 16u;
/// What is known of the four cells around it: two bits for each level (see `table.wgsl`).
const LINKS: u32 = 256u;

fn recorded_pixel(record: vec2<u32>) -> vec2<u32> {
    return vec2(record.x & 0xffffu, record.x >> 16u);
}
