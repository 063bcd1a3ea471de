//! Tests of the reconciliation of knobs in an app without a renderer.

use bevy::MinimalPlugins;
use bevy::anti_alias::fxaa::Fxaa;
use bevy::anti_alias::smaa::{Smaa, SmaaPreset};
use bevy::app::{App, Update};
use bevy::light::{
    CascadeShadowConfig, DirectionalLight, DirectionalLightShadowMap, PointLightShadowMap,
};
use bevy::pbr::{ScreenSpaceAmbientOcclusion, ScreenSpaceAmbientOcclusionQualityLevel as Quality};
use bevy::post_process::bloom::Bloom;
use bevy::render::camera::MipBias;

use super::*;
use crate::gi::FrugalGi;
use crate::knobs::{Knob, KnobDriver, KnobLevels, KnobPlugin, KnobSpace, Level, RegisterKnob};
use crate::resolution::ResolutionScale;

fn app() -> App {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, KnobPlugin))
        .init_resource::<DirectionalLightShadowMap>()
        .init_resource::<PointLightShadowMap>();
    app
}

/// Settings of the registered knobs called in `text`, as on the command line.
fn settings(app: &App, text: &str) -> KnobSettings {
    let names: Vec<&str> =
        text.split(',').filter_map(|part| Some(part.split_once('=')?.0)).collect();
    let all = app.world().resource::<KnobRegistry>().space().expect("a valid registry");
    let space = all.subset(names).expect("registered knobs");
    let settings = space.parse(text).expect("settings");
    KnobSettings { space: Arc::new(space), settings }
}

fn camera(app: &mut App, text: &str) -> Entity {
    let settings = settings(app, text);
    app.world_mut().spawn((Camera::default(), settings)).id()
}

fn vpl_count(app: &App, camera: Entity) -> u32 {
    app.world().get::<FrugalGi>(camera).expect("GI").vpl_count
}

fn cascades(app: &App, light: Entity) -> usize {
    app.world().get::<CascadeShadowConfig>(light).expect("cascades").bounds.len()
}

fn shadow_texels(app: &App) -> usize {
    app.world().resource::<DirectionalLightShadowMap>().size
}

fn set_active(app: &mut App, camera: Entity, is_active: bool) {
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = is_active;
}

#[test]
fn components_added_or_overwritten_later_get_their_level() {
    let mut app = app();
    let camera = camera(&mut app, "gi_vpl_count=512,texture_detail=+1");
    app.update();
    app.world_mut().entity_mut(camera).insert((FrugalGi::default(), MipBias(-1.0)));
    app.update();
    assert_eq!(vpl_count(&app, camera), 512, "GI after the settings");
    assert_eq!(app.world().get::<MipBias>(camera).map(|bias| bias.0), Some(1.0));
    app.world_mut().entity_mut(camera).insert(FrugalGi { vpl_count: 7, ..Default::default() });
    app.update();
    assert_eq!(vpl_count(&app, camera), 512, "overwritten");
    app.world_mut().get_mut::<FrugalGi>(camera).expect("GI").vpl_count = 9;
    app.update();
    assert_eq!(vpl_count(&app, camera), 512, "changed in place");
    app.world_mut().resource_mut::<DirectionalLightShadowMap>().size = 4096;
}

#[test]
fn lights_added_later_get_their_cascades() {
    let mut app = app();
    camera(&mut app, "shadow_cascades=1");
    app.update();
    let sun = app.world_mut().spawn(DirectionalLight::default()).id();
    app.update();
    assert_eq!(cascades(&app, sun), 1);
    app.world_mut().entity_mut(sun).insert(CascadeShadowConfig::default());
    app.update();
    assert_eq!(cascades(&app, sun), 1, "overwritten");
}

#[test]
fn a_camera_that_wakes_gets_what_it_missed() {
    let mut app = app();
    let camera = camera(&mut app, "gi_vpl_count=512");
    app.world_mut().entity_mut(camera).insert(FrugalGi::default());
    set_active(&mut app, camera, false);
    app.update();
    assert_eq!(vpl_count(&app, camera), FrugalGi::default().vpl_count, "inactive");
    set_active(&mut app, camera, true);
    app.update();
    assert_eq!(vpl_count(&app, camera), 512);
}

