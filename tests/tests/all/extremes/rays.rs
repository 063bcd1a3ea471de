//! The gather with rays through the plugin's acceleration structure, against a brute-force
//! intersection of all triangles in 64-bit floats.

use bevy::asset::RenderAssetUsages;
use bevy::color::Color;
use bevy::light::DirectionalLight;
use bevy::math::{DAffine3, DVec3, Quat, Vec3};
use bevy::mesh::{Indices, Mesh, PrimitiveTopology};
use bevy::pbr::StandardMaterial;
use bevy::prelude::AlphaMode;
use bevy::render::render_resource::{Buffer, TextureFormat};
use bevy::transform::components::Transform;
use bevy_frugal_gi::gi::{GiOccluders, inspect};
use frugal::stage::Stage;
use frugal_tests::gather::{Gather, irradiance};
use frugal_tests::gpu::Point;
use frugal_tests::pixels::{Pixels, Plane, g_buffer_normal};
use frugal_tests::{meshes, set};

use super::{Random, Worst, stage};

tests!(
    rays_agree_with_a_brute_force_intersection,
    rays_pass_where_masks_have_holes,
    surfaces_do_not_shadow_themselves,
    a_stratum_of_lights_is_summed_or_rejected,
);

const SIZE: [u32; 2] = [16, 16];
const COUNT: usize = (SIZE[0] * SIZE[1]) as usize;

/// A triangle, and a bit mask of its opaque strips. The eight strips are bounded by barycentric
/// weights of the second corner of 0, 1/8, 2/8 and so on.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [DVec3; 3],
    strips: u8,
}

/// The occluders of a stage on the GPU, and their triangles in the world.
struct Scene {
    stage: Stage,
    triangles: Vec<Triangle>,
}

impl Scene {
    fn new() -> Self {
        Self { stage: stage(), triangles: Vec::new() }
    }

    /// Spawns triangles, given in the mesh's local space.
    fn add(&mut self, corners: &[[Vec3; 3]], transform: Transform) {
        self.add_with(corners, transform, meshes::diffuse(0.5, 0.5, 0.5), u8::MAX);
    }

    /// [`add`](Self::add) with holes between the strips.
    fn add_strips(&mut self, corners: &[[Vec3; 3]], transform: Transform, strips: u8) {
        let texels: Vec<[u8; 4]> = (0..8)
            .map(|strip| [255, 255, 255, if strips >> strip & 1 == 1 { 200 } else { 100 }])
            .collect();
        let texture =
            meshes::texture(&mut self.stage, TextureFormat::Rgba8UnormSrgb, 8, 1, &texels);
        // Multiplied by the material's alpha of 0.75, 200 of 255 is above the cutoff of 0.5, and
        // 100 is below.
        let base_color = Color::linear_rgba(0.5, 0.5, 0.5, 0.75);
        let material = StandardMaterial {
            base_color,
            base_color_texture: Some(texture),
            alpha_mode: AlphaMode::Mask(0.5),
            ..meshes::diffuse(0.5, 0.5, 0.5)
        };
        self.add_with(corners, transform, material, strips);
    }

