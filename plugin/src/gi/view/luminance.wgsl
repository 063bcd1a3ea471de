// Luminance.
#define_import_path bevy_frugal_gi::gi::view::luminance

/// Rec. 709, linear RGB.
fn luminance(light: vec3<f32>) -> f32 {
    return dot(light, vec3(0.2126, 0.7152, 0.0722));
}
