//! Further bounces at the limits: without light or rays, at extreme scenes, and as a knob.

use bevy::asset::RenderAssetUsages;
use bevy::color::{Color, LinearRgba};
use bevy::light::DirectionalLight;
use bevy::math::Vec3;
use bevy::mesh::Mesh;
use bevy::pbr::StandardMaterial;
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::FrugalGi;
use bevy_frugal_gi::gi::inspect::GiPatches;
use bevy_frugal_gi::knobs::KnobRegistry;
use frugal::stage::{Component, Stage};
use frugal_tests::{meshes, set};
use frugal_trace::light::Light;

use super::super::gi::{assert_costs_nothing, corner, sun};
use super::{RAYS, patches, with_bounces};

tests!(
    without_light_or_rays_patches_cost_nothing,
    extreme_light_stays_finite,
    invalid_albedos_stay_finite,
    invalid_triangles_and_ranges_change_no_other_light,
    far_from_the_origin_light_is_finite,
    the_knob_of_bounces_is_opt_in,
);

fn without_light_or_rays_patches_cost_nothing() {
    let mut stage = corner(vec![]);
    set::apply(&mut stage, RAYS);
    set::radiance(with_bounces(&mut stage, 3));
    assert_costs_nothing(&mut stage);
    let light = stage
        .world_mut()
        .spawn((
            DirectionalLight::default(),
            Transform::from_xyz(0.5, 1.0, 0.5).looking_at(Vec3::ZERO, Vec3::Y),
        ))
        .id();
    set::radiance(&mut stage);
    let bytes = |stage: &Stage| set::gathered(stage).bytes;
    let with = bytes(&stage);
    with_bounces(&mut stage, 1);
    set::radiance(&mut stage);
    let without = bytes(&stage);
    // Patches, their light, texels and VPLs, and 1,024 bounce VPLs.
    println!("    {} bytes", with - without);
    assert!(with > without + 2 * 2048 * 32 && with < without + 400_000, "{with} {without}");
    assert_eq!(stage.world_mut().resource::<GiPatches>().patch_count(), 0);
    with_bounces(&mut stage, 3);
    set::gi_without_knobs(&mut stage).visibility = bevy_frugal_gi::gi::GiVisibility::None;
    set::radiance(&mut stage);
    assert_eq!(stage.world_mut().resource::<GiPatches>().patch_count(), 0);
    stage.world_mut().despawn(light);
    set::radiance(&mut stage);
    assert_costs_nothing(&mut stage);
}

/// Mean radiance with all bounces. Asserts that no pixel and no patch has light that is negative or
/// not finite.
fn finite(stage: &mut Stage, label: &str) -> f64 {
    let radiance = set::radiance(with_bounces(stage, FrugalGi::ALL_BOUNCES));
    let is_light = |value: &f32| value.is_finite() && *value >= 0.0;
    assert!(radiance.rgb.iter().flatten().all(is_light), "{label}");
    for patch in patches(stage) {
        assert!(patch.flux.iter().all(is_light), "{label}: {patch:?}");
    }
    radiance.mean()
}

/// A corner in the sun.
fn sunlit_corner() -> Stage {
    let mut stage = corner(vec![sun(Vec3::new(-0.3, -1.0, -0.2))]);
    set::apply(&mut stage, RAYS);
    stage
}

fn extreme_light_stays_finite() {
    for illuminance in [1e-20, 1e20] {
        let mut stage = corner(vec![Light::Directional {
            direction: Vec3::new(-0.3, -1.0, -0.2),
            illuminance,
            color: [1.0; 3],
        }]);
        set::apply(&mut stage, RAYS);
        finite(&mut stage, "flux");
    }
}