    fn add_with(
        &mut self,
        corners: &[[Vec3; 3]],
        transform: Transform,
        material: StandardMaterial,
        strips: u8,
    ) {
        let positions: Vec<[f32; 3]> =
            corners.iter().flatten().map(|corner| corner.to_array()).collect();
        let count = positions.len();
        let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
            .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0f32, 1.0, 0.0]; count])
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_attribute(
                Mesh::ATTRIBUTE_UV_0,
                [[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0]].repeat(corners.len()),
            )
            .with_inserted_indices(Indices::U32((0..count as u32).collect()));
        meshes::spawn(&mut self.stage, mesh, material, transform);
        let affine = transform.compute_affine();
        let affine = DAffine3::from_mat3_translation(
            affine.matrix3.as_dmat3(),
            affine.translation.as_dvec3(),
        );
        let in_world = |triangle: &[Vec3; 3]| {
            triangle.map(|corner| affine.transform_point3(corner.as_dvec3()))
        };
        self.triangles.extend(
            corners.iter().map(|triangle| Triangle { corners: in_world(triangle), strips }),
        );
    }

    /// The plugin's buffers of the occluders.
    fn occluders(&mut self) -> [Buffer; 4] {
        // They exist only while there is a light.
        self.stage.world_mut().spawn((DirectionalLight::default(), Transform::default()));
        set::apply(&mut self.stage, "min,gi_refresh_period=1,gi_vpl_count=64,gi_visibility=fine");
        self.stage.get_ready().expect("a ready stage");
        inspect::gpu_state(self.stage.render_world()).occluders.expect("a camera that traces")
    }

    /// VPLs above the floor, for the comparison.
    fn lights() -> Vec<Point> {
        let mut random = Random(29);
        let mut light = || {
            let position = random.inside(Vec3::new(-5.0, 0.5, -5.0), Vec3::new(5.0, 4.0, 5.0));
            let facing = (random.direction() + 1.5 * Vec3::NEG_Y).normalize();
            Point {
                position: position.to_array(),
                normal: facing.to_array(),
                flux: [1e4, 1e3, 1e2],
                extent: 100.0,
            }
        };
        (0..24).map(|_| light()).collect()
    }

    /// The plane of the pixels that the VPLs light.
    fn plane() -> Plane {
        Plane { spacing: 0.75, eye: Vec3::new(0.0, 3.0, 5.0), exposure: 0.1, ..Plane::ORIGIN }
    }

    /// All pairs of a VPL and a pixel that it faces: VPL index, pixel index, position, unoccluded
    /// irradiance, and visibility as by [`is_free`].
    fn pairs(&self) -> impl Iterator<Item = (usize, usize, DVec3, f64, Option<bool>)> {
        let plane = Self::plane();
        let (_, normal) = g_buffer_normal(Vec3::Y);
        let lights = Self::lights();
        (0..lights.len() * COUNT).map(|pair| (pair / COUNT, pair % COUNT)).filter_map(
            move |(light, pixel)| {
                let (vpl, index) = (&lights[light], pixel as u32);
                let at = plane.position(SIZE, index % SIZE[0], index / SIZE[0]);
                let open = irradiance(&[*vpl], at, normal, plane.exposure)[0];
                (open >= 0.01).then(|| {
                    (light, pixel, at, open, is_free(&self.triangles, &plane, [at, normal], vpl))
                })
            },
        )
    }

    /// Number of occluded rays by brute force.
    fn count_occluded(&self) -> usize {
        self.pairs().filter(|(.., free)| *free == Some(false)).count()
    }

    /// Compares the gather with brute force; returns the number of occluded rays.
    fn compare(&mut self, occluders: &[Buffer; 4], label: &str) -> usize {
        let (packed, _) = g_buffer_normal(Vec3::Y);
        let gather = Gather::new(&mut self.stage, 2);
        let pixels = Pixels::new(&self.stage, SIZE, &[packed; COUNT]);
        // One VPL at a time: it is in the first stratum, and the second stratum is empty.
        let run = |vpl: Point| {
            gather.run_with(&self.stage, &pixels, &Self::plane(), &[vpl], Some(occluders))
        };
        let found: Vec<_> = Self::lights().into_iter().map(run).collect();
        let (mut worst, mut rays, mut occluded, mut unclear) = (Worst::default(), 0, 0, 0);
        for (light, pixel, at, open, free) in self.pairs() {
            rays += 1;
            let Some(free) = free else {
                unclear += 1;
                continue;
            };
            occluded += usize::from(!free);
            let found = found[light][pixel][0];
            worst.check(
                &format!("pixel {pixel} at {at}, light {light}"),
                found,
                if free { open } else { 0.0 },
                1e-5 * open,
            );
        }
        println!(
            "    {rays} rays, {occluded} of them occluded, {unclear} too near an edge to decide"
        );
        worst.report(label, 1000);
        assert!(unclear < rays / 50, "{unclear} of {rays}");
        occluded
    }
}

