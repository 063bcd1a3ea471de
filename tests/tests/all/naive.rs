//! Correctness of the baseline: its light against closed forms, and its use of the plugin's maps.

use bevy::math::{UVec2, Vec2, Vec3};
use bevy_frugal_gi::gi::{GiCounts, GiOutput, GiRefresh, inspect};
use frugal::stage::{Component, Stage};
use frugal_tests::naive_rsm::{self, NaiveRsm, Weights};
use frugal_tests::{gpu, meshes, set};
use frugal_trace::scene::CameraPose;

use crate::furnace;
use crate::gi::{corner, sun};

tests!(
    maps_project_their_own_texels,
    in_a_furnace_it_is_the_closed_form,
    on_two_plates_it_is_the_form_factor,
    the_light_of_several_lights_adds_up,
    its_cost_is_the_maps_only,
);

const MAPS: &str = "min,gi_vpl_count=64,rsm_resolution=128,resolution_scale=100%";

fn show(stage: &mut Stage, naive: NaiveRsm) {
    naive_rsm::show(stage, Some(NaiveRsm { alone: true, ..naive }), GiOutput::MapsOnly);
}

/// `inspect` reports the projections with which maps were rendered.
fn maps_project_their_own_texels() {
    let point = frugal_trace::light::Light::Point {
        position: Vec3::new(0.3, 1.5, 0.4),
        luminous_power: 1e4,
        range: 30.0,
        color: [1.0; 3],
    };
    let mut stage = corner(vec![sun(Vec3::new(0.2, -1.0, -0.3)), point]);
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    set::radiance(&mut stage);
    let texels = gpu::rsm_texels(&stage);
    let maps = inspect::gpu_state(stage.render_world()).maps;
    assert_eq!(maps.len(), 7);
    let mut lit_maps = 0;
    for map in maps {
        let mut lit = 0;
        for (index, pixel) in (0..map.resolution.pow(2))
            .map(|index| (index, UVec2::new(index % map.resolution, index / map.resolution)))
        {
            let texel = texels[(map.texel_offset + index) as usize];
            if texel.luminance() > 0.0 {
                lit += 1;
                let clip = map.clip_from_world * Vec3::from(texel.position).extend(1.0);
                let projected =
                    (Vec2::new(clip.x, -clip.y) / clip.w * 0.5 + 0.5) * map.resolution as f32;
                // Depths of 32 bits and positions of a few metres.
                assert!(
                    projected.distance(pixel.as_vec2() + 0.5) < 0.01,
                    "{:?}: {pixel} is at {projected}",
                    map.view
                );
            }
        }
        lit_maps += u32::from(lit > 0);
    }
    // There is no surface above the point light.
    assert_eq!(lit_maps, 6);
}

/// In a furnace the sum has a closed form, whichever texels are sampled around the light.
fn in_a_furnace_it_is_the_closed_form() {
    let mut stage =
        set::open(&set::scene("furnace"), set::radiance_options(96, 54, Component::Indirect));
    set::apply(&mut stage, MAPS);
    set::look(&mut stage, Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.0, 0.4, -2.0));
    let expected = furnace::ALBEDO
        * furnace::direct_radiance()
        * (meshes::stored_albedo(furnace::ALBEDO) / furnace::ALBEDO).powi(2);
    for weights in [Weights::Exact, Weights::Published] {
        show(&mut stage, NaiveRsm { radius: 1.0, weights, ..Default::default() });
        let (most, mean) = furnace::deviation(&set::radiance(&mut stage), expected);
        println!(
            "    {weights:?}: off by at most {:.2} %, {:.2} % in the mean",
            most * 100.0,
            mean * 100.0
        );
        assert!(most <= furnace::TOLERANCE, "{weights:?}: {most}");
    }
}

/// Form factor of a point of the wall z = −1.9, at least 0.3 m above the floor, and the floor [−2,
/// 2] × [−1.9, 2] at y = 0.
fn form_factor(x: f64, height: f64) -> f64 {
    // Form factor of a rectangle with a corner below the point, in a plane perpendicular to the
    // point's: Lambert's integral along its edges.
    let from_corner = |width: f64| {
        let far = height.hypot(3.9);
        ((width / height).atan() - height / far * (width / far).atan()) / std::f64::consts::TAU
    };
    from_corner(2.0 - x) + from_corner(2.0 + x)
}

