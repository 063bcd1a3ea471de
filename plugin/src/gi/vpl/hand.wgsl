// One light drawn from many, in proportion to what each would send.
//
// A hand of lights takes one ray: the drawn light stands for the hand, with all that the hand would
// send where the ray to it is free, and with nothing where not. In luminance the expectation is the
// sum of what is visible, whatever hides the rest, and rays go where light comes from: one step of
// resampled importance sampling (Talbot et al. 2005) with its proposals in a fixed order.
#define_import_path bevy_frugal_gi::gi::vpl::hand

#import bevy_frugal_gi::gi::view::luminance::luminance

struct Hand {
    /// What all lights of it would send.
    sent: vec3<f32>,
    /// The same, as they are weighed.
    total: f32,
    /// What draws: one number for the whole hand, of which what is left after each draw is again
    /// evenly spread (Chao 1982, with the number reused).
    number: f32,
    /// Index of the light that is drawn.
    drawn: u32,
}

/// A hand of nothing; `number` in 0 to 1.
fn empty_hand(number: f32) -> Hand {
    return Hand(vec3(0.0), 0.0, number, 0u);
}

fn weight_of(light: vec3<f32>) -> f32 {
    // So that a sum of a thousand is finite.
    return min(luminance(light), 1e30);
}

/// The hand with one light more, which would send `light`.
fn dealt(hand: Hand, index: u32, light: vec3<f32>) -> Hand {
    let weight = weight_of(light);
    let total = hand.total + weight;
    let probability = weight / max(total, 1e-35);
    let taken = hand.number < probability;
    return Hand(
        hand.sent + light,
        total,
        select((hand.number - probability) / (1.0 - probability), hand.number / probability, taken),
        select(hand.drawn, index, taken),
    );
}