#[test]
fn a_camera_that_sleeps_asks_nothing_of_the_app() {
    let mut app = app();
    let cheap = camera(&mut app, "shadow_map_resolution=512");
    let dear = camera(&mut app, "shadow_map_resolution=1024");
    app.update();
    assert_eq!(shadow_texels(&app), 1024);
    let value = |app: &App, camera| {
        app.world()
            .get::<AppliedKnobs>(camera)
            .and_then(|applied| applied.value("shadow_map_resolution"))
    };
    assert_eq!(value(&app, cheap), Some(1024.0), "both cameras pay for the highest level");
    set_active(&mut app, dear, false);
    app.update();
    assert_eq!((shadow_texels(&app), value(&app, cheap)), (512, Some(512.0)));
    set_active(&mut app, cheap, false);
    app.update();
    assert_eq!(shadow_texels(&app), 2048, "nobody asks: the app's own");
    set_active(&mut app, dear, true);
    app.update();
    assert_eq!(shadow_texels(&app), 1024);
    app.world_mut().resource_mut::<DirectionalLightShadowMap>().size = 4096;
    app.update();
    assert_eq!(shadow_texels(&app), 1024, "overwritten");
    app.world_mut().despawn(dear);
    app.update();
    assert_eq!(shadow_texels(&app), 4096, "what the app wrote last");
}

#[test]
fn another_table_of_levels_is_applied_at_the_same_index() {
    let mut app = app();
    let camera = camera(&mut app, "gi_vpl_count=64");
    app.world_mut().entity_mut(camera).insert(FrugalGi::default());
    app.update();
    assert_eq!(vpl_count(&app, camera), 64);
    let space = KnobSpace::new(vec![Knob::new("gi_vpl_count", [0.0, 32.0])]).expect("a space");
    let settings = KnobLevels::default().with_level(0, 1);
    app.world_mut().entity_mut(camera).insert(KnobSettings { space: Arc::new(space), settings });
    app.update();
    assert_eq!(vpl_count(&app, camera), 32);
}

const EVERYTHING_LOW: &str = "gi_vpl_count=64,gi_pixel_fraction=1/16,gi_interleave=8x8,gi_visibility=none,gi_environment_samples=0,rsm_resolution=64,gi_refresh_period=8,shadow_map_resolution=256,shadow_cascades=1,ambient_occlusion=off,antialiasing=off,texture_detail=+2,post_processing=off,resolution_scale=50%";

