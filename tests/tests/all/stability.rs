//! Still scenes do not flicker, and converged images do not depend on history.

use bevy::ecs::query::With;
use bevy::light::{DirectionalLight, PointLight, ShadowFilteringMethod};
use bevy::math::{Quat, Vec3};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::GiRefresh;
use frugal::stage::{Component, Stage, StageOptions};
use frugal_tests::set;
use frugal_trace::metrics::Radiance;
use frugal_trace::scene::CameraPose;

tests!(
    a_still_scene_is_still_for_120_frames,
    a_cut_discards_history,
    history_reduces_flicker_and_leaves_no_trace_at_rest,
    history_outlives_a_switch_of_settings,
    a_camera_at_rest_converges_and_then_gathers_nothing,
    where_a_camera_comes_from_hardly_matters_at_rest,
    what_came_into_view_has_a_history_of_its_own,
    a_clip_costs_the_same_whatever_was_rendered_before
);

/// A place in the court of `courtyard`, and one across from it.
const IN_COURT: Vec3 = Vec3::new(4.9, 2.0, 2.2);
const ACROSS_COURT: Vec3 = Vec3::new(-4.0, 1.8, -3.4);

/// Settings with every effect that keeps history.
const RICH: &str = "max,rsm_resolution=128,gi_vpl_count=512,shadow_map_resolution=512";

fn a_still_scene_is_still_for_120_frames() {
    // At full resolution with many rays, and at low resolution, upsampled; recomputed in every
    // frame, and only composited.
    for (more, policy) in [
        ("", GiRefresh::EveryFrame),
        ("", GiRefresh::OnChange),
        (",gi_pixel_fraction=1/16,gi_interleave=8x8,gi_visibility=coarse", GiRefresh::EveryFrame),
    ] {
        let mut stage = set::open(&set::scene("courtyard"), set::options(48, 27));
        set::look(&mut stage, IN_COURT, ACROSS_COURT);
        set::apply(&mut stage, &format!("{RICH}{more}"));
        stage.world_mut().insert_resource(policy);
        stage.get_ready().expect("a ready stage");
        let first = stage.picture().expect("an image");
        assert!(first.rgb.iter().any(|pixel| *pixel != first.rgb[0]), "the image is not uniform");
        for frame in 1..120 {
            stage.frame();
            assert!(
                stage.picture().expect("an image") == first,
                "frame {frame} differs from the first"
            );
        }
    }
}

fn look(stage: &mut Stage, pose: CameraPose) {
    stage.place(pose.position, pose.rotation);
}

fn a_cut_discards_history() {
    for (name, from, to) in [
        // From the court to the gallery.
        (
            "courtyard",
            (IN_COURT, ACROSS_COURT),
            (Vec3::new(-7.2, 1.5, -1.4), Vec3::new(-6.2, 1.5, -6.6)),
        ),
        // From the lit room to the dark one.
        (
            "two_rooms",
            (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6)),
            (Vec3::new(1.5, 1.5, -0.4), Vec3::new(0.0, 1.4, 0.4)),
        ),
    ] {
        let [from, to] =
            [from, to].map(|(position, target)| CameraPose::looking_at(position, target));
        let ready = |pose| {
            let mut stage =
                set::open(&set::scene(name), set::radiance_options(48, 27, Component::Full));
            set::apply(&mut stage, RICH);
            look(&mut stage, pose);
            stage.get_ready().expect("a ready stage");
            stage
        };
        let expected = ready(to).radiance().expect("radiance");
        let mut stage = ready(from);
        let before = stage.radiance().expect("radiance");
        look(&mut stage, to);
        stage.frame();
        let after = stage.radiance().expect("radiance");
        assert!(before != expected, "{name}: the views differ");
        let worst = after.rgb.iter().flatten().zip(expected.rgb.iter().flatten());
        let worst = worst.map(|(a, b)| (a - b).abs() / b.abs().max(1e-3)).fold(0.0, f32::max);
        assert!(
            after == expected,
            "{name}: a relative error of up to {worst} in the first frame after the cut"
        );
    }
}

