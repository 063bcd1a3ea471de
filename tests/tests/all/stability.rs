//! Nothing flickers where nothing moves, and nothing of the past is in the picture.

use bevy::math::Vec3;
use bevy_frugal_gi::gi::GiRefresh;
use frugal::scene::CameraPose;
use frugal::stage::{Component, Stage};
use frugal_tests::set;

tests!(a_still_scene_is_still_for_120_frames, a_cut_leaves_no_trace);

/// Everything that could remember something.
const RICH: &str = "max,rsm_resolution=128,gi_vpl_count=512,shadow_map_resolution=512";

fn a_still_scene_is_still_for_120_frames() {
    // Gathered at every pixel with many rays, and at few, upsampled; done again in every frame, and only composited.
    for (more, policy) in [
        ("", GiRefresh::EveryFrame),
        ("", GiRefresh::OnChange),
        (",gi_pixel_fraction=1/16,gi_interleave=8x8,gi_visibility=coarse", GiRefresh::EveryFrame),
    ] {
        let mut stage = set::open(&set::scene("courtyard"), set::options(48, 27));
        set::look(&mut stage, Vec3::new(4.9, 2.0, 2.2), Vec3::new(-4.0, 1.8, -3.4));
        set::apply(&mut stage, &format!("{RICH}{more}"));
        stage.world_mut().insert_resource(policy);
        stage.get_ready().expect("a ready stage");
        let first = stage.picture().expect("a picture");
        assert!(first.rgb.iter().any(|pixel| *pixel != first.rgb[0]), "there is something to see");
        for frame in 1..120 {
            stage.frame();
            assert!(stage.picture().expect("a picture") == first, "frame {frame} differs from the first");
        }
    }
}

fn look(stage: &mut Stage, pose: CameraPose) {
    stage.place(pose.position, pose.rotation);
}

fn a_cut_leaves_no_trace() {
    for (name, from, to) in [
        // From the court to the gallery.
        ("courtyard", (Vec3::new(4.9, 2.0, 2.2), Vec3::new(-4.0, 1.8, -3.4)), (Vec3::new(-7.2, 1.5, -1.4), Vec3::new(-6.2, 1.5, -6.6))),
        // From the lit room to the dark one.
        ("two_rooms", (Vec3::new(-0.8, 1.7, 2.0), Vec3::new(-3.2, 1.0, -1.6)), (Vec3::new(1.5, 1.5, -0.4), Vec3::new(0.0, 1.4, 0.4))),
    ] {
        let [from, to] = [from, to].map(|(position, target)| CameraPose::looking_at(position, target));
        let ready = |pose| {
            let mut stage = set::open(&set::scene(name), set::radiance_options(48, 27, Component::Full));
            set::apply(&mut stage, RICH);
            look(&mut stage, pose);
            stage.get_ready().expect("a ready stage");
            stage
        };
        let always_there = ready(to).radiance().expect("radiance");
        let mut stage = ready(from);
        let before = stage.radiance().expect("radiance");
        look(&mut stage, to);
        stage.frame();
        let after = stage.radiance().expect("radiance");
        assert!(before != always_there, "{name}: the views differ");
        let worst = after.rgb.iter().flatten().zip(always_there.rgb.iter().flatten());
        let worst = worst.map(|(a, b)| (a - b).abs() / b.abs().max(1e-3)).fold(0.0, f32::max);
        assert!(after == always_there, "{name}: off by up to {worst} of what is right in the first frame after the cut");
    }
}