#[test]
fn a_release_restores_what_was_authored() {
    let mut app = app();
    let gi = FrugalGi { vpl_count: 300, range: 12.0, ..Default::default() };
    let occlusion = ScreenSpaceAmbientOcclusion {
        quality_level: Quality::Medium,
        constant_object_thickness: 2.5,
    };
    let camera = camera(&mut app, EVERYTHING_LOW);
    app.world_mut().entity_mut(camera).insert((
        gi.clone(),
        occlusion.clone(),
        Smaa { preset: SmaaPreset::Medium },
        Bloom { intensity: 0.7, max_mip_dimension: 99, ..Bloom::NATURAL },
    ));
    let sun = app.world_mut().spawn(DirectionalLight::default()).id();
    let authored_cascades = cascades(&app, sun);
    app.update();
    let world = app.world();
    assert_ne!(world.get::<FrugalGi>(camera), Some(&gi));
    assert!(!world.entity(camera).contains::<Bloom>() && !world.entity(camera).contains::<Smaa>());
    assert!(!world.entity(camera).contains::<ScreenSpaceAmbientOcclusion>());
    assert_eq!(world.get::<ResolutionScale>(camera), Some(&ResolutionScale(0.5)));
    assert_eq!((shadow_texels(&app), cascades(&app, sun)), (256, 1));
    // Every level between, so that nothing depends on the last one alone.
    let high = EVERYTHING_LOW
        .replace("ambient_occlusion=off", "ambient_occlusion=8")
        .replace("post_processing=off", "post_processing=low")
        .replace("antialiasing=off", "antialiasing=FXAA");
    let high = settings(&app, &high);
    app.world_mut().entity_mut(camera).insert(high);
    app.update();
    let world = app.world();
    let thickness = |world: &World| {
        world
            .get::<ScreenSpaceAmbientOcclusion>(camera)
            .map(|occlusion| occlusion.constant_object_thickness)
    };
    assert_eq!(thickness(world), Some(2.5));
    assert!(world.entity(camera).contains::<Fxaa>() && !world.entity(camera).contains::<Smaa>());
    let bloom = world.get::<Bloom>(camera).expect("bloom");
    assert!(bloom.intensity == 0.7 && bloom.max_mip_dimension != 99);
    // A field that no knob controls is the app's at any time.
    app.world_mut().get_mut::<Bloom>(camera).expect("bloom").intensity = 0.3;
    app.update();

    app.world_mut().entity_mut(camera).remove::<KnobSettings>();
    app.update();
    let world = app.world();
    assert_eq!(world.get::<FrugalGi>(camera), Some(&gi));
    assert_eq!(world.get::<ScreenSpaceAmbientOcclusion>(camera), Some(&occlusion));
    assert!(world.get::<Smaa>(camera).is_some_and(|smaa| smaa.preset == SmaaPreset::Medium));
    assert!(!world.entity(camera).contains::<Fxaa>());
    let bloom = world.get::<Bloom>(camera).expect("bloom");
    assert_eq!((bloom.intensity, bloom.max_mip_dimension), (0.3, 99));
    assert!(!world.entity(camera).contains::<MipBias>());
    assert!(!world.entity(camera).contains::<ResolutionScale>());
    assert!(!world.entity(camera).contains::<AppliedKnobs>());
    assert_eq!((shadow_texels(&app), cascades(&app, sun)), (2048, authored_cascades));
    assert_eq!(world.resource::<PointLightShadowMap>().size, PointLightShadowMap::default().size);
}

#[test]
fn knobs_that_leave_the_space_are_released() {
    let mut app = app();
    let camera = camera(&mut app, "gi_vpl_count=64,rsm_resolution=64");
    app.world_mut().entity_mut(camera).insert(FrugalGi::default());
    app.update();
    let fewer = settings(&app, "rsm_resolution=64");
    app.world_mut().entity_mut(camera).insert(fewer);
    app.update();
    let gi = app.world().get::<FrugalGi>(camera).expect("GI");
    assert_eq!((gi.vpl_count, gi.rsm_resolution), (FrugalGi::default().vpl_count, 64));
}

#[test]
fn nothing_is_added_that_nobody_authored() {
    let mut app = app();
    let best = "ambient_occlusion=32,antialiasing=SMAA 32,post_processing=high";
    let camera = camera(&mut app, best);
    app.update();
    let bare = app.world().entity(camera);
    assert!(!bare.contains::<Bloom>() && !bare.contains::<ScreenSpaceAmbientOcclusion>());
    assert!(!bare.contains::<Smaa>() && !bare.contains::<Fxaa>());
    // The app adds one later: now the level counts.
    app.world_mut().entity_mut(camera).insert((Fxaa::default(), Bloom::NATURAL));
    app.update();
    let camera_ref = app.world().entity(camera);
    assert!(camera_ref.get::<Smaa>().is_some_and(|smaa| smaa.preset == SmaaPreset::Ultra));
    assert!(!camera_ref.contains::<Fxaa>() && camera_ref.contains::<Bloom>());
    // And takes it away again.
    app.world_mut().entity_mut(camera).remove::<Bloom>();
    app.update();
    let off = settings(&app, &best.replace("=high", "=low"));
    app.world_mut().entity_mut(camera).insert(off);
    app.update();
    assert!(!app.world().entity(camera).contains::<Bloom>());
}