fn on_two_plates_it_is_the_form_factor() {
    let lux = 10_000.0;
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    set::apply(&mut stage, MAPS);
    let pose = CameraPose::looking_at(Vec3::new(0.0, 1.2, 3.0), Vec3::new(0.0, 0.8, -2.0));
    let per_share =
        meshes::stored_albedo(0.5) / std::f64::consts::PI * meshes::stored_albedo(0.8) * lux;
    // Points of the wall at pixel centres.
    let half_height = (60.0_f32.to_radians() * 0.5).tan();
    let wall: Vec<(usize, f64)> = (0..48 * 27)
        .filter_map(|index| {
            let (x, y) = ((index % 48) as f32 + 0.5, (index / 48) as f32 + 0.5);
            let ahead = Vec3::new(
                (x / 24.0 - 1.0) * half_height * 48.0 / 27.0,
                (1.0 - y / 13.5) * half_height,
                -1.0,
            );
            let ray = pose.rotation * ahead;
            let hit = pose.position + ray * ((-1.9 - pose.position.z) / ray.z);
            let is_wall = hit.x.abs() < 1.9 && (0.3..1.9).contains(&hit.y);
            is_wall.then(|| (index, per_share * form_factor(f64::from(hit.x), f64::from(hit.y))))
        })
        .collect();
    assert!(wall.len() > 100);
    // The disk contains every texel from any point. No visible point of the wall is near enough for
    // the bound of the geometry term.
    let exact = NaiveRsm { radius: std::f32::consts::SQRT_2, ..Default::default() };
    for samples in [400, 4000] {
        show(&mut stage, NaiveRsm { samples, ..exact });
        let radiance = set::radiance(&mut stage);
        let expected = wall.iter().map(|(_, expected)| expected).sum::<f64>();
        let found = wall.iter().map(|(index, _)| f64::from(radiance.rgb[*index][1])).sum::<f64>();
        let off = wall
            .iter()
            .map(|(index, expected)| (f64::from(radiance.rgb[*index][1]) - expected).abs())
            .sum::<f64>();
        println!(
            "    {samples} samples: {:.3} of the form factor, off by {:.1} % in the mean",
            found / expected,
            100.0 * off / expected
        );
        // The map's texels of 4 cm match the floor's edges to within half a texel: a share of at
        // most 1 %. The rest is noise of the samples.
        assert!((found / expected - 1.0).abs() < 0.01, "{samples}: {}", found / expected);
        assert!(
            off / expected < 0.03 * (400.0 / f64::from(samples)).sqrt(),
            "{samples}: {}",
            off / expected
        );
    }
}

/// Light adds up over lights, with flat maps and cube maps.
fn the_light_of_several_lights_adds_up() {
    let point = frugal_trace::light::Light::Point {
        position: Vec3::new(0.3, 1.5, 0.4),
        luminous_power: 1e6,
        range: 30.0,
        color: [1.0; 3],
    };
    let mean = |lights: Vec<frugal_trace::light::Light>| {
        let mut stage = corner(lights);
        set::apply(&mut stage, MAPS);
        show(&mut stage, NaiveRsm { radius: 0.5, ..Default::default() });
        set::radiance(&mut stage).mean()
    };
    let (sun_alone, point_alone) = (mean(vec![sun(Vec3::NEG_Y)]), mean(vec![point.clone()]));
    let both = mean(vec![sun(Vec3::NEG_Y), point]);
    assert!(sun_alone > 1.0 && point_alone > 1.0, "{sun_alone} {point_alone}");
    // Half floats.
    assert!(
        (both / (sun_alone + point_alone) - 1.0).abs() < 2e-3,
        "{sun_alone} + {point_alone}, both {both}"
    );
}

fn its_cost_is_the_maps_only() {
    let mut stage = corner(vec![sun(Vec3::NEG_Y)]);
    let ours = set::radiance(&mut stage);
    show(&mut stage, NaiveRsm::default());
    let naive = set::radiance(&mut stage);
    assert!(naive.mean() > 1.0 && naive != ours);
    stage.world_mut().insert_resource(GiRefresh::EveryFrame);
    assert!(set::radiance(&mut stage) == naive, "maps that are not rendered again are kept");
    let GiCounts { maps, cameras, vpls, pairs, rays, .. } = set::gathered(&stage);
    assert_eq!((maps, cameras, vpls, pairs, rays), (1, 0, 0, 0, 0), "the plugin gathers nothing");
    let state = inspect::gpu_state(stage.render_world());
    assert!(state.texels.is_some() && state.maps.len() == 1 && state.cameras.is_empty());
    // And back.
    naive_rsm::show(&mut stage, None, GiOutput::IndirectOnly);
    assert!(set::radiance(&mut stage) == ours);
}