/// Möller and Trumbore 1997, two-sided; degenerate triangles are never hit.
fn intersects(triangle: &Triangle, origin: DVec3, direction: DVec3) -> bool {
    let [a, b, c] = triangle.corners;
    let (ab, ac) = (b - a, c - a);
    let p = direction.cross(ac);
    let determinant = ab.dot(p);
    let offset = origin - a;
    let (u, q) = (offset.dot(p) / determinant, offset.cross(ab));
    let (v, t) = (direction.dot(q) / determinant, ac.dot(q) / determinant);
    u >= 0.0
        && v >= 0.0
        && u + v <= 1.0
        && t > 0.0
        && t < 1.0
        && triangle.strips >> ((u * 8.0) as u32).min(7) & 1 == 1
}

/// Offset of a ray's ends from their surfaces, metres: `surface_offset` of `trace.wgsl`.
fn offset(position: DVec3, plane: &Plane, width: f32) -> f64 {
    5e-4 + 2e-4 * plane.apparent_distance(SIZE[1])
        + 4e-7 * position.abs().max_element()
        + 0.045 * f64::from(width)
}

/// Whether the segment between two surface points is unoccluded; `None` if a shift of 0.01 mm
/// changes the answer.
fn is_free(
    triangles: &[Triangle],
    plane: &Plane,
    [from, normal]: [DVec3; 2],
    vpl: &Point,
) -> Option<bool> {
    let [at, facing] =
        [vpl.position, vpl.normal].map(|vector| DVec3::from_array(vector.map(f64::from)));
    let (origin, end) =
        (from + normal * offset(from, plane, plane.spacing), at + facing * offset(at, plane, 0.0));
    let free = |shift: DVec3, other: DVec3| {
        let (origin, end) = (origin + shift, end + other);
        !triangles.iter().any(|triangle| intersects(triangle, origin, end - origin))
    };
    let straight = free(DVec3::ZERO, DVec3::ZERO);
    let [x, y, z] =
        [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * 1e-5 * from.abs().max_element().max(1.0));
    let shifts = [(x, x), (-x, -x), (y, y), (-y, -y), (z, z), (-z, -z), (x, -x), (y, -y), (z, -z)];
    shifts.iter().all(|(shift, other)| free(*shift, *other) == straight).then_some(straight)
}

/// Triangles of about 2 m in a box, some of them degenerate: points, lines and needles.
fn soup(random: &mut Random, count: usize) -> Vec<[Vec3; 3]> {
    let mut triangle = |index: usize| {
        let center = random.inside(Vec3::new(-6.0, 0.3, -6.0), Vec3::new(6.0, 3.0, 6.0));
        let mut corner = || center + random.direction();
        let [a, b, c] = [corner(), corner(), corner()];
        match index % 8 {
            0 => [a, a, a],
            1 => [a, b, b],
            2 => [a, b, a],
            // A needle of 0.1 mm.
            3 => [a, b, b + (c - b) * 1e-4],
            _ => [a, b, c],
        }
    };
    (0..count).map(&mut triangle).collect()
}

