//! The handful of materials, with textures made by formulas, and meshes whose textures are in metres.

use std::f32::consts::TAU;

use bevy::asset::RenderAssetUsages;
use bevy::image::{ImageAddressMode, ImageFilterMode, ImageSampler, ImageSamplerDescriptor};
use bevy::math::Affine2;
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy::render::render_resource::{Extent3d, TextureDimension, TextureFormat};

/// Texels along the edge of a texture.
const EDGE: u32 = 256;

/// The materials.
pub(crate) struct Surfaces {
    pub(crate) stone: Handle<StandardMaterial>,
    pub(crate) brick: Handle<StandardMaterial>,
    pub(crate) plaster: Handle<StandardMaterial>,
    pub(crate) ochre: Handle<StandardMaterial>,
    pub(crate) planks: Handle<StandardMaterial>,
    pub(crate) dark_wood: Handle<StandardMaterial>,
    pub(crate) tiles: Handle<StandardMaterial>,
    pub(crate) canvas: Handle<StandardMaterial>,
    pub(crate) hull: Handle<StandardMaterial>,
    pub(crate) iron: Handle<StandardMaterial>,
    pub(crate) grass: Handle<StandardMaterial>,
    pub(crate) hills: Handle<StandardMaterial>,
    pub(crate) water: Handle<StandardMaterial>,
    pub(crate) window: Handle<StandardMaterial>,
    pub(crate) bulb: Handle<StandardMaterial>,
}

impl Surfaces {
    pub(crate) fn new(
        materials: &mut Assets<StandardMaterial>,
        images: &mut Assets<Image>,
    ) -> Self {
        let cobbles = images.add(grey(|at| rows(at, 8.0, 6.0, 0.10)));
        let bricks = images.add(grey(|at| rows(at, 12.0, 4.0, 0.07)));
        let boards = images.add(grey(|at| rows(at, 6.0, 1.0, 0.05) * (0.8 + 0.2 * grain(at))));
        let rough = images.add(grey(|at| 0.8 + 0.2 * grain(at)));
        // `period`: metres that a texture covers.
        let mut matte = |colour: Color, texture: &Handle<Image>, period: f32| {
            materials.add(StandardMaterial {
                base_color: colour,
                base_color_texture: Some(texture.clone()),
                uv_transform: Affine2::from_scale(Vec2::splat(period.recip())),
                perceptual_roughness: 0.9,
                reflectance: 0.3,
                ..default()
            })
        };
        let stone = matte(Color::srgb(0.55, 0.53, 0.50), &cobbles, 3.0);
        let brick = matte(Color::srgb(0.56, 0.30, 0.22), &bricks, 2.0);
        let plaster = matte(Color::srgb(0.80, 0.75, 0.66), &rough, 3.0);
        let ochre = matte(Color::srgb(0.72, 0.52, 0.28), &rough, 3.0);
        let planks = matte(Color::srgb(0.52, 0.38, 0.25), &boards, 1.8);
        let dark_wood = matte(Color::srgb(0.26, 0.18, 0.12), &boards, 1.2);
        let tiles = matte(Color::srgb(0.50, 0.22, 0.15), &bricks, 2.5);
        let canvas = matte(Color::srgb(0.82, 0.78, 0.68), &rough, 2.0);
        let hull = matte(Color::srgb(0.10, 0.25, 0.30), &boards, 1.5);
        let iron = matte(Color::srgb(0.12, 0.12, 0.13), &rough, 1.0);
        let grass = matte(Color::srgb(0.20, 0.25, 0.12), &rough, 8.0);
        let hills = matte(Color::srgb(0.16, 0.17, 0.22), &rough, 40.0);
        let ripples = images.add(ripples());
        let water = materials.add(StandardMaterial {
            base_color: Color::srgb(0.02, 0.06, 0.08),
            perceptual_roughness: 0.12,
            reflectance: 0.5,
            normal_map_texture: Some(ripples),
            uv_transform: Affine2::from_scale(Vec2::splat(0.125)),
            ..default()
        });
        let emissive = |nits: Vec3| StandardMaterial {
            base_color: Color::BLACK,
            emissive: LinearRgba::rgb(nits.x, nits.y, nits.z),
            ..default()
        };
        Self {
            window: materials.add(emissive(vec3(120.0, 62.0, 20.0))),
            bulb: materials.add(emissive(vec3(6000.0, 3000.0, 1000.0))),
            stone,
            brick,
            plaster,
            ochre,
            planks,
            dark_wood,
            tiles,
            canvas,
            hull,
            iron,
            grass,
            hills,
            water,
        }
    }
}

/// A mesh whose texture coordinates are metres across its faces.
pub(crate) fn in_metres(mut mesh: Mesh) -> Mesh {
    let (
        Some(VertexAttributeValues::Float32x3(places)),
        Some(VertexAttributeValues::Float32x3(normals)),
    ) = (mesh.attribute(Mesh::ATTRIBUTE_POSITION), mesh.attribute(Mesh::ATTRIBUTE_NORMAL))
    else {
        return mesh;
    };
    let across = |([x, y, z], normal): (&[f32; 3], &[f32; 3])| {
        let normal = Vec3::from_array(*normal).abs();
        if normal.y >= normal.x.max(normal.z) {
            [*x, *z]
        } else if normal.x >= normal.z {
            [*z, -*y]
        } else {
            [*x, -*y]
        }
    };
    let metres: Vec<[f32; 2]> = places.iter().zip(normals).map(across).collect();
    mesh.insert_attribute(Mesh::ATTRIBUTE_UV_0, metres);
    mesh
}