#[test]
fn nothing_is_written_while_nothing_differs() {
    #[derive(Resource, Default)]
    struct Changes(usize);
    let mut app = app();
    app.init_resource::<Changes>().add_systems(
        Update,
        |gi: Query<(), Changed<FrugalGi>>,
         cascades: Query<(), Changed<CascadeShadowConfig>>,
         maps: Res<DirectionalLightShadowMap>,
         applied: Query<(), Changed<AppliedKnobs>>,
         mut changes: ResMut<Changes>| {
            changes.0 += gi.iter().count() + cascades.iter().count() + applied.iter().count();
            changes.0 += usize::from(maps.is_changed());
        },
    );
    let camera = camera(&mut app, EVERYTHING_LOW);
    app.world_mut().entity_mut(camera).insert((FrugalGi::default(), Bloom::NATURAL));
    app.world_mut().spawn(DirectionalLight::default());
    (0..3).for_each(|_| app.update());
    app.world_mut().resource_mut::<Changes>().0 = 0;
    (0..5).for_each(|_| app.update());
    assert_eq!(app.world().resource::<Changes>().0, 0);
}

/// Counts its calls.
struct Counting;

#[derive(Resource, Default, Debug, PartialEq)]
struct Calls(Vec<f64>, usize);

impl KnobDriver for Counting {
    fn knob(&self) -> Knob {
        Knob::new("counting", [1.0, 2.0])
    }

    fn apply(&self, world: &mut World, _: Entity, level: &Level) {
        world.get_resource_or_init::<Calls>().0.push(level.value);
    }

    fn release(&self, world: &mut World, _: Entity) {
        world.get_resource_or_init::<Calls>().1 += 1;
    }
}

#[test]
fn drivers_are_called_once_a_change_and_again_when_replaced() {
    let mut app = app();
    app.register_knob(Counting);
    let camera = camera(&mut app, "counting=2");
    (0..3).for_each(|_| app.update());
    assert_eq!(*app.world().resource::<Calls>(), Calls(vec![2.0], 0));
    app.register_knob(Counting);
    (0..3).for_each(|_| app.update());
    assert_eq!(*app.world().resource::<Calls>(), Calls(vec![2.0, 2.0], 0));
    app.world_mut().entity_mut(camera).remove::<KnobSettings>();
    (0..3).for_each(|_| app.update());
    assert_eq!(*app.world().resource::<Calls>(), Calls(vec![2.0, 2.0], 1));
    // Settings of a knob that the app lacks are ignored.
    let unknown = KnobSpace::new(vec![Knob::new("unknown", [1.0])]).expect("a space");
    let none = KnobSettings { space: Arc::new(unknown), settings: KnobLevels::default() };
    app.world_mut().entity_mut(camera).insert(none);
    app.update();
    assert_eq!(app.world().get::<AppliedKnobs>(camera).and_then(|a| a.value("unknown")), None);
    app.world_mut().despawn(camera);
    app.update();
}

/// A knob of any name.
struct Named(&'static str);

impl KnobDriver for Named {
    fn knob(&self) -> Knob {
        Knob::new(self.0, [0.0, 1.0])
    }

    fn apply(&self, _: &mut World, _: Entity, _: &Level) {}
}

#[test]
fn more_knobs_than_settings_pack_are_one_clear_error_and_all_are_known() {
    let mut app = app();
    app.register_knob(Named("one"));
    let space = |app: &App| app.world().resource::<KnobRegistry>().space();
    assert_eq!(space(&app).map(|space| space.len()).ok(), Some(17), "more than 64 bits");
    for number in 4..20 {
        app.register_knob(Named(format!("knob_{number}").leak()));
    }
    app.finish();
    let error = space(&app).expect_err("33 knobs").to_string();
    assert!(error.contains("33 knobs") && error.contains("leave some out"), "{error}");
    let known = |app: &App| app.world().resource::<KnobRegistry>().clone();
    assert_eq!(known(&app).names().count(), 35, "the opt-in ones included");
    // A map with some of them is accepted, and one with an unknown knob is not.
    let space = |names: &[&str]| {
        KnobSpace::new(names.iter().map(|name| Knob::new(name, [0.0])).collect()).expect("a space")
    };
    assert_eq!(known(&app).first_unknown(&space(&["one", "gi_vpl_count"])), None);
    assert_eq!(known(&app).first_unknown(&space(&["one", "four"])), Some("four"));
    app.register_knob(Named("four"));
    app.update();
    assert_eq!(known(&app).first_unknown(&space(&["one", "four"])), None, "registered late");
}