fn turn_the_sun(stage: &mut Stage) {
    let world = stage.world_mut();
    let mut suns = world.query_filtered::<&mut Transform, With<DirectionalLight>>();
    for mut transform in suns.iter_mut(world) {
        transform.rotate(Quat::from_rotation_y(0.1f32.to_radians()));
    }
}

fn history_reduces_flicker_and_leaves_no_trace_at_rest() {
    let shown = |frames: u32| -> (f64, Radiance) {
        let mut stage =
            set::open(&set::scene("courtyard"), set::radiance_options(64, 36, Component::Indirect));
        set::look(&mut stage, IN_COURT, ACROSS_COURT);
        set::apply(&mut stage, "max,rsm_resolution=128,gi_vpl_count=512,gi_visibility=coarse");
        stage.world_mut().insert_resource(GiRefresh::OnChange);
        set::gi(&mut stage).history_frames = frames;
        let mut last = set::radiance(&mut stage);
        let mut change = 0.0;
        for frame in 0..24 {
            turn_the_sun(&mut stage);
            stage.frame();
            let next = stage.radiance().expect("radiance");
            let differences = next
                .rgb
                .iter()
                .flatten()
                .zip(last.rgb.iter().flatten())
                .map(|(a, b)| f64::from((a - b).abs()));
            // Measured once there is history.
            change += if frame < 8 {
                0.0
            } else {
                differences.sum::<f64>() / next.rgb.len() as f64 / 3.0 / next.mean()
            };
            last = next;
        }
        assert!(frames == 1 || set::gathered(&stage).settling == 1);
        for _ in 0..frames + 4 {
            stage.frame();
        }
        let done = set::gathered(&stage);
        assert_eq!((done.cameras, done.settling), (0, 0), "converged");
        (change / 16.0, stage.radiance().expect("radiance"))
    };
    let [(without, fresh), (with, rested)] = [1, 16].map(shown);
    println!(
        "    from frame to frame {:.2} % of the light changes without history, {:.2} % with it",
        100.0 * without,
        100.0 * with
    );
    assert!(with < 0.34 * without, "{with} {without}");
    assert!(rested == fresh, "a still image does not depend on history");
}

/// Mean absolute difference of two images relative to the mean of the second.
fn change(last: &Radiance, next: &Radiance) -> f64 {
    let differences = next
        .rgb
        .iter()
        .flatten()
        .zip(last.rgb.iter().flatten())
        .map(|(a, b)| f64::from((a - b).abs()));
    differences.sum::<f64>() / next.rgb.len() as f64 / 3.0 / next.mean()
}

fn history_outlives_a_switch_of_settings() {
    let settings = |vpls: u32, interleave: &str, fraction: &str| {
        let rest = "max,rsm_resolution=128,gi_visibility=coarse";
        format!(
            "{rest},gi_vpl_count={vpls},gi_interleave={interleave},gi_pixel_fraction={fraction}"
        )
    };
    // Other VPLs, and other resolutions, to which the history is reprojected, and the largest share of
    // the light that may change. A coarser resolution loses detail of a finer one.
    for (vpls, interleave, fraction, most) in [
        (256, "2x2", "1/4", 0.08),
        (512, "8x8", "1/4", 0.12),
        (512, "2x2", "1/16", 0.25),
        (512, "2x2", "1/2", 0.13),
    ] {
        let (from, to) = (settings(512, "2x2", "1/4"), settings(vpls, interleave, fraction));
        let shown = |cuts: bool| -> (f64, Radiance) {
            let mut stage = set::open(
                &set::scene("courtyard"),
                set::radiance_options(64, 36, Component::Indirect),
            );
            set::look(&mut stage, IN_COURT, ACROSS_COURT);
            stage.world_mut().insert_resource(GiRefresh::OnChange);
            set::apply(&mut stage, &from);
            let mut last = set::radiance(&mut stage);
            for _ in 0..12 {
                turn_the_sun(&mut stage);
                stage.frame();
                last = stage.radiance().expect("radiance");
            }
            if cuts {
                set::apply(&mut stage, &to);
            } else {
                set::switch(&mut stage, &to);
            }
            turn_the_sun(&mut stage);
            stage.frame();
            let step = change(&last, &stage.radiance().expect("radiance"));
            (step, set::radiance(&mut stage))
        };
        let [(dropped, fresh), (kept, rested)] = [true, false].map(shown);
        println!(
            "    {to}: {:.1} % of the light changes at the switch, {:.1} % without history",
            100.0 * kept,
            100.0 * dropped
        );
        assert!(kept < f64::min(most, dropped), "{to}: {kept} {dropped}");
        assert!(rested == fresh, "{to}: a still image does not depend on history");
    }
}