fn rays_agree_with_a_brute_force_intersection() {
    let mut scene = Scene::new();
    let mut random = Random(5);
    scene.add(&soup(&mut random, 40), Transform::default());
    // Rotated, stretched and mirrored; scaled to zero; and far larger in local space.
    let turned = Quat::from_axis_angle(Vec3::new(0.48, 0.6, 0.64), 1.1);
    scene.add(
        &soup(&mut random, 40),
        Transform::from_xyz(0.5, 1.0, -0.5)
            .with_rotation(turned)
            .with_scale(Vec3::new(0.4, -0.3, 0.6)),
    );
    scene.add(&soup(&mut random, 8), Transform::from_xyz(0.0, 1.0, 0.0).with_scale(Vec3::ZERO));
    let large: Vec<_> = soup(&mut random, 24)
        .into_iter()
        .map(|triangle| triangle.map(|corner| corner * 1e4))
        .collect();
    scene.add(&large, Transform::from_scale(Vec3::splat(1e-4)));
    let occluders = scene.occluders();
    // Three of every eight triangles are degenerate. Those of the mesh that is scaled to zero are
    // kept, because its acceleration structure does not depend on the transform.
    let kept = scene.stage.world_mut().resource::<GiOccluders>();
    assert_eq!(
        (kept.triangle_count(), kept.instance_count()),
        (112 / 8 * 5, 3),
        "triangles that occlude nothing are left out"
    );
    let occluded = scene.compare(&occluders, "rays");
    assert!(occluded > 200, "{occluded}");
}

/// Holes that end at the borders of sub-triangles, so that masks of 64 sub-triangles represent them
/// exactly.
fn rays_pass_where_masks_have_holes() {
    let mut scene = Scene::new();
    let mut random = Random(6);
    for strips in [0b1010_0101, 0b0000_0001, 0b1111_1110, 0b0110_0000] {
        scene.add_strips(&soup(&mut random, 24), Transform::from_xyz(0.0, 0.2, 0.0), strips);
    }
    scene.add_strips(&soup(&mut random, 24), Transform::default(), 0);
    // The same mesh with holes and without.
    let small: Vec<_> = soup(&mut random, 16)
        .into_iter()
        .map(|triangle| triangle.map(|corner| corner * 0.3))
        .collect();
    scene.add_strips(
        &small,
        Transform::from_scale(Vec3::new(3.0, -2.0, 3.0)).with_translation(Vec3::Y * 4.0),
        0b0011_0011,
    );
    scene.add(&small, Transform::from_xyz(0.0, 1.0, 0.0));
    let occluders = scene.occluders();
    let kept = scene.stage.world_mut().resource::<GiOccluders>();
    assert_eq!(
        (kept.triangle_count(), kept.instance_count()),
        (128 / 8 * 5, 6),
        "a mesh that is completely transparent is left out"
    );
    let occluded = scene.compare(&occluders, "rays through holes");
    // Without holes, the same triangles would occlude clearly more rays.
    for triangle in &mut scene.triangles {
        triangle.strips = u8::MAX;
    }
    let solid = scene.count_occluded();
    println!("    {occluded} rays occluded; {solid} without holes");
    assert!(occluded > 100 && solid > occluded + 200, "{occluded} {solid}");
}

