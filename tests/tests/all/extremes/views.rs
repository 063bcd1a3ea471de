//! Views of one pixel, of odd sizes, and of changing sizes.

use bevy::asset::{Assets, Handle, RenderAssetUsages};
use bevy::camera::{Exposure, RenderTarget};
use bevy::ecs::entity::Entity;
use bevy::image::Image;
use bevy::math::Vec3;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat, TextureUsages};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{FrugalGi, GiInterleave, GiPixelFraction, GiVisibility, inspect};
use frugal::stage::Stage;
use frugal_tests::{gpu, set};

use crate::gi::{corner, sun};

tests!(any_size_is_gathered_and_a_resize_leaves_no_trace);

fn extent([width, height]: [u32; 2]) -> Extent3d {
    Extent3d { width, height, depth_or_array_layers: 1 }
}

/// Adds a camera next to the stage's own.
fn add_camera(stage: &mut Stage, size: [u32; 2], gi: FrugalGi) -> (Entity, Handle<Image>) {
    let usage = RenderAssetUsages::RENDER_WORLD | RenderAssetUsages::MAIN_WORLD;
    let mut image =
        Image::new_uninit(extent(size), TextureDimension::D2, TextureFormat::Rgba16Float, usage);
    image.texture_descriptor.usage =
        TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING;
    let world = stage.world_mut();
    let image = world.resource_mut::<Assets<Image>>().add(image);
    let transform =
        Transform::from_xyz(0.0, 1.2, 3.0).looking_at(Vec3::new(0.0, 0.8, -2.0), Vec3::Y);
    let camera = world.spawn((
        gi,
        RenderTarget::Image(image.clone().into()),
        Exposure { ev100: 8.0 },
        transform,
    ));
    (camera.id(), image)
}

/// Size and exposed irradiance of a camera's low-resolution image.
fn irradiance(stage: &mut Stage, camera: Entity) -> ([u32; 2], Vec<[f64; 4]>) {
    stage.get_ready().expect("a ready stage");
    let state = inspect::gpu_state(stage.render_world());
    let camera =
        state.cameras.iter().find(|held| held.camera == camera).expect("a camera that gathers");
    let found = gpu::read_halves(stage.render_world(), &camera.irradiance);
    ([camera.irradiance.width(), camera.irradiance.height()], found)
}

fn any_size_is_gathered_and_a_resize_leaves_no_trace() {
    let mut stage = corner(vec![sun(Vec3::new(0.2, -1.0, -0.1))]);
    // The stage's own camera would sample VPLs from the same maps.
    set::apply(&mut stage, "min,gi_refresh_period=1");
    for (interleave, pixel_fraction, visibility, sizes) in [
        (
            GiInterleave::One,
            GiPixelFraction::Full,
            GiVisibility::None,
            &[[1, 1], [1, 40], [7, 5]][..],
        ),
        (
            GiInterleave::Four,
            GiPixelFraction::Sixteenth,
            GiVisibility::Coarse,
            &[[1, 1], [33, 17], [64, 36]][..],
        ),
    ] {
        let gi = FrugalGi {
            vpl_count: 64,
            interleave,
            pixel_fraction,
            visibility,
            rsm_resolution: 64,
            // Patches of further bounces are each camera's own, and drawn anew in time.
            bounces: 1,
            ..Default::default()
        };
        let (cell_width, cell_height) = pixel_fraction.cell();
        let (camera, image) = add_camera(&mut stage, [64, 36], gi.clone());
        irradiance(&mut stage, camera);
        for &size in sizes {
            stage
                .world_mut()
                .resource_mut::<Assets<Image>>()
                .get_mut(&image)
                .expect("a target")
                .resize(extent(size));
            let (gathered, resized) = irradiance(&mut stage, camera);
            assert_eq!(
                gathered,
                [size[0].div_ceil(cell_width), size[1].div_ceil(cell_height)],
                "{size:?}"
            );
            assert!(
                resized.iter().flatten().all(|value| value.is_finite() && *value >= 0.0),
                "{size:?}"
            );
            let lit = resized.iter().filter(|texel| texel[0] > 0.0).count();
            println!(
                "    {pixel_fraction:?} of {size:?}: {lit} of {} low-resolution pixels lit",
                resized.len()
            );
            assert!(lit > 0, "{size:?}");
            // Equal to a camera that always had this size.
            let (fresh, _) = add_camera(&mut stage, size, gi.clone());
            let (_, expected) = irradiance(&mut stage, fresh);
            assert!(resized == expected, "{size:?} differs after a resize");
            assert!(stage.world_mut().despawn(fresh));
        }
        assert!(stage.world_mut().despawn(camera));
    }
}