/// The court of `courtyard`, whose camera gathers for `rest_frames` frames at rest.
fn court(rest_frames: u32) -> Stage {
    let mut stage =
        set::open(&set::scene("courtyard"), set::radiance_options(48, 27, Component::Indirect));
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    set::look(&mut stage, IN_COURT, ACROSS_COURT);
    set::gi(&mut stage).rest_frames = rest_frames;
    stage
}

/// Renders until nothing is gathered any more.
fn rest(stage: &mut Stage) -> Radiance {
    for _ in 0..600 {
        stage.frame();
        let done = set::gathered(stage);
        if (done.cameras, done.settling) == (0, 0) {
            return stage.radiance().expect("radiance");
        }
    }
    panic!("the camera never rests: {:?}", set::gathered(stage));
}

fn a_camera_at_rest_converges_and_then_gathers_nothing() {
    let mut stage = court(64);
    set::apply(&mut stage, "max,rsm_resolution=128,gi_interleave=2x2");
    let best = rest(&mut stage);
    let middle = "gi_vpl_count=1024,gi_interleave=4x4,gi_visibility=coarse";
    set::apply(&mut stage, &format!("max,rsm_resolution=128,{middle}"));
    // Pipelines are compiled.
    (0..6).for_each(|_| stage.frame());
    set::cut(&mut stage);
    // The same samples as in motion, and then others.
    let mut frame = 0;
    let errors = [1, 8, 64].map(|until| {
        (frame..until).for_each(|_| stage.frame());
        frame = until;
        change(&stage.radiance().expect("radiance"), &best)
    });
    println!("    L1 {errors:.4?} after 1, 8 and 64 frames");
    assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.35 * errors[0], "{errors:?}");
    let settled = rest(&mut stage);
    for _ in 0..20 {
        stage.frame();
        assert!(stage.radiance().expect("radiance") == settled, "it changes at rest");
        let done = set::gathered(&stage);
        assert_eq!((done.cameras, done.maps, done.pairs, done.vpls), (0, 0, 0, 0));
    }
}

fn where_a_camera_comes_from_hardly_matters_at_rest() {
    let mut stage = court(64);
    let settings = "max,rsm_resolution=128,gi_vpl_count=1024,gi_visibility=coarse";
    set::apply(&mut stage, settings);
    let cut = rest(&mut stage);
    let mut differences = Vec::new();
    for from in [Vec3::new(4.9, 2.0, 3.2), Vec3::new(3.9, 1.6, 2.2)] {
        for frame in 0..=20u8 {
            let position = from.lerp(IN_COURT, f32::from(frame) / 20.0);
            set::look(&mut stage, position, ACROSS_COURT);
            stage.frame();
        }
        differences.push(change(&rest(&mut stage), &cut));
    }
    println!("    at rest two walks differ from a cut by {differences:.5?} of the light");
    assert!(differences.iter().all(|difference| *difference < 1e-3), "{differences:?}");
}

/// Sum of the radiance of columns `from..to`.
fn columns(image: &Radiance, from: usize, to: usize) -> f64 {
    let pixels = image.rgb.iter().enumerate();
    let inside = pixels.filter(|(index, _)| (from..to).contains(&(index % image.width as usize)));
    inside.map(|(_, rgb)| rgb.iter().map(|v| f64::from(*v)).sum::<f64>()).sum()
}