/// Pixels and VPLs on the triangles that their rays might hit.
fn surfaces_do_not_shadow_themselves() {
    for far in [0.0f32, 1e4] {
        let mut scene = Scene::new();
        let base = Vec3::new(far, 0.0, -far);
        let quad = |a: Vec3, b: Vec3, c: Vec3| [[a, b, c], [c, b, b + c - a]];
        // A floor, and two walls that lean over it: no two of their points that face each other are
        // occluded.
        let floor =
            quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::new(4.0, 0.0, -4.0), Vec3::new(-4.0, 0.0, 4.0));
        let wall =
            quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::new(4.0, 0.0, -4.0), Vec3::new(-4.0, 3.0, -3.5));
        let side =
            quad(Vec3::new(4.0, 0.0, -4.0), Vec3::new(4.0, 0.0, 4.0), Vec3::new(3.5, 3.0, -4.0));
        scene.add(&[floor, wall, side].concat(), Transform::from_translation(base));
        let occluders = scene.occluders();
        let stage = &mut scene.stage;
        let gather = Gather::new(stage, 2);
        let (packed, normal) = g_buffer_normal(Vec3::Y);
        let pixels = Pixels::new(stage, SIZE, &[packed; COUNT]);
        let plane = Plane {
            center: base,
            spacing: 0.5,
            eye: base + Vec3::new(0.0, 2.0, 3.0),
            exposure: 0.1,
        };
        let mut worst = Worst::default();
        let mut random = Random(17);
        for index in 0..16 {
            let [a, b, c] = if index % 2 == 0 { wall[0] } else { side[0] };
            // Away from the intersection of the two walls.
            let (u, v) = (0.1 + 0.7 * random.next(), 0.05 + 0.9 * random.next());
            let facing = (b - a).cross(c - a).normalize();
            let inwards = facing * facing.dot(Vec3::Y - a).signum();
            let position = base + a + u * (b - a) + v * (c - a);
            let vpl = Point {
                position: position.to_array(),
                normal: inwards.to_array(),
                flux: [1e4; 3],
                extent: 1e3,
            };
            for (pixel, found) in
                (0..).zip(gather.run_with(stage, &pixels, &plane, &[vpl], Some(&occluders)))
            {
                let at = plane.position(SIZE, pixel % SIZE[0], pixel / SIZE[0]);
                let open = irradiance(&[vpl], at, normal, plane.exposure)[0];
                // Between the walls, and farther from them than the offset of a ray's start.
                let inside = (at - base.as_dvec3()).abs().max_element() < 3.4;
                if open > 0.01 && inside {
                    worst.check(
                        &format!("{far} m away, light at {position}, pixel {pixel} at {at}"),
                        found[0],
                        open,
                        0.0,
                    );
                }
            }
        }
        worst.report(&format!("{far} m from the origin, no self-shadowing"), 1000);
    }
}

/// One ray to the sampled VPL accepts or rejects the sum of its stratum: the full sum without
/// occluders, zero if all VPLs are occluded.
fn a_stratum_of_lights_is_summed_or_rejected() {
    let mut scene = Scene::new();
    let lid =
        [[Vec3::new(-50.0, 1.0, -50.0), Vec3::new(50.0, 1.0, -50.0), Vec3::new(0.0, 1.0, 90.0)]];
    scene.add(&lid, Transform::default());
    let occluders = scene.occluders();
    let stage = &mut scene.stage;
    let (packed, normal) = g_buffer_normal(Vec3::Y);
    let pixels = Pixels::new(stage, SIZE, &[packed; COUNT]);
    let plane = Plane { spacing: 0.5, eye: Vec3::new(0.0, 0.5, 5.0), ..Plane::ORIGIN };
    let mut random = Random(19);
    for rays in [2, 8] {
        let gather = Gather::new(stage, rays);
        // Fewer VPLs than strata, as many, and more.
        for count in [1, 2, 8, 100] {
            for (height, free) in [(0.2, true), (1.3, false)] {
                let mut light = || {
                    random.inside(Vec3::new(-3.0, height, -3.0), Vec3::new(3.0, height + 0.5, 3.0))
                };
                let vpls: Vec<_> =
                    (0..count).map(|_| super::facing_down(light(), 1000.0, 0.01)).collect();
                let mut worst = Worst::default();
                for (pixel, found) in
                    (0..).zip(gather.run_with(stage, &pixels, &plane, &vpls, Some(&occluders)))
                {
                    let open = irradiance(
                        &vpls,
                        plane.position(SIZE, pixel % SIZE[0], pixel / SIZE[0]),
                        normal,
                        plane.exposure,
                    )[0];
                    worst.check(
                        &format!("{rays} rays, {count} lights at {height} m"),
                        found[0],
                        if free { open } else { 0.0 },
                        0.0,
                    );
                }
                worst.report(
                    &format!(
                        "{rays} rays, {count} lights, {}",
                        if free { "unoccluded" } else { "occluded" }
                    ),
                    if free { 100 } else { 0 },
                );
            }
        }
    }
}
