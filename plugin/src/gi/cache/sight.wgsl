// What cells' anchors see of each other and of the points between them.
#define_import_path bevy_frugal_gi::gi::cache::sight

#import bevy_frugal_gi::gi::cache::grid::Spot
#import bevy_frugal_gi::gi::cache::table::settings
#import bevy_frugal_gi::gi::trace::trace::is_occluded

/// Whether two points see each other, relative to the grid's origin.
fn is_seen(one: vec3<f32>, other: vec3<f32>) -> bool {
    return !is_occluded(one + settings.origin, other + settings.origin);
}

/// Of the four squares around a spot the nearest, the second, the third or the farthest. `corner` is
/// the lowest of them.
fn nth_nearest(spot: Spot, corner: vec2<i32>, size: f32, rank: u32) -> vec2<i32> {
    let part = spot.at / size - 0.5 - vec2<f32>(corner);
    let nearest = vec2<i32>(vec2<u32>(part >= vec2(0.5)));
    // The one across the nearer border is the second.
    let along_x = abs(part.x - 0.5) < abs(part.y - 0.5);
    let second = select(vec2(0, 1), vec2(1, 0), along_x);
    let third = vec2(1, 1) - second;
    let flip = select(select(vec2(0, 0), second, rank == 1u), select(third, vec2(1, 1), rank == 3u), rank >= 2u);
    return corner + (nearest ^ flip);
}