fn what_came_into_view_has_a_history_of_its_own() {
    /// The brightness that all light falls to, which is no reason to reject history.
    const DIMMED: f32 = 0.6;
    /// Frames after that.
    const FRAMES: u8 = 4;
    let mut stage =
        set::open(&set::scene("courtyard"), set::radiance_options(96, 54, Component::Indirect));
    stage.world_mut().insert_resource(GiRefresh::OnChange);
    let turn = |stage: &mut Stage, degrees: f32| {
        let rotation = Quat::from_rotation_y(degrees.to_radians());
        look(stage, CameraPose { position: Vec3::new(3.0, 1.8, 1.0), rotation });
    };
    // The camera turns to the left: hardly, but it does not rest; then by a fifth of the image; then
    // hardly again.
    turn(&mut stage, 90.0);
    set::apply(&mut stage, "max,rsm_resolution=128,gi_vpl_count=512,gi_visibility=coarse");
    for frame in 0..40u8 {
        turn(&mut stage, 90.0 + 1e-3 * f32::from(frame));
        stage.frame();
    }
    turn(&mut stage, 110.0);
    stage.frame();
    let bright = stage.radiance().expect("radiance");
    let world = stage.world_mut();
    for mut sun in world.query::<&mut DirectionalLight>().iter_mut(world) {
        sun.illuminance *= DIMMED;
    }
    for mut light in world.query::<&mut PointLight>().iter_mut(world) {
        light.intensity *= DIMMED;
    }
    for frame in 1..=FRAMES {
        turn(&mut stage, 110.0 + 1e-3 * f32::from(frame));
        stage.frame();
    }
    let dimmed = stage.radiance().expect("radiance");
    let kept = |from, to| columns(&dimmed, from, to) / columns(&bright, from, to);
    let (new, old) = (kept(2, 14), kept(40, 96));
    println!("    {new:.3} of the light is left where it is new in view, {old:.3} elsewhere");
    // A mean of one bright frame and four dimmed ones; elsewhere of 32 frames, but for edges.
    let mean = (1.0 + f64::from(FRAMES) * f64::from(DIMMED)) / f64::from(FRAMES + 1);
    assert!((new - mean).abs() < 0.04, "{new} {mean}");
    assert!((0.88..0.97).contains(&old), "{old}");
}

fn a_clip_costs_the_same_whatever_was_rendered_before() {
    let clip = |x: f32| {
        [0.0, 0.03]
            .map(|step| {
                CameraPose::looking_at(Vec3::new(x + step, 1.0, 2.2), Vec3::new(x + step, 1.0, 0.0))
            })
            .to_vec()
    };
    let mut stage = set::open(
        &set::scene("cornell"),
        StageOptions { meter: Some("none".into()), ..set::options(64, 36) },
    );
    // An effect of Bevy that draws random numbers by the frame's number.
    let camera = set::camera(&mut stage);
    stage.world_mut().entity_mut(camera).insert(ShadowFilteringMethod::Temporal);
    stage.warm().expect("a ready stage");
    let space = stage.space().clone();
    let levels = |drop: &dyn Fn(usize) -> bool| {
        let best = space.highest();
        (0..space.len()).fold(best, |settings, knob| {
            if drop(knob) { settings.with_level(knob, settings.level(knob) - 1) } else { settings }
        })
    };
    let (best, lowest, middle) = (space.highest(), space.lowest(), levels(&|_| true));
    let mut costs = Vec::new();
    for before in
        [lowest, best, middle, levels(&|knob| knob % 2 == 0), levels(&|knob| knob % 2 == 1)]
    {
        stage.measure(&clip(0.5), before).expect("a measurement");
        assert_eq!(
            stage.measure(&clip(0.1), best).expect("a measurement").error,
            0.0,
            "the best settings, rendered twice"
        );
        costs.push(stage.measure(&clip(0.1), middle).expect("a measurement"));
    }
    assert!(costs[0].error > 0.0 && costs.iter().all(|cost| *cost == costs[0]), "{costs:?}");
}
