// One light sampled from a stratum of many, in proportion to the irradiance from each.
//
// Each stratum takes one ray. The ray to the sampled light accepts or rejects the irradiance of the
// whole stratum. In luminance the expectation is the sum over the visible lights, whatever occludes
// the others, and rays go where light comes from: one step of resampled importance sampling (Talbot
// et al. 2005) with its candidates in a fixed order.
#define_import_path bevy_frugal_gi::gi::vpl::stratum

#import bevy_frugal_gi::gi::view::luminance::luminance

struct Stratum {
    /// Unoccluded irradiance from all its lights, lux · π.
    sent: vec3<f32>,
    /// Sum of the lights' weights: their luminance.
    total: f32,
    /// The random number, in 0 to 1: one for the whole stratum. After each candidate it is
    /// rescaled, which leaves it uniform (reservoir sampling by Chao 1982, with the number reused).
    number: f32,
    /// Index of the sampled light.
    sampled: u32,
}

/// A stratum without lights; `number` in 0 to 1.
fn empty_stratum(number: f32) -> Stratum {
    return Stratum(vec3(0.0), 0.0, number, 0u);
}

fn weight_of(light: vec3<f32>) -> f32 {
    // Keeps a sum over a thousand lights finite.
    return min(luminance(light), 1e30);
}

/// Adds one candidate with unoccluded irradiance `light` to the reservoir.
fn update_stratum(stratum: Stratum, index: u32, light: vec3<f32>) -> Stratum {
    let weight = weight_of(light);
    let total = stratum.total + weight;
    let probability = weight / max(total, 1e-35);
    let accepted = stratum.number < probability;
    return Stratum(
        stratum.sent + light,
        total,
        select((stratum.number - probability) / (1.0 - probability), stratum.number / probability, accepted),
        select(stratum.sampled, index, accepted),
    );
}