fn invalid_albedos_stay_finite() {
    for albedo in [0.0, 1e20, -1.0, f32::NAN] {
        let mut stage = sunlit_corner();
        let color = Color::LinearRgba(LinearRgba::rgb(albedo, albedo, albedo));
        meshes::spawn_box(
            &mut stage,
            Vec3::new(0.5, 0.5, 0.0),
            Vec3::splat(0.4),
            StandardMaterial { base_color: color, ..meshes::diffuse(0.5, 0.5, 0.5) },
        );
        finite(&mut stage, "albedo");
    }
}

/// Degenerate triangles, vertices that are not finite or far away, and ranges out of range.
fn invalid_triangles_and_ranges_change_no_other_light() {
    let mut stage = sunlit_corner();
    let expected = finite(&mut stage, "a corner");
    for vertex in [0.0f32, f32::NAN, 1e30] {
        let mesh = Mesh::new(bevy::mesh::PrimitiveTopology::TriangleList, RenderAssetUsages::all())
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_POSITION,
                vec![[0.0f32; 3], [0.0; 3], [vertex; 3]],
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0f32; 3]; 3]);
        let id = meshes::spawn(
            &mut stage,
            mesh,
            meshes::diffuse(0.5, 0.5, 0.5),
            Transform::from_xyz(0.0, 0.5, 0.0),
        );
        let found = finite(&mut stage, "triangles");
        // A finite vertex that is far away makes the scene so large that its maps resolve none of
        // it.
        assert!(
            vertex == 1e30 || (found / expected - 1.0).abs() < 0.1,
            "{vertex}: {found} {expected}"
        );
        assert!(stage.world_mut().despawn(id));
    }
    for range in [0.0, f32::INFINITY, f32::NAN] {
        set::gi(&mut stage).range = range;
        finite(&mut stage, "range");
    }
}

/// At 1,000 km from the origin, where the spacing of floats is 1/16 m.
fn far_from_the_origin_light_is_finite() {
    let mut stage = set::bare(
        vec![sun(Vec3::new(-0.3, -1.0, -0.2))],
        set::radiance_options(48, 27, Component::Indirect),
    );
    let far = Vec3::new(1e6, 0.0, 1e6);
    meshes::spawn_box(
        &mut stage,
        far + Vec3::new(0.0, -1.0, 0.0),
        Vec3::new(40.0, 2.0, 40.0),
        meshes::diffuse(0.8, 0.8, 0.8),
    );
    meshes::spawn_box(
        &mut stage,
        far + Vec3::new(0.0, 10.0, -20.0),
        Vec3::new(40.0, 20.0, 2.0),
        meshes::diffuse(0.5, 0.5, 0.5),
    );
    set::look(&mut stage, far + Vec3::new(0.0, 12.0, 30.0), far + Vec3::new(0.0, 8.0, -20.0));
    set::apply(&mut stage, RAYS);
    let light = finite(&mut stage, "far away");
    assert!(light > 1.0, "{light}");
}

fn the_knob_of_bounces_is_opt_in() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let registry = stage.world_mut().resource::<KnobRegistry>().clone();
    assert!(
        stage.space().index_of("gi_bounces").is_none()
            && registry.space().expect("valid").index_of("gi_bounces").is_none()
    );
    assert!(registry.space_with(|_| true).expect("valid").index_of("gi_bounces").is_some());
    set::apply(&mut stage, "max");
    stage.frame();
    assert_eq!(set::gi(&mut stage).bounces, 1);
    let once = set::radiance(&mut stage);
    set::apply(&mut stage, "max,gi_bounces=3");
    stage.frame();
    assert_eq!(set::gi(&mut stage).bounces, 3);
    assert!(set::radiance(&mut stage).mean() > once.mean());
    set::apply(&mut stage, "max,gi_bounces=all");
    stage.frame();
    assert_eq!(set::gi(&mut stage).bounces, FrugalGi::ALL_BOUNCES);
    assert!(
        stage.apply_text("max,gi_bounces=9").is_err()
            && stage.apply_text("max,gi_bounce=2").is_err()
    );
}
