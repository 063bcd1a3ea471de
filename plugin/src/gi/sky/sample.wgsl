// Samples a camera's sky directions from its strata, in proportion to their light times their
// importance to the camera; one workgroup.
//
// As in `vpl/weigh.wgsl`, a defensive-sampling term of a quarter of the mean keeps the estimate
// unbiased and bounds its variance: a stratum that no importance point of `weigh.wgsl` sees may be
// visible elsewhere. Strata lie in Morton order, so that equal steps through their cumulative sum
// spread over the sky; each set takes as many steps as it has samples, and sets are shifted against
// each other by a fraction of a step.

#import bevy_frugal_gi::gi::view::noise::luminance
#import bevy_frugal_gi::gi::sky::sky::{SKY_STRATA, SKY_STRIDE, SkyLight}
#import bevy_frugal_gi::gi::vpl::vpl::Plan

@group(0) @binding(0) var<storage, read> strata: array<SkyLight>;
@group(0) @binding(1) var<storage, read> importance: array<f32>;
@group(0) @binding(2) var<storage, read> plan: Plan;
@group(0) @binding(3) var<storage, read_write> samples: array<SkyLight>;

const LANES: u32 = 64u;
/// Strata that each lane sums.
const RUN: u32 = SKY_STRATA / LANES;

var<workgroup> lane_light: array<f32, LANES>;
var<workgroup> lane_weighted: array<f32, LANES>;
var<workgroup> lane_weight: array<f32, LANES>;
var<workgroup> cumulative: array<f32, SKY_STRATA>;

/// First stratum whose cumulative sum exceeds `threshold`, or the last one.
fn find_stratum(threshold: f32) -> u32 {
    var low = 0u;
    var high = SKY_STRATA - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if cumulative[middle] > threshold {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    return low;
}

@compute @workgroup_size(LANES)
fn sample_sky(@builtin(local_invocation_index) lane: u32) {
    let first = lane * RUN;
    var light = 0.0;
    var weighted = 0.0;
    for (var i = first; i < first + RUN; i++) {
        let luminance = luminance(strata[i].light);
        light += luminance;
        weighted += luminance * importance[i];
    }
    lane_light[lane] = light;
    lane_weighted[lane] = weighted;
    workgroupBarrier();
    light = 0.0;
    weighted = 0.0;
    for (var i = 0u; i < LANES; i++) {
        light += lane_light[i];
        weighted += lane_weighted[i];
    }
    // Where no importance point sees any stratum, light alone decides.
    let defensive_term = max(0.25 * weighted / max(light, 1e-36), 1e-3);
    var sum = 0.0;
    for (var i = first; i < first + RUN; i++) {
        sum += luminance(strata[i].light) * (importance[i] + defensive_term);
        cumulative[i] = sum;
    }
    lane_weight[lane] = sum;
    workgroupBarrier();
    var before = 0.0;
    for (var i = 0u; i < lane; i++) {
        before += lane_weight[i];
    }
    for (var i = first; i < first + RUN; i++) {
        cumulative[i] += before;
    }
    workgroupBarrier();

    let total = cumulative[SKY_STRATA - 1u];
    let count = f32(plan.sky_samples);
    for (var i = lane; i < plan.sets * plan.sky_samples; i += LANES) {
        let which = i / plan.sky_samples;
        let member = i % plan.sky_samples;
        let shift = f32(plan.sequence) * 0.618034;
        let index = find_stratum((f32(member) + fract((f32(which) + 0.5) / f32(plan.sets) + shift)) / count * total);
        // The step of the cumulative sum, not the weight that was added: this is the probability
        // with which the stratum was sampled, rounding included.
        let weight = cumulative[index] - select(0.0, cumulative[max(index, 1u) - 1u], index > 0u);
        let share = select(0.0, total / (max(weight, 1e-36) * count), weight > 0.0);
        var sampled: SkyLight;
        sampled.direction = strata[index].direction;
        sampled.light = strata[index].light * min(share, 1e12);
        samples[which * SKY_STRIDE + member] = sampled;
    }
}
