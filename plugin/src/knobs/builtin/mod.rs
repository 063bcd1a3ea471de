//! The built-in knobs; here those of resolution: of the image, textures, shadow maps, and time.

mod effects;
mod gi;
mod shadow_cascades;
mod view_distance;

use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::Smaa;
use bevy::app::App;
use bevy::ecs::entity::{EntityClonerBuilder, OptIn};
use bevy::light::{DirectionalLightShadowMap, PointLightShadowMap, VolumetricFog};
use bevy::pbr::{ContactShadows, ScreenSpaceAmbientOcclusion, ScreenSpaceReflections};
use bevy::post_process::bloom::Bloom;
use bevy::render::camera::MipBias;

use super::overrides::Override;
use super::{FieldKnob, Knob, KnobField, RegisterKnob};
use crate::gi::FrugalGi;
use crate::pacing::FrameRateLimit;
use crate::resolution::ResolutionScale;

/// Registers the knobs, in the order of spaces, and adds their systems.
pub(super) fn build(app: &mut App) {
    app.register_knob(gi::vpl_count())
        .register_knob(gi::pixel_fraction())
        .register_knob(gi::interleave())
        .register_knob(gi::visibility())
        .register_knob(gi::environment_samples())
        .register_knob(gi::bounces())
        .register_knob(gi::rsm_resolution())
        .register_knob(gi::refresh_period())
        .register_knob(shadow_map_resolution())
        .register_knob(shadow_cascades::knob())
        .register_knob(effects::ambient_occlusion())
        .register_knob(effects::Antialiasing)
        .register_knob(texture_detail())
        .register_knob(effects::post_processing())
        .register_knob(resolution_scale())
        .register_knob(effects::effects())
        .register_knob(view_distance::knob())
        .register_knob(frame_rate());
    effects::build(app);
    shadow_cascades::build(app);
    view_distance::build(app);
}

/// Lets a clone of a camera have what knobs keep of the components that the app authored.
pub(crate) fn allow_authored(builder: &mut EntityClonerBuilder<OptIn>) {
    builder
        .allow::<(Override<FrugalGi>, Override<Bloom>, Override<Fxaa>, Override<Smaa>)>()
        .allow::<(Override<ScreenSpaceAmbientOcclusion>, Override<ScreenSpaceReflections>)>()
        .allow::<(Override<ContactShadows>, Override<VolumetricFog>)>();
}

/// 50 to 100 % of the width and height. Higher levels are sharper; the cost grows with the square.
fn resolution_scale() -> FieldKnob {
    let levels = [50, 60, 70, 80, 90, 100]
        .map(|percent| (f64::from(percent) / 100.0, format!("{percent}%")));
    FieldKnob::new(
        Knob::labelled("resolution_scale", levels),
        KnobField::new(|scale: &mut ResolutionScale| &mut scale.0, |level, _| level.value as f32)
            .added(),
    )
}

/// Mip bias +2 to 0 levels. A higher bias is blurrier and saves bandwidth, but not memory: the
/// finer mip levels stay resident.
fn texture_detail() -> FieldKnob {
    FieldKnob::new(
        // The value is the negated bias, so that it increases with quality.
        Knob::labelled("texture_detail", [(-2.0, "+2"), (-1.0, "+1"), (-0.5, "+0.5"), (0.0, "0")]),
        KnobField::new(|bias: &mut MipBias| &mut bias.0, |level, _| -level.value as f32).added(),
    )
}

/// Texels along the edge of a cascade or a spot light's map; a point light's six faces have half as
/// many. Higher levels give sharper shadow edges and cost more fill rate and memory.
fn shadow_map_resolution() -> FieldKnob {
    FieldKnob::new(
        Knob::new("shadow_map_resolution", [256.0, 512.0, 1024.0, 2048.0]),
        KnobField::new(
            |map: &mut DirectionalLightShadowMap| &mut map.size,
            |level, _| level.value as usize,
        )
        .of_resource(),
    )
    .and(
        KnobField::new(
            |map: &mut PointLightShadowMap| &mut map.size,
            |level, _| level.value as usize / 2,
        )
        .of_resource(),
    )
}

/// Value of the frame rate's level without a limit: knobs have finite values.
const UNLIMITED: f64 = 1e6;

/// 30, 40, 60, 90 or 120 frames per second, or no limit; at most the app's own limit. Power grows
/// with the frame rate, motion gets smoother. Opt-in: the error of a still image cannot measure it.
fn frame_rate() -> FieldKnob {
    let rates = [30, 40, 60, 90, 120].map(|rate| (f64::from(rate), rate.to_string()));
    let unlimited = (UNLIMITED, "unlimited".to_owned());
    FieldKnob::new(
        Knob::labelled("frame_rate", rates.into_iter().chain([unlimited])),
        KnobField::new(
            |limit: &mut FrameRateLimit| &mut limit.hertz,
            |level, authored| {
                let hertz = (level.value < UNLIMITED).then_some(level.value);
                // 0, negative and NaN are no limit, as none.
                let own = authored.filter(|own| *own > 0.0);
                own.map_or(hertz, |own| Some(hertz.map_or(own, |hertz| hertz.min(own))))
            },
        )
        .of_resource(),
    )
    .opt_in()
}

#[cfg(test)]
mod tests {
    use bevy::ecs::prelude::*;

    use super::*;
    use crate::knobs::KnobDriver;

    #[test]
    fn the_apps_own_limit_bounds_the_knob_and_comes_back() {
        let mut world = World::new();
        let camera = world.spawn_empty().id();
        let knob = frame_rate();
        let levels = knob.knob().levels;
        let limit = |world: &World| world.get_resource::<FrameRateLimit>().and_then(|it| it.hertz);
        knob.apply(&mut world, camera, &levels[0]);
        assert_eq!(limit(&world), None, "an app without pacing is left alone");
        world.insert_resource(FrameRateLimit { hertz: Some(60.0) });
        let limits: Vec<_> = levels
            .iter()
            .map(|level| {
                knob.apply(&mut world, camera, level);
                limit(&world)
            })
            .collect();
        assert_eq!(limits, [30.0, 40.0, 60.0, 60.0, 60.0, 60.0].map(Some));
        knob.apply(&mut world, camera, &levels[1]);
        world.insert_resource(FrameRateLimit { hertz: None });
        assert!(!knob.is_applied(&world, camera, &levels[1]));
        knob.apply(&mut world, camera, &levels[1]);
        assert_eq!(limit(&world), Some(40.0));
        knob.release(&mut world, camera);
        assert_eq!(limit(&world), None);
        for none in [0.0, -1.0, f64::NAN] {
            world.insert_resource(FrameRateLimit { hertz: Some(none) });
            knob.apply(&mut world, camera, &levels[0]);
            assert_eq!(limit(&world), Some(30.0), "{none} is no limit");
        }
    }
}