/// The water's plane: `half` its size. Ripples need tangents.
pub(crate) fn water_plane(half: Vec2) -> Mesh {
    let plane = in_metres(Plane3d::new(Vec3::Y, half).mesh().build());
    let count = plane.count_vertices();
    plane.with_inserted_attribute(Mesh::ATTRIBUTE_TANGENT, vec![[1.0f32, 0.0, 0.0, 1.0]; count])
}

/// Smooth noise from 0 to 1, about one hill for each unit.
pub(crate) fn noise(at: Vec2) -> f32 {
    noise_of_period(at, 0xffff)
}

/// Noise that repeats after a power of two, `mask` + 1.
fn noise_of_period(at: Vec2, mask: i32) -> f32 {
    let (cell, inside) = (at.floor(), at - at.floor());
    let smooth = inside * inside * (3.0 - 2.0 * inside);
    let value = |x: i32, y: i32| {
        let (x, y) = ((cell.x as i32 + x) & mask, (cell.y as i32 + y) & mask);
        scramble(x as u32, y as u32)
    };
    let row = |y: i32| value(0, y).lerp(value(1, y), smooth.x);
    row(0).lerp(row(1), smooth.y)
}

/// A number from 0 to 1 that two others pick.
pub(crate) fn scramble(x: u32, y: u32) -> f32 {
    let mixed =
        (x.wrapping_mul(0x9E37_79B1) ^ y.wrapping_mul(0x85EB_CA77)).wrapping_add(0x27D4_EB2F);
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x2C1B_3C6D);
    let mixed = (mixed ^ (mixed >> 12)).wrapping_mul(0x297A_2D39);
    (mixed ^ (mixed >> 15)) as f32 / u32::MAX as f32
}

/// Fine noise over a texture, which repeats.
fn grain(at: Vec2) -> f32 {
    0.5 * noise_of_period(at * 16.0, 15) + 0.5 * noise_of_period(at * 64.0, 63)
}

/// Bricks in rows, each with a shade of its own, and dark joints. `joint`: share of a row's height.
fn rows(at: Vec2, rows: f32, columns: f32, joint: f32) -> f32 {
    let row = (at.y * rows).floor();
    let along = at.x * columns + 0.5 * (row % 2.0);
    let column = along.floor().rem_euclid(columns);
    let height = (at.y * rows - row).min(row + 1.0 - at.y * rows);
    let width = (along.fract()).min(1.0 - along.fract()) * rows / columns;
    if height.min(width) < joint {
        return 0.35;
    }
    0.72 + 0.22 * scramble(row as u32, column as u32) + 0.06 * grain(at)
}

/// A texture of shades, of points from 0 to 1.
fn grey(shade: impl Fn(Vec2) -> f32) -> Image {
    texture(TextureFormat::Rgba8UnormSrgb, |at| Vec3::splat(shade(at)))
}

/// Normals of waves that repeat after a texture.
fn ripples() -> Image {
    // Directions in whole waves across, and steepness.
    const WAVES: [(f32, f32, f32); 6] = [
        (1.0, 2.0, 0.020),
        (-2.0, 3.0, 0.020),
        (4.0, 5.0, 0.020),
        (-3.0, 7.0, 0.018),
        (9.0, 4.0, 0.014),
        (-8.0, 11.0, 0.012),
    ];
    texture(TextureFormat::Rgba8Unorm, |at| {
        let mut slope = Vec2::ZERO;
        for (x, y, steepness) in WAVES {
            let phase = TAU * (x * at.x + y * at.y) + 7.0 * x;
            slope += vec2(x, y).normalize() * steepness * phase.cos();
        }
        0.5 + 0.5 * vec3(-slope.x, -slope.y, 1.0).normalize()
    })
}

/// A texture with all its mip levels.
fn texture(format: TextureFormat, colour: impl Fn(Vec2) -> Vec3) -> Image {
    let at =
        |texel: u32| vec2((texel % EDGE) as f32 + 0.5, (texel / EDGE) as f32 + 0.5) / EDGE as f32;
    let mut level: Vec<Vec3> = (0..EDGE * EDGE).map(|texel| colour(at(texel))).collect();
    let (mut edge, mut data) = (EDGE as usize, Vec::new());
    loop {
        for texel in &level {
            let [red, green, blue] = texel.to_array().map(|value| (value * 255.0).round() as u8);
            data.extend([red, green, blue, 255]);
        }
        if edge == 1 {
            break;
        }
        let half = edge / 2;
        let mean = |texel: usize| {
            let first = texel / half * 2 * edge + texel % half * 2;
            0.25 * (level[first] + level[first + 1] + level[first + edge] + level[first + edge + 1])
        };
        level = (0..half * half).map(mean).collect();
        edge = half;
    }
    let size = Extent3d { width: EDGE, height: EDGE, depth_or_array_layers: 1 };
    let mut image = Image::new_uninit(size, TextureDimension::D2, format, RenderAssetUsages::all());
    image.data = Some(data);
    image.texture_descriptor.mip_level_count = EDGE.ilog2() + 1;
    image.sampler = ImageSampler::Descriptor(ImageSamplerDescriptor {
        address_mode_u: ImageAddressMode::Repeat,
        address_mode_v: ImageAddressMode::Repeat,
        mipmap_filter: ImageFilterMode::Linear,
        ..ImageSamplerDescriptor::linear()
    });
    image
}
